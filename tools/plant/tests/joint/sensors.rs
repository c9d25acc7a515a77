//! Every sensor of the joint broken in every way, as the table in docs/faults.md says; and where nothing can show, what
//! comes of it.

use crate::rig::table::{SensorRow, documented_sensors};
use crate::rig::{Rig, break_down, position, reference, velocity};
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::State;
use joint_firmware::motor::thermal::WindingTemperature;
use plant::actuator::{ActuatorParameters, Channel, Failure, Fault as Broken};
use plant::thermal::Heat;
use plant::virtual_joint::Setup;

/// Time for which a joint whose failure does not show is watched, s.
const WATCHED: f64 = 0.4;

/// Failure of a row: for good, or an offset in every other step.
enum Breakage {
    Lasting(Failure),
    Jumping(f64),
}

fn breakage(text: &str) -> Breakage {
    let mut words = text.split_whitespace();
    let name = words.next().unwrap_or_default();
    let size = words.next().map(|size| size.parse().unwrap());
    match (name, size) {
        ("stuck", None) => Breakage::Lasting(Failure::Stuck),
        ("open", None) => Breakage::Lasting(Failure::Open),
        ("shorted", None) => Breakage::Lasting(Failure::Shorted),
        ("offset", Some(size)) => Breakage::Lasting(Failure::Offset(size)),
        ("noisy", Some(size)) => Breakage::Lasting(Failure::Noisy(size)),
        ("jumping", Some(size)) => Breakage::Jumping(size),
        other => panic!("unknown failure {other:?}"),
    }
}

fn channels(sensor: &str) -> Vec<Channel> {
    match sensor {
        "phase current" => vec![Channel::CurrentA, Channel::CurrentB, Channel::CurrentC],
        "encoder" => vec![Channel::Encoder],
        "supply" => vec![Channel::BusVoltage],
        "winding thermistor" => vec![Channel::WindingTemperature],
        "bridge thermistor" => vec![Channel::BridgeTemperature],
        other => panic!("unknown sensor {other:?}"),
    }
}

fn moving() -> Rig {
    Rig::following(velocity(1.0), 0.4)
}

fn at_rest() -> Rig {
    Rig::following(position(0.6), 1.2)
}

fn break_sensor(rig: &mut Rig, channel: Channel, breakage: &Breakage) {
    match breakage {
        Breakage::Lasting(failure) => break_down(rig, Broken::Sensor(channel, *failure)),
        Breakage::Jumping(size) => {
            let (start, period) = (rig.joint.actuator().state().time, rig.joint.period());
            for n in 0..rig.steps_in(WATCHED / 2.0) {
                let from = start + 2.0 * f64::from(n) * period;
                // Half a period either side of the control step that is to see it.
                let jump = Broken::Sensor(channel, Failure::Offset(*size));
                rig.joint.actuator_mut().schedule(jump, (from - 0.5 * period).max(start), from + 0.5 * period).unwrap();
            }
        }
    }
}

fn behaves_as_documented(row: &SensorRow, channel: Channel, mut rig: Rig) {
    let name = format!("{channel:?} {} {}", row.failure, row.motion);
    rig.worst_torque = 0.0;
    let (start, speed) = (rig.position(), rig.velocity());
    break_sensor(&mut rig, channel, &breakage(row.failure));
    match row.fault {
        Some((faults, steps)) => {
            let found = rig.steps_to_fault(steps);
            assert!(found.is_some(), "{name}: nothing in {steps} steps");
            let expected: Vec<&str> = faults.split(" or ").collect();
            for fault in rig.latched() {
                assert!(expected.contains(&format!("{fault:?}").as_str()), "{name}: {:?}", rig.latched());
            }
            // To its end: braking takes a second at most.
            rig.run(1.1);
            assert_eq!((rig.state(), rig.is_switching()), (State::Fault, false), "{name}");
        }
        None => {
            assert_eq!(rig.steps_to_fault(rig.steps_in(WATCHED)), None, "{name}: {:?}", rig.latched());
            assert_eq!(rig.state(), State::OperationEnabled, "{name}");
            let (way, slower) = (rig.position() - start - speed * WATCHED, rig.velocity() - speed);
            assert!(way.abs() < 0.01 && slower.abs() < 0.1, "{name}: {way} rad, {slower} rad/s off");
        }
    }
    assert!(rig.worst_torque < 1.05 * rig.torque_limit(), "{name}: {} Nm", rig.worst_torque);
}

#[test]
fn every_sensor_broken_in_every_way_does_what_the_table_says() {
    let (moving, at_rest) = (moving(), at_rest());
    for row in documented_sensors() {
        let rigs = match row.motion {
            "moving" => vec![&moving],
            "at rest" => vec![&at_rest],
            "any" => vec![&moving, &at_rest],
            other => panic!("unknown motion {other:?}"),
        };
        for channel in channels(row.sensor) {
            rigs.iter().for_each(|rig| behaves_as_documented(&row, channel, (*rig).clone()));
        }
    }
}

#[test]
fn the_table_has_every_failure_of_every_sensor_in_motion_and_at_rest() {
    let rows = documented_sensors();
    let mut documented: Vec<Channel> = vec![];
    for sensor in ["phase current", "encoder", "supply", "winding thermistor", "bridge thermistor"] {
        documented.extend(channels(sensor));
        for failure in ["stuck", "open", "shorted", "offset", "noisy", "jumping"] {
            for motion in ["moving", "at rest"] {
                let is_there = |row: &SensorRow| {
                    row.sensor == sensor
                        && row.failure.starts_with(failure)
                        && (row.motion == motion || row.motion == "any")
                };
                assert!(rows.iter().any(is_there), "{sensor} {failure} {motion}");
            }
        }
    }
    assert_eq!(documented, Channel::ALL);
}

#[test]
fn a_joint_whose_encoder_stuck_at_rest_stays_within_one_and_a_half_electrical_turns() {
    for command in [velocity(1.0), velocity(-0.3), position(-1.0)] {
        let mut rig = Rig::following(position(0.0), 0.3);
        let parameters = *rig.joint.actuator().parameters();
        break_down(&mut rig, Broken::Sensor(Channel::Encoder, Failure::Stuck));
        rig.run(0.05);
        let start = rig.position();
        rig.demand.command = command;
        let turn = std::f64::consts::TAU / (parameters.windings.pole_pairs as f64 * parameters.joint.motor.gear_ratio);
        let mut furthest = 0f64;
        for _ in 0..rig.steps_in(1.0) {
            rig.step();
            furthest = furthest.max((rig.position() - start).abs());
        }
        assert!(furthest < 1.5 * turn, "{command:?}: {} turns", furthest / turn);
        assert!(rig.latched().iter().all(|fault| *fault == Fault::EncoderImplausible), "{:?}", rig.latched());
        assert!(rig.worst_torque < 1.05 * rig.torque_limit(), "{command:?}: {} Nm", rig.worst_torque);
    }
}

/// Half the speed limit, then the encoder sticks. Of 300 joints 284 notice it in 8,000 steps; a rotor that the field
/// holds still contradicts nothing. Which of the two names it gets depends on how well the current follows.
#[test]
fn an_encoder_that_sticks_in_motion_is_found_on_random_joints() {
    let mut steps = vec![];
    for seed in 0..40 {
        let parameters = ActuatorParameters::randomised(seed).aligned();
        let mut rig = Rig::enabled(parameters, &Setup::of(&parameters));
        rig.follow(velocity(0.5 * parameters.joint.limits.speed as f32), 0.3);
        rig.worst_torque = 0.0;
        break_down(&mut rig, Broken::Sensor(Channel::Encoder, Failure::Stuck));
        steps.extend(rig.steps_to_fault(8_000));
        let known = [Fault::EncoderImplausible, Fault::CurrentNotFollowed];
        assert!(rig.latched().iter().all(|fault| known.contains(fault)), "seed {seed}: {:?}", rig.latched());
        assert!(rig.worst_torque < 1.3 * rig.torque_limit(), "seed {seed}: {} Nm", rig.worst_torque);
    }
    steps.sort_unstable();
    println!("{steps:?}");
    assert!(steps.len() >= 38 && steps[20] <= 40 && steps[36] <= 150, "{steps:?}");
}

#[test]
fn a_current_sensor_that_stuck_at_rest_is_found_with_the_first_motion() {
    for channel in [Channel::CurrentA, Channel::CurrentB, Channel::CurrentC] {
        let mut rig = Rig::following(position(0.0), 0.3);
        break_down(&mut rig, Broken::Sensor(channel, Failure::Stuck));
        rig.run(0.2);
        assert_eq!(rig.state(), State::OperationEnabled);
        rig.demand.command = velocity(1.0);
        rig.steps_to_fault(4_000).unwrap();
        assert_eq!(rig.latched(), [Fault::CurrentSensor]);
        assert!(!rig.is_switching() && rig.worst_torque < 0.5 * rig.torque_limit(), "{} Nm", rig.worst_torque);
    }
}

/// Ten minutes of all the current that derating leaves, with a thermistor that stuck when the motor was cold.
#[test]
fn a_winding_thermistor_that_stuck_cold_leaves_the_winding_below_its_limit() {
    let random = (0..10).map(|seed| ActuatorParameters::randomised(seed).aligned());
    for parameters in random.chain([reference()]) {
        let setup = Setup::of(&parameters);
        let active = setup.configuration.prepare(&setup.bridge).unwrap();
        let mut model = WindingTemperature::new(&active.thermal, 25.0).unwrap();
        let (motor, mut truth) = (parameters.joint.motor, Heat::uniform(25.0));
        let mut derated = false;
        for _ in 0..600 * 100 {
            let current = motor.current_limit * f64::from(model.derating());
            derated |= model.derating() < 1.0;
            let copper = 1.0 + parameters.windings.resistance_rise * (truth.winding - 25.0);
            truth.advance(&parameters.joint.thermal, copper * motor.copper_loss(current), 0.0, 0.01);
            model.step((current * current) as f32, 25.0);
            assert!(truth.winding < f64::from(setup.configuration.limits.winding_temperature), "{} °C", truth.winding);
        }
        assert!(derated || truth.winding < 115.0, "{} °C", truth.winding);
    }
}
