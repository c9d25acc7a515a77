use super::*;
use crate::friction_model::{Directional, FrictionModel, Ripple, Term, Terms};
use crate::identify::synthetic::{RIGID, drive, motion, rigid};
use crate::identify::{Options, identify};
use crate::presets::Preset;

fn truth() -> FrictionModel {
    FrictionModel {
        terms: Terms::of(&[Term::Viscous, Term::Coulomb, Term::PreSliding, Term::Ripple, Term::SecondRipple]),
        viscous: 0.8,
        coulomb: Directional { positive: 0.6, negative: 0.6 },
        coulomb_slope: 60.0,
        element_stiffness: [1.0 / 0.3, 1.0 / 0.04, 0.0, 0.0],
        element_level: [1.0, 1.4, 0.0, 0.0],
        ripples: [
            Ripple { frequency: 11.0, level_sine: 0.4, level_cosine: -0.2, ..Ripple::default() },
            Ripple { frequency: 37.3, torque_sine: 0.15, torque_cosine: 0.3, ..Ripple::default() },
        ],
        ..FrictionModel::default()
    }
}

#[test]
fn pre_sliding_and_two_ripples_are_found_where_they_are() {
    let (mut samples, truth) = (motion(12_000), truth());
    drive(&mut samples, &rigid(), &truth, 0.02, 7);
    samples.bent.clear();
    let found = identify(&mut samples, &RIGID, Preset::Full, &Options::default()).unwrap();
    for term in [Term::PreSliding, Term::Ripple, Term::SecondRipple] {
        assert!(found.friction.terms.contains(term), "{term:?}: {:?}", found.notes);
    }
    let mut frequencies = found.friction.ripples.map(|ripple| ripple.frequency);
    frequencies.sort_by(f64::total_cmp);
    assert!((frequencies[0] - 11.0).abs() < 0.1 && (frequencies[1] - 37.3).abs() < 0.1, "{frequencies:?}");
    // Distances are those of a row, each half of the one before: the levels divide themselves among the nearest.
    let level: f64 = found.friction.element_level.iter().sum();
    assert!((level + 0.5 * (found.friction.coulomb.positive + found.friction.coulomb.negative) - 3.0).abs() < 0.15);
    assert!((level - 2.4).abs() < 0.3, "{:?}", found.friction);
    let simplest = identify(&mut samples, &RIGID, Preset::CoulombViscous, &Options::default()).unwrap();
    assert!(found.train_rmse < 0.25 * simplest.train_rmse, "{} {}", found.train_rmse, simplest.train_rmse);
}

#[test]
fn neither_is_offered_to_a_joint_that_has_none() {
    let mut samples = motion(12_000);
    let plain = FrictionModel { terms: Terms::of(&[Term::Viscous, Term::Coulomb]), ..truth() };
    drive(&mut samples, &rigid(), &plain, 0.02, 7);
    let found = identify(&mut samples, &RIGID, Preset::Full, &Options::default()).unwrap();
    assert_eq!(found.friction.terms, Terms::of(&[Term::Viscous, Term::Coulomb, Term::Constant]), "{:?}", found.notes);
}

#[test]
fn a_ripple_has_a_part_whatever_the_direction_from_eight_periods_over_the_range_on() {
    assert!(!has_torque(7.99 * TAU / 3.0, 3.0) && has_torque(8.01 * TAU / 3.0, 3.0));
    // The rest of gravity looks like a slow ripple whatever the direction.
    let (mut samples, slow) = (motion(12_000), Ripple { frequency: 5.0, torque_sine: 0.4, ..Ripple::default() });
    let truth = FrictionModel {
        terms: Terms::of(&[Term::Viscous, Term::Coulomb, Term::Ripple]),
        ripples: [slow, Ripple::default()],
        ..truth()
    };
    drive(&mut samples, &rigid(), &truth, 0.02, 7);
    let found = identify(&mut samples, &RIGID, Preset::Full, &Options::default()).unwrap();
    let slow = found.friction.ripples.iter().filter(|ripple| ripple.frequency < 10.0);
    assert!(slow.into_iter().all(|ripple| ripple.torque_sine == 0.0 && ripple.torque_cosine == 0.0));
}
