//! The current loop: everything between a wanted torque and three duty cycles; control step.
//!
//! Single-precision floating point in SI units. The Cortex-M4F and the host both compute it by IEEE 754 without contraction,
//! so the bits are the same as long as nothing calls a mathematics library: angles are 32-bit fractions of a turn, their sine
//! and cosine come from the integer routine of `idsp`.

pub mod phases;
