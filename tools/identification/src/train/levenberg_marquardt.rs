//! The default trainer: Levenberg-Marquardt with early stopping and several seeds; host.
//!
//! After the legged-robot paper, table 3.1 (1000 epochs, gradient threshold 1e-7, mu limit 1e10, mean squared error)
//! and the toolbox defaults it names: training stops when the validation error has not improved for `max_fail` epochs,
//! and the weights of the best epoch are kept. An epoch is an accepted step.

use super::normal_equations::NetworkFit;
use super::weights::{Bounds, nguyen_widrow};
use super::{OnProgress, Recorder, Stop, Task, TrainError, Trained, TrainingSet, best_of_seeds, require};
use crate::levenberg_marquardt::{self as minimiser, Damping, minimise};
use crate::network::{FIRMWARE_HIDDEN, InputBox, Shape};
use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::ops::ControlFlow;

/// Options of what is trained and when it stops.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Neurons of each hidden layer.
    pub hidden: Vec<usize>,
    /// One run each, in parallel; the best on validation wins.
    pub seeds: Vec<u64>,
    /// Limit of epochs.
    pub max_epochs: usize,
    /// Epochs without improvement of the validation error after which training stops.
    ///
    /// The toolbox's 6 ends many runs on a plateau, some before the first improvement: where time allows, ten times
    /// that finds better networks on recorded joints.
    pub max_fail: usize,
    /// Penalty on the sum of squared weights, in units of the normalised mean squared error.
    ///
    /// It keeps directions that no sample determines from growing. Between 0 and 1e-4 its effect on recorded joints is
    /// smaller than that of another seed.
    pub decay: f64,
    /// Bounds of the weights.
    pub bounds: Bounds,
    /// Stop when the largest component of the gradient is below this.
    pub gradient_tolerance: f64,
    /// Stop when an epoch lowers the cost by less than this fraction (0 = never, as in the paper).
    pub cost_tolerance: f64,
    /// Stop when mu exceeds this.
    pub mu_max: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            hidden: FIRMWARE_HIDDEN.to_vec(),
            seeds: (0..4).collect(),
            max_epochs: 1000,
            max_fail: 6,
            decay: 1e-5,
            bounds: Bounds::Firmware,
            gradient_tolerance: 1e-7,
            cost_tolerance: 0.0,
            mu_max: 1e10,
        }
    }
}

/// Trains a network of `input_box` on `train`, stopping and choosing by `validation`.
///
/// Errors name the set, sample or option that is wrong; no input makes it panic.
pub fn train(
    train: &TrainingSet,
    validation: &TrainingSet,
    input_box: &InputBox,
    options: &Options,
    progress: OnProgress,
) -> Result<Trained, TrainError> {
    require(options.decay >= 0.0 && options.decay.is_finite(), "decay", options.decay, "finite and not negative")?;
    require(options.max_fail > 0, "max_fail", options.max_fail as f64, "at least 1")?;
    let task = Task::new(train, validation, input_box, &options.hidden)?;
    let shape = Shape::new(task.train.inputs(), &options.hidden)?;
    best_of_seeds(&options.seeds, |seed| run(&task, &shape, options, seed, progress))
}

fn run(task: &Task, shape: &Shape, options: &Options, seed: u64, progress: OnProgress) -> Result<Trained, TrainError> {
    let fit = NetworkFit::new(shape, &task.train, options.decay);
    let mut recorder = Recorder::new(progress, seed, task.output_scale);
    let start = DVector::from_vec(nguyen_widrow(shape, &mut ChaCha8Rng::seed_from_u64(seed)));
    let mut note = |x: &DVector<f64>, train: f64| {
        recorder.record(x.as_slice(), train, task.validation.mean_squared_error(shape, x.as_slice()));
        match recorder.failures() >= options.max_fail {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    };
    let _ = note(&start, task.train.mean_squared_error(shape, start.as_slice()));
    let solver = minimiser::Options {
        max_iterations: options.max_epochs,
        gradient_tolerance: options.gradient_tolerance,
        cost_tolerance: options.cost_tolerance,
        mu_initial: 1e-3,
        mu_max: options.mu_max,
        damping: Damping::Identity,
        bounds: options.bounds.of_parameters(shape),
    };
    let solution = minimise(&fit, &start, &solver, |_, x, cost| note(x, cost - fit.penalty(x.as_slice())));
    let stop = match solution.stop {
        minimiser::Stop::Caller => Stop::Validation,
        minimiser::Stop::Gradient => Stop::Gradient,
        minimiser::Stop::Cost => Stop::Cost,
        minimiser::Stop::Mu => Stop::Mu,
        minimiser::Stop::Iterations => Stop::Epochs,
    };
    recorder.finish(task, stop)
}
