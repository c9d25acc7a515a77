//! The firmware's joint follows its commands on a virtual actuator.

use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Command, Demand, Mode};
use plant::VirtualJoint;
use plant::actuator::ActuatorParameters;
use plant::virtual_joint::Setup;

fn enabled() -> VirtualJoint {
    let parameters = ActuatorParameters::reference().aligned();
    let mut joint = VirtualJoint::new(parameters, &Setup::of(&parameters), 25.0, 1).unwrap();
    joint.enable().unwrap();
    joint
}

/// Runs a command for a time, s; sent anew every millisecond.
fn run(joint: &mut VirtualJoint, time: f64, command: impl Fn(f64) -> Command) {
    let steps = (time / joint.period()) as u32;
    let start = joint.time();
    let mut demand = Demand { controlword: Controlword::ENABLE_OPERATION, ..Demand::default() };
    for n in 0..steps {
        if n % 20 == 0 {
            demand.sequence = demand.sequence.wrapping_add(1);
            demand.command = command(joint.time() - start);
        }
        joint.step(&demand, 0.0);
        assert_eq!(
            joint.joint().telemetry().state,
            State::OperationEnabled,
            "{:?}",
            joint.joint().latched_faults().iter().collect::<Vec<_>>()
        );
    }
}

#[test]
fn a_position_is_reached_and_held() {
    let mut joint = enabled();
    run(&mut joint, 5.0, |_| Command { mode: Mode::Position, position: 0.5, ..Command::default() });
    let position = joint.actuator().state().joint.position;
    println!("{position}");
    assert!((position - 0.5).abs() < 4e-3, "{position}");
}

#[test]
fn a_velocity_is_reached_and_held() {
    let mut joint = enabled();
    run(&mut joint, 0.6, |_| Command { mode: Mode::Velocity, velocity: 1.0, ..Command::default() });
    let velocity = joint.actuator().state().joint.velocity;
    println!("{velocity}");
    assert!((velocity - 1.0).abs() < 0.05, "{velocity}");
}

#[test]
fn a_torque_arrives_at_the_motor() {
    let mut joint = enabled();
    run(&mut joint, 0.05, |_| Command { torque: 2.0, ..Command::default() });
    let torque = joint.actuator().state().joint.motor_torque;
    println!("{torque}");
    assert!((torque - 2.0).abs() < 0.2, "{torque}");
}
