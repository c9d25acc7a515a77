//! A joint in a test's hands, one control step at a time.

use super::state_machine::{Controlword, State};
use super::{Active, Command, Demand, Joint, Measurements, OFFSET_STEPS, Slow};
use crate::motor::phases::Phases;

/// A joint at rest without current, on a supply of so many V.
pub fn at_rest(bus_voltage: f32) -> Measurements {
    Measurements {
        phase_currents: Phases::uniform(0.0),
        bus_voltage,
        encoder: 0,
        encoder_valid: true,
        encoder_referenced: true,
        winding_temperature: f32::NAN,
        bridge_temperature: 25.0,
        bridge_fault: false,
        overrun: false,
    }
}

/// A joint that has started, with sensors without offsets.
pub fn started(active: &Active) -> Joint {
    let mut joint = Joint::new();
    for _ in 0..=OFFSET_STEPS {
        joint.control_step(active, &Demand::default(), &Slow::default(), &at_rest(18.0));
    }
    assert_eq!(joint.telemetry().state, State::SwitchOnDisabled);
    joint
}

/// Enables operation with a torque asked for, Nm; the demand goes on from there.
pub fn enabled(joint: &mut Joint, active: &Active, torque: f32, measured: &Measurements) -> Demand {
    let command = Command { torque, ..Command::default() };
    let mut demand = Demand { command, ..Demand::default() };
    for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::ENABLE_OPERATION] {
        (demand.controlword, demand.sequence) = (word, demand.sequence + 1);
        joint.control_step(active, &demand, &Slow::default(), measured);
    }
    demand
}
