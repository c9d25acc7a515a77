//! Current sensors that drift after the start: a joint that is off follows them, one that is enabled does not.

use crate::rig::{Rig, break_down, reference, torque};
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::State;
use plant::actuator::{Channel, Failure, Fault as Broken};
use plant::virtual_joint::Setup;

/// The drift, A: 1.2 times what the sum of the currents may be, and within what a sensor may have at the start.
fn drift(rig: &Rig) -> f64 {
    1.2 * 0.1 * f64::from(rig.joint.active().limits.over_current)
}

/// Lets a current sensor drift to that in ten steps.
fn drifts(rig: &mut Rig, time: f64) {
    for step in 1..=10 {
        let offset = drift(rig) * f64::from(step) / 10.0;
        break_down(rig, Broken::Sensor(Channel::CurrentA, Failure::Offset(offset)));
        rig.run(time / 10.0);
    }
}

#[test]
fn a_sensor_that_drifts_while_the_joint_is_off_causes_neither_a_fault_nor_a_wrong_torque() {
    let parameters = reference();
    let mut rig = Rig::off(parameters, &Setup::of(&parameters));
    rig.run(0.1);
    drifts(&mut rig, 20.0);
    assert_eq!((rig.state(), rig.latched()), (State::SwitchOnDisabled, vec![]));
    // A few time constants later it is enabled.
    rig.run(5.0);
    rig.enable();
    let wanted = 0.2 * rig.torque_limit() as f32;
    rig.follow(torque(wanted), 0.02);
    let (mut error, steps) = (0.0f64, rig.steps_in(0.01));
    for _ in 0..steps {
        rig.step();
        error = error.max((rig.motor_torque() - f64::from(wanted)).abs());
    }
    assert_eq!((rig.state(), rig.latched()), (State::OperationEnabled, vec![]));
    assert!(error < 0.05 * f64::from(wanted), "{error} of {wanted} Nm");
}

#[test]
fn a_sensor_that_drifts_while_the_joint_is_enabled_is_a_fault() {
    let parameters = reference();
    let mut rig = Rig::enabled(parameters, &Setup::of(&parameters));
    rig.follow(torque(0.0), 0.05);
    drifts(&mut rig, 2.0);
    assert!(rig.latched().contains(&Fault::CurrentSensor), "{:?}", rig.latched());
}
