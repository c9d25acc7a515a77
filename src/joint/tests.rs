//! The joint as a whole, a few control steps at a time.

use super::rig::{at_rest, enabled, started};
use super::state_machine::Controlword;
use super::*;
use crate::motor::angle::TAU;

#[test]
fn a_joint_is_not_ready_before_its_encoder_knows_its_zero_and_then_begins_there() {
    let board = crate::default_configuration::B_G431B_ESC1;
    let active = board.joint.prepare(&board.bridge).unwrap();
    let mut joint = Joint::new();
    let mut step = |encoder, referenced| {
        joint.control_step(
            &active,
            &Demand::default(),
            &Slow::default(),
            &Measurements { encoder, encoder_referenced: referenced, ..at_rest(18.0) },
        );
        (joint.telemetry().state, joint.latched_faults().is_empty(), joint.telemetry().motion.position)
    };
    for _ in 0..2 * OFFSET_STEPS {
        assert_eq!(step(1 << 30, false), (State::NotReadyToSwitchOn, true, TAU / 4.0));
    }
    // The index lies an eighth of a turn back from here: no jump, but where the joint is.
    for _ in 0..100 {
        let (state, healthy, position) = step(1 << 29, true);
        assert!(state == State::SwitchOnDisabled && healthy && (position - TAU / 8.0).abs() < 1e-6, "{position}");
    }
}

#[test]
fn a_joint_looks_for_its_encoders_zero_in_the_open_loop_and_is_ready_for_nothing_else_before() {
    let board = crate::default_configuration::B_G431B_ESC1;
    let active = board.joint.prepare(&board.bridge).unwrap();
    let mut joint = Joint::new();
    let mut step = |word, mode, encoder, referenced| {
        let command = Command { mode, ..Command::default() };
        let demand = Demand { controlword: word, command, ..Demand::default() };
        joint.control_step(
            &active,
            &demand,
            &Slow::default(),
            &Measurements { encoder, encoder_referenced: referenced, ..at_rest(18.0) },
        );
        assert!(joint.latched_faults().is_empty());
        joint.telemetry().state
    };
    let off = Controlword::DISABLE_VOLTAGE;
    for _ in 0..2 * OFFSET_STEPS {
        assert_eq!(step(off, Mode::Position, 1 << 30, false), State::NotReadyToSwitchOn);
    }
    for (word, state) in [
        (off, State::SwitchOnDisabled),
        (Controlword::SHUTDOWN, State::ReadyToSwitchOn),
        (Controlword::SWITCH_ON, State::SwitchedOn),
        (Controlword::ENABLE_OPERATION, State::OpenLoop),
    ] {
        assert_eq!(step(word, Mode::OpenLoop, 1 << 30, false), state);
    }
    // The encoder's zero comes with a jump of its angle, which is none of the rotor.
    assert_eq!(step(Controlword::ENABLE_OPERATION, Mode::OpenLoop, 1 << 29, true), State::OpenLoop);
    assert_eq!(step(off, Mode::OpenLoop, 1 << 29, true), State::SwitchOnDisabled);
    assert_eq!(step(off, Mode::Position, 1 << 29, true), State::SwitchOnDisabled);
    // Without it the joint would not be ready again.
    let mut unknown = Joint::new();
    let demand = Demand { command: Command { mode: Mode::OpenLoop, ..Command::default() }, ..Demand::default() };
    for demand in [demand, Demand::default()] {
        for _ in 0..=OFFSET_STEPS {
            unknown.control_step(
                &active,
                &demand,
                &Slow::default(),
                &Measurements { encoder: 1 << 30, encoder_referenced: false, ..at_rest(18.0) },
            );
        }
    }
    assert_eq!(unknown.telemetry().state, State::NotReadyToSwitchOn);
}

#[test]
fn a_coupled_joint_that_falls_silent_counts_as_standing_after_the_command_deadline() {
    let board = crate::default_configuration::B_G431B_ESC1;
    let active = board.joint.prepare(&board.bridge).unwrap();
    let mut joint = Joint::new();
    let mut demand = Demand::default();
    assert_eq!(joint.coupled(&active, &demand), 0.0);
    demand.coupled = Coupled { velocity: -2.5, sequence: 1 };
    for _ in 0..=active.deadline_steps {
        assert_eq!(joint.coupled(&active, &demand), -2.5);
    }
    assert_eq!(joint.coupled(&active, &demand), 0.0);
    demand.coupled.sequence = 2;
    assert_eq!(joint.coupled(&active, &demand), -2.5);
}

#[test]
fn before_the_first_step_telemetry_tells_nothing() {
    assert_eq!(Joint::new().telemetry(), Telemetry::NOTHING);
    assert_eq!(Telemetry::NOTHING.motion, JointMotion::default());
}

/// Wanted current as a part of the current limit at a temperature of the bridge, and faults, in "operation enabled" and
/// while braking.
fn derated(bridge_temperature: f32, winding: f32, sensor: bool) -> (f32, Faults) {
    let mut board = crate::default_configuration::B_G431B_ESC1;
    board.bridge.has_bridge_sensor = sensor;
    let active = board.joint.prepare(&board.bridge).unwrap();
    let mut joint = started(&active);
    let demand = enabled(&mut joint, &active, 1.0, &at_rest(18.0));
    let measured = Measurements { bridge_temperature, ..at_rest(18.0) };
    let slow = Slow { derating: winding, ..Slow::default() };
    // A round of the motion loop: in it the torque is bounded anew.
    for _ in 0..10 {
        joint.control_step(&active, &demand, &slow, &measured);
        if !joint.latched_faults().is_empty() {
            break;
        }
    }
    (joint.telemetry().reference.q / active.current_limit, joint.telemetry().faults)
}

#[test]
fn the_current_falls_in_a_line_over_the_last_20_k_of_the_bridge() {
    let limit = crate::default_configuration::B_G431B_ESC1.joint.limits.bridge_temperature;
    for (below, expected) in
        [(100.0, 1.0), (20.01, 1.0), (20.0, 1.0), (19.8, 0.99), (10.0, 0.5), (1.0, 0.05), (0.01, 0.000_5)]
    {
        let (part, faults) = derated(limit - below, 1.0, true);
        assert!((part - expected).abs() < 1e-4 && faults.is_empty(), "{below} K below: {part}, {faults:?}");
    }
    for above in [0.0, 0.01, 50.0] {
        let (_, faults) = derated(limit + above, 1.0, true);
        assert!(faults.iter().eq([Fault::BridgeTemperature]), "{above} K above: {faults:?}");
    }
}

#[test]
fn of_winding_and_bridge_the_hotter_counts_and_only_the_winding_is_called_so() {
    let limit = crate::default_configuration::B_G431B_ESC1.joint.limits.bridge_temperature;
    for (below, winding, expected) in [(10.0, 0.25, 0.25), (5.0, 0.5, 0.25), (30.0, 0.75, 0.75)] {
        let (part, faults) = derated(limit - below, winding, true);
        assert!((part - expected).abs() < 1e-4 && faults.is_empty(), "{below} K, {winding}: {part}, {faults:?}");
    }
    let (_, faults) = derated(25.0, 0.0, true);
    assert!(faults.iter().eq([Fault::WindingTemperature]), "{faults:?}");
}

#[test]
fn a_bridge_without_a_sensor_does_not_derate() {
    assert_eq!(derated(f32::NAN, 1.0, false), (1.0, Faults::NONE));
    assert_eq!(derated(f32::NAN, 0.5, false), (0.5, Faults::NONE));
}

#[test]
fn a_joint_that_holds_waits_for_its_master_and_one_that_follows_does_not() {
    let board = crate::default_configuration::B_G431B_ESC1;
    let active = board.joint.prepare(&board.bridge).unwrap();
    let mut joint = started(&active);
    let measured = at_rest(18.0);
    let mut demand = enabled(&mut joint, &active, 0.0, &measured);
    demand.command.mode = Mode::Hold;
    for _ in 0..2 * active.deadline_steps {
        joint.control_step(&active, &demand, &Slow::default(), &measured);
        assert_eq!(joint.telemetry().state, State::OperationEnabled);
    }
    demand.command.mode = Mode::Position;
    for _ in 0..active.deadline_steps {
        joint.control_step(&active, &demand, &Slow::default(), &measured);
        assert_eq!(joint.telemetry().state, State::OperationEnabled);
    }
    joint.control_step(&active, &demand, &Slow::default(), &measured);
    assert!(joint.latched_faults().contains(Fault::StaleCommand));
}

#[test]
fn a_joint_that_bears_a_load_goes_on_bearing_it_from_mode_to_mode() {
    let mut board = crate::default_configuration::B_G431B_ESC1;
    board.joint.gains.integral = 10.0;
    let active = board.joint.prepare(&board.bridge).unwrap();
    let mut law = motion_law::MotionLaw::default();
    let motion = JointMotion { position: 0.25, ..JointMotion::default() };
    let command = |mode| Command { mode, position: 0.25, ..Command::default() };
    // Pulled away from its reference for a while, so that the integral bears something.
    law.step(&active, &command(Mode::Hold), &motion, 1.0);
    let pulled = JointMotion { position: 0.249, ..motion };
    let mut last = (0..2_000).map(|_| law.step(&active, &command(Mode::Hold), &pulled, 1.0).torque).last().unwrap();
    let spring = active.motion.stiffness * (0.25 - 0.249);
    assert!(last > 1.02 * spring, "{last} Nm, {spring} Nm of them by the spring");
    for mode in [Mode::Position, Mode::Hold, Mode::Position] {
        let torque = law.step(&active, &command(mode), &pulled, 1.0).torque;
        assert!((torque - last).abs() < 0.01 * last, "{mode:?}: {last} Nm, then {torque} Nm");
        last = torque;
    }
    // Velocity mode knows no spring; the integral stays.
    let integral = law.step(&active, &command(Mode::Velocity), &pulled, 1.0).torque;
    assert!((integral - (last - spring)).abs() < 0.02 * spring, "{integral} Nm of {last} Nm");
    let held = law.step(&active, &command(Mode::Hold), &pulled, 1.0).torque;
    assert!((held - integral).abs() < 0.02 * spring, "{integral} Nm, then {held} Nm");
    // Torque mode has none: what follows it begins anew.
    law.step(&active, &command(Mode::Torque), &pulled, 1.0);
    assert_eq!(law.step(&active, &command(Mode::Hold), &pulled, 1.0).torque, 0.0);
}

#[test]
fn the_torque_that_is_reported_is_a_mean_over_a_millisecond_and_not_what_a_tooth_of_a_saw_holds() {
    let board = crate::default_configuration::MOTEUS_R4;
    let mut active = board.joint.prepare(&board.bridge).unwrap();
    active.scales.torque_per_current = 1.0;
    let steps = active.adaptation.mean_steps;
    assert_eq!(steps, 40);
    let mut mean = MeanTorque::default();
    for n in 0..10 * steps {
        let before = mean.mean();
        // From 3 to 5 Nm in each millisecond.
        mean.add(&active, 3.0 + 2.0 * (n % steps) as f32 / (steps - 1) as f32);
        let done = (n + 1) % steps == 0;
        assert!(done || mean.mean() == before);
        assert!(!done || (mean.mean() - 4.0).abs() < 1e-5, "{}", mean.mean());
    }
}
