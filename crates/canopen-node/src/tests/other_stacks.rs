//! Defects of other servers: each of these brought one down, or made it act on what it should not have.

use super::client::{BlockDownload, BlockUpload, Outcome};
use super::*;

const UPLOAD: BlockUpload = BlockUpload { index: 0x2011, sub_index: 0, crc: true, block_size: 127, threshold: 0 };

#[test]
fn block_upload_of_an_empty_object_gives_no_bytes() {
    let mut node = Node::booted();
    assert_eq!(UPLOAD.run(&mut node, |_| {}), Ok(vec![]));
    assert_eq!(client::upload(&mut node, 0x2011, 0), Ok(vec![]));
}

#[test]
fn block_upload_with_a_block_size_of_0_or_above_127_is_refused() {
    let mut node = Node::booted();
    node.dictionary.domain = pattern(100);
    for block_size in [0, 128, 255] {
        for (index, command) in [(0x10, 0xA4), (0x10, 0xA0), (0x11, 0xA4)] {
            let refused = [0x80, index, 0x20, 0, 2, 0, 0x04, 0x05];
            assert_eq!(node.sdo([command, index, 0x20, 0, block_size, 0, 0, 0]), [refused]);
            assert!(node.server.sdo_is_idle());
        }
        // The same in the acknowledgement of a block.
        node.sdo([0xA4, 0x10, 0x20, 0, 5, 0, 0, 0]);
        assert_eq!(node.sdo([0xA3, 0, 0, 0, 0, 0, 0, 0]).len(), 5);
        assert_eq!(node.sdo([0xA2, 5, block_size, 0, 0, 0, 0, 0]), [[0x80, 0x10, 0x20, 0, 2, 0, 0x04, 0x05]]);
    }
}

#[test]
fn a_clients_abort_at_any_moment_of_any_transfer_returns_to_idle_without_an_answer() {
    let transfers: [&[[u8; 8]]; 5] = [
        &[[0x20, 0x10, 0x20, 0, 0, 0, 0, 0], [0, 1, 2, 3, 4, 5, 6, 7], [0x10, 1, 2, 3, 4, 5, 6, 7]],
        &[[0x40, 0x10, 0x20, 0, 0, 0, 0, 0], [0x60, 0, 0, 0, 0, 0, 0, 0], [0x70, 0, 0, 0, 0, 0, 0, 0]],
        &[
            [0xC4, 0x10, 0x20, 0, 0, 0, 0, 0],
            [1, 1, 2, 3, 4, 5, 6, 7],
            [2, 1, 2, 3, 4, 5, 6, 7],
            [0x83, 1, 2, 3, 4, 5, 6, 7],
        ],
        &[
            [0xA4, 0x10, 0x20, 0, 3, 0, 0, 0],
            [0xA3, 0, 0, 0, 0, 0, 0, 0],
            [0xA2, 1, 3, 0, 0, 0, 0, 0],
            [0xA2, 3, 127, 0, 0, 0, 0, 0],
        ],
        &[[0xA4, 0x11, 0x20, 0, 3, 0, 0, 0], [0xA3, 0, 0, 0, 0, 0, 0, 0], [0xA2, 1, 3, 0, 0, 0, 0, 0]],
    ];
    let domain = pattern(60);
    let mut moments = 0;
    for transfer in transfers {
        for length in 1..=transfer.len() {
            let mut node = Node::booted();
            node.dictionary.domain = domain.clone();
            for request in &transfer[..length] {
                assert!(node.sdo(*request).iter().all(|answer| answer[0] != 0x80));
            }
            assert!(!node.server.sdo_is_idle());
            assert_eq!(node.sdo([0x80, 0x10, 0x20, 0, 0, 0, 0, 8]), [[0; 8]; 0]);
            assert!(node.server.sdo_is_idle() && node.dictionary.staging.is_none());
            assert_eq!(node.dictionary.domain, domain);
            assert_eq!(node.run(1_000), []);
            assert_eq!(client::upload(&mut node, 0x2010, 0), Ok(domain.clone()));
            moments += 1;
        }
    }
    assert_eq!(moments, 17);
    // And between the segments of a block that is being sent.
    let mut node = Node::booted();
    node.dictionary.domain = domain.clone();
    node.sdo([0xA4, 0x10, 0x20, 0, 127, 0, 0, 0]);
    let start = frame(0x605, &[0xA3, 0, 0, 0, 0, 0, 0, 0]);
    node.server.receive(&start, node.now, &mut node.dictionary);
    assert!(node.server.poll(node.now, &mut node.dictionary).is_some());
    assert_eq!(node.sdo([0x80, 0x10, 0x20, 0, 0, 0, 0, 8]), [[0; 8]; 0]);
    assert!(node.server.sdo_is_idle());
}

#[test]
fn objects_of_more_than_32_bytes_are_written_and_read() {
    let mut node = Node::booted();
    for length in [32, 33, 34, 2048] {
        let data = pattern(length);
        assert_eq!(client::download(&mut node, 0x2010, 0, &data), Ok(()));
        assert_eq!(client::upload(&mut node, 0x2010, 0), Ok(data.clone()));
        assert_eq!(BlockDownload { data: &data, crc: true, size: true }.run(&mut node, |_| {}), Outcome::Done);
        assert_eq!(BlockUpload { index: 0x2010, ..UPLOAD }.run(&mut node, |_| {}), Ok(data));
    }
}

#[test]
fn the_store_signature_is_the_characters_of_save_in_the_order_of_transmission() {
    let mut node = Node::booted();
    assert_eq!(node.sdo([0x23, 0x10, 0x10, 1, 0x65, 0x76, 0x61, 0x73])[0][0], 0x80);
    assert_eq!(node.write(0x1010, 1, b"load"), Err(Abort::STORE.0));
    assert_eq!(node.dictionary.stored, None);
    assert_eq!(node.sdo([0x23, 0x10, 0x10, 1, b's', b'a', b'v', b'e']), [[0x60, 0x10, 0x10, 1, 0, 0, 0, 0]]);
    assert_eq!(node.dictionary.stored.map(|(group, _)| group), Some(Group::All));
    assert_eq!(node.read(0x1010, 1), Ok(1));
}

#[test]
fn defaults_are_restored_by_load_and_by_nothing_else() {
    let mut node = Node::booted();
    assert_eq!(node.write(0x1011, 3, b"save"), Err(Abort::STORE.0));
    assert_eq!(node.dictionary.restored, None);
    node.write(0x1011, 3, b"load").unwrap();
    assert_eq!(node.dictionary.restored, Some(Group::Application));
    assert_eq!(node.read(0x1011, 0), Ok(3));
}

#[test]
fn the_boot_up_message_is_one_byte_of_zero_and_comes_before_anything_else() {
    let mut node = Node::powered(NODE);
    node.server.emergency(0x1000, 1, [0; 5]);
    let sent = node.task();
    assert_eq!(sent, [frame(0x705, &[0])]);
    assert_eq!(node.shared.state(), NmtState::PreOperational);
}

#[test]
fn an_rpdo_received_before_operational_is_not_applied_later() {
    let mut node = Node::booted();
    node.interrupt(&frame(0x205, &[1; 6]));
    node.interrupt(&frame(0x305, &[1; 8]));
    node.bus(0, &[1, 0]);
    node.sync();
    node.run(10);
    assert!(node.image.set_points.is_empty() && node.image.received.is_empty());
}

#[test]
fn a_stop_followed_by_other_nodes_frames_is_not_lost() {
    let mut node = Node::operational();
    node.interrupt(&frame(0x205, &[1; 6]));
    assert!(!node.image.set_points.is_empty());
    node.interrupt(&frame(0, &[2, 0]));
    // Before the task runs at all.
    assert!(node.image.set_points.is_empty());
    for id in 0x081..=0x77F {
        if id != 0x605 {
            node.interrupt(&frame(id, &[1; 8]));
        }
    }
    assert_eq!((node.shared.state(), node.queue.len()), (NmtState::Stopped, 0));
    assert!(node.image.set_points.is_empty());
    node.task();
    assert_eq!(node.dictionary.events.last(), Some(&Event::State(NmtState::Stopped)));
}

#[test]
fn a_flood_of_other_nodes_frames_leaves_the_queue_to_this_nodes_requests() {
    let mut node = Node::operational();
    for id in 1..=0x7FF {
        node.interrupt(&frame(id, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]));
    }
    let queued = node.queue.iter().map(Frame::id).collect::<Vec<_>>();
    assert_eq!(queued, [0x605, LSS_MASTER]);
}

#[test]
fn a_client_may_take_longer_than_25_ms_and_the_time_out_is_a_setting() {
    for timeout in [30, 500, 5_000] {
        let mut node = Node::powered(NODE);
        let settings = SdoSettings { timeout: timeout * 1_000, ..SdoSettings::default() };
        node.server = Server::new(node.shared, &IDENTITY, settings, NODE);
        node.task();
        node.sdo([0x20, 0x10, 0x20, 0, 0, 0, 0, 0]);
        assert_eq!(node.run(timeout), []);
        assert_eq!(node.run(1).len(), 1);
    }
}

#[test]
fn the_objects_that_report_errors_exist() {
    let mut node = Node::booted();
    for (index, sub_index) in [(0x1001, 0), (0x1003, 0), (0x1011, 1), (0x1014, 0), (0x1015, 0), (0x1016, 1)] {
        assert!(node.read(index, sub_index).is_ok(), "{index:04X}h:{sub_index}");
    }
    assert_eq!(node.read(0x1014, 0), Ok(0x85));
    node.server.emergency(0xFF01, 0x80, [1, 2, 3, 4, 5]);
    assert_eq!(node.task(), [frame(0x85, &[0x01, 0xFF, 0x81, 1, 2, 3, 4, 5])]);
}
