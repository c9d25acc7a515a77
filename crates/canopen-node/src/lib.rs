//! A CANopen server (CiA 301, CiA 305): frames in, frames out, time passed in. It knows nothing of joints: the
//! application's objects come through [`ObjectDictionary`], its set-points and actual values through [`ProcessImage`].
//!
//! # Two contexts
//! A node is three values that share nothing mutable but atomics:
//!
//!  - [`Receiver`], in the receive interrupt, sees every frame in order. NMT commands, SYNC and RPDOs act in that call;
//!    heartbeats of others are noted. For the task it leaves only what is addressed to this node's SDO server, and LSS.
//!  - [`Server`], in a task below, answers SDO and LSS and sends heartbeats, EMCYs, the boot-up message and the TPDOs
//!    of event and timer.
//!  - [`Shared`], a static, which both borrow: the NMT state, the PDO parameters, instants. See there why no lock is
//!    needed.
//!
//! Frames that both send wait in a [`TransmitQueue`], which defines what happens on a bus that has no room.
//!
//! ```text
//!  FDCAN interrupt   frame -> Receiver::receive(frame, now, &mut image, send) -> Done | Server -> bounded queue
//!  task              queue -> Server::receive(frame, now, &mut dictionary) -> answer
//!                    Server::poll(now, &mut dictionary) -> frames, until none or the sender is full
//! ```
//!
//! So a stop is never behind anything: no queue and no mailbox lies between the controller and [`Receiver`], and when
//! it returns the next frame meets the new state. A flood of other nodes' frames costs the interrupt a few comparisons
//! each and never reaches the queue, and of a flood of SYNC one in [`SHORTEST_SYNC`] counts. The queue may be as short
//! as one SDO block ([`SdoSettings::block_size`]); what it drops the protocol sends again or ends by time-out.
//!
//! The NMT state belongs to the interrupt. The task changes it where the server itself does (boot-up, object 1029h),
//! by compare-and-exchange: a command that comes at the same moment wins. Set-points count while [`Shared::state`] is
//! OPERATIONAL. On every transition the image gets [`ProcessImage::state_changed`] and the task [`Event::State`]; a
//! transition by the task reaches the image with the next frame of any kind, so a control loop that holds set-points
//! also looks at [`Shared::state`].
//!
//! # What there is
//! NMT slave, boot-up, heartbeat producer and consumer (4 nodes), SYNC consumer, EMCY producer with history, 4 RPDOs
//! and 4 TPDOs with run-time mapping of whole bytes (types 0 to 240, 254, 255; inhibit time, event timer, RPDO
//! deadline), one SDO server (expedited, segmented, block, with CRC), 1010h/1011h, LSS with fastscan. Objects 1000h,
//! 1001h, 1003h, 1005h, 1008h to 100Ah, 1010h, 1011h, 1014h to 1020h, 1029h, 1200h, 1400h to 1403h, 1600h to 1603h,
//! 1800h to 1803h, 1A00h to 1A03h are the server's own.
//!
//! Not supported: node guarding and remotely requested PDOs (they need remote frames), SYNC producer, TIME, SDO client,
//! multiplexed PDOs.
//!
//! A TPDO of type 0, 254 or 255 is sent once when the node becomes operational, then after [`Shared::trigger`].
#![cfg_attr(not(test), no_std)]
#![deny(unsafe_code)]

mod abort;
mod access;
pub mod bit_timing;
mod communication;
mod dictionary;
pub mod emergency;
mod frame;
mod heartbeat;
mod lss;
mod nmt;
mod parameters;
mod pdo;
mod receiver;
mod sdo;
mod server;
mod shared;
mod time;
mod transmit_queue;

#[cfg(test)]
mod tests;

pub use abort::Abort;
pub use dictionary::{Access, Entry, Event, Group, Identity, Length, Mappable, ObjectDictionary};
pub use frame::Frame;
pub use nmt::{NmtState, Reset};
pub use parameters::{CONSUMERS, CommunicationParameters, MAPPED, PDOS, PdoParameters};
pub use pdo::{MappedObject, ProcessImage};
pub use receiver::{Receiver, Route, SHORTEST_SYNC};
pub use sdo::SdoSettings;
pub use server::Server;
pub use shared::{NO_NODE_ID, Shared};
pub use transmit_queue::{Buffers, PATIENCE, TransmitQueue, URGENT};

/// Presence of the SYNC counter (1019h, 1800h:6) and of date and time of the configuration (1020h) in this program: the
/// feature `counter-and-date`.
pub const COUNTER_AND_DATE: bool = cfg!(feature = "counter-and-date");

/// Identifiers of the predefined connection set, CiA 301 section 7.3.3; the node id is added to the last three.
const NMT: u16 = 0x000;
const SDO_TRANSMIT: u16 = 0x580;
const SDO_RECEIVE: u16 = 0x600;
const HEARTBEAT: u16 = 0x700;
/// CiA 305: from the LSS slave, and to it.
const LSS_SLAVE: u16 = 0x7E4;
const LSS_MASTER: u16 = 0x7E5;
