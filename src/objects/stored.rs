//! Content of object 1010h's store: configuration, impedance ranges and communication parameters as one record of
//! bytes; the task, host.
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 1 | format, 1; bit 7: a configuration that was stored before is lost, and none has been stored since |
//! | 1 | 1 | node id that LSS stored, 255 for none |
//! | 2 | 1 | node id that the communication parameters are for; 0 where there are none |
//! | 3 | 7 each | index (2 bytes), sub-index (1), value (4), all little-endian, for every object that is stored |
//!
//! Objects that a program does not know are skipped, objects that are missing keep their defaults: a record survives a
//! change of program both ways. A limit damping that is missing, in records of programs that had none, is the least
//! that its limits permit. Length and damage are the business of the [slots](friction_compensation::parameters::slots)
//! that it lies in.

use super::communication::{self, VERIFICATION};
use super::field::{Field, RANGES, Range};
use super::shared::DEFAULT_RANGES;
use super::table::OBJECTS;
use crate::joint::configuration::Configuration;
use crate::joint::configuration::LOADS;
use canopen_node::{COUNTER_AND_DATE, CommunicationParameters, NO_NODE_ID};

/// Longest record: what all objects take, 1,221 bytes and those of the SYNC counter, of 1020h and of a load, and three
/// more. A page of flash would hold 2,016; the stack has to, too.
pub const RECORD: usize = 1_224 + if COUNTER_AND_DATE { 7 * ITEM } else { 0 } + 9 * ITEM * LOADS as usize;
const _: () = assert!(
    RECORD <= friction_compensation::parameters::slots::PAGE - friction_compensation::parameters::slots::OVERHEAD
);
const FORMAT: u8 = 1;
/// Flag of the format.
const LOST: u8 = 1 << 7;
const ITEM: usize = 7;

/// A record's content but for the communication parameters, which are read from it when they are wanted
/// (`communication_parameters`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stored {
    /// 1 to 127, or 255 for none: what LSS stored. Defaults are restored without it.
    pub node_id: u8,
    /// A configuration was lost: what is here is not what was stored last.
    pub lost: bool,
    /// 2101h to 2109h and 2200h to 2203h, and 2012h.
    pub application: Option<(Configuration, [f32; RANGES])>,
}

/// A part of a new record.
#[derive(Clone, Copy, Debug)]
pub enum Part<T> {
    /// Unchanged from the record before.
    Kept,
    /// Left out: defaults.
    Removed,
    /// New values.
    New(T),
}

/// A new record in place of one before. What both hold is copied item by item, so that nobody has to hold a whole
/// record's values.
#[derive(Clone, Copy, Debug)]
pub struct Update<'a> {
    /// The node id that LSS stored, or none for the one before.
    pub node_id: Option<u8>,
    /// 2101h to 2109h and 2200h to 2203h, and 2012h.
    pub application: Part<(&'a Configuration, [f32; RANGES])>,
    /// 1000h to 1FFFh, and the node id that they are for: another node id gets the defaults.
    pub communication: Part<(u8, &'a CommunicationParameters)>,
}

/// A record's two node ids and its items; none for another format.
fn parse(record: &[u8]) -> Option<(u8, u8, impl Iterator<Item = (u16, u8, u32)>)> {
    let (&[format, node_id, of], items) = record.split_first_chunk()?;
    if format & !LOST != FORMAT {
        return None;
    }
    let items = items.chunks_exact(ITEM).filter_map(|item| {
        let &[low, high, sub_index, a, b, c, d] = item else { return None };
        Some((u16::from_le_bytes([low, high]), sub_index, u32::from_le_bytes([a, b, c, d])))
    });
    Some((if matches!(node_id, 1..=127) { node_id } else { NO_NODE_ID }, of, items))
}

/// Returns `true` if an index is one of the server's objects.
const fn is_communication(index: u16) -> bool {
    index < 0x2000
}

/// The communication parameters for a node id: those of a record that holds some for it, or the defaults.
pub(super) fn communication_parameters(record: Option<&[u8]>, node_id: u8) -> CommunicationParameters {
    let mut parameters = super::default_communication(node_id);
    if let Some((_, of, items)) = record.and_then(parse)
        && of == node_id
    {
        for (index, sub_index, value) in items.filter(|(index, ..)| is_communication(*index)) {
            communication::set(&mut parameters, index, sub_index, value);
        }
    }
    parameters
}

/// Fills a record.
struct Writer<'a> {
    record: &'a mut [u8; RECORD],
    length: usize,
}

impl Writer<'_> {
    /// None where the record is full.
    fn put(&mut self, bytes: &[u8]) -> Option<()> {
        let end = self.length.checked_add(bytes.len())?;
        let place = self.record.get_mut(self.length..end)?;
        place.iter_mut().zip(bytes).for_each(|(place, byte)| *place = *byte);
        self.length = end;
        Some(())
    }

    fn item(&mut self, index: u16, sub_index: u8, value: u32) -> Option<()> {
        self.put(&index.to_le_bytes())?;
        self.put(&[sub_index])?;
        self.put(&value.to_le_bytes())
    }

    /// The items of another record that are wanted.
    fn copy(&mut self, record: &[u8], wanted: impl Fn(u16, u8) -> bool) -> Option<()> {
        let (_, _, items) = parse(record)?;
        for (index, sub_index, value) in items.filter(|(index, sub_index, _)| wanted(*index, *sub_index)) {
            self.item(index, sub_index, value)?;
        }
        Some(())
    }
}

impl Stored {
    /// Content without a record.
    pub const NOTHING: Self = Self { node_id: NO_NODE_ID, lost: false, application: None };

    /// The configuration to start with, where `defaults` are the board's. It may hold values out of their ranges, if
    /// those have changed: [`Configuration::prepare`] decides.
    pub fn configuration(&self, defaults: &Configuration) -> Configuration {
        let (configuration, _) = self.application.unwrap_or((*defaults, DEFAULT_RANGES));
        Configuration { node_id: self.node_id, ..configuration }
    }

    /// Ranges of the impedance frame.
    pub fn ranges(&self) -> [f32; RANGES] {
        self.application.map_or(DEFAULT_RANGES, |(_, ranges)| ranges)
    }

    /// Reads a record; what it lacks comes from `defaults`, the board's. None for another format.
    pub fn decode(record: &[u8], defaults: &Configuration) -> Option<Self> {
        let (node_id, _, items) = parse(record)?;
        let (mut configuration, mut ranges, mut application) = (*defaults, DEFAULT_RANGES, false);
        configuration.limits.damping = 0.0;
        for (index, sub_index, value) in items {
            let Some(object) = super::table::find(index, sub_index) else { continue };
            application = true;
            match object.field {
                Field::Setting(setting) | Field::AtOnce(setting) => {
                    // A number that stands for nothing any more: the default.
                    let _ = setting.set(&mut configuration, value);
                }
                Field::Range(range) if is_range(range, f32::from_bits(value)) => {
                    if let Some(place) = ranges.get_mut(range as usize) {
                        *place = f32::from_bits(value);
                    }
                }
                _ => {}
            }
        }
        if configuration.limits.damping == 0.0 {
            configuration.limits.damping = configuration.limits.least_damping();
        }
        let lost = record.first().is_some_and(|format| format & LOST != 0);
        Some(Self { node_id, lost, application: application.then_some((configuration, ranges)) })
    }
}

impl Update<'_> {
    /// Writes the new record; its length. None where it does not fit, which a test rules out. `lost`: it says that a
    /// configuration is.
    pub fn encode(&self, before: Option<&[u8]>, lost: bool, record: &mut [u8; RECORD]) -> Option<usize> {
        let old = before.filter(|before| parse(before).is_some()).unwrap_or(&[FORMAT, NO_NODE_ID, 0]);
        let (node_id, old_of, _) = parse(old)?;
        let of = match self.communication {
            Part::Kept => old_of,
            Part::Removed => 0,
            Part::New((of, _)) => of,
        };
        let mut writer = Writer { record, length: 0 };
        writer.put(&[FORMAT | u8::from(lost) << 7, self.node_id.unwrap_or(node_id), of])?;
        match &self.application {
            Part::Kept => writer.copy(old, |index, sub_index| super::table::find(index, sub_index).is_some())?,
            Part::Removed => {}
            Part::New((configuration, ranges)) => {
                for object in &OBJECTS {
                    let value = match object.field {
                        Field::Setting(setting) | Field::AtOnce(setting) => setting.get(configuration),
                        Field::Range(range) => ranges.get(range as usize).map_or(0, |value| value.to_bits()),
                        _ => continue,
                    };
                    writer.item(object.index, object.sub_index, value)?;
                }
            }
        }
        match self.communication {
            Part::Kept => {
                let dated = !COUNTER_AND_DATE || matches!(self.application, Part::Kept);
                writer.copy(old, |index, _| is_communication(index) && (dated || index != VERIFICATION))?;
            }
            Part::Removed => {}
            Part::New((_, parameters)) => {
                communication::store(parameters, |index, sub_index, value| writer.item(index, sub_index, value))?;
            }
        }
        Some(writer.length)
    }
}

/// Returns `true` if a range can be used.
pub(super) fn is_range(range: Range, value: f32) -> bool {
    value > 0.0 && value <= range.widest()
}
