//! 6000h to 67FFh: what CiA 402-2 has an object for.

use super::*;
use crate::objects::field::Constant::SupportedModes;
use crate::objects::field::{
    Actual, Field::Actual as A, Field::AtOnce as S, Field::Constant, Field::SetPoint as Set, SetPoint,
};
use crate::objects::settings::Setting;

room! {
    0x6007 "abort connection option code" {
        0, "abort connection option code", I16, RW, UNMAPPED, S(Setting::LateCommand); "", 1.0, within(1.0, 3.0);
            "A command that is late (2103h:11) is 1 a fault (8130h), 3 a quick stop; 2 is not possible. Outside OPERATIONAL the joint makes a quick stop in any case. Acts at once, stored by 1010h, as 605Ah to 605Eh do"
    }
    0x603F "error code" {
        0, "error code", U16, RO, TRANSMIT, A(Actual::ErrorCode); "", 1.0, ANY;
            "Of the first latched fault, in the order of 2021h:4; 0 where there is none"
    }
    0x6040 "controlword" {
        0, "controlword", U16, RW, RECEIVE, Set(SetPoint::Controlword); "", 1.0, ANY;
            "Commands of the state machine, and halt (bit 8): the joint brakes and holds where it came to a stop, in every mode; the open loop applies no voltage"
    }
    0x6041 "statusword" {
        0, "statusword", U16, RO, TRANSMIT, A(Actual::Statusword); "", 1.0, ANY;
            "State of the state machine, voltage present (bit 4), remote (bit 9), the joint follows the target of its mode (bit 12: not before one has come, nor in halt); operation enabled with bit 14 is the open loop"
    }
    0x605A "quick stop option code" {
        0, "quick stop option code", I16, RW, UNMAPPED, S(Setting::QuickStop); "", 1.0, within(0.0, 6.0);
            "0: off at once; 1: along the ramp of 2104h:6, 2: of 2104h:7, then switch on disabled; 5, 6: the same, then it holds in quick stop active until the voltage is disabled or operation enabled anew, after another command. 3 and 4 are not possible"
    }
    0x605B "shutdown option code" {
        0, "shutdown option code", I16, RW, UNMAPPED, S(Setting::Shutdown); "", 1.0, within(0.0, 1.0);
            "0: off at once; 1: along the ramp of 2104h:6, then off; until then operation is enabled"
    }
    0x605C "disable operation option code" {
        0, "disable operation option code", I16, RW, UNMAPPED, S(Setting::DisableOperation); "", 1.0, within(0.0, 1.0);
            "0: off at once; 1: along the ramp of 2104h:6, then off; until then operation is enabled"
    }
    0x605D "halt option code" {
        0, "halt option code", I16, RW, UNMAPPED, S(Setting::Halt); "", 1.0, within(1.0, 2.0);
            "1: brake along the ramp of 2104h:6, 2: of 2104h:7; then hold, with operation enabled"
    }
    0x605E "fault reaction option code" {
        0, "fault reaction option code", I16, RW, UNMAPPED, S(Setting::FaultReaction); "", 1.0, within(0.0, 2.0);
            "Of a fault that permits braking. 0: off at once; 1: along the ramp of 2104h:6, 2: of 2104h:7, then fault"
    }
    0x6060 "modes of operation" {
        0, "modes of operation", I8, RW, RECEIVE, Set(SetPoint::Mode); "", 1.0, within(-2.0, 10.0);
            "8 position (CSP), 9 velocity (CSV), 10 torque (CST), 0 none (the joint holds where it is), -1 impedance, -2 open loop (2107h); in a PDO any other number changes nothing. \
             Enabled, or in another mode, the joint holds where it is until a target of the mode comes in a later PDO or by SDO"
    }
    0x6061 "modes of operation display" {
        0, "modes of operation display", I8, RO, TRANSMIT, A(Actual::Mode); "", 1.0, ANY;
            "Mode that was chosen"
    }
    0x6064 "position actual value" {
        0, "position actual value", I32, RO, TRANSMIT, A(Actual::Position); "rad", 1e-6, ANY;
            "Position of the joint"
    }
    0x606C "velocity actual value" {
        0, "velocity actual value", I32, RO, TRANSMIT, A(Actual::Velocity); "rad/s", 1e-3, ANY;
            "Velocity of the joint"
    }
    0x6071 "target torque" {
        0, "target torque", I16, RW, RECEIVE, Set(SetPoint::TargetTorque); "of 6076h", 1e-3, ANY;
            "Torque mode; added in position and velocity mode"
    }
    0x6074 "torque demand" {
        0, "torque demand", I16, RO, TRANSMIT, A(Actual::TorqueDemand); "of 6076h", 1e-3, ANY;
            "Torque that the command asks for within all limits, before compensation: friction's theoretical torque"
    }
    0x6076 "motor rated torque" {
        0, "motor rated torque", U32, RO, UNMAPPED, A(Actual::RatedTorque); "Nm", 1e-3, ANY;
            "What the thousandths of 6071h, 6074h and 6077h refer to: the torque limit of the joint, 2103h:1"
    }
    0x6077 "torque actual value" {
        0, "torque actual value", I16, RO, TRANSMIT, A(Actual::Torque); "of 6076h", 1e-3, ANY;
            "Torque of the measured current at the joint, mean over the last millisecond (where a program does not adapt, of one control step); in the open loop the most that it can make"
    }
    0x607A "target position" {
        0, "target position", I32, RW, RECEIVE, Set(SetPoint::TargetPosition); "rad", 1e-6, ANY;
            "Position mode. In a PDO it counts once it is another one than when the mode was entered or operation enabled, or with the release of halt"
    }
    0x60B2 "torque offset" {
        0, "torque offset", I16, RW, RECEIVE, Set(SetPoint::TorqueOffset); "of 6076h", 1e-3, ANY;
            "Added in every mode but the open loop: what holds the joint, gravity above all. In torque mode the energy guard takes the sign of 6071h alone for a push"
    }
    0x60FE "digital outputs" {
        1, "physical outputs", U32, RO, TRANSMIT, A(Actual::Outputs); "", 1.0, ANY;
            "Bits: 0 the holding brake is to be closed, 16 the brake chopper conducts. Where a board has no such output it is what one would do"
    }
    0x60FF "target velocity" {
        0, "target velocity", I32, RW, RECEIVE, Set(SetPoint::TargetVelocity); "rad/s", 1e-3, ANY;
            "Velocity mode"
    }
    0x6502 "supported drive modes" {
        0, "supported drive modes", U32, RO, TRANSMIT, Constant(SupportedModes); "", 1.0, ANY;
            "Position, velocity and torque (bits 7 to 9), impedance (bit 16), open loop (bit 17)"
    }
}
