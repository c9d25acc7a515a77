//! The joint over a bus, as a CANopen client sees it; host.
//!
//! ```text
//! RemoteJoint::open("udp:239.74.163.2:43113", 5)     one node, checked to be a joint
//!   .read / .write (Entry)                           any object, by the one table: names, types, units, limits
//!   Telemetry::begin(&joint, &signals)               TPDOs packed with what is wanted, decoded into SI values, a sample a SYNC
//!   Stream::begin(&joint, mode, rate)                enabled, with set-points at a rate; ends disabled whatever happens
//! ```
//!
//! - [`entry`], [`value`]: objects by name, and their values as people write and read them
//! - [`joint`]: the node; [`condition`] its state and faults, [`drive`] what changes them, [`history`] the steps
//!   before a fault
//! - [`pdo`]: what PDOs carry; [`telemetry`]: out of the joint; [`stream`]: into it; [`motion`]: `jointctl move`
//! - [`image`]: the life of a parameter image, [`refusal`] its numbers in words, [`words`] those of other objects;
//!   [`configuration`]: settings, stored and restored, [`configured`] since when
//! - [`commission`]: the objects of a joint for its commissioning
//! - [`record`]: samples as a data set; [`retrain`]: a joint's friction learned anew, from excitation to commit;
//!   [`load_check`]: the load that it shows against the configured one
//! - [`robot_motion`]: all joints of a robot at once
//! - [`address`]: node ids for new joints; [`info`]: a joint on one page

pub mod address;
pub mod commission;
pub mod condition;
pub mod configuration;
pub mod configured;
pub mod drive;
pub mod entry;
pub mod error;
pub mod history;
pub mod image;
pub mod info;
mod interpolation;
pub mod joint;
pub mod load_check;
pub mod motion;
mod owner;
mod partners;
pub mod pdo;
pub mod present;
pub mod record;
pub mod refusal;
pub mod retrain;
pub mod robot_motion;
pub mod route;
mod session;
pub mod stream;
pub mod telemetry;
pub mod value;
pub mod words;

pub use entry::Entry;
pub use error::RemoteError;
pub use joint::RemoteJoint;
pub use stream::Stream;
pub use telemetry::{Sample, Signal, Telemetry};
pub use value::Value;
