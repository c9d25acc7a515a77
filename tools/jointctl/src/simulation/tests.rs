//! The simulation as a whole. Parts are short: every second of motion is 20,000 control steps.

use super::motion::Sweep;
use super::table::{Line, table};
use super::*;
use friction_compensation::compensation::Request;
use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::{Domain, Range};
use friction_compensation::friction::physical::PhysicalParameters;
use friction_compensation::friction::regime::Selector;
use friction_compensation::friction::state::SIGNALS;
use friction_compensation::friction::{FrictionModel, FrictionParameters, ParameterSet};
use identification::friction_model::{Directional, FrictionModel as FloatModel, Term, Terms};
use identification::quantize::physical::quantize;
use joint_firmware::joint::fault::Fault;
use joint_firmware::motor::angle::ElectricalAngle;
use plant::ActuatorParameters;
use plant::excitation::{Segment, Trajectory};
use plant::virtual_joint::Setup;
use rayon::prelude::*;

/// The reference joint with friction that depends on velocity alone.
fn plain() -> ActuatorParameters {
    let mut plant = ActuatorParameters::reference().aligned();
    plant.joint = plant.joint.with_plain_friction();
    plant
}

/// Coulomb and viscous friction as that joint has them.
fn its_friction(plant: &ActuatorParameters) -> FrictionModel {
    let friction = &plant.joint.friction;
    let both = |value| Directional { positive: value, negative: value };
    let model = FloatModel {
        terms: Terms::of(&[Term::Viscous, Term::Coulomb]),
        viscous: friction.viscous.forward,
        coulomb: both(friction.coulomb.forward),
        coulomb_slope: 200.0,
        ..FloatModel::default()
    };
    let range = Range { low: -(16 << 16), high: 16 << 16 };
    let domain = Domain { ranges: [range; SIGNALS], margin: 8 << 16, reference_temperature: 25 << 16 };
    let physical = quantize(&model, &domain).unwrap();
    let nothing = ParameterSet { physical: PhysicalParameters::default(), network: None };
    let mut sets = [nothing; 4];
    sets[0].physical = physical;
    let selector = Selector { criteria: [None, None], fade_time: 0 };
    FrictionModel::new(&FrictionParameters { domain, selector, common: CommonTerms::NONE, sets }, 20_000)
}

/// Two seconds of a sweep that reverses a few times.
fn short(plant: &ActuatorParameters) -> Part {
    Part::new("short", plant, Motion::Sweep(Sweep { amplitude: 0.1, frequency: (0.5, 2.0), duration: 2.0 }))
}

#[test]
fn every_scenario_runs_to_its_end_on_the_reference_joint() {
    let plant = ActuatorParameters::reference().aligned();
    let setup = Setup::of(&plant);
    Scenario::ALL.into_par_iter().for_each(|scenario| {
        for part in scenario.parts(&plant, 1, None).unwrap() {
            let choices = Choices::default();
            let done = run(&part, &setup, None, &choices).unwrap();
            assert_eq!(done.ending, Ending::Whole, "{} {}: {}", scenario.name(), part.name, done.ending);
            let expected = part.motion.duration() / choices.sample_period;
            assert!((done.log.rows.len() as f64 - expected).abs() <= 1.0, "{} {expected}", done.log.rows.len());
            if part.tracks {
                let worst = done.log.rows.iter().map(|row| row.position_error().abs()).fold(0.0, f64::max);
                assert!(worst < 0.1, "{} {}: {worst} rad away", scenario.name(), part.name);
            }
        }
    });
}

#[test]
fn references_of_any_joint_stay_within_its_limits_and_begin_at_rest_at_zero() {
    for seed in 0..20 {
        let plant = ActuatorParameters::randomised(seed).aligned();
        for scenario in Scenario::ALL {
            for part in scenario.parts(&plant, seed, None).unwrap() {
                let Some(first) = part.motion.reference(0.0) else { continue };
                assert!(first.position.abs() + first.velocity.abs() < 1e-9, "{scenario:?} {first:?}");
                let limits = &part.plant.joint.limits;
                for n in 0..=2000 {
                    let at = part.motion.reference(part.motion.duration() * f64::from(n) / 2000.0).unwrap();
                    // The reference of the contact lies in the wall.
                    assert!(!part.tracks || at.position.abs() <= 1.001 * limits.travel, "{scenario:?} {at:?}");
                    assert!(at.velocity.abs() <= 1.001 * limits.speed, "{scenario:?} {at:?}");
                }
            }
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_log_and_another_one_other_noise() {
    let plant = plain();
    let part =
        Part::new("rest", &plant, Motion::Trajectory(Trajectory::new(vec![Segment::Rest { duration: 0.1 }]).unwrap()));
    let log = |seed| run(&part, &Setup::of(&plant), None, &Choices { seed, ..Choices::default() }).unwrap().log;
    assert_eq!(log(3), log(3));
    assert_ne!(log(3), log(4));
    assert_eq!(log(3).rows.len(), 25);
}

#[test]
fn compensation_by_the_right_model_brings_the_joint_and_the_torque_closer() {
    let plant = plain();
    let model = its_friction(&plant);
    let setup = Setup::of(&plant);
    let judged = |request, model| {
        let done = run(&short(&plant), &setup.compensating(request), model, &Choices::default()).unwrap();
        assert_eq!(done.ending, Ending::Whole);
        judge([(true, &done.log)], 0.01).unwrap()
    };
    let off = judged(Request::Off, Some(&model));
    let on = judged(Request::Physical, Some(&model));
    let torque = |judged: &Judgement| judged.torque_error_in_motion.unwrap();
    println!("{off:?}\n{on:?}");
    assert!(on.position_rms.unwrap() < 0.5 * off.position_rms.unwrap(), "{off:?} {on:?}");
    assert!(torque(&on) < 0.5 * torque(&off), "{off:?} {on:?}");
    assert_eq!(judged(Request::Physical, None), off, "without a model nothing is added");
}

#[test]
fn a_joint_that_is_configured_wrongly_stops_and_says_why() {
    let plant = plain();
    let mut setup = Setup::of(&plant);
    // Half an electrical turn: every torque pushes the other way.
    setup.configuration.motor.alignment.electrical_zero = ElectricalAngle(1 << 31);
    let done = run(&short(&plant), &setup, None, &Choices::default()).unwrap();
    let Ending::Stopped { time, faults, .. } = done.ending else { panic!("{:?}", done.ending) };
    assert!(time < 2.0 && faults.iter().count() > 0);
    assert!(done.ending.to_string().contains(&faults.iter().map(|f: Fault| f.to_string()).next().unwrap()));

    let shown = table(&[Line {
        scenario: "sine-sweep",
        compensated: false,
        judgement: Judgement::default(),
        part: Some("short"),
        ending: done.ending,
    }]);
    assert!(shown.contains("sine-sweep/short, compensation off: stopped after"), "{shown}");
}

#[test]
fn a_wall_is_held_with_the_torque_that_the_spring_into_it_asks_for() {
    let plant = plain().without_payload();
    let setup = Setup::of(&plant);
    let part = &Scenario::ImpedanceContact.parts(&plant, 1, None).unwrap()[0];
    let log = run(part, &setup, None, &Choices::default()).unwrap().log;
    let pressed = log.rows.iter().map(|row| row.true_load_torque).fold(0.0, f64::max);
    let asked = 0.25 * plant.joint.motor.torque_limit();
    let friction = plant.joint.friction.breakaway.forward;
    assert!((pressed - asked).abs() < friction + 0.05 * asked, "{pressed} Nm pressed, {asked} Nm asked");
}

#[test]
fn the_table_has_a_row_without_and_one_with_compensation() {
    let line = |compensated, position_rms| Line {
        scenario: "slow-reversal",
        compensated,
        judgement: Judgement { position_rms, ..Judgement::default() },
        part: None,
        ending: Ending::Whole,
    };
    let shown = table(&[line(false, Some(0.0021)), line(true, Some(0.0004)), line(true, None)]);
    let lines: Vec<&str> = shown.lines().collect();
    assert_eq!(lines.len(), 5, "{shown}");
    assert!(lines[2].starts_with("slow-reversal  off") && lines[2].contains("2.100"), "{shown}");
    assert!(lines[3].starts_with("slow-reversal  on") && lines[3].contains("0.4000"), "{shown}");
    assert!(lines[4].ends_with('–'), "{shown}");
}

#[test]
fn a_row_that_was_outside_the_trained_box_says_so_and_one_just_inside_the_limit_does_not() {
    let line = |compensated, faded| Line {
        scenario: "hot-and-cold",
        compensated,
        judgement: Judgement { faded, ..Judgement::default() },
        part: Some("hot"),
        ending: Ending::Whole,
    };
    let shown = table(&[line(true, 83.0)]);
    assert!(shown.contains("hot-and-cold/hot  faded"), "{shown}");
    assert!(shown.contains("outside the image's trained box in 83 % of the motion"), "{shown}");
    assert!(line(true, 5.1).faded().is_some() && line(true, 5.0).faded().is_none());
    assert!(line(false, 83.0).faded().is_none());
}
