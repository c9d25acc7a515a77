//! Load of a joint, and the gains with which its torques are computed; task, host.

use super::configuration::{CollisionReaction, Configuration, LoadConfiguration, LoadFeedforwardRequest};
use crate::motor::number::greater;
use friction_compensation::sine::cos_sin_of;

/// Standard gravity, m/s².
pub const STANDARD_GRAVITY: f32 = 9.806_65;

/// Inertia and gravity with the payload.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// kg m².
    pub inertia: f32,
    /// Largest gravity torque, Nm.
    pub gravity: f32,
    /// Position in which it hangs, rad.
    pub hanging: f32,
}

impl Load {
    /// Load as configured.
    pub fn of(load: &LoadConfiguration) -> Self {
        let moment = load.payload_mass * load.payload_arm;
        Self {
            inertia: load.inertia + moment * load.payload_arm,
            gravity: load.gravity + moment * STANDARD_GRAVITY,
            hanging: load.hanging,
        }
    }

    /// Torque that holds the load at a position (rad), Nm.
    pub fn gravity_torque(&self, position: f32) -> f32 {
        let (_, sine) = cos_sin_of(position - self.hanging);
        self.gravity * sine
    }
}

/// Parameters of the feedforward, from a configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadGains {
    /// Torques that are requested.
    pub request: LoadFeedforwardRequest,
    /// Load that is moved.
    pub load: Load,
    /// Largest acceleration, rad/s².
    pub acceleration: f32,
    /// Nm.
    pub torque_limit: f32,
    /// Part of the load that may be lacking or too much: u / (1 - u) of the configured uncertainty u.
    pub load_wrong: f32,
    /// Part of a collision's torque beyond the uncertainty, Nm.
    pub collision_threshold: f32,
    /// Reaction to a collision.
    pub collision_reaction: CollisionReaction,
}

impl LoadGains {
    /// Gains of a joint without load.
    pub const NONE: Self = Self {
        request: LoadFeedforwardRequest::Off,
        load: Load { inertia: 0.0, gravity: 0.0, hanging: 0.0 },
        acceleration: 0.0,
        torque_limit: 0.0,
        load_wrong: 0.0,
        collision_threshold: 0.0,
        collision_reaction: CollisionReaction::Off,
    };

    /// Gains of a configuration.
    pub fn of(configuration: &Configuration) -> Self {
        let Configuration { load, gains, limits, .. } = configuration;
        Self {
            request: load.request,
            load: Load::of(load),
            acceleration: greater(gains.acceleration, gains.quick_stop_deceleration),
            torque_limit: limits.torque,
            load_wrong: load.uncertainty / (1.0 - load.uncertainty),
            collision_threshold: load.collision_threshold,
            collision_reaction: load.collision_reaction,
        }
    }
}
