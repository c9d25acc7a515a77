//! Training a network on what the physical model leaves, and deciding on validation samples whether it stays.

use super::extrapolation;
use super::problem::{MINIMUM_SAMPLES, Problem};
use super::trainer::{Trainer, curves};
use super::{FitError, part_rmse};
use crate::augment::augment;
use crate::classify::Thresholds;
use crate::equalise::{Equalise, draw};
use crate::identify::Identified;
use crate::joint_model::{FloatFriction, regimes};
use crate::network::{InputBox, Network};
use crate::report::{NetworkOutcome, TrainingCurve};
use crate::samples::{Part, Samples};
use crate::train::{TrainError, TrainingSet};
use joint_firmware::friction::regime::{Criterion, MAX_CRITERIA, Measure, Selector};

/// A temperature that varies less than this in training is no input, K: over a few kelvins it stands for time.
const TEMPERATURE_RANGE: f64 = 10.0;
/// Cross-fade between regimes, s.
const FADE_TIME: f64 = 0.02;

/// The friction after training: with networks where they help.
#[derive(Clone, Debug)]
pub struct Learned {
    /// Physical model and networks, in f64.
    pub float: FloatFriction,
    /// Which parameter set applies when.
    pub selector: Selector,
    /// The box that the networks were trained in.
    pub input_box: Option<InputBox>,
    /// What became of the network.
    pub outcome: NetworkOutcome,
    /// Validation error with network, whether kept or not.
    pub validation_rmse: Option<f64>,
    /// Parameters of the networks.
    pub parameters: usize,
    /// Training curves of every seed.
    pub curves: Vec<TrainingCurve>,
    /// The legged-robot paper's network.
    pub reference: Option<Network>,
}

impl Learned {
    /// The physical model alone.
    pub(super) fn physical(physical: &Identified, outcome: NetworkOutcome) -> Self {
        Self {
            float: FloatFriction { sets: vec![(physical.friction.clone(), None)] },
            selector: Selector::default(),
            input_box: None,
            outcome,
            validation_rmse: None,
            parameters: 0,
            curves: vec![],
            reference: None,
        }
    }

    /// The same without networks, for the stated reason.
    pub fn rejected(mut self, reason: String) -> Self {
        self.float.sets.truncate(1);
        self.float.sets.iter_mut().for_each(|(_, network)| *network = None);
        self.selector = Selector::default();
        self.input_box = None;
        self.outcome = NetworkOutcome::Rejected { reason };
        self
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

/// Trains as the options say and keeps the network where it lowers the validation error enough.
pub(super) fn learn(problem: &Problem) -> Result<Learned, FitError> {
    let Problem { samples, physical, options, progress, .. } = *problem;
    let Some(trainer) = options.trainer else { return Ok(Learned::physical(physical, NetworkOutcome::NotTrained)) };
    progress.stage("train");
    let pick = Equalise { limit: options.samples, blend: options.equalise, seed: options.seed, ..Equalise::default() };
    let train = draw(samples, Part::Train, &pick);
    // Early stopping needs the validation error's shape, not every sample of it; the decision below sees them all.
    let validation = draw(samples, Part::Validation, &Equalise { blend: 0.0, ..pick });
    if train.len().min(validation.len()) < MINIMUM_SAMPLES {
        let reason = format!(
            "{} training and {} validation samples; {MINIMUM_SAMPLES} of each are needed",
            train.len(),
            validation.len()
        );
        return Ok(Learned::physical(physical, NetworkOutcome::Rejected { reason }));
    }

    let mut learned = train_sets(problem, trainer, &train, &validation)?;
    decide(&mut learned, problem);
    if learned.has_network() && problem.inputs[LOAD] {
        progress.detail("does the network extrapolate over load?");
        let ratio = extrapolation::error_ratio(problem, trainer, &train, &validation)?;
        if ratio >= 1.0 {
            let percent = 100.0 * (ratio - 1.0);
            let reason = format!(
                "trained without the tenth of the samples with the highest load, it raises the error there by {percent:.1} %"
            );
            learned = learned.rejected(reason);
        }
    }
    Ok(learned)
}

/// A network for every parameter set that has enough samples of its own.
fn train_sets(problem: &Problem, trainer: Trainer, train: &[usize], validation: &[usize]) -> Result<Learned, FitError> {
    let Problem { samples, physical, options, progress, .. } = *problem;
    let (inputs, _) = problem.targets(&samples.indices(Part::Train));
    let input_box = InputBox::around(&inputs, problem.inputs).map_err(TrainError::from)?;
    let selector = selector(&options.regimes, problem.thresholds);
    let sets = regimes(&selector, problem.states, samples);
    let of_set = |indices: &[usize], set: usize| {
        let members: Vec<usize> = indices.iter().copied().filter(|&i| sets[i] == set).collect();
        problem.targets(&members)
    };
    let mut learned = Learned::physical(physical, NetworkOutcome::NotTrained);
    learned.float.sets.clear();
    learned.selector = selector;
    learned.input_box = Some(input_box);
    for set in 0..selector.sets() {
        let (inputs, targets) = of_set(train, set);
        let (inputs, targets) = augment(&inputs, &targets, &options.augment);
        let (checks, checked) = of_set(validation, set);
        if inputs.len().min(checks.len()) < MINIMUM_SAMPLES {
            learned.float.sets.push((physical.friction.clone(), None));
            continue;
        }
        let (train, validation) = (TrainingSet::unweighted(inputs, targets), TrainingSet::unweighted(checks, checked));
        let task = problem.task(train, validation, input_box, options.restarts);
        let trained = task.run(trainer)?;
        learned.parameters += trained.network.parameters().len();
        learned.curves.extend(curves(&trained));
        if options.reference && learned.reference.is_none() {
            progress.detail("reference network");
            learned.reference = Some(task.reference()?.network);
        }
        learned.float.sets.push((physical.friction.clone(), Some(trained.network)));
    }
    Ok(learned)
}

/// Index of the theoretical torque among the inputs.
const LOAD: usize = 2;

/// Keeps the networks only where they pay on validation samples.
fn decide(learned: &mut Learned, problem: &Problem) {
    let Problem { samples, physical, options, .. } = *problem;
    let sets = regimes(&learned.selector, problem.states, samples);
    let rigid = |i: usize| physical.rigid_effort(samples, i);
    let without = part_rmse(samples, Part::Validation, |i| rigid(i) + physical.friction(samples, i));
    let with = part_rmse(samples, Part::Validation, |i| {
        let (friction, network) = learned.float.parts(sets[i], samples, i);
        rigid(i) + friction + network
    });
    learned.validation_rmse = Some(with);
    let gain = 1.0 - with / without;
    if gain >= options.least_gain {
        learned.outcome = NetworkOutcome::Kept;
        return;
    }
    let change =
        format!("{} the validation error by {:.1} %", if gain < 0.0 { "raises" } else { "lowers" }, 100.0 * gain.abs());
    let reason = format!("it {change}; at least {:.1} % less is needed", 100.0 * options.least_gain);
    let physical_only = Learned::physical(physical, NetworkOutcome::NotTrained);
    let whole = std::mem::replace(learned, physical_only);
    *learned = whole.rejected(reason);
}

fn selector(measures: &[Measure], thresholds: &Thresholds) -> Selector {
    let mut criteria = [None; MAX_CRITERIA];
    for (criterion, measure) in criteria.iter_mut().zip(measures) {
        let threshold = match measure {
            Measure::Acceleration => thresholds.acceleration,
            Measure::Speed | Measure::Coupled => thresholds.speed,
        };
        // A tenth of hysteresis either way.
        let bits = |factor: f64| (threshold * factor * 65536.0).clamp(1.0, f64::from(i32::MAX)) as i32;
        *criterion = Some(Criterion { measure: *measure, enter: bits(1.1), leave: bits(0.9) });
    }
    Selector { criteria, fade_time: if measures.is_empty() { 0 } else { (FADE_TIME * 65536.0) as u32 } }
}
