//! Conversion of the numbers of the bus into a command; the receive interrupt.

use super::field::{FIRST_OF_PROFILES, PROFILE_SET_POINTS, Range, SetPoint, Several};
use super::interpolation::Target;
use super::operation::Operation;
use super::profile_positions::Positions;
use super::shared::Shared;
use crate::joint::state_machine::Controlword;
use crate::joint::{Command, CommandLimits, Mode, PROFILES};
use crate::motor::open_loop::Frame;

/// Set-points as they came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SetPoints {
    pub(super) controlword: u16,
    pub(super) mode: Operation,
    pub(super) counter: Option<u8>,
    torque: i16,
    torque_offset: i16,
    position: i32,
    velocity: i32,
    impedance: u64,
    /// Set-points of the profile modes, where a program has them: [`SetPoint`]s from [`FIRST_OF_PROFILES`] on, raw.
    more: [u32; PROFILE_SET_POINTS],
    positions: [Positions; PROFILES as usize],
    /// Those that came since operation was enabled in this mode: of targets and the torque that is added to them no
    /// others count. A joint must not run to zero, or to where it was to go an hour ago, because nobody said where to.
    come: Several,
    /// mrad/s.
    pub(super) coupled: i32,
    open_loop: Frame,
}

/// A raw limit that limits nothing: the joint's own counts.
const UNLIMITED: u32 = u32::MAX;
/// Initial set-points of the profile modes: no limits, no offsets.
const MORE: [u32; 6] = [UNLIMITED, UNLIMITED, UNLIMITED, 1_000, 0, 0];
/// Number of choices among them, which stay.
const CHOICES: usize = 4;

const fn more() -> [u32; PROFILE_SET_POINTS] {
    let mut more = [0; PROFILE_SET_POINTS];
    let mut next = 0;
    while next != PROFILE_SET_POINTS {
        more[next] = MORE[next];
        next += 1;
    }
    more
}

impl SetPoints {
    /// None yet: the joint stops, and asks for no torque.
    pub(super) const NONE: Self = Self {
        controlword: Controlword::QUICK_STOP.0,
        mode: Operation::Torque,
        counter: None,
        torque: 0,
        torque_offset: 0,
        position: 0,
        velocity: 0,
        impedance: 0,
        more: more(),
        positions: [Positions::NONE; PROFILES as usize],
        come: Several::NONE,
        coupled: 0,
        open_loop: Frame { voltage: 0, speed: 0, along: 0, across: 0 },
    };

    /// Set-points as if there had never been one. Mode, profile and largest torque are choices, not set-points, and
    /// stay.
    pub(super) fn forgotten(&self) -> Self {
        let mut none = Self { mode: self.mode, ..Self::NONE };
        none.more.iter_mut().zip(self.more).take(CHOICES).for_each(|(place, value)| *place = value);
        none.positions.iter_mut().zip(self.positions).for_each(|(place, before)| *place = before.forgotten());
        none
    }

    /// Transition from the set-points `before` an RPDO, or a value by SDO, to these. `position` tells whether it
    /// carries one, `actual` where the joint is, raw.
    ///
    /// Where it enables operation or enters another mode no target counts: the joint holds where it is until one comes.
    /// A position has to be another one then, because a PDO carries all of its objects, also those that the master has
    /// left at zero or at an old value. The position that comes with the release of halt counts whatever it is.
    pub(super) fn succeed(&mut self, before: &Self, position: bool, actual: i32) {
        let (word, last) = (Controlword(self.controlword), Controlword(before.controlword));
        let goes_on = last.enables_operation() && self.mode == before.mode;
        if word.enables_operation() && !goes_on {
            self.come = Several::NONE;
            self.positions.iter_mut().for_each(Positions::forget);
        } else if position && last.halts() && !word.halts() {
            self.insist(SetPoint::TargetPosition);
        }
        if self.mode == Operation::ProfilePosition && word.enables_operation() {
            let rises = goes_on && !last.is_new_set_point();
            self.positions.iter_mut().for_each(|positions| positions.hand_shake(word, rises, self.position, actual));
        }
    }

    /// Goes on to the position that waits, where the joint is told to have reached the one before; whether there was
    /// one.
    pub(super) fn go_on(&mut self, shared: &Shared) -> bool {
        self.positions.iter_mut().any(|positions| positions.go_on(shared.reached()))
    }

    /// Sets one from the low bits of `value`. A mode that does not exist changes nothing.
    pub(super) fn set(&mut self, set_point: SetPoint, value: u64) {
        match set_point {
            SetPoint::Controlword => self.controlword = value as u16,
            SetPoint::Mode => self.mode = Operation::of(value as i8).unwrap_or(self.mode),
            SetPoint::Counter => self.counter = Some(value as u8),
            SetPoint::TargetTorque => {
                self.torque = value as i16;
                self.insist(SetPoint::TargetTorque);
            }
            SetPoint::TorqueOffset => {
                self.torque_offset = value as i16;
                self.insist(SetPoint::TorqueOffset);
            }
            SetPoint::TargetPosition => {
                if self.position != value as i32 {
                    self.insist(SetPoint::TargetPosition);
                }
                self.position = value as i32;
            }
            SetPoint::TargetVelocity => {
                self.velocity = value as i32;
                self.insist(SetPoint::TargetVelocity);
            }
            SetPoint::ImpedanceFrame => {
                self.impedance = value;
                self.insist(SetPoint::ImpedanceFrame);
            }
            SetPoint::CoupledVelocity => self.coupled = value as i32,
            SetPoint::OpenLoop => self.open_loop = Frame::from_bits(value),
            SetPoint::ProfileVelocity
            | SetPoint::ProfileAcceleration
            | SetPoint::ProfileDeceleration
            | SetPoint::MaxTorque
            | SetPoint::PositionOffset
            | SetPoint::VelocityOffset => {
                if let Some(place) = self.more.get_mut(set_point as usize - FIRST_OF_PROFILES) {
                    *place = value as u32;
                }
            }
        }
    }

    /// One of the profile modes', raw.
    fn more(&self, set_point: SetPoint) -> u32 {
        let number = set_point as usize - FIRST_OF_PROFILES;
        self.more.get(number).copied().unwrap_or(MORE[number])
    }

    /// It has come. One by SDO is meant, also where it is the position that was there.
    pub(super) fn insist(&mut self, set_point: SetPoint) {
        self.come = self.come.and(set_point);
    }

    /// Returns `true` if there is a target for the mode, and nothing halts the joint.
    fn follows(&self) -> bool {
        let target = match self.mode {
            Operation::ProfileVelocity => PROFILES && self.come.has(SetPoint::TargetVelocity),
            Operation::ProfilePosition => self.positions.iter().any(|positions| positions.target().is_some()),
            mode => self.come.among(Several::target(mode)) != Several::NONE,
        };
        target && !Controlword(self.controlword).halts()
    }

    /// Leaves copies for the task.
    pub(super) fn publish(&self, shared: &Shared) {
        for (set_point, value) in [
            (SetPoint::Controlword, self.controlword.into()),
            (SetPoint::Mode, u64::from(self.mode.number() as u8)),
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
        for (number, value) in (FIRST_OF_PROFILES..).zip(self.more) {
            shared.copy_number(number, value.into());
        }
        for positions in &self.positions {
            shared.set_profile_target(positions.target());
        }
        self.publish_follows(shared);
    }

    /// Leaves for the task whether the joint follows its mode's target; in profile position mode the hand-shake.
    pub(super) fn publish_follows(&self, shared: &Shared) {
        shared.set_follows(match self.mode {
            Operation::ProfilePosition => self.positions.iter().any(Positions::are_acknowledged),
            _ => self.follows(),
        });
    }

    /// The same with halt set.
    pub(super) fn halted(&self) -> Self {
        Self { controlword: self.controlword | Controlword::HALT.0, ..*self }
    }

    /// The command in SI units: to hold, where the mode's target has not come or halt is set.
    pub(super) fn command(&self, shared: &Shared) -> Command {
        if !PROFILES {
            return self.unlimited_command(shared);
        }
        let command = self.unlimited_command(shared);
        let homing = shared.homing().filter(|_| self.mode == Operation::Homing && command.mode != Mode::Hold);
        let (velocity, acceleration, deceleration) = match (self.mode, homing) {
            (Operation::Homing, Some((_, speed, acceleration))) => (speed, acceleration, acceleration),
            (Operation::ProfilePosition | Operation::ProfileVelocity, _) => (
                self.more(SetPoint::ProfileVelocity),
                self.more(SetPoint::ProfileAcceleration),
                self.more(SetPoint::ProfileDeceleration),
            ),
            _ => (UNLIMITED, UNLIMITED, UNLIMITED),
        };
        let milli = |raw: u32| if raw == UNLIMITED { f32::INFINITY } else { 1e-3 * raw as f32 };
        let torque = match self.more(SetPoint::MaxTorque) {
            permille @ ..1_000 => permille as f32 * (1e-3 * shared.rated_torque()),
            _ => f32::INFINITY,
        };
        let limits = CommandLimits::new(milli(velocity), milli(acceleration), milli(deceleration), torque);
        Command { limits, ..command }
    }

    /// The same without the limits that come with it.
    fn unlimited_command(&self, shared: &Shared) -> Command {
        let torque = |counts: bool, value: i16| {
            if counts { f32::from(value) * (1e-3 * shared.rated_torque()) } else { 0.0 }
        };
        let has_offset = self.come.has(SetPoint::TorqueOffset);
        let target = torque(self.come.has(SetPoint::TargetTorque), self.torque);
        let offset = torque(has_offset, self.torque_offset);
        // A master that does not say what holds the joint may mean gravity by the target.
        let push = if has_offset { target } else { 0.0 };
        let plain = Command { mode: self.mode.of_the_joint(), torque: target + offset, push, ..Command::NOTHING };
        let halts = Controlword(self.controlword).halts();
        match self.mode {
            Operation::Homing | Operation::ProfilePosition | Operation::ProfileVelocity if !PROFILES => {
                Command::NOTHING
            }
            Operation::OpenLoop if halts => Command { mode: Mode::OpenLoop, ..Command::NOTHING },
            Operation::OpenLoop => Command { mode: Mode::OpenLoop, open_loop: self.open_loop, ..Command::NOTHING },
            Operation::Homing => match shared.homing() {
                Some((position, ..)) if !halts => Command { mode: Mode::Profile, position, ..plain },
                _ => plain,
            },
            // A torque that bears a load goes on bearing it.
            Operation::Velocity | Operation::Position | Operation::ProfileVelocity | Operation::ProfilePosition
                if !self.follows() =>
            {
                Command { mode: Mode::Hold, ..plain }
            }
            _ if !self.follows() => Command { mode: Mode::Hold, torque: offset, ..Command::NOTHING },
            Operation::Torque | Operation::None => plain,
            Operation::Velocity | Operation::ProfileVelocity => Command { velocity: self.velocity(), ..plain },
            Operation::Position => Command { position: self.position(), ..plain },
            Operation::ProfilePosition => {
                let target = self.positions.iter().find_map(Positions::target).map_or(0, |(target, _)| target);
                Command { position: 1e-6 * target as f32, ..plain }
            }
            Operation::Impedance => {
                let framed = impedance(self.impedance, |range| shared.range(range));
                Command { torque: framed.torque + offset, ..framed }
            }
        }
    }

    /// The target of the modes that 60C2h interpolates, where the joint follows it.
    pub(super) fn cyclic_target(&self) -> Option<Target> {
        match self.mode {
            Operation::Velocity if self.follows() => Some((Mode::Velocity, self.velocity())),
            Operation::Position if self.follows() => Some((Mode::Position, self.position())),
            _ => None,
        }
    }

    /// Target velocity, with what is added to it in cyclic synchronous velocity mode, rad/s.
    fn velocity(&self) -> f32 {
        let offset = self.offset(Operation::Velocity, SetPoint::VelocityOffset);
        1e-3 * self.velocity.saturating_add(offset) as f32
    }

    /// Target position of cyclic synchronous position mode, with what is added to it, rad.
    fn position(&self) -> f32 {
        let offset = self.offset(Operation::Position, SetPoint::PositionOffset);
        1e-6 * self.position.saturating_add(offset) as f32
    }

    /// Offset that is added to the target of one mode, raw.
    fn offset(&self, mode: Operation, set_point: SetPoint) -> i32 {
        if PROFILES && self.mode == mode { self.more(set_point) as i32 } else { 0 }
    }

    /// rad/s.
    pub(super) fn coupled_velocity(&self) -> f32 {
        1e-3 * self.coupled as f32
    }
}

/// The command of an impedance frame.
///
/// Bits as in the mini-cheetah actuator's frame, most significant first on the bus: position 16, velocity 12, stiffness
/// 12, damping 12, torque 12. Position, velocity and torque count from minus their range to plus it, the gains from 0.
/// As the number of steps is odd, no number stands for exactly zero: of velocity and torque the nearest are half a
/// step, range / 4095, off.
pub(super) fn impedance(frame: u64, range: impl Fn(Range) -> f32) -> Command {
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
