//! Heat in two nodes: the winding, and the housing with the gear in it; or in three, where the gear is a node of its
//! own.
//!
//! Copper loss enters the winding, friction loss the gear, and the housing gives off to the ambient. Stepped by
//! the backward Euler rule, so a long step is inaccurate but never unstable.

use crate::error::{ParameterError, within};
use serde::{Deserialize, Serialize};

/// A gear that does not have the housing's temperature.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct GearNode {
    /// Heat capacity, 0.1 to 1e4 J/K.
    pub capacity: f64,
    /// Thermal resistance to the housing, 0.01 to 100 K/W.
    pub to_housing: f64,
}

/// Capacities, resistances and surroundings of the nodes.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ThermalParameters {
    /// Heat capacity of the winding, 0.1 to 1e4 J/K.
    pub winding_capacity: f64,
    /// Heat capacity of housing and gear, 1 to 1e5 J/K.
    pub housing_capacity: f64,
    /// Thermal resistance from winding to housing, 0.01 to 100 K/W.
    pub winding_to_housing: f64,
    /// Thermal resistance from housing to ambient, 0.01 to 100 K/W.
    pub housing_to_ambient: f64,
    /// Ambient temperature, -40 to 85 °C.
    pub ambient: f64,
    /// Gear, if it is a node of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gear: Option<GearNode>,
}

impl ThermalParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        within("thermal.winding_capacity", self.winding_capacity, 0.1, 1e4)?;
        within("thermal.housing_capacity", self.housing_capacity, 1.0, 1e5)?;
        within("thermal.winding_to_housing", self.winding_to_housing, 0.01, 100.0)?;
        within("thermal.housing_to_ambient", self.housing_to_ambient, 0.01, 100.0)?;
        if let Some(gear) = &self.gear {
            within("thermal.gear.capacity", gear.capacity, 0.1, 1e4)?;
            within("thermal.gear.to_housing", gear.to_housing, 0.01, 100.0)?;
        }
        within("thermal.ambient", self.ambient, -40.0, 85.0)
    }
}

/// Temperatures of the nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heat {
    /// Winding, °C.
    pub winding: f64,
    /// Housing, °C.
    pub housing: f64,
    /// Gear, °C: the temperature that the friction feels. The housing's, where it is no node of its own.
    pub gear: f64,
}

impl Heat {
    /// All nodes at `temperature`, °C.
    #[must_use]
    pub fn uniform(temperature: f64) -> Self {
        Self { winding: temperature, housing: temperature, gear: temperature }
    }

    /// Lets `copper_loss` (W) into the winding and `friction_loss` (W) into the gear for `step` seconds.
    pub fn advance(&mut self, parameters: &ThermalParameters, copper_loss: f64, friction_loss: f64, step: f64) {
        let mut into_housing = friction_loss;
        if let Some(gear) = &parameters.gear {
            let (capacity, conductance) = (gear.capacity / step, 1.0 / gear.to_housing);
            let gained = capacity * self.gear + friction_loss + conductance * self.housing;
            self.gear = gained / (capacity + conductance);
            into_housing = (self.gear - self.housing) * conductance;
        }
        let between = 1.0 / parameters.winding_to_housing;
        let outside = 1.0 / parameters.housing_to_ambient;
        let winding = parameters.winding_capacity / step;
        let housing = parameters.housing_capacity / step;
        // (winding + between) Tw - between Th = right_winding, and the same for the housing: Cramer's rule.
        let right_winding = winding * self.winding + copper_loss;
        let right_housing = housing * self.housing + into_housing + outside * parameters.ambient;
        let diagonal_winding = winding + between;
        let diagonal_housing = housing + between + outside;
        let determinant = diagonal_winding * diagonal_housing - between * between;
        self.winding = (right_winding * diagonal_housing + between * right_housing) / determinant;
        self.housing = (right_housing * diagonal_winding + between * right_winding) / determinant;
        if parameters.gear.is_none() {
            self.gear = self.housing;
        }
    }
}
