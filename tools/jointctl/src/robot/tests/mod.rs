//! Recordings and robots that do not fit each other.

mod refused;
