//! Parameters of one joint, and a reference joint whose numbers a reader can hold in mind.

use crate::error::{ParameterError, within};
use crate::friction::{Directional, FrictionParameters, Ripple};
use crate::load::LoadParameters;
use crate::motor::MotorParameters;
use crate::thermal::ThermalParameters;
use crate::transmission::TransmissionParameters;
use serde::{Deserialize, Serialize};

/// Range and speed in which the joint may be moved when it is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Largest distance from hanging down, 0.05 to 6.3 rad.
    pub travel: f64,
    /// Largest speed, 0.05 to 50 rad/s.
    pub speed: f64,
}

/// One virtual joint.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct JointParameters {
    /// Motor and gear ratio.
    pub motor: MotorParameters,
    /// Link and payload.
    pub load: LoadParameters,
    /// Elasticity between motor and link; without, they are one body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transmission: Option<TransmissionParameters>,
    /// Friction.
    pub friction: FrictionParameters,
    /// Heat.
    pub thermal: ThermalParameters,
    /// Limits of motion.
    pub limits: Limits,
}

impl JointParameters {
    /// A harmonic-drive joint of a mid-size arm: 90 Nm peak, 3 Nm of Coulomb friction, 4 kg on 0.4 m.
    #[must_use]
    pub fn reference() -> Self {
        Self {
            motor: MotorParameters {
                torque_constant: 0.09,
                gear_ratio: 50.0,
                rotor_inertia: 6e-5,
                current_limit: 20.0,
                resistance: 0.3,
            },
            load: LoadParameters { inertia: 0.1, mass: 4.0, length: 0.4 },
            transmission: None,
            friction: FrictionParameters {
                coulomb: Directional { forward: 3.0, backward: 2.5 },
                breakaway: Directional { forward: 4.2, backward: 3.5 },
                stribeck_velocity: 0.06,
                viscous: Directional { forward: 1.2, backward: 1.0 },
                bristle_stiffness: 4000.0,
                bristle_damping: 20.0,
                viscous_thinning: 0.015,
                coulomb_thinning: 0.002,
                gear_loss: 0.05,
                ripple: [
                    Ripple { periods_per_revolution: 4.0, amplitude: 0.08, phase: 0.7 },
                    Ripple { periods_per_revolution: 50.0, amplitude: 0.05, phase: -1.1 },
                ],
                shape: None,
            },
            thermal: ThermalParameters {
                winding_capacity: 60.0,
                housing_capacity: 500.0,
                winding_to_housing: 0.8,
                housing_to_ambient: 1.5,
                ambient: 22.0,
                gear: None,
            },
            limits: Limits { travel: 1.5, speed: 4.0 },
        }
    }

    /// The same joint with plain friction that depends on nothing but the velocity: no ripple, no gear loss, no
    /// temperature, both directions as forward. A base on which one effect at a time is added.
    #[must_use]
    pub fn with_plain_friction(mut self) -> Self {
        let friction = &mut self.friction;
        friction.coulomb.backward = friction.coulomb.forward;
        friction.breakaway.backward = friction.breakaway.forward;
        friction.viscous.backward = friction.viscous.forward;
        friction.viscous_thinning = 0.0;
        friction.coulomb_thinning = 0.0;
        friction.gear_loss = 0.0;
        for ripple in &mut friction.ripple {
            ripple.amplitude = 0.0;
        }
        self
    }

    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.motor.validate()?;
        self.load.validate()?;
        if let Some(transmission) = &self.transmission {
            transmission.validate()?;
            // A body of its own needs an inertia.
            within("load's total inertia behind a transmission", self.load.total_inertia(), 1e-6, 1000.0)?;
        }
        self.friction.validate()?;
        self.thermal.validate()?;
        within("limits.travel", self.limits.travel, 0.05, 6.3)?;
        within("limits.speed", self.limits.speed, 0.05, 50.0)
    }

    /// Inertia of everything that accelerates with the link, kg m².
    #[must_use]
    pub fn inertia(&self) -> f64 {
        self.motor.reflected_inertia() + self.load.total_inertia()
    }

    /// Acceleration that 60 % of the peak torque gives with the arm horizontal and against the largest friction,
    /// rad/s²; at least a twentieth of what the peak torque would give freely. The rest is left to the controller.
    #[must_use]
    pub fn usable_acceleration(&self) -> f64 {
        let friction = &self.friction;
        let breakaway = friction.breakaway.forward.max(friction.breakaway.backward);
        let viscous = friction.viscous.forward.max(friction.viscous.backward) * self.limits.speed;
        let spent = self.load.gravity_amplitude() + breakaway + viscous;
        let peak = self.motor.torque_limit();
        (0.6 * peak - spent).max(0.05 * peak) / self.inertia()
    }
}
