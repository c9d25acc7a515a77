//! What object 1010h stores: configuration, impedance ranges and communication parameters as one record of bytes; the task, host.
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 1 | format, 1 |
//! | 1 | 1 | node id that LSS stored, 255 for none |
//! | 2 | 1 | node id that the communication parameters are for; 0 where there are none |
//! | 3 | 7 each | index (2 bytes), sub-index (1), value (4), all little-endian, for every object that is stored |
//!
//! Objects that a program does not know are skipped, objects that are missing keep their defaults: a record survives a change of
//! program both ways. Length and damage are the business of the [slots](crate::parameters::slots) that it lies in.

use super::communication;
use super::field::{Field, RANGES, Range};
use super::shared::DEFAULT_RANGES;
use super::table::OBJECTS;
use crate::canopen::{CommunicationParameters, NO_NODE_ID};
use crate::joint::configuration::Configuration;

/// Longest record: what all objects take, 1,088 bytes, and nine more. A page of flash would hold 2,016; the stack has to, too.
pub const RECORD: usize = 1_152;
const _: () = assert!(RECORD <= crate::parameters::slots::PAGE - crate::parameters::slots::OVERHEAD);
const FORMAT: u8 = 1;
const ITEM: usize = 7;

/// A record's content.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stored {
    /// 1 to 127, or 255 for none: what LSS stored. Defaults are restored without it.
    pub node_id: u8,
    /// 2101h to 2106h and 2200h, and 2012h.
    pub application: Option<(Configuration, [f32; RANGES])>,
    /// 1000h to 1FFFh, and the node id that they are for: another node id gets the defaults.
    pub communication: Option<(u8, CommunicationParameters)>,
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
}

impl Stored {
    /// What there is without a record.
    pub const NOTHING: Self = Self { node_id: NO_NODE_ID, application: None, communication: None };

    /// The configuration to start with, where `defaults` are the board's. It may hold values out of their ranges, if those have
    /// changed: [`Configuration::prepare`] decides.
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
        let (&[FORMAT, node_id, of], items) = record.split_first_chunk()? else { return None };
        let (mut configuration, mut ranges, mut application) = (*defaults, DEFAULT_RANGES, false);
        let mut parameters = super::default_communication(of);
        for item in items.chunks_exact(ITEM) {
            let &[low, high, sub_index, a, b, c, d] = item else { continue };
            let (index, value) = (u16::from_le_bytes([low, high]), u32::from_le_bytes([a, b, c, d]));
            let Some(object) = super::table::find(index, sub_index) else {
                communication::set(&mut parameters, index, sub_index, value);
                continue;
            };
            application = true;
            match object.field {
                Field::Setting(setting) | Field::Compensation(setting) => {
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
        let node_id = if matches!(node_id, 1..=127) { node_id } else { NO_NODE_ID };
        Some(Self {
            node_id,
            application: application.then_some((configuration, ranges)),
            communication: (of != 0).then_some((of, parameters)),
        })
    }

    /// The record's length. None where it does not fit, which a test rules out.
    pub fn encode(&self, record: &mut [u8; RECORD]) -> Option<usize> {
        let mut writer = Writer { record, length: 0 };
        writer.put(&[FORMAT, self.node_id, self.communication.map_or(0, |(node_id, _)| node_id)])?;
        if let Some((configuration, ranges)) = &self.application {
            for object in &OBJECTS {
                let value = match object.field {
                    Field::Setting(setting) | Field::Compensation(setting) => setting.get(configuration),
                    Field::Range(range) => ranges.get(range as usize).map_or(0, |value| value.to_bits()),
                    _ => continue,
                };
                writer.item(object.index, object.sub_index, value)?;
            }
        }
        if let Some((_, parameters)) = &self.communication {
            communication::store(parameters, |index, sub_index, value| writer.item(index, sub_index, value))?;
        }
        Some(writer.length)
    }
}

/// Whether a range can be used.
pub(super) fn is_range(range: Range, value: f32) -> bool {
    value > 0.0 && value <= range.widest()
}
