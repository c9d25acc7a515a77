//! Deep Lagrangian Networks with nonsymmetric Coulomb friction and rotor inertias (002), in the paper's setting: they
//! know the joints' drive gains and no kinematics; host.
//!
//! [`network`] are values and derivatives of a network, [`dynamics`] the Euler-Lagrange equations, [`model`] both
//! with the linear layers, [`train`] the training.

pub mod dynamics;
pub mod model;
pub mod network;
pub mod train;

pub use model::{Friction, Inputs, Model, Sample, Shape};
pub use network::Activation;
pub use train::Training;

#[cfg(test)]
mod tests;
