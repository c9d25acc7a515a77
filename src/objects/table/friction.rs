//! 2200h and 2201h: friction compensation, and its adaptation. Its settings act at once, also while the joint moves;
//! 1010h stores them with the configuration.

use super::*;
use crate::objects::field::{Actual, Field::Actual as A, Field::AtOnce as S};
use crate::objects::settings::Setting;

room! {
    0x2200 "friction compensation" {
        1, "requested model", U8, RW, UNMAPPED, S(Setting::Request); "", 1.0, within(0.0, 3.0);
            "0 off, 1 physical, 2 physical and network, 3 physical with the network in shadow"
        2, "acting model", U8, RO, TRANSMIT, A(Actual::ActingModel); "", 1.0, ANY;
            "0 nothing, 1 physical, 2 physical and network"
        3, "gain", F32, RW, UNMAPPED, S(Setting::CompensationGain); "", 1.0, within(0.0, 1.0);
            "Share of the estimate that is added"
        4, "clamp", F32, RW, UNMAPPED, S(Setting::Clamp); "Nm", 1.0, within(0.0, 2_000.0);
            "Largest compensation torque; at most the torque limit"
        5, "slew limit", F32, RW, UNMAPPED, S(Setting::Slew); "Nm/s", 1.0, within(0.5, 32e3);
            "Largest change of the compensation torque in a second"
        6, "envelope violations", U16, RO, TRANSMIT, A(Actual::Violations); "", 1.0, ANY;
            "How often the joint left the range that its friction was learned in; stays at 65535"
        7, "shadow RMS", F32, RO, TRANSMIT, A(Actual::ShadowRms); "Nm", 1.0, ANY;
            "How far the full model, network included, would be from what acts: root of the mean square, over about a second"
        8, "reason", U8, RO, TRANSMIT, A(Actual::Reason); "", 1.0, ANY;
            "0 as requested, 1 switched off, 2 no image, 3 no network in the image; 16 + n outside, 32 + n far outside the range of signal n: 0 position, 1 velocity, 2 theoretical torque, 3 measured torque, 4 temperature, 5 acceleration"
        9, "velocity source", U8, RW, UNMAPPED, S(Setting::VelocitySource); "", 1.0, within(0.0, 1.0);
            "Which velocity friction is computed for: 0 the command's where it has one, 1 always the measured one"
        10, "standstill velocity", F32, RW, UNMAPPED, S(Setting::StandstillVelocity); "rad/s", 1.0, within(1e-4, 10.0);
            "Velocity below which compensation fades out in proportion"
        11, "friction uncertainty", F32, RW, UNMAPPED, S(Setting::Uncertainty); "", 1.0, within(0.0, 1.0);
            "By how much friction may be less than gain times the model, as a part of it: what the energy guard may take of a compensation for the measured velocity; 1: all of it"
    }
    0x2201 "adaptation" {
        1, "requested adaptation", U8, RW, UNMAPPED, S(Setting::Adaptation); "", 1.0, within(0.0, 2.0);
            "0 off, and all is forgotten, 1 learns without effect, 2 learns and acts; where a program has no room for it, 0 alone"
        2, "learning", U8, RO, TRANSMIT, A(Actual::Learning); "", 1.0, ANY;
            "0 learns; or why not: 1 off, 2 no image acts, 3 operation not enabled, 4 outside the trained range, 5 standstill, 6 not moved by its command, 7 torque or compensation at a limit, 8 something touches the joint"
        3, "friction factor", F32, RO, TRANSMIT, A(Actual::AdaptedFactor); "", 1.0, ANY;
            "What is left of the image's friction, or more; 0.25 to 2.5"
        4, "deviation of the factor", F32, RO, TRANSMIT, A(Actual::FactorDeviation); "", 1.0, ANY;
            "Its standard deviation; 0.5 before anything is learned"
        5, "added viscous friction", F32, RO, TRANSMIT, A(Actual::AdaptedViscous); "Nm s/rad", 1.0, ANY;
            "What acts beside the image's"
    }
}
