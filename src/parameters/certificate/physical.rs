//! Bounds of the physical model: torque and slope over velocity, for every state in the widened box.

use super::bisect;
use super::interval::Interval;
use crate::dsp::{narrow, saturate};
use crate::friction::physical::{Directional, Physical, Terms, times};
use crate::friction::smooth::{STRIBECK, TANH, atan, stribeck, tanh};
use crate::friction::state::{SIGNALS, Signal};

/// What holds of the physical model in the whole widened box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Q16.16.
    pub(super) torque: Interval,
    /// Slope over velocity, Q16.16 per full scale.
    pub(super) slope: Interval,
    /// How far the fixed-point model departs from the smooth one whose slope is bounded, Q16.16.
    pub(super) resolution: u32,
}

/// What holds in one cell: the sum of products with 47 fraction bits, and the slope.
#[derive(Clone, Copy)]
struct CellBounds {
    sum: Interval,
    slope: Interval,
}

/// One, Q16.16.
const ONE: Interval = Interval::point(1 << 16);

/// Bounds, or nothing where the sum could leave the range of a torque.
pub(super) fn bounds(physical: &Physical) -> Option<Bounds> {
    let box_ = scaled_box(physical);
    if !harmonics_fit(physical) {
        return None;
    }
    let velocity = box_[Signal::Velocity as usize];
    let found = bisect(
        velocity,
        &|cell: &Interval| cell_bounds(physical, &box_, *cell),
        &|a, b| CellBounds { sum: a.sum.union(b.sum), slope: a.slope.union(b.slope) },
        &|found, new| found.sum.contains(new.sum) && found.slope.contains(new.slope),
        &|cell: &Interval| {
            let middle = (cell.low + cell.high) >> 1;
            let halves = (Interval { low: cell.low, high: middle }, Interval { low: middle, high: cell.high });
            (cell.high - cell.low > 1).then_some(halves)
        },
    );
    // Partial sums may wrap and come back; the whole sum must fit, and its rounding too.
    let fits = Interval::symmetric((1 << 62) - (1 << 31));
    fits.contains(found.sum).then(|| Bounds {
        torque: found.sum.map(|sum| narrow(sum) as i64),
        slope: found.slope,
        resolution: resolution(physical),
    })
}

/// The widened box in Q31 of full scale.
fn scaled_box(physical: &Physical) -> [Interval; SIGNALS] {
    let low = physical.scale(&physical.ranges.map(|range| range.low));
    let high = physical.scale(&physical.ranges.map(|range| range.high));
    let mut scaled = [Interval::ZERO; SIGNALS];
    for (place, (low, high)) in scaled.iter_mut().zip(low.into_iter().zip(high)) {
        *place = Interval { low: low as i64, high: high as i64 };
    }
    scaled
}

/// Whether the harmonics' own sums stay in 64 bits.
fn harmonics_fit(physical: &Physical) -> bool {
    let total = |amplitudes: &[i32]| amplitudes.iter().map(|a| (*a as i64).abs()).sum::<i64>();
    total(&physical.harmonic_mean) < 1 << 31 && total(&physical.harmonic_difference) < 1 << 31
}

/// The values of a directional pair that a velocity interval can select.
fn level(pair: Directional, velocity: Interval) -> Interval {
    let (positive, negative) = (Interval::point(pair.positive as i64), Interval::point(pair.negative as i64));
    match (velocity.low < 0, velocity.high >= 0) {
        (true, true) => positive.union(negative),
        (true, false) => negative,
        _ => positive,
    }
}

/// `times` over intervals: monotone in both operands, so its corners bound it.
fn rounded_times(a: Interval, b: Interval) -> Interval {
    let corner = |x: i64, y: i64| times(saturate(x), saturate(y)) as i64;
    Interval::between(corner(a.low, b.low), corner(a.high, b.high))
        .union(Interval::between(corner(a.low, b.high), corner(a.high, b.low)))
}

fn cell_bounds(physical: &Physical, box_: &[Interval; SIGNALS], v: Interval) -> CellBounds {
    let [q, _, load, _, th, a] = *box_;
    let c = &physical.coefficients;
    let product = |coefficient: i32, signal: Interval| signal.times(Interval::point(coefficient as i64));
    let factor_part = |coefficient: i32, signal: Interval| product(coefficient, signal).map(|p| narrow(p) as i64);
    let clip = |i: Interval| i.map(|value| saturate(value) as i64);

    let mut sum = Interval::point((c.constant as i64) << 31)
        .add(product(c.position, q))
        .add(product(c.temperature, th))
        .add(product(c.load, load))
        .add(product(c.rotor_inertia, a));

    let viscous_factor = clip(ONE.add(factor_part(c.viscous_temperature, th)));
    let viscous = rounded_times(Interval::point(c.viscous as i64), viscous_factor);
    sum = sum.add(viscous.times(v));
    let mut slope = viscous;

    let speed = v.abs();
    sum =
        sum.add(product(c.quadratic, v.map(|v| saturate((v * v.saturating_abs().min(i32::MAX as i64)) >> 31) as i64)));
    slope = slope.add(product(c.quadratic, speed).shift_right(30));

    let argument = product(c.coulomb_slope, v).map(|p| saturate(p >> 22) as i64);
    let direction = argument.map(|x| tanh(x as i32) as i64);
    let coulomb_factor =
        clip(clip(ONE.add(factor_part(c.coulomb_temperature, th))).add(factor_part(c.coulomb_load, load.abs())));
    let coulomb = rounded_times(level(physical.coulomb, v), coulomb_factor);
    sum = sum.add(coulomb.times(direction));
    // Slope of the direction over full-scale velocity, Q16: table slope Q14 times 1 / v_c in Q16.
    let edge = tanh_slopes(argument).times(Interval::point(c.coulomb_slope as i64)).shift_right(14);
    slope = slope.add(coulomb.times(edge).shift_right(16));

    if physical.terms.contains(Terms::STRIBECK) {
        let u = product(c.stribeck_slope, v).map(|p| saturate(p >> 21) as i64);
        let amplitude = level(physical.stribeck, v);
        sum = sum.add(amplitude.times(stribeck_values(u)));
        let bump = stribeck_slopes(u).times(Interval::point(c.stribeck_slope as i64)).shift_right(13);
        slope = slope.add(amplitude.times(bump).shift_right(16));
    }
    if physical.terms.contains(Terms::HYSTERESIS) {
        let at = |v: i64, a: i64| physical.hysteresis_argument(v as i32, a as i32) as i64;
        let argument = Interval::between(at(v.low, a.low), at(v.high, a.high))
            .union(Interval::between(at(v.low, a.high), at(v.high, a.low)));
        let amplitude = Interval::point(physical.hysteresis as i64);
        sum = sum.add(amplitude.times(argument.map(|x| atan(x as i32) as i64)));
        let edge = atan_slopes(argument).times(Interval::point(c.hysteresis_velocity_slope as i64)).shift_right(16);
        slope = slope.add(amplitude.times(edge).shift_right(16));
    }
    if physical.terms.contains(Terms::HARMONICS) {
        let bound = |amplitudes: &[i32]| {
            let total: i64 = amplitudes.iter().map(|a| (*a as i64).abs()).sum();
            total + (total >> 10) + 1 // the sines exceed one by less than 2^-10
        };
        let difference = bound(&physical.harmonic_difference);
        let amplitude = bound(&physical.harmonic_mean) + difference + 2;
        sum = sum.add(Interval::symmetric(amplitude).times(Interval::point(i32::MAX as i64)));
        slope = slope.add(Interval::symmetric(difference).times(edge).shift_right(16));
    }
    CellBounds { sum, slope }
}

/// Slopes of the tanh table over arguments in Q25, Q14. As in the network, but here the argument may span the table.
fn tanh_slopes(argument: Interval) -> Interval {
    slopes_between(&TANH, argument, &[-1, 0])
}

/// Values of the Stribeck bump: it turns at u = +-1 / sqrt 2, in steps 45 and -46.
fn stribeck_values(u: Interval) -> Interval {
    let ends = Interval::between(stribeck(u.low as i32) as i64, stribeck(u.high as i32) as i64);
    let peak = i32::MAX as i64;
    let ends = if spans(u, 44, 46) { ends.union(Interval::point(peak)) } else { ends };
    if spans(u, -47, -45) { ends.union(Interval::point(-peak)) } else { ends }
}

/// Slopes of the Stribeck bump, Q13: steepest at zero, turning where u^2 = 3/2 (steps 78 and -79).
fn stribeck_slopes(u: Interval) -> Interval {
    slopes_between(&STRIBECK, u, &[-80, -79, -78, -77, -1, 0, 76, 77, 78, 79])
}

fn spans(argument: Interval, first: i64, last: i64) -> bool {
    argument.low >> 20 <= last && argument.high >> 20 >= first
}

/// Slopes of a table over an interval: those of its ends and of the turning steps between, plus the knots' rounding.
fn slopes_between(table: &[i32; 512], argument: Interval, turns: &[i64]) -> Interval {
    const ROUNDING: i64 = 32;
    let step = |end: i64| (end >> 20).clamp(-256, 255);
    let slope = |step: i64| table[(step + 256) as usize & 511] as i16 as i64;
    let (low, high) = (step(argument.low), step(argument.high));
    let mut found = Interval::between(slope(low), slope(high));
    for &turn in turns {
        if (low..=high).contains(&turn) {
            found = found.union(Interval::point(slope(turn)));
        }
    }
    Interval { low: found.low - ROUNDING, high: found.high + ROUNDING }
}

/// Slopes of atan in quarter turns, Q16: 1 / (1 + x^2) times 2 / pi, for arguments in Q16.16.
fn atan_slopes(argument: Interval) -> Interval {
    // The table's knots are rounded to a part in 40 of a step's rise, the reciprocal beyond 1 likewise: allow 1/16.
    const STEEPEST: u64 = 44_000; // 2 / pi in Q16, and a twentieth more
    let nearest = argument.abs().low.unsigned_abs().min(1 << 31);
    let square = ((nearest * nearest) >> 16) + (1 << 16);
    let divisor = core::num::NonZeroU64::new(square).unwrap_or(core::num::NonZeroU64::MIN);
    Interval { low: 0, high: ((STEEPEST << 16) / divisor) as i64 + 64 }
}

/// Worst departure from the smooth model: arguments are cut to 17 fraction bits before the tables, factors rounded to Q16.
fn resolution(physical: &Physical) -> u32 {
    let magnitude = |pair: Directional| (pair.positive as i64).abs().max((pair.negative as i64).abs());
    let harmonics: i64 =
        physical.harmonic_mean.iter().chain(&physical.harmonic_difference).map(|a| (*a as i64).abs()).sum();
    // Coulomb: 2^-17 of its level and as much for the factor; Stribeck: slope 2.4 at 2^-18; atan: knots at 2^-15;
    // harmonics follow the same direction as Coulomb friction.
    let levels = (magnitude(physical.coulomb) >> 14)
        + (magnitude(physical.stribeck) >> 15)
        + ((physical.hysteresis as i64).abs() >> 13)
        + (harmonics >> 15);
    (levels + 4).min(u32::MAX as i64) as u32
}
