//! The supply: a source behind a resistance, and the capacitor of the board.
//!
//! C V' = (V_source - V)/R - i, stepped by the backward Euler rule. A source that cannot take current back (a
//! laboratory supply, an adapter) stops conducting when the motor brakes, and the capacitor's voltage rises.

use crate::error::{ParameterError, within};
use serde::{Deserialize, Serialize};

/// Source and capacitor.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct BusParameters {
    /// Voltage of the source without load, 5 to 400 V.
    pub source_voltage: f64,
    /// Resistance of source and cable, 1e-4 to 10 ohm.
    pub source_resistance: f64,
    /// Capacitance of the board, 1e-6 to 0.1 F.
    pub capacitance: f64,
    /// `true` if the source takes current back: a battery does, a laboratory supply does not.
    pub takes_back: bool,
}

impl BusParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        within("bus.source_voltage", self.source_voltage, 5.0, 400.0)?;
        within("bus.source_resistance", self.source_resistance, 1e-4, 10.0)?;
        within("bus.capacitance", self.capacitance, 1e-6, 0.1)
    }
}

/// The bus with its voltage.
#[derive(Clone, Debug)]
pub struct Bus {
    parameters: BusParameters,
    source_voltage: f64,
    voltage: f64,
    source_current: f64,
}

impl Bus {
    /// A charged bus.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn new(parameters: BusParameters) -> Result<Self, ParameterError> {
        parameters.validate()?;
        let source_voltage = parameters.source_voltage;
        Ok(Self { parameters, source_voltage, voltage: source_voltage, source_current: 0.0 })
    }

    /// Voltage of the bus, V; never negative.
    #[must_use]
    pub fn voltage(&self) -> f64 {
        self.voltage
    }

    /// Current out of the source over the last step, A.
    #[must_use]
    pub fn source_current(&self) -> f64 {
        self.source_current
    }

    /// Energy in the capacitor, J.
    #[must_use]
    pub fn stored_energy(&self) -> f64 {
        0.5 * self.parameters.capacitance * self.voltage * self.voltage
    }

    /// Another voltage of the source (V), or its own again.
    pub fn set_source_voltage(&mut self, voltage: Option<f64>) {
        self.source_voltage = voltage.unwrap_or(self.parameters.source_voltage);
    }

    /// Moves on by `step` seconds while the board takes `current` (A, negative when it feeds the bus) and a conductance
    /// of `conductance` (1/ohm) lies across the rails.
    pub fn advance(&mut self, current: f64, conductance: f64, step: f64) {
        let p = &self.parameters;
        let (storage, source) = (p.capacitance / step, 1.0 / p.source_resistance);
        let charge = storage * self.voltage - current;
        let connected = (charge + source * self.source_voltage) / (storage + source + conductance);
        if connected <= self.source_voltage || p.takes_back {
            self.voltage = connected.max(0.0);
            self.source_current = (self.source_voltage - self.voltage) * source;
        } else {
            self.voltage = (charge / (storage + conductance)).max(0.0);
            self.source_current = 0.0;
        }
    }
}
