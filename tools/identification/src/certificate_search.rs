//! A search for states that come close to a certificate's bounds: how tight they are, for the report; host.
//!
//! It proves nothing. A bound that is far above what the search finds is loose, one below it would be a defect.

use friction_compensation::friction::domain::Range;
use friction_compensation::friction::state::{JointState, SIGNALS, Signal};
use friction_compensation::friction::{FrictionModel, FrictionParameters};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// The largest values found, in the effort's unit and SI.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// |friction|.
    pub output: f64,
    /// |d(network) / d(measured torque)|.
    pub torque_gain: f64,
    /// |d(friction) / d(velocity)|.
    pub velocity_slope: f64,
}

/// Evaluates every parameter set in `states` states, half of them with each signal at an end of its range, and finite
/// differences around them.
pub fn search(parameters: &FrictionParameters, states: usize, seed: u64) -> Found {
    let model = FrictionModel::new(parameters, 1);
    let ranges = parameters.domain.ranges;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut found = Found::default();
    for n in 0..states {
        let signals: [i32; SIGNALS] = std::array::from_fn(|i| {
            let Range { low, high } = ranges[i];
            match (ranges[i] == Range::ANY, n % 2, random.random_range(0..3u8)) {
                (true, ..) => 0,
                (_, 0, 0) => low,
                (_, 0, 1) => high,
                _ => random.random_range(low..=high),
            }
        });
        // Standstill is where the slope over velocity is steepest.
        let signals = if n % 4 == 3 { with(signals, Signal::Velocity, 0) } else { signals };
        for set in 0..parameters.selector.sets() {
            let at = |signals| model.evaluate(set, &JointState::from_signals(signals));
            let here = at(signals);
            found.output = found.output.max(here.total().to_f64().abs());
            let difference = |signal: Signal, value: fn(friction_compensation::friction::Estimate) -> f64| {
                let Range { low, high } = ranges[signal as usize];
                if low == high || ranges[signal as usize] == Range::ANY {
                    return 0.0;
                }
                // A step of a hundredth of the range, smaller at standstill: large against the staircase, small against
                // the curve.
                let width = (high as i64 - low as i64) as i32 / if n % 4 == 3 { 1000 } else { 100 };
                let from = signals[signal as usize].min(high - width);
                let (a, b) = (at(with(signals, signal, from)), at(with(signals, signal, from + width)));
                ((value(b) - value(a)) / (f64::from(width.max(1)) / 65536.0)).abs()
            };
            let torque_gain = difference(Signal::MeasuredTorque, |estimate| estimate.network.to_f64());
            let velocity_slope = difference(Signal::Velocity, |estimate| estimate.total().to_f64());
            found.torque_gain = found.torque_gain.max(torque_gain);
            found.velocity_slope = found.velocity_slope.max(velocity_slope);
        }
    }
    found
}

fn with(mut signals: [i32; SIGNALS], signal: Signal, value: i32) -> [i32; SIGNALS] {
    signals[signal as usize] = value;
    signals
}
