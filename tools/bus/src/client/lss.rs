//! LSS master's protocol: finding nodes without a node id by fastscan, and giving them one; CiA 305; no I/O, host.
//!
//! A fastscan finds one of any number of identical new nodes: the master asks bit by bit whether some node's address
//! has a 0 there, and takes silence for a 1. All nodes that match answer with the same frame. The one that is left at
//! the end is in configuration state; then it gets its node id, and is not asked again.

use super::sdo::Message;
use std::fmt;

/// A node's 128-bit LSS address: object 1018h.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Address {
    /// 1018h:1.
    pub vendor: u32,
    /// 1018h:2.
    pub product: u32,
    /// 1018h:3.
    pub revision: u32,
    /// 1018h:4.
    pub serial: u32,
}

impl Address {
    fn number(&mut self, part: u8) -> &mut u32 {
        match part {
            0 => &mut self.vendor,
            1 => &mut self.product,
            2 => &mut self.revision,
            _ => &mut self.serial,
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { vendor, product, revision, serial } = self;
        write!(
            formatter,
            "vendor {vendor:08X}h, product {product:08X}h, revision {revision:08X}h, serial number {serial:08X}h"
        )
    }
}

/// Answer to a fastscan: "identify slave".
pub const IDENTIFIED: u8 = 0x4F;

/// Requests of an LSS master.
pub mod request {
    use super::{Address, Message};

    fn number(command: u8, number: u32) -> Message {
        let [a, b, c, d] = number.to_le_bytes();
        [command, a, b, c, d, 0, 0, 0]
    }

    /// All nodes to waiting state (configuration false) or configuration state (true); no answer. A node without a node
    /// id that got one begins to communicate when it returns to waiting.
    pub const fn switch_global(configuration: bool) -> Message {
        [0x04, configuration as u8, 0, 0, 0, 0, 0, 0]
    }

    /// The four messages that bring the node with this address to configuration state; it answers the last with 44h.
    pub fn switch_selective(address: &Address) -> [Message; 4] {
        let Address { vendor, product, revision, serial } = *address;
        [number(0x40, vendor), number(0x41, product), number(0x42, revision), number(0x43, serial)]
    }

    /// The node in configuration state gets this id, 1 to 127, or 255 for none; it answers 11h and an error code.
    pub const fn configure_node_id(node: u8) -> Message {
        [0x11, node, 0, 0, 0, 0, 0, 0]
    }

    /// The node keeps its id over a loss of power; it answers 17h and an error code.
    pub const fn store() -> Message {
        [0x17, 0, 0, 0, 0, 0, 0, 0]
    }

    /// Fastscan: nodes without an id whose number `part` equals `number` from `bit` up answer. Bit 128 asks all of
    /// them.
    pub fn fastscan(number: u32, bit: u8, part: u8, next: u8) -> Message {
        let [a, b, c, d] = number.to_le_bytes();
        [0x51, a, b, c, d, bit, part, next]
    }
}

/// "Begin": every node without an id answers.
const BEGIN: u8 = 128;

/// Next step of the scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Send this, and tell by [`Fastscan::answered`] whether anybody answered [`IDENTIFIED`].
    Ask(Message),
    /// The node with this address is in configuration state.
    Found(Address),
    /// No node without an id.
    Nobody,
    /// A node answered, and then contradicted itself: an answer came late or was lost. Scan again, with a longer wait.
    Confused,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Begin,
    /// Is this bit of this number 0?
    Bit {
        part: u8,
        bit: u8,
    },
    /// Is the whole number right? The node goes on with the next one.
    Confirm {
        part: u8,
    },
    Over(Step),
}

/// A fastscan in progress: 4 x 33 + 1 questions.
#[derive(Clone, Debug)]
pub struct Fastscan {
    address: Address,
    phase: Phase,
}

impl Default for Fastscan {
    fn default() -> Self {
        Self::new()
    }
}

impl Fastscan {
    /// Scan from the beginning.
    pub fn new() -> Self {
        Self { address: Address::default(), phase: Phase::Begin }
    }

    /// Step to do now.
    pub fn step(&mut self) -> Step {
        match self.phase {
            Phase::Begin => Step::Ask(request::fastscan(0, BEGIN, 0, 0)),
            Phase::Bit { part, bit } => Step::Ask(request::fastscan(*self.address.number(part), bit, part, part)),
            Phase::Confirm { part } => {
                // After the last number the next one is the first, which ends the scan at the node.
                Step::Ask(request::fastscan(*self.address.number(part), 0, part, (part + 1) & 3))
            }
            Phase::Over(step) => step,
        }
    }

    /// Takes whether anybody answered what [`Fastscan::step`] asked.
    pub fn answered(&mut self, somebody: bool) {
        self.phase = match (self.phase, somebody) {
            (Phase::Begin, true) => Phase::Bit { part: 0, bit: 31 },
            (Phase::Begin, false) => Phase::Over(Step::Nobody),
            (Phase::Bit { part, bit }, _) => {
                if !somebody {
                    *self.address.number(part) |= 1 << bit;
                }
                if bit > 0 { Phase::Bit { part, bit: bit - 1 } } else { Phase::Confirm { part } }
            }
            (Phase::Confirm { part: 3 }, true) => Phase::Over(Step::Found(self.address)),
            (Phase::Confirm { part }, true) => Phase::Bit { part: part + 1, bit: 31 },
            (Phase::Confirm { .. }, false) => Phase::Over(Step::Confused),
            (Phase::Over(step), _) => Phase::Over(step),
        };
    }
}
