//! 2300h: what is left of a fault.

use super::*;

room! {
    0x2300 "fault history" {
        0, "fault history", Domain, RO, UNMAPPED, Field::History; "", 1.0, ANY;
            "The control steps before the last fault, oldest first, 36 bytes each: state, 3 reserved, faults (u32), position, velocity, torque, compensation, current d, current q, bus voltage (f32, SI); empty while no fault is latched"
    }
}
