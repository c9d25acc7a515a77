//! Regimes of an image: criteria that choose the parameter set, and the physical friction of each.
//!
//! A joint whose friction the joint that shares its drive relieves has two sets without any network: the first while
//! the other one leads, the second while it leads itself. Other criteria are for networks.

use crate::classify::Thresholds;
use crate::friction_model::{FrictionModel, Term};
use crate::samples::Samples;
use friction_compensation::friction::regime::{Criterion, MAX_CRITERIA, Measure, Selector};

/// Cross-fade between regimes, s.
const FADE_TIME: f64 = 0.02;

/// Selector and friction of each of its sets.
#[derive(Clone, Debug)]
pub struct Regimes {
    /// Selector.
    pub selector: Selector,
    /// Physical friction of each set.
    pub friction: Vec<FrictionModel>,
}

impl Regimes {
    /// Regimes of a physical model alone.
    pub fn of(friction: &FrictionModel, samples: &Samples) -> Self {
        Self::with(friction, samples, vec![])
    }

    /// Regimes of a physical model and of networks by these measures.
    pub fn by(friction: &FrictionModel, samples: &Samples, measures: &[Measure], thresholds: &Thresholds) -> Self {
        let criterion = |measure: &Measure| {
            let threshold = match measure {
                Measure::Acceleration => thresholds.acceleration,
                Measure::Speed | Measure::Coupled => thresholds.speed,
            };
            // A tenth of hysteresis either way.
            let bits = |factor: f64| (threshold * factor * 65536.0).clamp(1.0, f64::from(i32::MAX)) as i32;
            Criterion { measure: *measure, enter: bits(1.1), leave: bits(0.9) }
        };
        Self::with(friction, samples, measures.iter().map(criterion).collect())
    }

    fn with(friction: &FrictionModel, samples: &Samples, others: Vec<Criterion>) -> Self {
        let partner = samples.partner.as_ref().filter(|_| friction.terms.contains(Term::Relief));
        let leading = partner.map(|partner| {
            let band = (partner.band * 65536.0).round().clamp(1.0, f64::from(i32::MAX)) as i32;
            Criterion { measure: Measure::Coupled, enter: band, leave: -band }
        });
        let mut criteria = [None; MAX_CRITERIA];
        criteria.iter_mut().zip(leading.into_iter().chain(others)).for_each(|(place, one)| *place = Some(one));
        let fade_time = if criteria[0].is_none() { 0 } else { (FADE_TIME * 65536.0) as u32 };
        let selector = Selector { criteria, fade_time };
        // The first criterion is bit 0 of a set's number.
        let of_set = |set: usize| match leading {
            Some(_) => friction.of_regime(set & 1 == 0),
            None => friction.clone(),
        };
        Self { selector, friction: (0..selector.sets()).map(of_set).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction_model::{Directional, JointState, Terms};
    use crate::samples::Partner;

    const THRESHOLDS: Thresholds = Thresholds { acceleration: 2.0, speed: 1.0 };

    fn relieved() -> FrictionModel {
        FrictionModel {
            terms: Terms::of(&[Term::Coulomb, Term::Stribeck, Term::Viscous, Term::Relief]),
            coulomb: Directional { positive: 2.0, negative: 3.0 },
            breakaway: Directional { positive: 2.5, negative: 3.5 },
            coulomb_slope: 50.0,
            stribeck_slope: 9.0,
            viscous: 0.7,
            relief: 0.4,
            ..FrictionModel::default()
        }
    }

    fn samples() -> Samples {
        let partner = Partner { velocity: vec![], band: 0.25, leads: vec![] };
        Samples { partner: Some(partner), ..Samples::default() }
    }

    #[test]
    fn a_relieved_joint_has_a_set_for_each_leader_that_says_what_the_model_says() {
        let model = relieved();
        let found = Regimes::of(&model, &samples());
        let criterion = Criterion { measure: Measure::Coupled, enter: 1 << 14, leave: -(1 << 14) };
        assert_eq!(found.selector.criteria, [Some(criterion), None]);
        assert_eq!(found.selector.fade_time, 1310);
        for velocity in [-1.0, -0.03, 0.02, 0.8] {
            for (set, following) in [(0, true), (1, false)] {
                let state = JointState { velocity, following, ..JointState::default() };
                let of_set = found.friction[set].friction(&JointState { following: false, ..state });
                assert!((of_set - model.friction(&state)).abs() < 1e-12, "set {set} at {velocity} rad/s");
            }
        }
        assert!(found.friction.iter().all(|set| !set.terms.contains(Term::Relief)));
    }

    #[test]
    fn without_relief_there_are_the_regimes_that_were_asked_for() {
        let plain = FrictionModel { terms: relieved().terms.without(Term::Relief), ..relieved() };
        let alone = Regimes::of(&plain, &samples());
        assert_eq!((alone.selector, alone.friction.len()), (Selector::default(), 1));
        let by = |measures: &[Measure]| Regimes::by(&plain, &samples(), measures, &THRESHOLDS);
        let speed = Criterion { measure: Measure::Speed, enter: 72_089, leave: 58_982 };
        assert_eq!(by(&[Measure::Speed]).selector.criteria, [Some(speed), None]);
        assert_eq!(by(&[Measure::Speed]).friction, [plain.clone(), plain.clone()]);
    }

    #[test]
    fn a_relief_is_the_first_criterion_and_leaves_room_for_one_more() {
        let measures = [Measure::Acceleration, Measure::Speed];
        let found = Regimes::by(&relieved(), &samples(), &measures, &THRESHOLDS);
        let measure = |number: usize| found.selector.criteria[number].unwrap().measure;
        assert_eq!([measure(0), measure(1)], [Measure::Coupled, Measure::Acceleration]);
        assert_eq!(found.friction[0], found.friction[2]);
        assert_eq!(found.friction[1], found.friction[3]);
        assert!(found.friction[0].coulomb.positive < found.friction[1].coulomb.positive);
    }
}
