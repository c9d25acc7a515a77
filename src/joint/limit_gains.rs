//! Gains of the bounds of torque, velocity and position ([limit law](super::limit_law)), prepared; task and control
//! step.

use super::configuration::{Gains, Limits};
use crate::motor::number::{greater, square_root};

/// Part of the longest braking time that the integral of braking takes at least: it has three such times to find a
/// load.
const SHORTEST_INTEGRAL: f32 = 0.05;

/// More than twice the relative error of the root: a square this much above that of a limit has its root above the
/// limit.
const ROOT_RESERVE: f32 = 1e-5;

/// The gains of the limits, prepared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitGains {
    /// Velocity over which the whole torque fades, rad/s.
    pub fade: f32,
    /// Its slope beyond a position limit, 1/s.
    pub slope: f32,
    /// The fade's square, rad²/s².
    pub(super) fade_squared: f32,
    /// Twice the quick stop's deceleration, rad/s².
    pub(super) twice_deceleration: f32,
    /// Square of a speed, rad²/s², that no error of the root brings below the velocity limit.
    beyond_velocity: f32,
    /// Nm/rad of the velocity error's integral while the joint brakes, times the motion loop's period.
    pub braking_integral: f32,
}

impl LimitGains {
    /// Gains for a motion loop with rounds of `period` s.
    pub(super) fn new(limits: &Limits, gains: &Gains, period: f32) -> Self {
        let fade = limits.torque / limits.damping;
        // With it the loop's damping ratio is 0.5 for the largest inertia that the torque can brake so, and more for
        // all others.
        let integral_time = greater(fade / gains.quick_stop_deceleration, SHORTEST_INTEGRAL * gains.braking_time);
        Self {
            fade,
            slope: 2.0 * fade / limits.position_margin,
            fade_squared: fade * fade,
            twice_deceleration: 2.0 * gains.quick_stop_deceleration,
            beyond_velocity: limits.velocity * limits.velocity * (1.0 + ROOT_RESERVE),
            braking_integral: limits.damping / integral_time * period,
        }
    }

    /// A speed, rad/s, of this square; where it is beyond the velocity limit, that one, and no root is taken.
    #[inline(always)]
    pub(super) fn speed(&self, square: f32, limits: &Limits) -> f32 {
        if square > self.beyond_velocity { limits.velocity } else { square_root(square) }
    }
}
