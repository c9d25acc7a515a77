//! Methods of the papers that this project stands on, as the papers describe them, so that they can be put beside ours
//! on the same motions; host. Nothing that a joint or a user runs depends on it.

#![forbid(unsafe_code)]

pub mod hysteresis;
pub mod lagrangian;
pub mod model_detail;
pub mod motions;
pub mod network_protocols;
pub mod residual_network;
pub mod simulated_leg;
