//! NMT commands: CiA 301 section 7.2.8.3.1; host.

use super::cob_id;
use super::frame::frame;
use crate::Frame;

/// Command to a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Command {
    /// Transition to OPERATIONAL.
    Start = 0x01,
    /// Transition to STOPPED.
    Stop = 0x02,
    /// Transition to PRE-OPERATIONAL.
    EnterPreOperational = 0x80,
    /// The application starts anew, and with it communication.
    ResetNode = 0x81,
    /// Communication starts anew.
    ResetCommunication = 0x82,
}

/// Nodes that are told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// One node, 1 to 127.
    Node(u8),
    /// All.
    All,
}

impl Command {
    /// The command as a frame.
    pub fn frame(self, target: Target) -> Frame {
        let node = match target {
            Target::Node(node) => node,
            Target::All => 0,
        };
        frame(cob_id::NMT, &[self as u8, node])
    }
}
