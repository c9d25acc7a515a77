//! Synthetic robots, where the truth is known; and recordings and robots that do not fit each other.

mod bounded;
mod evaluated;
mod excited;
mod recovered;
mod refused;
mod synthetic;
