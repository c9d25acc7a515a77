//! Offsets of the current sensors: the mean of the first steps, in which the bridge is off and no current flows; control step.

use crate::motor::phases::Phases;

/// Control steps over which the current sensors' offsets are measured at the start.
pub const OFFSET_STEPS: u32 = 1024;
/// Largest offset that a sound current sensor has, as a part of the over-current limit.
const LARGEST_OFFSET: f32 = 0.25;
/// Readings beyond it that make a sensor a broken one.
const REFUSED_READINGS: u32 = 3;

/// Measured offsets, or the measurement of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Offsets {
    sum: Phases,
    steps: u32,
    mean: Phases,
    /// How often the measurement began anew.
    restarts: u32,
}

impl Offsets {
    /// Whether the measurement is complete.
    pub const fn are_known(&self) -> bool {
        self.steps >= OFFSET_STEPS
    }

    /// Whether the sensors read too much without current, again and again.
    pub const fn are_refused(&self) -> bool {
        self.restarts >= REFUSED_READINGS
    }

    /// Adds a step's currents, A, of sensors whose over-current limit is `over_current`. What a sound sensor without current cannot
    /// read begins the measurement anew: a single disturbance in the mean would be there for good.
    #[inline(never)]
    pub fn add(&mut self, measured: Phases, over_current: f32) {
        let largest = LARGEST_OFFSET * over_current;
        let sound = |value: f32| value <= largest && value >= -largest;
        if !(sound(measured.a) && sound(measured.b) && sound(measured.c)) {
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

    /// The currents without the offsets, A.
    #[inline(always)]
    pub fn taken_from(&self, measured: Phases) -> Phases {
        let Self { mean, .. } = self;
        Phases { a: measured.a - mean.a, b: measured.b - mean.b, c: measured.c - mean.c }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disturbance_begins_the_measurement_anew_and_several_refuse_it() {
        let mut offsets = Offsets::default();
        let quiet = Phases { a: 0.5, b: -0.25, c: 0.0 };
        for _ in 0..OFFSET_STEPS - 1 {
            offsets.add(quiet, 20.0);
        }
        offsets.add(Phases { c: f32::NAN, ..quiet }, 20.0);
        assert!(!offsets.are_known() && !offsets.are_refused());
        for _ in 0..REFUSED_READINGS {
            offsets.add(Phases { a: 5.1, ..quiet }, 20.0);
        }
        assert!(offsets.are_refused());
        for _ in 0..OFFSET_STEPS {
            offsets.add(quiet, 20.0);
        }
        assert!(offsets.are_known() && !offsets.are_refused());
        assert_eq!(offsets.taken_from(Phases { a: 1.5, b: -0.25, c: 2.0 }), Phases { a: 1.0, b: 0.0, c: 2.0 });
    }
}
