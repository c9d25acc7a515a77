//! What the joint is asked to do; written by a task, read by the control step.

use super::state_machine::Controlword;
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
    /// Stiffness and damping around a position and a velocity, and a torque, all of the command's own.
    Impedance,
    /// A voltage along a turning field, for commissioning ([`crate::motor::open_loop`]).
    OpenLoop,
    /// The position in which the joint comes to a stop. No set-point counts, so none can be late.
    Hold,
}

/// One set-point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Which of the fields count.
    pub mode: Mode,
    /// rad; position and impedance mode.
    pub position: f32,
    /// rad/s; velocity and impedance mode.
    pub velocity: f32,
    /// Nm; torque mode, and added in every other one.
    pub torque: f32,
    /// The part of the torque that pushes the joint to where it is to go, Nm, by its sign for the
    /// [energy guard](super::friction_feedforward) in torque mode. What holds gravity is none of it; zero where nobody said
    /// what holds.
    pub push: f32,
    /// Nm/rad; impedance mode, 0 to 1e5.
    pub stiffness: f32,
    /// Nm s/rad; impedance mode, 0 to 1e4.
    pub damping: f32,
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
        open_loop: Frame { voltage: 0, speed: 0, along: 0, across: 0 },
    };
}

/// Everything that is asked of the joint in a control step. The set-point is looked at once a round of the motion loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demand {
    /// For the state machine.
    pub controlword: Controlword,
    /// The newest set-point.
    pub command: Command,
    /// Changes with every set-point that arrives, also where its content is the same: the command deadline counts from here.
    pub sequence: u32,
    /// The joint that shares this joint's drive.
    pub coupled: Coupled,
}

/// Velocity of the joint that shares this joint's drive, as its neighbour last told it. One that is silent for longer than the command
/// deadline counts as standing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coupled {
    /// rad/s.
    pub velocity: f32,
    /// Changes with every velocity that arrives.
    pub sequence: u32,
}
