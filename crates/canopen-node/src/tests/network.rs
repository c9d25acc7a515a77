//! NMT, boot-up, heartbeat and EMCY.

use super::*;

const HEARTBEAT_OF_NODE: u16 = HEARTBEAT + NODE as u16;

#[test]
fn nmt_commands_act_before_the_interrupt_returns() {
    let mut node = Node::booted();
    for (command, state) in [
        (1, NmtState::Operational),
        (2, NmtState::Stopped),
        (0x80, NmtState::PreOperational),
        (1, NmtState::Operational),
    ] {
        for target in [0, NODE] {
            node.interrupt(&frame(0, &[command, target]));
            assert_eq!(node.shared.state(), state);
        }
    }
    node.interrupt(&frame(0, &[2, NODE + 1]));
    node.interrupt(&frame(0, &[9, NODE]));
    node.interrupt(&frame(0, &[2]));
    assert_eq!(node.shared.state(), NmtState::Operational);
    use NmtState::*;
    // Set-points are invalidated at each change, and at a command that changes nothing they are not.
    assert_eq!(node.image.states, [PreOperational, Operational, Stopped, PreOperational, Operational]);
}

#[test]
fn the_task_hears_of_a_state_that_was_left_and_entered_again() {
    let mut node = Node::operational();
    node.dictionary.events.clear();
    node.interrupt(&frame(0, &[2, 0]));
    node.interrupt(&frame(0, &[1, 0]));
    node.task();
    assert_eq!(node.dictionary.events, [Event::State(NmtState::Operational)]);
}

#[test]
fn a_reset_loads_power_on_values_and_boots_again() {
    let mut node = Node::operational();
    for (command, reset) in [(0x81, Reset::Node), (0x82, Reset::Communication)] {
        node.write(0x1017, 0, &100u16.to_le_bytes()).unwrap();
        node.write(0x1800, 1, &0xC000_0185u32.to_le_bytes()).unwrap();
        node.dictionary.events.clear();
        node.interrupt(&frame(0, &[command, 0]));
        assert_eq!(node.shared.state(), NmtState::Initialising);
        // Until the boot-up message it knows nothing but another reset.
        node.interrupt(&frame(0, &[1, 0]));
        assert_eq!(node.shared.state(), NmtState::Initialising);
        assert_eq!(node.task(), [frame(HEARTBEAT_OF_NODE, &[0])]);
        assert_eq!(node.dictionary.events[0], Event::Reset(reset));
        assert_eq!(node.shared.state(), NmtState::PreOperational);
        assert_eq!(node.read(0x1017, 0), Ok(0));
        assert_eq!(node.read(0x1800, 1), Ok(0x4000_0185));
        node.bus(0, &[1, 0]);
    }
}

#[test]
fn a_reset_between_a_reset_and_its_boot_up_message_is_not_lost() {
    let mut node = Node::booted();
    node.interrupt(&frame(0, &[0x82, 0]));
    node.interrupt(&frame(0, &[0x81, 0]));
    assert_eq!(node.task(), [frame(HEARTBEAT_OF_NODE, &[0])]);
    assert!(node.dictionary.events.contains(&Event::Reset(Reset::Node)));
    assert_eq!(node.shared.state(), NmtState::PreOperational);
}

#[test]
fn a_reset_while_the_task_deals_with_another_is_dealt_with_too() {
    let mut node = Node::booted();
    node.dictionary.interrupted = Some(node.shared);
    node.dictionary.events.clear();
    node.interrupt(&frame(0, &[0x82, 0]));
    // One boot-up message, after the second.
    assert_eq!(node.run(2), [frame(HEARTBEAT_OF_NODE, &[0])]);
    let resets = node.dictionary.events.iter().filter(|event| matches!(event, Event::Reset(_))).collect::<Vec<_>>();
    assert_eq!(resets, [&Event::Reset(Reset::Communication), &Event::Reset(Reset::Node)]);
    assert_eq!(node.shared.state(), NmtState::PreOperational);
    assert_eq!(node.bus(0, &[1, 0]), []);
    assert_eq!(node.shared.state(), NmtState::Operational);
}

#[test]
fn heartbeats_tell_the_state_in_every_state() {
    let mut node = Node::booted();
    node.write(0x1017, 0, &10u16.to_le_bytes()).unwrap();
    for (command, byte) in [(1, 5), (2, 4), (0x80, 0x7F)] {
        node.bus(0, &[command, 0]);
        assert_eq!(node.run(1_000), vec![frame(HEARTBEAT_OF_NODE, &[byte]); 100]);
    }
    node.write(0x1017, 0, &[0, 0]).unwrap();
    assert_eq!(node.run(1_000), []);
}

#[test]
fn heartbeats_go_on_during_a_block_upload() {
    let mut node = Node::booted();
    node.dictionary.domain = pattern(889);
    node.write(0x1017, 0, &1u16.to_le_bytes()).unwrap();
    node.sdo([0xA4, 0x10, 0x20, 0, 127, 0, 0, 0]);
    node.interrupt(&frame(0x605, &[0xA3, 0, 0, 0, 0, 0, 0, 0]));
    let request = node.queue.pop_front().unwrap();
    assert_eq!(node.server.receive(&request, node.now, &mut node.dictionary), None);
    // A sender that takes one frame in 130 us.
    let mut heartbeats = 0;
    for _ in 0..127 {
        node.now = node.now.wrapping_add(130);
        let sent = node.server.poll(node.now, &mut node.dictionary).unwrap();
        heartbeats += u32::from(sent.id() == HEARTBEAT_OF_NODE);
    }
    assert_eq!(heartbeats, 127 * 130 / 1_000);
}

#[test]
fn a_monitored_node_that_falls_silent_is_reported_and_leaves_operational() {
    for (behaviour, state) in [(0, NmtState::PreOperational), (1, NmtState::Operational), (2, NmtState::Stopped)] {
        let mut node = Node::operational();
        node.write(0x1029, 1, &[behaviour]).unwrap();
        node.write(0x1016, 2, &(9u32 << 16 | 50).to_le_bytes()).unwrap();
        // Not before it was heard.
        assert_eq!(node.run(200), []);
        node.bus(0x709, &[5]);
        assert_eq!(node.run(50), []);
        node.dictionary.events.clear();
        let sent = node.run(1);
        assert_eq!(node.shared.state(), state);
        assert!(node.dictionary.events.contains(&Event::HeartbeatLost { node: 9 }));
        if state == NmtState::Stopped {
            assert_eq!(sent, []);
            continue;
        }
        assert_eq!(sent, [frame(0x85, &[0x30, 0x81, 0x11, 9, 0, 0, 0, 0])]);
        assert_eq!(node.read(0x1001, 0), Ok(0x11));
        assert_eq!(node.bus(0x709, &[5]), [frame(0x85, &[0; 8])]);
        assert_eq!(node.dictionary.events.last(), Some(&Event::HeartbeatBack { node: 9 }));
        assert_eq!((node.read(0x1001, 0), node.read(0x1003, 1)), (Ok(0), Ok(0x0009_8130)));
    }
}

#[test]
fn a_node_is_monitored_once_and_other_nodes_are_nothing_to_it() {
    let mut node = Node::booted();
    node.write(0x1016, 1, &(9u32 << 16 | 50).to_le_bytes()).unwrap();
    assert_eq!(node.write(0x1016, 2, &(9u32 << 16 | 60).to_le_bytes()), Err(Abort::INCOMPATIBLE.0));
    assert_eq!(node.write(0x1016, 2, &(128u32 << 16 | 60).to_le_bytes()), Err(Abort::VALUE.0));
    node.bus(0x709, &[5]);
    for _ in 0..10 {
        node.run(10);
        node.bus(0x70A, &[5]);
    }
    assert_eq!(node.read(0x1003, 0), Ok(1));
    // A node that is not monitored any more is no error.
    node.write(0x1016, 1, &[0; 4]).unwrap();
    assert_eq!(node.read(0x1001, 0), Ok(0));
}

#[test]
fn emergencies_wait_while_stopped_and_keep_their_distance() {
    let mut node = Node::operational();
    node.write(0x1015, 0, &100u16.to_le_bytes()).unwrap();
    node.bus(0, &[2, 0]);
    node.server.emergency(0x5530, 0x80, [1, 2, 3, 4, 5]);
    node.server.emergency(0x6320, 0x80, [0; 5]);
    assert_eq!(node.run(100), []);
    assert_eq!(node.bus(0, &[1, 0]), [frame(0x85, &[0x30, 0x55, 0x81, 1, 2, 3, 4, 5])]);
    assert_eq!(node.run(9), []);
    assert_eq!(node.run(1), [frame(0x85, &[0x20, 0x63, 0x81, 0, 0, 0, 0, 0])]);
}

#[test]
fn the_error_history_is_read_newest_first_and_cleared_by_zero_only() {
    let mut node = Node::booted();
    assert_eq!((node.read(0x1003, 0), node.read(0x1003, 1)), (Ok(0), Err(Abort::NO_DATA.0)));
    for number in 1..=10 {
        node.server.emergency(0xFF00 + number, 1, [0; 5]);
    }
    assert_eq!((node.read(0x1003, 0), node.read(0x1003, 1)), (Ok(8), Ok(0xFF0A)));
    assert_eq!((node.read(0x1003, 8), node.read(0x1003, 9)), (Ok(0xFF03), Err(Abort::NO_SUB_INDEX.0)));
    assert_eq!(node.write(0x1003, 0, &[1]), Err(Abort::VALUE.0));
    assert_eq!(node.write(0x1003, 1, &[0; 4]), Err(Abort::READ_ONLY.0));
    node.write(0x1003, 0, &[0]).unwrap();
    assert_eq!(node.read(0x1003, 0), Ok(0));
    assert_eq!(node.server.dropped_emergencies(), 2);
}

#[test]
fn emcy_can_be_switched_off_and_moved_while_it_is_off() {
    let mut node = Node::booted();
    assert_eq!(node.write(0x1014, 0, &0x86u32.to_le_bytes()), Err(Abort::VALUE.0));
    node.write(0x1014, 0, &0x8000_0085u32.to_le_bytes()).unwrap();
    node.server.emergency(0x1000, 1, [0; 5]);
    assert_eq!(node.task(), []);
    node.write(0x1014, 0, &0x86u32.to_le_bytes()).unwrap();
    node.server.emergency(code::RESET, 0, [0; 5]);
    assert_eq!(node.task(), [frame(0x86, &[0; 8])]);
}

#[test]
fn an_error_passive_controller_is_reported_once_and_so_is_its_recovery() {
    let mut node = Node::operational();
    for _ in 0..3 {
        node.server.error_passive(true);
    }
    // Communication error, and so the generic bit.
    assert_eq!(node.task(), [frame(0x85, &[0x20, 0x81, 0x11, 0, 0, 0, 0, 0])]);
    for _ in 0..3 {
        node.server.error_passive(false);
    }
    assert_eq!(node.task(), [frame(0x85, &[0; 8])]);
    assert_eq!(node.shared.state(), NmtState::Operational);
}

#[test]
fn bus_off_counts_as_a_communication_error() {
    let mut node = Node::operational();
    node.server.bus_off_recovered(&mut node.dictionary);
    assert_eq!(node.shared.state(), NmtState::PreOperational);
    assert_eq!(node.task(), [frame(0x85, &[0x40, 0x81, 0, 0, 0, 0, 0, 0])]);
    // The image learns of it with the next frame, whatever it is.
    node.interrupt(&frame(0x123, &[]));
    assert_eq!(node.image.states.last(), Some(&NmtState::PreOperational));
}
