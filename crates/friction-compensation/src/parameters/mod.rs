//! Transport of a trained model: the byte layout of an image, the proof that it is safe to use, and its storage.

pub mod authentication;
pub mod certificate;
pub mod ecc;
pub mod fault_log;
pub mod guard;
pub mod image;
pub mod life_cycle;
pub mod slots;
mod summary;

pub use summary::Summary;
