//! The identifiable numbers of the physical friction model, one by one: name, symbol and unit of each; host.
//!
//! The model itself (`friction_model`) has fields; identification, reports and bounds need to speak of "the third
//! harmonic of the positive direction" as a value. The names and symbols are those of the design's friction formula.

use friction_compensation::friction::maxwell_slip::ELEMENTS;
use friction_compensation::friction::ripple::RIPPLES;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Number of odd position harmonics in each direction (003 eq. 5).
pub const HARMONICS: usize = 5;

/// One identifiable number of the friction model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrictionParameter {
    /// Constant offset.
    Offset,
    /// Slope of the friction over position.
    PositionSlope,
    /// Slope of the friction over temperature.
    TemperatureSlope,
    /// Slope of the friction over the theoretical torque.
    LoadSlope,
    /// Viscous coefficient. A motor's back-EMF is proportional to velocity too and is contained in it.
    Viscous,
    /// Relative change of the viscous coefficient with temperature.
    ViscousTemperature,
    /// Coefficient of v |v|.
    Quadratic,
    /// Coulomb friction at positive velocity.
    CoulombPositive,
    /// Coulomb friction at negative velocity.
    CoulombNegative,
    /// Relative change of the Coulomb friction with temperature.
    CoulombTemperature,
    /// Relative change of the Coulomb friction with the magnitude of the theoretical torque.
    CoulombLoad,
    /// Inverse of the Coulomb velocity.
    CoulombSlope,
    /// Breakaway friction at positive velocity.
    BreakawayPositive,
    /// Breakaway friction at negative velocity.
    BreakawayNegative,
    /// Inverse of the Stribeck velocity.
    StribeckSlope,
    /// Amplitude of the hysteresis.
    Hysteresis,
    /// Steepness of the hysteresis over velocity.
    HysteresisVelocitySlope,
    /// Width of the hysteresis.
    HysteresisWidth,
    /// Angular frequency of the first position harmonic.
    HarmonicFrequency,
    /// Inertia of the rotor.
    RotorInertia,
    /// Amplitude of a position harmonic at positive velocity; 0-based: n stands for the (2 n + 1)-th multiple.
    HarmonicPositive(usize),
    /// Amplitude of a position harmonic at negative velocity, numbered alike.
    HarmonicNegative(usize),
    /// Half the difference of the viscous coefficients of both directions.
    ViscousAsymmetry,
    /// Velocity weakening at positive velocity: breakaway over Coulomb friction, less one.
    WeakeningPositive,
    /// Velocity weakening at negative velocity.
    WeakeningNegative,
    /// Inverse of the velocity over which dry friction weakens.
    WeakeningSlope,
    /// Torque of a pre-sliding element while it slips; 0-based.
    Element(usize),
    /// Sine of a ripple of the Coulomb friction; 0-based.
    RippleLevelSine(usize),
    /// Cosine of it.
    RippleLevelCosine(usize),
    /// Sine of a ripple whatever the direction; 0-based.
    RippleTorqueSine(usize),
    /// Cosine of it.
    RippleTorqueCosine(usize),
    /// Part of the dry friction that is lost while the joint that shares the drive leads.
    Relief,
}

/// Units of a data set's position and effort, in which those of all parameters are expressed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Units {
    /// Unit of position: rad or m.
    pub position: String,
    /// Unit of effort: Nm, N, A or V.
    pub effort: String,
}

impl Default for Units {
    fn default() -> Self {
        Self { position: "rad".into(), effort: "Nm".into() }
    }
}

impl FrictionParameter {
    /// Number of different parameters.
    pub const COUNT: usize = 25 + 2 * HARMONICS + ELEMENTS + 4 * RIPPLES;

    /// Position in a table of all parameters, 0..COUNT.
    pub const fn index(self) -> usize {
        match self {
            Self::Offset => 0,
            Self::PositionSlope => 1,
            Self::TemperatureSlope => 2,
            Self::LoadSlope => 3,
            Self::Viscous => 4,
            Self::ViscousTemperature => 5,
            Self::Quadratic => 6,
            Self::CoulombPositive => 7,
            Self::CoulombNegative => 8,
            Self::CoulombTemperature => 9,
            Self::CoulombLoad => 10,
            Self::CoulombSlope => 11,
            Self::BreakawayPositive => 12,
            Self::BreakawayNegative => 13,
            Self::StribeckSlope => 14,
            Self::Hysteresis => 15,
            Self::HysteresisVelocitySlope => 16,
            Self::HysteresisWidth => 17,
            Self::HarmonicFrequency => 18,
            Self::RotorInertia => 19,
            Self::HarmonicPositive(n) => 20 + n,
            Self::HarmonicNegative(n) => 20 + HARMONICS + n,
            Self::ViscousAsymmetry => 20 + 2 * HARMONICS,
            Self::WeakeningPositive => 21 + 2 * HARMONICS,
            Self::WeakeningNegative => 22 + 2 * HARMONICS,
            Self::WeakeningSlope => 23 + 2 * HARMONICS,
            Self::Element(n) => 24 + 2 * HARMONICS + n,
            Self::RippleLevelSine(k) => 24 + 2 * HARMONICS + ELEMENTS + 4 * k,
            Self::RippleLevelCosine(k) => Self::RippleLevelSine(k).index() + 1,
            Self::RippleTorqueSine(k) => Self::RippleLevelSine(k).index() + 2,
            Self::RippleTorqueCosine(k) => Self::RippleLevelSine(k).index() + 3,
            Self::Relief => Self::COUNT - 1,
        }
    }

    /// All parameters in the order of their index.
    pub fn all() -> [Self; Self::COUNT] {
        let mut all = [Self::Offset; Self::COUNT];
        let single = [
            Self::Offset,
            Self::PositionSlope,
            Self::TemperatureSlope,
            Self::LoadSlope,
            Self::Viscous,
            Self::ViscousTemperature,
            Self::Quadratic,
            Self::CoulombPositive,
            Self::CoulombNegative,
            Self::CoulombTemperature,
            Self::CoulombLoad,
            Self::CoulombSlope,
            Self::BreakawayPositive,
            Self::BreakawayNegative,
            Self::StribeckSlope,
            Self::Hysteresis,
            Self::HysteresisVelocitySlope,
            Self::HysteresisWidth,
            Self::HarmonicFrequency,
            Self::RotorInertia,
        ];
        let harmonics = (0..HARMONICS).map(Self::HarmonicPositive).chain((0..HARMONICS).map(Self::HarmonicNegative));
        let ripples = (0..RIPPLES).flat_map(|k| {
            [
                Self::RippleLevelSine(k),
                Self::RippleLevelCosine(k),
                Self::RippleTorqueSine(k),
                Self::RippleTorqueCosine(k),
            ]
        });
        let others = (0..ELEMENTS).map(Self::Element).chain(ripples).chain([
            Self::ViscousAsymmetry,
            Self::WeakeningPositive,
            Self::WeakeningNegative,
            Self::WeakeningSlope,
            Self::Relief,
        ]);
        for parameter in single.into_iter().chain(harmonics).chain(others) {
            all[parameter.index()] = parameter;
        }
        all
    }

    /// Symbol in the design's formula.
    pub fn symbol(self) -> String {
        match self {
            Self::Offset => "c_0".into(),
            Self::PositionSlope => "c_q".into(),
            Self::TemperatureSlope => "c_T".into(),
            Self::LoadSlope => "c_tau".into(),
            Self::Viscous => "f_v".into(),
            Self::ViscousTemperature => "k_v".into(),
            Self::Quadratic => "f_2".into(),
            Self::CoulombPositive => "F_c+".into(),
            Self::CoulombNegative => "F_c-".into(),
            Self::CoulombTemperature => "k_c".into(),
            Self::CoulombLoad => "k_l".into(),
            Self::CoulombSlope => "1/v_c".into(),
            Self::BreakawayPositive => "F_brk+".into(),
            Self::BreakawayNegative => "F_brk-".into(),
            Self::StribeckSlope => "1/v_st".into(),
            Self::Hysteresis => "b_h".into(),
            Self::HysteresisVelocitySlope => "s".into(),
            Self::HysteresisWidth => "z".into(),
            Self::HarmonicFrequency => "h".into(),
            Self::RotorInertia => "I_a".into(),
            Self::HarmonicPositive(n) => format!("b_{}+", n + 1),
            Self::HarmonicNegative(n) => format!("b_{}-", n + 1),
            Self::ViscousAsymmetry => "f_a".into(),
            Self::WeakeningPositive => "w+".into(),
            Self::WeakeningNegative => "w-".into(),
            Self::WeakeningSlope => "1/v_w".into(),
            Self::Element(n) => format!("L_{}", n + 1),
            Self::RippleLevelSine(k) => format!("A_{}", k + 1),
            Self::RippleLevelCosine(k) => format!("B_{}", k + 1),
            Self::RippleTorqueSine(k) => format!("C_{}", k + 1),
            Self::RippleTorqueCosine(k) => format!("D_{}", k + 1),
            Self::Relief => "r".into(),
        }
    }

    /// Unit, from those of the data set.
    pub fn unit(self, units: &Units) -> String {
        let Units { position, effort } = units;
        match self {
            Self::PositionSlope => format!("{effort}/{position}"),
            Self::TemperatureSlope => format!("{effort}/K"),
            Self::LoadSlope
            | Self::HysteresisWidth
            | Self::WeakeningPositive
            | Self::WeakeningNegative
            | Self::Relief => "1".into(),
            Self::Viscous | Self::ViscousAsymmetry => format!("{effort} s/{position}"),
            Self::ViscousTemperature | Self::CoulombTemperature => "1/K".into(),
            Self::Quadratic => format!("{effort} s^2/{position}^2"),
            Self::CoulombLoad => format!("1/{effort}"),
            Self::CoulombSlope | Self::StribeckSlope | Self::HysteresisVelocitySlope | Self::WeakeningSlope => {
                format!("s/{position}")
            }
            Self::HarmonicFrequency => format!("rad/{position}"),
            Self::RotorInertia => format!("{effort} s^2/{position}"),
            Self::Offset
            | Self::CoulombPositive
            | Self::CoulombNegative
            | Self::BreakawayPositive
            | Self::BreakawayNegative
            | Self::Hysteresis
            | Self::HarmonicPositive(_)
            | Self::HarmonicNegative(_)
            | Self::Element(_)
            | Self::RippleLevelSine(_)
            | Self::RippleLevelCosine(_)
            | Self::RippleTorqueSine(_)
            | Self::RippleTorqueCosine(_) => effort.clone(),
        }
    }
}

/// The parameter's name in the field's words.
impl fmt::Display for FrictionParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Offset => f.write_str("offset"),
            Self::PositionSlope => f.write_str("position slope"),
            Self::TemperatureSlope => f.write_str("temperature slope"),
            Self::LoadSlope => f.write_str("load slope"),
            Self::Viscous => f.write_str("viscous coefficient"),
            Self::ViscousTemperature => f.write_str("viscous temperature coefficient"),
            Self::Quadratic => f.write_str("quadratic coefficient"),
            Self::CoulombPositive => f.write_str("Coulomb friction, positive direction"),
            Self::CoulombNegative => f.write_str("Coulomb friction, negative direction"),
            Self::CoulombTemperature => f.write_str("Coulomb temperature coefficient"),
            Self::CoulombLoad => f.write_str("Coulomb load coefficient"),
            Self::CoulombSlope => f.write_str("Coulomb slope"),
            Self::BreakawayPositive => f.write_str("breakaway friction, positive direction"),
            Self::BreakawayNegative => f.write_str("breakaway friction, negative direction"),
            Self::StribeckSlope => f.write_str("Stribeck slope"),
            Self::Hysteresis => f.write_str("hysteresis amplitude"),
            Self::HysteresisVelocitySlope => f.write_str("hysteresis velocity slope"),
            Self::HysteresisWidth => f.write_str("hysteresis width"),
            Self::HarmonicFrequency => f.write_str("harmonic frequency"),
            Self::RotorInertia => f.write_str("rotor inertia"),
            Self::HarmonicPositive(n) => write!(f, "position harmonic {}, positive direction", 2 * n + 1),
            Self::HarmonicNegative(n) => write!(f, "position harmonic {}, negative direction", 2 * n + 1),
            Self::ViscousAsymmetry => f.write_str("viscous asymmetry"),
            Self::WeakeningPositive => f.write_str("velocity weakening, positive direction"),
            Self::WeakeningNegative => f.write_str("velocity weakening, negative direction"),
            Self::WeakeningSlope => f.write_str("weakening slope"),
            Self::Element(n) => write!(f, "pre-sliding friction, element {}", n + 1),
            Self::RippleLevelSine(k) => write!(f, "ripple {} of the Coulomb friction, sine", k + 1),
            Self::RippleLevelCosine(k) => write!(f, "ripple {} of the Coulomb friction, cosine", k + 1),
            Self::RippleTorqueSine(k) => write!(f, "ripple {} of both directions, sine", k + 1),
            Self::RippleTorqueCosine(k) => write!(f, "ripple {} of both directions, cosine", k + 1),
            Self::Relief => f.write_str("relief by the joint that shares the drive"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_parameter_has_its_own_index_symbol_and_name() {
        let all = FrictionParameter::all();
        assert!(all.iter().enumerate().all(|(i, p)| p.index() == i));
        assert_eq!(all.iter().map(|p| p.symbol()).collect::<BTreeSet<_>>().len(), FrictionParameter::COUNT);
        assert_eq!(all.iter().map(|p| p.to_string()).collect::<BTreeSet<_>>().len(), FrictionParameter::COUNT);
    }

    #[test]
    fn units_follow_those_of_the_data_set() {
        let emps = Units { position: "m".into(), effort: "N".into() };
        assert_eq!(FrictionParameter::Viscous.unit(&emps), "N s/m");
        assert_eq!(FrictionParameter::CoulombPositive.unit(&emps), "N");
    }
}
