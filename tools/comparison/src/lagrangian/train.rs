//! Training of a model by Adam (D. Kingma, J. Ba, 2015) with decoupled weight decay (I. Loshchilov, F. Hutter, 2019)
//! and early stopping; host.

use super::model::{Learned, Model, Rule, Sample, root_mean_square};
use nalgebra::SVector;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Samples whose efforts are computed at once.
const CHUNK: usize = 256;
/// Decay of Adam's mean of the gradient, and of its square.
const MOMENTS: [f64; 2] = [0.9, 0.999];

/// Choices of a training.
#[derive(Clone, Debug)]
pub struct Training {
    /// Passes over the samples.
    pub epochs: usize,
    /// Samples of a step.
    pub batch: usize,
    /// Learning rate at the begin; it falls to 0 along half a cosine.
    pub rate: f64,
    /// Weights that are changed.
    pub learned: Learned,
    /// Weight decay of the networks, inertia and potential energy: part of a weight, or of its distance from what it
    /// was, that a step at rate 1 takes away.
    pub decay: [f64; 2],
    /// Epochs from one validation to the next.
    pub every: usize,
    /// Seed of the order of samples.
    pub seed: u64,
}

/// Outcome of a training.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Epoch of the weights that were kept.
    pub epoch: usize,
    /// Weighted error on the validation samples at that epoch.
    pub validation: f64,
}

/// Importance of each joint's squared errors: its effort's RMS to a negative power; 2 makes all joints alike.
pub fn importance<const N: usize>(samples: &[Sample<N>], power: f64) -> SVector<f64, N> {
    root_mean_square(samples.iter().map(|sample| sample.effort)).map(|rms| rms.powf(-power))
}

/// Mean square of each joint's error.
pub fn mean_square<const N: usize>(model: &Model<N>, samples: &[Sample<N>]) -> SVector<f64, N> {
    let mut sum = SVector::zeros();
    for chunk in samples.chunks(CHUNK) {
        for (sample, effort) in chunk.iter().zip(model.efforts(chunk)) {
            sum += (effort - sample.effort).map(|error| error * error);
        }
    }
    sum / samples.len().max(1) as f64
}

impl Training {
    /// Trains a model, and keeps the weights that are best on the validation samples.
    pub fn run<const N: usize>(
        &self,
        model: &mut Model<N>,
        samples: &[Sample<N>],
        validation: &[Sample<N>],
        importance: &SVector<f64, N>,
    ) -> Outcome {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut order: Vec<usize> = (0..samples.len()).collect();
        let mut moments = vec![[0.0; 2]; model.weights.len()];
        let rules = model.rules(self.learned, self.decay);
        let begin = match self.learned {
            Learned::All => vec![0.0; model.weights.len()],
            Learned::Outputs => model.weights.clone(),
        };
        let (mut step, mut best) = (0, model.weights.clone());
        let mut outcome = Outcome { epoch: 0, validation: mean_square(model, validation).dot(importance) };
        let steps = self.epochs * samples.len().div_ceil(self.batch);
        for epoch in 1..=self.epochs {
            order.shuffle(&mut random);
            for batch in order.chunks(self.batch) {
                let batch: Vec<Sample<N>> = batch.iter().map(|&i| samples[i]).collect();
                let mut gradient = vec![0.0; model.weights.len()];
                model.error(&batch, importance, &mut gradient);
                let rate = 0.5 * self.rate * (1.0 + (std::f64::consts::PI * step as f64 / steps as f64).cos());
                step += 1;
                adam(model, &gradient, &mut moments, (&rules, &begin), step, rate);
                model.bound_rotors();
            }
            if epoch % self.every == 0 || epoch == self.epochs {
                let error = mean_square(model, validation).dot(importance);
                if error < outcome.validation {
                    outcome = Outcome { epoch, validation: error };
                    best.clone_from(&model.weights);
                }
            }
        }
        model.weights = best;
        outcome
    }
}

/// One step of Adam on the weights that are learned; they decay to `begin`.
fn adam<const N: usize>(
    model: &mut Model<N>,
    gradient: &[f64],
    moments: &mut [[f64; 2]],
    (rules, begin): (&[Rule], &[f64]),
    step: i32,
    rate: f64,
) {
    let corrections = MOMENTS.map(|decay| 1.0 - decay.powi(step));
    for (i, (weight, moment)) in model.weights.iter_mut().zip(moments).enumerate().filter(|(i, _)| rules[*i].learned) {
        moment[0] += (1.0 - MOMENTS[0]) * (gradient[i] - moment[0]);
        moment[1] += (1.0 - MOMENTS[1]) * (gradient[i] * gradient[i] - moment[1]);
        let [mean, square] = [moment[0] / corrections[0], moment[1] / corrections[1]];
        *weight -= rate * (mean / (square.sqrt() + 1e-8) + rules[i].decay * (*weight - begin[i]));
    }
}
