//! Friction compensation in the joint: which state the model sees, what holds it back near standstill, and the energy guard;
//! control step.
//!
//! Two things keep compensation from moving a joint by itself. Where the command has a velocity, friction is computed for that
//! velocity: a pure feedforward, which no error of the model can turn into an instability, and zero while nothing is asked for.
//! Where there is none (torque mode), friction is computed for the measured velocity, and that is a positive feedback. It is held by the
//! fade near standstill and by the guard: while the joint speeds up although its command does not push it that way, the
//! compensation backs off within milliseconds, and it comes back only while the command pushes.

use super::active::{Active, JointMotion};
use super::configuration::VelocitySource;
use super::motion_law::Wanted;
use crate::compensation::{Compensation, Output};
use crate::friction::state::JointState;
use crate::motor::number::{greater, or_zero, within};
use crate::quantity::{Acceleration, Position, Temperature, Torque, Velocity};

/// Time over which the reference's acceleration is taken, s: several commands of a bus at 1 kHz.
const DERIVATIVE: f32 = 0.004;
/// Growth of the speed against its mean, as a fraction, from which the joint counts as speeding up.
const GROWTH: f32 = 0.01;

/// What compensation does until the next round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compensated {
    /// Torque to add, Nm.
    pub torque: f32,
    /// What the model said, and why.
    pub output: Output,
    /// Part that standstill and guard let through, 0 to 1.
    pub permitted: f32,
}

impl Compensated {
    /// No compensation.
    pub const NOTHING: Self = Self { torque: 0.0, output: Output::NOTHING, permitted: 0.0 };
}

impl Default for Compensated {
    fn default() -> Self {
        Self::NOTHING
    }
}

/// What friction depends on besides this joint's motion and torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Of the gear, °C.
    pub temperature: f32,
    /// Of the joint that shares the drive, rad/s.
    pub coupled_velocity: f32,
}

/// Compensation, from one round of the motion loop to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionFeedforward {
    compensation: Compensation,
    /// What the guard has taken away, 0 to 1.
    withheld: f32,
    /// Slow mean of the speed, rad/s.
    speed: f32,
    /// Reference velocity, rad/s, as a first-order lag follows it; what it lacks is its acceleration.
    reference: Option<f32>,
}

/// The command's velocity, where friction is computed for that, rad/s.
#[inline(always)]
fn reference(active: &Active, wanted: &Wanted) -> Option<f32> {
    match active.compensation.source {
        VelocitySource::Reference => wanted.velocity,
        VelocitySource::Measured => None,
    }
}

/// To Q16.16; held at the ends of the range, zero for what is not a number.
fn q16(value: f32) -> i32 {
    (value * 65536.0) as i32
}

impl FrictionFeedforward {
    /// Forgets the past.
    #[inline(never)]
    pub fn reset(&mut self) {
        self.compensation.reset();
        (self.withheld, self.speed, self.reference) = (0.0, 0.0, None);
    }

    /// First stage of a round: the state that friction is computed for, and its regime. `measured_torque` is the torque of the measured current, Nm.
    #[inline(always)]
    pub fn begin(
        &mut self,
        active: &Active,
        motion: &JointMotion,
        wanted: &Wanted,
        measured_torque: f32,
        surroundings: &Surroundings,
    ) {
        let gains = &active.compensation;
        let reference = reference(active, wanted);
        let velocity = reference.unwrap_or(motion.velocity);
        let acceleration = self.acceleration(gains.period, reference, motion);
        let state = JointState {
            position: Position::from_bits(q16(motion.position)),
            velocity: Velocity::from_bits(q16(velocity)),
            acceleration: Acceleration::from_bits(q16(acceleration)),
            theoretical_torque: Torque::from_bits(q16(wanted.torque)),
            measured_torque: Torque::from_bits(q16(measured_torque)),
            temperature: Temperature::from_bits(q16(surroundings.temperature)),
            coupled_velocity: Velocity::from_bits(q16(surroundings.coupled_velocity)),
        };
        self.compensation.begin(active.friction.as_ref(), &gains.settings, &state);
    }

    /// Second stage: friction by the network.
    #[inline(always)]
    pub fn network(&mut self, active: &Active) {
        self.compensation.network(active.friction.as_ref());
    }

    /// Third stage: friction by the physical model.
    #[inline(always)]
    pub fn physical_model(&mut self, active: &Active) {
        self.compensation.physical_model(active.friction.as_ref());
    }

    /// Last stage: the torque to add until the next round's.
    #[inline(always)]
    pub fn compensate(&mut self, active: &Active, motion: &JointMotion, wanted: &Wanted) -> Compensated {
        let gains = &active.compensation;
        let output = self.compensation.finish(active.friction.as_ref(), &gains.settings);
        let reference = reference(active, wanted);
        let velocity = reference.unwrap_or(motion.velocity);
        let speed = if velocity < 0.0 { -velocity } else { velocity };
        let standstill = within(speed * gains.inverse_standstill, 0.0, 1.0);
        let guarded = match reference {
            Some(_) => 1.0,
            None => self.guard(active, motion, wanted.velocity.unwrap_or(wanted.torque)),
        };
        let permitted = or_zero(standstill * guarded);
        // Where nothing is added, not even the sign of a zero changes.
        let torque = output.torque.to_bits() as f32 * (1.0 / 65536.0) * permitted;
        Compensated { torque, output, permitted }
    }

    /// Acceleration for the model, rad/s²: the reference's, where there is one. The measured one is mostly noise, and a sign of noise
    /// switches the friction of a hysteresis back and forth.
    fn acceleration(&mut self, period: f32, reference: Option<f32>, motion: &JointMotion) -> f32 {
        let Some(velocity) = reference else {
            self.reference = None;
            return motion.acceleration;
        };
        let lagging = self.reference.unwrap_or(velocity);
        let acceleration = (velocity - lagging) * (1.0 / DERIVATIVE);
        self.reference = Some(or_zero(lagging + acceleration * period));
        acceleration
    }

    /// Part of the compensation that the energy guard lets through. `commanded` says by its sign which way the command pushes: the
    /// velocity that it asks for, or in torque mode its torque. A spring's torque does not count: around a held position
    /// it pushes back and forth, and too much compensation makes it hunt.
    #[inline(never)]
    fn guard(&mut self, active: &Active, motion: &JointMotion, commanded: f32) -> f32 {
        let gains = &active.compensation;
        let speed = if motion.velocity < 0.0 { -motion.velocity } else { motion.velocity };
        let growing = speed > (1.0 + GROWTH) * self.speed && speed > gains.standstill;
        self.speed += gains.guard.mean * (or_zero(speed) - self.speed);
        let pushed = if motion.velocity < 0.0 { commanded < 0.0 } else { commanded > 0.0 };
        if growing && !pushed {
            self.withheld += gains.guard.back_off;
        } else if pushed {
            self.withheld -= gains.guard.recovery;
        }
        self.withheld = within(self.withheld, 0.0, 1.0);
        greater(1.0 - self.withheld, 0.0)
    }

    /// What the guard withholds, 0 to 1.
    pub fn withheld(&self) -> f32 {
        self.withheld
    }
}
