//! The legged-robot paper's network, to compare with: one hidden layer of 16 tanh neurons; host, floating point only.
//!
//! Section 3.2 and table 3.1 of that paper: a single-layer net with 16 neurons, trained by Levenberg-Marquardt with the
//! defaults of a numerical toolbox (no penalty on the weights, no bounds). The firmware cannot run it; reports show
//! what its extra width would have brought.

use super::levenberg_marquardt::Options;
use super::weights::Bounds;

/// Neurons of the one hidden layer.
pub const HIDDEN: usize = 16;

/// Options that make [`super::levenberg_marquardt::train`] the paper's trainer, for the runs `seeds`.
pub fn options(seeds: Vec<u64>) -> Options {
    Options { hidden: vec![HIDDEN], seeds, max_fail: 6, decay: 0.0, bounds: Bounds::None, ..Options::default() }
}
