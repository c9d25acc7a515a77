//! Placeholder until the plant lands.
