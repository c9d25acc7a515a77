//! Identification of a joint: rigid part and physical friction from its train samples; host.
//!
//! 1. The rigid part is identified with viscous and Coulomb friction and an offset. It gets lagged accelerations and a
//!    factor on a given rigid part, where they pay. Its effort is the theoretical torque of every sample
//!    (`Samples::load`), frozen from then on: friction terms that depend on load never see the measured torque.
//! 2. The terms of the chosen preset are identified, jointly with the rigid part once more.
//!
//! Training and validation samples are both used; what is chosen is chosen by folds over motions (`choice`).
//!
//! `observations` checks and thins the samples, `lags` chooses lagged accelerations, `given` a factor (both by
//! `fold_sums`), `layout` maps parameters to the searched vector, `linear` and `nonlinear` fit, `grid` finds where to
//! start, `selection` chooses the terms of `Preset::Full`, `crossed` fits without each fold, `shapes` chooses distances
//! and frequencies, `determined` says which terms the data determine, `estimates` adds standard errors.

mod crossed;
mod determined;
mod estimates;
mod fold_rows;
mod fold_sums;
mod freedom;
mod given;
mod grid;
mod lags;
mod layout;
mod linear;
mod nonlinear;
mod observations;
mod selection;
mod shapes;

pub use crossed::{FoldFit, overall};
pub use estimates::Estimated;
pub use selection::TEMPERATURE_RANGE;

use crate::choice::{Decision, Folds, TermRule, grouping};
use crate::friction_model::{FrictionModel, Term};
use crate::friction_parameter::{FrictionParameter, Units};
use crate::joint_model::{float_state, rigid_efforts, rigid_state};
use crate::presets::Preset;
use crate::rigid::{RigidModel, RigidParameters};
use crate::samples::Samples;
use nonlinear::{Fit, Problem};
use observations::{Limits, Row};

/// Train samples below which nothing is identified.
const MINIMUM_SAMPLES: usize = 200;

/// Choices that the data do not make.
#[derive(Clone, Debug)]
pub struct Options {
    /// Units of the data set, for the units of the parameters.
    pub units: Units,
    /// T_ref, degrees Celsius; None: the mean over the train samples.
    pub reference_temperature: Option<f64>,
    /// k_a; None: sign(a) counts fully from a fifth of the acceleration's root mean square.
    pub hysteresis_acceleration_slope: Option<f64>,
    /// Evenly decimated samples that searches use; the last descent uses all.
    pub search_samples: usize,
    /// Motions that are left out in turn; None: blocks of time.
    pub folds: Option<Folds>,
    /// Decision about lagged accelerations in the rigid part.
    pub lags: Decision,
    /// Terms of `Preset::Full` that are forced or forbidden.
    pub terms: Vec<TermRule>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            units: Units::default(),
            reference_temperature: None,
            hysteresis_acceleration_slope: None,
            search_samples: 8_000,
            folds: None,
            lags: Decision::Choose,
            terms: vec![],
        }
    }
}

/// Reason for which nothing was identified.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IdentifyError {
    /// A column has another length than the others.
    #[error("column {column} has {found} samples, the others have {expected}")]
    Length {
        /// The column.
        column: &'static str,
        /// Its length.
        found: usize,
        /// Length of the others.
        expected: usize,
    },
    /// The rigid part needs a column that the data set does not have.
    #[error("the rigid part needs the column {column}, which the data set does not have")]
    MissingColumn {
        /// The column.
        column: &'static str,
    },
    /// A train or validation sample is not a number.
    #[error("{column} of sample {index} is {value}")]
    NotFinite {
        /// The column.
        column: &'static str,
        /// Index of the sample.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// Too few train samples.
    #[error("{found} train samples; at least {needed} are needed")]
    TooFewSamples {
        /// Number of train samples.
        found: usize,
        /// Least number.
        needed: usize,
    },
    /// The terms of the full model are chosen on samples that are left out, and there are too few for two folds.
    #[error("the full model needs two folds of samples to choose its terms; the {found} samples make {folds}")]
    TooFewFolds {
        /// Number of samples for training and validation.
        found: usize,
        /// Folds that they make.
        folds: usize,
    },
}

/// An identified joint.
#[derive(Clone, Debug)]
pub struct Identified {
    /// Preset that was asked for.
    pub preset: Preset,
    /// Regressors of the rigid part, with the lagged accelerations that were chosen.
    pub rigid_model: RigidModel,
    /// Rigid part, identified together with the friction.
    pub rigid: RigidParameters,
    /// Rigid part whose effort is the theoretical torque in `Samples::load`.
    pub theoretical: RigidParameters,
    /// Friction.
    pub friction: FrictionModel,
    /// All identified parameters, rigid ones first.
    pub parameters: Vec<Estimated>,
    /// Root mean square of effort - rigid - friction over the samples for training and validation.
    pub train_rmse: f64,
    /// The same model fitted without each fold, with its error there.
    pub folds: Vec<FoldFit>,
    /// Notes on what was left out or could not be determined, and why.
    pub notes: Vec<String>,
}

impl Identified {
    /// Error on each fold when it is left out.
    pub fn fold_errors(&self) -> Vec<f64> {
        self.folds.iter().map(|fold| fold.rmse).collect()
    }

    /// Root mean square of the errors on all folds, each left out; the training error where there is no fold.
    pub fn unseen_rmse(&self) -> f64 {
        overall(&self.fold_errors()).unwrap_or(self.train_rmse)
    }

    /// Rigid part of the effort of one sample.
    pub fn rigid_effort(&self, samples: &Samples, index: usize) -> f64 {
        self.rigid.effort(&rigid_state(samples, index))
    }

    /// Friction of one sample, whose load must have been filled in by `identify`.
    pub fn friction(&self, samples: &Samples, index: usize) -> f64 {
        self.friction.friction(&float_state(samples, index))
    }
}

/// Identifies a joint from its train samples and fills in the theoretical torque (`load`) of all samples.
///
/// Samples for training and validation are used alike, test samples not at all.
pub fn identify(
    samples: &mut Samples,
    rigid: &RigidModel,
    preset: Preset,
    options: &Options,
) -> Result<Identified, IdentifyError> {
    let folds = options.folds.clone().unwrap_or_else(|| grouping::of_time(samples));
    let (mut problem, found) = theoretical_torque(samples, rigid, &folds, options)?;
    let rigid = problem.rigid;
    if preset == Preset::Full {
        shapes::choose(&mut problem, samples);
    }
    problem.leave_out(samples, &folds);
    let (fit, folds, mut notes) = match preset.structure(&rigid) {
        Some(structure) => {
            let structure = problem.determined(structure);
            let found = grid::search(&problem, &structure);
            let folds = crossed::crossed(&problem, &found);
            (found.polished(&problem), folds, vec![])
        }
        None if problem.folds.len() < 2 => {
            return Err(IdentifyError::TooFewFolds { found: problem.train.len(), folds: problem.folds.len() });
        }
        None => selection::select(&problem, &rigid, &options.terms, folds.several),
    };
    notes.extend(found);
    let (parameters, undetermined) = estimates::estimates(&fit, problem.train.len(), &options.units);
    if problem.own_part_of_offset < linear::OWN_PART && !fit.friction.terms.contains(Term::Constant) {
        notes.push(format!(
            "no offset: over these positions the rigid part explains all but {:.2} % of it",
            100.0 * problem.own_part_of_offset
        ));
    }
    notes.extend(fit.candidate.notes.iter().cloned());
    notes.extend(undetermined);
    if fit.candidate.structure.holds_rigid() {
        notes.push("the rigid part is held at the theoretical torque: a load slope cannot be told from it".into());
    }
    Ok(Identified {
        preset,
        rigid_model: rigid,
        rigid: fit.rigid,
        theoretical: problem.theoretical,
        train_rmse: fit.at.cost.sqrt(),
        folds,
        friction: fit.friction,
        parameters,
        notes,
    })
}

/// Step 1: the rigid part with viscous and Coulomb friction; fills in the load of all samples. With the problem come
/// the rigid part with the lagged accelerations that were chosen, and what is to be said of them.
fn theoretical_torque(
    samples: &mut Samples,
    rigid: &RigidModel,
    folds: &Folds,
    options: &Options,
) -> Result<(Problem, Vec<String>), IdentifyError> {
    observations::check(samples, rigid)?;
    let train = observations::rows(samples);
    if train.len() < MINIMUM_SAMPLES {
        return Err(IdentifyError::TooFewSamples { found: train.len(), needed: MINIMUM_SAMPLES });
    }
    let mean = |value: fn(&Row) -> f64| train.iter().map(value).sum::<f64>() / train.len() as f64;
    let reference_temperature = options.reference_temperature.unwrap_or_else(|| mean(|row| row.joint.temperature));
    let limits = Limits::of(&train, reference_temperature);
    let template = FrictionModel {
        reference_temperature,
        hysteresis_acceleration_slope: options
            .hysteresis_acceleration_slope
            .unwrap_or(5.0 / limits.acceleration_rms.max(f64::MIN_POSITIVE)),
        ..FrictionModel::default()
    };
    let mut problem = Problem {
        own_part_of_offset: determined::own_part_of_offset(&train, &rigid.regressors()),
        search: observations::decimated(&train, options.search_samples),
        train,
        folds: vec![],
        limits,
        rigid: *rigid,
        theoretical: RigidParameters::default(),
        template,
    };
    let mut notes = vec![];
    if let Some(mut structure) = Preset::CoulombViscous.structure(rigid) {
        if limits.both_lead {
            structure.terms = structure.terms.with(Term::Relief);
        }
        let fitted =
            |problem: &Problem| -> Fit { grid::search(problem, &problem.determined(structure)).polished(problem) };
        let mut first = fitted(&problem);
        let slope = first.friction.parameter(FrictionParameter::CoulombSlope);
        let sums = fold_sums::of(&problem.train, &left_out(samples, folds), folds, slope);
        let (chosen, given) = given::choose(&sums, rigid);
        let (lags, lagged) = lags::choose(&sums, folds, &chosen, options.lags);
        notes.extend(given.into_iter().chain(lagged));
        problem.rigid = RigidModel { lags, ..chosen };
        if problem.rigid != *rigid {
            problem.own_part_of_offset = determined::own_part_of_offset(&problem.train, &chosen.regressors());
            first = fitted(&problem);
        }
        problem.theoretical = first.rigid;
        problem.template.coulomb_slope = first.friction.parameter(FrictionParameter::CoulombSlope);
    }
    samples.load = rigid_efforts(&problem.theoretical, samples);
    for rows in [&mut problem.train, &mut problem.search] {
        rows.iter_mut().for_each(|row| row.joint.load = nonlinear::rigid_effort(&problem.theoretical, row));
    }
    problem.limits = Limits::of(&problem.train, reference_temperature);
    Ok((problem, notes))
}

/// Folds that leave each row out, one bit each.
fn left_out(samples: &Samples, folds: &Folds) -> Vec<u8> {
    observations::used(samples).into_iter().map(|i| folds.left_out[i]).collect()
}

impl Problem {
    /// Fills in the rows of every fold.
    fn leave_out(&mut self, samples: &Samples, folds: &Folds) {
        self.folds = fold_rows::fold_rows(&self.train, &left_out(samples, folds), folds);
    }
}

#[cfg(test)]
mod recovery_tests;
#[cfg(test)]
pub(crate) mod synthetic;
#[cfg(test)]
mod tests;
