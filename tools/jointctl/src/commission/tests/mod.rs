//! Commissioning against a simulated actuator, in virtual time.

mod bench;

use super::bench::{Bench, Stopped};
use super::{Failure, Found, Guide, Plan, Stage, commission, find_index};
use bench::{RATE, Simulated};
use joint_firmware::objects::settings::Setting;
use plant::ActuatorParameters;
use plant::actuator::windings::PhaseOrder;
use plant::actuator::{Fault, Phase};
use std::f64::consts::TAU;

/// Says yes, and remembers.
#[derive(Default)]
struct Yes {
    stages: Vec<Stage>,
    found: Vec<String>,
    questions: Vec<String>,
    /// Says no to this question, counted from 1.
    no: usize,
}

impl Guide for Yes {
    fn stage(&mut self, stage: Stage) {
        self.stages.push(stage);
    }

    fn found(&mut self, text: &str) {
        self.found.push(text.into());
    }

    fn agrees(&mut self, question: &str) -> bool {
        self.questions.push(question.into());
        self.questions.len() != self.no
    }
}

/// The reference without a payload and without dead time, which nothing here compensates.
fn parameters() -> ActuatorParameters {
    let mut parameters = ActuatorParameters::reference().without_payload();
    parameters.inverter.dead_time = 0.0;
    parameters
}

fn plan() -> Plan {
    Plan { travel: 1.0, ..Plan::new(8.0) }
}

fn found(bench: &mut Simulated, plan: &Plan) -> Found {
    let mut yes = Yes::default();
    commission(bench, plan, &mut yes).unwrap_or_else(|failure| panic!("{failure}\n{:#?}", yes.found))
}

fn failure(parameters: ActuatorParameters, plan: &Plan) -> Failure {
    let mut bench = Simulated::new(parameters);
    let failure = commission(&mut bench, plan, &mut Yes::default()).expect_err("nothing failed");
    assert!(!bench.on, "the bridge is on after {failure}");
    failure
}

/// Direction and electrical zero as they really are.
fn truth(parameters: &ActuatorParameters) -> (bool, f64) {
    let ActuatorParameters { windings, sensors, .. } = parameters;
    let phases = if windings.phase_order == PhaseOrder::Exchanged { -1.0 } else { 1.0 };
    let direction = if sensors.encoder.reversed { -phases } else { phases };
    let zero = direction * windings.pole_pairs as f64 * sensors.encoder.zero - phases * windings.electrical_zero / TAU;
    (direction < 0.0, zero)
}

fn degrees(found: f64, exact: f64) -> f64 {
    360.0 * super::estimate::wrapped(found - exact)
}

fn is_right(found: &Found, parameters: &ActuatorParameters) {
    winding_and_encoder_are_right(found, parameters);
    let (constant, exact) = (found.alignment.torque_constant().value, parameters.joint.motor.torque_constant);
    assert!((constant / exact - 1.0).abs() < 0.05, "torque constant: {constant} of {exact}");
}

fn winding_and_encoder_are_right(found: &Found, parameters: &ActuatorParameters) {
    let ActuatorParameters { joint, windings, inverter, .. } = parameters;
    let resistance = joint.motor.resistance / 1.5 + inverter.on_resistance;
    let near = |what: &str, value: f64, exact: f64, part: f64| {
        assert!((value / exact - 1.0).abs() < part, "{what}: {value} of {exact}");
    };
    near("resistance", found.resistance.resistance.value, resistance, 0.03);
    near("inductance d", found.inductance.d.value, windings.inductance_d, 0.03);
    near("inductance q", found.inductance.q.value, windings.inductance_q, 0.03);
    let (reversed, zero) = truth(parameters);
    assert_eq!((found.alignment.pole_pairs as usize, found.alignment.reversed), (windings.pole_pairs, reversed));
    let error = degrees(found.alignment.zero.value, zero);
    assert!(error.abs() < 1.5, "{error}°, {:?}", found.alignment);
}

#[test]
fn a_motor_is_found_as_it_is_whichever_way_it_is_wired_and_its_encoder_counts() {
    for (reversed, phase_order, zero) in [
        (false, PhaseOrder::Forward, 0.31),
        (true, PhaseOrder::Forward, 0.9),
        (false, PhaseOrder::Exchanged, 0.0),
        (true, PhaseOrder::Exchanged, 0.55),
    ] {
        let mut parameters = parameters();
        (parameters.sensors.encoder.reversed, parameters.sensors.encoder.zero) = (reversed, zero);
        parameters.windings.phase_order = phase_order;
        let mut bench = Simulated::new(parameters);
        let found = found(&mut bench, &plan());
        is_right(&found, &parameters);
        assert!(bench.stored && !bench.on);
        assert!(bench.highest_current < 1.45 * plan().current, "{} A", bench.highest_current);
    }
}

#[test]
fn an_encoder_with_an_index_is_led_to_it_and_its_zero_is_relative_to_it() {
    for (start, reversed) in [(0x1234_5678, false), (0x8000_0000, true), (0xFFFF_0000, false)] {
        let mut parameters = parameters();
        parameters.sensors.encoder.reversed = reversed;
        let mut bench = Simulated::new(parameters);
        (bench.incremental, bench.start) = (true, start);
        let found = found(&mut bench, &plan());
        is_right(&found, &parameters);
        assert!(bench.window(false).unwrap().referenced);
    }
}

#[test]
fn what_dead_time_takes_shows_as_lost_voltage_and_not_as_resistance() {
    let mut parameters = parameters();
    parameters.inverter.dead_time = 5e-7;
    let found = found(&mut Simulated::new(parameters), &plan());
    winding_and_encoder_are_right(&found, &parameters);
    let lost = 5e-7 * RATE * parameters.bus.source_voltage;
    assert!((found.resistance.lost.value / lost - 1.0).abs() < 0.1, "{} of {lost} V", found.resistance.lost.value);
}

#[test]
fn the_index_alone_is_found_with_the_constants_that_are_stored() {
    let mut bench = Simulated::new(parameters());
    (bench.incremental, bench.start) = (true, 0x4000_0000);
    bench.set(&[(Setting::Resistance, 0.205), (Setting::TorqueConstant, 0.09)]).unwrap();
    let mut yes = Yes::default();
    let index = find_index(&mut bench, &plan(), &mut yes).unwrap();
    assert!(index.turns > 0.0 && index.turns < 1.1, "{index:?}");
    assert_eq!(yes.stages, [Stage::Checks, Stage::Index]);
    assert!(!bench.on);
    let again = find_index(&mut bench, &plan(), &mut yes).unwrap();
    assert_eq!(again.turns, 0.0);
}

#[test]
fn an_index_that_is_not_there_ends_within_its_bounds() {
    let mut bench = Simulated::new(parameters());
    (bench.incremental, bench.start) = (true, 0x4000_0000);
    // It has no index: the turn's end is never reached by what counts.
    bench.event = Some(|bench| bench.forget_index());
    let failure = commission(&mut bench, &plan(), &mut Yes::default()).unwrap_err();
    let Failure::IndexNotMet { turns, limit } = failure else { panic!("{failure}") };
    assert!(turns[0] > 1.0 && turns[0] < limit + 0.05 && turns[1] > 1.0 && turns[1] < limit + 0.05, "{failure}");
    assert!(!bench.on);
}

#[test]
fn every_stage_comes_in_its_order_and_no_question_is_asked_under_current() {
    struct Watched<'b>(&'b mut Yes);
    impl Guide for Watched<'_> {
        fn stage(&mut self, stage: Stage) {
            self.0.stage(stage);
        }
        fn found(&mut self, text: &str) {
            self.0.found(text);
        }
        fn agrees(&mut self, question: &str) -> bool {
            self.0.agrees(question)
        }
    }
    let mut bench = Simulated::new(parameters());
    let mut yes = Yes::default();
    let found = commission(&mut bench, &plan(), &mut Watched(&mut yes)).unwrap();
    use Stage::*;
    assert_eq!(yes.stages, [Checks, Resistance, Inductance, FirstSweep, Alignment, Settings, Turning]);
    assert_eq!(yes.questions.len(), 4);
    assert!(found.turned.is_some_and(|turned| turned.velocity[0] > 0.0 && turned.velocity[1] < 0.0));
    // `Simulated` counts the control steps with the bridge on; a no leaves it off and the settings as they were.
    for no in 1..=4 {
        let mut bench = Simulated::new(parameters());
        let before = bench.setting(Setting::PolePairs).unwrap();
        let mut yes = Yes { no, ..Yes::default() };
        let declined = commission(&mut bench, &Plan { current_limit: Some(11.0), ..plan() }, &mut yes);
        assert_eq!(declined, Err(Failure::Declined));
        assert!(!bench.on);
        if no < 4 {
            assert_eq!(bench.setting(Setting::CurrentLimit), Ok(20.0), "question {no}");
            assert_eq!(bench.setting(Setting::PolePairs), Ok(before));
        }
    }
}

#[test]
fn a_host_that_hesitates_when_the_field_turns_round_counts_right_or_says_that_it_is_late() {
    let mut late = 0;
    for milliseconds in (0..95).step_by(7) {
        let mut bench = Simulated::new(parameters());
        bench.hesitates = 1e-3 * f64::from(milliseconds);
        match commission(&mut bench, &plan(), &mut Yes::default()) {
            Ok(found) => winding_and_encoder_are_right(&found, &parameters()),
            Err(failure) => {
                assert_eq!(failure, Failure::Stopped(Stopped::Late), "{milliseconds} ms");
                late += 1;
            }
        }
    }
    assert!((1..8).contains(&late), "{late} of 14 were late");
}

#[test]
fn a_host_that_is_late_once_repeats_the_part_and_one_that_is_late_again_and_again_is_told() {
    let mut bench = Simulated::new(parameters());
    bench.late_at = Some(20_000);
    is_right(&found(&mut bench, &plan()), &parameters());
    let mut bench = Simulated::new(parameters());
    bench.event = Some(|bench| {
        if bench.on && bench.late_at.is_none() {
            bench.late_at = Some(bench.step + 500);
        }
    });
    let failure = commission(&mut bench, &plan(), &mut Yes::default()).unwrap_err();
    assert_eq!(failure, Failure::Stopped(Stopped::Late));
}

#[test]
fn an_open_phase_is_named() {
    for (phase, name) in [(Phase::A, None), (Phase::B, Some('B')), (Phase::C, Some('C'))] {
        let mut bench = Simulated::new(parameters());
        bench.actuator.inject(Fault::PhaseOpen(phase)).unwrap();
        let failure = commission(&mut bench, &plan(), &mut Yes::default()).unwrap_err();
        match name {
            None => assert!(matches!(failure, Failure::NoCurrent { .. }), "{failure}"),
            Some(name) => {
                assert!(matches!(failure, Failure::PhaseOpen { phase, .. } if phase == name), "{phase:?}: {failure}");
            }
        }
        assert!(!bench.on);
    }
}

#[test]
fn sensors_of_the_wrong_sign_or_gain_are_told() {
    let mut parameters = parameters();
    parameters.sensors.currents.gain_error = [0.0, 0.2, -0.2];
    let failure = failure(parameters, &plan());
    assert!(matches!(failure, Failure::CurrentAside { .. }), "{failure}");
}

#[test]
fn a_current_that_the_supply_cannot_drive_is_told_with_the_current_that_flows() {
    let mut parameters = parameters();
    parameters.joint.motor.resistance = 6.0;
    let failure = failure(parameters, &plan());
    assert!(
        matches!(failure, Failure::CurrentNotReached { current, wanted: 8.0, .. } if current > 3.0 && current < 5.0),
        "{failure}"
    );
}

#[test]
fn a_blocked_rotor_is_told() {
    let mut bench = Simulated::new(parameters());
    bench.actuator.inject(Fault::LoadBlocked).unwrap();
    let failure = commission(&mut bench, &plan(), &mut Yes::default()).unwrap_err();
    assert!(matches!(failure, Failure::RotorDidNotMove { turns, .. } if turns.abs() < 0.01), "{failure}");
}

#[test]
fn another_number_of_pole_pairs_than_the_data_sheet_s_is_told() {
    let failure = failure(parameters(), &Plan { pole_pairs: Some(14), ..plan() });
    assert_eq!(failure, Failure::PolePairs { counted: 7, expected: 14 });
}

#[test]
fn a_load_that_the_current_hardly_turns_is_told_by_the_rotor_s_lag() {
    let mut parameters = parameters();
    // 0.72 Nm of holding torque at the rotor, 36 Nm at the joint.
    let friction = &mut parameters.joint.friction;
    for part in [&mut friction.coulomb, &mut friction.breakaway] {
        (part.forward, part.backward) = (33.0, 33.0);
    }
    let failure = failure(parameters, &plan());
    let lags = |failure: &Failure| {
        matches!(
            failure,
            Failure::LagTooLarge { .. }
                | Failure::RotorBesideField { .. }
                | Failure::RotorDidNotMove { .. }
                | Failure::RotorSlipped { .. }
                | Failure::PolePairsUnclear { .. }
        )
    };
    assert!(lags(&failure), "{failure}");
}

#[test]
fn a_load_that_pulls_the_rotor_beside_the_field_is_told_by_the_zero_with_less_current() {
    let mut bench = Simulated::new(parameters());
    // 0.2 of 0.72 Nm at the rotor: 16 degrees, with 60 % of the current 28.
    bench.event = Some(|bench| {
        if bench.is_turning() && bench.actuator.faults().external_torque == 0.0 {
            bench.actuator.inject(Fault::ExternalTorque(10.0)).unwrap();
        }
    });
    let failure = commission(&mut bench, &plan(), &mut Yes::default()).unwrap_err();
    let Failure::RotorBesideField { turns, limit } = failure else { panic!("{failure}") };
    assert!(turns.abs() > limit && turns.abs() < 2.0 * limit, "{failure}");
}

#[test]
fn a_motor_too_salient_for_the_current_is_told_by_the_rotor_s_lag() {
    let mut parameters = parameters();
    // (L_q - L_d) 8 A is 11.4 mVs, the magnet's flux linkage 8.6 mVs.
    parameters.windings.inductance_q = 1.6e-3;
    let failure = failure(parameters, &plan());
    assert!(matches!(failure, Failure::LagTooLarge { .. } | Failure::RotorBesideField { .. }), "{failure}");
}

#[test]
fn a_joint_that_is_not_fit_to_begin_is_left_alone() {
    type Spoil = fn(&mut Simulated);
    /// Returns `true` if it is the failure that was to come.
    type Expected = fn(&Failure) -> bool;
    let spoilt: [(Spoil, Expected); 6] = [
        (|b| b.condition.faults = "over-current (2310h)".into(), |f| matches!(f, Failure::Fault { .. })),
        (|b| b.condition.armed = true, |f| matches!(f, Failure::Armed { .. })),
        (|b| b.condition.staged = true, |f| matches!(f, Failure::Staged)),
        (|b| b.condition.supply = 9.9, |f| matches!(f, Failure::Supply { .. })),
        (|b| b.condition.winding = 60.5, |f| matches!(f, Failure::Hot { part: "winding", .. })),
        (|b| b.condition.bridge = 50.5, |f| matches!(f, Failure::Hot { part: "bridge", .. })),
    ];
    for (spoil, is_told) in spoilt {
        let mut bench = Simulated::new(parameters());
        spoil(&mut bench);
        let mut yes = Yes::default();
        let failure = commission(&mut bench, &plan(), &mut yes).unwrap_err();
        assert!(is_told(&failure), "{failure}");
        assert_eq!((bench.step, yes.questions.len()), (0, 0), "{failure}");
    }
    let mut bench = Simulated::new(parameters());
    (bench.condition.winding, bench.condition.bridge, bench.condition.supply) = (59.5, 49.5, 10.1);
    bench.condition.faults = "command deadline missed (8100h)".into();
    assert!(super::checks::check(&mut bench, true).is_ok());
}

#[test]
fn a_motor_that_does_not_turn_with_what_was_found_is_told() {
    let mut bench = Simulated::new(parameters());
    bench.follows = 0.1;
    let failure = commission(&mut bench, &plan(), &mut Yes::default()).unwrap_err();
    assert!(matches!(failure, Failure::DoesNotTurn { .. }), "{failure}");
    assert!(!bench.on);
}

#[test]
fn a_known_load_gives_the_torque_constant_with_which_it_agrees_whatever_friction_adds() {
    let mut bench = Simulated::new(parameters());
    (bench.load, bench.torque_gain) = ([2.0, 0.5], 1.1);
    let plan = Plan { load: Some(2.0), torque_constant: Some(0.1), ..plan() };
    let load = found(&mut bench, &plan).load.unwrap();
    assert!((load.torque_constant - 0.1 / 1.1).abs() < 1e-9, "{load:?}");
    assert!((load.measured.error - 0.55).abs() < 1e-9, "{load:?}");
}

#[test]
fn a_known_inertia_gives_the_torque_constant_with_which_it_agrees_beside_friction() {
    let mut bench = Simulated::new(parameters());
    // Friction is forty times what the inertia takes.
    (bench.swung, bench.torque_gain) = ([0.02, 0.8, 0.5], 1.1);
    let plan = Plan { inertia: Some(0.02), torque_constant: Some(0.1), ..plan() };
    let inertia = found(&mut bench, &plan).inertia.unwrap();
    assert!((inertia.torque_constant / (0.1 / 1.1) - 1.0).abs() < 0.03, "{inertia:?}");
    assert!(inertia.measured.relative() < 0.1, "{inertia:?}");
    assert!(!bench.on);
}

#[test]
fn an_inertia_that_the_torque_does_not_tell_is_no_result() {
    let mut bench = Simulated::new(parameters());
    bench.swung = [0.0, 0.8, 0.5];
    let plan = Plan { inertia: Some(0.02), torque_constant: Some(0.1), ..plan() };
    let failure = commission(&mut bench, &plan, &mut Yes::default()).unwrap_err();
    assert!(matches!(failure, Failure::InertiaUnclear { .. }), "{failure}");
    assert!(!bench.on && bench.stored);
}

#[test]
fn a_new_joint_permits_compensation_and_a_commissioned_one_keeps_what_it_permits() {
    let mut bench = Simulated::new(parameters());
    found(&mut bench, &Plan { turn: false, ..plan() });
    let [torque, velocity] = [Setting::TorqueLimit, Setting::VelocityLimit].map(|limit| bench.setting(limit).unwrap());
    let permitted = [Setting::CompensationGain, Setting::Clamp, Setting::Slew, Setting::StandstillVelocity]
        .map(|setting| bench.setting(setting).unwrap());
    assert_eq!(permitted, [0.98, 0.5 * torque, 50.0 * torque, 0.01 * velocity]);
    let mut bench = Simulated::new(parameters());
    bench.set(&[(Setting::TorqueConstant, 0.09), (Setting::Clamp, 0.7)]).unwrap();
    found(&mut bench, &Plan { turn: false, ..plan() });
    assert_eq!(bench.setting(Setting::Clamp), Ok(0.7));
}

#[test]
fn the_present_position_becomes_what_the_user_says_and_zero_on_a_new_joint() {
    let mut bench = Simulated::new(parameters());
    found(&mut bench, &Plan { zero: Some(0.2), turn: false, ..plan() });
    assert!((bench.motion().unwrap()[0] - 0.2).abs() < 1e-9);
    let mut bench = Simulated::new(parameters());
    found(&mut bench, &Plan { turn: false, ..plan() });
    assert!(bench.motion().unwrap()[0].abs() < 1e-9);
    let mut bench = Simulated::new(parameters());
    bench.set(&[(Setting::TorqueConstant, 0.09)]).unwrap();
    found(&mut bench, &Plan { turn: false, ..plan() });
    assert!((bench.motion().unwrap()[0] - 0.3).abs() < 1e-9, "a joint that was commissioned keeps its zero");
    assert_eq!(bench.setting(Setting::TorqueConstant), Ok(0.09));
}
