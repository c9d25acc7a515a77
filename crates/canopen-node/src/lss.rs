//! LSS slave: node ids for nodes that have none. CiA 305; the task.
//!
//! Bit timing is fixed at 1 Mbit/s: configuring that is accepted, any other rate refused, and activating it changes
//! nothing. Store goes to the application. Works in every NMT state.

use super::abort::Abort;
use super::dictionary::{Identity, ObjectDictionary};
use super::parameters::is_node_id;
use super::shared::NO_NODE_ID;

/// Error of the manufacturer's, with its number behind it.
const MANUFACTURERS: u8 = 0xFF;
/// The application cannot do without its node id at this moment.
const MOVING: u8 = 1;
/// The application keeps a node id for its owner alone.
const OWNED: u8 = 2;
/// "Identify slave", which answers fastscan too, and "identify non-configured slave".
const IDENTIFIED: u8 = 0x4F;
const NOT_CONFIGURED: u8 = 0x50;
/// Bit check of the request that begins a fastscan.
const FASTSCAN_BEGIN: u8 = 0x80;

/// LSS modes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Mode {
    #[default]
    Waiting,
    Configuration,
}

/// Result of a request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Outcome {
    /// Data of the answer.
    pub(super) answer: Option<[u8; 8]>,
    /// A node without a node id got one: it starts to communicate.
    pub(super) start: bool,
}

impl Outcome {
    fn answer(command: u8, [a, b, c, d]: [u8; 4]) -> Self {
        Self { answer: Some([command, a, b, c, d, 0, 0, 0]), start: false }
    }
}

/// LSS slave.
#[derive(Debug)]
pub(super) struct Lss {
    mode: Mode,
    /// Node id from the next reset of communication on.
    pending: u8,
    /// Numbers of the address that a selective switch has matched.
    selected: u8,
    /// Range of the remote identification that matched so far.
    identified: u8,
    /// Number of the address that a fastscan is at.
    scanned: u8,
}

impl Lss {
    pub(super) fn new(node_id: u8) -> Self {
        Self { mode: Mode::Waiting, pending: node_id, selected: 0, identified: 0, scanned: 0 }
    }

    /// Node id from the next reset of communication on.
    pub(super) fn pending(&self) -> u8 {
        self.pending
    }

    /// A reset of communication ends the configuration.
    pub(super) fn restart(&mut self) {
        *self = Self::new(self.pending);
    }

    /// Takes a request of the LSS master.
    pub(super) fn receive(
        &mut self,
        request: &[u8; 8],
        node_id: u8,
        identity: &Identity<'_>,
        dictionary: &mut impl ObjectDictionary,
    ) -> Outcome {
        let &[command, a, b, c, d, e, f, g] = request;
        let number = u32::from_le_bytes([a, b, c, d]);
        match (command, self.mode) {
            (0x04, _) => self.switch(a, node_id),
            (0x40..=0x43, Mode::Waiting) => self.select(command & 3, number, identity),
            (0x46..=0x4B, _) => self.identify(command.wrapping_sub(0x46), number, identity),
            (0x4C, _) if !is_node_id(node_id) && !is_node_id(self.pending) => Outcome::answer(NOT_CONFIGURED, [0; 4]),
            (0x51, Mode::Waiting) if !is_node_id(node_id) && !is_node_id(self.pending) => {
                self.fastscan(number, e, f, g, identity)
            }
            (0x11 | 0x17, Mode::Configuration) if !dictionary.may_change_node_id() => {
                Outcome::answer(command, [MANUFACTURERS, MOVING, 0, 0])
            }
            (0x11, Mode::Configuration) => {
                let valid = is_node_id(a) || a == NO_NODE_ID;
                if valid {
                    self.pending = a;
                }
                Outcome::answer(command, [u8::from(!valid), 0, 0, 0])
            }
            // Table 0, entry 0: 1 Mbit/s.
            (0x13, Mode::Configuration) => Outcome::answer(command, [u8::from((a, b) != (0, 0)), 0, 0, 0]),
            (0x17, Mode::Configuration) => {
                let error = match dictionary.store_node_id(self.pending) {
                    Ok(()) => [0; 4],
                    Err(Abort::LOCAL_CONTROL) => [MANUFACTURERS, OWNED, 0, 0],
                    // The storage medium failed.
                    Err(_) => [2, 0, 0, 0],
                };
                Outcome::answer(command, error)
            }
            (0x5A..=0x5D, Mode::Configuration) => {
                let value = identity.number(command.wrapping_sub(0x5A)).unwrap_or(0);
                Outcome::answer(command, value.to_le_bytes())
            }
            (0x5E, Mode::Configuration) => Outcome::answer(command, [node_id, 0, 0, 0]),
            _ => Outcome::default(),
        }
    }

    /// Switch state global.
    fn switch(&mut self, mode: u8, node_id: u8) -> Outcome {
        self.selected = 0;
        match mode {
            0 => {
                let start = self.mode == Mode::Configuration && !is_node_id(node_id) && is_node_id(self.pending);
                self.mode = Mode::Waiting;
                Outcome { answer: None, start }
            }
            1 => {
                self.mode = Mode::Configuration;
                Outcome::default()
            }
            _ => Outcome::default(),
        }
    }

    /// Switch state selective: vendor, product, revision, serial number, in this order.
    fn select(&mut self, part: u8, number: u32, identity: &Identity<'_>) -> Outcome {
        let matches = (part == 0 || part == self.selected) && identity.number(part) == Some(number);
        self.selected = if matches { part.saturating_add(1) } else { 0 };
        if self.selected < 4 {
            return Outcome::default();
        }
        self.selected = 0;
        self.mode = Mode::Configuration;
        Outcome::answer(0x44, [0; 4])
    }

    /// Identify remote slave: vendor, product, least and greatest revision, least and greatest serial number, in this
    /// order.
    fn identify(&mut self, part: u8, number: u32, identity: &Identity<'_>) -> Outcome {
        let matches = match part {
            0 => identity.vendor == number,
            1 => identity.product == number,
            2 => identity.revision >= number,
            3 => identity.revision <= number,
            4 => identity.serial >= number,
            _ => identity.serial <= number,
        };
        let matches = (part == 0 || part == self.identified) && matches;
        self.identified = if matches { part.saturating_add(1) } else { 0 };
        if self.identified < 6 {
            return Outcome::default();
        }
        self.identified = 0;
        Outcome::answer(IDENTIFIED, [0; 4])
    }

    /// Fastscan: the master finds the address bit by bit, from bit 31 of the vendor to bit 0 of the serial number.
    fn fastscan(&mut self, number: u32, bit_check: u8, sub: u8, next: u8, identity: &Identity<'_>) -> Outcome {
        if bit_check == FASTSCAN_BEGIN {
            self.scanned = 0;
            return Outcome::answer(IDENTIFIED, [0; 4]);
        }
        if bit_check > 31 || next > 3 || sub != self.scanned {
            return Outcome::default();
        }
        let Some(own) = identity.number(sub) else { return Outcome::default() };
        if (own ^ number).checked_shr(bit_check.into()) != Some(0) {
            return Outcome::default();
        }
        if bit_check == 0 {
            self.scanned = next;
            if next < sub {
                self.mode = Mode::Configuration;
            }
        }
        Outcome::answer(IDENTIFIED, [0; 4])
    }
}
