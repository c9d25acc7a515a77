//! Randomness from a seed: ChaCha8, whose values stay the same across versions and platforms.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// One stream of random numbers.
#[derive(Clone, Debug)]
pub(crate) struct Noise(ChaCha8Rng);

impl Noise {
    /// Streams of one seed are independent of each other.
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Self(generator)
    }

    /// Mean 0, standard deviation 1.
    pub(crate) fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Uniform in `[minimum, maximum)`.
    pub(crate) fn uniform(&mut self, minimum: f64, maximum: f64) -> f64 {
        minimum + (maximum - minimum) * self.0.random::<f64>()
    }

    /// Uniform in the logarithm, for scales: each decade of `[minimum, maximum)` is equally likely.
    pub(crate) fn scale(&mut self, minimum: f64, maximum: f64) -> f64 {
        minimum * libm::pow(maximum / minimum, self.0.random::<f64>())
    }
}
