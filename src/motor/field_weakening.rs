//! Field weakening: a d current against the magnet's flux, where the supply's voltage is used up; control step.
//!
//! The faster a rotor turns, the more voltage it induces, and at its base speed nothing is left to drive a current
//! with. A negative d current takes L_d i_d from the flux linkage psi, and with it from the voltage (Krishnan,
//! Permanent Magnet Synchronous and Brushless DC Motor Drives, chapter 6). How much is needed an integrator finds, of
//! what the current loop asked for in the step before:
//!
//! ```text
//! i_d += k ((0.95 V)^2 - v_d^2 - v_q^2), within -I_w and 0
//! ```
//!
//! V is the longest voltage vector that the [modulation](super::modulation) permits, I_w the field-weakening current.
//! No constant of the motor tells how much is needed, so that a wrong flux linkage does not matter. Near the limit the
//! integrator is a first-order loop whose bandwidth rises with the speed; k is such that it is a tenth of the current
//! loop's at the fastest the joint may be.
//!
//! More d current helps as long as it takes more voltage from q than its resistance adds to d: R |v_d| < w L_d v_q, the
//! derivative of the vector's length. Where that ends, in a motor of high resistance soon, it goes no further.
//!
//! A voltage that the winding's resistance takes, or a change of the current, no d current gives back: below a speed at
//! which the rotor induces seven tenths of V the d current goes back to zero. The current limit holds for both: q
//! current keeps what d current leaves of its circle. I_w is at most psi / L_d, beyond which more of it would raise the
//! voltage again, and there it may not be lost: while the bridge switches it bounds the voltage, and off, the diodes
//! rectify all of what the rotor induces. A [configuration](crate::joint::configuration) with I_w above 0 is therefore
//! refused where that would be more than the highest supply.

use super::number::{limited, magnitude, square_root, within};
use super::transform::Dq;

/// Part of the longest voltage vector that is used before the field is weakened: the rest is for changes of the
/// current.
pub const SHARE: f32 = 0.95;
/// Part of the longest voltage vector that the rotor has to induce.
pub const INDUCED: f32 = 0.7;
/// The current loop's bandwidth over that of the integrator.
const SLOWER: f32 = 10.0;

/// Settings of field weakening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeakeningSettings {
    /// Largest d current, A; 0 (off) to flux linkage over inductance.
    pub current: f32,
    /// Bandwidth of the current loop, Hz.
    pub bandwidth: f32,
    /// Control steps a second, Hz.
    pub rate: f32,
    /// Resistance of a phase, Ω.
    pub resistance: f32,
    /// Inductance along the magnet's flux, H.
    pub inductance_d: f32,
    /// Magnet's flux linkage, Wb.
    pub flux_linkage: f32,
    /// Longest voltage vector at the highest supply, V.
    pub highest_reach: f32,
    /// Fastest electrical speed, rad/s.
    pub highest_speed: f32,
}

/// The same, prepared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WeakeningGains {
    /// A; 0: off.
    current: f32,
    /// A/V² in a control step.
    integral: f32,
    /// Wb.
    flux_linkage: f32,
    /// Part of the longest voltage vector, for an electrical speed of 1 rad/s, up to which a voltage along d leaves
    /// something to be gained, s.
    time_constant: f32,
}

impl WeakeningGains {
    /// Gains for settings that the [configuration](crate::joint::configuration) has checked.
    pub fn new(settings: &WeakeningSettings) -> Self {
        let WeakeningSettings { current, bandwidth, rate, resistance, inductance_d, flux_linkage, .. } = *settings;
        let WeakeningSettings { highest_reach, highest_speed, .. } = *settings;
        // Of the voltage's square over the d current, at the fastest.
        let slope = 2.0 * SHARE * highest_reach * highest_speed * inductance_d;
        Self {
            current,
            integral: core::f32::consts::TAU * bandwidth / (SLOWER * rate * slope),
            flux_linkage,
            time_constant: SHARE * inductance_d / resistance,
        }
    }

    /// Returns `true` if the field is ever weakened.
    #[inline(always)]
    pub fn is_on(&self) -> bool {
        self.current > 0.0
    }
}

/// Field weakening, from one control step to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldWeakening {
    /// d current, A; 0 or less.
    current: f32,
}

impl FieldWeakening {
    /// The current to be made, A, where `reference` is the one without field weakening. `asked` is the voltage, V, that
    /// the current loop asked for in the step before, `reach` the longest vector, V, `speed` the electrical speed,
    /// rad/s, `limit` the current limit, A. The larger demand of d current counts.
    ///
    /// NaN counts as no voltage and no speed. A function of its own: it is seldom run.
    #[inline(never)]
    pub fn step(&mut self, gains: &WeakeningGains, reference: Dq, asked: Dq, reach: f32, speed: f32, limit: f32) -> Dq {
        let permitted = SHARE * SHARE * reach * reach;
        let missing = match magnitude(gains.flux_linkage * speed) > INDUCED * reach {
            true => limited(asked.norm_squared() - permitted, permitted),
            false => -permitted,
        };
        let gains_voltage = magnitude(asked.d) < magnitude(speed) * gains.time_constant * reach;
        let missing = if gains_voltage { missing } else { -magnitude(missing) };
        let most = if gains.current < limit { gains.current } else { limit };
        self.current = within(self.current - gains.integral * missing, -most, 0.0);
        if self.current >= reference.d {
            return reference;
        }
        let left = square_root(limit * limit - self.current * self.current);
        Dq { d: self.current, q: limited(reference.q, left) }
    }

    /// Forgets the past: the bridge is off.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GAINS: WeakeningSettings = WeakeningSettings {
        current: 8.0,
        bandwidth: 800.0,
        rate: 20_000.0,
        resistance: 0.1,
        inductance_d: 60e-6,
        flux_linkage: 0.005,
        highest_reach: 15.0,
        highest_speed: 5_000.0,
    };

    /// Steps with these demands from a d current of 0 on; what is made in the last one.
    fn after(steps: usize, reference: Dq, asked: Dq, speed: f32) -> Dq {
        let (gains, mut weakening) = (WeakeningGains::new(&GAINS), FieldWeakening::default());
        let mut step = || weakening.step(&gains, reference, asked, 12.0, speed, 10.0);
        (1..steps).for_each(|_| {
            step();
        });
        step()
    }

    fn near(one: Dq, other: Dq) -> bool {
        (one - other).norm() < 1e-4
    }

    const DRIVING: Dq = Dq { d: 0.0, q: 10.0 };

    #[test]
    fn the_field_is_weakened_from_the_share_of_the_voltage_on_and_not_before() {
        let at = |part: f32| after(5_000, DRIVING, Dq { d: 0.0, q: part * SHARE * 12.0 }, 2_400.0);
        assert_eq!(at(0.999), DRIVING);
        assert!(near(at(1.01), Dq { d: -8.0, q: 6.0 }), "{:?}", at(1.01));
    }

    #[test]
    fn what_the_resistance_takes_weakens_nothing() {
        let edge = INDUCED * 12.0 / GAINS.flux_linkage;
        let at = |part: f32, sign: f32| after(5_000, DRIVING, Dq { d: 0.0, q: sign * 20.0 }, sign * part * edge);
        for sign in [-1.0, 1.0] {
            assert_eq!(at(0.999, sign), DRIVING);
            assert!((at(1.001, sign).d + 8.0).abs() < 1e-6);
        }
    }

    #[test]
    fn a_d_current_that_takes_more_voltage_than_it_gives_is_not_made() {
        // L_d / R is 0.6 ms: at 2,000 rad/s the voltage along d may be 1.2 times that along q.
        let edge = 2_000.0 * 6e-4 * SHARE * 12.0;
        let at = |part: f32| after(5_000, DRIVING, Dq { d: -part * edge, q: 20.0 }, 2_000.0);
        assert!((at(0.999).d + 8.0).abs() < 1e-6);
        assert_eq!(at(1.001), DRIVING);
    }

    #[test]
    fn the_larger_demand_of_d_current_counts_and_the_circle_is_kept() {
        for d in [0.0, -3.0, -7.99] {
            let made = after(5_000, Dq { d, q: -10.0 }, Dq { d: 0.0, q: 20.0 }, 4_000.0);
            assert!(near(made, Dq { d: -8.0, q: -6.0 }), "{made:?}");
        }
        let burning = Dq { d: -8.01, q: -4.0 };
        assert_eq!(after(5_000, burning, Dq { d: 0.0, q: 20.0 }, 4_000.0), burning);
    }

    proptest! {
        #[test]
        fn whatever_comes_the_current_keeps_its_limits(steps in prop::collection::vec(any::<[u32; 4]>(), 1..20), limit in 0.0f32..12.0) {
            let (gains, mut weakening) = (WeakeningGains::new(&GAINS), FieldWeakening::default());
            for bits in steps {
                let [d, q, reach, speed] = bits.map(f32::from_bits);
                let made = weakening.step(&gains, Dq { d: 0.0, q: limit }, Dq { d, q }, reach, speed, limit);
                prop_assert!(made.d <= 0.0 && made.d >= -lesser_of(limit), "{made:?}");
                prop_assert!(made.norm() <= limit * 1.000_01 + 1e-6, "{made:?} of {limit}");
            }
            // It comes back from there.
            for _ in 0..20_000 {
                weakening.step(&gains, Dq::ZERO, Dq::ZERO, 12.0, 0.0, limit);
            }
            prop_assert_eq!(weakening, FieldWeakening::default());
        }
    }

    fn lesser_of(limit: f32) -> f32 {
        limit.min(GAINS.current)
    }
}
