//! Actuators that are less like the firmware's model than those of [`super::randomised`], and what a data sheet says of
//! them.
//!
//! An actuator of [`super::randomised`] comes first. Then a gear that gives way, friction with laws of its own, a gear
//! with its own temperature and magnets that weaken are added:
//!
//! | what | range |
//! |---|---|
//! | class | strain wave (4 of 10): elastic, with hysteresis; planetary (4 of 10): backlash; rigid (2 of 10) |
//! | twist under the peak torque, hardening there | 2..20 mrad, 0..100 % |
//! | damping ratio of the transmission | 0.02..0.1 |
//! | hysteresis, twist in which it turns round | 0.3..2 % of the peak torque, 1e-4..1e-3 rad |
//! | backlash | 0.3..5 mrad |
//! | exponents of Stribeck curve, viscous torque, load | 0.5..2, 0.6..1.2, 0.6..1.3 |
//! | skew of the ripple, frictional lag | 0..0.7, 1..20 ms |
//! | aging at rest | 0..30 % of the dry friction in 1..100 s, gone after 1e-3..1e-2 rad |
//! | film at rest | 0..30 % of the viscous friction in 30..1000 s, gone after 0.3..3 rad |
//! | running in | 0..20 % of the dry friction in 100..3000 rad |
//! | gear | 0.2..0.5 of the housing's heat capacity, 0.2..1.5 K/W to it |
//! | flux of the magnets | 0.05..0.2 % less per K |
//!
//! The firmware knows none of that, and of the rest what [`ActuatorParameters::as_data_sheet`] says.

use super::parameters::ActuatorParameters;
use crate::friction_shape::{FrictionShape, Rest};
use crate::noise::Noise;
use crate::parameters::JointParameters;
use crate::thermal::GearNode;
use crate::transmission::TransmissionParameters;

/// Ambient temperature that a configuration assumes, °C.
const ROOM: f64 = 25.0;

impl ActuatorParameters {
    /// The judging actuator number `seed` of all within the ranges of this module's table; always valid. The base is
    /// the [randomised](Self::randomised) one of the same number.
    #[must_use]
    pub fn judging(seed: u64) -> Self {
        let mut parameters = Self::randomised(seed);
        let mut draw = Noise::new(seed, 102);
        let joint = &mut parameters.joint;
        joint.friction.shape = Some(shape(&mut draw, joint));
        joint.thermal.gear = Some(GearNode {
            capacity: joint.thermal.housing_capacity * draw.uniform(0.2, 0.5),
            to_housing: draw.scale(0.2, 1.5),
        });
        joint.transmission = transmission(&mut draw, joint);
        parameters.windings.flux_fall = draw.uniform(0.0005, 0.002);
        parameters
    }

    /// The same actuator as a data sheet and a pair of scales know it: gear ratio, pole pairs and the encoder are what
    /// they are; resistance and inductances, which commissioning measures, are off by up to 5 %, torque constant and
    /// rotor inertia by 7 %, dead time by 20 %, mass and inertia of the link by 10 and 20 %, and what heats up by 30 %.
    /// Nothing is said of what [`Self::judging`] adds.
    #[must_use]
    pub fn as_data_sheet(mut self, seed: u64) -> Self {
        let mut draw = Noise::new(seed, 103);
        let mut off = |value: &mut f64, share: f64| *value *= draw.uniform(1.0 - share, 1.0 + share);
        let joint = &mut self.joint;
        joint.transmission = None;
        joint.friction.shape = None;
        joint.thermal.gear = None;
        joint.thermal.ambient = ROOM;
        self.windings.flux_fall = 0.0;
        off(&mut joint.motor.torque_constant, 0.07);
        off(&mut joint.motor.resistance, 0.05);
        off(&mut joint.motor.rotor_inertia, 0.07);
        off(&mut joint.load.mass, 0.1);
        off(&mut joint.load.inertia, 0.2);
        let thermal = &mut joint.thermal;
        let heats = [
            &mut thermal.winding_capacity,
            &mut thermal.housing_capacity,
            &mut thermal.winding_to_housing,
            &mut thermal.housing_to_ambient,
        ];
        heats.into_iter().for_each(|value| off(value, 0.3));
        off(&mut self.windings.inductance_d, 0.05);
        off(&mut self.windings.inductance_q, 0.05);
        off(&mut self.inverter.dead_time, 0.2);
        self
    }
}

fn shape(draw: &mut Noise, joint: &JointParameters) -> FrictionShape {
    FrictionShape {
        stribeck: draw.uniform(0.5, 2.0),
        viscous: draw.uniform(0.6, 1.2),
        viscous_speed: joint.limits.speed,
        load: draw.uniform(0.6, 1.3),
        load_torque: 0.2 * joint.motor.torque_limit(),
        ripple_skew: draw.uniform(0.0, 0.7),
        lag: draw.scale(1e-3, 2e-2),
        aging: Rest { rise: draw.uniform(0.0, 0.3), time: draw.scale(1.0, 100.0), way: draw.scale(1e-3, 1e-2) },
        film: Rest { rise: draw.uniform(0.0, 0.3), time: draw.scale(30.0, 1000.0), way: draw.scale(0.3, 3.0) },
        run_in: draw.uniform(0.0, 0.2),
        run_in_way: draw.scale(100.0, 3000.0),
    }
}

fn transmission(draw: &mut Noise, joint: &JointParameters) -> Option<TransmissionParameters> {
    let class = draw.uniform(0.0, 1.0);
    let twist = draw.scale(2e-3, 2e-2);
    let peak = joint.motor.torque_limit();
    let stiffness = peak / twist;
    let inertia = 1.0 / (1.0 / joint.load.total_inertia() + 1.0 / joint.motor.reflected_inertia());
    let damping = draw.scale(0.02, 0.1) * 2.0 * (stiffness * inertia).sqrt();
    let elastic = TransmissionParameters {
        stiffness,
        hardening: draw.uniform(0.0, 1.0) / (3.0 * twist * twist),
        damping,
        hysteresis: peak * draw.scale(0.003, 0.02),
        hysteresis_twist: draw.scale(1e-4, 1e-3),
        backlash: 0.0,
    };
    let backlash = draw.scale(3e-4, 5e-3);
    match class {
        class if class < 0.4 => Some(elastic),
        class if class < 0.8 => Some(TransmissionParameters { hardening: 0.0, hysteresis: 0.0, backlash, ..elastic }),
        _ => None,
    }
}
