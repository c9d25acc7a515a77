//! RPDOs: from a frame to the process image; the receive interrupt.

use super::{MappedObject, ProcessImage};
use crate::shared::{PdoRegisters, Shared};

/// Data of a synchronous RPDO that waits for SYNC; a newer one replaces it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Waiting {
    data: [u8; 8],
    generation: u8,
}

/// Takes RPDO `pdo`, whose identifier matched, in OPERATIONAL. Returns it where it has to wait for SYNC.
pub(crate) fn take(
    shared: &Shared,
    registers: &PdoRegisters,
    pdo: u8,
    data: &[u8],
    now: u32,
    image: &mut impl ProcessImage,
) -> Option<Waiting> {
    let bits = registers.mapping().fold(0u32, |sum, object| sum.saturating_add(object.bits()));
    if bits == 0 {
        return None;
    }
    let received = data.len().saturating_mul(8) as u32;
    if received < bits {
        shared.note_length_error(pdo, false);
        return None;
    }
    if received > bits {
        // CiA 301 table 26, 8220h: the first bytes are processed.
        shared.note_length_error(pdo, true);
    }
    registers.received().note(now);
    let mut bytes = [0; 8];
    bytes.iter_mut().zip(data).for_each(|(byte, received)| *byte = *received);
    if registers.transmission() <= 240 {
        return Some(Waiting { data: bytes, generation: registers.generation() });
    }
    apply(registers, pdo, bytes, image);
    None
}

/// SYNC: what waited counts now, unless the PDO was set up anew or taken out of service meanwhile.
pub(crate) fn synchronise(registers: &PdoRegisters, pdo: u8, waiting: Waiting, image: &mut impl ProcessImage) {
    if registers.id().is_some() && registers.generation() == waiting.generation {
        apply(registers, pdo, waiting.data, image);
    }
}

fn apply(registers: &PdoRegisters, pdo: u8, data: [u8; 8], image: &mut impl ProcessImage) {
    let mut rest = u64::from_le_bytes(data);
    for object in registers.mapping() {
        if object.dummy().is_none() {
            image.receive(object, rest & object.mask());
        }
        rest = shift_out(rest, object);
    }
    image.received(pdo);
}

fn shift_out(rest: u64, object: MappedObject) -> u64 {
    rest.checked_shr(object.bits()).unwrap_or(0)
}
