//! 2300h, 2301h: what is left of a fault, and of what stopped the program.

use super::super::field::ResetField;
use super::*;

room! {
    0x2300 "fault history" {
        0, "fault history", Domain, RO, UNMAPPED, Field::History; "", 1.0, ANY;
            "The control steps before the last fault, oldest first, 36 bytes each: state, 3 reserved, faults (u32), position, velocity, torque, compensation, current d, current q, bus voltage (f32, SI); empty while no fault is latched"
    }
    0x2301 "last reset" {
        1, "reset causes", U8, RO, UNMAPPED, Field::Reset(ResetField::Causes); "", 1.0, ANY;
            "Bits: 0 option bytes, 1 reset pin (also with every other), 2 power, 3 software, 4 watchdog, 5 window watchdog, 6 low-power mode. After a watchdog EMCY 6010h says so, with what this object's 1 and 2 say as its information"
        2, "stop", U8, RO, UNMAPPED, Field::Reset(ResetField::Stop); "", 1.0, ANY;
            "What stopped the program before: 0 nothing, 1 panic, 2 hard fault, 3 non-maskable interrupt, 4 interrupt without a handler. EMCY 6100h says so"
        3, "stop address", U32, RO, UNMAPPED, Field::Reset(ResetField::Address); "", 1.0, ANY;
            "Address of the instruction that it stopped at, 0 where that is not known"
        4, "stop detail", U32, RO, UNMAPPED, Field::Reset(ResetField::Detail); "", 1.0, ANY;
            "Line of a panic, CFSR of a hard fault, flash ECC register of a non-maskable interrupt, number of an interrupt"
        5, "stops in a row", U32, RO, UNMAPPED, Field::Reset(ResetField::Repeats); "", 1.0, ANY;
            "The last included; 0 where nothing stopped the program, or once it has run for 10 s since"
        6, "stop place", Text, RO, UNMAPPED, Field::Reset(ResetField::Place); "", 1.0, ANY;
            "End of the name of a panic's source file"
    }
}
