//! Changing PDO parameters at run time, by the procedure of CiA 301 section 7.5.2.36: take the PDO out of service (bit
//! 31 of the COB-ID), set sub-index 0 of the mapping to 0, write the entries, set sub-index 0 to their number, put the
//! PDO into service; the task.

use super::MappedObject;
use crate::abort::Abort;
use crate::dictionary::{Access, Entry, Length, ObjectDictionary};
use crate::parameters::{HIGHEST_COUNTER, INVALID, MAPPED, NO_REMOTE, is_free};
use crate::shared::PdoRegisters;

/// Direction of a PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direction {
    Receive,
    Transmit,
}

/// Sub-index 1 of the communication parameter as a client reads it.
pub(crate) fn cob_id(registers: &PdoRegisters, direction: Direction) -> u32 {
    match direction {
        Direction::Receive => registers.cob_id() & !NO_REMOTE,
        Direction::Transmit => registers.cob_id() | NO_REMOTE,
    }
}

/// Writes sub-index 1. Bit 30 is taken with either value and reads as it is: 1 for a TPDO, as there are no remote
/// frames.
pub(crate) fn set_cob_id(registers: &PdoRegisters, value: u32) -> Result<(), Abort> {
    let wanted = value & !NO_REMOTE;
    let now = registers.cob_id() & !NO_REMOTE;
    let identifier = wanted & !INVALID;
    let in_service = wanted & INVALID == 0;
    // While the PDO exists its identifier stays. Bit 29 asks for extended identifiers, which do not exist here.
    let changed = now & INVALID == 0 && in_service && now != wanted;
    // Out of service any 11-bit value may stand there, also the 0 that some clients write.
    if changed || identifier > 0x7FF || (in_service && !is_free(identifier)) {
        return Err(Abort::VALUE);
    }
    registers.set_cob_id(wanted);
    Ok(())
}

/// Writes sub-index 2. 241 to 251 are reserved; 252 and 253 need remote frames.
pub(crate) fn set_transmission(registers: &PdoRegisters, value: u8) -> Result<(), Abort> {
    if matches!(value, 241..=253) {
        return Err(Abort::VALUE);
    }
    registers.set_transmission(value);
    Ok(())
}

/// Writes sub-index 3; only while the PDO does not exist.
pub(crate) fn set_inhibit(registers: &PdoRegisters, value: u16) -> Result<(), Abort> {
    if registers.id().is_some() {
        return Err(Abort::VALUE);
    }
    registers.set_inhibit(value);
    Ok(())
}

/// Writes sub-index 6; only while the PDO does not exist.
pub(crate) fn set_sync_start(registers: &PdoRegisters, value: u8) -> Result<(), Abort> {
    if registers.id().is_some() || value > HIGHEST_COUNTER {
        return Err(Abort::VALUE);
    }
    registers.set_sync_start(value);
    Ok(())
}

/// Writes sub-index 0 of the mapping.
pub(crate) fn set_count(
    registers: &PdoRegisters,
    direction: Direction,
    count: u8,
    dictionary: &impl ObjectDictionary,
) -> Result<(), Abort> {
    if registers.id().is_some() {
        return Err(Abort::ACCESS);
    }
    if usize::from(count) > MAPPED {
        return Err(Abort::PDO_LENGTH);
    }
    let mut bits = 0u32;
    for entry in 0..count {
        let object = registers.mapped(entry).ok_or(Abort::GENERAL)?;
        check(object, direction, dictionary)?;
        bits = bits.saturating_add(object.bits());
    }
    if bits > 64 {
        return Err(Abort::PDO_LENGTH);
    }
    registers.set_count(count);
    Ok(())
}

/// Writes sub-index 1 to 8 of the mapping, `entry` 0 to 7.
pub(crate) fn set_mapped(
    registers: &PdoRegisters,
    direction: Direction,
    entry: u8,
    object: MappedObject,
    dictionary: &impl ObjectDictionary,
) -> Result<(), Abort> {
    if registers.id().is_some() || registers.count() != 0 {
        return Err(Abort::ACCESS);
    }
    // Zero empties the place.
    if object.0 != 0 {
        check(object, direction, dictionary)?;
    }
    registers.set_mapped(entry, object);
    Ok(())
}

/// Checks that an object may be mapped; whole values only.
fn check(object: MappedObject, direction: Direction, dictionary: &impl ObjectDictionary) -> Result<(), Abort> {
    if object.index() < 0x1000 {
        let dummy = direction == Direction::Receive && object.dummy() == Some(object.bits());
        return if dummy { Ok(()) } else { Err(Abort::NO_OBJECT) };
    }
    let Entry { length, access, mappable } = dictionary.entry(object.index(), object.sub_index())?;
    let allowed = match direction {
        Direction::Receive => mappable.receive && access != Access::ReadOnly,
        Direction::Transmit => mappable.transmit && access != Access::WriteOnly,
    };
    match length {
        Length::Value(bytes) if allowed && u32::from(bytes).saturating_mul(8) == object.bits() => Ok(()),
        _ => Err(Abort::NOT_MAPPABLE),
    }
}
