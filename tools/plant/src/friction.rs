//! Bristle friction (LuGre), seen from the link.
//!
//! Source: Canudas de Wit, Olsson, Åström, Lischinsky 1995, eq. 1-3 and 6. Added here: both torque levels and the
//! viscous coefficient differ per direction; the level of the dry friction depends on temperature, on position, on
//! the torque that the gear transmits and on a joint that shares the drive ([`crate::pair`]). Where its laws depart
//! from the firmware's model: [`crate::friction_shape`].
//!
//! The bristle is stiff (sigma0 v / g reaches 1e5 per second), so it is stepped by the backward Euler rule: stable
//! for every step, and passive in every step. With z' = (z1 - z0)/h = v - lambda z1 and lambda = sigma0 |v| / g,
//!
//! ```text
//! F v h - sigma0 (z1^2 - z0^2)/2 >= h (sigma0 lambda z1^2 + sigma1 lambda z1 z' + sigma1 z'^2 + sigma2 v^2)
//! ```
//!
//! whose right side is never negative while sigma1 lambda <= 4 sigma0. A constant sigma1 breaks that at speed, so
//! the micro-damping fades: sigma1(v) = sigma1 / (1 + sigma1 lambda / (4 sigma0)).

use crate::error::{ParameterError, within};
use crate::friction_shape::{FrictionShape, Memory};
use serde::{Deserialize, Serialize};

/// Temperature at which the friction parameters hold, °C.
pub const REFERENCE_TEMPERATURE: f64 = 25.0;

/// One value for each direction of motion.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Directional {
    /// Value at velocity zero and above.
    pub forward: f64,
    /// Value at negative velocity. A magnitude: not negative itself.
    pub backward: f64,
}

impl Directional {
    /// The value for the direction of `velocity`, rad/s.
    #[must_use]
    pub fn at(self, velocity: f64) -> f64 {
        if velocity < 0.0 { self.backward } else { self.forward }
    }
}

/// One periodic variation of the dry friction over the joint's position.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Ripple {
    /// Periods per revolution of the link, 1 to 2000: gear meshes at low orders, pole pairs times gear ratio at high.
    pub periods_per_revolution: f64,
    /// Relative amplitude, 0 to 0.4 of the friction level.
    pub amplitude: f64,
    /// Phase at position zero, -pi to pi rad.
    pub phase: f64,
}

/// The friction of one joint.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct FrictionParameters {
    /// Coulomb torque F_c, 0.001 to 100 Nm.
    pub coulomb: Directional,
    /// Breakaway torque F_s, from the Coulomb torque to five times it, Nm.
    pub breakaway: Directional,
    /// Stribeck velocity v_s, 0.0005 to 2 rad/s.
    pub stribeck_velocity: f64,
    /// Viscous coefficient sigma2, 0 to 100 Nm s/rad.
    pub viscous: Directional,
    /// Bristle stiffness sigma0, 10 to 1e7 Nm/rad.
    pub bristle_stiffness: f64,
    /// Bristle damping (micro-damping) sigma1 at rest, 0 to 1e4 Nm s/rad.
    pub bristle_damping: f64,
    /// Relative fall of the viscous coefficient, 0 to 0.05 per K: w(T) = exp(-k (T - 25)).
    pub viscous_thinning: f64,
    /// Relative fall of the dry friction, 0 to 0.02 per K: c(T) = exp(-k (T - 25)).
    pub coulomb_thinning: f64,
    /// Dry friction added for each Nm that the gear transmits, 0 to 0.3 Nm/Nm (one minus the gear's efficiency).
    /// It scales the whole Stribeck curve: l = 1 + loss |torque| / F_c.
    pub gear_loss: f64,
    /// Variation over position: r(q) = 1 + sum of amplitude sin(periods q + phase). Put a zero amplitude where only
    /// one is wanted.
    pub ripple: [Ripple; 2],
    /// Laws in which it departs from the firmware's model, if it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<FrictionShape>,
}

impl FrictionParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        within("friction.coulomb.forward", self.coulomb.forward, 0.001, 100.0)?;
        within("friction.coulomb.backward", self.coulomb.backward, 0.001, 100.0)?;
        let (forward, backward) = (self.coulomb.forward, self.coulomb.backward);
        within("friction.breakaway.forward", self.breakaway.forward, forward, 5.0 * forward)?;
        within("friction.breakaway.backward", self.breakaway.backward, backward, 5.0 * backward)?;
        within("friction.stribeck_velocity", self.stribeck_velocity, 5e-4, 2.0)?;
        within("friction.viscous.forward", self.viscous.forward, 0.0, 100.0)?;
        within("friction.viscous.backward", self.viscous.backward, 0.0, 100.0)?;
        within("friction.bristle_stiffness", self.bristle_stiffness, 10.0, 1e7)?;
        within("friction.bristle_damping", self.bristle_damping, 0.0, 1e4)?;
        within("friction.viscous_thinning", self.viscous_thinning, 0.0, 0.05)?;
        within("friction.coulomb_thinning", self.coulomb_thinning, 0.0, 0.02)?;
        within("friction.gear_loss", self.gear_loss, 0.0, 0.3)?;
        for ripple in &self.ripple {
            within("friction.ripple.periods_per_revolution", ripple.periods_per_revolution, 1.0, 2000.0)?;
            within("friction.ripple.amplitude", ripple.amplitude, 0.0, 0.4)?;
            within("friction.ripple.phase", ripple.phase, -std::f64::consts::PI, std::f64::consts::PI)?;
        }
        self.shape.map_or(Ok(()), |shape| shape.validate())
    }

    /// Dry friction g at a constant `velocity` (rad/s), Nm, never negative: the Stribeck curve without its viscous
    /// part.
    #[must_use]
    pub fn dry_level(&self, velocity: f64, surroundings: &Surroundings) -> f64 {
        let coulomb = self.coulomb.at(velocity);
        let breakaway = self.breakaway.at(velocity);
        let ratio = velocity / self.stribeck_velocity;
        let weakening = self.shape.map_or_else(|| libm::exp(-ratio * ratio), |shape| shape.stribeck(ratio));
        let stribeck = coulomb + (breakaway - coulomb) * weakening;
        let temperature = libm::exp(-self.coulomb_thinning * (surroundings.temperature - REFERENCE_TEMPERATURE));
        let torque = surroundings.gear_torque.abs();
        let torque = self.shape.map_or(torque, |shape| shape.load(torque));
        let load = 1.0 + self.gear_loss * torque / coulomb;
        let mut ripple = 1.0;
        for r in &self.ripple {
            let phase = r.periods_per_revolution * surroundings.position + r.phase;
            ripple += r.amplitude * self.shape.map_or_else(|| libm::sin(phase), |shape| shape.ripple(phase));
        }
        stribeck * temperature * load * ripple * surroundings.relief
    }

    /// Viscous coefficient for the direction of `velocity` (rad/s) at `temperature` (°C), Nm s/rad.
    #[must_use]
    pub fn viscous_coefficient(&self, velocity: f64, temperature: f64) -> f64 {
        let thinning = libm::exp(-self.viscous_thinning * (temperature - REFERENCE_TEMPERATURE));
        self.viscous.at(velocity) * thinning * self.shape.map_or(1.0, |shape| shape.viscous(velocity))
    }
}

/// Other variables that the friction depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Position of the link, rad.
    pub position: f64,
    /// Torque that the gear transmits to the link, Nm; its sign is ignored.
    pub gear_torque: f64,
    /// Temperature of the gear, °C.
    pub temperature: f64,
    /// Factor of the dry friction, above 0; 1 but for a joint whose partner leads.
    pub relief: f64,
}

impl Default for Surroundings {
    /// State at position zero, unloaded, at [`REFERENCE_TEMPERATURE`], of a joint that shares its drive with none.
    fn default() -> Self {
        Self { position: 0.0, gear_torque: 0.0, temperature: REFERENCE_TEMPERATURE, relief: 1.0 }
    }
}

/// The friction's own state: how far the bristles are bent, and what friction remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bristles {
    deflection: f64,
    memory: Memory,
}

impl Bristles {
    /// Deflection z, rad; positive when bent by a forward motion.
    #[must_use]
    pub fn deflection(&self) -> f64 {
        self.deflection
    }

    /// Elastic energy held by the bristles, J.
    #[must_use]
    pub fn energy(&self, parameters: &FrictionParameters) -> f64 {
        0.5 * parameters.bristle_stiffness * self.deflection * self.deflection
    }

    /// The friction of the next `step` seconds, as a straight line over the velocity at its end. The coefficients
    /// that vary with speed are frozen at `velocity` (rad/s), that of its beginning; that does not cost passivity.
    #[must_use]
    pub fn prepare(
        &self,
        parameters: &FrictionParameters,
        velocity: f64,
        surroundings: &Surroundings,
        step: f64,
    ) -> FrictionStep {
        let stiffness = parameters.bristle_stiffness;
        let (mut level_at, mut dry, mut wet) = (velocity, 1.0, 1.0);
        if let Some(shape) = &parameters.shape {
            level_at = self.memory.velocity(shape, velocity);
            (dry, wet) = (self.memory.dry(shape), self.memory.viscous(shape));
        }
        let relaxation = stiffness * velocity.abs() / (dry * parameters.dry_level(level_at, surroundings));
        let damping = parameters.bristle_damping;
        let fading_damping = damping / (1.0 + damping * relaxation / (4.0 * stiffness));
        FrictionStep {
            stiffness,
            damping: fading_damping,
            viscous: parameters.viscous_coefficient(velocity, surroundings.temperature) * wet,
            deflection: self.deflection,
            relaxation,
            step,
        }
    }

    /// Bends the bristles through one prepared step that ended at `velocity` (rad/s); returns the friction torque,
    /// Nm, which opposes a motion of its own sign.
    pub fn advance(&mut self, parameters: &FrictionParameters, prepared: &FrictionStep, velocity: f64) -> f64 {
        self.deflection = prepared.deflection_after(velocity);
        if let Some(shape) = &parameters.shape {
            self.memory.advance(shape, velocity, prepared.step);
        }
        prepared.torque(velocity)
    }

    /// One step of `step` seconds at a prescribed `velocity` (rad/s); returns the friction torque, Nm.
    pub fn drag(
        &mut self,
        parameters: &FrictionParameters,
        velocity: f64,
        surroundings: &Surroundings,
        step: f64,
    ) -> f64 {
        let prepared = self.prepare(parameters, velocity, surroundings, step);
        self.advance(parameters, &prepared, velocity)
    }
}

/// One backward Euler step of the bristles, before the velocity at its end is known.
#[derive(Clone, Copy, Debug)]
pub struct FrictionStep {
    stiffness: f64,
    damping: f64,
    viscous: f64,
    deflection: f64,
    relaxation: f64,
    step: f64,
}

impl FrictionStep {
    /// Friction torque at the end of the step when the velocity there is `velocity` (rad/s), Nm.
    #[must_use]
    pub fn torque(&self, velocity: f64) -> f64 {
        let after = self.deflection_after(velocity);
        let rate = (after - self.deflection) / self.step;
        self.stiffness * after + self.damping * rate + self.viscous * velocity
    }

    /// Slope of [`torque`](Self::torque) over the velocity, Nm s/rad: never negative, so an implicit step of the
    /// motion has exactly one solution.
    #[must_use]
    pub fn slope(&self) -> f64 {
        (self.stiffness * self.step + self.damping) / (1.0 + self.relaxation * self.step) + self.viscous
    }

    fn deflection_after(&self, velocity: f64) -> f64 {
        (self.deflection + self.step * velocity) / (1.0 + self.relaxation * self.step)
    }
}
