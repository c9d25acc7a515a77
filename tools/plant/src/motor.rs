//! The motor as an ideal torque source: the torque follows the current at once.
//!
//! [`Joint::advance`](crate::Joint::advance) takes this ideal current. At the control rate the windings of
//! [`actuator`](crate::actuator) stand in its place and call [`Joint::drive`](crate::Joint::drive) with the torque that
//! they really give; torque constant and resistance are these here in both cases.

use crate::error::{ParameterError, within};
use serde::{Deserialize, Serialize};

/// Motor and gear ratio.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct MotorParameters {
    /// Torque constant K_t at the rotor, 0.001 to 5 Nm/A of torque-producing current.
    pub torque_constant: f64,
    /// Gear ratio N, rotor revolutions per link revolution, 1 to 300.
    pub gear_ratio: f64,
    /// Inertia of rotor and gear input about the rotor's axis, 1e-8 to 0.1 kg m².
    pub rotor_inertia: f64,
    /// Largest current, 0.1 to 500 A.
    pub current_limit: f64,
    /// Resistance that turns the torque-producing current into copper loss R i², 1e-4 to 50 ohm.
    pub resistance: f64,
}

impl MotorParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        within("motor.torque_constant", self.torque_constant, 0.001, 5.0)?;
        within("motor.gear_ratio", self.gear_ratio, 1.0, 300.0)?;
        within("motor.rotor_inertia", self.rotor_inertia, 1e-8, 0.1)?;
        within("motor.current_limit", self.current_limit, 0.1, 500.0)?;
        within("motor.resistance", self.resistance, 1e-4, 50.0)
    }

    /// Torque at the link per ampere, K_t N, Nm/A.
    #[must_use]
    pub fn torque_per_ampere(&self) -> f64 {
        self.torque_constant * self.gear_ratio
    }

    /// Largest torque at the link before friction, Nm.
    #[must_use]
    pub fn torque_limit(&self) -> f64 {
        self.torque_per_ampere() * self.current_limit
    }

    /// Rotor inertia as the link feels it, N² J, kg m².
    #[must_use]
    pub fn reflected_inertia(&self) -> f64 {
        self.gear_ratio * self.gear_ratio * self.rotor_inertia
    }

    /// Current that gives `torque` (Nm at the link), limited to the current limit, A.
    #[must_use]
    pub fn current_for(&self, torque: f64) -> f64 {
        (torque / self.torque_per_ampere()).clamp(-self.current_limit, self.current_limit)
    }

    /// Heat in the windings at `current` (A), W.
    #[must_use]
    pub fn copper_loss(&self, current: f64) -> f64 {
        self.resistance * current * current
    }
}
