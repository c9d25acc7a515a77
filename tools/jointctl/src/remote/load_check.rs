//! The load that a motion shows against the one that is configured: a torque constant, gear ratio or load that is wrong
//! scales inertia and gravity, and friction with them; host.

use super::error::RemoteError;
use super::joint::RemoteJoint;
use identification::page::Parameter;
use identification::rigid::RigidRegressor;
use joint_firmware::joint::configuration::LoadConfiguration;
use joint_firmware::joint::load::Load;
use joint_firmware::objects::field::Field;
use joint_firmware::objects::settings::Setting;
use serde::Serialize;
use std::fmt;

/// Part of the configured value by which the measured one may differ: data sheets, and friction that is taken for
/// inertia.
pub const TOLERANCE: f64 = 0.15;
/// Standard errors of the measured one beyond that.
const DEVIATIONS: f64 = 2.0;

/// One quantity that a motion shows, beside the configured one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoadDifference {
    /// Inertia or gravity torque.
    pub quantity: &'static str,
    /// kg m² or Nm.
    pub unit: &'static str,
    /// Value as configured, payload included.
    pub configured: f64,
    /// Value as the torque shows it.
    pub measured: f64,
    /// Standard error of that.
    pub standard_error: f64,
}

impl fmt::Display for LoadDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { quantity, unit, configured, measured, standard_error } = self;
        write!(
            f,
            "{quantity} is {measured:.4} {unit} by the joint's torque (standard error {standard_error:.4}), {configured:.4} as \
             configured, payload included: torque constant, gear ratio or [load] is wrong by as much; `jointctl commission \
             --load` or `--inertia` tells which"
        )
    }
}

/// Load that is configured, with the payload; zero where the joint has no such objects.
pub fn configured(joint: &RemoteJoint) -> Result<Load, RemoteError> {
    let setting = |setting| match joint.number(Field::AtOnce(setting)) {
        Err(error) if error.is_absent() => Ok(0.0),
        other => other.map(|value| value as f32),
    };
    Ok(Load::of(&LoadConfiguration {
        inertia: setting(Setting::LoadInertia)?,
        gravity: setting(Setting::LoadGravity)?,
        payload_mass: setting(Setting::PayloadMass)?,
        payload_arm: setting(Setting::PayloadArm)?,
        ..LoadConfiguration::NONE
    }))
}

/// Differences of more than the tolerance. What is not configured, or was not identified, is no difference.
pub fn differences(configured: &Load, identified: &[Parameter]) -> Vec<LoadDifference> {
    let of = |regressor: RigidRegressor| {
        let found = identified.iter().find(|parameter| parameter.symbol == regressor.symbol());
        found.map_or((0.0, 0.0), |parameter| (parameter.value, parameter.standard_error.unwrap_or(0.0)))
    };
    let (inertia, inertia_error) = of(RigidRegressor::Inertia);
    let [(sine, sine_error), (cosine, cosine_error)] =
        [RigidRegressor::GravitySine, RigidRegressor::GravityCosine].map(of);
    let all = [
        LoadDifference {
            quantity: "inertia",
            unit: "kg m²",
            configured: configured.inertia.into(),
            measured: inertia,
            standard_error: inertia_error,
        },
        LoadDifference {
            quantity: "gravity torque",
            unit: "Nm",
            configured: configured.gravity.into(),
            measured: sine.hypot(cosine),
            standard_error: sine_error.hypot(cosine_error),
        },
    ];
    all.into_iter().filter(LoadDifference::counts).collect()
}

impl LoadDifference {
    fn counts(&self) -> bool {
        let permitted = TOLERANCE * self.configured + DEVIATIONS * self.standard_error;
        // A load that was not identified is zero. A negative inertia is the sign of torque or position.
        self.configured > 0.0 && self.measured != 0.0 && (self.measured - self.configured).abs() > permitted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identified(inertia: f64, sine: f64, cosine: f64) -> Vec<Parameter> {
        let parameter = |(regressor, value): (RigidRegressor, f64)| Parameter {
            name: String::new(),
            symbol: regressor.symbol().to_owned(),
            value,
            unit: String::new(),
            standard_error: Some(0.01),
            at_bound: false,
            truth: None,
        };
        let all = [
            (RigidRegressor::Inertia, inertia),
            (RigidRegressor::GravitySine, sine),
            (RigidRegressor::GravityCosine, cosine),
        ];
        all.map(parameter).into()
    }

    #[test]
    fn a_torque_constant_that_is_wrong_by_a_fifth_is_found_and_a_tenth_is_not() {
        let configured = Load { inertia: 1.0, gravity: 5.0, hanging: 0.0 };
        let scaled = |factor: f64| differences(&configured, &identified(factor, 3.0 * factor, -4.0 * factor));
        for factor in [0.9, 1.0, 1.1] {
            assert_eq!(scaled(factor), [], "{factor}");
        }
        assert_eq!(scaled(-1.0).len(), 1, "the inertia of a torque with the wrong sign");
        for factor in [0.8, 1.2, 4.0, 0.25] {
            let found = scaled(factor);
            assert_eq!(
                found.iter().map(|one| one.quantity).collect::<Vec<_>>(),
                ["inertia", "gravity torque"],
                "{factor}"
            );
        }
    }

    #[test]
    fn the_limit_is_the_tolerance_and_twice_the_standard_error() {
        let configured = Load { inertia: 1.0, ..Load::default() };
        let of = |inertia| differences(&configured, &identified(inertia, 0.0, 0.0)).len();
        assert_eq!([of(1.169), of(1.171), of(0.831), of(0.829)], [0, 1, 0, 1]);
    }

    #[test]
    fn what_is_not_configured_or_not_identified_is_no_difference() {
        assert_eq!(differences(&Load::default(), &identified(1.0, 2.0, 3.0)), []);
        assert_eq!(differences(&Load { inertia: 1.0, gravity: 1.0, hanging: 0.0 }, &[]), []);
    }
}
