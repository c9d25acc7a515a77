//! What several scenarios share: friction parameters and joint states drawn from a seed, and the friction model once more in
//! arithmetic too wide to overflow.

pub mod parameters;
pub mod states;
pub mod wide;
