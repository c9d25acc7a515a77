//! 2202h and 2203h: the load, its feedforward, and the external torque. The settings act at once, also while the joint
//! moves; 1010h stores them with the configuration.

use super::*;
use crate::objects::field::{Actual, Field::Actual as A, Field::AtOnce as S};
use crate::objects::settings::Setting;

room! {
    0x2202 "load" {
        1, "load feedforward", U8, RW, UNMAPPED, S(Setting::LoadFeedforward); "", 1.0, within(0.0, 3.0);
            "Torques of the load that the joint adds in modes with a reference velocity: 0 none, 1 acceleration, 2 gravity, 3 both"
        2, "load inertia", F32, RW, UNMAPPED, S(Setting::LoadInertia); "kg m²", 1.0, within(0.0, 1_000.0);
            "Inertia about the joint without payload, rotor times the gear ratio squared included"
        3, "gravity torque", F32, RW, UNMAPPED, S(Setting::LoadGravity); "Nm", 1.0, within(0.0, 2_000.0);
            "Largest gravity torque without payload, with the lever level"
        4, "hanging position", F32, RW, UNMAPPED, S(Setting::HangingPosition); "rad", 1.0, within(-1_000.0, 1_000.0);
            "Position in which the lever, and with it the payload, hangs straight down"
        5, "payload mass", F32, RW, UNMAPPED, S(Setting::PayloadMass); "kg", 1.0, within(0.0, 1_000.0);
            "Payload: adds its mass times the arm squared to the inertia, and times g and the arm to the gravity torque"
        6, "payload arm", F32, RW, UNMAPPED, S(Setting::PayloadArm); "m", 1.0, within(0.0, 10.0);
            "Distance of the payload's centre of mass from the axis"
    }
    0x2203 "external torque" {
        1, "collision threshold", F32, RW, UNMAPPED, S(Setting::CollisionThreshold); "Nm", 1.0, within(0.0, 2_000.0);
            "A collision is an external torque beyond its uncertainty and this"
        2, "collision reaction", U8, RW, UNMAPPED, S(Setting::CollisionReaction); "", 1.0, within(0.0, 4.0);
            "0 none, 1 EMCY FF04h, 2 that and a quick stop (605Ah), 3 that and halt (605Dh), 4 that, and the joint gives way; 2 to 4 until it is acknowledged"
        3, "load uncertainty", F32, RW, UNMAPPED, S(Setting::LoadUncertainty); "", 1.0, within(0.0, 0.9);
            "Part of true inertia and gravity by which object 2202h may be wrong"
        4, "external torque", I16, RO, TRANSMIT, A(Actual::ExternalTorque); "of 6076h", 1e-3, ANY;
            "Torque that acts on the link from outside, positive forward, through a lag of 10 ms; 0 while operation is not enabled"
        5, "external torque uncertainty", U16, RO, TRANSMIT, A(Actual::ExternalUncertainty); "of 6076h", 1e-3, ANY;
            "Bound of its error; 1000 where nothing knows the friction, or no load inertia is configured"
        6, "collisions", U16, RO, TRANSMIT, A(Actual::Collisions); "", 1.0, ANY;
            "Since the start; wraps"
    }
}
