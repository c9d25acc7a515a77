//! The `jointctl` program.
fn main() {}
