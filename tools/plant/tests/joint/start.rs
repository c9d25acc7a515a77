//! Defects before the joint has moved: it is not switched on, or refused before it gives torque.

use crate::rig::{Rig, break_down, mend, reference, reset, torque};
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::{Controlword, State};
use plant::actuator::{Channel, Failure, Fault as Broken};
use plant::virtual_joint::Setup;

#[test]
fn an_encoder_that_never_answers_is_lost_before_anything_can_be_enabled() {
    let parameters = reference();
    let mut rig = Rig::off(parameters, &Setup::of(&parameters));
    break_down(&mut rig, Broken::Sensor(Channel::Encoder, Failure::Open));
    rig.run(0.1);
    assert_eq!((rig.state(), rig.latched()), (State::Fault, vec![Fault::EncoderLost]));
}

#[test]
fn a_current_sensor_that_is_broken_at_the_start_is_a_fault() {
    let parameters = reference();
    for failure in [Failure::Open, Failure::Shorted, Failure::Offset(10.0)] {
        let mut rig = Rig::off(parameters, &Setup::of(&parameters));
        break_down(&mut rig, Broken::Sensor(Channel::CurrentC, failure));
        rig.run(0.1);
        assert_eq!((rig.state(), rig.latched()), (State::Fault, vec![Fault::CurrentSensor]), "{failure:?}");
        reset(&mut rig);
        assert_eq!(rig.state(), State::Fault, "{failure:?}");
        mend(&mut rig);
        rig.run(0.1);
        reset(&mut rig);
        assert_eq!(rig.state(), State::SwitchOnDisabled, "{failure:?}");
        rig.enable();
        rig.follow(torque(0.0), 0.05);
    }
}

#[test]
fn a_joint_whose_winding_is_too_hot_is_refused_before_it_gives_torque() {
    let parameters = reference();
    let mut setup = Setup::of(&parameters);
    setup.configuration.limits.bridge_temperature = 150.0;
    let mut rig = Rig::off_at(parameters, &setup, 140.0);
    assert!(rig.joint.enable().is_err());
    assert_eq!((rig.state(), rig.latched()), (State::Fault, vec![Fault::WindingTemperature]));
}

#[test]
fn a_joint_without_set_points_is_refused_before_it_gives_torque() {
    let parameters = reference();
    let mut rig = Rig::enabled(parameters, &Setup::of(&parameters));
    rig.demand.controlword = Controlword::SWITCH_ON;
    rig.demand.command = torque(50.0);
    rig.silent = true;
    rig.run(0.2);
    assert_eq!(rig.state(), State::SwitchedOn);
    rig.demand.controlword = Controlword::ENABLE_OPERATION;
    assert_eq!((rig.step(), rig.latched()), (State::Fault, vec![Fault::StaleCommand]));
}
