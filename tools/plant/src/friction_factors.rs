//! The same friction with other numbers: how wrong a model of it may be.

use crate::error::{ParameterError, within};
use crate::friction::{Directional, FrictionParameters};
use crate::noise::Noise;
use serde::{Deserialize, Serialize};

/// A factor for every friction parameter, 0 to 10 each; the orders and phases of the ripple stay.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct FrictionFactors {
    /// Coulomb torque.
    pub coulomb: Directional,
    /// Breakaway torque.
    pub breakaway: Directional,
    /// Stribeck velocity.
    pub stribeck_velocity: f64,
    /// Viscous coefficient.
    pub viscous: Directional,
    /// Bristle stiffness.
    pub bristle_stiffness: f64,
    /// Bristle damping.
    pub bristle_damping: f64,
    /// Fall of the viscous coefficient with temperature.
    pub viscous_thinning: f64,
    /// Fall of the dry friction with temperature.
    pub coulomb_thinning: f64,
    /// Gear loss.
    pub gear_loss: f64,
    /// Amplitudes of the ripple.
    pub ripple: [f64; 2],
}

impl FrictionFactors {
    /// `factor` for every parameter.
    #[must_use]
    pub fn uniform(factor: f64) -> Self {
        Self::from_fn(|| factor)
    }

    /// `factor` for every torque; Stribeck velocity and the way in which temperature acts stay. So is a gear that is
    /// worn, or has run in.
    #[must_use]
    pub fn torques(factor: f64) -> Self {
        Self { stribeck_velocity: 1.0, viscous_thinning: 1.0, coulomb_thinning: 1.0, ..Self::uniform(factor) }
    }

    /// `factor` for the viscous friction alone. So is a gear in the cold, or with another grease.
    #[must_use]
    pub fn viscous(factor: f64) -> Self {
        Self { viscous: Directional { forward: factor, backward: factor }, ..Self::uniform(1.0) }
    }

    /// Every factor drawn on its own between 1 - `share` and 1 + `share`.
    #[must_use]
    pub fn drawn(seed: u64, share: f64) -> Self {
        let mut draw = Noise::new(seed, 500);
        Self::from_fn(|| draw.uniform(1.0 - share, 1.0 + share))
    }

    /// Every factor either 1 - `share` or 1 + `share`: the corners of the same range.
    #[must_use]
    pub fn extreme(seed: u64, share: f64) -> Self {
        let mut draw = Noise::new(seed, 501);
        Self::from_fn(|| if draw.uniform(0.0, 1.0) < 0.5 { 1.0 - share } else { 1.0 + share })
    }

    fn from_fn(mut factor: impl FnMut() -> f64) -> Self {
        Self {
            coulomb: Directional { forward: factor(), backward: factor() },
            breakaway: Directional { forward: factor(), backward: factor() },
            stribeck_velocity: factor(),
            viscous: Directional { forward: factor(), backward: factor() },
            bristle_stiffness: factor(),
            bristle_damping: factor(),
            viscous_thinning: factor(),
            coulomb_thinning: factor(),
            gear_loss: factor(),
            ripple: [factor(), factor()],
        }
    }

    /// Checks every factor against its documented range.
    ///
    /// # Errors
    /// The first factor that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for (name, factor) in [
            ("factors.coulomb.forward", self.coulomb.forward),
            ("factors.coulomb.backward", self.coulomb.backward),
            ("factors.breakaway.forward", self.breakaway.forward),
            ("factors.breakaway.backward", self.breakaway.backward),
            ("factors.stribeck_velocity", self.stribeck_velocity),
            ("factors.viscous.forward", self.viscous.forward),
            ("factors.viscous.backward", self.viscous.backward),
            ("factors.bristle_stiffness", self.bristle_stiffness),
            ("factors.bristle_damping", self.bristle_damping),
            ("factors.viscous_thinning", self.viscous_thinning),
            ("factors.coulomb_thinning", self.coulomb_thinning),
            ("factors.gear_loss", self.gear_loss),
            ("factors.ripple", self.ripple[0]),
            ("factors.ripple", self.ripple[1]),
        ] {
            within(name, factor, 0.0, 10.0)?;
        }
        Ok(())
    }
}

impl FrictionParameters {
    /// The same friction with every parameter times its factor. A breakaway torque stays within one and five times the
    /// Coulomb torque, whatever the two factors say.
    ///
    /// # Errors
    /// The first factor, or parameter times factor, that is outside its range.
    pub fn scaled(&self, factors: &FrictionFactors) -> Result<Self, ParameterError> {
        factors.validate()?;
        let product = |a: Directional, b: Directional| Directional {
            forward: a.forward * b.forward,
            backward: a.backward * b.backward,
        };
        let coulomb = product(self.coulomb, factors.coulomb);
        let breakaway = product(self.breakaway, factors.breakaway);
        let mut ripple = self.ripple;
        for (ripple, factor) in ripple.iter_mut().zip(factors.ripple) {
            ripple.amplitude *= factor;
        }
        let scaled = Self {
            coulomb,
            breakaway: Directional {
                forward: breakaway.forward.max(coulomb.forward).min(5.0 * coulomb.forward),
                backward: breakaway.backward.max(coulomb.backward).min(5.0 * coulomb.backward),
            },
            stribeck_velocity: self.stribeck_velocity * factors.stribeck_velocity,
            viscous: product(self.viscous, factors.viscous),
            bristle_stiffness: self.bristle_stiffness * factors.bristle_stiffness,
            bristle_damping: self.bristle_damping * factors.bristle_damping,
            viscous_thinning: self.viscous_thinning * factors.viscous_thinning,
            coulomb_thinning: self.coulomb_thinning * factors.coulomb_thinning,
            gear_loss: self.gear_loss * factors.gear_loss,
            ripple,
            shape: self.shape,
        };
        scaled.validate()?;
        Ok(scaled)
    }
}
