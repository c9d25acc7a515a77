//! What the receive interrupt and the task both need of the objects; atomics, any context. A static that both borrow.
//!
//! The set-points belong to the interrupt: RPDOs set them, and an RPDO counts as a whole. A set-point that the task is written by SDO
//! goes through a place for one value, which the interrupt empties; what the task reads of set-points is a copy that the interrupt
//! leaves here. Ranges, scale and state of the image belong to the task, and the interrupt only reads them.

use super::field::{RANGES, Range, SET_POINTS, SetPoint};
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};

/// Ranges of the mini-cheetah actuator's firmware, the first to use such a frame: 12.5 rad, 65 rad/s, 500 Nm/rad, 5 Nm s/rad, 18 Nm.
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
    follows: AtomicBool,
    image_version: AtomicU32,
    image_state: AtomicU8,
}

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
    /// Nothing written, default ranges; torque counts as 0 until the task has said what it refers to.
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
            follows: AtomicBool::new(false),
            image_version: AtomicU32::new(0),
            image_state: AtomicU8::new(0),
        }
    }

    /// Whether a set-point that came by SDO waits for [`JointImage::follow`](super::JointImage::follow). The task looks here after each SDO
    /// request and then has the interrupt run.
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
            _ => SetPoint::CoupledVelocity,
        };
        let value = self.value.get();
        self.written.store(false, Ordering::Release);
        Some((set_point, value))
    }

    /// Leaves a copy of a set-point. Interrupt.
    pub(super) fn copy(&self, set_point: SetPoint, value: u64) {
        if let Some(place) = self.copies.get(set_point as usize) {
            place.set(value);
        }
    }

    /// The newest copy; the halves of an impedance frame may be of two that came one after the other.
    pub(super) fn set_point(&self, set_point: SetPoint) -> u64 {
        self.copies.get(set_point as usize).map_or(0, Value::get)
    }

    pub(super) fn range(&self, range: Range) -> f32 {
        self.ranges.get(range as usize).map_or(0.0, |bits| f32::from_bits(bits.load(Ordering::Relaxed)))
    }

    pub(super) fn set_range(&self, range: Range, value: f32) {
        if let Some(place) = self.ranges.get(range as usize) {
            place.store(value.to_bits(), Ordering::Relaxed);
        }
    }

    /// What the permille of torque refer to, Nm; 0 before the task has said so.
    pub(super) fn rated_torque(&self) -> f32 {
        f32::from_bits(self.rated_torque.load(Ordering::Relaxed))
    }

    pub(super) fn set_rated_torque(&self, torque: f32) {
        self.rated_torque.store(torque.to_bits(), Ordering::Relaxed);
    }

    /// Whether the joint, once enabled, follows its mode's target.
    pub(super) fn follows(&self) -> bool {
        self.follows.load(Ordering::Relaxed)
    }

    /// Interrupt.
    pub(super) fn set_follows(&self, follows: bool) {
        self.follows.store(follows, Ordering::Relaxed);
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
