//! The three phase-current sensors: offset, gain, noise, and a converter with a range.

use super::delay::MAXIMUM_DELAY;
use crate::error::{ParameterError, count_within, within};
use serde::{Deserialize, Serialize};

/// Shunts, amplifiers and converter.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct CurrentSensorParameters {
    /// Current that each sensor reports at zero, -50 to 50 A.
    pub offset: [f64; 3],
    /// Relative error of each gain, -0.2 to 0.2.
    pub gain_error: [f64; 3],
    /// Standard deviation of each reading, 0 to 10 A.
    pub noise: f64,
    /// Current for one count of the converter, 0 (not quantised) to 5 A.
    pub resolution: f64,
    /// Lowest reading of the converter, -1000 to -0.1 A.
    pub lowest: f64,
    /// Highest reading of the converter, 0.1 to 1000 A.
    pub highest: f64,
    /// Age of a reading, 0 to 7 periods.
    pub delay: usize,
}

impl CurrentSensorParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for (offset, gain_error) in self.offset.iter().zip(&self.gain_error) {
            within("currents.offset", *offset, -50.0, 50.0)?;
            within("currents.gain_error", *gain_error, -0.2, 0.2)?;
        }
        within("currents.noise", self.noise, 0.0, 10.0)?;
        within("currents.resolution", self.resolution, 0.0, 5.0)?;
        within("currents.lowest", self.lowest, -1000.0, -0.1)?;
        within("currents.highest", self.highest, 0.1, 1000.0)?;
        count_within("currents.delay", self.delay, 0, MAXIMUM_DELAY)
    }
}
