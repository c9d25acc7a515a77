//! The papers' friction models, and ours, as named choices of terms; host.
//!
//! 001 = friction compensation model for mobile robots' joints; 002 = DeLaN with non-symmetric Coulomb friction;
//! 003 = friction-model-based framework (WAM).

use crate::friction_model::{Term, Terms};
use crate::rigid::RigidModel;
use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};

/// A named friction model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// Offset, viscous and symmetric Coulomb friction: the usual baseline.
    CoulombViscous,
    /// 001 eq. 5: constant, velocity, load, temperature, position.
    Linear,
    /// 001 eq. 6-8: viscous, Coulomb and Stribeck friction with one velocity for both shapes.
    Stribeck,
    /// 002 eq. 6 and section III.A: offset, viscous, non-symmetric Coulomb friction, rotor inertia.
    Nscf,
    /// 003 eq. 4: viscous friction and an arctangent with hysteresis.
    Hysteresis,
    /// 003 eq. 5: eq. 4, position slope and position harmonics.
    HysteresisHarmonics,
    /// Every term that the data can support, reduced on validation samples.
    Full,
}

impl Preset {
    /// All presets, simplest first.
    pub const ALL: [Self; 7] = [
        Self::CoulombViscous,
        Self::Linear,
        Self::Stribeck,
        Self::Nscf,
        Self::Hysteresis,
        Self::HysteresisHarmonics,
        Self::Full,
    ];

    /// The name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::CoulombViscous => "coulomb-viscous",
            Self::Linear => "linear",
            Self::Stribeck => "stribeck",
            Self::Nscf => "nscf",
            Self::Hysteresis => "hysteresis",
            Self::HysteresisHarmonics => "hysteresis-harmonics",
            Self::Full => "full",
        }
    }

    /// The terms of this preset beside the given rigid part; nothing for `Full`, whose terms the data decide.
    ///
    /// The rotor inertia of `Nscf` is left to the rigid part where that has an inertia: both multiply the acceleration.
    pub fn structure(self, rigid: &RigidModel) -> Option<Structure> {
        use Term::*;
        let symmetric = |terms: &[Term]| Structure { terms: Terms::of(terms), ..Structure::default() };
        Some(match self {
            Self::CoulombViscous => symmetric(&[Constant, Viscous, Coulomb]),
            Self::Linear => symmetric(&[Constant, Viscous, Load, Temperature, Position]),
            Self::Stribeck => Structure { coupled_slopes: true, ..symmetric(&[Viscous, Coulomb, Stribeck]) },
            Self::Nscf => {
                let base = symmetric(&[Constant, Viscous, Coulomb]);
                let terms = if rigid.has_inertia() { base.terms } else { base.terms.with(RotorInertia) };
                Structure { terms, asymmetric_coulomb: true, ..base }
            }
            Self::Hysteresis => symmetric(&[Viscous, Hysteresis]),
            Self::HysteresisHarmonics => symmetric(&[Position, Viscous, Hysteresis, Harmonics]),
            Self::Full => return None,
        })
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The name is not that of a preset.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "no friction model is called {0:?}; there are coulomb-viscous, linear, stribeck, nscf, hysteresis, hysteresis-harmonics, full"
)]
pub struct UnknownPreset(pub String);

impl FromStr for Preset {
    type Err = UnknownPreset;

    fn from_str(name: &str) -> Result<Self, UnknownPreset> {
        Self::ALL.into_iter().find(|preset| preset.name() == name).ok_or_else(|| UnknownPreset(name.into()))
    }
}

/// Degrees of freedom of an identification: the terms and what their parameters share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Structure {
    /// Terms that are on.
    pub terms: Terms,
    /// One Coulomb friction for each direction, instead of one for both.
    pub asymmetric_coulomb: bool,
    /// One height of the Stribeck peak for each direction, instead of one for both.
    pub asymmetric_breakaway: bool,
    /// v_c = v_st / (10 sqrt 2): both follow from one breakaway velocity (001 eq. 7 and 8).
    pub coupled_slopes: bool,
}

impl Structure {
    /// True when the rigid part is held at the theoretical torque: `c_tau tau_t` is a multiple of the rigid part, so
    /// the two can only be told apart when one of them is given, and 001 takes the theoretical torque as given.
    pub fn holds_rigid(&self) -> bool {
        self.terms.contains(Term::Load)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_preset_has_exactly_the_terms_of_its_paper() {
        use Term::*;
        let (none, fixed) = (RigidModel::default(), RigidModel { inertia: true, ..RigidModel::default() });
        let terms = |preset: Preset, rigid| preset.structure(rigid).unwrap().terms.iter().collect::<Vec<_>>();
        assert_eq!(terms(Preset::CoulombViscous, &fixed), [Constant, Viscous, Coulomb]);
        assert_eq!(terms(Preset::Linear, &fixed), [Constant, Position, Temperature, Load, Viscous]);
        assert_eq!(terms(Preset::Stribeck, &fixed), [Viscous, Coulomb, Stribeck]);
        assert_eq!(terms(Preset::Nscf, &fixed), [Constant, Viscous, Coulomb]);
        assert_eq!(terms(Preset::Nscf, &none), [Constant, Viscous, Coulomb, RotorInertia]);
        assert_eq!(terms(Preset::Hysteresis, &fixed), [Viscous, Hysteresis]);
        assert_eq!(terms(Preset::HysteresisHarmonics, &fixed), [Position, Viscous, Hysteresis, Harmonics]);
        assert!(Preset::Nscf.structure(&fixed).unwrap().asymmetric_coulomb);
        assert!(Preset::Stribeck.structure(&fixed).unwrap().coupled_slopes);
        assert!(Preset::Full.structure(&fixed).is_none());
    }

    #[test]
    fn a_preset_is_found_by_its_name_and_only_by_that() {
        for preset in Preset::ALL {
            assert_eq!(preset.name().parse(), Ok(preset));
        }
        assert!("Stribek".parse::<Preset>().unwrap_err().to_string().contains("Stribek"));
    }
}
