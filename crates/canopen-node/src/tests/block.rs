//! Block transfers over a good bus and over a bad one.

use super::client::{BlockDownload, BlockUpload, Outcome};
use super::*;
use proptest::prelude::*;

const WHOLE: BlockUpload = BlockUpload { index: 0x2010, sub_index: 0, crc: true, block_size: 127, threshold: 0 };

#[test]
fn every_length_up_to_two_kibibytes_passes_by_block_both_ways() {
    let mut node = Node::booted();
    for length in 0..=DOMAIN_SIZE as usize {
        let data = pattern(length);
        for (crc, size) in [(true, true), (false, false), (true, false)] {
            let download = BlockDownload { data: &data, crc, size };
            assert_eq!(download.run(&mut node, |_| {}), Outcome::Done, "{length}");
            assert_eq!(node.dictionary.domain, data);
        }
        for (crc, block_size) in [(true, 127), (false, 1 + (length % 127) as u8)] {
            let upload = BlockUpload { crc, block_size, ..WHOLE };
            assert_eq!(upload.run(&mut node, |_| {}), Ok(data.clone()), "{length}");
        }
    }
    assert!(node.server.sdo_is_idle());
}

#[test]
fn every_block_size_of_the_server_works() {
    for block_size in 1..=127 {
        let mut node = Node::powered(NODE);
        node.server = Server::new(node.shared, &IDENTITY, SdoSettings { block_size, ..SdoSettings::default() }, NODE);
        node.task();
        let data = pattern(900);
        let download = BlockDownload { data: &data, crc: true, size: true };
        assert_eq!(
            download.run(&mut node, |segments| assert!(segments.len() <= usize::from(block_size))),
            Outcome::Done
        );
        assert_eq!(node.dictionary.domain, data);
    }
}

#[test]
fn few_bytes_are_uploaded_plainly_where_the_client_allows_it() {
    let mut node = Node::booted();
    for (length, threshold) in [(3, 3), (20, 21), (22, 21)] {
        node.dictionary.domain = pattern(length);
        let upload = BlockUpload { threshold, ..WHOLE };
        assert_eq!(upload.run(&mut node, |_| {}), Ok(pattern(length)));
    }
    node.dictionary.domain = pattern(21);
    assert_eq!(node.sdo([0xA4, 0x10, 0x20, 0, 127, 21, 0, 0]), [[0x41, 0x10, 0x20, 0, 21, 0, 0, 0]]);
    node.sdo([0x80, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(node.sdo([0xA4, 0x10, 0x20, 0, 127, 20, 0, 0]), [[0xC6, 0x10, 0x20, 0, 21, 0, 0, 0]]);
}

#[test]
fn a_wrong_checksum_changes_nothing() {
    let mut node = Node::booted();
    let mut corrupted = false;
    let data = pattern(300);
    let download = BlockDownload { data: &data, crc: true, size: true };
    let outcome = download.run(&mut node, |segments| {
        segments[3][5] ^= 1;
        corrupted = true;
    });
    assert_eq!((outcome, corrupted), (Outcome::Aborted(Abort::CRC.0), true));
    assert!(node.dictionary.domain.is_empty() && node.dictionary.staging.is_none());
}

#[test]
fn a_value_can_be_written_and_read_by_block() {
    let mut node = Node::booted();
    assert_eq!(node.sdo([0xC2, 0x00, 0x20, 4, 8, 0, 0, 0]), [[0xA4, 0x00, 0x20, 4, 127, 0, 0, 0]]);
    assert_eq!(node.sdo([0x01, 1, 2, 3, 4, 5, 6, 7]), [[0; 8]; 0]);
    assert_eq!(node.sdo([0x82, 8, 0, 0, 0, 0, 0, 0]), [[0xA2, 2, 127, 0, 0, 0, 0, 0]]);
    assert_eq!(node.sdo([0xD9, 0, 0, 0, 0, 0, 0, 0]), [[0xA1, 0, 0, 0, 0, 0, 0, 0]]);
    assert_eq!(node.dictionary.writes, [(0x2000, 4, vec![1, 2, 3, 4, 5, 6, 7, 8])]);
    let upload = BlockUpload { index: 0x2000, sub_index: 4, ..WHOLE };
    assert_eq!(upload.run(&mut node, |_| {}), Ok(vec![1, 2, 3, 4, 5, 6, 7, 8]));
}

#[test]
fn the_last_segment_of_a_block_that_is_lost_ends_in_a_time_out() {
    let mut node = Node::booted();
    let data = pattern(2_000);
    let download = BlockDownload { data: &data, crc: true, size: true };
    let outcome = download.run(&mut node, |segments| {
        segments.pop();
    });
    assert_eq!(outcome, Outcome::Silence);
    assert_eq!(node.run(502), [frame(0x585, &[0x80, 0x10, 0x20, 0, 0, 0, 0x04, 0x05])]);
    assert!(node.server.sdo_is_idle() && node.dictionary.staging.is_none());
}

#[test]
fn an_upload_that_nobody_acknowledges_ends_in_a_time_out() {
    let mut node = Node::booted();
    node.dictionary.domain = pattern(100);
    node.sdo([0xA4, 0x10, 0x20, 0, 10, 0, 0, 0]);
    assert_eq!(node.sdo([0xA3, 0, 0, 0, 0, 0, 0, 0]).len(), 10);
    assert_eq!(node.run(502), [frame(0x585, &[0x80, 0x10, 0x20, 0, 0, 0, 0x04, 0x05])]);
    assert!(node.server.sdo_is_idle());
}

#[test]
fn an_acknowledgement_of_more_than_was_sent_aborts() {
    let mut node = Node::booted();
    node.dictionary.domain = pattern(100);
    node.sdo([0xA4, 0x10, 0x20, 0, 10, 0, 0, 0]);
    node.sdo([0xA3, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(node.sdo([0xA2, 11, 10, 0, 0, 0, 0, 0]), [[0x80, 0x10, 0x20, 0, 3, 0, 0x04, 0x05]]);
}

#[test]
fn a_repeated_last_segment_that_looks_like_an_end_does_not_end() {
    // The 65th segment, marked last, has the command byte C1h.
    for crc in [true, false] {
        let mut node = Node::booted();
        let data = pattern(65 * 7);
        let download = BlockDownload { data: &data, crc, size: true };
        let outcome = download.run(&mut node, |segments| {
            let last = *segments.last().unwrap();
            assert_eq!(last[0], 0xC1);
            segments.push(last);
        });
        assert_eq!(outcome, Outcome::Done);
        assert_eq!(node.dictionary.domain, data);
    }
}

#[derive(Clone, Copy, Debug)]
enum Disturbance {
    Lose(usize),
    Repeat(usize),
    Swap(usize),
}

fn losses_and_repetitions() -> impl Strategy<Value = Vec<Disturbance>> {
    let one = prop_oneof![(0usize..127).prop_map(Disturbance::Lose), (0usize..127).prop_map(Disturbance::Repeat)];
    prop::collection::vec(one, 0..40)
}

/// CAN keeps the order; a gateway may not.
fn losses_and_swaps() -> impl Strategy<Value = Vec<Disturbance>> {
    let one = prop_oneof![(0usize..127).prop_map(Disturbance::Lose), (0usize..127).prop_map(Disturbance::Swap)];
    prop::collection::vec(one, 0..40)
}

fn disturbances() -> impl Strategy<Value = Vec<Disturbance>> {
    (losses_and_repetitions(), losses_and_swaps()).prop_map(|(some, others)| [some, others].concat()).prop_shuffle()
}

/// Applies one of them to the block; where `keep_ends`, its first and last segment arrive.
fn apply(disturbance: Disturbance, segments: &mut Vec<[u8; 8]>, keep_ends: bool) {
    let (first, places) = match keep_ends {
        true => (1, segments.len().saturating_sub(2)),
        false => (0, segments.len()),
    };
    match disturbance {
        Disturbance::Lose(place) if places > 0 => {
            segments.remove(first + place % places);
        }
        Disturbance::Repeat(place) if !segments.is_empty() => {
            let place = place % segments.len();
            segments.insert(place, segments[place]);
        }
        Disturbance::Swap(place) if segments.len() > 1 => {
            let place = place % (segments.len() - 1);
            segments.swap(place, place + 1);
        }
        _ => {}
    }
}

/// Its seven zeros have the checksum that stands in its second and third byte, so the checksum alone would take it for
/// an end.
#[test]
fn the_only_segment_of_an_empty_download_may_come_twice() {
    for crc in [false, true] {
        let mut node = Node::booted();
        let outcome = BlockDownload { data: &[], crc, size: false }.run(&mut node, |segments| {
            apply(Disturbance::Repeat(0), segments, true);
        });
        assert_eq!((outcome, node.dictionary.domain.len()), (Outcome::Done, 0));
    }
}

proptest! {
    /// A block of which nothing but the last segment arrives, twice in a row, is the one loss that ends in a time-out
    /// as well: it cannot be told from that segment's repetition.
    #[test]
    fn lost_and_repeated_segments_of_a_download_come_again(
        length in 0usize..=2048, crc: bool, size: bool,
        disturbances in losses_and_repetitions()
    ) {
        let mut node = Node::booted();
        let data = pattern(length);
        let mut disturbances = disturbances.chunks(5);
        let outcome = BlockDownload { data: &data, crc, size }.run(&mut node, |segments| {
            for disturbance in disturbances.next().unwrap_or_default() {
                apply(*disturbance, segments, true);
            }
        });
        prop_assert_eq!(outcome, Outcome::Done);
        prop_assert_eq!(&node.dictionary.domain, &data);
        prop_assert!(node.server.sdo_is_idle());
    }

    #[test]
    fn whatever_the_bus_does_to_a_download_with_a_checksum_it_is_whole_or_nothing(
        length in 1usize..=2048, disturbances in disturbances()
    ) {
        let mut node = Node::booted();
        node.dictionary.domain = vec![0xAA; 3];
        let data = pattern(length);
        let mut disturbances = disturbances.chunks(8);
        let outcome = BlockDownload { data: &data, crc: true, size: true }.run(&mut node, |segments| {
            for disturbance in disturbances.next().unwrap_or_default() {
                apply(*disturbance, segments, false);
            }
        });
        node.run(600);
        let whole = outcome == Outcome::Done;
        prop_assert_eq!(&node.dictionary.domain, if whole { &data } else { &[0xAA; 3][..] });
        prop_assert!(node.server.sdo_is_idle() && node.dictionary.staging.is_none());
    }

    #[test]
    fn segments_of_an_upload_that_the_client_misses_come_again(
        length in 0usize..=2048, crc: bool, block_size in 1u8..=127, disturbances in disturbances()
    ) {
        let mut node = Node::booted();
        node.dictionary.domain = pattern(length);
        let mut disturbances = disturbances.chunks(3);
        let upload = BlockUpload { crc, block_size, ..WHOLE };
        let data = upload.run(&mut node, |segments| {
            for disturbance in disturbances.next().unwrap_or_default() {
                apply(*disturbance, segments, false);
            }
        });
        prop_assert_eq!(data, Ok(pattern(length)));
        prop_assert!(node.server.sdo_is_idle());
    }
}
