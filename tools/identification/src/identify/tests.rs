//! Tests of the identification as a whole.

use super::synthetic::{RIGID, drive, friction, motion, rigid, shared};
use super::*;
use crate::choice::{LEAST_WORTH, compare};
use crate::friction_model::{Term, Terms};
use crate::rigid::Gravity;
use crate::samples::Part;

/// The friction of the joint that most tests identify.
fn truth() -> FrictionModel {
    friction(Terms::of(&[Term::Constant, Term::Viscous, Term::Coulomb, Term::Stribeck]))
}

/// A joint with asymmetric Coulomb, Stribeck and viscous friction and an offset.
fn joint(count: usize) -> Samples {
    let mut samples = motion(count);
    drive(&mut samples, &rigid(), &truth(), 0.02, 42);
    samples
}

fn of<'a>(found: &'a Identified, symbol: &str) -> &'a Estimated {
    found.parameters.iter().find(|e| e.symbol == symbol).unwrap()
}

#[test]
fn each_preset_identifies_exactly_the_parameters_of_its_paper() {
    let harmonics = "b_1+ b_2+ b_3+ b_4+ b_5+ b_1- b_2- b_3- b_4- b_5-";
    for (preset, expected) in [
        (Preset::CoulombViscous, "I g_s g_c c_0 f_v F_c+ F_c- 1/v_c".to_string()),
        (Preset::Linear, "I g_s g_c c_0 c_q c_T c_tau f_v".into()),
        (Preset::Stribeck, "I g_s g_c f_v F_c+ F_c- 1/v_c F_brk+ F_brk- 1/v_st".into()),
        (Preset::Nscf, "I g_s g_c c_0 f_v F_c+ F_c- 1/v_c".into()),
        (Preset::Hysteresis, "I g_s g_c f_v b_h s z".into()),
        (Preset::HysteresisHarmonics, format!("I g_s g_c c_q f_v b_h s z h {harmonics}")),
    ] {
        let found = identify(&mut joint(4_000), &RIGID, preset, &Options::default()).unwrap();
        let symbols: Vec<&str> = found.parameters.iter().map(|e| e.symbol.as_str()).collect();
        assert_eq!(symbols.join(" "), expected, "{preset}");
        assert_eq!(found.friction.terms, preset.structure(&RIGID).unwrap().terms);
    }
    let no_inertia = RigidModel { inertia: false, ..RIGID };
    let found = identify(&mut joint(4_000), &no_inertia, Preset::Nscf, &Options::default()).unwrap();
    assert!(of(&found, "I_a").value > 1.0 && found.parameters.iter().all(|e| e.symbol != "I"));
}

#[test]
fn the_stribeck_preset_couples_both_slopes_through_the_breakaway_velocity() {
    let found = identify(&mut joint(4_000), &RIGID, Preset::Stribeck, &Options::default()).unwrap();
    let ratio = found.friction.coulomb_slope / found.friction.stribeck_slope;
    assert!((ratio - 10.0 * 2f64.sqrt()).abs() < 1e-9, "{ratio}");
}

#[test]
fn the_load_of_every_sample_is_the_rigid_part_and_not_the_measured_effort() {
    let mut samples = joint(4_000);
    let found = identify(&mut samples, &RIGID, Preset::CoulombViscous, &Options::default()).unwrap();
    assert_eq!(found.rigid, found.theoretical);
    for i in 0..samples.len() {
        assert_eq!(samples.load[i], found.theoretical.effort(&crate::joint_model::rigid_state(&samples, i)));
    }
    assert!((found.theoretical.inertia - rigid().inertia).abs() < 0.05, "{:?}", found.theoretical);
}

#[test]
fn rigid_part_and_friction_of_the_samples_leave_the_reported_error() {
    let mut samples = joint(4_000);
    let found = identify(&mut samples, &RIGID, Preset::Nscf, &Options::default()).unwrap();
    let indices = observations::used(&samples);
    let left = |i: usize| samples.effort[i] - found.rigid_effort(&samples, i) - found.friction(&samples, i);
    let rmse = (indices.iter().map(|&i| left(i).powi(2)).sum::<f64>() / indices.len() as f64).sqrt();
    assert!((rmse - found.train_rmse).abs() < 1e-9);
}

#[test]
fn full_reaches_the_noise_and_no_preset_beats_it_on_left_out_samples() {
    let mut samples = joint(6_000);
    let full = identify(&mut samples, &RIGID, Preset::Full, &Options::default()).unwrap();
    for preset in Preset::ALL {
        let other = identify(&mut samples, &RIGID, preset, &Options::default()).unwrap();
        let change = compare(&full.fold_errors(), &other.fold_errors());
        assert!(!change.wins(LEAST_WORTH), "{preset}: {change:?}");
    }
    assert!(full.friction.terms.contains(Term::Stribeck), "{:?}", full.notes);
    assert!(full.unseen_rmse() < 1.01 * 0.02, "{} of a noise of 0.02", full.unseen_rmse());
}

/// The joint has offset, viscous, Coulomb and Stribeck friction: a model with more says what is not there.
#[test]
fn full_finds_the_terms_of_the_joint_and_their_values_and_no_others() {
    for seed in [42, 43, 44] {
        let mut samples = motion(6_000);
        drive(&mut samples, &rigid(), &truth(), 0.02, seed);
        let found = identify(&mut samples, &RIGID, Preset::Full, &Options::default()).unwrap();
        assert_eq!(found.friction.terms, truth().terms, "{:?}", found.notes);
        for (value, truth) in [
            (found.friction.coulomb.positive, truth().coulomb.positive),
            (found.friction.coulomb.negative, truth().coulomb.negative),
            (found.friction.viscous, truth().viscous),
        ] {
            assert!((value / truth - 1.0).abs() < 0.1, "{value}, true {truth}: {:?}", found.notes);
        }
    }
}

#[test]
fn full_finds_a_relief_where_there_is_one_and_nowhere_else() {
    let relieved = FrictionModel { terms: truth().terms.with(Term::Relief), ..truth() };
    for (joint, is) in [(&relieved, true), (&truth(), false)] {
        let mut samples = shared(motion(6_000));
        drive(&mut samples, &rigid(), joint, 0.02, 42);
        let found = identify(&mut samples, &RIGID, Preset::Full, &Options::default()).unwrap();
        assert_eq!(found.friction.terms, joint.terms, "{:?}", found.notes);
        if is {
            let relief = found.friction.relief;
            assert!((relief / joint.relief - 1.0).abs() < 0.05, "{relief}, true {}", joint.relief);
        }
    }
}

#[test]
fn a_term_is_forced_or_forbidden_by_request() {
    let found = |rule: &str| {
        let options = Options { terms: vec![rule.parse().unwrap()], ..Options::default() };
        identify(&mut joint(4_000), &RIGID, Preset::Full, &options).unwrap().friction.terms
    };
    assert!(!found("-Stribeck").contains(Term::Stribeck));
    assert!(!found("-Constant").contains(Term::Constant));
    assert!(found("+Quadratic").contains(Term::Quadratic));
    assert!(!found("+Stribeck").contains(Term::Quadratic));
}

#[test]
fn where_runs_are_left_out_the_search_begins_with_other_terms_as_well() {
    let ways = |several: bool| {
        let mut samples = joint(4_000);
        let folds = Folds { several, ..grouping::of_time(&samples) };
        let options = Options { folds: Some(folds), ..Options::default() };
        let found = identify(&mut samples, &RIGID, Preset::Full, &options).unwrap();
        found.notes.iter().filter(|note| note.contains("taken first")).count()
    };
    assert_eq!(ways(false), 1);
    assert!((2..=3).contains(&ways(true)), "{}", ways(true));
}

#[test]
fn full_considers_temperature_only_when_it_varied_enough() {
    let mut samples = joint(4_000);
    samples.temperature.iter_mut().for_each(|t| *t = 30.0 + 0.1 * (*t - 30.0));
    let found = identify(&mut samples, &RIGID, Preset::Full, &Options::default()).unwrap();
    assert!(!found.friction.terms.contains(Term::CoulombTemperature));
    assert!(found.notes.iter().any(|note| note.contains("cover 2.0 K")), "{:?}", found.notes);
}

#[test]
fn a_position_slope_that_gravity_explains_is_not_friction_and_one_that_it_does_not_explain_is() {
    let rigid_model = RigidModel { gravity: Gravity::Sine, ..RIGID };
    let rigid = RigidParameters { gravity_cosine: 0.0, ..rigid() };
    let sloped = friction(Terms::of(&[Term::Position, Term::Viscous, Term::Coulomb]));
    let found = |scale: f64, friction: &FrictionModel| {
        let mut samples = motion(4_000);
        for values in [&mut samples.position, &mut samples.velocity, &mut samples.acceleration] {
            values.iter_mut().for_each(|value| *value *= scale);
        }
        drive(&mut samples, &rigid, friction, 0.02, 42);
        identify(&mut samples, &rigid_model, Preset::Full, &Options::default()).unwrap()
    };
    let narrow = found(0.5, &truth());
    assert!(!narrow.friction.terms.contains(Term::Position), "{:?}", narrow.notes);
    assert!((narrow.rigid.gravity_sine - rigid.gravity_sine).abs() < 0.1, "{:?}", narrow.rigid);
    let wide = found(2.0, &sloped);
    assert!(wide.friction.terms.contains(Term::Position), "{:?}", wide.notes);
    assert!((wide.friction.position_slope - sloped.position_slope).abs() < 0.03, "{:?}", wide.friction);
}

/// But for their velocities, which bend the pre-sliding elements that the motion behind them begins with.
#[test]
fn the_test_samples_are_never_looked_at() {
    let mut clean = joint(3_000);
    let mut corrupt = clean.clone();
    for i in corrupt.indices(Part::Test) {
        (corrupt.effort[i], corrupt.acceleration[i], corrupt.temperature[i]) = (f64::NAN, 1e6, -300.0);
    }
    let found =
        [&mut clean, &mut corrupt].map(|samples| identify(samples, &RIGID, Preset::Full, &Options::default()).unwrap());
    assert_eq!(found[0].friction, found[1].friction);
    assert_eq!(found[0].rigid, found[1].rigid);
    assert_eq!(found[0].parameters, found[1].parameters);
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let found = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| identify(&mut joint(6_000), &RIGID, Preset::Full, &Options::default()).unwrap())
    });
    assert_eq!(found[0].friction, found[1].friction);
    assert_eq!(found[0].parameters, found[1].parameters);
    assert_eq!(found[0].notes, found[1].notes);
}

#[test]
fn an_offset_that_gravity_explains_is_left_to_gravity() {
    let mut samples = joint(3_000);
    samples.position.iter_mut().for_each(|q| *q = 0.4);
    let found = identify(&mut samples, &RIGID, Preset::CoulombViscous, &Options::default()).unwrap();
    let says = |what: &str| found.notes.iter().any(|note| note.starts_with(what));
    assert!(says("no offset: over these positions the rigid part explains all but 0.00 % of it"), "{:?}", found.notes);
    assert!(
        says("gravity, cosine of position: cannot be told from gravity, sine of position; set to 0"),
        "{:?}",
        found.notes
    );
    assert_eq!((found.friction.offset, found.rigid.gravity_cosine), (0.0, 0.0));
    assert!(of(&found, "I").standard_error.is_some());
}

#[test]
fn a_joint_that_never_moves_gives_no_friction_and_says_why() {
    let mut samples = joint(3_000);
    for column in [&mut samples.velocity, &mut samples.acceleration] {
        column.iter_mut().for_each(|x| *x = 0.0);
    }
    let found = identify(&mut samples, &RIGID, Preset::CoulombViscous, &Options::default()).unwrap();
    assert!(found.notes.contains(&"viscous coefficient: nothing in the train samples excites it; set to 0".into()));
    assert_eq!(found.friction.viscous, 0.0);
}

#[test]
fn a_known_load_splits_inertia_and_gravity() {
    let mut samples = motion(6_000);
    let run = |i: usize| i / 1_000;
    let column = |values: [f64; 3]| (0..6_000).map(|i| values[run(i) % 3]).collect::<Vec<f64>>();
    samples.extra.insert("mass".into(), column([0.5, 1.1, 1.7]));
    samples.extra.insert("length".into(), column([0.20, 0.15, 0.10]));
    let truth = RigidParameters { inertia: 0.02, load_inertia: 1.0, load_gravity_sine: 9.81, ..Default::default() };
    drive(&mut samples, &truth, &friction(Terms::of(&[Term::Viscous, Term::Coulomb])), 0.01, 9);
    let model = RigidModel { gravity: Gravity::Sine, mass_and_length: true, ..RIGID };
    let found = identify(&mut samples, &model, Preset::Nscf, &Options::default()).unwrap();
    for (symbol, value) in [("I", 0.02), ("g_s", 0.0), ("I_ml2", 1.0), ("g_s,ml", 9.81)] {
        let e = of(&found, symbol);
        assert!((e.value - value).abs() < 3.0 * e.standard_error.unwrap(), "{e:?}");
    }
}

#[test]
fn data_that_cannot_be_used_are_refused_with_the_reason() {
    let fails = |change: fn(&mut Samples), model: RigidModel, preset| {
        let mut samples = joint(2_000);
        change(&mut samples);
        identify(&mut samples, &model, preset, &Options::default()).unwrap_err()
    };
    let cv = Preset::CoulombViscous;
    let error = fails(|s| s.velocity[3] = f64::INFINITY, RIGID, cv);
    assert_eq!(error, IdentifyError::NotFinite { column: "velocity", index: 3, value: f64::INFINITY });
    let error = fails(|s| s.effort.truncate(1_999), RIGID, cv);
    assert_eq!(error, IdentifyError::Length { column: "effort", found: 1_999, expected: 2_000 });
    let error = fails(|_| (), RigidModel { mass_and_length: true, ..RIGID }, cv);
    assert_eq!(error, IdentifyError::MissingColumn { column: "mass" });
    let error = fails(|s| s.part.iter_mut().skip(50).for_each(|p| *p = Part::Unused), RIGID, cv);
    assert_eq!(error, IdentifyError::TooFewSamples { found: 50, needed: 200 });
    let few = |s: &mut Samples| s.part.iter_mut().skip(220).for_each(|p| *p = Part::Unused);
    assert_eq!(fails(few, RIGID, Preset::Full), IdentifyError::TooFewFolds { found: 220, folds: 0 });
}
