//! Errors between a client and a node, said with node, object and limit; host.

use super::abort::description;
use crate::BusError;
use canopen_node::Abort;
use std::fmt;
use std::time::Duration;

/// An entry of a node's object dictionary, for messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Object {
    /// Node id, 1 to 127.
    pub node: u8,
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub sub_index: u8,
}

impl fmt::Display for Object {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:04X}h:{} of node {}", self.index, self.sub_index, self.node)
    }
}

/// Reason for which something did not happen.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ClientError {
    /// The bus itself.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// No node has this id.
    #[error("{0} is no node id: they are 1 to 127")]
    NodeId(u8),
    /// The node is silent.
    #[error("{object}: no answer within {} ms. {}", timeout.as_millis(), silence(object.node, heard))]
    NoAnswer {
        /// Object that was to be read or written.
        object: Object,
        /// Time for which it was waited for.
        timeout: Duration,
        /// Nodes that sent anything since the bus was opened.
        heard: Vec<u8>,
    },
    /// The node refuses.
    #[error("{object} refused: {:08X}h, {}", abort.0, description(*abort))]
    Aborted {
        /// Object that was to be read or written.
        object: Object,
        /// Reason, as an abort code.
        abort: Abort,
    },
    /// Another client uses the node's SDO server at the same time. It has one channel, and the transfers destroy each
    /// other.
    #[error(
        "{object}: another client is talking to this node's SDO server; the transfer was given up. Stop the other client, or wait for it"
    )]
    OtherClient {
        /// Object that was to be read or written.
        object: Object,
    },
    /// Message of the node that the protocol does not allow here; the transfer was aborted.
    #[error("{object}: {problem}")]
    Protocol {
        /// Object that was to be read or written.
        object: Object,
        /// Defect of it.
        problem: String,
    },
    /// No answer to what was waited for.
    #[error("{what} did not come within {} ms", timeout.as_millis())]
    Silence {
        /// Name of what was waited for.
        what: String,
        /// Time for which it was waited for.
        timeout: Duration,
    },
    /// An LSS slave refuses.
    #[error("LSS: {what} refused with error {code}{}", specific(*code, *specific_code))]
    Lss {
        /// Name of what was asked for.
        what: &'static str,
        /// Error code of CiA 305; 255 is the manufacturer's.
        code: u8,
        /// The manufacturer's code.
        specific_code: u8,
    },
}

fn specific(code: u8, specific_code: u8) -> String {
    if code == 255 { format!(" (manufacturer's code {specific_code})") } else { String::new() }
}

fn silence(node: u8, heard: &[u8]) -> String {
    let list = heard.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
    match heard {
        [] => "Nothing at all was heard on this bus: are power, wiring and bit rate (1 Mbit/s) right?".into(),
        _ if heard.contains(&node) => {
            "The node was heard before: it is busy, or stopped by NMT, or just lost power".into()
        }
        _ => format!("Other nodes were heard ({list}): is the node id right?"),
    }
}
