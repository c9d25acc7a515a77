//! Training a network on what the physical model leaves, if it pays on motions that were left out.

use super::FitError;
use super::problem::{MINIMUM_SAMPLES, Problem};
use super::regimes::Regimes;
use super::trainer::{Trainer, curves};
use super::uncovered::with_uncovered;
use super::unseen::{self, Verdict};
use crate::augment::augment;
use crate::choice::Decision;
use crate::equalise::{Equalise, draw};
use crate::identify::{Identified, overall};
use crate::joint_model::{FloatFriction, regimes};
use crate::network::{InputBox, Network};
use crate::page::{NetworkOutcome, TrainingCurve};
use crate::samples::{Part, Samples};
use crate::train::TrainError;
use friction_compensation::friction::regime::Selector;

/// A temperature that varies less than this in training is no input, K: over a few kelvins it stands for time.
const TEMPERATURE_RANGE: f64 = 10.0;

/// The friction after training: with networks where they help.
#[derive(Clone, Debug)]
pub struct Learned {
    /// Physical model and networks, in f64.
    pub float: FloatFriction,
    /// Selector of the parameter set that applies.
    pub selector: Selector,
    /// The box that the networks were trained in.
    pub input_box: Option<InputBox>,
    /// Outcome of the network.
    pub outcome: NetworkOutcome,
    /// Error on left-out motions with network, whether kept or not; None where no network was tried.
    pub unseen_rmse: Option<f64>,
    /// Notes on the choice of the network and its inputs.
    pub notes: Vec<String>,
    /// Parameters of the networks.
    pub parameters: usize,
    /// Training curves of every seed.
    pub curves: Vec<TrainingCurve>,
    /// The legged-robot paper's network.
    pub reference: Option<Network>,
}

impl Learned {
    /// The physical model alone.
    pub(super) fn physical(samples: &Samples, physical: &Identified, outcome: NetworkOutcome) -> Self {
        let Regimes { selector, friction } = Regimes::of(&physical.friction, samples);
        Self {
            float: FloatFriction { sets: friction.into_iter().map(|friction| (friction, None)).collect() },
            selector,
            input_box: None,
            outcome,
            unseen_rmse: None,
            notes: vec![],
            parameters: 0,
            curves: vec![],
            reference: None,
        }
    }

    /// The same without networks, for the stated reason.
    pub fn rejected(self, samples: &Samples, physical: &Identified, reason: String) -> Self {
        let Self { float, selector, input_box, outcome, .. } =
            Self::physical(samples, physical, NetworkOutcome::Rejected { reason });
        Self { float, selector, input_box, outcome, ..self }
    }

    /// True where a network is part of the model.
    pub fn has_network(&self) -> bool {
        self.float.sets.iter().any(|(_, network)| network.is_some())
    }
}

/// The inputs that a recording supports: position and velocity; the theoretical torque where gravity makes it more than
/// a multiple of the acceleration, which would let the network fit the recording's delays; the temperature where it
/// varies enough. Never the measured torque: in a recording it is the very effort that is to be predicted.
pub fn inputs(samples: &Samples, static_load: bool) -> [bool; 5] {
    let temperatures = samples.indices(Part::Train).into_iter().map(|i| samples.temperature[i]);
    let (low, high) = temperatures.fold((f64::MAX, f64::MIN), |(low, high), t| (low.min(t), high.max(t)));
    [true, true, static_load, false, high - low >= TEMPERATURE_RANGE]
}

/// Decides on left-out motions whether a network is taken and with which inputs, and trains it.
pub(super) fn learn(problem: &Problem) -> Result<Learned, FitError> {
    let Problem { samples, physical, options, progress, .. } = *problem;
    let alone = |outcome| Ok(Learned::physical(samples, physical, outcome));
    let Some(trainer) = options.trainer.filter(|_| options.network != Decision::Never) else {
        return alone(NetworkOutcome::NotTrained);
    };
    progress.stage("train");
    let pick = Equalise { limit: options.samples, blend: options.equalise, seed: options.seed, ..Equalise::default() };
    let train = draw(samples, Part::Train, &pick);
    // Early stopping needs the validation error's shape, not every sample of it.
    let validation = draw(samples, Part::Validation, &Equalise { blend: 0.0, ..pick });
    if train.len().min(validation.len()) < MINIMUM_SAMPLES {
        let reason = format!(
            "{} training and {} validation samples; {MINIMUM_SAMPLES} of each are needed",
            train.len(),
            validation.len()
        );
        return alone(NetworkOutcome::Rejected { reason });
    }
    let verdict = unseen::judge(problem, trainer, &train, &validation, problem.reference)?;
    let Some(Verdict { inputs, errors, refusal, mut notes }) = verdict else {
        let reason = "the recording is too short for two folds that leave samples out".to_owned();
        return alone(NetworkOutcome::Rejected { reason });
    };
    let unseen_rmse = overall(&errors);
    let kept = options.network == Decision::Keep;
    match &refusal {
        Some(reason) if !kept => {
            let outcome = NetworkOutcome::Rejected { reason: reason.clone() };
            return Ok(Learned { unseen_rmse, notes, ..Learned::physical(samples, physical, outcome) });
        }
        Some(reason) => notes.push(format!("the network is kept by request; the rule refuses it: {reason}")),
        None => {}
    }
    progress.detail(&format!("network of {}", unseen::names(inputs)));
    let learned = train_sets(problem, trainer, &train, &validation, inputs)?;
    Ok(Learned { unseen_rmse, notes, outcome: NetworkOutcome::Kept, ..learned })
}

/// A network for every parameter set that has enough samples of its own.
fn train_sets(
    problem: &Problem,
    trainer: Trainer,
    train: &[usize],
    validation: &[usize],
    inputs: [bool; 5],
) -> Result<Learned, FitError> {
    let Problem { samples, physical, options, progress, .. } = *problem;
    let (low, high) = super::coverage::trained(samples);
    let input_box = InputBox::new(low, high, inputs).map_err(TrainError::from)?;
    let Regimes { selector, friction } = Regimes::by(&physical.friction, samples, &options.regimes, problem.thresholds);
    let sets = regimes(&selector, problem.states, samples);
    let of_set = |indices: &[usize], set: usize| {
        let members: Vec<usize> = indices.iter().copied().filter(|&i| sets[i] == set).collect();
        problem.targets(&members)
    };
    let mut learned = Learned::physical(samples, physical, NetworkOutcome::NotTrained);
    learned.float.sets.clear();
    learned.selector = selector;
    learned.input_box = Some(input_box);
    for (set, friction) in friction.into_iter().enumerate() {
        let (inputs, targets) = of_set(train, set);
        let (inputs, targets) = augment(&inputs, &targets, &options.augment);
        let (checks, checked) = of_set(validation, set);
        if inputs.len().min(checks.len()) < MINIMUM_SAMPLES {
            learned.float.sets.push((friction, None));
            continue;
        }
        let train = with_uncovered(inputs, targets, &input_box, options.seed);
        let validation = with_uncovered(checks, checked, &input_box, options.seed.wrapping_add(1));
        let task = problem.task(train, validation, input_box, options.restarts);
        let trained = task.run(trainer, false)?;
        learned.parameters += trained.network.parameters().len();
        learned.curves.extend(curves(&trained));
        if options.reference && learned.reference.is_none() {
            progress.detail("reference network");
            learned.reference = Some(task.reference()?.network);
        }
        learned.float.sets.push((friction, Some(trained.network)));
    }
    Ok(learned)
}
