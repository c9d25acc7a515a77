//! Training a network on what the physical model leaves, and deciding on validation samples whether it stays.

use super::{FitError, Options, part_rmse};
use crate::augment::augment;
use crate::classify::Thresholds;
use crate::equalise::{Equalise, draw};
use crate::evaluate::rmse;
use crate::identify::Identified;
use crate::joint_model::{FloatFriction, network_inputs, regimes};
use crate::network::{InputBox, Network};
use crate::progress::Progress;
use crate::report::{NetworkOutcome, TrainingCurve};
use crate::samples::{Part, Samples};
use crate::train::{self, Trained, TrainingSet, levenberg_marquardt, reference, stochastic};
use joint_firmware::friction::regime::{Criterion, MAX_CRITERIA, Measure, Selector};
use joint_firmware::friction::state::JointState;
use serde::{Deserialize, Serialize};

/// A way to train.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Trainer {
    /// The legged-robot paper's: Levenberg-Marquardt, up to 1000 epochs.
    LevenbergMarquardt,
    /// The mobile-robot paper's: stochastic gradient descent with batch normalisation, 500 epochs.
    StochasticGradient,
}

/// Least number of training samples, and of validation samples, with which a network is trained.
const MINIMUM_SAMPLES: usize = 300;
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
    /// Training curves.
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

/// Trains on `used` inputs as the options say and keeps the network where it lowers the validation error enough.
pub fn learn(
    samples: &Samples,
    states: &[JointState],
    physical: &Identified,
    thresholds: &Thresholds,
    used: [bool; 5],
    options: &Options,
    progress: &dyn Progress,
) -> Result<Learned, FitError> {
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
    let inputs: Vec<_> = samples.indices(Part::Train).into_iter().map(|i| network_inputs(samples, i)).collect();
    let input_box = InputBox::around(&inputs, used).map_err(crate::train::TrainError::from)?;
    let selector = selector(&options.regimes, thresholds);
    let sets = regimes(&selector, states, samples);
    let residual = |i: usize| samples.effort[i] - physical.rigid_effort(samples, i) - physical.friction(samples, i);
    let set_of = |indices: &[usize], set: usize| {
        let members: Vec<usize> = indices.iter().copied().filter(|&i| sets[i] == set).collect();
        let inputs: Vec<_> = members.iter().map(|&i| network_inputs(samples, i)).collect();
        let targets: Vec<_> = members.iter().map(|&i| residual(i)).collect();
        (inputs, targets)
    };

    let mut learned = Learned::physical(physical, NetworkOutcome::NotTrained);
    learned.float.sets.clear();
    learned.selector = selector;
    learned.input_box = Some(input_box);
    for set in 0..selector.sets() {
        let (inputs, targets) = set_of(&train, set);
        let (inputs, targets) = augment(&inputs, &targets, &options.augment);
        let (checks, checked) = set_of(&validation, set);
        if inputs.len().min(checks.len()) < MINIMUM_SAMPLES {
            learned.float.sets.push((physical.friction.clone(), None));
            continue;
        }
        let task = Task {
            train: TrainingSet::unweighted(inputs, targets),
            validation: TrainingSet::unweighted(checks, checked),
            input_box,
            options,
            restarts: options.restarts,
            progress,
        };
        let trained = task.run(trainer)?;
        learned.parameters += trained.network.parameters().len();
        learned.curves.push(curve(&trained));
        if options.reference && learned.reference.is_none() {
            progress.detail("reference network");
            learned.reference = Some(task.reference()?.network);
        }
        learned.float.sets.push((physical.friction.clone(), Some(trained.network)));
    }
    decide(&mut learned, samples, physical, &sets, options);
    if learned.has_network() && used[LOAD] {
        progress.detail("does the network extrapolate over load?");
        let ratio = extrapolation(samples, physical, &train, &validation, used, trainer, options, progress)?;
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

/// Index of the theoretical torque among the inputs.
const LOAD: usize = 2;
/// Share of the samples with the highest |theoretical torque| that the check of extrapolation holds back.
const HELD_BACK: f64 = 0.1;

/// Error with a network over error without, on loads above all that the network was trained with.
///
/// Recorded trajectories repeat themselves: a network that has learned them by heart does well on any block of time cut from
/// them. On loads that it has not seen it does not.
#[expect(clippy::too_many_arguments, reason = "the same task as that of `learn`, on other samples")]
fn extrapolation(
    samples: &Samples,
    physical: &Identified,
    train: &[usize],
    validation: &[usize],
    used: [bool; 5],
    trainer: Trainer,
    options: &Options,
    progress: &dyn Progress,
) -> Result<f64, FitError> {
    let mut loads: Vec<f64> = train.iter().map(|&i| samples.load[i].abs()).collect();
    loads.sort_by(f64::total_cmp);
    let limit = loads[((loads.len() - 1) as f64 * (1.0 - HELD_BACK)) as usize];
    let (low, high): (Vec<usize>, Vec<usize>) = train.iter().partition(|&&i| samples.load[i].abs() <= limit);
    let (low_checks, high_checks): (Vec<usize>, Vec<usize>) =
        validation.iter().partition(|&&i| samples.load[i].abs() <= limit);
    let residual = |i: usize| samples.effort[i] - physical.rigid_effort(samples, i) - physical.friction(samples, i);
    let set = |indices: &[usize]| {
        let inputs: Vec<_> = indices.iter().map(|&i| network_inputs(samples, i)).collect();
        TrainingSet::unweighted(inputs, indices.iter().map(|&i| residual(i)).collect())
    };
    if low.len().min(low_checks.len()) < MINIMUM_SAMPLES || high.is_empty() {
        return Ok(0.0);
    }
    let (train, validation) = (set(&low), set(&low_checks));
    let input_box = InputBox::around(&train.inputs, used).map_err(crate::train::TrainError::from)?;
    // Half the restarts: the question is whether such a network extrapolates, not which is best.
    let restarts = options.restarts.div_ceil(2);
    let network = Task { train, validation, input_box, options, restarts, progress }.run(trainer)?.network;
    let judged: Vec<usize> = high.into_iter().chain(high_checks).collect();
    let without = rmse(judged.iter().map(|&i| residual(i)));
    let with = rmse(judged.iter().map(|&i| residual(i) - network.evaluate(&network_inputs(samples, i))));
    Ok(with / without)
}

/// Keeps the networks only where they pay on validation samples.
fn decide(learned: &mut Learned, samples: &Samples, physical: &Identified, sets: &[usize], options: &Options) {
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

/// One network to be trained.
struct Task<'a> {
    train: TrainingSet,
    validation: TrainingSet,
    input_box: InputBox,
    options: &'a Options,
    restarts: usize,
    progress: &'a dyn Progress,
}

impl Task<'_> {
    fn seeds(&self) -> Vec<u64> {
        (0..self.restarts.max(1) as u64).map(|n| self.options.seed.wrapping_add(n)).collect()
    }

    fn run(&self, trainer: Trainer) -> Result<Trained, FitError> {
        let Self { train, validation, input_box, .. } = self;
        let tell = |p: train::Progress| self.tell("network", p);
        Ok(match trainer {
            Trainer::LevenbergMarquardt => {
                let options = levenberg_marquardt::Options {
                    seeds: self.seeds(),
                    max_fail: self.options.patience.max(1),
                    decay: self.options.decay,
                    ..Default::default()
                };
                levenberg_marquardt::train(train, validation, input_box, &options, &tell)?
            }
            Trainer::StochasticGradient => {
                let options = stochastic::Options { seeds: self.seeds(), ..Default::default() };
                stochastic::train(train, validation, input_box, &options, &tell)?
            }
        })
    }

    fn reference(&self) -> Result<Trained, FitError> {
        let options = reference::options(vec![self.options.seed]);
        let tell = |p: train::Progress| self.tell("reference network", p);
        Ok(levenberg_marquardt::train(&self.train, &self.validation, &self.input_box, &options, &tell)?)
    }

    fn tell(&self, what: &str, p: train::Progress) {
        let (seed, epoch, train, validation) = (p.seed, p.epoch, p.train_mse.sqrt(), p.validation_mse.sqrt());
        self.progress
            .detail(&format!("{what}, seed {seed}, epoch {epoch}: {train:.4} training, {validation:.4} validation"));
    }
}

fn curve(trained: &Trained) -> TrainingCurve {
    TrainingCurve {
        seed: trained.seed,
        train: trained.curve.train_mse.clone(),
        validation: trained.curve.validation_mse.clone(),
        best_epoch: trained.curve.best_epoch,
        chosen: true,
        stop: trained.curve.stop.to_string(),
    }
}
