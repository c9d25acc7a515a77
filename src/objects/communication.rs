//! Communication parameters of the joint: which PDOs there are at first, and each parameter as a number at its index;
//! the task.

use canopen_node::{COUNTER_AND_DATE, CommunicationParameters, MappedObject, PDOS, PdoParameters};

const CONTROLWORD: MappedObject = MappedObject::new(0x6040, 0, 16);
const STATUSWORD: MappedObject = MappedObject::new(0x6041, 0, 16);
/// Date and time of the configuration: they hold for all that is stored.
pub(super) const VERIFICATION: u16 = 0x1020;
/// Slow telemetry, ms.
const SLOW: u16 = 100;

/// Parameters of a joint that nobody has set up.
///
/// RPDO 4 does not exist; its mapping takes the velocity out of another joint's TPDO 2, so that only its COB-ID is to
/// be set. TPDOs 1 and 2 follow every SYNC, TPDOs 3 and 4 come ten times a second.
pub fn default_communication(node_id: u8) -> CommunicationParameters {
    let map = MappedObject::new;
    let mut parameters = CommunicationParameters::predefined(node_id);
    let cob_id = |base: u16| base.saturating_add(node_id.into());
    parameters.receive = [
        PdoParameters::new(cob_id(0x200), &[CONTROLWORD, map(0x6071, 0, 16), map(0x607A, 0, 32)]),
        PdoParameters::new(cob_id(0x300), &[CONTROLWORD, map(0x6060, 0, 8), map(0x60FF, 0, 32)]),
        PdoParameters::new(cob_id(0x400), &[map(0x2011, 1, 64)]),
        // The rest of the neighbour's PDO is skipped: a dummy of 32 bits.
        PdoParameters {
            cob_id: PdoParameters::unused(cob_id(0x500)).cob_id,
            ..PdoParameters::new(cob_id(0x500), &[map(0x2030, 1, 32), map(0x0007, 0, 32)])
        },
    ];
    let synchronous =
        |id, mapping: &[MappedObject]| PdoParameters { transmission: 1, ..PdoParameters::new(id, mapping) };
    let slow = |id, mapping: &[MappedObject]| PdoParameters {
        event_timer: SLOW,
        // Voltages and temperatures change all the time. 0.1 ms.
        inhibit: 10 * SLOW,
        ..PdoParameters::new(id, mapping)
    };
    parameters.transmit = [
        synchronous(cob_id(0x180), &[STATUSWORD, map(0x6077, 0, 16), map(0x6064, 0, 32)]),
        synchronous(cob_id(0x280), &[map(0x606C, 0, 32), map(0x2020, 1, 16), map(0x2020, 2, 16)]),
        slow(cob_id(0x380), &[map(0x2021, 1, 16), map(0x2021, 2, 16), map(0x2021, 3, 16), map(0x2021, 4, 16)]),
        slow(cob_id(0x480), &[map(0x2213, 1, 32), map(0x2200, 2, 8), map(0x2212, 2, 8), map(0x2200, 6, 16)]),
    ];
    parameters
}

/// Hands over what is stored of the communication parameters, as numbers at their indices and sub-indices, in ascending
/// order; none as soon as one is not taken.
pub(super) fn store(
    parameters: &CommunicationParameters,
    mut item: impl FnMut(u16, u8, u32) -> Option<()>,
) -> Option<()> {
    const RECEIVE: u16 = 0x1400;
    const INDICES: [(u16, u16); 9] = [
        (0x1005, 1),
        (0x1014, 4),
        (0x1019, 1),
        (VERIFICATION, 1),
        (0x1029, 1),
        (RECEIVE, 4),
        (0x1600, 4),
        (0x1800, 4),
        (0x1A00, 4),
    ];
    const _: () = assert!(PDOS == 4);
    for (first, count) in INDICES {
        for index in first..first + count {
            // Sub-indices 0 to 8 are the most that any has. RPDOs have no inhibit time and no start value.
            for sub_index in (0..=8).filter(|sub_index| first != RECEIVE || !matches!(*sub_index, 3 | 6)) {
                // Without a date nothing is to be told from a record that never had one.
                let dated = |value: &u32| !COUNTER_AND_DATE || first != VERIFICATION || *value != 0;
                if let Some(value) = get(parameters, index, sub_index).filter(dated) {
                    item(index, sub_index, value)?;
                }
            }
        }
    }
    Some(())
}

/// A parameter as it is kept.
enum Place<'a> {
    Byte(&'a mut u8),
    Short(&'a mut u16),
    Word(&'a mut u32),
}

/// The parameter at an index; none where nothing is stored.
fn place(parameters: &mut CommunicationParameters, index: u16, sub_index: u8) -> Option<Place<'_>> {
    let consumer = usize::from(sub_index).checked_sub(1);
    Some(match (index, sub_index) {
        (0x1005, 0) => Place::Word(&mut parameters.sync_cob_id),
        (0x1014, 0) => Place::Word(&mut parameters.emergency_cob_id),
        (0x1015, 0) => Place::Short(&mut parameters.emergency_inhibit),
        (0x1016, _) => Place::Word(parameters.consumers.get_mut(consumer?)?),
        (0x1017, 0) => Place::Short(&mut parameters.heartbeat),
        (0x1019, 0) if COUNTER_AND_DATE => Place::Byte(&mut parameters.sync_overflow),
        (VERIFICATION, _) if COUNTER_AND_DATE => Place::Word(parameters.verification.get_mut(consumer?)?),
        (0x1029, 1) => Place::Byte(&mut parameters.error_behaviour),
        (0x1400..=0x1BFF, _) => return pdo_place(parameters, index, sub_index),
        _ => return None,
    })
}

fn pdo_place(parameters: &mut CommunicationParameters, index: u16, sub_index: u8) -> Option<Place<'_>> {
    let all = if index < 0x1800 { &mut parameters.receive } else { &mut parameters.transmit };
    let pdo = all.get_mut(usize::from(index & 0x1FF))?;
    Some(match (index & 0x0200 != 0, sub_index) {
        (false, 1) => Place::Word(&mut pdo.cob_id),
        (false, 2) => Place::Byte(&mut pdo.transmission),
        (false, 3) => Place::Short(&mut pdo.inhibit),
        (false, 5) => Place::Short(&mut pdo.event_timer),
        (false, 6) if COUNTER_AND_DATE => Place::Byte(&mut pdo.sync_start),
        (true, 0) => Place::Byte(&mut pdo.count),
        (true, entry) => Place::Word(&mut pdo.mapping.get_mut(usize::from(entry).checked_sub(1)?)?.0),
        _ => return None,
    })
}

/// The number at an index.
pub(super) fn get(parameters: &CommunicationParameters, index: u16, sub_index: u8) -> Option<u32> {
    // A copy, so that one declaration serves both ways.
    let mut copy = *parameters;
    Some(match place(&mut copy, index, sub_index)? {
        Place::Byte(byte) => (*byte).into(),
        Place::Short(short) => (*short).into(),
        Place::Word(word) => *word,
    })
}

/// Sets the number at an index; nothing where none is stored.
pub(super) fn set(parameters: &mut CommunicationParameters, index: u16, sub_index: u8, number: u32) {
    match place(parameters, index, sub_index) {
        Some(Place::Byte(byte)) => *byte = number as u8,
        Some(Place::Short(short)) => *short = number as u16,
        Some(Place::Word(word)) => *word = number,
        None => {}
    }
}
