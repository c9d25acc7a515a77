//! The friction of a robot's joint, in fixed point, and its compensation: the same bits on every machine.
//!
//! - [`friction`]: a physical model (Coulomb and viscous friction for each direction, Stribeck effect, load,
//!   temperature), pre-sliding, ripple, and a network of three hidden layers of five neurons for what these leave.
//! - [`compensation`]: from friction to a torque within a clamp and a slew rate, faded out where the model was not
//!   identified.
//! - [`parameters`]: a joint's parameters as an image: its byte layout, a certificate of what it can do at most, tags,
//!   and two slots in flash that survive a loss of power at any instant.
//! - [`quantity`], [`dsp`], [`mod@sine`]: SI units in Q16.16, DSP instructions, sine and cosine in integers.
//!
//! Nothing here allocates, blocks or loops without a bound, and what is evaluated in a control step does not panic.
//! The joint firmware of this repository is built on it; see its `src/joint/friction_feedforward.rs` for the energy
//! guard that a compensation of the measured velocity needs.
#![cfg_attr(not(test), no_std)]
#![deny(unsafe_code)]

pub mod compensation;
#[allow(unsafe_code, reason = "DSP instructions have no safe form")]
pub mod dsp;
pub mod friction;
pub mod parameters;
pub mod quantity;
pub mod sine;
