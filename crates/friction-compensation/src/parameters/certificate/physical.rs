//! Bounds of the physical model: torque and slope over velocity, for every state in the widened box.

use super::interval::Interval;
use super::{bisect, tanh_at};
use crate::dsp::{narrow, saturate, smull};
use crate::friction::common::CommonTerms;
use crate::friction::domain::Domain;
use crate::friction::maxwell_slip::MAX_STIFFNESS;
use crate::friction::physical::{Directional, HARMONICS, PhysicalParameters, PreparedTerms, Scaling, Terms, times};
use crate::friction::ripple::Ripple;
use crate::friction::smooth::{TANH, atan, stribeck, stribeck_slope};
use crate::friction::state::{SIGNALS, Signal};

/// Bounds of the physical model in the whole widened box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Q16.16.
    pub(super) torque: Interval,
    /// Slope over velocity, Q16.16 per full scale.
    pub(super) slope: Interval,
    /// Slope over velocity that bending the pre-sliding elements adds in one evaluation, 1/256 Nm s/rad.
    pub(super) bending: Interval,
    /// Deviation of the fixed-point model from the smooth one whose slope is bounded, Q16.16.
    pub(super) resolution: u32,
}

/// Bounds in one cell: the sum of products with 47 fraction bits, and the slope.
#[derive(Clone, Copy)]
struct CellBounds {
    sum: Interval,
    slope: Interval,
}

/// Range of the common terms, whatever the velocity.
struct Common {
    /// Added to the Coulomb friction, Q16.16.
    level: Interval,
    /// Sum of products, 47 fraction bits.
    sum: Interval,
    /// Largest pre-sliding friction, Q16.16.
    pre_sliding: i64,
    /// See [`Bounds::bending`].
    bending: Interval,
    /// Roundings of pre-sliding and ripple, Q16.16.
    roundings: i64,
}

/// One, Q16.16.
const ONE: Interval = Interval::point(1 << 16);

/// Bounds, or nothing where the sum could leave the range of a torque.
#[inline(never)]
pub(super) fn bounds(
    parameters: &PhysicalParameters,
    common: &CommonTerms,
    domain: &Domain,
    depth: u32,
) -> Option<Bounds> {
    let (physical, box_) = (&PreparedTerms::new(parameters), scaled_box(&Scaling::new(domain)));
    if !harmonics_fit(physical) {
        return None;
    }
    let common = common_bounds(common, coulomb_factor(physical, &box_))?;
    let velocity = box_[Signal::Velocity as usize];
    let found = bisect(
        velocity,
        depth,
        &|cell: &Interval| cell_bounds(physical, &common, &box_, *cell),
        &|a, b| CellBounds { sum: a.sum.union(b.sum), slope: a.slope.union(b.slope) },
        &|found, new| found.sum.contains(new.sum) && found.slope.contains(new.slope),
        &halves,
    );
    let coulomb = coulomb_levels(physical, &common, &box_, velocity).abs().high;
    let dry = coulomb + common.pre_sliding;
    let slope = plus(found.slope, Interval::point(dry), weakening_slope(physical), 16);
    // Partial sums may wrap and come back; the whole sum must fit, and its rounding too.
    let fits = Interval::symmetric((1 << 62) - (1 << 31));
    fits.contains(found.sum).then(|| Bounds {
        torque: found.sum.map(|sum| narrow(sum) as i64),
        // Zero belongs to it, for beyond the box the velocity is clamped.
        slope: slope.union(Interval::ZERO),
        bending: common.bending,
        resolution: resolution(physical, &common, (coulomb, dry), velocity),
    })
}

/// A range of velocities in two, which meet; none where nothing lies between its ends.
fn halves(cell: &Interval) -> Option<(Interval, Interval)> {
    let middle = (cell.low + cell.high) >> 1;
    let halves = (Interval { low: cell.low, high: middle }, Interval { low: middle, high: cell.high });
    (cell.high - cell.low > 1).then_some(halves)
}

/// The widened box in Q31 of full scale.
fn scaled_box(scaling: &Scaling) -> [Interval; SIGNALS] {
    let low = scaling.apply(&scaling.ranges.map(|range| range.low));
    let high = scaling.apply(&scaling.ranges.map(|range| range.high));
    let mut scaled = [Interval::ZERO; SIGNALS];
    for (place, (low, high)) in scaled.iter_mut().zip(low.into_iter().zip(high)) {
        *place = Interval { low: low as i64, high: high as i64 };
    }
    scaled
}

/// Returns `true` if the harmonics' own sums stay in 64 bits.
fn harmonics_fit(physical: &PreparedTerms) -> bool {
    total(&physical.harmonic_mean) < 1 << 31 && total(&physical.harmonic_difference) < 1 << 31
}

/// The values of a directional pair that a velocity interval can select.
#[inline(never)]
fn level(pair: Directional, velocity: Interval) -> Interval {
    let (positive, negative) = (Interval::point(pair.positive as i64), Interval::point(pair.negative as i64));
    match (velocity.low < 0, velocity.high >= 0) {
        (true, true) => positive.union(negative),
        (true, false) => negative,
        _ => positive,
    }
}

/// `times` over intervals: monotone in both operands, so its corners bound it.
#[inline(never)]
fn rounded_times(a: Interval, b: Interval) -> Interval {
    let corner = |x: i64, y: i64| times(saturate(x), saturate(y)) as i64;
    Interval::between(corner(a.low, b.low), corner(a.high, b.high))
        .union(Interval::between(corner(a.low, b.high), corner(a.high, b.low)))
}

#[inline(never)]
fn product(coefficient: i32, signal: Interval) -> Interval {
    signal.times(Interval::point(coefficient as i64))
}

/// Part of a factor, Q16.16.
#[inline(never)]
fn factor_part(coefficient: i32, signal: Interval) -> Interval {
    product(coefficient, signal).map(|p| narrow(p) as i64)
}

#[inline(never)]
fn clip(interval: Interval) -> Interval {
    interval.map(|value| saturate(value) as i64)
}

/// The factor of dry friction, Q16.16, whatever the velocity.
fn coulomb_factor(physical: &PreparedTerms, box_: &[Interval; SIGNALS]) -> Interval {
    let [_, _, load, _, th, _] = *box_;
    let c = &physical.coefficients;
    let factor =
        clip(clip(ONE.add(factor_part(c.coulomb_temperature, th))).add(factor_part(c.coulomb_load, load.abs())));
    let weakening = physical.largest_weakening();
    rounded_times(factor, Interval { low: ONE.low - weakening, high: ONE.high + weakening })
}

/// Slope of the weakening's factor over velocity, Q16.16 per full scale: its bell is less steep than the hyperbolic
/// tangent that it is made of, and its amount follows the Coulomb friction's from one direction's to the other's.
fn weakening_slope(physical: &PreparedTerms) -> Interval {
    let either = |slope: i32| {
        let steepest = slope.unsigned_abs() as i64;
        Interval { low: -steepest, high: steepest }
    };
    let c = &physical.coefficients;
    let of_bell = Interval::point(physical.largest_weakening()).times(either(c.weakening_slope));
    plus(of_bell, Interval::point(physical.weakening_difference as i64), either(c.coulomb_slope), 0).shift_right(16)
}

/// Largest sum of sines with these amplitudes: the sines exceed one by less than 2^-10.
#[inline(never)]
fn total(amplitudes: &[i32; HARMONICS]) -> i64 {
    let total: i64 = amplitudes.iter().map(|a| (*a as i64).abs()).sum();
    total + (total >> 10) + 1
}

/// A sum and one product more, without `bits` of its fraction.
#[inline(never)]
fn plus(sum: Interval, a: Interval, b: Interval, bits: u32) -> Interval {
    sum.add(a.times(b).shift_right(bits))
}

/// Argument of a smooth function over a velocity interval.
#[inline(never)]
fn argument(coefficient: i32, v: Interval, bits: u32) -> Interval {
    product(coefficient, v).map(|p| saturate(p >> bits) as i64)
}

/// v |v| in Q31.
#[inline(never)]
fn signed_square(v: i64) -> i64 {
    let v = v as i32;
    saturate(smull(v, v.saturating_abs()) >> 31) as i64
}

/// The Coulomb levels, with their factor, that a velocity interval can select, Q16.16.
fn coulomb_levels(
    physical: &PreparedTerms,
    common: &Common,
    box_: &[Interval; SIGNALS],
    velocity: Interval,
) -> Interval {
    rounded_times(clip(level(physical.coulomb, velocity).add(common.level)), coulomb_factor(physical, box_))
}

/// Bounds of the common terms, or nothing where their own sums could wrap. `factor`: of dry friction, Q16.16.
#[inline(never)]
fn common_bounds(common: &CommonTerms, factor: Interval) -> Option<Common> {
    let (level, torque) = Ripple::bound(&common.ripples);
    let (mut pre_sliding, mut stiffness) = (0i64, 0i64);
    for element in common.elements {
        let level = element.level as i64;
        pre_sliding += level;
        // Fewer than 2^60 each; in Nm/rad they have 32 fraction bits.
        stiffness += level * element.stiffness.min(MAX_STIFFNESS) as i64;
    }
    let fit = [level, torque, pre_sliding].into_iter().all(|bound| bound < 1 << 31);
    // Per rad in 8 fraction bits, a thousandth of it per rad/s; the factor may exceed one.
    let per_step = Interval { low: 0, high: stiffness / (1_000 << 24) + 1 };
    let bent = rounded_times(Interval::symmetric(pre_sliding), factor);
    fit.then(|| Common {
        level: Interval::symmetric(level),
        // A unit of each sum, and half a one of each element's bending. The factor of dry friction multiplies all but
        // that of the torque.
        roundings: match (pre_sliding, level, torque) {
            (0, 0, 0) => 0,
            _ => 4 * ((factor.abs().high >> 16) + 1) + 1,
        },
        sum: Interval::symmetric(torque)
            .times(Interval::point(1 << 31))
            .add(bent.times(Interval::point(i32::MAX as i64))),
        pre_sliding: bent.high,
        bending: match pre_sliding {
            0 => Interval::ZERO,
            _ => per_step.times(factor).shift_right(16).union(Interval::ZERO),
        },
    })
}

fn cell_bounds(physical: &PreparedTerms, common: &Common, box_: &[Interval; SIGNALS], v: Interval) -> CellBounds {
    let [q, _, load, _, th, a] = *box_;
    let c = &physical.coefficients;

    let mut sum = Interval::point((c.constant as i64) << 31).add(common.sum);
    for (coefficient, signal) in [(c.position, q), (c.temperature, th), (c.load, load), (c.rotor_inertia, a)] {
        sum = sum.add(product(coefficient, signal));
    }

    let viscous_factor = clip(ONE.add(factor_part(c.viscous_temperature, th)));
    let viscous = rounded_times(Interval::point(c.viscous as i64), viscous_factor);
    sum = plus(sum, viscous, v, 0);
    let mut slope = viscous;

    let speed = v.abs();
    sum = sum.add(product(c.quadratic, v.map(signed_square)));
    slope = slope.add(product(c.quadratic, speed).shift_right(30));
    sum = sum.add(product(c.viscous_asymmetry, speed));
    let backward = v.low < 0;
    let side = Interval { low: if backward { -1 } else { 1 }, high: if backward && v.high <= 0 { -1 } else { 1 } };
    slope = slope.add(product(c.viscous_asymmetry, side));

    let edge = argument(c.coulomb_slope, v, 22);
    let direction = edge.map(tanh_at);
    let coulomb = coulomb_levels(physical, common, box_, v);
    sum = plus(sum, coulomb, direction, 0);
    // Slope of the direction over full-scale velocity, Q16: table slope Q14 times 1 / v_c in Q16.
    let edge = product(c.coulomb_slope, tanh_slopes(edge)).shift_right(14);
    slope = plus(slope, coulomb, edge, 16);

    if physical.terms.contains(Terms::STRIBECK) {
        let u = argument(c.stribeck_slope, v, 21);
        let amplitude = level(physical.stribeck, v);
        sum = plus(sum, amplitude, stribeck_values(u), 0);
        let bump = product(c.stribeck_slope, stribeck_slopes(u)).shift_right(13);
        slope = plus(slope, amplitude, bump, 16);
    }
    if physical.terms.contains(Terms::HYSTERESIS) {
        let at = |v: i64, a: i64| hysteresis_argument(physical, v, a);
        let argument = Interval::between(at(v.low, a.low), at(v.high, a.high))
            .union(Interval::between(at(v.low, a.high), at(v.high, a.low)));
        let amplitude = Interval::point(physical.hysteresis as i64);
        sum = plus(sum, amplitude, argument.map(atan_at), 0);
        let edge = product(c.hysteresis_velocity_slope, atan_slopes(argument)).shift_right(16);
        slope = plus(slope, amplitude, edge, 16);
    }
    if physical.terms.contains(Terms::HARMONICS) {
        let difference = total(&physical.harmonic_difference);
        let amplitude = total(&physical.harmonic_mean) + difference + 2;
        sum = plus(sum, Interval::symmetric(amplitude), Interval::point(i32::MAX as i64), 0);
        slope = plus(slope, Interval::symmetric(difference), edge, 16);
    }
    CellBounds { sum, slope }
}

#[inline(never)]
fn hysteresis_argument(physical: &PreparedTerms, velocity: i64, acceleration: i64) -> i64 {
    physical.hysteresis_argument(velocity as i32, acceleration as i32) as i64
}

/// Slopes of the tanh table over arguments in Q25, Q14. As in the network, but here the argument may span the table.
fn tanh_slopes(argument: Interval) -> Interval {
    slopes_between(tanh_slope, argument, &[-1, 0])
}

// The tables' look-ups are inlined in the control step; here each is linked once.

#[inline(never)]
fn stribeck_at(argument: i64) -> i64 {
    stribeck(argument as i32) as i64
}

#[inline(never)]
fn atan_at(argument: i64) -> i64 {
    atan(argument as i32) as i64
}

/// Values of the Stribeck bump: it turns at u = +-1 / sqrt 2, in steps 45 and -46.
fn stribeck_values(u: Interval) -> Interval {
    let ends = u.map(stribeck_at);
    let peak = i32::MAX as i64;
    let ends = if spans(u, 44, 46) { ends.union(Interval::point(peak)) } else { ends };
    if spans(u, -47, -45) { ends.union(Interval::point(-peak)) } else { ends }
}

/// Slopes of the Stribeck bump, Q13: steepest at zero, turning where u^2 = 3/2 (steps 78 and -79).
fn stribeck_slopes(u: Interval) -> Interval {
    slopes_between(stribeck_slope, u, &[-80, -79, -78, -77, -1, 0, 76, 77, 78, 79])
}

fn spans(argument: Interval, first: i64, last: i64) -> bool {
    argument.low >> 20 <= last && argument.high >> 20 >= first
}

/// Slope of the tanh table over a step, -256 to 255.
fn tanh_slope(step: i64) -> i64 {
    TANH[(step + 256) as usize & 511] as i16 as i64
}

/// Slopes of a table over an interval: those of its ends and of the turning steps between, plus the knots' rounding.
fn slopes_between(slope: fn(i64) -> i64, argument: Interval, turns: &[i8]) -> Interval {
    const ROUNDING: i64 = 32;
    let step = |end: i64| (end >> 20).clamp(-256, 255);
    let (low, high) = (step(argument.low), step(argument.high));
    let mut found = Interval::between(slope(low), slope(high));
    for turn in turns.iter().map(|turn| *turn as i64) {
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

/// Worst departure from the smooth model whose slopes are bounded, Q16.16. `coulomb`: largest Coulomb level, and with
/// pre-sliding.
fn resolution(physical: &PreparedTerms, common: &Common, (coulomb, dry): (i64, i64), velocity: Interval) -> u32 {
    let stribeck = level(physical.stribeck, velocity).abs().high;
    let harmonics = total(&physical.harmonic_difference);
    // Arguments are cut to 17 fraction bits before tanh (slope 1), to 18 before the Stribeck bump (slope 2.33): hardly
    // more than 2^-17 of the Coulomb level and of the harmonics that follow the same edge, 2^-16.7 of the Stribeck
    // level. Twice that, because where two directions have different levels, they meet at this distance from zero.
    // The arc tangent's argument and reciprocal are rounded at 2^-16 (slope 2 / pi). The weakening's bell is a square,
    // slope 2, and its factor is rounded four times: below five times the next whole amount.
    let amount = (physical.largest_weakening() + 0xffff) >> 16;
    let weakened = 5 * amount * ((dry >> 15) + 1);
    let levels =
        weakened + (coulomb >> 16) + (harmonics >> 16) + (stribeck >> 15) + ((physical.hysteresis as i64).abs() >> 15);
    // Shifts above, v |v|, the harmonics' two roundings, those of pre-sliding and ripple, and the last one.
    (levels + 4 + 1 + 2 + common.roundings + 1).min(u32::MAX as i64) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::smooth::odd_sines;
    use proptest::prelude::*;

    #[test]
    fn a_range_of_velocities_is_halved_down_to_its_last_unit() {
        for low in [-3, -2, -1, 0, 1] {
            assert_eq!(halves(&Interval { low, high: low + 1 }), None);
            for width in 2..6 {
                let (first, second) = halves(&Interval { low, high: low + width }).unwrap();
                assert_eq!((first.low, first.high, second.high), (low, second.low, low + width));
                assert!(first.high > first.low && second.high > second.low, "{low} {width}");
            }
        }
    }

    /// Every interval of whole steps of a table, with the hull of a property of its steps.
    fn for_every_interval(of_step: impl Fn(i64) -> Interval, mut check: impl FnMut(Interval, Interval)) {
        for first in -256i64..256 {
            let mut hull = of_step(first);
            for last in first..256 {
                hull = hull.union(of_step(last));
                check(Interval { low: first << 20, high: (last << 20) + (1 << 20) - 1 }, hull);
            }
        }
    }

    #[test]
    fn slopes_of_both_tables_are_bounded_over_every_interval() {
        for_every_interval(
            |step| Interval::point(tanh_slope(step)),
            |steps, exact| assert!(tanh_slopes(steps).contains(exact), "{steps:?}"),
        );
        for_every_interval(
            |step| Interval::point(stribeck_slope(step)),
            |steps, exact| assert!(stribeck_slopes(steps).contains(exact), "{steps:?}"),
        );
    }

    #[test]
    fn the_stribeck_bump_is_bounded_over_every_interval_and_turns_only_at_its_peaks() {
        let step_values = |step: i64| {
            let at = |x: i64| stribeck(x as i32) as i64;
            Interval::between(at(step << 20), at((step << 20) + (1 << 20) - 1))
        };
        for_every_interval(step_values, |steps, exact| {
            let bound = stribeck_values(steps);
            assert!(bound.contains(exact), "{steps:?}: {exact:?} not in {bound:?}");
            // The bump is flat near a peak: a step or two beside it, the peak is a thousandth too high a bound.
            assert!(bound.high - exact.high < 1 << 21 && exact.low - bound.low < 1 << 21, "{steps:?}");
        });
    }

    proptest! {
        #[test]
        fn the_stribeck_bump_is_bounded_between_any_two_arguments(a in -(5i64 << 26)..5 << 26, b in -(5i64 << 26)..5 << 26, part in 0.0f64..=1.0) {
            let arguments = Interval::between(a, b);
            let between = a + ((b - a) as f64 * part) as i64;
            prop_assert!(stribeck_values(arguments).contains(Interval::point(stribeck(between as i32) as i64)));
        }

        #[test]
        fn the_arc_tangent_rises_by_no_more_than_its_slope_times_the_distance(
            x in prop_oneof![-(3i32 << 16)..3 << 16, any::<i32>()],
            distance in (0u32..31).prop_flat_map(|bits| 0..1i32 << bits),
        ) {
            let end = x.saturating_add(distance);
            let slopes = atan_slopes(Interval { low: x as i64, high: end as i64 });
            // Q31 of a quarter turn; slope Q16 times distance Q16 is Q32. The argument is rounded at 2^-16.
            let rise = atan(end) as i64 - atan(x) as i64;
            let slack = 2 << 15;
            prop_assert!(rise >= 0 && rise <= ((slopes.high * (end as i64 - x as i64)) >> 1) + slack, "{} {}", x, rise);
        }
    }

    #[test]
    fn the_slope_of_the_arc_tangent_is_bounded_by_a_sixteenth_more_than_it_is() {
        for step in -40_000i64..=40_000 {
            let x = step << 7;
            let exact = 65_536.0 * core::f64::consts::FRAC_2_PI / (1.0 + (x as f64 / 65_536.0).powi(2));
            let bound = atan_slopes(Interval::point(x)).high as f64;
            assert!(exact <= bound && bound <= exact * (1.0 + 1.0 / 16.0) + 65.0, "{x}: {bound}, exact {exact}");
        }
    }

    #[test]
    fn sines_exceed_one_by_less_than_is_allowed_for() {
        let largest = (0..u32::MAX).step_by(9_973).flat_map(odd_sines).map(|sine| sine.unsigned_abs()).max();
        let largest = largest.unwrap_or(0);
        assert!(largest < (1 << 30) + (1 << 20), "{largest}");
    }
}
