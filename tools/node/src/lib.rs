//! The virtual joint as a CANopen node on a bus: the firmware's control step, object dictionary, CANopen server, image life cycle and slots around
//! the simulated actuator; host.
//!
//! ```text
//! frame -> Receiver -> JointImage -> Demand -> VirtualJoint::step        as the board's two interrupts
//!            |                                      |
//!            +-> Server -> Objects <- Observed <----+                   as the board's task
//!                            |
//!                            +-> slots in a simulated flash, images swapped between two control steps
//! ```
//!
//! - [`VirtualNode`]: the whole node; frames and time passed in, so that tests run it faster than real time
//! - [`serve`]: the node on a bus, in real time
//! - [`flash`]: a flash with the rules of the STM32G4's

#![forbid(unsafe_code)]

pub mod flash;
mod images;
mod program;
mod serve;
mod virtual_node;

pub use images::SlotImages;
pub use serve::{ServeError, serve};
pub use virtual_node::{NodeError, Options, VirtualNode};
