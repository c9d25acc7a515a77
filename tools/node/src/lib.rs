//! The virtual joint as a CANopen node on a bus: the firmware's control step, object dictionary, CANopen server, image
//! life cycle and slots around the simulated actuator; host.
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
//! - [`VirtualArm`]: several nodes whose joints turn the links of one arm
//! - [`serve`]: a node, or an arm, on a bus, in real time
//! - [`PacedNodes`]: several nodes on one modelled wire, in simulated time
//! - [`Storage`]: what outlasts a loss of power, in memory or in files
//! - [`flash`]: a flash with the rules of the STM32G4's
//! - [`hostile`]: server and objects without the joint, and a judge of what arbitrary frames do to them
//!
//! With the feature `emulator`:
//!
//! - `EmulatedNode`: a board's own program, as it is flashed, in the place of the virtual joint
//! - `FlashFile`: the emulated board's parameters in a file
//! - `Workbench`: an emulated board's surroundings, changed by lines of text

#![forbid(unsafe_code)]

#[cfg(feature = "emulator")]
mod emulated;
pub mod flash;
pub mod hostile;
mod images;
mod paced;
mod program;
mod sample_image;
mod serve;
mod storage;
mod virtual_arm;
mod virtual_node;

#[cfg(feature = "emulator")]
pub use emulated::{Command, DriverFault, EmulatedNode, FlashFile, FlashFileError, Workbench};
pub use images::SlotImages;
pub use paced::{PacedEvent, PacedNodes, REACTION, TASK};
pub use sample_image::SampleImage;
pub use serve::{ServeError, Served, serve};
pub use storage::{Storage, StorageError};
pub use virtual_arm::VirtualArm;
pub use virtual_node::{NodeError, Options, VirtualNode};
