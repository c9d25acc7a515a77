//! Conversion of a command into a torque: ramps, stiffness and damping; control step, once a round of the motion loop.
//!
//! The torque stays within the [bounds](super::limit_law) of the limits, whatever a mode and its gains want.

use super::active::{Active, JointMotion};
use super::command::{Command, CommandLimits, Mode, PROFILES};
use super::limit_law::Bounds;
use crate::motor::number::{greater, lesser, limited, or_zero};

/// Torque, velocity and push that a command wants in this round.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wanted {
    /// Torque before friction compensation, within every limit, Nm.
    pub torque: f32,
    /// Velocity that the command asks for at this instant, rad/s; none in torque mode.
    pub velocity: Option<f32>,
    /// The command's push, Nm.
    pub push: f32,
}

/// Ramps and integrals, from one round of the motion loop to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionLaw {
    mode: Option<Mode>,
    /// Reference that ramps towards the command, rad; in modes without one the joint's own position.
    position: f32,
    /// rad/s.
    velocity: f32,
    /// Nm.
    integral: f32,
    /// Bounds of the torque.
    bounds: Bounds,
    /// The joint brakes: no mode.
    brakes: bool,
    /// Joint's zero that the reference counts from, rad.
    zero: f32,
}

impl MotionLaw {
    /// Forgets the past: ramps start where the joint is.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// One round towards a command. `derating` is the part of the torque limit that is permitted, 0 to 1. What is not a
    /// number counts as zero; the torque is always within the limit.
    #[inline(always)]
    pub fn step(&mut self, active: &Active, command: &Command, motion: &JointMotion, derating: f32) -> Wanted {
        if self.mode != Some(command.mode) {
            self.enter(command.mode, motion);
        }
        let gains = &active.motion;
        let (torque, velocity) = match command.mode {
            // The open loop knows no torque.
            Mode::Torque | Mode::OpenLoop => (0.0, None),
            Mode::Velocity => {
                self.approach_velocity(limited(command.velocity, active.limits.velocity), &command.limits, active);
                let error = self.velocity - motion.velocity;
                self.integral += gains.velocity_integral * error;
                (gains.damping * error + self.integral, Some(self.velocity))
            }
            Mode::Position | Mode::Profile | Mode::Hold => {
                self.follow(command, active);
                let error = self.position - motion.position;
                self.integral += gains.position_integral * error;
                let damped = gains.damping * (self.velocity - motion.velocity);
                (gains.stiffness * error + damped + self.integral, Some(self.velocity))
            }
            Mode::Impedance => {
                let stiffness = limited(greater(command.stiffness, 0.0), 1e5);
                let damping = limited(greater(command.damping, 0.0), 1e4);
                let spring = stiffness * (command.position - motion.position);
                (spring + damping * (command.velocity - motion.velocity), Some(or_zero(command.velocity)))
            }
        };
        let limit = lesser(command.limits.torque(), active.limits.torque) * derating;
        self.integral = limited(self.integral, limit);
        // Two opposite infinities add up to no number.
        let torque = or_zero(or_zero(torque) + or_zero(command.torque));
        self.bounds = Bounds::at(active, motion, limit);
        if PROFILES && !matches!(command.mode, Mode::Position | Mode::Profile | Mode::Hold) {
            self.position = motion.position;
        }
        Wanted { torque: self.bounds.hold(torque), velocity, push: command.push }
    }

    /// Follows a zero that the joint's positions count from since the last round, and tells whether it is another one:
    /// what was remembered of positions means nothing then.
    #[inline(always)]
    pub fn counts_anew(&mut self, active: &Active) -> bool {
        let (before, zero) = (self.zero, active.scales.zero());
        self.zero = zero;
        self.position += zero - before;
        zero != before
    }

    /// Bounds of the torque of this round, compensation included.
    #[inline(always)]
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// One round of braking: the velocity comes down along a ramp by so much, rad/s, by the limit damping and an
    /// integral of its own, whatever the modes' gains are.
    #[inline(never)]
    pub fn brake(&mut self, active: &Active, motion: &JointMotion, step: f32) -> Wanted {
        if !self.brakes {
            *self = Self { velocity: motion.velocity, brakes: true, ..Self::default() };
        }
        self.ramp(0.0, step);
        let (gains, limit) = (&active.limit_gains, active.limits.torque);
        let error = self.velocity - motion.velocity;
        let damped = limited(active.limits.damping * error, limit);
        let torque = limited(damped + self.integral + gains.braking_integral * error, limit);
        // Torque that the limit has cut off is not integrated: it would drive the joint back after its stop.
        self.integral = torque - damped;
        if PROFILES {
            self.position = motion.position;
        }
        Wanted { torque, velocity: Some(self.velocity), push: 0.0 }
    }

    /// Position that is asked for at this instant, rad; in modes without one the joint's own. With [`PROFILES`] alone.
    #[inline(always)]
    pub fn position(&self) -> f32 {
        self.position
    }

    /// The joint is asked to be where it is, until a round says something else.
    #[inline(always)]
    pub fn begin_at(&mut self, motion: &JointMotion) {
        self.position = motion.position;
    }

    /// Returns `true` if braking's ramp has come to its end.
    pub fn ramp_is_over(&self) -> bool {
        self.velocity == 0.0
    }

    /// Begins a mode where the joint is. What moves or holds it goes on without a step from one of these modes to
    /// another: velocity, position, profile and hold share ramp and integral, all but velocity the reference too.
    /// Braking's ramp and integral they take over.
    #[inline(never)]
    fn enter(&mut self, mode: Mode, motion: &JointMotion) {
        let ramps = |mode| matches!(mode, Mode::Velocity | Mode::Position | Mode::Profile | Mode::Hold);
        let goes_on = (self.brakes || self.mode.is_some_and(ramps)) && ramps(mode);
        // Field by field: the compiler would copy the whole record, byte by byte where it is optimised for size.
        if !goes_on {
            (self.integral, self.bounds) = (0.0, Bounds::default());
        }
        if !goes_on || self.brakes || self.mode == Some(Mode::Velocity) {
            self.position = motion.position;
        }
        if !goes_on || mode == Mode::Velocity {
            self.velocity = motion.velocity;
        }
        (self.mode, self.brakes) = (Some(mode), false);
    }

    fn ramp(&mut self, target: f32, step: f32) {
        self.velocity += limited(target - self.velocity, step);
    }

    /// The ramp towards a velocity, with the command's accelerations within the joint's own.
    #[inline(always)]
    fn approach_velocity(&mut self, target: f32, limits: &CommandLimits, active: &Active) {
        let step = if PROFILES { self.velocity_step(target, limits, active) } else { active.motion.velocity_step };
        self.ramp(target, step);
    }

    /// rad/s a round.
    #[inline(never)]
    fn velocity_step(&self, target: f32, limits: &CommandLimits, active: &Active) -> f32 {
        // Up to a standstill a velocity of the other sign is a lower one.
        let rises = if self.velocity < 0.0 { target < self.velocity } else { target > self.velocity };
        let acceleration = if rises || self.velocity == 0.0 { limits.acceleration() } else { limits.deceleration() };
        lesser(acceleration * active.motion.period, active.motion.velocity_step)
    }

    /// One round of the reference: towards the command's position, or to a stop.
    #[inline(never)]
    fn follow(&mut self, command: &Command, active: &Active) {
        match command.mode {
            Mode::Hold => self.ramp(0.0, active.motion.hold_step),
            _ => {
                let velocity = self.approach(command.position, &command.limits, active);
                self.approach_velocity(velocity, &command.limits, active);
            }
        }
        self.position += self.velocity * active.motion.period;
    }

    /// Velocity of the fastest approach to `target` from which the ramp can still stop there (trapezoidal profile, in
    /// closed loop).
    #[inline(always)]
    fn approach(&self, target: f32, limits: &CommandLimits, active: &Active) -> f32 {
        let gains = &active.motion;
        let (low, high) = active.limits.position;
        let target = if target < low {
            low
        } else if target > high {
            high
        } else {
            target
        };
        let way = or_zero(target - self.position);
        let distance = if way < 0.0 { -way } else { way };
        let deceleration = lesser(limits.deceleration(), gains.acceleration);
        // Of the way that the next round needs anyway, nothing is left to brake on.
        let speed =
            lesser(active.limit_gains.speed(2.0 * deceleration * distance, &active.limits), distance * gains.rate);
        let speed = lesser(speed, lesser(limits.velocity(), active.limits.velocity));
        if way < 0.0 { -speed } else { speed }
    }
}
