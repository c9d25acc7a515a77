//! The rigid part of the effort as a sum of known regressors times unknown coefficients; host.
//!
//! effort = rigid + friction. For one joint the rigid part is inertia times acceleration and gravity as a function of
//! position; where mass and length of the load are known run by run (pendulum rigs), each coefficient splits into a
//! constant part (the joint itself) and a part in proportion to m l^2 or m l. A constant offset belongs to friction
//! (`Term::Constant`), and a motor's back-EMF k_e v cannot be told from viscous friction: it is part of that coefficient.

use crate::friction_parameter::Units;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Shape of the gravity term.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Gravity {
    /// The joint's axis is vertical, or the axis is a horizontal slide.
    #[default]
    None,
    /// sin q: position 0 hangs straight down.
    Sine,
    /// sin q and cos q: the direction of gravity is unknown.
    SineAndCosine,
}

/// Which regressors the rigid part has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RigidModel {
    /// Inertia times acceleration.
    pub inertia: bool,
    /// Gravity as a function of position.
    pub gravity: Gravity,
    /// Adds regressors in proportion to m l^2 and m l; needs the columns `mass` (kg) and `length` (m) of the samples.
    pub mass_and_length: bool,
}

/// One regressor of the rigid part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RigidRegressor {
    /// a.
    Inertia,
    /// sin q.
    GravitySine,
    /// cos q.
    GravityCosine,
    /// m l^2 a.
    LoadInertia,
    /// m l sin q.
    LoadGravitySine,
    /// m l cos q.
    LoadGravityCosine,
}

impl RigidRegressor {
    /// All regressors, in the order of their index.
    pub const ALL: [Self; 6] = [
        Self::Inertia,
        Self::GravitySine,
        Self::GravityCosine,
        Self::LoadInertia,
        Self::LoadGravitySine,
        Self::LoadGravityCosine,
    ];

    /// Symbol of its coefficient.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Inertia => "I",
            Self::GravitySine => "g_s",
            Self::GravityCosine => "g_c",
            Self::LoadInertia => "I_ml2",
            Self::LoadGravitySine => "g_s,ml",
            Self::LoadGravityCosine => "g_c,ml",
        }
    }

    /// Unit of its coefficient, from those of the data set.
    pub fn unit(self, units: &Units) -> String {
        let Units { position, effort } = units;
        match self {
            Self::Inertia => format!("{effort} s^2/{position}"),
            Self::GravitySine | Self::GravityCosine => effort.clone(),
            Self::LoadInertia => format!("{effort} s^2/(kg m^2 {position})"),
            Self::LoadGravitySine | Self::LoadGravityCosine => format!("{effort}/(kg m)"),
        }
    }
}

/// The coefficient's name in the field's words.
impl fmt::Display for RigidRegressor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Inertia => "inertia",
            Self::GravitySine => "gravity, sine of position",
            Self::GravityCosine => "gravity, cosine of position",
            Self::LoadInertia => "inertia per m l^2",
            Self::LoadGravitySine => "gravity per m l, sine of position",
            Self::LoadGravityCosine => "gravity per m l, cosine of position",
        })
    }
}

impl RigidModel {
    /// The regressors of this model.
    pub fn regressors(&self) -> Vec<RigidRegressor> {
        let (sine, cosine) = (self.gravity != Gravity::None, self.gravity == Gravity::SineAndCosine);
        RigidRegressor::ALL
            .into_iter()
            .filter(|regressor| match regressor {
                RigidRegressor::Inertia => self.inertia,
                RigidRegressor::GravitySine => sine,
                RigidRegressor::GravityCosine => cosine,
                RigidRegressor::LoadInertia => self.inertia && self.mass_and_length,
                RigidRegressor::LoadGravitySine => sine && self.mass_and_length,
                RigidRegressor::LoadGravityCosine => cosine && self.mass_and_length,
            })
            .collect()
    }
}

/// What the rigid part depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigidState {
    /// Position q, rad or m.
    pub position: f64,
    /// Acceleration a, rad/s^2 or m/s^2.
    pub acceleration: f64,
    /// Mass of the load m, kg; 0 where it is not known.
    pub mass: f64,
    /// Distance of the load from the axis l, m; 0 where it is not known.
    pub length: f64,
}

/// Coefficients of the rigid part; those that the model does not have are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RigidParameters {
    /// Coefficient of a.
    pub inertia: f64,
    /// Coefficient of sin q.
    pub gravity_sine: f64,
    /// Coefficient of cos q.
    pub gravity_cosine: f64,
    /// Coefficient of m l^2 a.
    pub load_inertia: f64,
    /// Coefficient of m l sin q.
    pub load_gravity_sine: f64,
    /// Coefficient of m l cos q.
    pub load_gravity_cosine: f64,
}

impl RigidParameters {
    /// The rigid part of the effort.
    pub fn effort(&self, state: &RigidState) -> f64 {
        let by = Self::regressor_values(state);
        RigidRegressor::ALL.into_iter().map(|regressor| self.coefficient(regressor) * by[regressor as usize]).sum()
    }

    /// The values of all regressors, in the order of `RigidRegressor::ALL`: the derivatives of the effort.
    #[inline]
    pub fn regressor_values(state: &RigidState) -> [f64; 6] {
        let (sine, cosine) = state.position.sin_cos();
        let (a, moment) = (state.acceleration, state.mass * state.length);
        [a, sine, cosine, moment * state.length * a, moment * sine, moment * cosine]
    }

    /// The coefficient of one regressor.
    pub fn coefficient(&self, regressor: RigidRegressor) -> f64 {
        let mut copy = *self;
        *copy.coefficient_mut(regressor)
    }

    /// The coefficient of one regressor, to be changed.
    pub fn coefficient_mut(&mut self, regressor: RigidRegressor) -> &mut f64 {
        match regressor {
            RigidRegressor::Inertia => &mut self.inertia,
            RigidRegressor::GravitySine => &mut self.gravity_sine,
            RigidRegressor::GravityCosine => &mut self.gravity_cosine,
            RigidRegressor::LoadInertia => &mut self.load_inertia,
            RigidRegressor::LoadGravitySine => &mut self.load_gravity_sine,
            RigidRegressor::LoadGravityCosine => &mut self.load_gravity_cosine,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pendulum_with_known_load_has_a_constant_and_a_proportional_part() {
        let model = RigidModel { inertia: true, gravity: Gravity::Sine, mass_and_length: true };
        use RigidRegressor::*;
        assert_eq!(model.regressors(), [Inertia, GravitySine, LoadInertia, LoadGravitySine]);
        assert!(RigidModel::default().regressors().is_empty());
    }

    #[test]
    fn the_effort_of_a_pendulum_is_its_equation_of_motion() {
        let pendulum =
            RigidParameters { inertia: 0.02, load_inertia: 1.0, load_gravity_sine: 9.81, ..Default::default() };
        let state = RigidState { position: 0.7, acceleration: -3.0, mass: 1.2, length: 0.15 };
        let by_hand = (0.02 + 1.2 * 0.15 * 0.15) * -3.0 + 1.2 * 9.81 * 0.15 * 0.7f64.sin();
        assert!((pendulum.effort(&state) - by_hand).abs() < 1e-14);
    }
}
