//! Start of a joint with the stored configuration, or the board's own; the task, before it begins.

use super::field::RANGES;
use super::stored::Stored;
use crate::joint::configuration::{BridgeConfiguration, Configuration};

/// Start of the objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Configuration in use, with which the control step runs.
    pub configuration: Configuration,
    /// Ranges of the impedance frame, by number.
    pub ranges: [f32; RANGES],
    /// The configuration that was stored last is not the one in use: it is damaged, unreadable or refused. The joint
    /// is not enabled before one has been stored (1010h) or the defaults restored (1011h).
    pub lost: bool,
    /// Code and parameters lie in one bank of flash: writing stops the program, so the motor has to be off, and nearly
    /// at rest.
    pub single_bank: bool,
    /// Times that a record may be written, [`STORES`](super::STORES) after power-up.
    pub stores_left: u8,
}

impl Start {
    /// Start from the newest `record` that is whole. `lost`: the slots hold, or held, another one. `defaults` are the
    /// board's.
    pub fn new(record: Option<&[u8]>, lost: bool, defaults: &Configuration, bridge: &BridgeConfiguration) -> Self {
        let found = record.map_or(Some(Stored::NOTHING), |record| Stored::decode(record, defaults));
        let stored = found.unwrap_or(Stored { lost: true, ..Stored::NOTHING });
        let mut start = Self {
            configuration: stored.configuration(defaults),
            ranges: stored.ranges(),
            lost: lost || stored.lost,
            single_bank: true,
            stores_left: 0,
        };
        if start.configuration.verify(bridge).is_err() {
            start.lost = true;
            start.configuration = Configuration { node_id: stored.node_id, ..*defaults };
        }
        start
    }
}
