//! Joints drawn at random: from a small quasi-direct drive to a large harmonic-drive joint.
//!
//! Sizes are drawn first (motor torque, gear ratio); friction, load and heat follow as shares of the joint's peak
//! torque, so that every draw is a joint that somebody could have built and that its motor can move.
//!
//! | what | range |
//! |---|---|
//! | motor peak torque, gear ratio | 0.4..3 Nm, 6..120 |
//! | rotor inertia | 2e-5..2e-4 kg m² per Nm of motor peak torque |
//! | current limit, copper loss there | 8..60 A, 50..400 W |
//! | gravity torque of the payload, arm | 5..35 % of the peak torque, 0.15..0.6 m |
//! | Coulomb friction, asymmetry | 1..6 % of the peak torque, the directions 0..30 % apart |
//! | breakaway over Coulomb, Stribeck velocity | 1.1..1.9, 0.01..0.2 rad/s |
//! | viscous torque at the speed limit | 0.3..1.5 of the Coulomb torque |
//! | bristle deflection at breakaway, damping ratio | 1e-4..2e-3 rad, 0.2..0.8 |
//! | viscous and Coulomb fall | 0.005..0.03 per K, 0.0005..0.004 per K |
//! | gear loss | 0.01..0.1 Nm/Nm |
//! | ripple | 1..8 and 10..80 periods per revolution, 2..15 % and 1..8 % of the friction |
//! | winding and housing time constants | 20..120 s, 300..1500 s |
//! | ambient temperature | 15..35 °C |
//! | travel, speed limit | 0.8..2.5 rad, 2..8 rad/s |

use crate::friction::{Directional, FrictionParameters, Ripple};
use crate::load::{GRAVITY, LoadParameters};
use crate::motor::MotorParameters;
use crate::noise::Noise;
use crate::parameters::{JointParameters, Limits};
use crate::thermal::ThermalParameters;
use std::f64::consts::PI;

impl JointParameters {
    /// The joint number `seed` of all joints within the ranges of this module's table; always valid.
    #[must_use]
    pub fn randomised(seed: u64) -> Self {
        // A stream of its own, so that the joint and the noise of one seed are not related.
        let mut draw = Noise::new(seed, 100);
        let motor = motor(&mut draw);
        let load = load(&mut draw, motor.torque_limit());
        let limits = Limits { travel: draw.uniform(0.8, 2.5), speed: draw.scale(2.0, 8.0) };
        let inertia = motor.reflected_inertia() + load.total_inertia();
        let friction = friction(&mut draw, motor.torque_limit(), inertia, limits.speed);
        let thermal = thermal(&mut draw);
        Self { motor, load, transmission: None, friction, thermal, limits }
    }
}

fn motor(draw: &mut Noise) -> MotorParameters {
    let peak_torque = draw.scale(0.4, 3.0);
    let current_limit = draw.scale(8.0, 60.0);
    MotorParameters {
        torque_constant: peak_torque / current_limit,
        gear_ratio: draw.scale(6.0, 120.0),
        rotor_inertia: peak_torque * draw.scale(2e-5, 2e-4),
        current_limit,
        resistance: draw.scale(50.0, 400.0) / (current_limit * current_limit),
    }
}

fn load(draw: &mut Noise, peak_torque: f64) -> LoadParameters {
    let length = draw.uniform(0.15, 0.6);
    let mass = peak_torque * draw.uniform(0.05, 0.35) / (GRAVITY * length);
    LoadParameters { inertia: mass * length * length * draw.uniform(0.05, 0.3), mass, length }
}

fn friction(draw: &mut Noise, peak_torque: f64, inertia: f64, speed: f64) -> FrictionParameters {
    let forward = peak_torque * draw.scale(0.01, 0.06);
    let coulomb = Directional { forward, backward: forward * draw.uniform(0.7, 1.0) };
    // Either direction may be the heavier one.
    let coulomb = if draw.uniform(0.0, 1.0) < 0.5 {
        coulomb
    } else {
        Directional { forward: coulomb.backward, backward: coulomb.forward }
    };
    let breakaway = Directional {
        forward: coulomb.forward * draw.uniform(1.1, 1.9),
        backward: coulomb.backward * draw.uniform(1.1, 1.9),
    };
    let viscous = forward * draw.uniform(0.3, 1.3) / speed;
    let bristle_stiffness = breakaway.forward / draw.scale(1e-4, 2e-3);
    FrictionParameters {
        coulomb,
        breakaway,
        stribeck_velocity: draw.scale(0.01, 0.2),
        viscous: Directional { forward: viscous, backward: viscous * draw.uniform(0.85, 1.15) },
        bristle_stiffness,
        bristle_damping: draw.uniform(0.2, 0.8) * 2.0 * (bristle_stiffness * inertia).sqrt(),
        viscous_thinning: draw.uniform(0.005, 0.03),
        coulomb_thinning: draw.uniform(0.0005, 0.004),
        gear_loss: draw.scale(0.01, 0.1),
        ripple: [
            Ripple {
                periods_per_revolution: draw.uniform(1.0, 9.0).floor(),
                amplitude: draw.uniform(0.02, 0.15),
                phase: draw.uniform(-PI, PI),
            },
            Ripple {
                periods_per_revolution: draw.uniform(10.0, 81.0).floor(),
                amplitude: draw.uniform(0.01, 0.08),
                phase: draw.uniform(-PI, PI),
            },
        ],
        shape: None,
    }
}

fn thermal(draw: &mut Noise) -> ThermalParameters {
    let winding_to_housing = draw.scale(0.4, 2.0);
    let housing_to_ambient = draw.scale(0.5, 3.0);
    ThermalParameters {
        winding_capacity: draw.scale(20.0, 120.0) / winding_to_housing,
        housing_capacity: draw.scale(300.0, 1500.0) / housing_to_ambient,
        winding_to_housing,
        housing_to_ambient,
        ambient: draw.uniform(15.0, 35.0),
        gear: None,
    }
}
