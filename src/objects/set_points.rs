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
    torque_offset: i16,
    position: i32,
    velocity: i32,
    impedance: u64,
    /// Targets that count: those that came since operation was enabled in this mode.
    targets: Targets,
    /// mrad/s.
    pub(super) coupled: i32,
    open_loop: Frame,
}

/// Which targets there are. A joint must not run to zero, or to where it was to go an hour ago, because nobody said where to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Targets {
    torque: bool,
    torque_offset: bool,
    position: bool,
    velocity: bool,
    impedance: bool,
}

impl SetPoints {
    /// As if there had never been one: the joint stops, and asks for no torque. The mode is a choice, not a set-point, and stays.
    pub(super) const fn none(mode: Mode) -> Self {
        Self {
            controlword: Controlword::QUICK_STOP.0,
            mode,
            counter: None,
            torque: 0,
            torque_offset: 0,
            position: 0,
            velocity: 0,
            impedance: 0,
            targets: Targets {
                torque: false,
                torque_offset: false,
                position: false,
                velocity: false,
                impedance: false,
            },
            coupled: 0,
            open_loop: Frame { voltage: 0, speed: 0, along: 0, across: 0 },
        }
    }

    /// What an RPDO, or a value by SDO, makes of the set-points `before` it. `position` tells whether it carries one.
    ///
    /// Where it enables operation or enters another mode no target counts: the joint holds where it is until one comes. A position has to be another
    /// one then, because a PDO carries all of its objects, also those that the master has left at zero or at an old value. The position that comes
    /// with the release of halt counts whatever it is.
    pub(super) fn succeed(&mut self, before: &Self, position: bool) {
        let (word, last) = (Controlword(self.controlword), Controlword(before.controlword));
        let goes_on = last.enables_operation() && self.mode == before.mode;
        if word.enables_operation() && !goes_on {
            self.targets = Targets::default();
        } else if position && last.halts() && !word.halts() {
            self.targets.position = true;
        }
    }

    /// Sets one from the low bits of `value`. A mode that does not exist changes nothing.
    pub(super) fn set(&mut self, set_point: SetPoint, value: u64) {
        match set_point {
            SetPoint::Controlword => self.controlword = value as u16,
            SetPoint::Mode => self.mode = mode(value as i8).unwrap_or(self.mode),
            SetPoint::Counter => self.counter = Some(value as u8),
            SetPoint::TargetTorque => (self.torque, self.targets.torque) = (value as i16, true),
            SetPoint::TorqueOffset => (self.torque_offset, self.targets.torque_offset) = (value as i16, true),
            SetPoint::TargetPosition => {
                self.targets.position |= self.position != value as i32;
                self.position = value as i32;
            }
            SetPoint::TargetVelocity => (self.velocity, self.targets.velocity) = (value as i32, true),
            SetPoint::ImpedanceFrame => (self.impedance, self.targets.impedance) = (value, true),
            SetPoint::CoupledVelocity => self.coupled = value as i32,
            SetPoint::OpenLoop => self.open_loop = Frame::from_bits(value),
        }
    }

    /// A position by SDO is meant: it counts also where it is the one that was there.
    pub(super) fn insist(&mut self, set_point: SetPoint) {
        self.targets.position |= set_point == SetPoint::TargetPosition;
    }

    /// Whether there is a target for the mode, and nothing halts the joint.
    fn follows(&self) -> bool {
        let target = match self.mode {
            Mode::Torque => self.targets.torque,
            Mode::Velocity => self.targets.velocity,
            Mode::Position => self.targets.position,
            Mode::Impedance => self.targets.impedance,
            Mode::OpenLoop | Mode::Hold => false,
        };
        target && !Controlword(self.controlword).halts()
    }

    /// Leaves copies for the task.
    pub(super) fn publish(&self, shared: &Shared) {
        for (set_point, value) in [
            (SetPoint::Controlword, self.controlword.into()),
            (SetPoint::Mode, mode_number(self.mode) as u8 as u64),
            (SetPoint::Counter, self.counter.unwrap_or(0).into()),
            (SetPoint::TargetTorque, self.torque as u64),
            (SetPoint::TargetPosition, self.position as u64),
            (SetPoint::TargetVelocity, self.velocity as u64),
            (SetPoint::ImpedanceFrame, self.impedance),
            (SetPoint::CoupledVelocity, self.coupled as u64),
            (SetPoint::OpenLoop, self.open_loop.to_bits()),
            (SetPoint::TorqueOffset, self.torque_offset as u64),
        ] {
            shared.copy(set_point, value);
        }
        shared.set_follows(self.follows());
    }

    /// The command in SI units: to hold, where the mode's target has not come or halt is set.
    pub(super) fn command(&self, shared: &Shared) -> Command {
        let torque = |counts: bool, value: i16| {
            if counts { f32::from(value) * (1e-3 * shared.rated_torque()) } else { 0.0 }
        };
        let target = torque(self.targets.torque, self.torque);
        let offset = torque(self.targets.torque_offset, self.torque_offset);
        // Who does not say what holds the joint may mean gravity by the target.
        let push = if self.targets.torque_offset { target } else { 0.0 };
        let plain = Command { mode: self.mode, torque: target + offset, push, ..Command::NOTHING };
        match self.mode {
            Mode::OpenLoop if Controlword(self.controlword).halts() => Command { mode: self.mode, ..Command::NOTHING },
            Mode::OpenLoop => Command { mode: self.mode, open_loop: self.open_loop, ..Command::NOTHING },
            // What bears a load goes on bearing it.
            Mode::Velocity | Mode::Position if !self.follows() => Command { mode: Mode::Hold, ..plain },
            _ if !self.follows() => Command { mode: Mode::Hold, torque: offset, ..Command::NOTHING },
            Mode::Torque | Mode::Hold => plain,
            Mode::Velocity => Command { velocity: 1e-3 * self.velocity as f32, ..plain },
            Mode::Position => Command { position: 1e-6 * self.position as f32, ..plain },
            Mode::Impedance => {
                let framed = impedance(self.impedance, |range| shared.range(range));
                Command { torque: framed.torque + offset, ..framed }
            }
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
        0 => Mode::Hold,
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
        Mode::Hold => 0,
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
