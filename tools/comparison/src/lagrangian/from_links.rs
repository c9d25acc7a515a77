//! Samples of the links of a URDF, from which a model learns before any recording: without friction and rotors; host.

use super::model::{Sample, root_mean_square};
use nalgebra::SVector;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigid_body::Tree;
use rigid_body::newton_euler::inverse_dynamics;

/// Random states, and the efforts that the links take: torques over `gain`. Positions are even over what the samples of
/// a recording reach, and `beyond` more, rad; velocities and accelerations are normal with their RMS.
pub fn samples<const N: usize>(
    links: &Tree,
    gain: &SVector<f64, N>,
    recorded: &[Sample<N>],
    beyond: f64,
    count: usize,
    seed: u64,
) -> Vec<Sample<N>> {
    let reach = |j: usize, begin: f64, further: fn(f64, f64) -> f64| {
        recorded.iter().map(|sample| sample.q[j]).fold(begin, further)
    };
    let low: SVector<f64, N> = SVector::from_fn(|j, _| reach(j, f64::MAX, f64::min) - beyond);
    let high: SVector<f64, N> = SVector::from_fn(|j, _| reach(j, f64::MIN, f64::max) + beyond);
    let rms = |of: fn(&Sample<N>) -> SVector<f64, N>| root_mean_square(recorded.iter().map(of));
    let (speed, acceleration) = (rms(|sample| sample.v), rms(|sample| sample.a));
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut sample = || {
        let q: SVector<f64, N> = SVector::from_fn(|j, _| random.random_range(low[j]..=high[j]));
        let mut normal = |rms: f64| -> f64 {
            let number: f64 = StandardNormal.sample(&mut random);
            rms * number
        };
        let (v, a) = (speed.map(&mut normal), acceleration.map(&mut normal));
        let torques = inverse_dynamics(links, q.as_slice(), v.as_slice(), a.as_slice());
        Sample { q, v, a, effort: SVector::from_fn(|j, _| torques[j] / gain[j]) }
    };
    (0..count).map(|_| sample()).collect()
}
