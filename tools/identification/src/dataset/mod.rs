//! A recorded data set, from its TOML description to classified and split samples; host.
//!
//! `prepare` is the whole way. The keys of the description are documented in `docs/dataset.md`.

pub mod checks;
pub mod choice_keys;
mod condition;
pub mod condition_keys;
pub mod description;
mod error;
pub mod lag;
pub mod load;
mod logs;
mod observed;
mod prepare;
pub mod recordings;
mod signals;
pub mod simple_model;
mod treat;
pub mod treatment;
mod validate;
mod warning;

pub use description::{Description, EffortUnit, Gravity, PositionUnit, RigidDescription};
pub use error::DatasetError;
pub use lag::Lag;
pub use prepare::{
    MINIMUM_SAMPLES, Note, Prepared, Recording, SIGNAL_LIMIT, prepare, prepare_as, prepare_text, prepare_with,
};
pub use validate::parse;
pub use warning::Warning;

#[cfg(test)]
mod tests;
