//! Pipeline from a prepared data set to an image and a report, stage by stage; host.
//!
//! Identification sees the samples for training and validation, training stops by those for validation, choices are
//! made on motions that were left out (`choice`). Test samples are looked at once, at the end, through the image in the
//! firmware's own arithmetic.

mod assemble;
mod coverage;
mod learn;
mod problem;
mod regimes;
mod summary;
mod trainer;
mod uncertainty;
mod uncovered;
mod unseen;

use assemble::build_image;
pub use learn::Learned;
use problem::Problem;
pub use trainer::Trainer;

use crate::augment::Augment;
use crate::certificate_search::search;
use crate::choice::{Decision, TermRule, rank};
use crate::dataset::Prepared;
use crate::dataset::checks::slope;
use crate::dataset::choice_keys::Choice;
use crate::dataset::description::{Gravity as DescribedGravity, RigidDescription};
use crate::evaluate::{Prediction, error_tables, fixed_point_difference};
use crate::friction_parameter::Units;
use crate::identify::{self, Identified, identify};
use crate::joint_model::{firmware_states, fixed_point, regimes, rigid_efforts};
use crate::page::{self, NetworkOutcome, Report, Role};
use crate::presets::Preset;
use crate::progress::Progress;
use crate::rigid::{Given, Gravity, RigidModel, RigidParameters};
use crate::samples::Samples;
use friction_compensation::friction::FrictionParameters;
use friction_compensation::friction::regime::Measure;
use friction_compensation::parameters::certificate::Certificate;
use friction_compensation::parameters::image::Image;
use serde::Serialize;

/// Choices of a fit.
#[derive(Clone, Debug, Serialize)]
pub struct Options {
    /// Physical models that compete: the simplest that no other beats on motions that were left out is used.
    pub presets: Vec<Preset>,
    /// Trainer of the network; None trains none.
    pub trainer: Option<Trainer>,
    /// Networks that are trained from different first weights.
    pub restarts: usize,
    /// Epochs without a lower validation error after which training stops.
    pub patience: usize,
    /// Penalty on squared weights, in units of the normalised mean squared error.
    pub decay: f64,
    /// Seed of everything random.
    pub seed: u64,
    /// Most training samples that a network sees.
    pub samples: usize,
    /// Departure of their selection from natural frequencies towards equal ones, 0 to 1.
    pub equalise: f64,
    /// Copies of training samples.
    #[serde(skip)]
    pub augment: Augment,
    /// Inputs that the network uses: position, velocity, theoretical torque, measured torque, temperature; None:
    /// velocity, and those that pay of position, the theoretical torque where there is gravity, and the
    /// temperature where it varies by 10 K.
    pub inputs: Option<[bool; 5]>,
    /// Decision about the network; `Choose`: as the description of the data set says.
    pub network: Decision,
    /// Decision about lagged accelerations in the rigid part; `Choose`: as the description of the data set says.
    pub lags: Decision,
    /// Terms of the full model that are forced or forbidden, beside those of the description.
    pub terms: Vec<TermRule>,
    /// Least fall of the error on motions that were left out, as a fraction, for which a network is kept.
    pub least_gain: f64,
    /// Criteria of regimes with a network each; none: one network for all.
    #[serde(skip)]
    pub regimes: Vec<Measure>,
    /// Train the legged-robot paper's network too, for comparison.
    pub reference: bool,
    /// Distance beyond the trained box over which the network fades out, in half widths.
    pub margin: f64,
    /// Torque limit of the joint that the image is for, in the effort's unit: a joint takes no image whose friction can
    /// reach more. None: not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_limit: Option<f64>,
    /// Version of the image.
    pub version: u32,
    /// Creation time of the image, s since 1970; 0 = not stated.
    pub created: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            presets: vec![Preset::CoulombViscous, Preset::Full],
            trainer: Some(Trainer::LevenbergMarquardt),
            restarts: 8,
            patience: 20,
            decay: 1e-4,
            seed: 1,
            samples: 12_000,
            equalise: 0.5,
            augment: Augment::default(),
            inputs: None,
            network: Decision::default(),
            lags: Decision::default(),
            terms: vec![],
            least_gain: 0.02,
            regimes: vec![],
            reference: true,
            margin: 0.5,
            torque_limit: None,
            version: 1,
            created: 0,
        }
    }
}

/// Reason for which a fit ended without an image.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// Identification of the physical models.
    #[error("{preset}: {source}")]
    Identify {
        /// The model.
        preset: Preset,
        /// Cause.
        source: identify::IdentifyError,
    },
    /// No physical model was asked for.
    #[error("no physical model is chosen; at least one is needed")]
    NoPreset,
    /// Training of the network.
    #[error(transparent)]
    Train(#[from] crate::train::TrainError),
    /// The model does not fit the image's numbers.
    #[error(transparent)]
    Quantize(#[from] crate::quantize::QuantizeError),
    /// A sample does not fit the firmware's quantities.
    #[error(transparent)]
    State(#[from] crate::joint_model::StateError),
    /// The image would be refused by the joint.
    #[error(
        "the certificate refuses every physical model that was asked for, the last one because {0}; a recording that does not \
         determine a term makes it large: record more positions, speeds and loads, or ask for a model with fewer terms (--preset, \
         --all tries every one)"
    )]
    Refused(friction_compensation::parameters::certificate::Refusal),
    /// The image cannot be written.
    #[error(transparent)]
    Image(#[from] friction_compensation::parameters::image::ImageError),
    /// Judging.
    #[error(transparent)]
    Metrics(#[from] crate::metrics::MetricsError),
}

/// The result of a fit.
#[derive(Debug)]
pub struct Fitted {
    /// The image.
    pub image: Image,
    /// Bounds that are proved of it.
    pub certificate: Certificate,
    /// Rigid part that was identified beside the friction.
    pub rigid: RigidParameters,
    /// Rigid part whose effort is the theoretical torque that the image's terms depend on.
    pub theoretical: RigidParameters,
    /// Report of everything worth knowing, for people.
    pub report: Report,
    /// The effort of every sample as the image and every model beside it predict it, rigid part included.
    pub predictions: Vec<Prediction>,
}

/// Runs the whole pipeline on a prepared data set.
pub fn fit(prepared: &mut Prepared, options: &Options, progress: &dyn Progress) -> Result<Fitted, FitError> {
    let rigid_model = rigid_model(&prepared.description.rigid);
    let units = units(prepared);
    let options = &overruled(options, &prepared.description.choice);
    let samples = &mut prepared.samples;

    let choices = identify::Options {
        units: units.clone(),
        folds: Some(prepared.folds.clone()),
        terms: options.terms.clone(),
        lags: options.lags,
        ..identify::Options::default()
    };
    let identified = identify_all(samples, &rigid_model, &choices, options, progress)?;
    let effort = prepared.description.columns.effort.unit;
    let context = assemble::Context { effort, sha256: &prepared.sha256, options };
    let (chosen, refused) = choose_physical(samples, &identified, &context)?;
    let physical = &identified[chosen];
    let states = firmware_states(samples)?;

    let static_load = rigid_model.gravity != Gravity::None || rigid_model.given != Given::None;
    let inputs = options.inputs.unwrap_or_else(|| learn::inputs(samples, static_load));
    let thresholds = &prepared.thresholds;
    let reference = simplest(&identified).fold_errors();
    let learned = learn::learn(&Problem {
        samples,
        states: &states,
        physical,
        thresholds,
        inputs,
        folds: &prepared.folds,
        reference: &reference,
        options,
        progress,
    })?;

    progress.stage("quantise and certify");
    let built = build_image(samples, physical, &learned, &context)?;
    let learned = built.learned;

    progress.stage("judge");
    let parameters = &built.image.friction;
    let sets = regimes(&parameters.selector, &states, samples);
    let fixed = fixed_point(parameters, &states, &sets, samples);
    let mut predictions = summary::predictions(samples, &identified, chosen, &learned, &sets, &fixed);
    prepared.warnings.extend(slope::check(&physical.friction, &prepared.samples));
    if let Some((name, other)) = prepared.on_other_motion() {
        predictions.push(image_on_other_motion(name, &other, &physical.rigid, parameters)?);
    }
    let samples = &prepared.samples;
    let errors = error_tables(samples, &prepared.test_sets, &predictions)?;
    let difference = fixed_point_difference(&learned.float, &fixed, &sets, samples);
    let worst = search(parameters, 20_000, options.seed);

    let rigid = rigid_efforts(&physical.rigid, samples);
    let report = Report {
        title: format!("Friction of {}", prepared.description.name),
        data_set: prepared.description.name.clone(),
        units: page::Units {
            position: units.position.clone(),
            velocity: format!("{}/s", units.position),
            effort: units.effort.clone(),
        },
        provenance: page::Provenance {
            tool_version: env!("CARGO_PKG_VERSION").to_owned(),
            data_sha256: prepared.sha256.iter().map(|byte| format!("{byte:02x}")).collect(),
            description: prepared.description.name.clone(),
            options: summary::option_list(options),
            seed: options.seed,
            created: if options.created == 0 {
                "creation time not stated".to_owned()
            } else {
                options.created.to_string()
            },
        },
        warnings: prepared.warnings.clone(),
        stages: summary::stages(prepared),
        parameters: physical.parameters.iter().map(summary::parameter).collect(),
        candidates: summary::candidates(&identified, chosen, &refused, &learned),
        choice: summary::choice(&prepared.folds, &identified, chosen, &refused, &learned, options),
        network: learned.outcome.clone(),
        errors,
        fixed_point: Some(difference),
        training: learned.curves.clone(),
        uncertainty: uncertainty::uncertainty(samples, &prepared.folds, physical, &fixed),
        certificate: summary::certificate_items(&built.certificate, &built.image, &worst, &units),
        test: summary::test_samples(prepared, &rigid, physical, &learned, &fixed),
    };
    progress.stage("done");
    let (rigid, theoretical) = (physical.rigid, physical.theoretical);
    Ok(Fitted { image: built.image, certificate: built.certificate, rigid, theoretical, report, predictions })
}

/// The image on another view of the same motion: the difference to its own row is what observer, sampling and noise
/// cost.
///
/// # Errors
/// [`FitError::State`].
pub fn image_on_other_motion(
    name: &str,
    samples: &Samples,
    rigid: &RigidParameters,
    parameters: &FrictionParameters,
) -> Result<Prediction, FitError> {
    let states = firmware_states(samples)?;
    let sets = regimes(&parameters.selector, &states, samples);
    let fixed = fixed_point(parameters, &states, &sets, samples);
    let rigid = rigid_efforts(rigid, samples);
    Ok(Prediction::new(format!("image, {name}"), Role::OtherMotion, &rigid, |i| fixed[i].0 + fixed[i].1))
}

/// Every preset, in the order asked for.
fn identify_all(
    samples: &mut Samples,
    rigid: &RigidModel,
    choices: &identify::Options,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Vec<Identified>, FitError> {
    progress.stage("identify");
    let mut identified = Vec::new();
    for &preset in &options.presets {
        progress.detail(preset.name());
        let one = identify(samples, rigid, preset, choices).map_err(|source| FitError::Identify { preset, source })?;
        identified.push(one);
    }
    if identified.is_empty() { Err(FitError::NoPreset) } else { Ok(identified) }
}

/// The options with what the description of the data set overrules; those of the caller go first.
fn overruled(options: &Options, choice: &Choice) -> Options {
    let mut all = options.clone();
    if all.network == Decision::Choose {
        all.network = choice.network;
    }
    if all.lags == Decision::Choose {
        all.lags = choice.lags;
    }
    let own = |rule: &&TermRule| !options.terms.iter().any(|own| own.term == rule.term);
    all.terms.extend(choice.terms.iter().filter(own));
    all
}

/// The model with the fewest parameters.
fn simplest(identified: &[Identified]) -> &Identified {
    identified.iter().min_by_key(|one| one.parameters.len()).unwrap_or(&identified[0])
}

/// The simplest model that no other beats on motions that were left out, of those that the certificate accepts, and why
/// it refused others.
fn choose_physical(
    samples: &Samples,
    identified: &[Identified],
    context: &assemble::Context,
) -> Result<(usize, Vec<(usize, String)>), FitError> {
    let errors: Vec<Vec<f64>> = identified.iter().map(Identified::fold_errors).collect();
    let parameters: Vec<usize> = identified.iter().map(|one| one.parameters.len()).collect();
    let order = rank(&errors, &parameters);
    let mut refused = Vec::new();
    let mut last = FitError::NoPreset;
    for i in order {
        let alone = Learned::physical(samples, &identified[i], NetworkOutcome::NotTrained);
        match build_image(samples, &identified[i], &alone, context) {
            Ok(_) => return Ok((i, refused)),
            Err(error @ (FitError::Refused(_) | FitError::Quantize(_))) => {
                refused.push((i, error.to_string()));
                last = error;
            }
            Err(error) => return Err(error),
        }
    }
    Err(last)
}

/// The rigid part of the description, as identification knows it.
pub fn rigid_model(description: &RigidDescription) -> RigidModel {
    RigidModel {
        inertia: description.inertia,
        gravity: match description.gravity {
            DescribedGravity::None => Gravity::None,
            DescribedGravity::Sine => Gravity::Sine,
            DescribedGravity::Cosine | DescribedGravity::SineAndCosine => Gravity::SineAndCosine,
        },
        mass_and_length: description.mass_and_length,
        lags: 0,
        given: if description.given { Given::Scaled } else { Given::None },
    }
}

/// Units of the data set.
pub fn units(prepared: &Prepared) -> Units {
    let columns = &prepared.description.columns;
    Units { position: columns.position.unit.symbol().to_owned(), effort: columns.effort.unit.symbol().to_owned() }
}
