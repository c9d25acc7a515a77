//! Command to the joint; written by a task, read by the control step.

use super::state_machine::Controlword;
use crate::motor::number::greater;
use crate::motor::open_loop::Frame;

/// Modes of operation (object 6060h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// The commanded torque, within all limits.
    #[default]
    Torque,
    /// A velocity, reached along a ramp, held by damping and integral.
    Velocity,
    /// A position, reached with limited velocity and acceleration, held by stiffness, damping and a slow integral.
    Position,
    /// The same for a position that is the end of a motion: it ends by itself, so no set-point can be late.
    Profile,
    /// Stiffness and damping around a position and a velocity, and a torque, all of the command's own.
    Impedance,
    /// A voltage along a turning field, for commissioning ([`crate::motor::open_loop`]).
    OpenLoop,
    /// The position in which the joint comes to a stop. No set-point counts, so none can be late.
    Hold,
}

/// Presence of the profile modes, and of limits that come with a command, in this program. With the feature
/// `little-room` a chip's program does not have them; on the host nothing changes.
pub const PROFILES: bool = !cfg!(all(feature = "little-room", target_os = "none"));

/// Limits of a command, within the joint's own ([`Limits`](super::configuration::Limits),
/// [`Gains`](super::configuration::Gains)): what is beyond those counts as they do. Where a program has no profile
/// modes it limits nothing and takes no room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandLimits {
    /// Velocity, acceleration, deceleration, torque.
    values: [f32; 4 * PROFILES as usize],
}

impl CommandLimits {
    /// The joint's own limits alone.
    pub const NONE: Self = Self { values: [f32::INFINITY; 4 * PROFILES as usize] };

    /// A profile: velocity of a position's reference, rad/s, with zero it stands; accelerations while its speed rises
    /// and while it falls, rad/s², of velocity modes, too. The torque, Nm, is that of command and compensation in
    /// every mode; braking has all that the joint has. What is negative or not a number is zero; an acceleration of
    /// zero, with which a joint that moves would never stop, limits nothing.
    pub fn new(velocity: f32, acceleration: f32, deceleration: f32, torque: f32) -> Self {
        let above_zero = |value: f32| if value > 0.0 { value } else { f32::INFINITY };
        let values = [greater(velocity, 0.0), above_zero(acceleration), above_zero(deceleration), greater(torque, 0.0)];
        let mut limits = Self::NONE;
        limits.values.iter_mut().zip(values).for_each(|(place, value)| *place = value);
        limits
    }

    #[inline(always)]
    fn value(&self, number: usize) -> f32 {
        self.values.get(number).copied().unwrap_or(f32::INFINITY)
    }

    /// rad/s.
    #[inline(always)]
    pub fn velocity(&self) -> f32 {
        self.value(0)
    }

    /// rad/s².
    #[inline(always)]
    pub fn acceleration(&self) -> f32 {
        self.value(1)
    }

    /// rad/s².
    #[inline(always)]
    pub fn deceleration(&self) -> f32 {
        self.value(2)
    }

    /// Nm.
    #[inline(always)]
    pub fn torque(&self) -> f32 {
        self.value(3)
    }
}

/// One set-point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Mode, which decides the fields that count.
    pub mode: Mode,
    /// rad; position and impedance modes.
    pub position: f32,
    /// rad/s; velocity and impedance mode.
    pub velocity: f32,
    /// Nm; torque mode, and added in every other one.
    pub torque: f32,
    /// The part of the torque that pushes the joint to where it is to go, Nm, by its sign for the
    /// [energy guard](super::friction_feedforward) in torque mode. What holds gravity is none of it; zero where nobody
    /// said what holds.
    pub push: f32,
    /// Nm/rad; impedance mode, 0 to 1e5.
    pub stiffness: f32,
    /// Nm s/rad; impedance mode, 0 to 1e4.
    pub damping: f32,
    /// Its limits.
    pub limits: CommandLimits,
    /// Open loop.
    pub open_loop: Frame,
}

impl Command {
    /// No torque, in torque mode.
    pub const NOTHING: Self = Self {
        mode: Mode::Torque,
        position: 0.0,
        velocity: 0.0,
        torque: 0.0,
        push: 0.0,
        stiffness: 0.0,
        damping: 0.0,
        limits: CommandLimits::NONE,
        open_loop: Frame { voltage: 0, speed: 0, along: 0, across: 0 },
    };
}

impl Command {
    /// Adds the feedforward of the load ([`super::load_feedforward`]), Nm, to a command that has a reference velocity.
    /// It pushes nowhere. Zero leaves every bit as it is.
    #[inline(always)]
    pub fn bear(&mut self, load: f32) {
        if load != 0.0 && !matches!(self.mode, Mode::Torque | Mode::OpenLoop) {
            self.torque += load;
        }
    }

    /// The same torque, and the load's feedforward, without spring and damper: the joint gives way.
    pub fn giving_way(self) -> Self {
        Self { mode: Mode::Impedance, position: 0.0, velocity: 0.0, stiffness: 0.0, damping: 0.0, ..self }
    }
}

impl Default for Command {
    fn default() -> Self {
        Self::NOTHING
    }
}

/// Demand on the joint in a control step. The set-point is looked at once a round of the motion loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demand {
    /// Controlword for the state machine.
    pub controlword: Controlword,
    /// The newest set-point.
    pub command: Command,
    /// Changes with every set-point that arrives, also where its content is the same: the command deadline counts from
    /// here.
    pub sequence: u32,
    /// The joint that shares this joint's drive.
    pub coupled: Coupled,
}

/// Velocity of the joint that shares this joint's drive, as its neighbour last told it. One that is silent for longer
/// than the command deadline counts as standing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coupled {
    /// rad/s.
    pub velocity: f32,
    /// Changes with every velocity that arrives.
    pub sequence: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_never_negative_and_an_acceleration_is_never_zero() {
        let found = |value| {
            let limits = CommandLimits::new(value, value, value, value);
            [limits.velocity(), limits.acceleration(), limits.deceleration(), limits.torque()]
        };
        let all = f32::INFINITY;
        for nothing in [0.0, -0.0, -1.0, f32::NAN, f32::NEG_INFINITY] {
            assert_eq!(found(nothing), [0.0, all, all, 0.0], "{nothing}");
        }
        assert_eq!(found(1e-3), [1e-3; 4]);
        assert_eq!(found(all), [all; 4]);
        assert_eq!(CommandLimits::NONE, CommandLimits::new(all, all, all, all));
    }
}
