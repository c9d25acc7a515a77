//! 6000h to 67FFh: what CiA 402-2 has an object for.

use super::*;
use crate::objects::field::Constant::SupportedModes;
use crate::objects::field::{
    Actual, Field::Actual as A, Field::AtOnce as S, Field::Constant, Field::Micro, Field::Milli, Field::Profile,
    Field::SetPoint as Set, ProfileParameter as P, SetPoint,
};
use crate::objects::settings::Setting;

room! {
    0x6007 "abort connection option code" {
        0, "abort connection option code", I16, RW, UNMAPPED, S(Setting::LateCommand); "", 1.0, within(1.0, 3.0);
            "A command that is late (2103h:11) is 1 a fault (8100h), 3 a quick stop; 2 is not possible. Outside OPERATIONAL the joint makes a quick stop in any case. Acts at once, stored by 1010h, as 605Ah to 605Eh do"
    }
    0x603F "error code" {
        0, "error code", U16, RO, TRANSMIT, A(Actual::ErrorCode); "", 1.0, ANY;
            "Of the first latched fault, in the order of 2021h:4; 0 where there is none"
    }
    0x6040 "controlword" {
        0, "controlword", U16, RW, RECEIVE, Set(SetPoint::Controlword); "", 1.0, ANY;
            "Commands of the state machine, and halt (bit 8): the joint brakes and holds where it came to a stop, in every mode; the open loop applies no voltage. \
             Mode 1: new set-point (bit 4, by its rising edge), at once (bit 5) or behind the one before, relative to it (bit 6). Mode 6: start (bit 4, by its rising edge; homing goes on while it is set)"
    }
    0x6041 "statusword" {
        0, "statusword", U16, RO, TRANSMIT, A(Actual::Statusword); "", 1.0, ANY;
            "State of the state machine, voltage present (bit 4), remote (bit 9), a target beyond the joint's limits, or of torque beyond 6072h, is clipped (bit 11; in impedance mode where a gain counts it); operation enabled with bit 14 is the open loop. \
             Bit 10: mode 1, 3 and 6 target reached, or the joint stands in halt. Bit 12: mode 1 set-point taken (until bit 4 of the controlword falls), or one waits; mode 3 the joint stands; mode 6 homing done; \
             other modes the target is followed (not before one has come, nor in halt). Bit 13: mode 1 and 8 following error beyond 6065h; mode 6 homing failed, or is the owner's alone"
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
            "1 profile position, 3 profile velocity, 6 homing, 8 position (CSP), 9 velocity (CSV), 10 torque (CST), 0 none (the joint holds where it is), -1 impedance, -2 open loop (2107h); in a PDO any other number changes nothing. \
             In every mode but 0, 1 and 6 set-points have to be renewed within 2103h:11, in modes 8, 9, 10 and -1 by what carries 607Ah, 60FFh, 6071h and 2011h:1 themselves. Enabled, or in another mode, the joint holds where it is until a target of the mode comes in a later PDO or by SDO"
    }
    0x6061 "modes of operation display" {
        0, "modes of operation display", I8, RO, TRANSMIT, A(Actual::Mode); "", 1.0, ANY;
            "Mode that was chosen"
    }
    0x6062 "position demand value" {
        0, "position demand value", I32, RO, TRANSMIT, A(Actual::PositionDemand); "rad", 1e-6, ANY;
            "Where the joint should be at this instant, on its way to the target; in modes without a position where it is"
    }
    0x6064 "position actual value" {
        0, "position actual value", I32, RO, TRANSMIT, A(Actual::Position); "rad", 1e-6, ANY;
            "Position of the joint"
    }
    0x6065 "following error window" {
        0, "following error window", U32, RW, UNMAPPED, Profile(P::FollowingErrorWindow); "rad", 1e-6, ANY;
            "Following error (60F4h) beyond which bit 13 of the statusword is set in modes 1 and 8; FFFFFFFFh: never. It is no fault. Lost with a reset, as 6066h to 6068h, 606Dh, 606Fh, 607Ch, 6098h to 609Ah are"
    }
    0x6066 "following error time out" {
        0, "following error time out", U16, RW, UNMAPPED, Profile(P::FollowingErrorTime); "s", 1e-3, ANY;
            "For how long it has to be beyond"
    }
    0x6067 "position window" {
        0, "position window", U32, RW, UNMAPPED, Profile(P::PositionWindow); "rad", 1e-6, ANY;
            "How near joint and 6062h have to be to the target of mode 1, or to the index in mode 6, to have reached it"
    }
    0x6068 "position window time" {
        0, "position window time", U16, RW, UNMAPPED, Profile(P::PositionTime); "s", 1e-3, ANY;
            "For how long, in mode 1"
    }
    0x606C "velocity actual value" {
        0, "velocity actual value", I32, RO, TRANSMIT, A(Actual::Velocity); "rad/s", 1e-3, ANY;
            "Velocity of the joint"
    }
    0x606D "velocity window" {
        0, "velocity window", U16, RW, UNMAPPED, Profile(P::VelocityWindow); "rad/s", 1e-3, ANY;
            "How near the velocity has to be to the target of mode 3 to have reached it"
    }
    0x606F "velocity threshold" {
        0, "velocity threshold", U16, RW, UNMAPPED, Profile(P::VelocityThreshold); "rad/s", 1e-3, ANY;
            "Speed below which the joint stands, for the statusword"
    }
    0x6071 "target torque" {
        0, "target torque", I16, RW, RECEIVE, Set(SetPoint::TargetTorque); "of 6076h", 1e-3, ANY;
            "Torque mode; added in position and velocity modes"
    }
    0x6072 "max torque" {
        0, "max torque", U16, RW, RECEIVE, Set(SetPoint::MaxTorque); "of 6076h", 1e-3, ANY;
            "Largest torque, compensation included, in every mode but the open loop; from 1000 on the joint's own limit counts, as for braking and stops it does always"
    }
    0x6074 "torque demand" {
        0, "torque demand", I16, RO, TRANSMIT, A(Actual::TorqueDemand); "of 6076h", 1e-3, ANY;
            "Torque that the command asks for within all limits, before compensation: friction's theoretical torque"
    }
    0x6075 "motor rated current" {
        0, "motor rated current", U32, RO, UNMAPPED, Milli(Setting::CurrentLimit); "A", 1e-3, ANY;
            "What the thousandths of 6078h refer to: the motor's current limit, 2101h:5"
    }
    0x6076 "motor rated torque" {
        0, "motor rated torque", U32, RO, UNMAPPED, A(Actual::RatedTorque); "Nm", 1e-3, ANY;
            "What the thousandths of 6071h, 6074h and 6077h refer to: the torque limit of the joint, 2103h:1"
    }
    0x6077 "torque actual value" {
        0, "torque actual value", I16, RO, TRANSMIT, A(Actual::Torque); "of 6076h", 1e-3, ANY;
            "Torque of the measured current at the joint, mean over the last millisecond (where a program does not adapt, of one control step); in the open loop the most that it can make"
    }
    0x6078 "current actual value" {
        0, "current actual value", I16, RO, TRANSMIT, A(Actual::Current); "of 6075h", 1e-3, ANY;
            "Current that makes torque, of one control step"
    }
    0x6079 "DC link circuit voltage" {
        0, "DC link circuit voltage", U32, RO, TRANSMIT, A(Actual::DcLink); "V", 1e-3, ANY;
            "Supply"
    }
    0x607A "target position" {
        0, "target position", I32, RW, RECEIVE, Set(SetPoint::TargetPosition); "rad", 1e-6, ANY;
            "Modes 1 and 8. In mode 1 it counts with bit 4 of the controlword. In mode 8 in a PDO it counts once it is another one than when the mode was entered or operation enabled, or with the release of halt"
    }
    0x607C "home offset" {
        0, "home offset", I32, RW, UNMAPPED, Profile(P::HomeOffset); "rad", 1e-6, ANY;
            "Position that the joint has, from homing on, where its zero was found"
    }
    0x607D "software position limit" {
        1, "min position limit", I32, RW, UNMAPPED, Micro(Setting::LowestPosition); "rad", 1e-6, within(-1_000.0, 1_000.0);
            "2103h:3 in use. Taken at once where it is written, with the motor off and below the other limit: write first the one that widens the travel. Stored by 1010h"
        2, "max position limit", I32, RW, UNMAPPED, Micro(Setting::HighestPosition); "rad", 1e-6, within(-1_000.0, 1_000.0);
            "2103h:4 in use, likewise"
    }
    0x607F "max profile velocity" {
        0, "max profile velocity", U32, RO, UNMAPPED, Milli(Setting::VelocityLimit); "rad/s", 1e-3, ANY;
            "2103h:2, where it is set"
    }
    0x6081 "profile velocity" {
        0, "profile velocity", U32, RW, RECEIVE, Set(SetPoint::ProfileVelocity); "rad/s", 1e-3, ANY;
            "Of mode 1; at most 607Fh counts. With 0 the joint stays. Kept until a reset, as 6083h and 6084h are"
    }
    0x6083 "profile acceleration" {
        0, "profile acceleration", U32, RW, RECEIVE, Set(SetPoint::ProfileAcceleration); "rad/s²", 1e-3, within(0.001, 4294967.295);
            "Of modes 1 and 3, while the speed rises; at most 2104h:6 counts. In a PDO 0 is as much"
    }
    0x6084 "profile deceleration" {
        0, "profile deceleration", U32, RW, RECEIVE, Set(SetPoint::ProfileDeceleration); "rad/s²", 1e-3, within(0.001, 4294967.295);
            "The same while it falls"
    }
    0x6085 "quick stop deceleration in use" {
        0, "quick stop deceleration in use", U32, RO, UNMAPPED, Milli(Setting::QuickStopDeceleration); "rad/s²", 1e-3, ANY;
            "2104h:7, where it is set"
    }
    0x6098 "homing method" {
        0, "homing method", I8, RW, UNMAPPED, Profile(P::HomingMethod); "", 1.0, within(0.0, 37.0);
            "35, 37: the joint is where it has the position 607Ch. 33, 34: to the next index of the rotor's encoder below or above, which then has it; an absolute encoder's is where it reads zero. 0: none is wanted, homing is done at once. With a key it is started in its owner's session alone, but for 0. \
             It sets 2102h:2, which 1010h stores; terms of a friction model that depend on the position belong to the zero that they were recorded with"
    }
    0x6099 "homing speeds" {
        1, "speed during search for switch", U32, RW, UNMAPPED, Profile(P::SwitchSpeed); "rad/s", 1e-3, within(0.001, 4294967.295);
            "No method here looks for a switch: it has no effect"
        2, "speed during search for zero", U32, RW, UNMAPPED, Profile(P::HomingSpeed); "rad/s", 1e-3, within(0.001, 4294967.295);
            "On the way to the index; at most 607Fh counts"
    }
    0x609A "homing acceleration" {
        0, "homing acceleration", U32, RW, UNMAPPED, Profile(P::HomingAcceleration); "rad/s²", 1e-3, within(0.001, 4294967.295);
            "On the way to the index; at most 2104h:6 counts"
    }
    0x60B0 "position offset" {
        0, "position offset", I32, RW, RECEIVE, Set(SetPoint::PositionOffset); "rad", 1e-6, ANY;
            "Added to 607Ah in mode 8"
    }
    0x60B1 "velocity offset" {
        0, "velocity offset", I32, RW, RECEIVE, Set(SetPoint::VelocityOffset); "rad/s", 1e-3, ANY;
            "Added to 60FFh in mode 9"
    }
    0x60B2 "torque offset" {
        0, "torque offset", I16, RW, RECEIVE, Set(SetPoint::TorqueOffset); "of 6076h", 1e-3, ANY;
            "Added in every mode but the open loop: what holds the joint, gravity above all. In torque mode the energy guard takes the sign of 6071h alone for a push"
    }
    0x60C2 "interpolation time period" {
        1, "interpolation time period value", U8, RW, UNMAPPED, Profile(P::InterpolationTime); "", 1.0, ANY;
            "Time between two set-points of modes 8 and 9, over which the joint goes from one to the next in a straight line, a period late, in steps of 1 ms; 0: each counts at once. The first one of a mode counts at once. Lost with a reset"
        2, "interpolation time index", I8, RW, UNMAPPED, Profile(P::InterpolationExponent); "", 1.0, within(-6.0, 0.0);
            "Its unit: this power of ten in seconds"
    }
    0x60F4 "following error actual value" {
        0, "following error actual value", I32, RO, TRANSMIT, A(Actual::FollowingError); "rad", 1e-6, ANY;
            "6062h less 6064h"
    }
    0x60FE "digital outputs" {
        1, "physical outputs", U32, RO, TRANSMIT, A(Actual::Outputs); "", 1.0, ANY;
            "Bits: 0 the holding brake is to be closed, 16 the brake chopper conducts. Where a board has no such output it is what one would do"
    }
    0x60FF "target velocity" {
        0, "target velocity", I32, RW, RECEIVE, Set(SetPoint::TargetVelocity); "rad/s", 1e-3, ANY;
            "Modes 3 and 9"
    }
    0x6502 "supported drive modes" {
        0, "supported drive modes", U32, RO, TRANSMIT, Constant(SupportedModes); "", 1.0, ANY;
            "Profile position (bit 0), profile velocity (bit 2), homing (bit 5), cyclic position, velocity and torque (bits 7 to 9), impedance (bit 16), open loop (bit 17)"
    }
}
