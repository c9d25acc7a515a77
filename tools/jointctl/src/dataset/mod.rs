//! A recorded data set, from its TOML description to classified and split samples; host.
//!
//! `prepare` is the whole way. The keys of the description are documented in `docs/dataset.md`.

mod condition;
pub mod condition_keys;
pub mod description;
mod error;
pub mod load;
mod prepare;
pub mod recordings;
mod signals;
mod treat;
pub mod treatment;
mod validate;

pub use description::{Description, EffortUnit, Gravity, PositionUnit, RigidDescription};
pub use error::DatasetError;
pub use prepare::{MINIMUM_SAMPLES, Note, Prepared, Recording, SIGNAL_LIMIT, prepare, prepare_as, prepare_with};
pub use validate::parse;

#[cfg(test)]
mod tests;
