//! The mobile-robot paper's trainer: stochastic gradient descent with batch normalisation; host.
//!
//! Sections 2.2.3 and 3.1 of that paper: learning rate 0.01, 500 passes over the samples, squared error, batch
//! normalisation before each dense layer. The paper updates after every sample; a single sample has no variance to
//! normalise with, so mini-batches are needed. After each pass the normalisation is folded into the weights inside the
//! firmware's bounds, and the network so obtained is the one whose errors are noted and which is kept.

use super::batch_norm::{BatchNormNetwork, MiniBatch};
use super::weights::{Bounds, uniform};
use super::{OnProgress, Recorder, Stop, Task, TrainError, Trained, TrainingSet, best_of_seeds, require};
use crate::network::{FIRMWARE_HIDDEN, InputBox, Shape};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Options of what is trained and for how long.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Neurons of each hidden layer.
    pub hidden: Vec<usize>,
    /// One run each, in parallel; the best on validation wins.
    pub seeds: Vec<u64>,
    /// Passes over the training samples.
    pub epochs: usize,
    /// Step along the negative gradient.
    pub learning_rate: f64,
    /// Samples in a mini-batch, at least 2.
    pub batch_size: usize,
    /// Bounds of the folded weights.
    pub bounds: Bounds,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            hidden: FIRMWARE_HIDDEN.to_vec(),
            seeds: (0..4).collect(),
            epochs: 500,
            learning_rate: 0.01,
            batch_size: 32,
            bounds: Bounds::Firmware,
        }
    }
}

/// Trains a network of `input_box` on `train` and keeps the epoch that is best on `validation`.
///
/// Errors name the set, sample or option that is wrong; no input makes it panic.
pub fn train(
    train: &TrainingSet,
    validation: &TrainingSet,
    input_box: &InputBox,
    options: &Options,
    progress: OnProgress,
) -> Result<Trained, TrainError> {
    let rate = options.learning_rate;
    require(rate > 0.0 && rate.is_finite(), "learning_rate", rate, "positive and finite")?;
    require(options.batch_size >= 2, "batch_size", options.batch_size as f64, "at least 2")?;
    let task = Task::new(train, validation, input_box, &options.hidden)?;
    let shape = Shape::new(task.train.inputs(), &options.hidden)?;
    best_of_seeds(&options.seeds, |seed| run(&task, &shape, options, seed, progress))
}

fn run(task: &Task, shape: &Shape, options: &Options, seed: u64, progress: OnProgress) -> Result<Trained, TrainError> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut network = BatchNormNetwork::new(shape, uniform(shape, &mut random));
    let mut recorder = Recorder::new(progress, seed, task.output_scale);
    let mut order: Vec<usize> = (0..task.train.len()).collect();
    let batch_size = options.batch_size.min(order.len());
    for epoch in 0..=options.epochs {
        if epoch > 0 {
            order.shuffle(&mut random);
            // An incomplete last batch is left out: shuffled, it holds other samples every time.
            for samples in order.chunks_exact(batch_size) {
                let (_, gradient) = network.loss_and_gradient(&MiniBatch::gather(&task.train, samples));
                network.descend(&gradient, options.learning_rate);
            }
        }
        network.measure_statistics(&task.train, options.bounds);
        let folded = network.fold(options.bounds);
        let error = task.train.mean_squared_error(shape, &folded);
        if !error.is_finite() {
            return recorder.finish(task, Stop::Diverged);
        }
        recorder.record(&folded, error, task.validation.mean_squared_error(shape, &folded));
    }
    recorder.finish(task, Stop::Epochs)
}
