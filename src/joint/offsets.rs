//! Offsets of the current sensors: the mean of the first steps, in which the bridge is off and no current flows;
//! control step.
//!
//! Amplifiers drift. While the joint is switched off and stands, the offsets follow the readings slowly; a bridge that
//! switches, a rotor that turns and a reading beyond what a sound sensor has at the start hold them.

use super::active::Active;
use super::configuration::Limits;
use super::state_machine::State;
use super::{Joint, STANDING};
use crate::motor::phases::Phases;

/// Control steps over which the current sensors' offsets are measured at the start.
pub const OFFSET_STEPS: u32 = 1024;
/// Readings beyond it that make a sensor a broken one.
const REFUSED_READINGS: u32 = 3;
/// Steps without cause for a current before the offsets follow: what diodes carried has decayed.
const QUIET_STEPS: u32 = OFFSET_STEPS;
/// Part of what a reading differs by that an offset follows in a step: a time constant of 2^14 steps, 0.8 s at 20 kHz.
const FOLLOWED: f32 = 1.0 / 16_384.0;

/// Measured offsets, or the measurement of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Offsets {
    sum: Phases,
    /// Steps of the measurement; behind it, those since something could cause a current.
    steps: u32,
    mean: Phases,
    /// Number of restarts of the measurement.
    restarts: u32,
}

impl Offsets {
    /// Returns `true` once the measurement is complete.
    pub const fn are_known(&self) -> bool {
        self.steps >= OFFSET_STEPS
    }

    /// Returns `true` if the sensors read too much without current, again and again.
    pub const fn are_refused(&self) -> bool {
        self.restarts >= REFUSED_READINGS
    }

    /// Adds a step's currents, A, of sensors whose offset is at most `largest`. What a sound sensor without current
    /// cannot read begins the measurement anew: a single disturbance in the mean would be there for good.
    pub fn add(&mut self, measured: Phases, largest: f32) {
        if !are_sound(measured, largest) {
            *self = Self { restarts: self.restarts.saturating_add(1), ..Self::default() };
            return;
        }
        self.sum = Phases { a: self.sum.a + measured.a, b: self.sum.b + measured.b, c: self.sum.c + measured.c };
        self.steps += 1;
        if self.are_known() {
            const SHARE: f32 = 1.0 / OFFSET_STEPS as f32;
            self.mean = Phases { a: self.sum.a * SHARE, b: self.sum.b * SHARE, c: self.sum.c * SHARE };
            self.restarts = 0;
        }
    }

    /// A step in which a current may flow, behind the measurement: the offsets stay as they are.
    const fn hold(&mut self) {
        self.steps = OFFSET_STEPS;
    }

    /// Follows a step's currents, A, where the joint is off and its velocity (rad/s) that of a joint that stands. A
    /// reading that no sound sensor has at the start is a current, or a broken sensor, and nothing is followed for
    /// a while; so the offsets stay within what a start permits.
    pub fn follow(&mut self, measured: Phases, is_off: bool, velocity: f32, limits: &Limits, largest: f32) {
        let standing = STANDING * limits.velocity;
        if !(is_off && velocity <= standing && velocity >= -standing && are_sound(measured, largest)) {
            self.hold();
        }
        if self.steps < OFFSET_STEPS + QUIET_STEPS {
            self.steps += 1;
            return;
        }
        for (mean, measured) in
            [(&mut self.mean.a, measured.a), (&mut self.mean.b, measured.b), (&mut self.mean.c, measured.c)]
        {
            *mean += FOLLOWED * (measured - *mean);
        }
    }

    /// The currents without the offsets, A.
    #[inline(always)]
    pub fn taken_from(&self, measured: Phases) -> Phases {
        let Self { mean, .. } = self;
        Phases { a: measured.a - mean.a, b: measured.b - mean.b, c: measured.c - mean.c }
    }
}

impl Joint {
    /// Begins a step behind one that left the bridge off: nothing is left of the current loop, and the offsets are
    /// measured or followed. On the way to where the bridge switches lies "switched on", which holds them. In this
    /// module because one board's program has all of it in flash.
    #[inline(never)]
    pub(super) fn rest(&mut self, active: &Active, measured: Phases) {
        self.field_oriented.reset();
        self.monitor.loop_is_off();
        self.regeneration.reset();
        if !self.offsets.are_known() {
            return self.offsets.add(measured, active.largest_offset);
        }
        // Measurements in "fault" are not trusted.
        let is_off = matches!(self.machine.state(), State::SwitchOnDisabled | State::ReadyToSwitchOn);
        self.offsets.follow(measured, is_off, self.found.motion.velocity, &active.limits, active.largest_offset);
    }
}

/// Returns `true` if sound sensors may read this without current, A; not numbers they may not.
fn are_sound(measured: Phases, largest: f32) -> bool {
    let sound = |value: f32| value <= largest && value >= -largest;
    sound(measured.a) && sound(measured.b) && sound(measured.c)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = crate::default_configuration::B_G431B_ESC1.joint.limits;
    const LARGEST: f32 = 5.0;

    /// Known offsets of zero.
    fn known() -> Offsets {
        let mut offsets = Offsets::default();
        (0..OFFSET_STEPS).for_each(|_| offsets.add(Phases::uniform(0.0), LARGEST));
        offsets
    }

    /// A step of a joint that is off and stands.
    fn follow(offsets: &mut Offsets, measured: Phases) {
        offsets.follow(measured, true, 0.0, &LIMITS, LARGEST);
    }

    #[test]
    fn offsets_follow_a_drift_after_a_while() {
        let mut offsets = known();
        let drifted = Phases { a: 1.0, b: -0.5, c: 4.9 };
        (0..QUIET_STEPS).for_each(|_| follow(&mut offsets, drifted));
        assert_eq!(offsets.taken_from(drifted), drifted);
        // Ten time constants.
        (0..10 * 16_384).for_each(|_| follow(&mut offsets, drifted));
        let Phases { a, b, c } = offsets.taken_from(drifted);
        // Less than 2^-10 of an offset is lost in rounding.
        assert!(a.abs() < 5e-3 && b.abs() < 5e-3 && c.abs() < 5e-3, "{a} {b} {c}");
    }

    #[test]
    fn they_stay_while_a_current_may_flow_and_for_a_while_after_it() {
        let standing = STANDING * LIMITS.velocity;
        let (mut offsets, drifted) = (known(), Phases::uniform(1.0));
        let causes: [&dyn Fn(&mut Offsets); 6] = [
            &|offsets| offsets.hold(),
            &|offsets| offsets.follow(drifted, false, 0.0, &LIMITS, LARGEST),
            &|offsets| offsets.follow(drifted, true, 1.01 * standing, &LIMITS, LARGEST),
            &|offsets| offsets.follow(drifted, true, -1.01 * standing, &LIMITS, LARGEST),
            &|offsets| offsets.follow(drifted, true, f32::NAN, &LIMITS, LARGEST),
            &|offsets| follow(offsets, Phases { b: 5.01, ..drifted }),
        ];
        for cause in causes {
            (0..QUIET_STEPS - 1).for_each(|_| follow(&mut offsets, drifted));
            cause(&mut offsets);
        }
        (0..QUIET_STEPS - 1).for_each(|_| follow(&mut offsets, drifted));
        assert_eq!(offsets.mean, Phases::uniform(0.0));
        offsets.follow(drifted, true, 0.99 * standing, &LIMITS, LARGEST);
        follow(&mut offsets, drifted);
        assert!(offsets.mean.a > 0.0);
    }

    #[test]
    fn what_no_sound_sensor_reads_without_current_is_not_followed() {
        for wrong in [5.01, -5.01, f32::NAN, f32::INFINITY] {
            let mut offsets = known();
            (0..3 * QUIET_STEPS).for_each(|_| follow(&mut offsets, Phases { b: wrong, ..Phases::uniform(1.0) }));
            assert_eq!(offsets.mean, Phases::uniform(0.0), "{wrong}");
        }
        let mut offsets = known();
        (0..=QUIET_STEPS).for_each(|_| follow(&mut offsets, Phases::uniform(5.0)));
        assert!(offsets.mean.a > 0.0);
    }

    #[test]
    fn a_disturbance_begins_the_measurement_anew_and_several_refuse_it() {
        let mut offsets = Offsets::default();
        let quiet = Phases { a: 0.5, b: -0.25, c: 0.0 };
        for _ in 0..OFFSET_STEPS - 1 {
            offsets.add(quiet, 5.0);
        }
        offsets.add(Phases { c: f32::NAN, ..quiet }, 5.0);
        assert!(!offsets.are_known() && !offsets.are_refused());
        for _ in 0..REFUSED_READINGS {
            offsets.add(Phases { a: 5.1, ..quiet }, 5.0);
        }
        assert!(offsets.are_refused());
        for _ in 0..OFFSET_STEPS {
            offsets.add(quiet, 5.0);
        }
        assert!(offsets.are_known() && !offsets.are_refused());
        assert_eq!(offsets.taken_from(Phases { a: 1.5, b: -0.25, c: 2.0 }), Phases { a: 1.0, b: 0.0, c: 2.0 });
    }
}
