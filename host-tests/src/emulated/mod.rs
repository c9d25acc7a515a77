//! The boards' programs on emulated boards: on a bench supply, driven by a CANopen master in emulated time, watched
//! control step by control step.

pub mod bench;
pub mod commissioned;
mod each_board;
pub mod kept;
pub mod master;
pub mod motion;
pub mod observed;
pub mod power;
pub mod stack;
pub mod taken;
pub mod twin;

pub use bench::Bench;
pub use twin::Twin;
