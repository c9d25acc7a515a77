//! The communication objects, 1000h to 1A03h, which the server serves itself; the task. CiA 301 section 7.5.2.

use super::abort::Abort;
use super::dictionary::{Access, Entry, Group, Identity, Length, Mappable, ObjectDictionary};
use super::emergency::{Emergencies, HISTORY, Lasting};
use super::heartbeat::Producer;
use super::parameters::{CONSUMERS, CommunicationParameters, HIGHEST_COUNTER, INVALID, MAPPED, NO_REMOTE, is_free};
use super::pdo::MappedObject;
use super::pdo::mapping::{self, Direction};
use super::shared::{PdoRegisters, Shared};
use super::{COUNTER_AND_DATE, SDO_RECEIVE, SDO_TRANSMIT};

/// Signatures of objects 1010h and 1011h: the ASCII characters in the order of transmission.
const SAVE: u32 = u32::from_le_bytes(*b"save");
const LOAD: u32 = u32::from_le_bytes(*b"load");
/// "Saves on command" of object 1010h, "restores defaults" of object 1011h.
const ON_COMMAND: u32 = 1;

/// Communication object; `find` gives it for an index and a sub-index.
#[derive(Clone, Copy, Debug)]
pub(super) enum Object<'a> {
    Constant(u32, u8),
    Text(&'a str),
    ErrorRegister,
    HistoryLength,
    History(u8),
    SyncCobId,
    Store(Group),
    Restore(Group),
    EmergencyCobId,
    EmergencyInhibit,
    Consumer(u8),
    Heartbeat,
    SyncOverflow,
    /// Date 0, time 1.
    Verification(u8),
    ErrorBehaviour,
    Pdo(&'a PdoRegisters, Direction, Parameter),
}

/// An entry of a PDO's objects.
#[derive(Clone, Copy, Debug)]
pub(super) enum Parameter {
    CobId,
    Transmission,
    Inhibit,
    EventTimer,
    SyncStart,
    Count,
    /// Mapping entry 0 to 7.
    Mapped(u8),
}

impl Object<'_> {
    /// Length and access.
    pub(super) fn entry(self) -> Entry {
        use Access::{ReadOnly, ReadWrite};
        let (length, access) = match self {
            Self::Text(text) => {
                let entry = Length::Stream { readable: text.len() as u32, writable: 0 };
                return Entry { length: entry, access: ReadOnly, mappable: Mappable::default() };
            }
            Self::Constant(_, bytes) => (bytes, ReadOnly),
            Self::ErrorRegister => (1, ReadOnly),
            Self::History(_) => (4, ReadOnly),
            Self::HistoryLength | Self::ErrorBehaviour | Self::SyncOverflow => (1, ReadWrite),
            Self::EmergencyInhibit | Self::Heartbeat => (2, ReadWrite),
            Self::SyncCobId
            | Self::Store(_)
            | Self::Restore(_)
            | Self::EmergencyCobId
            | Self::Consumer(_)
            | Self::Verification(_) => (4, ReadWrite),
            Self::Pdo(_, _, Parameter::CobId | Parameter::Mapped(_)) => (4, ReadWrite),
            Self::Pdo(_, _, Parameter::Transmission | Parameter::Count | Parameter::SyncStart) => (1, ReadWrite),
            Self::Pdo(_, _, Parameter::Inhibit | Parameter::EventTimer) => (2, ReadWrite),
        };
        Entry { length: Length::Value(length), access, mappable: Mappable::default() }
    }

    /// True where object 1010h stores it.
    pub(super) const fn is_stored(self) -> bool {
        matches!(
            self,
            Self::SyncCobId
                | Self::EmergencyCobId
                | Self::EmergencyInhibit
                | Self::Consumer(_)
                | Self::Heartbeat
                | Self::SyncOverflow
                | Self::ErrorBehaviour
                | Self::Pdo(..)
        )
    }
}

/// The server's state as far as objects show it.
#[derive(Debug)]
pub(super) struct Communication<'s, 'a> {
    pub(super) shared: &'a Shared,
    pub(super) identity: &'a Identity<'a>,
    pub(super) emergencies: &'s mut Emergencies,
    pub(super) producer: &'s mut Producer,
    pub(super) error_behaviour: &'s mut u8,
    pub(super) verification: &'s mut [u32; 2],
}

impl<'a> Communication<'_, 'a> {
    /// The object; none where it is not the server's, an error where only the sub-index does not exist.
    pub(super) fn find(&self, index: u16, sub_index: u8) -> Option<Result<Object<'a>, Abort>> {
        use Object::*;
        let node_id = u32::from(self.shared.node_id());
        let highest = |number| Constant(number, 1);
        let object = match (index, sub_index) {
            (0x1000, 0) => Constant(self.identity.device_type, 4),
            (0x1001, 0) => ErrorRegister,
            (0x1003, 0) => HistoryLength,
            (0x1003, number @ 1..) if usize::from(number) <= HISTORY => History(number.wrapping_sub(1)),
            (0x1005, 0) => SyncCobId,
            (0x1008, 0) => Text(self.identity.device_name),
            (0x1009, 0) => Text(self.identity.hardware_version),
            (0x100A, 0) => Text(self.identity.software_version),
            (0x1010 | 0x1011, 0) => highest(3),
            (0x1010, 1) => Store(Group::All),
            (0x1010, 2) => Store(Group::Communication),
            (0x1010, 3) => Store(Group::Application),
            (0x1011, 1) => Restore(Group::All),
            (0x1011, 2) => Restore(Group::Communication),
            (0x1011, 3) => Restore(Group::Application),
            (0x1014, 0) => EmergencyCobId,
            (0x1015, 0) => EmergencyInhibit,
            (0x1016, 0) => highest(CONSUMERS as u32),
            (0x1016, number @ 1..) if usize::from(number) <= CONSUMERS => Consumer(number.wrapping_sub(1)),
            (0x1017, 0) => Heartbeat,
            (0x1018, 0) => highest(4),
            (0x1018, number @ 1..=4) => Constant(self.identity.number(number.wrapping_sub(1)).unwrap_or(0), 4),
            (0x1019, 0) if COUNTER_AND_DATE => SyncOverflow,
            (0x1020, 0) if COUNTER_AND_DATE => highest(2),
            (0x1020, number @ 1..=2) if COUNTER_AND_DATE => Verification(number.wrapping_sub(1)),
            (0x1019 | 0x1020, _) if COUNTER_AND_DATE => return Some(Err(Abort::NO_SUB_INDEX)),
            (0x1029, 0) => highest(1),
            (0x1029, 1) => ErrorBehaviour,
            (0x1200, 0) => highest(2),
            (0x1200, 1) => Constant(u32::from(SDO_RECEIVE) | node_id, 4),
            (0x1200, 2) => Constant(u32::from(SDO_TRANSMIT) | node_id, 4),
            (0x1400..=0x1BFF, _) => return self.find_pdo(index, sub_index),
            (0x1000 | 0x1001 | 0x1003 | 0x1005 | 0x1008..=0x100A | 0x1010 | 0x1011 | 0x1014..=0x1018, _)
            | (0x1029 | 0x1200, _) => return Some(Err(Abort::NO_SUB_INDEX)),
            _ => return None,
        };
        Some(Ok(object))
    }

    fn find_pdo(&self, index: u16, sub_index: u8) -> Option<Result<Object<'a>, Abort>> {
        use Direction::{Receive, Transmit};
        let (all, direction, mapping) = match index & 0xFE00 {
            0x1400 => (&self.shared.receive, Receive, false),
            0x1600 => (&self.shared.receive, Receive, true),
            0x1800 => (&self.shared.transmit, Transmit, false),
            0x1A00 => (&self.shared.transmit, Transmit, true),
            _ => return None,
        };
        let registers = all.get(usize::from(index & 0x1FF))?;
        let parameter = match (mapping, sub_index) {
            (false, 0) if COUNTER_AND_DATE && direction == Transmit => return Some(Ok(Object::Constant(6, 1))),
            (false, 0) => return Some(Ok(Object::Constant(5, 1))),
            (false, 1) => Parameter::CobId,
            (false, 2) => Parameter::Transmission,
            (false, 3) if direction == Transmit => Parameter::Inhibit,
            (false, 5) => Parameter::EventTimer,
            (false, 6) if COUNTER_AND_DATE && direction == Transmit => Parameter::SyncStart,
            (true, 0) => Parameter::Count,
            (true, number @ 1..) if usize::from(number) <= MAPPED => Parameter::Mapped(number.wrapping_sub(1)),
            _ => return Some(Err(Abort::NO_SUB_INDEX)),
        };
        Some(Ok(Object::Pdo(registers, direction, parameter)))
    }

    /// The value of an object that is not a text.
    pub(super) fn read(&self, object: Object<'_>) -> Result<u32, Abort> {
        Ok(match object {
            Object::Constant(value, _) => value,
            Object::Text(_) => return Err(Abort::GENERAL),
            Object::ErrorRegister => self.emergencies.register().into(),
            Object::HistoryLength => self.emergencies.history_length().into(),
            Object::History(entry) => self.emergencies.history(entry).ok_or(Abort::NO_DATA)?,
            Object::SyncCobId => self.shared.sync_cob_id().into(),
            Object::Store(_) | Object::Restore(_) => ON_COMMAND,
            Object::EmergencyCobId => self.emergencies.cob_id,
            Object::EmergencyInhibit => self.emergencies.inhibit.into(),
            Object::Consumer(consumer) => {
                self.shared.consumers.get(usize::from(consumer)).ok_or(Abort::NO_SUB_INDEX)?.setting()
            }
            Object::Heartbeat => self.producer.period().into(),
            Object::SyncOverflow if COUNTER_AND_DATE => self.shared.sync_overflow().into(),
            Object::Verification(part) if COUNTER_AND_DATE => {
                *self.verification.get(usize::from(part)).ok_or(Abort::NO_SUB_INDEX)?
            }
            Object::ErrorBehaviour => (*self.error_behaviour).into(),
            Object::SyncOverflow | Object::Verification(_) => return Err(Abort::NO_OBJECT),
            Object::Pdo(registers, direction, parameter) => match parameter {
                Parameter::CobId => mapping::cob_id(registers, direction),
                Parameter::Transmission => registers.transmission().into(),
                Parameter::Inhibit => registers.inhibit().into(),
                Parameter::EventTimer => registers.event_timer().into(),
                Parameter::SyncStart if COUNTER_AND_DATE => registers.sync_start().into(),
                Parameter::SyncStart => return Err(Abort::NO_SUB_INDEX),
                Parameter::Count => registers.count().into(),
                Parameter::Mapped(entry) => registers.mapped(entry).ok_or(Abort::NO_SUB_INDEX)?.0,
            },
        })
    }

    /// Sets an object to a value that has its length.
    #[inline(never)]
    pub(super) fn write(
        &mut self,
        object: Object<'_>,
        value: u32,
        dictionary: &mut impl ObjectDictionary,
    ) -> Result<(), Abort> {
        match object {
            Object::Constant(..) | Object::Text(_) | Object::ErrorRegister | Object::History(_) => {
                return Err(Abort::READ_ONLY);
            }
            Object::HistoryLength if value == 0 => self.emergencies.clear_history(),
            Object::HistoryLength => return Err(Abort::VALUE),
            // Bit 30 would make this node the SYNC producer; bit 29 asks for extended identifiers.
            Object::SyncCobId if is_free(value) => self.shared.set_sync_cob_id(value as u16),
            Object::SyncCobId => return Err(Abort::VALUE),
            Object::Store(group) if value == SAVE => {
                let mut parameters = self.parameters();
                if COUNTER_AND_DATE && group != Group::All {
                    // Date and time are those of everything.
                    parameters.verification = [0; 2];
                }
                dictionary.store(group, &parameters)?;
                self.date(parameters.verification);
            }
            Object::Restore(group) if value == LOAD => {
                dictionary.restore(group)?;
                self.date([0; 2]);
            }
            Object::Store(_) | Object::Restore(_) => return Err(Abort::STORE),
            Object::EmergencyCobId => self.set_emergency_cob_id(value)?,
            Object::EmergencyInhibit => self.emergencies.inhibit = value as u16,
            Object::Consumer(consumer) => self.set_consumer(consumer, value)?,
            Object::Heartbeat => self.producer.set_period(value as u16),
            // There is no cycle period (1006h) that would be in the way: this node never produces SYNC.
            Object::SyncOverflow if COUNTER_AND_DATE && value != 1 && value <= u32::from(HIGHEST_COUNTER) => {
                self.shared.set_sync_overflow(value as u8);
                self.emergencies.end(Lasting::SyncLength);
            }
            Object::Verification(part) if COUNTER_AND_DATE => {
                *self.verification.get_mut(usize::from(part)).ok_or(Abort::NO_SUB_INDEX)? = value;
            }
            Object::SyncOverflow | Object::Verification(_) => return Err(Abort::VALUE),
            Object::ErrorBehaviour if value <= 2 => *self.error_behaviour = value as u8,
            Object::ErrorBehaviour => return Err(Abort::VALUE),
            Object::Pdo(registers, direction, parameter) => match parameter {
                Parameter::CobId => mapping::set_cob_id(registers, value)?,
                Parameter::Transmission => mapping::set_transmission(registers, value as u8)?,
                Parameter::Inhibit => mapping::set_inhibit(registers, value as u16)?,
                Parameter::EventTimer => registers.set_event_timer(value as u16),
                Parameter::SyncStart if COUNTER_AND_DATE => mapping::set_sync_start(registers, value as u8)?,
                Parameter::SyncStart => return Err(Abort::NO_SUB_INDEX),
                Parameter::Count => mapping::set_count(registers, direction, value as u8, dictionary)?,
                Parameter::Mapped(entry) => {
                    let object = MappedObject(value);
                    let set = mapping::set_mapped(registers, direction, entry, object, dictionary);
                    // The application does not know the server's own objects, which no PDO carries.
                    let own = || self.find(object.index(), object.sub_index());
                    set.map_err(|abort| {
                        if abort == Abort::NO_OBJECT && own().is_some() { Abort::NOT_MAPPABLE } else { abort }
                    })?;
                }
            },
        }
        Ok(())
    }

    /// Date and time of the configuration are others now.
    pub(super) fn date(&mut self, verification: [u32; 2]) {
        if COUNTER_AND_DATE {
            *self.verification = verification;
        }
    }

    fn set_emergency_cob_id(&mut self, value: u32) -> Result<(), Abort> {
        let now = self.emergencies.cob_id;
        // While EMCY exists its identifier stays, CiA 301 section 7.5.2.17.
        let changed = now & INVALID == 0 && value & INVALID == 0 && now != value;
        if changed || value & NO_REMOTE != 0 || !is_free(value & !INVALID) {
            return Err(Abort::VALUE);
        }
        self.emergencies.cob_id = value;
        Ok(())
    }

    fn set_consumer(&mut self, consumer: u8, value: u32) -> Result<(), Abort> {
        let (node, time) = (value >> 16, value & 0xFFFF);
        if node > 127 {
            return Err(Abort::VALUE);
        }
        let others = self.shared.consumers.iter().zip(0u8..).filter(|(_, number)| *number != consumer);
        // A node with two times, CiA 301 section 7.5.2.13.
        if time != 0 && node != 0 && others.into_iter().any(|(other, _)| other.node() == Some(node as u8)) {
            return Err(Abort::INCOMPATIBLE);
        }
        self.shared.consumers.get(usize::from(consumer)).ok_or(Abort::NO_SUB_INDEX)?.set(value);
        Ok(())
    }

    /// All parameters as they are now.
    pub(super) fn parameters(&self) -> CommunicationParameters {
        let mut parameters = CommunicationParameters::predefined(self.shared.node_id());
        parameters.sync_cob_id = self.shared.sync_cob_id().into();
        parameters.emergency_cob_id = self.emergencies.cob_id;
        parameters.emergency_inhibit = self.emergencies.inhibit;
        parameters.heartbeat = self.producer.period();
        if COUNTER_AND_DATE {
            parameters.sync_overflow = self.shared.sync_overflow();
            parameters.verification = *self.verification;
        }
        parameters.error_behaviour = *self.error_behaviour;
        for (setting, registers) in parameters.consumers.iter_mut().zip(&self.shared.consumers) {
            *setting = registers.setting();
        }
        for (pdo, registers) in parameters.receive.iter_mut().zip(&self.shared.receive) {
            *pdo = registers.parameters();
        }
        for (pdo, registers) in parameters.transmit.iter_mut().zip(&self.shared.transmit) {
            *pdo = registers.parameters();
        }
        parameters
    }
}
