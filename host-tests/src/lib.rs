//! What several scenarios share: friction parameters and joint states drawn from a seed, the friction model once more in
//! arithmetic too wide to overflow, and images as bytes.

pub mod driving;
pub mod image_bytes;
pub mod informed;
pub mod parameters;
pub mod states;
pub mod wide;
