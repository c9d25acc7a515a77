//! The drive that recorded the log: a plain position controller and a plain velocity filter.
//!
//! It knows the joint's inertia and payload from its data sheet and nothing of its friction, and it sees only what
//! the sensors report.

use crate::excitation::Reference;
use crate::parameters::JointParameters;
use crate::sensors::Measurement;
use std::f64::consts::TAU;

/// Longest control cycle, s.
pub const MAXIMUM_CYCLE: f64 = 1e-3;

/// Corner frequency of the velocity filter, Hz.
pub const VELOCITY_CORNER: f64 = 40.0;

/// Position error that the controller allows to the largest dry friction, rad.
pub const FRICTION_ERROR: f64 = 0.03;

/// What the drive knows after one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Velocity from the encoder, rad/s.
    pub velocity: f64,
    /// Torque asked for at the link, within the torque limit, Nm.
    pub torque: f64,
}

/// A drive with its controller tuned to one joint.
#[derive(Clone, Debug)]
pub struct Drive {
    parameters: JointParameters,
    stiffness: f64,
    damping: f64,
    previous: Option<f64>,
    velocity: f64,
}

impl Drive {
    /// Tunes the controller: as stiff as [`FRICTION_ERROR`] asks, with 20 to 60 rad/s of bandwidth.
    #[must_use]
    pub fn new(parameters: &JointParameters) -> Self {
        let inertia = parameters.inertia();
        let breakaway = parameters.friction.breakaway.forward.max(parameters.friction.breakaway.backward);
        let bandwidth = (breakaway / (FRICTION_ERROR * inertia)).sqrt().clamp(20.0, 60.0);
        Self {
            parameters: *parameters,
            stiffness: inertia * bandwidth * bandwidth,
            damping: 2.0 * 0.8 * inertia * bandwidth,
            previous: None,
            velocity: 0.0,
        }
    }

    /// One control cycle, `period` seconds after the last.
    pub fn cycle(&mut self, reference: &Reference, measured: &Measurement, period: f64) -> Command {
        let difference = (measured.position - self.previous.unwrap_or(measured.position)) / period;
        self.previous = Some(measured.position);
        self.velocity += (difference - self.velocity) * period / (period + 1.0 / (TAU * VELOCITY_CORNER));

        let torque = self.stiffness * (reference.position - measured.position)
            + self.damping * (reference.velocity - self.velocity)
            + self.parameters.load.gravity_torque(measured.position);
        let limit = self.parameters.motor.torque_limit();
        Command { velocity: self.velocity, torque: torque.clamp(-limit, limit) }
    }
}
