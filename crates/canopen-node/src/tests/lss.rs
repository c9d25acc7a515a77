//! Node ids by LSS, CiA 305.

use super::*;

fn ask(node: &mut Node, request: [u8; 8]) -> Vec<Frame> {
    node.bus(LSS_MASTER, &request)
}

fn answered(command: u8, data: [u8; 4]) -> Vec<Frame> {
    let [a, b, c, d] = data;
    vec![frame(LSS_SLAVE, &[command, a, b, c, d, 0, 0, 0])]
}

fn message(command: u8, number: u32) -> [u8; 8] {
    let [a, b, c, d] = number.to_le_bytes();
    [command, a, b, c, d, 0, 0, 0]
}

#[test]
fn a_node_without_a_node_id_is_silent_but_for_lss() {
    let mut node = Node::powered(NO_NODE_ID);
    assert_eq!(node.run(2_000), []);
    for id in 0..=0x7FF {
        if id != LSS_MASTER {
            assert_eq!(node.bus(id, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]), [], "{id:#x}");
            assert_eq!(node.bus(id, &[1, 0]), []);
        }
    }
    assert_eq!(node.shared.state(), NmtState::Initialising);
    assert!(node.image.states.is_empty());
    assert_eq!(ask(&mut node, message(0x4C, 0)), answered(0x50, [0; 4]));
}

#[test]
fn a_node_gets_its_id_boots_with_it_and_stores_it() {
    let mut node = Node::powered(NO_NODE_ID);
    node.task();
    for (command, number) in [(0x40, IDENTITY.vendor), (0x41, IDENTITY.product), (0x42, IDENTITY.revision)] {
        assert_eq!(ask(&mut node, message(command, number)), []);
    }
    assert_eq!(ask(&mut node, message(0x43, IDENTITY.serial)), answered(0x44, [0; 4]));
    assert_eq!(ask(&mut node, message(0x5B, 0)), answered(0x5B, IDENTITY.product.to_le_bytes()));
    assert_eq!(ask(&mut node, message(0x5E, 0)), answered(0x5E, [0xFF, 0, 0, 0]));
    for refused in [0, 128, 254] {
        assert_eq!(ask(&mut node, message(0x11, refused)), answered(0x11, [1, 0, 0, 0]));
    }
    assert_eq!(ask(&mut node, message(0x11, 42)), answered(0x11, [0; 4]));
    assert_eq!(ask(&mut node, message(0x17, 0)), answered(0x17, [0; 4]));
    assert_eq!(node.dictionary.stored_node_id, Some(42));
    assert_eq!(ask(&mut node, message(0x04, 0)), [frame(0x700 + 42, &[0])]);
    assert_eq!((node.shared.node_id(), node.shared.state()), (42, NmtState::PreOperational));
    assert_eq!(node.bus(0x62A, &[0x40, 0x01, 0x20, 0, 0, 0, 0, 0])[0].id(), 0x5AA);
}

#[test]
fn a_node_that_cannot_do_without_its_id_keeps_it() {
    let mut node = Node::operational();
    ask(&mut node, message(0x04, 1));
    node.dictionary.keeps_node_id = true;
    assert_eq!(ask(&mut node, message(0x11, 7)), answered(0x11, [0xFF, 1, 0, 0]));
    assert_eq!(ask(&mut node, message(0x17, 0)), answered(0x17, [0xFF, 1, 0, 0]));
    assert_eq!(node.dictionary.stored_node_id, None);
    node.dictionary.keeps_node_id = false;
    assert_eq!(ask(&mut node, message(0x11, 7)), answered(0x11, [0; 4]));
}

#[test]
fn a_node_id_that_is_not_stored_is_told_with_the_reason() {
    let mut node = Node::operational();
    ask(&mut node, message(0x04, 1));
    ask(&mut node, message(0x11, 7));
    for (abort, answer) in [(Abort::LOCAL_CONTROL, [0xFF, 2, 0, 0]), (Abort::HARDWARE, [2, 0, 0, 0])] {
        node.dictionary.refuses_node_id = Some(abort);
        assert_eq!(ask(&mut node, message(0x17, 0)), answered(0x17, answer));
        assert_eq!(node.dictionary.stored_node_id, None);
    }
    node.dictionary.refuses_node_id = None;
    assert_eq!(ask(&mut node, message(0x17, 0)), answered(0x17, [0; 4]));
    assert_eq!(node.dictionary.stored_node_id, Some(7));
}

#[test]
fn a_node_with_an_id_changes_it_with_the_next_reset() {
    let mut node = Node::operational();
    ask(&mut node, message(0x04, 1));
    ask(&mut node, message(0x11, 7));
    ask(&mut node, message(0x04, 0));
    assert_eq!((node.shared.node_id(), node.shared.state()), (NODE, NmtState::Operational));
    assert_eq!(node.bus(0, &[0x82, NODE]), [frame(0x707, &[0])]);
    assert_eq!((node.shared.node_id(), node.shared.state()), (7, NmtState::PreOperational));
}

#[test]
fn bit_timing_is_one_megabit_and_nothing_else() {
    let mut node = Node::booted();
    assert_eq!(ask(&mut node, [0x13, 0, 0, 0, 0, 0, 0, 0]), []);
    ask(&mut node, message(0x04, 1));
    assert_eq!(ask(&mut node, [0x13, 0, 0, 0, 0, 0, 0, 0]), answered(0x13, [0; 4]));
    assert_eq!(ask(&mut node, [0x13, 0, 1, 0, 0, 0, 0, 0]), answered(0x13, [1, 0, 0, 0]));
    assert_eq!(ask(&mut node, [0x13, 1, 0, 0, 0, 0, 0, 0]), answered(0x13, [1, 0, 0, 0]));
    assert_eq!(ask(&mut node, [0x15, 10, 0, 0, 0, 0, 0, 0]), []);
}

#[test]
fn selection_needs_all_four_numbers_in_order() {
    let mut node = Node::powered(NO_NODE_ID);
    node.task();
    let numbers = [IDENTITY.vendor, IDENTITY.product, IDENTITY.revision, IDENTITY.serial];
    for wrong in 0..4 {
        for (part, number) in (0..).zip(numbers) {
            let number = if part == wrong { number ^ 1 } else { number };
            assert_eq!(ask(&mut node, message(0x40 + part, number)), []);
        }
    }
    for part in [1, 0, 2, 3] {
        assert_eq!(ask(&mut node, message(0x40 + part, numbers[usize::from(part)])), []);
    }
}

#[test]
fn identification_is_by_ranges() {
    let mut node = Node::booted();
    let mut identify = |low: u32, high: u32| {
        let numbers = [IDENTITY.vendor, IDENTITY.product, 0, u32::MAX, low, high];
        let answers = (0x46..).zip(numbers).map(|(command, number)| ask(&mut node, message(command, number)));
        answers.last().unwrap()
    };
    assert_eq!(identify(IDENTITY.serial, IDENTITY.serial), answered(0x4F, [0; 4]));
    assert_eq!(identify(0, IDENTITY.serial - 1), []);
    assert_eq!(identify(IDENTITY.serial + 1, u32::MAX), []);
}

/// A master's scan of a bus: the address it finds, or none.
fn fastscan(nodes: &mut [Node]) -> Option<[u32; 4]> {
    let mut ask = |number: u32, bit: u8, sub: u8, next: u8| {
        let [a, b, c, d] = number.to_le_bytes();
        nodes.iter_mut().any(|node| node.bus(LSS_MASTER, &[0x51, a, b, c, d, bit, sub, next]) == answered(0x4F, [0; 4]))
    };
    if !ask(0, 0x80, 0, 0) {
        return None;
    }
    let mut address = [0; 4];
    for sub in 0..4u8 {
        let number = &mut address[usize::from(sub)];
        for bit in (0..32).rev() {
            if !ask(*number, bit, sub, sub) {
                *number |= 1 << bit;
            }
        }
        if !ask(*number, 0, sub, (sub + 1) % 4) {
            return None;
        }
    }
    Some(address)
}

#[test]
fn fastscan_finds_every_node_of_a_bus_of_new_ones_once() {
    let serials = [0, 1, 0x8000_0000, 0xFFFF_FFFF, 0x1234_5678, 0x1234_5679];
    let mut nodes = serials.map(|serial| {
        let identity: &Identity = Box::leak(Box::new(Identity { serial, ..IDENTITY }));
        let mut node = Node::powered(NO_NODE_ID);
        node.server = Server::new(node.shared, identity, SdoSettings::default(), NO_NODE_ID);
        node.task();
        node
    });
    let mut found = Vec::new();
    for node_id in 10.. {
        let Some([vendor, product, revision, serial]) = fastscan(&mut nodes) else { break };
        assert_eq!((vendor, product, revision), (IDENTITY.vendor, IDENTITY.product, IDENTITY.revision));
        found.push(serial);
        // Only the one that was found is configured.
        let mut all = |request| nodes.iter_mut().flat_map(|node| ask(node, request)).collect::<Vec<_>>();
        assert_eq!(all(message(0x5D, 0)), answered(0x5D, serial.to_le_bytes()));
        assert_eq!(all(message(0x11, node_id)), answered(0x11, [0; 4]));
        assert_eq!(all(message(0x04, 0)), [frame(0x700 + node_id as u16, &[0])]);
    }
    found.sort();
    let mut expected = serials;
    expected.sort();
    assert_eq!(found, expected);
}
