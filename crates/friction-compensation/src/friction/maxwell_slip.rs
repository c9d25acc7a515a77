//! Pre-sliding friction: Maxwell-slip elements in parallel; control step.
//!
//! Friction does not change its side at once when motion turns back: the contacts bend first, over microradians to
//! tenths of a radian, and give way one after the other. Each element is a spring of length `s` that is dragged along
//! by the motion and slips at its distance `d`, so that s / d stays within +-1:
//!
//! ```text
//! z(k) = clamp(z(k-1) + v T / d, -1, 1)        torque = sum of level z
//! ```
//!
//! Source: Iwan 1966; Lampaert, Swevers, Al-Bender 2002 (generalised Maxwell slip). Its velocity weakening is a factor
//! of the parameter set's dry friction. The state is bounded by construction, and at a velocity of zero it stays as it
//! is.

use crate::dsp::{saturate, smlal, smull};

/// Number of elements.
pub const ELEMENTS: usize = 4;

/// One element as it is stored and transferred.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MaxwellElement {
    /// 1 / d: the reciprocal of the way from rest to slip, 1/rad in Q16.16, 0 (absent) to [`MAX_STIFFNESS`].
    pub stiffness: i32,
    /// Torque while it slips, Nm in Q16.16, 0 to [`MAX_LEVEL`].
    pub level: i32,
}

/// Largest [`stiffness`](MaxwellElement::stiffness): an element slips after 61 microradians at the least.
pub const MAX_STIFFNESS: i32 = 16_384 << 16;

/// Largest [`level`](MaxwellElement::level), 8,191 Nm: the torque of all elements fits.
pub const MAX_LEVEL: i32 = i32::MAX / ELEMENTS as i32;

/// Fewest steps a second at which the stiffest element bends as far as it should; below it a gain may be held at the
/// end of its range.
pub const LOWEST_RATE: u32 = 1_000;

/// Bending of each element, Q31: at the ends of the range it slips.
pub type Bent = [i32; ELEMENTS];

/// The elements ready to be stepped at a fixed rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MaxwellSlip {
    /// Bending in a step for a velocity of one: Q26, held at the end of the range.
    gains: [i32; ELEMENTS],
    levels: [i32; ELEMENTS],
}

impl MaxwellSlip {
    /// No element.
    pub(super) const NONE: Self = Self { gains: [0; ELEMENTS], levels: [0; ELEMENTS] };

    /// Prepares elements for `rate` steps a second (at least 1, and [`LOWEST_RATE`] for stiff elements).
    pub fn new(elements: &[MaxwellElement; ELEMENTS], rate: u32) -> Self {
        let rate = i64::from(rate.max(1));
        let mut slip = Self::NONE;
        let places = slip.gains.iter_mut().zip(&mut slip.levels);
        for ((gain, level), element) in places.zip(elements) {
            *gain = saturate((i64::from(element.stiffness) << 10).wrapping_div(rate));
            *level = if element.stiffness == 0 { 0 } else { element.level.min(MAX_LEVEL) };
        }
        slip
    }

    /// True without any element.
    #[inline(always)]
    pub(super) fn is_none(&self) -> bool {
        let [a, b, c, d] = self.gains;
        a | b | c | d == 0
    }

    /// Torque of all elements where they slip, Nm in Q16.16.
    pub(super) fn level(&self) -> i32 {
        self.levels.iter().fold(0i32, |sum, level| sum.saturating_add(*level))
    }

    /// One step at a velocity (rad/s in Q16.16); the torque of all elements, Nm in Q16.16.
    #[inline(always)]
    pub fn step(&self, bent: &mut Bent, velocity: i32) -> i32 {
        let [a, b, c, d] = *bent;
        let [ga, gb, gc, gd] = self.gains;
        let [la, lb, lc, ld] = self.levels;
        // Written out: optimised for size, the compiler keeps a loop with bounds.
        let [a, b, c, d] = [drag(a, ga, velocity), drag(b, gb, velocity), drag(c, gc, velocity), drag(d, gd, velocity)];
        *bent = [a, b, c, d];
        // Four levels fit.
        (smlal(smlal(smlal(smull(la, a), lb, b), lc, c), ld, d) >> 31) as i32
    }
}

/// An element after a step: saturation is the slip. In halves, so that one step can take it from one end to the other.
#[inline(always)]
fn drag(bent: i32, gain: i32, velocity: i32) -> i32 {
    let half = saturate(smull(gain, velocity) >> 12);
    bent.saturating_add(half).saturating_add(half)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// One, in Q31.
    const ONE: f64 = (1u32 << 31) as f64;

    fn q16(value: f64) -> i32 {
        (value * 65_536.0).round() as i32
    }

    fn element(distance: f64, level: f64) -> MaxwellElement {
        MaxwellElement { stiffness: q16(1.0 / distance), level: q16(level) }
    }

    /// A way in rad, passed at a velocity in rad/s at 4 kHz; the torque at its end, Nm.
    fn pass(slip: &MaxwellSlip, bent: &mut Bent, way: f64, velocity: f64) -> f64 {
        let steps = (way.abs() / velocity.abs() * 4_000.0).round() as usize;
        let mut torque = 0;
        (0..steps).for_each(|_| torque = slip.step(bent, q16(velocity)));
        f64::from(torque) / 65_536.0
    }

    #[test]
    fn elements_bend_over_their_distance_and_then_slip_at_their_level() {
        let elements = [element(0.01, 2.0), element(0.04, 1.0), MaxwellElement::default(), MaxwellElement::default()];
        let slip = MaxwellSlip::new(&elements, 4_000);
        let bent = &mut Bent::default();
        let near = |torque: f64, want: f64| assert!((torque - want).abs() < 1e-3, "{torque}, {want}");
        near(pass(&slip, bent, 0.005, 0.1), 1.0 + 0.125);
        near(pass(&slip, bent, 0.005, 0.1), 2.0 + 0.25);
        near(pass(&slip, bent, 0.1, 1.0), 3.0);
        // Backwards the way from one end to the other is twice the distance.
        near(pass(&slip, bent, 0.01, -0.1), 0.0 + 0.75);
        near(pass(&slip, bent, 0.2, -2.0), -3.0);
        // At rest nothing moves.
        near(f64::from(slip.step(bent, 0)) / 65_536.0, -3.0);
    }

    #[test]
    fn the_rate_does_not_change_the_way() {
        for rate in [1_000, 4_000, 8_000] {
            let slip = MaxwellSlip::new(&[element(0.02, 1.0); ELEMENTS], rate);
            let bent = &mut Bent::default();
            (0..rate / 10).for_each(|_| _ = slip.step(bent, q16(0.1)));
            let way = f64::from(bent[0]) / ONE;
            assert!((way - 0.5).abs() < 1e-3, "{rate}: {way}");
        }
    }

    #[test]
    fn an_element_without_stiffness_has_no_torque() {
        let slip = MaxwellSlip::new(&[MaxwellElement { stiffness: 0, level: i32::MAX }; ELEMENTS], 1_000);
        assert_eq!(slip, MaxwellSlip::NONE);
    }

    #[test]
    fn the_stiffest_element_keeps_its_gain_at_the_lowest_rate() {
        let gain = |stiffness: i32| {
            MaxwellSlip::new(&[MaxwellElement { stiffness, level: 1 }; ELEMENTS], LOWEST_RATE).gains[0]
        };
        assert_eq!(i64::from(gain(MAX_STIFFNESS)), (i64::from(MAX_STIFFNESS) << 10) / i64::from(LOWEST_RATE));
        assert!(gain(MAX_STIFFNESS - 1) <= gain(MAX_STIFFNESS) && gain(MAX_STIFFNESS) < i32::MAX);
        assert_eq!(gain(i32::MAX), i32::MAX);
    }

    proptest! {
        #[test]
        fn the_state_is_bounded_and_follows_the_real_one(
            stiffness in 0..=MAX_STIFFNESS, level in 0..1i32 << 24, start: i32,
            velocities in prop::collection::vec(any::<i32>(), 1..20), rate in 1_000u32..20_000,
        ) {
            let slip = MaxwellSlip::new(&[MaxwellElement { stiffness, level }; ELEMENTS], rate);
            let mut bent = [start; ELEMENTS];
            let mut exact = f64::from(start) / ONE;
            for velocity in velocities {
                let velocity = velocity >> (velocity as u32 % 31);
                let torque = slip.step(&mut bent, velocity);
                let way = f64::from(velocity) / 65_536.0 / f64::from(rate);
                exact = (exact + way * f64::from(stiffness) / 65_536.0).clamp(-1.0, 1.0);
                let now = f64::from(bent[0]) / ONE;
                prop_assert!(now.abs() <= 1.0);
                // The gain is cut to a unit of 2^-26, the step to one of 2^-30.
                let error = 1e-7 + (velocity as f64).abs() / 65_536.0 / (1u64 << 26) as f64;
                prop_assert!((now - exact).abs() <= error.min(2.0), "{now} {exact} {error}");
                exact = now;
                prop_assert!((f64::from(torque) - 4.0 * f64::from(level) * now).abs() <= 1.0 + 4.0 * f64::from(level) * 1e-9);
            }
        }

        #[test]
        fn no_bits_overflow(gain: i32, level in 0..=MAX_LEVEL, bent: i32, velocity: i32) {
            let slip = MaxwellSlip { gains: [gain; ELEMENTS], levels: [level; ELEMENTS] };
            let mut state = [bent; ELEMENTS];
            let torque = slip.step(&mut state, velocity);
            prop_assert!(i64::from(torque).abs() <= 4 * i64::from(level));
        }
    }
}
