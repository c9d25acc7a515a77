//! CANopen from the master's side (CiA 301, CiA 305); host.
//!
//! Protocols are state machines without I/O, to which time is passed: [`sdo::Transfer`], [`heartbeat::Watch`],
//! [`lss::Fastscan`]. They run in simulated time as well as on a bus. [`Network`] runs them on a bus: it owns the only
//! reader, and everyone else subscribes.
//!
//! ```no_run
//! use bus::client::{Command, Network, Target};
//! use std::time::Duration;
//!
//! let network = Network::new(bus::open("socketcan:can0")?);
//! let node = network.node(5)?;
//! let status = node.upload(0x6041, 0)?;
//! network.command(Command::Start, Target::Node(5))?;
//! let positions = network.subscribe(|frame| frame.id() == 0x185);
//! network.sync()?;
//! let sample = positions.next(Duration::from_millis(10))?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod abort;
pub mod emergency;
mod error;
mod frame;
pub mod heartbeat;
pub mod lss;
mod lss_master;
mod network;
mod nmt;
mod node;
pub mod sdo;
mod sync;

pub use abort::description;
pub use emergency::Emergency;
pub use error::{ClientError, Object};
pub use network::{Network, Received, Subscription};
pub use nmt::{Command, Target};
pub use node::Node;
pub use sync::SyncProducer;

pub use canopen_node::{Abort, NmtState};

/// Identifiers of the predefined connection set, CiA 301 section 7.3.3; the node id is added to the last four.
pub mod cob_id {
    /// NMT commands.
    pub const NMT: u16 = 0x000;
    /// SYNC.
    pub const SYNC: u16 = 0x080;
    /// EMCY.
    pub const EMERGENCY: u16 = 0x080;
    /// Identifier from a node's SDO server.
    pub const SDO_TRANSMIT: u16 = 0x580;
    /// Identifier to a node's SDO server.
    pub const SDO_RECEIVE: u16 = 0x600;
    /// Heartbeat and boot-up.
    pub const HEARTBEAT: u16 = 0x700;
    /// Identifier from LSS slaves (CiA 305).
    pub const LSS_SLAVE: u16 = 0x7E4;
    /// Identifier to LSS slaves (CiA 305).
    pub const LSS_MASTER: u16 = 0x7E5;
}
