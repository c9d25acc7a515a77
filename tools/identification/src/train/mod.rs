//! Training: from normalised samples of what the physical friction model leaves to a network; host.
//!
//! - [`levenberg_marquardt`] the default trainer (legged-robot paper, table 3.1), with early stopping and restarts;
//! - [`stochastic`] gradient descent with batch normalisation (mobile-robot paper, sections 2.2.3 and 3.1);
//! - [`reference`](mod@reference) the legged-robot paper's own network, one hidden layer of 16, to compare with;
//! - [`batch`] the samples in blocks, [`normal_equations`] the hot loop, [`batch_norm`] layers that fold away,
//!   [`weights`] first values and bounds of the weights, `wide_vectors` the hot loops for the processor at hand.
//!
//! Every trainer returns the network of the epoch with the lowest validation error, of the best seed. The same seeds
//! and samples give the same network whatever the number of threads: work is cut into fixed pieces and summed in order.

use crate::network::{INPUT_NAMES, INPUTS, InputBox, Network, NetworkError};
use rayon::prelude::*;
use std::fmt;
use thiserror::Error;

pub mod batch;
pub mod batch_norm;
pub mod levenberg_marquardt;
pub mod normal_equations;
pub mod reference;
pub mod stochastic;
mod tanh;
pub mod weights;
mod wide_vectors;

#[cfg(test)]
mod tests;

/// Samples to learn from: one row of raw inputs, one target and one weight each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainingSet {
    /// Position, velocity, theoretical torque, measured torque, temperature, in SI units.
    pub inputs: Vec<[f64; INPUTS]>,
    /// Friction that the network shall return, Nm.
    pub targets: Vec<f64>,
    /// Relative weight of the sample's squared error, >= 0; a sample of weight 0 does not exist.
    pub weights: Vec<f64>,
}

impl TrainingSet {
    /// Samples that all count the same.
    pub fn unweighted(inputs: Vec<[f64; INPUTS]>, targets: Vec<f64>) -> Self {
        let weights = vec![1.0; targets.len()];
        Self { inputs, targets, weights }
    }

    fn check(&self, set: &'static str) -> Result<(), TrainError> {
        let (inputs, targets, weights) = (self.inputs.len(), self.targets.len(), self.weights.len());
        if inputs != targets || inputs != weights {
            return Err(TrainError::Lengths { set, inputs, targets, weights });
        }
        for (sample, row) in self.inputs.iter().enumerate() {
            if let Some(i) = row.iter().position(|value| !value.is_finite()) {
                return Err(TrainError::NotFinite { set, sample, column: INPUT_NAMES[i], value: row[i] });
            }
            let target = self.targets[sample];
            if !target.is_finite() {
                return Err(TrainError::NotFinite { set, sample, column: "target", value: target });
            }
            let weight = self.weights[sample];
            if !(weight.is_finite() && weight >= 0.0) {
                return Err(TrainError::Weight { set, sample, weight });
            }
        }
        if self.weights.iter().all(|&weight| weight == 0.0) {
            return Err(TrainError::Empty { set });
        }
        Ok(())
    }

    /// Weighted root mean square of the targets, Nm; 1 where all targets are zero, so that it can divide.
    fn target_scale(&self) -> f64 {
        let largest = self.targets.iter().zip(&self.weights).filter(|(_, w)| **w > 0.0);
        let largest = largest.fold(0.0, |m: f64, (t, _)| m.max(t.abs()));
        if largest == 0.0 {
            return 1.0;
        }
        let total: f64 = self.weights.iter().sum();
        let squares = self.targets.iter().zip(&self.weights).map(|(t, w)| w / total * (t / largest).powi(2));
        largest * squares.sum::<f64>().sqrt()
    }
}

/// Reason for which training cannot start.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TrainError {
    /// The columns of a set differ in length.
    #[error("the {set} set has {inputs} rows of inputs, {targets} targets and {weights} weights; they must be as many")]
    Lengths {
        /// `training` or `validation`.
        set: &'static str,
        /// Rows of inputs.
        inputs: usize,
        /// Targets.
        targets: usize,
        /// Weights.
        weights: usize,
    },
    /// A value is infinite or not a number.
    #[error("{column} of sample {sample} of the {set} set is {value}, which is not finite")]
    NotFinite {
        /// `training` or `validation`.
        set: &'static str,
        /// Index of the sample.
        sample: usize,
        /// Name of the value of the sample.
        column: &'static str,
        /// The value.
        value: f64,
    },
    /// A weight is negative or not finite.
    #[error("the weight of sample {sample} of the {set} set is {weight}; it must be finite and not negative")]
    Weight {
        /// `training` or `validation`.
        set: &'static str,
        /// Index of the sample.
        sample: usize,
        /// The weight.
        weight: f64,
    },
    /// No sample counts.
    #[error("the {set} set has no sample of positive weight")]
    Empty {
        /// `training` or `validation`.
        set: &'static str,
    },
    /// An option is outside its range.
    #[error("option `{option}` is {value}; it must be {range}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// Its value.
        value: f64,
        /// Range that is allowed.
        range: &'static str,
    },
    /// The network's shape is impossible.
    #[error(transparent)]
    Network(#[from] NetworkError),
}

/// Reason for the end of training.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The validation error did not improve for the set number of epochs.
    Validation,
    /// The gradient fell below its threshold.
    Gradient,
    /// The training error no longer falls by the set fraction.
    Cost,
    /// No step lowers the training error: mu passed its limit.
    Mu,
    /// The limit of epochs was reached.
    Epochs,
    /// The error grew beyond all numbers: the learning rate is too high for these samples.
    Diverged,
}

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Validation => "validation error no longer improves",
            Self::Gradient => "gradient below its threshold",
            Self::Cost => "training error no longer falls",
            Self::Mu => "mu above its limit",
            Self::Epochs => "epoch limit reached",
            Self::Diverged => "training error diverged",
        })
    }
}

/// The errors of a training run, one value an epoch; entry 0 is the untrained network.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingCurve {
    /// Weighted mean squared error of the training samples, Nm^2.
    pub train_mse: Vec<f64>,
    /// Weighted mean squared error of the validation samples, Nm^2.
    pub validation_mse: Vec<f64>,
    /// Epoch of the lowest validation error, whose network is kept.
    pub best_epoch: usize,
    /// Reason for the end of training.
    pub stop: Stop,
}

/// The result of a training run.
#[derive(Clone, Debug, PartialEq)]
pub struct Trained {
    /// The network of the best epoch.
    pub network: Network,
    /// Curve of its training.
    pub curve: TrainingCurve,
    /// Seed of the run that it came from.
    pub seed: u64,
    /// Seeds and curves of the runs that were worse, in the order of their seeds.
    pub others: Vec<(u64, TrainingCurve)>,
}

impl Trained {
    /// Weighted mean squared error of the kept network on the validation samples, Nm^2.
    pub fn validation_mse(&self) -> f64 {
        self.curve.validation_mse[self.curve.best_epoch]
    }
}

/// One epoch of one run, as it happens. Runs are parallel, so epochs of several seeds arrive interleaved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Seed of the run.
    pub seed: u64,
    /// Epochs done.
    pub epoch: usize,
    /// Weighted mean squared error of the training samples, Nm^2.
    pub train_mse: f64,
    /// Weighted mean squared error of the validation samples, Nm^2.
    pub validation_mse: f64,
}

/// Callback of a trainer after every epoch, from several threads.
pub type OnProgress<'a> = &'a (dyn Fn(Progress) + Sync);

/// Checked and normalised samples of a training run.
struct Task {
    input_box: InputBox,
    hidden: Vec<usize>,
    output_scale: f64,
    train: batch::Batch,
    validation: batch::Batch,
}

impl Task {
    fn new(
        train: &TrainingSet,
        validation: &TrainingSet,
        input_box: &InputBox,
        hidden: &[usize],
    ) -> Result<Self, TrainError> {
        train.check("training")?;
        validation.check("validation")?;
        let output_scale = train.target_scale();
        Ok(Self {
            input_box: *input_box,
            hidden: hidden.to_vec(),
            output_scale,
            train: batch::Batch::new(train, input_box, output_scale),
            validation: batch::Batch::new(validation, input_box, output_scale),
        })
    }

    /// The network of parameters of the active inputs.
    fn network(&self, parameters: &[f64]) -> Result<Network, TrainError> {
        Ok(Network::from_active(&self.hidden, self.input_box, self.output_scale, parameters)?)
    }
}

/// Keeps the curve and the parameters of the best epoch of one run.
struct Recorder<'a> {
    progress: OnProgress<'a>,
    seed: u64,
    /// Factor from normalised squares to Nm^2.
    unit: f64,
    train_mse: Vec<f64>,
    validation_mse: Vec<f64>,
    best_epoch: usize,
    best: Vec<f64>,
}

impl<'a> Recorder<'a> {
    fn new(progress: OnProgress<'a>, seed: u64, output_scale: f64) -> Self {
        let unit = output_scale * output_scale;
        Self { progress, seed, unit, train_mse: vec![], validation_mse: vec![], best_epoch: 0, best: vec![] }
    }

    /// Notes an epoch (the first call: the untrained network) from its normalised errors.
    fn record(&mut self, parameters: &[f64], train: f64, validation: f64) {
        let epoch = self.validation_mse.len();
        let (train_mse, validation_mse) = (train * self.unit, validation * self.unit);
        self.train_mse.push(train_mse);
        self.validation_mse.push(validation_mse);
        if epoch == 0 || validation_mse < self.validation_mse[self.best_epoch] {
            self.best_epoch = epoch;
            self.best = parameters.to_vec();
        }
        (self.progress)(Progress { seed: self.seed, epoch, train_mse, validation_mse });
    }

    /// Epochs since the validation error was lowest.
    fn failures(&self) -> usize {
        self.validation_mse.len() - 1 - self.best_epoch
    }

    fn finish(self, task: &Task, stop: Stop) -> Result<Trained, TrainError> {
        let network = task.network(&self.best)?;
        let Self { train_mse, validation_mse, best_epoch, seed, .. } = self;
        Ok(Trained {
            network,
            curve: TrainingCurve { train_mse, validation_mse, best_epoch, stop },
            seed,
            others: vec![],
        })
    }
}

/// Runs every seed in parallel and keeps the one with the lowest validation error (the earlier one of equals).
fn best_of_seeds(
    seeds: &[u64],
    run: impl Fn(u64) -> Result<Trained, TrainError> + Sync,
) -> Result<Trained, TrainError> {
    let runs = seeds.par_iter().map(|&seed| run(seed)).collect::<Result<Vec<_>, _>>()?;
    let better = |best: &Trained, next: &Trained| next.validation_mse() < best.validation_mse();
    let mut runs = runs.into_iter();
    let none = TrainError::Option { option: "seeds", value: 0.0, range: "a list of at least one seed" };
    let mut best = runs.next().ok_or(none)?;
    let mut others = vec![];
    for mut run in runs {
        if better(&best, &run) {
            std::mem::swap(&mut best, &mut run);
        }
        others.push((run.seed, run.curve));
    }
    others.sort_by_key(|(seed, _)| *seed);
    best.others = others;
    Ok(best)
}

/// Refuses an option outside its range.
fn require(valid: bool, option: &'static str, value: f64, range: &'static str) -> Result<(), TrainError> {
    if valid { Ok(()) } else { Err(TrainError::Option { option, value, range }) }
}
