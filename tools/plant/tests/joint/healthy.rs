//! A sound joint has no fault: random actuators in hard, ordinary motion.

use crate::rig::{Rig, position, torque, velocity};
use joint_firmware::joint::Command;
use joint_firmware::joint::state_machine::State;
use plant::actuator::ActuatorParameters;
use plant::virtual_joint::Setup;

/// Reversals at nine tenths of the speed limit, moves over most of the travel, full torque either way, and a stop; 2 s.
fn motion(parameters: &ActuatorParameters) -> [(Command, f64); 9] {
    let joint = &parameters.joint;
    let (speed, travel) = (0.9 * joint.limits.speed as f32, 0.8 * joint.limits.travel as f32);
    let full = joint.motor.torque_limit() as f32;
    [
        (velocity(speed), 0.3),
        (velocity(-speed), 0.4),
        (position(travel), 0.5),
        (position(-0.5 * travel), 0.4),
        (torque(full), 0.05),
        (torque(-full), 0.1),
        (torque(full), 0.05),
        (velocity(0.0), 0.15),
        (position(0.0), 0.05),
    ]
}

/// An actuator does the motion of `nominal`, with the configuration of a commissioned one.
fn runs_without_a_fault(seed: u64, actuator: ActuatorParameters, nominal: &ActuatorParameters, setup: &Setup) -> Rig {
    let mut rig = Rig::enabled(actuator, setup);
    for (command, time) in motion(nominal) {
        rig.demand.command = command;
        for _ in 0..rig.steps_in(time) {
            let state = rig.step();
            assert_eq!(state, State::OperationEnabled, "seed {seed}, {command:?}: {:?}", rig.latched());
        }
    }
    rig
}

fn runs_hard(seed: u64) {
    let parameters = ActuatorParameters::randomised(seed).aligned();
    let rig = runs_without_a_fault(seed, parameters, &parameters, &Setup::of(&parameters));
    // It was hard: what is not asked for cannot trip.
    assert!(rig.worst_torque > 0.9 * rig.torque_limit(), "seed {seed}: {} Nm", rig.worst_torque);
    // The limit holds for the current; with some of these windings a few degrees of it along d are another tenth of
    // torque.
    assert!(rig.worst_torque < 1.2 * rig.torque_limit(), "seed {seed}: {} Nm", rig.worst_torque);
}

#[test]
fn random_actuators_run_for_two_seconds_each_without_a_fault() {
    (0..40).for_each(runs_hard);
}

/// A winding 100 K above the temperature that its resistance is known for, and a torque constant that the hot magnet
/// has lowered.
#[test]
fn a_hot_motor_is_not_taken_for_a_broken_encoder() {
    for seed in 0..10 {
        let cold = ActuatorParameters::randomised(seed).aligned();
        let mut setup = Setup::of(&cold);
        setup.configuration.limits.winding_temperature = 200.0;
        setup.configuration.limits.bridge_temperature = 150.0;
        let mut hot = cold;
        hot.joint.motor.torque_constant *= 0.9;
        hot.joint.motor.resistance *= 1.39;
        runs_without_a_fault(seed, hot, &cold, &setup);
    }
}

/// The encoder's electrical zero is off by 5°, as a calibration may leave it.
#[test]
fn an_electrical_zero_that_is_a_little_off_is_not_taken_for_a_broken_encoder() {
    for seed in 0..10 {
        let calibrated = ActuatorParameters::randomised(seed).aligned();
        let mut off = calibrated;
        off.windings.electrical_zero = 5.0f64.to_radians();
        runs_without_a_fault(seed, off, &calibrated, &Setup::of(&calibrated));
    }
}
