//! Report of the board on its hardware, and what a master may do with it.

use super::Node;
use crate::hardware::chip_options::{COMMAND, ChipOptions};
use crate::hardware::{GateDriver, Hardware, Setup};
use crate::joint::fault::{Fault, Faults};
use crate::joint::state_machine::State;
use canopen_node::Abort;

/// EMCYs of the node.
fn emergencies(node: &mut Node) -> Vec<[u8; 8]> {
    node.task().iter().filter(|frame| frame.id() == 0x85).filter_map(|frame| frame.eight().copied()).collect()
}

#[test]
fn a_board_without_a_gate_driver_shows_zeros() {
    let mut node = Node::new();
    assert_eq!([1, 2, 3, 4, 5].map(|sub_index| node.number(0x2302, sub_index)), [0; 5]);
    assert_eq!([1, 2, 3].map(|sub_index| node.number(0x2303, sub_index)), [0; 3]);
}

#[test]
fn a_gate_driver_is_told_with_both_its_words_its_faults_and_what_is_missing() {
    let mut node = Node::new();
    let driver = GateDriver { status: [0x604, 0x102], faults: 7, setup: Setup::Fault, unread: false };
    node.objects.program().hardware = Hardware { driver, revision: 4, options: ChipOptions::default() };
    assert_eq!([1, 2, 3, 4, 5].map(|sub_index| node.number(0x2302, sub_index)), [0x604, 0x102, 7, 4, 4]);
}

#[test]
fn the_emcy_of_the_gate_driver_waits_for_its_words_and_carries_them() {
    let mut node = Node::operational();
    node.objects.program().hardware.driver.unread = true;
    node.observed.latched.set(Fault::BridgeDriver, true);
    node.observed.latched.set(Fault::OverVoltage, true);
    assert_eq!(emergencies(&mut node), [[0x10, 0x32, 0x85, 4, 8, 0x80, 0, 0]], "others do not wait");
    assert_eq!(emergencies(&mut node), [[0; 8]; 0]);
    let status = [0x604, 0x102];
    node.objects.program().hardware.driver = GateDriver { status, faults: 1, setup: Setup::Fault, unread: false };
    assert_eq!(emergencies(&mut node), [[0x10, 0x54, 0x85, 16, 0x04, 0x06, 0x02, 0x01]]);
    node.observed.latched = Faults::NONE;
    assert_eq!(emergencies(&mut node), [[0; 8]]);
}

#[test]
fn options_are_set_by_their_command_alone_and_only_while_the_joint_is_off() {
    let mut node = Node::new();
    let set = |node: &mut Node, command: u32| node.download(0x2303, 4, &command.to_le_bytes());
    for command in [0, 1, COMMAND - 1, COMMAND + 1, u32::MAX] {
        assert_eq!(set(&mut node, command), Err(Abort::VALUE.0));
    }
    for state in [State::ReadyToSwitchOn, State::SwitchedOn, State::OperationEnabled, State::QuickStopActive] {
        node.observed.telemetry.state = state;
        node.task();
        assert_eq!(set(&mut node, COMMAND), Err(Abort::DEVICE_STATE.0), "{state:?}");
    }
    assert_eq!(node.objects.program().options_set, 0);
    node.observed.telemetry.state = State::SwitchOnDisabled;
    node.task();
    assert_eq!(set(&mut node, COMMAND), Ok(()));
    assert_eq!(node.objects.program().options_set, 1);
    assert_eq!(node.upload(0x2303, 4), Err(Abort::WRITE_ONLY.0));
}
