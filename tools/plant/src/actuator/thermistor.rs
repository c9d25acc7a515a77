//! A temperature sensor: slow, coarse, with a range whose ends are what a broken one reads.

use crate::error::{ParameterError, within};
use serde::{Deserialize, Serialize};

/// A negative-temperature-coefficient resistor with its converter.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ThermistorParameters {
    /// `true` if the board has this sensor; without, the reading is not a number.
    pub fitted: bool,
    /// Time constant, 0 to 300 s.
    pub lag: f64,
    /// Temperature for one count of the converter, 0 (not quantised) to 10 K.
    pub resolution: f64,
    /// Lowest reading, -100 to 0 °C: what an open sensor reads.
    pub lowest: f64,
    /// Highest reading, 100 to 400 °C: what a shorted sensor reads.
    pub highest: f64,
}

impl ThermistorParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        within("thermistor.lag", self.lag, 0.0, 300.0)?;
        within("thermistor.resolution", self.resolution, 0.0, 10.0)?;
        within("thermistor.lowest", self.lowest, -100.0, 0.0)?;
        within("thermistor.highest", self.highest, 100.0, 400.0)
    }

    /// Temperature of the sensor's bead, `period` seconds after it was at `bead`, on something at `temperature`, °C.
    #[must_use]
    pub fn followed(&self, bead: f64, temperature: f64, period: f64) -> f64 {
        bead + (temperature - bead) * period / (period + self.lag)
    }
}
