//! Known parameters are found again: each term alone, all together, with standard errors that mean what they say.

use super::estimates::{Estimated, estimates};
use super::grid::search;
use super::synthetic::{RIGID, drive, friction, motion, problem, rigid, shared};
use crate::friction_model::{FrictionModel, Term, Terms};
use crate::friction_parameter::{FrictionParameter, Units};
use crate::presets::Structure;
use crate::rigid::{RigidModel, RigidParameters, RigidRegressor};

const NOISE: f64 = 0.02;

/// Fits the structure to a joint that has exactly it, and returns all parameters with their true values.
fn recovered(structure: &Structure, model: &RigidModel, truth: &FrictionModel, seed: u64) -> Vec<(Estimated, f64)> {
    let mut samples = shared(motion(8_000));
    drive(&mut samples, &rigid(), truth, NOISE, seed);
    let problem = problem(&samples, model, rigid(), truth);
    let fit = search(&problem, structure).polished(&problem);
    assert!(fit.candidate.notes.is_empty(), "{:?}", fit.candidate.notes);
    let (found, _) = estimates(&fit, problem.train.len(), &Units::default());
    found.into_iter().map(|e| (e.clone(), true_value(&e.symbol, truth))).collect()
}

fn true_value(symbol: &str, truth: &FrictionModel) -> f64 {
    let of_rigid = RigidRegressor::ALL.into_iter().find(|r| r.symbol() == symbol).map(|r| rigid().coefficient(r));
    let of_friction = FrictionParameter::all().into_iter().find(|p| p.symbol() == symbol).map(|p| truth.parameter(p));
    of_rigid.or(of_friction).unwrap()
}

/// Levels of pre-sliding elements that the synthetic joints do not have.
const ABSENT: usize = 2;

fn asymmetric(terms: &[Term]) -> Structure {
    let terms = Terms::of(terms);
    let asymmetric_breakaway = terms.contains(Term::Stribeck) || terms.contains(Term::VelocityWeakening);
    Structure { terms, asymmetric_coulomb: true, asymmetric_breakaway, ..Structure::default() }
}

fn assert_within_three_standard_errors(found: &[(Estimated, f64)]) {
    for (e, truth) in found {
        let Some(error) = e.standard_error else {
            assert!(!e.at_bound && e.value == *truth, "{e:?} has no standard error");
            continue;
        };
        assert!((e.value - truth).abs() < 3.0 * error, "{}: {} +- {error}, true {truth}", e.name, e.value);
    }
}

#[test]
fn every_term_alone_is_recovered_within_three_standard_errors() {
    for term in Term::ALL {
        let mut terms = vec![term];
        match term {
            Term::ViscousTemperature => terms.push(Term::Viscous),
            Term::CoulombTemperature
            | Term::CoulombLoad
            | Term::Stribeck
            | Term::VelocityWeakening
            | Term::PreSliding
            | Term::Ripple
            | Term::SecondRipple
            | Term::Relief => terms.push(Term::Coulomb),
            _ => {}
        }
        let structure = asymmetric(&terms);
        let mut model = RIGID;
        let mut truth = friction(structure.terms);
        if term == Term::RotorInertia {
            // Without an inertia of the rigid part, the whole inertia is the rotor's.
            model.inertia = false;
            truth.rotor_inertia = 0.3 + rigid().inertia;
            let mut found = recovered_rotor(&structure, &model, &truth);
            found.retain(|(e, _)| e.symbol == "I_a");
            assert_eq!(found.len(), 1);
            assert_within_three_standard_errors(&found);
            continue;
        }
        let found = recovered(&structure, &model, &truth, 7);
        assert!(found.len() > 3, "{term:?}: {found:?}");
        assert_within_three_standard_errors(&found);
    }
}

fn recovered_rotor(structure: &Structure, model: &RigidModel, truth: &FrictionModel) -> Vec<(Estimated, f64)> {
    let gravity = RigidParameters { inertia: 0.0, ..rigid() };
    let mut samples = motion(8_000);
    drive(&mut samples, &gravity, truth, NOISE, 7);
    let problem = problem(&samples, model, gravity, truth);
    let fit = search(&problem, structure).polished(&problem);
    let (found, _) = estimates(&fit, problem.train.len(), &Units::default());
    found.into_iter().map(|e| (e.clone(), true_value(&e.symbol, truth))).collect()
}

#[test]
fn all_terms_together_are_recovered_within_three_standard_errors() {
    // c_tau needs the rigid part to be given, which also leaves the rotor inertia free beside it.
    let structure = asymmetric(&Term::ALL);
    let found = recovered(&structure, &RIGID, &friction(structure.terms), 3);
    assert_eq!(found.len(), FrictionParameter::COUNT - ABSENT + 3);
    assert_within_three_standard_errors(&found);
}

#[test]
fn all_terms_are_recovered_together_with_the_rigid_part() {
    let terms = Terms::of(&Term::ALL).without(Term::Load).without(Term::RotorInertia);
    let structure = Structure { terms, ..asymmetric(&Term::ALL) };
    let found = recovered(&structure, &RIGID, &friction(terms), 5);
    assert_eq!(found.len(), FrictionParameter::COUNT - ABSENT - 2 + 3);
    assert_within_three_standard_errors(&found);
}

#[test]
fn standard_errors_are_those_of_repeated_experiments() {
    let structure = asymmetric(&[Term::Constant, Term::Viscous, Term::Coulomb, Term::CoulombLoad, Term::Stribeck]);
    let truth = friction(structure.terms);
    let repetitions = 60;
    let mut squares = vec![0.0; 12];
    for seed in 0..repetitions {
        let mut samples = motion(2_000);
        drive(&mut samples, &rigid(), &truth, NOISE, 100 + seed);
        let problem = problem(&samples, &RIGID, rigid(), &truth);
        let fit = search(&problem, &structure).polished(&problem);
        let (found, _) = estimates(&fit, problem.train.len(), &Units::default());
        assert_eq!(found.len(), squares.len());
        for (e, square) in found.iter().zip(&mut squares) {
            *square += ((e.value - true_value(&e.symbol, &truth)) / e.standard_error.unwrap()).powi(2);
        }
    }
    // The root mean square of 60 standard normal numbers lies between 0.72 and 1.28 but for 0.2 % of the cases.
    for square in &squares {
        let rms = (square / repetitions as f64).sqrt();
        assert!((0.72..1.28).contains(&rms), "{squares:?}");
    }
    let pooled = (squares.iter().sum::<f64>() / (repetitions as f64 * squares.len() as f64)).sqrt();
    assert!((0.9..1.1).contains(&pooled), "{pooled}");
}

#[test]
fn a_symmetric_structure_gives_both_directions_one_value() {
    let structure = Structure { terms: Terms::of(&[Term::Viscous, Term::Coulomb]), ..Structure::default() };
    let mut truth = friction(structure.terms);
    truth.coulomb.negative = truth.coulomb.positive;
    let found = recovered(&structure, &RIGID, &truth, 11);
    assert_within_three_standard_errors(&found);
    let value = |symbol: &str| found.iter().find(|(e, _)| e.symbol == symbol).unwrap().0.value;
    assert_eq!(value("F_c+"), value("F_c-"));
}

#[test]
fn a_value_that_would_leave_its_bound_stays_on_it_and_says_so() {
    let viscous = asymmetric(&[Term::Viscous, Term::Coulomb]);
    let truth = FrictionModel { viscous: -0.2, ..friction(viscous.terms) };
    let found = recovered(&viscous, &RIGID, &truth, 1);
    let of = |symbol: &str| found.iter().find(|(e, _)| e.symbol == symbol).unwrap().0.clone();
    assert!(of("f_v").value == 0.0 && of("f_v").at_bound && of("f_v").standard_error.is_none(), "{:?}", of("f_v"));

    let stribeck = asymmetric(&[Term::Viscous, Term::Coulomb, Term::Stribeck]);
    let mut truth = friction(stribeck.terms);
    truth.breakaway.positive = truth.coulomb.positive - 0.3;
    let found = recovered(&stribeck, &RIGID, &truth, 1);
    let of = |symbol: &str| found.iter().find(|(e, _)| e.symbol == symbol).unwrap().0.clone();
    assert!(of("F_brk+").value == of("F_c+").value && of("F_brk+").at_bound, "{:?}", of("F_brk+"));
    assert!(!of("F_c+").at_bound && !of("F_brk-").at_bound);
}
