//! State of the objects that the receive interrupt and the task share; atomics, any context. A static that both borrow.
//!
//! The set-points belong to the interrupt: RPDOs set them, and an RPDO counts as a whole. A set-point that the task is
//! written by SDO goes through a place for one value, which the interrupt empties; what the task reads of set-points is
//! a copy that the interrupt leaves here. Ranges, scale and state of the image belong to the task, and the interrupt
//! only reads them.

use super::field::{PROFILE_PARAMETERS, ProfileParameter, RANGES, Range, SET_POINTS, SetPoint};
use super::operation::Operation;
use crate::joint::PROFILES;
use crate::joint::configuration::Configuration;
use crate::joint::state_machine::Controlword;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU16, AtomicU32, Ordering};

/// Ranges of the mini-cheetah actuator's firmware, the first to use such a frame: 12.5 rad, 65 rad/s, 500 Nm/rad, 5 Nm
/// s/rad, 18 Nm.
pub const DEFAULT_RANGES: [f32; RANGES] = [12.5, 65.0, 500.0, 5.0, 18.0];

/// The shared part of the objects.
#[derive(Debug)]
pub struct Shared {
    /// A written value waits for the interrupt.
    written: AtomicBool,
    set_point: AtomicU8,
    value: Value,
    copies: [Value; SET_POINTS],
    ranges: [AtomicU32; RANGES],
    rated_torque: AtomicU32,
    rated_current: AtomicU32,
    follows: AtomicBool,
    locked: AtomicBool,
    /// Profile modes, where a program has them.
    profile: [ProfileModes; PROFILES as usize],
    image_version: AtomicU32,
    image_state: AtomicU8,
}

/// Words that interrupt and task exchange about the profile modes.
#[derive(Debug)]
struct ProfileModes {
    parameters: [AtomicU32; PROFILE_PARAMETERS],
    /// Raw; [`target_number`](Self::target_number) says whether there is one. Interrupt.
    target: AtomicU32,
    target_number: AtomicU16,
    /// Number of the target that was reached last. Task.
    reached: AtomicU16,
    /// Position of the joint, raw. Task.
    position: AtomicU32,
    /// Bits of the statusword. Task.
    status: AtomicU16,
    /// Destination of homing, rad. Task.
    homing: AtomicU32,
    homes: AtomicBool,
}

impl ProfileModes {
    const fn new() -> Self {
        Self {
            parameters: defaults(),
            target: AtomicU32::new(0),
            target_number: AtomicU16::new(0),
            reached: AtomicU16::new(0),
            position: AtomicU32::new(0),
            status: AtomicU16::new(0),
            homing: AtomicU32::new(0),
            homes: AtomicBool::new(false),
        }
    }
}

/// Flag of the task's bits that it has seen the start of homing.
pub(super) const STARTED: u16 = 1;
/// Flag of a number that there is one.
const THERE: u16 = 1 << 8;

/// 64 bits in two words, as the processor has no exchange of 64 bits.
#[derive(Debug)]
struct Value {
    low: AtomicU32,
    high: AtomicU32,
}

impl Value {
    const fn new() -> Self {
        Self { low: AtomicU32::new(0), high: AtomicU32::new(0) }
    }

    fn set(&self, value: u64) {
        self.low.store(value as u32, Ordering::Relaxed);
        self.high.store((value >> 32) as u32, Ordering::Relaxed);
    }

    fn get(&self) -> u64 {
        u64::from(self.low.load(Ordering::Relaxed)) | u64::from(self.high.load(Ordering::Relaxed)) << 32
    }
}

impl Shared {
    /// Initial state: nothing written, default ranges; torque counts as 0 until the task has said what it refers to.
    #[allow(clippy::new_without_default, reason = "it belongs into a static")]
    pub const fn new() -> Self {
        let [position, velocity, stiffness, damping, torque] = DEFAULT_RANGES;
        Self {
            written: AtomicBool::new(false),
            set_point: AtomicU8::new(0),
            value: Value::new(),
            copies: [const { Value::new() }; SET_POINTS],
            ranges: [
                AtomicU32::new(position.to_bits()),
                AtomicU32::new(velocity.to_bits()),
                AtomicU32::new(stiffness.to_bits()),
                AtomicU32::new(damping.to_bits()),
                AtomicU32::new(torque.to_bits()),
            ],
            rated_torque: AtomicU32::new(0),
            rated_current: AtomicU32::new(0),
            follows: AtomicBool::new(false),
            locked: AtomicBool::new(false),
            profile: [const { ProfileModes::new() }; PROFILES as usize],
            image_version: AtomicU32::new(0),
            image_state: AtomicU8::new(0),
        }
    }

    /// Returns `true` while a set-point that came by SDO waits for [`JointImage::follow`](super::JointImage::follow).
    /// The task looks here after each SDO request and then has the interrupt run.
    pub fn has_written(&self) -> bool {
        self.written.load(Ordering::Acquire)
    }

    /// Leaves a set-point for the interrupt; false while the one before is still there. Task.
    pub(super) fn write(&self, set_point: SetPoint, value: u64) -> bool {
        if self.has_written() {
            return false;
        }
        self.set_point.store(set_point as u8, Ordering::Relaxed);
        self.value.set(value);
        self.written.store(true, Ordering::Release);
        true
    }

    /// Takes what the task left. Interrupt.
    pub(super) fn take_written(&self) -> Option<(SetPoint, u64)> {
        if !self.has_written() {
            return None;
        }
        let set_point = match self.set_point.load(Ordering::Relaxed) {
            0 => SetPoint::Controlword,
            1 => SetPoint::Mode,
            2 => SetPoint::Counter,
            3 => SetPoint::TargetTorque,
            4 => SetPoint::TargetPosition,
            5 => SetPoint::TargetVelocity,
            6 => SetPoint::ImpedanceFrame,
            8 => SetPoint::OpenLoop,
            9 => SetPoint::TorqueOffset,
            10 => SetPoint::ProfileVelocity,
            11 => SetPoint::ProfileAcceleration,
            12 => SetPoint::ProfileDeceleration,
            13 => SetPoint::MaxTorque,
            14 => SetPoint::PositionOffset,
            15 => SetPoint::VelocityOffset,
            _ => SetPoint::CoupledVelocity,
        };
        let value = self.value.get();
        self.written.store(false, Ordering::Release);
        Some((set_point, value))
    }

    /// Leaves a copy of a set-point. Interrupt.
    pub(super) fn copy(&self, set_point: SetPoint, value: u64) {
        self.copy_number(set_point as usize, value);
    }

    /// The same by its number.
    pub(super) fn copy_number(&self, number: usize, value: u64) {
        if let Some(place) = self.copies.get(number) {
            place.set(value);
        }
    }

    /// The newest copy; the halves of an impedance frame may be of two that came one after the other.
    pub(super) fn set_point(&self, set_point: SetPoint) -> u64 {
        self.copies.get(set_point as usize).map_or(0, Value::get)
    }

    /// Mode of operation.
    pub(super) fn mode(&self) -> Option<Operation> {
        Operation::of(self.set_point(SetPoint::Mode) as i8)
    }

    pub(super) fn range(&self, range: Range) -> f32 {
        self.ranges.get(range as usize).map_or(0.0, |bits| f32::from_bits(bits.load(Ordering::Relaxed)))
    }

    pub(super) fn set_range(&self, range: Range, value: f32) {
        if let Some(place) = self.ranges.get(range as usize) {
            place.store(value.to_bits(), Ordering::Relaxed);
        }
    }

    /// Torque that permille of torque refer to, Nm; 0 before the task has said so.
    pub(super) fn rated_torque(&self) -> f32 {
        f32::from_bits(self.rated_torque.load(Ordering::Relaxed))
    }

    /// Torque and current limit of a configuration, which parts of torque and current refer to.
    pub(super) fn rate(&self, configuration: &Configuration) {
        self.rated_torque.store(configuration.limits.torque.to_bits(), Ordering::Relaxed);
        self.rated_current.store(configuration.motor.current_limit.to_bits(), Ordering::Relaxed);
    }

    #[cfg(test)]
    pub(super) fn set_rated_torque(&self, torque: f32) {
        self.rated_torque.store(torque.to_bits(), Ordering::Relaxed);
    }

    /// Current that permille of current refer to, A; 0 before the task has said so.
    pub(super) fn rated_current(&self) -> f32 {
        f32::from_bits(self.rated_current.load(Ordering::Relaxed))
    }

    /// A number for the profile modes; 0 where the program has none.
    pub(super) fn parameter(&self, parameter: ProfileParameter) -> u32 {
        let value = self.profile.first().and_then(|modes| modes.parameters.get(parameter as usize));
        value.map_or(0, |value| value.load(Ordering::Relaxed))
    }

    pub(super) fn set_parameter(&self, parameter: ProfileParameter, value: u32) {
        if let Some(place) = self.profile.first().and_then(|modes| modes.parameters.get(parameter as usize)) {
            place.store(value, Ordering::Relaxed);
        }
    }

    /// The target of profile position mode, raw, and its number. Interrupt.
    pub(super) fn set_profile_target(&self, target: Option<(i32, u8)>) {
        let Some(modes) = self.profile.first() else { return };
        let (target, number) = target.map_or((0, 0), |(target, number)| (target, THERE | u16::from(number)));
        modes.target.store(target as u32, Ordering::Relaxed);
        modes.target_number.store(number, Ordering::Release);
    }

    /// The same for the task, which the interrupt may have come between: none then, and another time.
    pub(super) fn profile_target(&self) -> Option<(i32, u8)> {
        let modes = self.profile.first()?;
        let number = modes.target_number.load(Ordering::Acquire);
        let target = modes.target.load(Ordering::Acquire) as i32;
        let same = modes.target_number.load(Ordering::Acquire) == number;
        (same && number & THERE != 0).then_some((target, number as u8))
    }

    /// The number of the target that the joint has reached, if it is where it was to go.
    pub(super) fn reached(&self) -> Option<u8> {
        let reached = self.profile.first()?.reached.load(Ordering::Relaxed);
        (reached & THERE != 0).then_some(reached as u8)
    }

    pub(super) fn set_reached(&self, number: Option<u8>) {
        if let Some(modes) = self.profile.first() {
            modes.reached.store(number.map_or(0, |number| THERE | u16::from(number)), Ordering::Relaxed);
        }
    }

    /// Position of the joint, raw, as the task saw it last.
    pub(super) fn position(&self) -> i32 {
        self.profile.first().map_or(0, |modes| modes.position.load(Ordering::Relaxed) as i32)
    }

    pub(super) fn set_position(&self, position: i32) {
        if let Some(modes) = self.profile.first() {
            modes.position.store(position as u32, Ordering::Relaxed);
        }
    }

    /// Bits of the statusword that only the profile modes have: whether the newest target is reached, and what the task
    /// looks after.
    pub(super) fn status(&self) -> u16 {
        let Some(modes) = self.profile.first() else { return 0 };
        let reached = modes.reached.load(Ordering::Relaxed);
        let newest = reached & THERE != 0 && reached == modes.target_number.load(Ordering::Relaxed);
        let mode = self.mode();
        let reached = newest && mode == Some(Operation::ProfilePosition);
        let told = modes.status.load(Ordering::Relaxed);
        let begins =
            Controlword(self.set_point(SetPoint::Controlword) as u16).is_new_set_point() && told & STARTED == 0;
        match mode {
            // The word told is still of the homing before.
            Some(Operation::Homing) if begins => 0,
            _ => told & !STARTED | u16::from(reached) << 10,
        }
    }

    pub(super) fn set_status(&self, bits: u16) {
        if let Some(modes) = self.profile.first() {
            modes.status.store(bits, Ordering::Relaxed);
        }
    }

    /// Destination of homing, rad, its speed and acceleration, raw.
    pub(super) fn homing(&self) -> Option<(f32, u32, u32)> {
        let modes = self.profile.first().filter(|modes| modes.homes.load(Ordering::Acquire))?;
        let acceleration = self.parameter(ProfileParameter::HomingAcceleration);
        let speed = self.parameter(ProfileParameter::HomingSpeed);
        Some((f32::from_bits(modes.homing.load(Ordering::Relaxed)), speed, acceleration))
    }

    pub(super) fn set_homing(&self, position: Option<f32>) {
        let Some(modes) = self.profile.first() else { return };
        if let Some(position) = position {
            modes.homing.store(position.to_bits(), Ordering::Relaxed);
        }
        modes.homes.store(position.is_some(), Ordering::Release);
    }

    /// Returns `true` if the joint, once enabled, follows its mode's target.
    pub(super) fn follows(&self) -> bool {
        self.follows.load(Ordering::Relaxed)
    }

    /// Interrupt.
    pub(super) fn set_follows(&self, follows: bool) {
        self.follows.store(follows, Ordering::Relaxed);
    }

    /// True where the joint is not to be enabled, because the configuration that was stored is lost.
    pub(super) fn is_locked(&self) -> bool {
        self.locked.load(Ordering::Relaxed)
    }

    /// Task.
    pub(super) fn lock(&self, locked: bool) {
        self.locked.store(locked, Ordering::Relaxed);
    }

    pub(super) fn image_version(&self) -> u32 {
        self.image_version.load(Ordering::Relaxed)
    }

    pub(super) fn image_state(&self) -> u8 {
        self.image_state.load(Ordering::Relaxed)
    }

    pub(super) fn set_image(&self, version: u32, state: u8) {
        self.image_version.store(version, Ordering::Relaxed);
        self.image_state.store(state, Ordering::Relaxed);
    }
}

/// While compiling.
const fn defaults() -> [AtomicU32; PROFILE_PARAMETERS] {
    let mut parameters = [const { AtomicU32::new(0) }; PROFILE_PARAMETERS];
    let mut next = 0;
    while next != PROFILE_PARAMETERS {
        parameters[next] = AtomicU32::new(ProfileParameter::DEFAULTS[next]);
        next += 1;
    }
    parameters
}
