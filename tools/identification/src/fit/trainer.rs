//! Choice of the trainer, with its seeds, and how it tells its progress.

use super::{FitError, Options};
use crate::network::InputBox;
use crate::page::TrainingCurve;
use crate::progress::Progress;
use crate::train::{self, Trained, TrainingSet, levenberg_marquardt, reference, stochastic};
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

/// Limit of epochs of Levenberg-Marquardt, for the networks that are judged on left-out motions and for the one that is
/// used alike: longer training follows the runs that it has seen further than what was judged.
const EPOCHS: usize = 150;

/// One network to be trained.
pub(super) struct Task<'a> {
    pub train: TrainingSet,
    pub validation: TrainingSet,
    pub input_box: InputBox,
    pub options: &'a Options,
    pub restarts: usize,
    pub progress: &'a dyn Progress,
}

impl Task<'_> {
    fn seeds(&self) -> Vec<u64> {
        (0..self.restarts.max(1) as u64).map(|n| self.options.seed.wrapping_add(n)).collect()
    }

    /// Trains with every seed; the network of the best one. With `quiet` it tells no progress.
    pub fn run(&self, trainer: Trainer, quiet: bool) -> Result<Trained, FitError> {
        let Self { train, validation, input_box, .. } = self;
        let tell = |p: train::Progress| {
            if !quiet {
                self.tell("network", p);
            }
        };
        Ok(match trainer {
            Trainer::LevenbergMarquardt => {
                let options = levenberg_marquardt::Options {
                    seeds: self.seeds(),
                    max_epochs: EPOCHS,
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

    /// Trains the legged-robot paper's network.
    pub fn reference(&self) -> Result<Trained, FitError> {
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

/// The curves of all runs for the report, the chosen one first.
pub(super) fn curves(trained: &Trained) -> impl Iterator<Item = TrainingCurve> {
    let all = std::iter::once((trained.seed, &trained.curve)).chain(trained.others.iter().map(|(seed, c)| (*seed, c)));
    all.map(|(seed, curve)| TrainingCurve {
        seed,
        train: curve.train_mse.clone(),
        validation: curve.validation_mse.clone(),
        best_epoch: curve.best_epoch,
        chosen: seed == trained.seed,
        stop: curve.stop.to_string(),
    })
}
