//! Deep Lagrangian Networks with nonsymmetric Coulomb friction and rotor inertias (002); host.
//!
//! In the paper's setting they know the joints' drive gains and no kinematics. A model that is to know the robot's URDF
//! learns from efforts of its links before it learns from a recording ([`from_links`]).
//!
//! [`network`] are values and derivatives of a network, [`dynamics`] the Euler-Lagrange equations, [`model`] both
//! with the linear layers, [`train`] the training.

pub mod dynamics;
pub mod from_links;
pub mod model;
pub mod network;
pub mod train;

pub use model::{Friction, Inputs, Learned, Model, Sample, Shape, Structure};
pub use network::Activation;
pub use train::Training;

#[cfg(test)]
mod tests;
