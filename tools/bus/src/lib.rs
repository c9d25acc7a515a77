//! CAN buses chosen by a string, a paced virtual bus, and a CANopen client; host.
//!
//! ```text
//! transport::open("udp:239.74.163.2:43113")   one trait over socketcan, slcan, UDP multicast and a bus within this process
//!   -> client::Network                        one reader, any number of subscribers: SDO, heartbeats, PDOs, a monitor
//!        -> upload, download, NMT, LSS, SYNC
//! pacing::PacedBus                            what these frames cost on a wire: bits, arbitration, load, latency
//! ```
//!
//! Frames, NMT states and abort codes are the server's own, from `canopen_node`: one meaning on both sides.
//!
//! - [`transport`]: the buses
//! - [`pacing`]: the wire as a model, in simulated time; `virtual:NAME?bitrate=1000000` runs it in real time
//! - [`client`]: CANopen from the master's side; protocols without I/O, and [`client::Network`] that runs them

#![forbid(unsafe_code)]

pub mod client;
pub mod pacing;
pub mod transport;

pub use canopen_node::Frame;
pub use transport::{BusError, Transport, free_port, open};
