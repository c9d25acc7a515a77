//! Expedited and segmented transfers, and what a client may not do.

use super::*;

#[test]
fn every_length_up_to_two_kibibytes_passes_segmented_and_expedited_both_ways() {
    let mut node = Node::booted();
    for length in 0..=DOMAIN_SIZE as usize {
        let data = pattern(length);
        assert_eq!(client::download(&mut node, 0x2010, 0, &data), Ok(()));
        assert_eq!(node.dictionary.domain, data);
        assert_eq!(client::upload(&mut node, 0x2010, 0), Ok(data.clone()));
        assert_eq!(client::segmented_download(&mut node, 0x2010, 0, &data, false), Ok(()));
        assert_eq!(node.dictionary.domain, data);
    }
    assert!(node.server.sdo_is_idle());
}

#[test]
fn a_value_is_read_and_written_whole_however_it_is_transferred() {
    let mut node = Node::booted();
    for (sub_index, bytes) in [(1, 1), (2, 2), (3, 4), (4, 8)] {
        for size in [true, false] {
            let data = pattern(bytes);
            assert_eq!(client::segmented_download(&mut node, 0x2000, sub_index, &data, size), Ok(()));
            assert_eq!(client::upload(&mut node, 0x2000, sub_index), Ok(data));
        }
    }
    // Between the two frames of an upload the value changes; the second frame belongs to the first all the same.
    node.dictionary.values.insert((0x2000, 4), vec![1; 8]);
    assert_eq!(node.sdo([0x40, 0x00, 0x20, 4, 0, 0, 0, 0]), [[0x41, 0x00, 0x20, 4, 8, 0, 0, 0]]);
    assert_eq!(node.sdo([0x60, 0, 0, 0, 0, 0, 0, 0]), [[0, 1, 1, 1, 1, 1, 1, 1]]);
    node.dictionary.values.insert((0x2000, 4), vec![2; 8]);
    assert_eq!(node.sdo([0x70, 0, 0, 0, 0, 0, 0, 0]), [[0x1D, 1, 0, 0, 0, 0, 0, 0]]);
}

#[test]
fn an_expedited_write_without_a_size_gives_the_entry_as_much_as_it_takes() {
    let mut node = Node::booted();
    assert_eq!(node.sdo([0x22, 0x00, 0x20, 2, 0x34, 0x12, 0xEE, 0xEE]), [[0x60, 0x00, 0x20, 2, 0, 0, 0, 0]]);
    assert_eq!(node.dictionary.writes, [(0x2000, 2, vec![0x34, 0x12])]);
    // Four bytes are not eight.
    assert_eq!(node.sdo([0x22, 0x00, 0x20, 4, 1, 2, 3, 4]), [[0x80, 0x00, 0x20, 4, 0x13, 0, 0x07, 0x06]]);
}

#[test]
fn a_wrong_length_changes_nothing() {
    let mut node = Node::booted();
    for length in [1usize, 3, 4, 7, 8] {
        let refusal = if length < 2 { Abort::TOO_SHORT } else { Abort::TOO_LONG };
        assert_eq!(client::download(&mut node, 0x2000, 2, &pattern(length)), Err(refusal.0), "{length}");
        assert_eq!(client::segmented_download(&mut node, 0x2000, 2, &pattern(length), false), Err(refusal.0));
    }
    let long = pattern(DOMAIN_SIZE as usize + 1);
    assert_eq!(client::download(&mut node, 0x2010, 0, &long), Err(Abort::TOO_LONG.0));
    assert_eq!(client::segmented_download(&mut node, 0x2010, 0, &long, false), Err(Abort::TOO_LONG.0));
    // Fewer and more bytes than announced.
    node.sdo([0x21, 0x10, 0x20, 0, 9, 0, 0, 0]);
    assert_eq!(node.sdo([0x01, 0, 0, 0, 0, 0, 0, 0]), [[0x80, 0x10, 0x20, 0, 0x13, 0, 0x07, 0x06]]);
    node.sdo([0x21, 0x10, 0x20, 0, 6, 0, 0, 0]);
    assert_eq!(node.sdo([0x01, 0, 0, 0, 0, 0, 0, 0]), [[0x80, 0x10, 0x20, 0, 0x12, 0, 0x07, 0x06]]);
    assert!(node.dictionary.writes.is_empty() && node.dictionary.domain.is_empty() && node.server.sdo_is_idle());
    assert_eq!(node.dictionary.opened, node.dictionary.closed);
}

#[test]
fn refusals_say_why() {
    let mut node = Node::booted();
    assert_eq!(node.read(0x3000, 0), Err(Abort::NO_OBJECT.0));
    assert_eq!(node.read(0x2000, 9), Err(Abort::NO_SUB_INDEX.0));
    assert_eq!(node.read(0x2002, 0), Err(Abort::WRITE_ONLY.0));
    assert_eq!(node.write(0x2001, 0, &[0; 4]), Err(Abort::READ_ONLY.0));
    assert_eq!(node.write(0x1008, 0, b"x"), Err(Abort::READ_ONLY.0));
    node.dictionary.refusal = Some(Abort::DEVICE_STATE);
    assert_eq!(node.write(0x2010, 0, &[1; 20]), Err(Abort::DEVICE_STATE.0));
    assert!(node.dictionary.domain.is_empty() && node.dictionary.staging.is_none());
    // SDO network variables and unknown commands.
    for command in [0xE0, 0xA1, 0xC1, 0x00, 0x60] {
        assert_eq!(node.sdo([command, 0, 0, 0, 0, 0, 0, 0]), [[0x80, 0, 0, 0, 1, 0, 0x04, 0x05]], "{command:#x}");
    }
}

#[test]
fn a_toggle_bit_that_does_not_alternate_aborts() {
    let toggle = [0x80, 0x10, 0x20, 0, 0, 0, 0x03, 0x05];
    let mut node = Node::booted();
    node.sdo([0x20, 0x10, 0x20, 0, 0, 0, 0, 0]);
    assert_eq!(node.sdo([0x00, 1, 2, 3, 4, 5, 6, 7]), [[0x20, 0, 0, 0, 0, 0, 0, 0]]);
    assert_eq!(node.sdo([0x00, 1, 2, 3, 4, 5, 6, 7]), [toggle]);
    assert!(node.dictionary.staging.is_none());
    node.dictionary.domain = pattern(20);
    node.sdo([0x40, 0x10, 0x20, 0, 0, 0, 0, 0]);
    assert_eq!(node.sdo([0x70, 0, 0, 0, 0, 0, 0, 0]), [toggle]);
}

#[test]
fn a_silent_client_loses_its_transfer_after_the_time_out() {
    let mut node = Node::booted();
    node.sdo([0x21, 0x10, 0x20, 0, 20, 0, 0, 0]);
    assert_eq!(node.run(500), []);
    assert!(node.dictionary.staging.is_some());
    assert_eq!(node.run(2), [frame(0x585, &[0x80, 0x10, 0x20, 0, 0, 0, 0x04, 0x05])]);
    assert!(node.dictionary.staging.is_none() && node.server.sdo_is_idle());
    assert_eq!(node.run(2_000), []);
}

#[test]
fn a_client_that_is_slow_within_the_time_out_succeeds() {
    let mut node = Node::booted();
    node.sdo([0x21, 0x10, 0x20, 0, 14, 0, 0, 0]);
    node.run(450);
    node.sdo([0x00, 1, 2, 3, 4, 5, 6, 7]);
    node.run(450);
    node.sdo([0x11, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(node.dictionary.domain.len(), 14);
}

#[test]
fn a_second_client_ends_the_transfer_and_nothing_is_half_written() {
    let mut node = Node::booted();
    node.dictionary.domain = pattern(100);
    node.sdo([0x21, 0x10, 0x20, 0, 20, 0, 0, 0]);
    node.sdo([0x00, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(node.read(0x2001, 0), Err(Abort::COMMAND.0));
    assert_eq!(node.dictionary.domain, pattern(100));
    assert!(node.dictionary.staging.is_none());
    assert_eq!(node.read(0x2001, 0), Ok(0x0403_0201));
}

#[test]
fn requests_that_are_not_eight_bytes_long_are_ignored() {
    let mut node = Node::booted();
    for length in 0..8 {
        assert_eq!(node.bus(0x605, &[0x40, 0x01, 0x20, 0, 0, 0, 0, 0][..length]), []);
    }
    assert_eq!(node.bus(0x604, &[0x40, 0x01, 0x20, 0, 0, 0, 0, 0]), []);
}

#[test]
fn there_is_no_sdo_when_stopped_and_a_transfer_in_progress_ends() {
    let mut node = Node::operational();
    node.sdo([0x21, 0x10, 0x20, 0, 20, 0, 0, 0]);
    assert_eq!(node.bus(0, &[2, NODE]), []);
    assert!(node.server.sdo_is_idle() && node.dictionary.staging.is_none());
    assert_eq!(node.sdo([0x40, 0x01, 0x20, 0, 0, 0, 0, 0]), [[0; 8]; 0]);
    // Nor is a request served that was queued before the stop.
    node.bus(0, &[1, NODE]);
    node.interrupt(&frame(0x605, &[0x2F, 0x00, 0x20, 1, 7, 0, 0, 0]));
    node.interrupt(&frame(0, &[2, NODE]));
    assert_eq!(node.task(), []);
    assert!(node.dictionary.writes.is_empty());
}
