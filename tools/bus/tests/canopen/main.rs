//! The client against the project's own server: SDO in simulated time with lost and late frames, everything else over
//! buses in real time.

mod disturbed;
mod network;
mod node;
mod paced;
mod sdo;
mod slcan;
