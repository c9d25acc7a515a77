//! The link as a pendulum: an inertia, and a mass on an arm.

use crate::error::{ParameterError, within};
use serde::{Deserialize, Serialize};

/// Standard gravity, m/s².
pub const GRAVITY: f64 = 9.80665;

/// Load on the gear's output.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct LoadParameters {
    /// Inertia of the link about the joint without the payload, 0 to 100 kg m².
    pub inertia: f64,
    /// Payload, a point mass, 0 to 100 kg.
    pub mass: f64,
    /// Distance of the payload from the joint's axis, 0 to 3 m.
    pub length: f64,
}

impl LoadParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        within("load.inertia", self.inertia, 0.0, 100.0)?;
        within("load.mass", self.mass, 0.0, 100.0)?;
        within("load.length", self.length, 0.0, 3.0)
    }

    /// Inertia of link and payload about the joint, kg m².
    #[must_use]
    pub fn total_inertia(&self) -> f64 {
        self.inertia + self.mass * self.length * self.length
    }

    /// Largest gravity torque, with the arm horizontal, Nm.
    #[must_use]
    pub fn gravity_amplitude(&self) -> f64 {
        self.mass * GRAVITY * self.length
    }

    /// Torque needed to hold the arm at `position` (rad, zero hanging down), Nm.
    #[must_use]
    pub fn gravity_torque(&self, position: f64) -> f64 {
        self.gravity_amplitude() * libm::sin(position)
    }
}
