//! Object 2107h: a calibration is begun, given up, and taken.

use super::*;
use crate::joint::state_machine::State;
use crate::motor::angle::{Direction, ElectricalAngle, EncoderAlignment};
use crate::motor::calibration::Calibration;
use crate::motor::phases::Phases;

const CURRENT: (u16, u8) = (0x2107, 1);
const DEVICE_STATE: u32 = 0x0800_0022;
const VALUE: u32 = 0x0609_0030;

/// A joint that is off, for the objects as well.
fn off() -> Node {
    let mut node = Node::new();
    node.observed.telemetry.state = State::SwitchOnDisabled;
    node.observed.winding_temperature = 25.0;
    node.task();
    node
}

fn found() -> Calibration {
    Calibration {
        current_offsets: Phases::uniform(0.0),
        resistance: 0.2,
        lost_voltage: 0.125,
        inductance_d: 70e-6,
        inductance_q: 90e-6,
        alignment: EncoderAlignment {
            pole_pairs: 11,
            direction: Direction::Reverse,
            electrical_zero: ElectricalAngle(0x1234_5678),
        },
        lag: 0.03,
    }
}

#[test]
fn what_a_calibration_finds_is_in_use_and_staged_beside_what_else_is_staged() {
    let mut node = off();
    node.set_real(0x2104, 3, 0.5).unwrap();
    node.set_real(CURRENT.0, CURRENT.1, 1.5).unwrap();
    assert_eq!(node.objects.program().calibrations, [1.5]);
    assert_eq!((node.number(0x2107, 2), node.real(0x2107, 1)), (1, 1.5));
    node.objects.program().calibration = Some(Progress::Alignment);
    node.task();
    assert!(node.number(0x2107, 2) == 4 && node.objects.program().configured.is_empty());

    // The control step is not ready for a configuration at once.
    node.objects.program().busy = true;
    node.objects.program().calibration = Some(Progress::Done(found()));
    node.task();
    assert_eq!(node.number(0x2100, 2), 2);
    node.objects.program().busy = false;
    node.task();
    node.task();
    let configured = &node.objects.program().configured;
    assert_eq!(configured.len(), 1);
    let (motor, gains) = (configured[0].motor, configured[0].gains);
    assert_eq!((motor.resistance, motor.inductance_q, motor.alignment), (0.2, 90e-6, found().alignment));
    assert_eq!(gains.stiffness, BOARD.joint.gains.stiffness, "what is staged besides waits for its own command");
    assert_eq!((node.real(0x2101, 1), node.number(0x2101, 6), node.number(0x2101, 8)), (0.2, 11, 0x1234_5678));
    assert_eq!((node.real(0x2104, 3), node.number(0x2100, 7)), (0.5, 1));
    assert_eq!((node.number(0x2107, 2), node.real(0x2107, 6), node.real(0x2107, 7)), (6, 0.03, 0.125));
    assert_eq!(node.number(0x2107, 3), 0);
}

#[test]
fn a_calibration_that_was_given_up_says_why_and_changes_nothing() {
    let mut node = off();
    node.set_real(CURRENT.0, CURRENT.1, 1.5).unwrap();
    let failure = Failure::SupplyTooLow { voltage: 6.5, least: 7.75 };
    node.objects.program().calibration = Some(Progress::Failed(failure));
    node.task();
    assert_eq!((node.number(0x2107, 2), node.number(0x2107, 3)), (7, 3));
    assert_eq!((node.real(0x2107, 4), node.real(0x2107, 5)), (6.5, 7.75));
    assert!(node.objects.program().configured.is_empty());
}

#[test]
fn it_is_begun_only_in_a_joint_that_is_off_and_with_a_current_that_is_possible() {
    use State::*;
    for state in
        [NotReadyToSwitchOn, SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn, OperationEnabled, QuickStopActive, Fault]
    {
        let mut node = off();
        node.observed.telemetry.state = state;
        node.task();
        let permitted = matches!(state, NotReadyToSwitchOn | SwitchOnDisabled);
        let begun = node.set_real(CURRENT.0, CURRENT.1, 1.0);
        assert_eq!(begun, if permitted { Ok(()) } else { Err(DEVICE_STATE) }, "{state:?}");
    }
    let mut node = off();
    for current in [0.05, 50.0, -1.0, f32::NAN] {
        assert_eq!(node.set_real(CURRENT.0, CURRENT.1, current), Err(VALUE), "{current} A");
    }
    assert!(node.objects.program().calibrations.is_empty());
}

#[test]
fn while_it_runs_no_other_is_begun_and_nothing_is_configured_or_stored() {
    let mut node = Node::with(Stored::NOTHING, true);
    node.observed.telemetry.state = State::SwitchOnDisabled;
    node.task();
    node.set_real(CURRENT.0, CURRENT.1, 1.0).unwrap();
    assert_eq!(node.set_real(CURRENT.0, CURRENT.1, 1.0), Err(DEVICE_STATE));
    assert_eq!(node.download(0x2100, 1, &[1]), Err(DEVICE_STATE));
    assert_eq!(node.download(0x1010, 1, b"save"), Err(DEVICE_STATE));
    node.set_real(CURRENT.0, CURRENT.1, 0.0).unwrap();
    assert_eq!((node.number(0x2107, 2), node.number(0x2107, 3)), (7, 1));
    node.download(0x1010, 1, b"save").unwrap();
}

#[test]
fn a_transition_of_the_network_gives_it_up() {
    let mut node = off();
    node.set_real(CURRENT.0, CURRENT.1, 1.0).unwrap();
    node.receive(0, &[1, NODE]);
    assert_eq!(node.number(0x2107, 3), 1);
}
