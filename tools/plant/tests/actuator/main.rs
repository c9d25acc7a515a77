//! The simulated actuator against equations and data sheets: windings, bridge, supply, sensors, heat, faults. One
//! program, as each links the plant anew.

mod bridge;
mod drive_sensors;
mod faults;
mod heat;
mod judging;
mod support;
mod whole;
mod windings;
