//! The joint's control step on the simulated actuator: a file a promise. One program, as each links the plant anew.

mod braking;
mod drift;
mod faults;
mod field_weakening;
mod healthy;
mod heartbeat;
mod hostile;
mod judging;
mod limits;
mod numeric_limits;
mod open_loop;
mod probes;
mod rig;
mod sensors;
mod start;
mod stops;
