//! Joint states drawn from a seed: inside a model's box, on its corners and edges, where a table's step begins, and
//! anywhere.

use friction_compensation::friction::FrictionParameters;
use friction_compensation::friction::domain::Range;
use friction_compensation::friction::network::{INPUTS, NetworkParameters};
use friction_compensation::friction::regime::{Criterion, Measure};
use friction_compensation::friction::state::{SIGNALS, Signal};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Signals of a state: each of them random in its range, at an end of the trained or of the widened range or one step
/// beside it, or anywhere; in one state of four the first layer of a network or an edge of the physical model is at the
/// start of a table step.
pub fn signals(random: &mut ChaCha8Rng, parameters: &FrictionParameters) -> [i32; SIGNALS] {
    let domain = &parameters.domain;
    let corner = random.random_bool(0.15);
    let mut signals = [0; SIGNALS];
    for ((signal, range), wide) in signals.iter_mut().zip(domain.ranges).zip(domain.widened()) {
        *signal = match if corner { random.random_range(5..7) } else { random.random_range(0..10) } {
            0..5 => within(random, range),
            5 => beside(random, range),
            6 => beside(random, wide),
            7 => within(random, wide),
            8 => [0, 1, -1, i32::MIN, i32::MAX, range.centre()][random.random_range(0..6)],
            _ => random.random(),
        };
    }
    match random.random_range(0..8) {
        0 => to_network_knot(random, parameters, &mut signals),
        1 => to_physical_knot(random, parameters, &mut signals),
        _ => {}
    }
    signals
}

/// [`signals`] and the velocity of a coupled joint. In one state of eight the joint stands; in one of four a
/// criterion's measure is at one of its thresholds, or one step beside it; in one of sixteen a signal is two margins
/// outside of its range, or one step beside that.
pub fn coupled(random: &mut ChaCha8Rng, parameters: &FrictionParameters) -> ([i32; SIGNALS], i32) {
    let mut signals = signals(random, parameters);
    let mut other = match random.random_range(0..4) {
        0 => random.random(),
        1 => [0, 1, -1, i32::MIN, i32::MAX][random.random_range(0..5)],
        _ => within(random, parameters.domain.ranges[Signal::Velocity as usize]),
    };
    match random.random_range(0..16) {
        0..2 => signals[Signal::Velocity as usize] = 0,
        2..6 => to_threshold(random, parameters, &mut signals, &mut other),
        6 => {
            let place = random.random_range(0..SIGNALS);
            let margins = parameters.domain.margin.saturating_mul(2);
            signals[place] = beside(random, parameters.domain.ranges[place].widened(margins));
        }
        _ => {}
    }
    (signals, other)
}

/// Moves what a criterion looks at to one of its thresholds.
fn to_threshold(
    random: &mut ChaCha8Rng,
    parameters: &FrictionParameters,
    signals: &mut [i32; SIGNALS],
    other: &mut i32,
) {
    let criteria = &parameters.selector.criteria;
    let Some(Criterion { measure, enter, leave }) = criteria[random.random_range(0..criteria.len())] else { return };
    let threshold = if random.random() { enter } else { leave };
    let wanted = threshold.saturating_add(random.random_range(-1..=1));
    let way = if random.random() { 1 } else { -1 };
    let velocity = signals[Signal::Velocity as usize];
    match measure {
        Measure::Acceleration => signals[Signal::Acceleration as usize] = wanted.saturating_mul(way),
        Measure::Speed => signals[Signal::Velocity as usize] = wanted.saturating_mul(way),
        Measure::Coupled => *other = velocity.saturating_abs().saturating_sub(wanted).saturating_mul(way),
    }
}

/// Uniform in a range.
pub fn within(random: &mut ChaCha8Rng, range: Range) -> i32 {
    random.random_range(range.low..=range.high)
}

/// Value at an end of a range or one step beside it.
fn beside(random: &mut ChaCha8Rng, range: Range) -> i32 {
    let end = if random.random() { range.low } else { range.high };
    end.saturating_add(random.random_range(-1..=1))
}

/// Moves one signal so that the sum of one neuron of layer 0 is at the start of a step of the tanh table, or beside it.
fn to_network_knot(random: &mut ChaCha8Rng, parameters: &FrictionParameters, signals: &mut [i32; SIGNALS]) {
    let set = random.random_range(0..parameters.selector.sets());
    let Some(NetworkParameters { first, .. }) = parameters.sets[set].network else { return };
    let weights = first[random.random_range(0..first.len())];
    let moved = random.random_range(0..INPUTS);
    let scaled = |i: usize, signal: i32| {
        let range = parameters.domain.ranges[i];
        let centred = signal.clamp(range.low, range.high) as f64 - range.centre() as f64;
        centred / (range.half_width() as f64).max(1.0)
    };
    // In Q25; a weight in Q26 counts half.
    let others: f64 =
        (0..INPUTS).filter(|&i| i != moved).map(|i| weights[i] as f64 / 2.0 * scaled(i, signals[i])).sum();
    let knot = (random.random_range(-256..=256) << 20) as f64;
    let wanted = (knot - others - weights[INPUTS] as f64) / (weights[moved] as f64 / 2.0);
    let range = parameters.domain.ranges[moved];
    let signal = range.centre() as f64 + wanted * range.half_width() as f64;
    if signal.is_finite() {
        signals[moved] = (signal as i32).saturating_add(random.random_range(-1..=1));
    }
}

/// Moves the velocity so that the argument of the Coulomb edge or the Stribeck bump is at the start of a step, or
/// beside it.
fn to_physical_knot(random: &mut ChaCha8Rng, parameters: &FrictionParameters, signals: &mut [i32; SIGNALS]) {
    let set = random.random_range(0..parameters.selector.sets());
    let coefficients = &parameters.sets[set].physical.coefficients;
    // Arguments in Q25 and Q26 of a slope in Q16 and a velocity in Q31.
    let (slope, to_argument) =
        if random.random() { (coefficients.coulomb_slope, 22) } else { (coefficients.stribeck_slope, 21) };
    let knot = (random.random_range(-256..=256) << 20) as f64;
    let shift = parameters.domain.shifts()[Signal::Velocity as usize] as i32;
    let velocity = knot * 2f64.powi(to_argument - shift) / slope as f64;
    if velocity.is_finite() {
        signals[Signal::Velocity as usize] = (velocity as i32).saturating_add(random.random_range(-1..=1));
    }
}
