//! Braking into a supply that takes nothing back: the braking current fades before over-voltage has to switch off;
//! control step.
//!
//! A motor that brakes is a generator. What it gives beyond its own copper loss goes into the supply's capacitor, and
//! where the supply takes nothing back (a laboratory supply, an adapter, a full battery whose protection has opened)
//! the voltage rises. Over the last volts below the highest supply, the
//! [band](super::configuration::Limits::regeneration_band), less and less of the current that would feed the supply is
//! made; at the limit, none. What the winding burns by itself is not withheld, so that a joint at rest holds its load
//! and a slow one brakes with all of its torque, nor is a torque that drives.
//!
//! The power at the motor's terminals, of the equations in [`crate::motor::current`] at rest, is 3/2 (w psi + R i_q)
//! i_q: the supply is fed where that is negative. What is withheld rises in the same step as the supply, and comes back
//! slowly; where the winding burns all of it, at once, because half of such a current feeds the supply again. Between
//! both edges lies a quarter of the induced voltage: noise would switch the current.
//!
//! A d current makes loss without torque: as much of the [loss
//! current](super::configuration::MotorConfiguration::loss_current) flows as q current is withheld. Both together stay
//! within the current limit: with a part s of it left for q and 1 - s for d, the vector is at most sqrt(s^2 + (1 -
//! s)^2) of it.

use super::active::Active;
use crate::motor::number::{greater, within};
use crate::motor::transform::Dq;

/// Control steps in which all of what is withheld comes back.
const RECOVERY_STEPS: f32 = 200.0;
/// Induced voltage, as a part of it, that the winding must be able to burn before a current that is withheld flows
/// again.
const HYSTERESIS: f32 = 1.25;

/// Withheld part of a braking current, from one control step to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Regeneration {
    /// Part of the current, 0 to 1.
    withheld: f32,
}

impl Regeneration {
    /// The current to be made, A, where `wanted` is the one for the torque, at an electrical speed, rad/s, and a
    /// supply, V. `derating` is the part of the current limit that winding and bridge permit.
    #[inline(always)]
    pub fn step(&mut self, active: &Active, wanted: f32, speed: f32, bus_voltage: f32, derating: f32) -> Dq {
        if bus_voltage > active.onset || self.withheld > 0.0 {
            self.withhold(active, wanted, speed, bus_voltage, derating)
        } else {
            Dq { d: 0.0, q: wanted }
        }
    }

    /// A function of its own: it is seldom run, and lies where there is room.
    #[inline(never)]
    fn withhold(&mut self, active: &Active, wanted: f32, speed: f32, bus_voltage: f32, derating: f32) -> Dq {
        let induced = active.flux_linkage * speed;
        let edge = if self.withheld > 0.0 { HYSTERESIS * induced } else { induced };
        self.withheld = if (edge + active.resistance * wanted) * wanted < 0.0 {
            let least = within((bus_voltage - active.onset) * active.withheld_per_volt, 0.0, 1.0);
            greater(least, self.withheld - 1.0 / RECOVERY_STEPS)
        } else {
            0.0
        };
        Dq { d: -(active.loss_current * derating * self.withheld), q: wanted - wanted * self.withheld }
    }

    /// Forgets the past: the bridge is off.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::default_configuration::B_G431B_ESC1;
    use proptest::prelude::*;

    /// A joint of 0.1 ohm on 8 to 25 V that fades over 2 V, with so many of its 20 A for losses. It induces 0.1 V at
    /// 52.5 rad/s.
    fn active(loss_current: f32) -> Active {
        let mut board = B_G431B_ESC1;
        (board.joint.motor.current_limit, board.joint.motor.loss_current) = (20.0, loss_current);
        (board.joint.limits.over_current, board.joint.limits.regeneration_band) = (30.0, 2.0);
        board.joint.prepare(&board.bridge).unwrap()
    }

    /// Fast enough that 20 A feed the supply: 9.5 V are induced.
    const FAST: f32 = 5_000.0;

    fn first(active: &Active, wanted: f32, speed: f32, bus_voltage: f32) -> Dq {
        Regeneration::default().step(active, wanted, speed, bus_voltage, 1.0)
    }

    #[test]
    fn braking_fades_in_a_line_over_four_fifths_of_the_band() {
        let active = active(0.0);
        for (supply, part) in
            [(22.9, 1.0), (23.0, 1.0), (23.016, 0.99), (23.8, 0.5), (24.584, 0.01), (24.6, 0.0), (99.0, 0.0)]
        {
            for sign in [-1.0, 1.0] {
                let current = first(&active, -sign * 10.0, sign * FAST, supply);
                assert!((current.q + sign * 10.0 * part).abs() < 1e-3, "{supply} V: {current:?}");
                assert_eq!(current.d, 0.0);
            }
        }
    }

    #[test]
    fn a_joint_at_rest_holds_and_a_slow_one_brakes_with_all_of_its_torque() {
        let active = active(20.0);
        assert_eq!(first(&active, 10.0, 0.0, 25.0), Dq { d: 0.0, q: 10.0 });
        // 10 A of 0.1 ohm take 1 V: up to there the winding burns all that braking gives.
        let edge = 1.0 / active.flux_linkage;
        assert_eq!(first(&active, -10.0, 0.999 * edge, 25.0).q, -10.0);
        assert_eq!(first(&active, -10.0, 1.001 * edge, 25.0).q, 0.0);
        // Once withheld, it comes back where the winding burns a quarter more.
        let mut regeneration = Regeneration::default();
        let speeds = [1.001, 0.999, 0.801, 0.799, 0.999, 1.001];
        let currents = speeds.map(|part| regeneration.step(&active, -10.0, part * edge, 25.0, 1.0).q);
        assert_eq!(currents, [0.0, 0.0, 0.0, -10.0, -10.0, 0.0]);
    }

    #[test]
    fn what_is_withheld_comes_back_slowly_and_losses_take_its_place() {
        let active = active(8.0);
        let mut regeneration = Regeneration::default();
        assert_eq!(regeneration.step(&active, -10.0, FAST, 25.0, 1.0), Dq { d: -8.0, q: 0.0 });
        assert_eq!(regeneration.step(&active, -10.0, FAST, 25.0, 0.25).d, -2.0, "a hot winding bears less");
        let mut before = regeneration.step(&active, -10.0, FAST, 20.0, 1.0);
        assert!(before.q > -0.2, "{before:?}");
        let steps = (0..1_000)
            .find(|_| {
                let now = regeneration.step(&active, -10.0, FAST, 20.0, 1.0);
                assert!(now.q <= before.q && before.q - now.q < 0.051 && now.d >= before.d);
                before = now;
                now == Dq { d: 0.0, q: -10.0 }
            })
            .unwrap();
        assert!((190..=200).contains(&steps), "{steps}");
        // A torque that drives waits for nothing.
        regeneration.step(&active, -10.0, FAST, 25.0, 1.0);
        assert_eq!(regeneration.step(&active, 10.0, FAST, 25.0, 1.0), Dq { d: 0.0, q: 10.0 });
    }

    proptest! {
        #[test]
        fn nothing_drives_less_and_nothing_exceeds_the_limit(
            steps in prop::collection::vec((-20.0f32..20.0, -6_000.0f32..6_000.0, 15.0f32..30.0, 0.0f32..1.0), 1..50),
        ) {
            let active = active(20.0);
            let mut regeneration = Regeneration::default();
            for (wanted, speed, supply, derating) in steps {
                let wanted = wanted * derating;
                let Dq { d, q } = regeneration.step(&active, wanted, speed, supply, derating);
                let slack = 1e-4 + 20.0 * derating * 1e-5;
                prop_assert!(q * wanted >= 0.0 && q.abs() <= wanted.abs() && d <= 0.0);
                prop_assert!(d.hypot(q) <= 20.0 * derating + slack);
                if wanted * speed >= 0.0 {
                    prop_assert_eq!((d, q), (0.0, wanted));
                }
                // Whatever was before, at the limit nothing feeds the supply.
                if supply >= 25.0 {
                    prop_assert!((active.flux_linkage * speed + 0.1 * q) * q >= 0.0 || q == 0.0, "{q} A at {speed} rad/s");
                }
            }
        }

        #[test]
        fn whatever_is_measured_the_current_is_a_number(bits: [u32; 3], again in 0.0f32..50.0) {
            let active = active(20.0);
            let mut regeneration = Regeneration::default();
            let [speed, supply, derating] = bits.map(f32::from_bits);
            for _ in 0..2 {
                let Dq { d, q } = regeneration.step(&active, 10.0, speed, supply, derating.clamp(0.0, 1.0));
                prop_assert!(derating.is_nan() || (d.is_finite() && q.is_finite()), "{d} {q}");
            }
            let Dq { q, .. } = regeneration.step(&active, -10.0, FAST, again, 1.0);
            prop_assert!((-10.0..=0.0).contains(&q));
        }
    }
}
