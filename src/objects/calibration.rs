//! Object 2107h: the calibration of the motor, from the current that begins it to the configuration with what it found; task.

use super::field::CalibrationField;
use crate::motor::calibration::{Calibration, Failure, Progress};

/// What was asked for, and whether what came of it is still to be taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct CalibrationState {
    /// A; 0 where none was begun.
    current: f32,
    /// It has not ended, as far as the objects know.
    begun: bool,
}

impl CalibrationState {
    pub fn begin(&mut self, current: f32) {
        *self = Self { current, begun: true };
    }

    /// What was found and is to be taken, until [`CalibrationState::taken`].
    pub fn result(&mut self, progress: Option<Progress>) -> Option<Calibration> {
        if !self.begun {
            return None;
        }
        match progress {
            Some(Progress::Done(found)) => Some(found),
            Some(Progress::Failed(_)) => {
                self.begun = false;
                None
            }
            _ => None,
        }
    }

    pub fn taken(&mut self) {
        self.begun = false;
    }

    /// The value as its object carries it.
    pub fn get(&self, field: CalibrationField, progress: Option<Progress>) -> u64 {
        let failure = || match progress {
            Some(Progress::Failed(failure)) => Some(failure),
            _ => None,
        };
        let found = |value: fn(&Calibration) -> f32| match progress {
            Some(Progress::Done(found)) => value(&found),
            _ => 0.0,
        };
        let number = match field {
            CalibrationField::Progress => return number(progress).into(),
            CalibrationField::Failure => return failure().as_ref().map_or(0, Failure::number).into(),
            CalibrationField::Current => self.current,
            CalibrationField::Value => failure().map_or(0.0, |failure| failure.numbers().0),
            CalibrationField::Limit => failure().map_or(0.0, |failure| failure.numbers().1),
            CalibrationField::Lag => found(|found| found.lag),
            CalibrationField::LostVoltage => found(|found| found.lost_voltage),
        };
        number.to_bits().into()
    }
}

/// Whether the bridge may switch for it.
pub(super) const fn runs(progress: Option<Progress>) -> bool {
    !matches!(progress, None | Some(Progress::Done(_) | Progress::Failed(_)))
}

/// Number of object 2107h:2.
const fn number(progress: Option<Progress>) -> u8 {
    match progress {
        None => 0,
        Some(Progress::Offsets) => 1,
        Some(Progress::Resistance) => 2,
        Some(Progress::Inductance) => 3,
        Some(Progress::Alignment) => 4,
        Some(Progress::RampDown) => 5,
        Some(Progress::Done(_)) => 6,
        Some(Progress::Failed(_)) => 7,
    }
}
