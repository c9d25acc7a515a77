//! The control steps before a fault as bytes, object 2300h; the task.
//!
//! Oldest first, [`STEP`] bytes each, little-endian: state (1 byte), three reserved, faults (a bit each as in object
//! 2021h:4, 4 bytes), position, velocity, torque before compensation, compensation torque, current d, current q, bus
//! voltage (4 bytes each, SI).

use super::observed::fault_bits;
use crate::joint::history::{History, LENGTH, Snapshot};

/// Bytes of a step.
pub const STEP: usize = 36;

/// Bytes of the whole history.
pub(super) fn length(history: &History) -> u32 {
    if history.is_frozen() { (STEP * LENGTH) as u32 } else { 0 }
}

/// Fills `out` from byte `offset` on; false where there are not so many, or the fault has been acknowledged meanwhile.
pub(super) fn read(history: &History, offset: u32, out: &mut [u8]) -> bool {
    if !history.is_frozen() {
        return false;
    }
    let mut bytes = history.iter().skip(offset as usize / STEP).flat_map(encode).skip(offset as usize % STEP);
    out.iter_mut().all(|place| bytes.next().map(|byte| *place = byte).is_some())
}

fn encode(step: Snapshot) -> [u8; STEP] {
    let mut bytes = [0; STEP];
    let faults = u32::from(fault_bits(step.faults));
    let numbers = [
        step.position,
        step.velocity,
        step.commanded_torque,
        step.compensation_torque,
        step.current.d,
        step.current.q,
        step.bus_voltage,
    ];
    let words = [step.state as u32, faults].into_iter().chain(numbers.map(f32::to_bits));
    for (place, byte) in bytes.iter_mut().zip(words.flat_map(u32::to_le_bytes)) {
        *place = byte;
    }
    bytes
}

/// Fills `out` from `all`, from `offset` on; false where there are not so many.
pub(super) fn copy(all: &[u8], offset: u32, out: &mut [u8]) -> bool {
    let end = (offset as usize).saturating_add(out.len());
    let Some(part) = all.get(offset as usize..end) else { return false };
    out.iter_mut().zip(part).for_each(|(place, byte)| *place = *byte);
    true
}
