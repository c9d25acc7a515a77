//! Contact that the link runs into: a wall on one side, or a grip that holds it where it is.
//!
//! A spring and a damper between the link and the ground. The torque is taken at the velocity at the end of the step
//! (backward Euler), so even a stop of steel leaves the joint stable.

use crate::error::{ParameterError, within};
use serde::{Deserialize, Serialize};

/// Motions that a contact resists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// A wall above the position: positions beyond it are pushed back, it never pulls.
    Above,
    /// A wall below the position: positions short of it are pushed forward, it never pulls.
    Below,
    /// A grip: every distance from the position is resisted.
    Both,
}

/// A spring and damper between link and ground.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Position at which the spring is unstressed, -1000 to 1000 rad.
    pub position: f64,
    /// Stiffness, 0.1 to 1e9 Nm/rad.
    pub stiffness: f64,
    /// Damping, 0 to 1e7 Nm s/rad.
    pub damping: f64,
    /// Motions that it resists.
    pub side: Side,
}

impl Contact {
    /// Natural frequency of a blocked joint, rad/s: far above every control bandwidth.
    pub const BLOCKED_FREQUENCY: f64 = 2000.0;

    /// A grip at `position` (rad) that holds an `inertia` (kg m²) critically damped at [`Self::BLOCKED_FREQUENCY`].
    #[must_use]
    pub fn blocking(position: f64, inertia: f64) -> Self {
        let frequency = Self::BLOCKED_FREQUENCY;
        let (stiffness, damping) = (inertia * frequency * frequency, 2.0 * inertia * frequency);
        Self { position, stiffness, damping, side: Side::Both }
    }

    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        within("contact.position", self.position, -1000.0, 1000.0)?;
        within("contact.stiffness", self.stiffness, 0.1, 1e9)?;
        within("contact.damping", self.damping, 0.0, 1e7)
    }

    /// Torque against the link over the velocity at the end of a step of `step` seconds that starts at `position`
    /// (rad): the value at velocity zero, Nm, and the slope, Nm s/rad.
    pub(crate) fn prepare(&self, position: f64, step: f64) -> (f64, f64) {
        (self.stiffness * (position - self.position), self.stiffness * step + self.damping)
    }

    /// Returns `true` if a contact of this side can give `torque` (Nm, positive against a forward motion).
    pub(crate) fn gives(&self, torque: f64) -> bool {
        match self.side {
            Side::Above => torque > 0.0,
            Side::Below => torque < 0.0,
            Side::Both => true,
        }
    }

    /// Energy in the spring at `position` (rad), J.
    #[must_use]
    pub fn energy(&self, position: f64) -> f64 {
        let pressed = self.stiffness * (position - self.position);
        if self.gives(pressed) { 0.5 * pressed * (position - self.position) } else { 0.0 }
    }
}
