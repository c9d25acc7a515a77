//! 2202h: the load, and its feedforward. The settings act at once, also while the joint moves; 1010h stores them with
//! the configuration.

use super::*;
use crate::objects::field::Field::AtOnce as S;
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
}
