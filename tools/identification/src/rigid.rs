//! The rigid part of the effort as a sum of known regressors times unknown coefficients; host.
//!
//! effort = rigid + friction. For one joint the rigid part is inertia times acceleration and gravity as a function of
//! position; where mass and length of the load are known run by run (pendulum rigs), each coefficient splits into a
//! constant part (the joint itself) and a part in proportion to m l^2 or m l. A constant offset belongs to friction
//! (`Term::Constant`), and a motor's back-EMF k_e v cannot be told from viscous friction: it is part of that
//! coefficient.
//!
//! A joint behind an elastic gear, on an arm that gives way, is no rigid body: its effort answers to accelerations
//! before and after, too. Where those pay on motions that were left out (`identify::lags`) they are regressors as well,
//! each less the acceleration of now, so that the inertia stays that of slow motion. A linear filter of the
//! acceleration is what small elastic deflections amount to (Spong 1987, Modeling and control of elastic joint robots);
//! left out, friction terms would learn it.

use crate::friction_parameter::Units;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Times before (positive) and after (negative) a sample whose accelerations may count, s; in pairs, the nearest first.
pub const LAGS: [f64; 8] = [0.025, -0.025, 0.05, -0.05, 0.1, -0.1, 0.2, -0.2];

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

/// Part that a rigid effort has which is computed elsewhere (a robot's), in the column `rigid` of the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Given {
    /// There is no such column.
    #[default]
    None,
    /// It counts as it is.
    AsItIs,
    /// It counts times a factor that is identified.
    Scaled,
}

/// Regressors of the rigid part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RigidModel {
    /// Inertia times acceleration.
    pub inertia: bool,
    /// Gravity as a function of position.
    pub gravity: Gravity,
    /// Adds regressors in proportion to m l^2 and m l; needs the columns `mass` (kg) and `length` (m) of the samples.
    pub mass_and_length: bool,
    /// Number of [`LAGS`] that have a regressor; not where nothing accounts for inertia.
    pub lags: usize,
    /// Rigid part that is computed elsewhere.
    pub given: Given,
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
    /// a at one of [`LAGS`], by its number, less a of now.
    LaggedAcceleration(usize),
    /// The rigid part that is computed elsewhere.
    Given,
}

impl RigidRegressor {
    /// All regressors, in the order of their index.
    pub const ALL: [Self; 7 + LAGS.len()] = [
        Self::Inertia,
        Self::GravitySine,
        Self::GravityCosine,
        Self::LoadInertia,
        Self::LoadGravitySine,
        Self::LoadGravityCosine,
        Self::LaggedAcceleration(0),
        Self::LaggedAcceleration(1),
        Self::LaggedAcceleration(2),
        Self::LaggedAcceleration(3),
        Self::LaggedAcceleration(4),
        Self::LaggedAcceleration(5),
        Self::LaggedAcceleration(6),
        Self::LaggedAcceleration(7),
        Self::Given,
    ];

    /// Position in [`ALL`](Self::ALL).
    #[inline]
    pub const fn index(self) -> usize {
        match self {
            Self::Inertia => 0,
            Self::GravitySine => 1,
            Self::GravityCosine => 2,
            Self::LoadInertia => 3,
            Self::LoadGravitySine => 4,
            Self::LoadGravityCosine => 5,
            Self::LaggedAcceleration(lag) => 6 + lag,
            Self::Given => 6 + LAGS.len(),
        }
    }

    /// True for those that gravity has.
    pub const fn is_gravity(self) -> bool {
        !matches!(self, Self::Inertia | Self::LoadInertia | Self::LaggedAcceleration(_) | Self::Given)
    }

    /// Symbol of its coefficient.
    pub fn symbol(self) -> String {
        let text = match self {
            Self::Inertia => "I",
            Self::GravitySine => "g_s",
            Self::GravityCosine => "g_c",
            Self::LoadInertia => "I_ml2",
            Self::LoadGravitySine => "g_s,ml",
            Self::LoadGravityCosine => "g_c,ml",
            Self::LaggedAcceleration(lag) => return format!("I_{:+.0}", -1e3 * LAGS[lag]),
            Self::Given => "g",
        };
        text.to_owned()
    }

    /// Unit of its coefficient, from those of the data set.
    pub fn unit(self, units: &Units) -> String {
        let Units { position, effort } = units;
        match self {
            Self::Inertia | Self::LaggedAcceleration(_) => format!("{effort} s^2/{position}"),
            Self::GravitySine | Self::GravityCosine => effort.clone(),
            Self::LoadInertia => format!("{effort} s^2/(kg m^2 {position})"),
            Self::LoadGravitySine | Self::LoadGravityCosine => format!("{effort}/(kg m)"),
            Self::Given => "-".to_owned(),
        }
    }
}

/// The coefficient's name in the field's words.
impl fmt::Display for RigidRegressor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::LaggedAcceleration(lag) => {
                let (time, side) = (1e3 * LAGS[*lag].abs(), if LAGS[*lag] > 0.0 { "before" } else { "after" });
                return write!(f, "acceleration {time:.0} ms {side}");
            }
            Self::Inertia => "inertia",
            Self::Given => "factor of the given rigid part",
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
                RigidRegressor::LaggedAcceleration(lag) => self.has_inertia() && *lag < self.lags,
                RigidRegressor::Given => self.given == Given::Scaled,
            })
            .collect()
    }

    /// True where the effort of an inertia is part of the rigid effort, identified or given.
    pub fn has_inertia(&self) -> bool {
        self.inertia || self.given != Given::None
    }

    /// Coefficients before anything is identified: what counts as it is.
    pub fn fixed(&self) -> RigidParameters {
        RigidParameters { given: if self.given == Given::AsItIs { 1.0 } else { 0.0 }, ..RigidParameters::default() }
    }
}

/// Variables that the rigid part depends on.
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
    /// Acceleration at each of [`LAGS`] less that of now, rad/s^2 or m/s^2; 0 where it is not known.
    pub lagged: [f64; LAGS.len()],
    /// Rigid part that is computed elsewhere, in the unit of the effort; 0 where there is none.
    pub given: f64,
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
    /// Coefficients of the acceleration at each of [`LAGS`] less that of now.
    #[serde(default)]
    pub lagged: [f64; LAGS.len()],
    /// Factor of the rigid part that is computed elsewhere.
    #[serde(default)]
    pub given: f64,
}

impl RigidParameters {
    /// The rigid part of the effort.
    pub fn effort(&self, state: &RigidState) -> f64 {
        let by = Self::regressor_values(state);
        RigidRegressor::ALL.into_iter().map(|regressor| self.coefficient(regressor) * by[regressor.index()]).sum()
    }

    /// The values of all regressors, in the order of `RigidRegressor::ALL`: the derivatives of the effort.
    #[inline]
    pub fn regressor_values(state: &RigidState) -> [f64; RigidRegressor::ALL.len()] {
        let (sine, cosine) = state.position.sin_cos();
        let (a, moment) = (state.acceleration, state.mass * state.length);
        let mut values = [0.0; RigidRegressor::ALL.len()];
        let (rigid, lagged) = values.split_at_mut(6);
        rigid.copy_from_slice(&[a, sine, cosine, moment * state.length * a, moment * sine, moment * cosine]);
        lagged[..LAGS.len()].copy_from_slice(&state.lagged);
        lagged[LAGS.len()] = state.given;
        values
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
            RigidRegressor::LaggedAcceleration(lag) => &mut self.lagged[lag],
            RigidRegressor::Given => &mut self.given,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pendulum_with_known_load_has_a_constant_and_a_proportional_part() {
        let model =
            RigidModel { inertia: true, gravity: Gravity::Sine, mass_and_length: true, ..RigidModel::default() };
        use RigidRegressor::*;
        assert_eq!(model.regressors(), [Inertia, GravitySine, LoadInertia, LoadGravitySine]);
        assert!(RigidModel::default().regressors().is_empty());
        let elastic = RigidModel { lags: 2, ..model };
        assert_eq!(elastic.regressors()[4..], [LaggedAcceleration(0), LaggedAcceleration(1)]);
        assert!(RigidModel { inertia: false, ..elastic }.regressors().iter().all(|r| r.is_gravity()));
    }

    #[test]
    fn the_effort_of_a_pendulum_is_its_equation_of_motion() {
        let pendulum =
            RigidParameters { inertia: 0.02, load_inertia: 1.0, load_gravity_sine: 9.81, ..Default::default() };
        let state = RigidState { position: 0.7, acceleration: -3.0, mass: 1.2, length: 0.15, ..RigidState::default() };
        let by_hand = (0.02 + 1.2 * 0.15 * 0.15) * -3.0 + 1.2 * 9.81 * 0.15 * 0.7f64.sin();
        assert!((pendulum.effort(&state) - by_hand).abs() < 1e-14);
    }

    #[test]
    fn regressors_stand_at_their_index_and_are_the_derivatives_of_the_effort() {
        let state = RigidState {
            position: 0.4,
            acceleration: 2.0,
            mass: 1.5,
            length: 0.3,
            lagged: [0.1; LAGS.len()],
            given: 0.7,
        };
        for (place, regressor) in RigidRegressor::ALL.into_iter().enumerate() {
            assert_eq!(regressor.index(), place);
            let mut one = RigidParameters::default();
            *one.coefficient_mut(regressor) = 1.0;
            assert_eq!(one.effort(&state), RigidParameters::regressor_values(&state)[place], "{regressor}");
        }
    }
}
