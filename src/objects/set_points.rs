//! From the numbers of the bus to a command; the receive interrupt.

use super::field::{Range, SetPoint};
use super::shared::Shared;
use crate::joint::state_machine::Controlword;
use crate::joint::{Command, Mode};
use crate::motor::open_loop::Frame;

/// Set-points as they came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SetPoints {
    pub(super) controlword: u16,
    pub(super) mode: Mode,
    pub(super) counter: Option<u8>,
    torque: i16,
    /// None since the last transition: a joint in position mode must not run to zero because nobody said where to.
    position: Option<i32>,
    velocity: i32,
    impedance: Option<u64>,
    /// mrad/s.
    pub(super) coupled: i32,
    open_loop: Frame,
}

impl SetPoints {
    /// As if there had never been one: the joint stops, and asks for no torque. The mode is a choice, not a set-point, and stays.
    pub(super) const fn none(mode: Mode) -> Self {
        Self {
            controlword: Controlword::QUICK_STOP.0,
            mode,
            counter: None,
            torque: 0,
            position: None,
            velocity: 0,
            impedance: None,
            coupled: 0,
            open_loop: Frame { voltage: 0, speed: 0, along: 0, across: 0 },
        }
    }

    /// Sets one from the low bits of `value`. A mode that does not exist changes nothing.
    pub(super) fn set(&mut self, set_point: SetPoint, value: u64) {
        match set_point {
            SetPoint::Controlword => self.controlword = value as u16,
            SetPoint::Mode => self.mode = mode(value as i8).unwrap_or(self.mode),
            SetPoint::Counter => self.counter = Some(value as u8),
            SetPoint::TargetTorque => self.torque = value as i16,
            SetPoint::TargetPosition => self.position = Some(value as i32),
            SetPoint::TargetVelocity => self.velocity = value as i32,
            SetPoint::ImpedanceFrame => self.impedance = Some(value),
            SetPoint::CoupledVelocity => self.coupled = value as i32,
            SetPoint::OpenLoop => self.open_loop = Frame::from_bits(value),
        }
    }

    /// Leaves copies for the task.
    pub(super) fn publish(&self, shared: &Shared) {
        for (set_point, value) in [
            (SetPoint::Controlword, self.controlword.into()),
            (SetPoint::Mode, mode_number(self.mode) as u8 as u64),
            (SetPoint::Counter, self.counter.unwrap_or(0).into()),
            (SetPoint::TargetTorque, self.torque as u64),
            (SetPoint::TargetPosition, self.position.unwrap_or(0) as u64),
            (SetPoint::TargetVelocity, self.velocity as u64),
            (SetPoint::ImpedanceFrame, self.impedance.unwrap_or(0)),
            (SetPoint::CoupledVelocity, self.coupled as u64),
            (SetPoint::OpenLoop, self.open_loop.to_bits()),
        ] {
            shared.copy(set_point, value);
        }
    }

    /// The command in SI units; none is asked for where the mode's set-point never came.
    pub(super) fn command(&self, shared: &Shared) -> Command {
        let torque = f32::from(self.torque) * (1e-3 * shared.rated_torque());
        let plain = Command { mode: self.mode, torque, ..Command::default() };
        match (self.mode, self.position, self.impedance) {
            (Mode::Torque, ..) => plain,
            (Mode::OpenLoop, ..) => Command { mode: self.mode, open_loop: self.open_loop, ..Command::default() },
            (Mode::Velocity, ..) => Command { velocity: 1e-3 * self.velocity as f32, ..plain },
            (Mode::Position, Some(position), _) => Command { position: 1e-6 * position as f32, ..plain },
            (Mode::Impedance, _, Some(frame)) => impedance(frame, |range| shared.range(range)),
            (Mode::Position | Mode::Impedance, ..) => Command::default(),
        }
    }

    /// rad/s.
    pub(super) fn coupled_velocity(&self) -> f32 {
        1e-3 * self.coupled as f32
    }
}

/// The mode of a number of object 6060h.
pub(super) const fn mode(number: i8) -> Option<Mode> {
    Some(match number {
        8 => Mode::Position,
        9 => Mode::Velocity,
        10 => Mode::Torque,
        -1 => Mode::Impedance,
        -2 => Mode::OpenLoop,
        _ => return None,
    })
}

/// The number of a mode.
pub(super) const fn mode_number(mode: Mode) -> i8 {
    match mode {
        Mode::Position => 8,
        Mode::Velocity => 9,
        Mode::Torque => 10,
        Mode::Impedance => -1,
        Mode::OpenLoop => -2,
    }
}

/// The command of an impedance frame.
///
/// Bits as in the mini-cheetah actuator's frame, most significant first on the bus: position 16, velocity 12, stiffness 12, damping 12,
/// torque 12. Position, velocity and torque count from minus their range to plus it, the gains from 0. As the number of steps is odd, no
/// number stands for exactly zero: of velocity and torque the nearest are half a step, range / 4095, off.
fn impedance(frame: u64, range: impl Fn(Range) -> f32) -> Command {
    let bits = frame.swap_bytes();
    let part = |shift: u32, mask: u16| (bits >> shift) as u16 & mask;
    let both = |range: f32, raw: u16, steps: f32| range * (2.0 * f32::from(raw) / steps - 1.0);
    let above = |range: f32, raw: u16| range * (f32::from(raw) / 4_095.0);
    Command {
        mode: Mode::Impedance,
        position: both(range(Range::Position), part(48, 0xFFFF), 65_535.0),
        velocity: both(range(Range::Velocity), part(36, 0xFFF), 4_095.0),
        stiffness: above(range(Range::Stiffness), part(24, 0xFFF)),
        damping: above(range(Range::Damping), part(12, 0xFFF)),
        torque: both(range(Range::Torque), part(0, 0xFFF), 4_095.0),
        ..Command::NOTHING
    }
}

/// The impedance frame that comes nearest to a command, as the value of object 2011h:1; host.
pub fn impedance_frame(command: &Command, ranges: [f32; super::field::RANGES]) -> u64 {
    let [position, velocity, stiffness, damping, torque] = ranges;
    let above = |value: f32, range: f32| u64::from(super::number::to_u16(4_095.0 * value / range).min(4_095));
    let both = |value: f32, range: f32, steps: f32| super::number::to_u16(0.5 * steps * (value / range + 1.0));
    let narrow = |value: f32, range: f32| u64::from(both(value, range, 4_095.0).min(4_095));
    let bits = u64::from(both(command.position, position, 65_535.0)) << 48
        | narrow(command.velocity, velocity) << 36
        | above(command.stiffness, stiffness) << 24
        | above(command.damping, damping) << 12
        | narrow(command.torque, torque);
    bits.swap_bytes()
}
