//! 2010h to 203Fh: set-points and actual values that the profile has no object for.

use super::*;
use crate::objects::field::{
    Actual, Field::Actual as A, Field::Range as Span, Field::SetPoint as Set, Range, SetPoint,
};

room! {
    0x2010 "set-point counter" {
        1, "counter", U8, RW, RECEIVE, Set(SetPoint::Counter); "", 1.0, ANY;
            "Optional, in no PDO at first. Where a PDO carries it beside set-points, they do not renew the command deadline with the counter of the one before"
    }
    0x2011 "impedance command" {
        1, "impedance frame", U64, RW, RECEIVE, Set(SetPoint::ImpedanceFrame); "", 1.0, ANY;
            "Position 16 bits, velocity, stiffness, damping and torque 12 bits each, most significant first on the bus; ranges in 2012h"
    }
    0x2012 "impedance ranges" {
        1, "position range", F32, RW, UNMAPPED, Span(Range::Position); "rad", 1.0, within(0.0, 1_000.0);
            "The frame's position reaches from minus this to plus this"
        2, "velocity range", F32, RW, UNMAPPED, Span(Range::Velocity); "rad/s", 1.0, within(0.0, 200.0);
            "The frame's velocity reaches from minus this to plus this"
        3, "stiffness range", F32, RW, UNMAPPED, Span(Range::Stiffness); "Nm/rad", 1.0, within(0.0, 1e5);
            "The frame's stiffness reaches from 0 to this"
        4, "damping range", F32, RW, UNMAPPED, Span(Range::Damping); "Nm s/rad", 1.0, within(0.0, 1e4);
            "The frame's damping reaches from 0 to this"
        5, "torque range", F32, RW, UNMAPPED, Span(Range::Torque); "Nm", 1.0, within(0.0, 2_000.0);
            "The frame's torque reaches from minus this to plus this"
    }
    0x2020 "friction compensation, actual" {
        1, "compensation torque", I16, RO, TRANSMIT, A(Actual::CompensationTorque); "Nm", 1e-3, ANY;
            "Torque that compensation adds to the command"
        2, "residual torque", I16, RO, TRANSMIT, A(Actual::Residual); "Nm", 1e-3, ANY;
            "Measured torque less the command's feed-forward torque and the compensation: what neither explains"
        3, "permitted part", U16, RO, TRANSMIT, A(Actual::Permitted); "", 1e-3, ANY;
            "Part of the compensation that standstill and energy guard let through"
    }
    0x2021 "measurements" {
        1, "bus voltage", U16, RO, TRANSMIT, A(Actual::BusVoltage); "V", 1e-2, ANY;
            "Supply"
        2, "winding temperature", I16, RO, TRANSMIT, A(Actual::WindingTemperature); "°C", 0.1, ANY;
            "Of the thermal model, with the sensor where there is one; -3276.8 where it is not known"
        3, "bridge temperature", I16, RO, TRANSMIT, A(Actual::BridgeTemperature); "°C", 0.1, ANY;
            "Of the bridge's sensor; -3276.8 where there is none"
        4, "latched faults", U16, RO, TRANSMIT, A(Actual::LatchedFaults); "", 1.0, ANY;
            "Faults since the last acknowledgement: bit n - 1 for fault n of docs/faults.md, in its order"
        5, "gear temperature", I16, RO, TRANSMIT, A(Actual::GearTemperature); "°C", 0.1, ANY;
            "Temperature that friction is computed for"
    }
    0x2022 "friction by part" {
        1, "physical torque", I16, RO, TRANSMIT, A(Actual::PhysicalTorque); "Nm", 1e-3, ANY;
            "Torque of the physical model, pre-sliding included, before gain and clamp; beyond the range that friction was learned in it fades"
        2, "network torque", I16, RO, TRANSMIT, A(Actual::NetworkTorque); "Nm", 1e-3, ANY;
            "Torque of the network, likewise; in shadow, too"
        3, "pre-sliding torque", I16, RO, TRANSMIT, A(Actual::PreSlidingTorque); "Nm", 1e-3, ANY;
            "Pre-sliding within the physical model, before what temperature and load make of it"
        4, "adaptation torque", I16, RO, TRANSMIT, A(Actual::AdaptationTorque); "Nm", 1e-3, ANY;
            "Part of the compensation torque that adaptation adds to the image's"
    }
    0x2030 "coupled joint" {
        1, "coupled velocity", I32, RW, RECEIVE, Set(SetPoint::CoupledVelocity); "rad/s", 1e-3, ANY;
            "Velocity of the joint that shares this joint's drive: map another joint's TPDO here. Silent for longer than the command deadline it counts as standing"
    }
}
