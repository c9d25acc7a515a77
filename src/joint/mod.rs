//! One joint: measurements in, bridge and duty cycles out.

mod signals;

pub use signals::{Bridge, BridgeState, Measurements};
