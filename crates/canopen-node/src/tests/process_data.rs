//! SYNC, RPDOs and TPDOs.

use super::*;

const RPDO1: u16 = 0x205;
const RPDO2: u16 = 0x305;

#[test]
fn an_rpdo_is_in_the_process_image_before_the_interrupt_returns() {
    let mut node = Node::operational();
    node.interrupt(&frame(RPDO1, &[0x34, 0x12, 4, 3, 2, 1]));
    assert_eq!(node.image.set_points, BTreeMap::from([(U16.0, 0x1234), (U32.0, 0x0102_0304)]));
    assert_eq!(node.image.received, [0]);
}

#[test]
fn a_synchronous_rpdo_counts_with_the_next_sync_and_the_newest_wins() {
    let mut node = Node::operational();
    node.interrupt(&frame(RPDO2, &[1; 8]));
    node.interrupt(&frame(RPDO2, &[2; 8]));
    assert!(node.image.set_points.is_empty());
    node.sync();
    assert_eq!(node.image.set_points, BTreeMap::from([(U64.0, 0x0202_0202_0202_0202)]));
    node.image.set_points.clear();
    node.sync();
    assert!(node.image.set_points.is_empty());
}

#[test]
fn an_rpdo_that_waits_for_sync_is_forgotten_with_the_state_and_with_its_mapping() {
    let mut node = Node::operational();
    node.interrupt(&frame(RPDO2, &[1; 8]));
    node.interrupt(&frame(0, &[2, 0]));
    node.interrupt(&frame(0, &[1, 0]));
    node.sync();
    assert!(node.image.set_points.is_empty());
    node.interrupt(&frame(RPDO2, &[1; 8]));
    map(&mut node, 0x1401, 0x1601, 0x305, &[U8]).unwrap();
    node.sync();
    assert!(node.image.set_points.is_empty());
}

#[test]
fn rpdos_outside_operational_change_nothing_and_are_not_applied_later() {
    let mut node = Node::booted();
    for command in [0x80, 2] {
        node.interrupt(&frame(0, &[command, 0]));
        node.interrupt(&frame(RPDO1, &[1; 6]));
        node.interrupt(&frame(RPDO2, &[1; 8]));
        node.sync();
        node.interrupt(&frame(0, &[1, 0]));
        node.sync();
        assert_eq!(node.task(), []);
        assert!(node.image.set_points.is_empty() && node.image.received.is_empty());
    }
}

#[test]
fn an_rpdo_that_is_too_short_changes_nothing_and_one_that_is_too_long_counts() {
    let mut node = Node::operational();
    assert_eq!(node.bus(RPDO1, &[1; 5]), [frame(0x85, &[0x10, 0x82, 0, 1, 0, 0, 0, 0])]);
    assert!(node.image.set_points.is_empty());
    assert_eq!(node.bus(RPDO1, &[1; 8]), [frame(0x85, &[0x20, 0x82, 0, 1, 0, 0, 0, 0])]);
    assert_eq!(node.image.set_points.len(), 2);
}

#[test]
fn an_rpdo_that_misses_its_deadline_is_reported_once_and_watched_from_the_next_one_on() {
    let mut node = Node::operational();
    node.write(0x1400, 5, &20u16.to_le_bytes()).unwrap();
    assert_eq!(node.run(100), []);
    node.interrupt(&frame(RPDO1, &[0; 6]));
    assert_eq!(node.run(20), []);
    assert_eq!(node.run(1), [frame(0x85, &[0x50, 0x82, 0x11, 1, 0, 0, 0, 0])]);
    assert_eq!(node.dictionary.events.last(), Some(&Event::RpdoDeadline { pdo: 0 }));
    assert_eq!(node.run(100), []);
    assert_eq!(node.bus(RPDO1, &[0; 6]), [frame(0x85, &[0; 8])]);
    // Outside OPERATIONAL nothing is due.
    node.bus(0, &[0x80, 0]);
    assert_eq!(node.run(100), []);
}

#[test]
fn a_synchronous_tpdo_leaves_within_the_interrupt_of_its_sync() {
    let mut node = Node::operational();
    let expected = frame(0x185, &[0x10, 0x02, 0x20, 0x03, 0x00, 0x20]);
    assert_eq!(node.sync(), [expected]);
    assert_eq!(node.image.syncs, 1);
    node.write(0x1800, 2, &[3]).unwrap();
    let sent = (0..9).map(|_| node.sync().len()).collect::<Vec<_>>();
    assert_eq!(sent, [0, 0, 1, 0, 0, 1, 0, 0, 1]);
    node.bus(0, &[0x80, 0]);
    assert_eq!(node.sync(), []);
}

#[test]
fn of_syncs_that_follow_too_soon_none_counts() {
    let mut node = Node::operational();
    let sync = frame(0x80, &[]);
    // A bus full of them, one in 50 us, over the wrap of the clock.
    let count = |node: &mut Node, interval: u32| {
        let counted = (0..40_000).filter(|_| {
            node.now = node.now.wrapping_add(interval);
            !node.interrupt(&sync).is_empty()
        });
        counted.count()
    };
    assert_eq!(count(&mut node, SHORTEST_SYNC.div_ceil(4)), 10_000);
    assert_eq!(count(&mut node, SHORTEST_SYNC), 40_000);
    assert_eq!(count(&mut node, SHORTEST_SYNC - 1), 20_000);
    // The first one in a new state counts.
    assert_eq!(node.sync().len(), 1);
    node.bus(0, &[0x80, NODE]);
    node.bus(0, &[1, NODE]);
    assert_eq!(node.interrupt(&sync).len(), 1);
}

#[test]
fn sync_can_be_moved_to_a_free_identifier_only() {
    let mut node = Node::operational();
    for refused in [0x4000_0080u32, 0x2000_0080, 0, 0x601, 0x700 + 5, 0x800] {
        assert_eq!(node.write(0x1005, 0, &refused.to_le_bytes()), Err(Abort::VALUE.0), "{refused:#x}");
    }
    node.write(0x1005, 0, &0x90u32.to_le_bytes()).unwrap();
    assert_eq!(node.sync(), []);
    assert_eq!(node.interrupt(&frame(0x90, &[])).len(), 1);
}

#[test]
fn a_tpdo_of_type_0_follows_an_event_or_a_change_with_the_next_sync() {
    let mut node = Node::operational();
    node.write(0x1800, 2, &[0]).unwrap();
    // Once when the node became operational.
    assert_eq!(node.sync().len(), 1);
    assert_eq!(node.sync().len(), 0);
    node.shared.trigger(0);
    assert_eq!(node.task(), []);
    assert_eq!(node.sync().len(), 1);
    assert_eq!(node.sync().len(), 0);
    node.image.actual = node.image.actual.wrapping_add(1);
    assert_eq!(node.task(), []);
    assert_eq!(node.sync().len(), 1);
    assert_eq!(node.sync().len(), 0);
}

#[test]
fn a_tpdo_of_type_254_and_255_is_sent_on_a_change_and_keeps_its_inhibit_time() {
    for kind in [254, 255] {
        let mut node = Node::booted();
        node.dictionary.values.insert((0x2000, 1), vec![0]);
        map(&mut node, 0x1801, 0x1A01, 0x285, &[U8]).unwrap();
        node.write(0x1801, 1, &0x8000_0285u32.to_le_bytes()).unwrap();
        node.write(0x1801, 2, &[kind]).unwrap();
        node.write(0x1801, 3, &50u16.to_le_bytes()).unwrap();
        node.write(0x1801, 1, &0x285u32.to_le_bytes()).unwrap();
        assert_eq!(node.bus(0, &[1, 0]), [frame(0x285, &[0])]);
        assert_eq!(node.run(100), [], "nothing changes");
        node.dictionary.values.insert((0x2000, 1), vec![1]);
        assert_eq!(node.run(1), [frame(0x285, &[1])]);
        // Three changes within the inhibit time: the newest counts.
        for value in 2..5 {
            node.dictionary.values.insert((0x2000, 1), vec![value]);
            assert_eq!(node.run(1), []);
        }
        assert_eq!(node.run(2), [frame(0x285, &[4])]);
        assert_eq!(node.run(100), []);
        // There and back within the inhibit time is no change.
        node.dictionary.values.insert((0x2000, 1), vec![5]);
        assert_eq!(node.run(1).len(), 1);
        node.dictionary.values.insert((0x2000, 1), vec![6]);
        node.run(1);
        node.dictionary.values.insert((0x2000, 1), vec![5]);
        assert_eq!(node.run(100), []);
    }
}

#[test]
fn a_sync_with_data_counts_and_is_reported_once() {
    let mut node = Node::operational();
    node.sync();
    node.task();
    let told = |frames: &[Frame]| {
        frames.iter().filter(|frame| frame.id() == 0x85).map(|frame| frame.data()[..3].to_vec()).collect::<Vec<_>>()
    };
    let mut sent = Vec::new();
    for counter in 1..=5u8 {
        node.now += 1_000;
        let answered = node.bus(0x80, &[counter]);
        assert!(answered.iter().any(|frame| frame.id() == 0x185), "{answered:?}");
        sent.extend(answered);
    }
    assert_eq!(told(&sent), [[0x40, 0x82, 0x11]]);
    // Its end comes with another NMT state.
    assert_eq!(told(&node.bus(0, &[0x80, 0])), [[0, 0, 0]]);
}

#[test]
fn a_sync_with_a_counter_is_as_long_as_1019h_says_and_another_one_counts_and_is_reported() {
    let mut node = Node::operational();
    for (value, taken) in [(0, true), (1, false), (2, true), (240, true), (241, false), (255, false), (10, true)] {
        let expected = if taken { Ok(()) } else { Err(Abort::VALUE.0) };
        assert_eq!(node.write(0x1019, 0, &[value]), expected, "{value}");
    }
    let mut sync = |data: &[u8]| {
        node.now += 1_000;
        let sent = node.bus(0x80, data);
        assert!(sent.iter().any(|frame| frame.id() == 0x185), "{data:?} counts");
        sent.iter().filter(|frame| frame.id() == 0x85).map(|frame| frame.data()[..3].to_vec()).collect::<Vec<_>>()
    };
    assert_eq!((sync(&[1]), sync(&[2])), (vec![], vec![]));
    assert_eq!(sync(&[]), [[0x40, 0x82, 0x11]]);
    assert_eq!((sync(&[]), sync(&[3, 0]), sync(&[4])), (vec![], vec![], vec![]), "once");
    // A client that writes what SYNC has has seen to it.
    let told = |frames: Vec<Frame>| frames.iter().map(|frame| (frame.id(), frame.data()[0])).collect::<Vec<_>>();
    assert_eq!(told(node.bus(0x605, &[0x2F, 0x19, 0x10, 0, 0, 0, 0, 0])), [(0x585, 0x60), (0x85, 0)]);
    assert_eq!(node.read(0x1001, 0), Ok(0));
    node.now += 1_000;
    assert_eq!(told(node.bus(0x80, &[])), [(0x185, 0x10)]);
    node.write(0x1019, 0, &[2]).unwrap();
    node.now += 1_000;
    assert_eq!(told(node.bus(0x80, &[1, 2])), [(0x185, 0x10), (0x85, 0x40)]);
}

#[test]
fn a_synchronous_tpdo_counts_from_the_sync_with_its_start_value() {
    // 1019h, type, start value, and the counters of the SYNCs that it follows out of twice 1, 2, 3, 4.
    for (overflow, every, start, expected) in [
        (4, 1, 0, vec![1, 2, 3, 4, 1, 2, 3, 4]),
        (4, 1, 3, vec![3, 4, 1, 2, 3, 4]),
        (4, 2, 3, vec![4, 2, 4]),
        (4, 2, 4, vec![1, 3]),
        (4, 3, 2, vec![4, 3]),
        // It is never that high.
        (4, 1, 5, vec![]),
        // SYNC has a counter that nobody announced.
        (0, 1, 3, vec![1, 2, 3, 4, 1, 2, 3, 4]),
    ] {
        let mut node = Node::booted();
        node.write(0x1019, 0, &[overflow]).unwrap();
        assert_eq!(node.write(0x1800, 6, &[start]), Err(Abort::VALUE.0), "while the PDO exists");
        node.write(0x1800, 1, &0x8000_0185u32.to_le_bytes()).unwrap();
        node.write(0x1800, 2, &[every]).unwrap();
        node.write(0x1800, 6, &[start]).unwrap();
        node.write(0x1800, 1, &0x185u32.to_le_bytes()).unwrap();
        let counters = |node: &mut Node| {
            let sent = [1, 2, 3, 4, 1, 2, 3, 4].into_iter().filter(|counter| {
                node.now = node.now.wrapping_add(SHORTEST_SYNC);
                !node.interrupt(&frame(0x80, &[*counter])).is_empty()
            });
            sent.collect::<Vec<u8>>()
        };
        // From the beginning whenever the node, or the PDO, begins.
        for _ in 0..2 {
            node.bus(0, &[1, NODE]);
            assert_eq!(counters(&mut node), expected, "{overflow} {every} {start}");
            node.bus(0, &[0x80, NODE]);
        }
        node.bus(0, &[1, NODE]);
        node.sync();
        counters(&mut node);
        node.write(0x1800, 1, &0x8000_0185u32.to_le_bytes()).unwrap();
        node.write(0x1800, 1, &0x185u32.to_le_bytes()).unwrap();
        assert_eq!(counters(&mut node), expected, "set up anew: {overflow} {every} {start}");
    }
    let mut node = Node::booted();
    for (start, expected) in [(240, Ok(())), (241, Err(Abort::VALUE.0))] {
        assert_eq!(node.write(0x1801, 6, &[start]), expected);
    }
    assert_eq!(node.write(0x1400, 6, &[0]), Err(Abort::NO_SUB_INDEX.0));
    assert_eq!((node.read(0x1400, 0), node.read(0x1800, 0)), (Ok(5), Ok(6)));
}

#[test]
fn an_event_driven_tpdo_keeps_its_inhibit_time_and_its_event_timer() {
    let mut node = Node::booted();
    node.dictionary.values.insert((0x2000, 1), vec![0x77]);
    map(&mut node, 0x1801, 0x1A01, 0x285, &[U8]).unwrap();
    node.write(0x1801, 1, &0x8000_0285u32.to_le_bytes()).unwrap();
    // 5 ms and 20 ms.
    node.write(0x1801, 3, &50u16.to_le_bytes()).unwrap();
    node.write(0x1801, 5, &20u16.to_le_bytes()).unwrap();
    node.write(0x1801, 1, &0x285u32.to_le_bytes()).unwrap();
    assert_eq!(node.run(100), []);
    assert_eq!(node.bus(0, &[1, 0]), [frame(0x285, &[0x77])]);
    node.shared.trigger(1);
    assert_eq!(node.run(4), []);
    assert_eq!(node.run(1).len(), 1);
    assert_eq!(node.run(19).len(), 0);
    assert_eq!(node.run(1).len(), 1);
    assert_eq!(node.run(2_000).len(), 100);
    // Faster than the inhibit time allows.
    let mut sent = 0;
    for _ in 0..100 {
        node.shared.trigger(1);
        sent += node.run(1).len();
    }
    assert_eq!(sent, 20);
    assert_eq!(node.write(0x1801, 3, &[0; 2]), Err(Abort::VALUE.0));
}

/// Sets up a PDO by the procedure of CiA 301.
fn map(node: &mut Node, communication: u16, mapping: u16, id: u32, objects: &[MappedObject]) -> Result<(), u32> {
    node.write(communication, 1, &(0x8000_0000 | id).to_le_bytes())?;
    node.write(mapping, 0, &[0])?;
    for (object, sub_index) in objects.iter().zip(1..) {
        node.write(mapping, sub_index, &object.0.to_le_bytes())?;
    }
    node.write(mapping, 0, &[objects.len() as u8])?;
    node.write(communication, 1, &id.to_le_bytes())
}

#[test]
fn a_mapping_set_up_at_run_time_is_what_counts() {
    let mut node = Node::operational();
    // A dummy entry skips a byte.
    map(&mut node, 0x1403, 0x1603, 0x444, &[MappedObject::new(5, 0, 8), U8, U16]).unwrap();
    node.interrupt(&frame(0x444, &[9, 1, 2, 3]));
    assert_eq!(node.image.set_points, BTreeMap::from([(U8.0, 1), (U16.0, 0x0302)]));
    assert_eq!(node.read(0x1603, 0), Ok(3));
    assert_eq!(node.read(0x1603, 2), Ok(U8.0.into()));
    map(&mut node, 0x1803, 0x1A03, 0x445, &[U64]).unwrap();
    node.write(0x1803, 2, &[1]).unwrap();
    let sent = node.sync();
    assert_eq!(sent.last(), Some(&frame(0x445, &(0xA5A5_A5A5_0000_0000 | u64::from(U64.0)).to_le_bytes())));
}

#[test]
fn a_mapping_cannot_change_while_the_pdo_exists() {
    let mut node = Node::booted();
    assert_eq!(node.write(0x1600, 0, &[0]), Err(Abort::ACCESS.0));
    assert_eq!(node.write(0x1600, 1, &U8.0.to_le_bytes()), Err(Abort::ACCESS.0));
    assert_eq!(node.write(0x1400, 1, &0x206u32.to_le_bytes()), Err(Abort::VALUE.0));
    node.write(0x1400, 1, &0x8000_0205u32.to_le_bytes()).unwrap();
    assert_eq!(node.write(0x1600, 1, &U8.0.to_le_bytes()), Err(Abort::ACCESS.0));
    node.write(0x1600, 0, &[0]).unwrap();
    node.write(0x1600, 1, &U8.0.to_le_bytes()).unwrap();
}

#[test]
fn what_cannot_be_mapped_is_refused() {
    let mut node = Node::booted();
    let mut map =
        |communication, mapping, objects: &[MappedObject]| map(&mut node, communication, mapping, 0x444, objects);
    assert_eq!(map(0x1403, 0x1603, &[MappedObject::new(0x3000, 0, 8)]), Err(Abort::NO_OBJECT.0));
    assert_eq!(map(0x1403, 0x1603, &[MappedObject::new(0x2000, 9, 8)]), Err(Abort::NO_SUB_INDEX.0));
    assert_eq!(map(0x1403, 0x1603, &[MappedObject::new(0x2000, 1, 7)]), Err(Abort::NOT_MAPPABLE.0));
    assert_eq!(map(0x1403, 0x1603, &[MappedObject::new(0x2001, 0, 32)]), Err(Abort::NOT_MAPPABLE.0));
    assert_eq!(map(0x1403, 0x1603, &[MappedObject::new(0x2010, 0, 64)]), Err(Abort::NOT_MAPPABLE.0));
    assert_eq!(map(0x1803, 0x1A03, &[MappedObject::new(0x2002, 0, 32)]), Err(Abort::NOT_MAPPABLE.0));
    assert_eq!(map(0x1803, 0x1A03, &[MappedObject::new(5, 0, 8)]), Err(Abort::NO_OBJECT.0));
    for own in [0x1017_0010, 0x1018_0120, 0x1801_0210, 0x1001_0008] {
        assert_eq!(map(0x1803, 0x1A03, &[MappedObject(own)]), Err(Abort::NOT_MAPPABLE.0), "{own:08x}");
    }
    assert_eq!(map(0x1403, 0x1603, &[U64, U8]), Err(Abort::PDO_LENGTH.0));
    assert_eq!(map(0x1403, 0x1603, &[U8; 8]), Ok(()));
    assert_eq!(node.write(0x1403, 1, &0x8000_0444u32.to_le_bytes()), Ok(()));
    assert_eq!(node.write(0x1603, 0, &[9]), Err(Abort::PDO_LENGTH.0));
    assert_eq!(node.write(0x1603, 9, &[0; 4]), Err(Abort::NO_SUB_INDEX.0));
}

#[test]
fn transmission_types_that_need_remote_frames_and_reserved_ones_are_refused() {
    let mut node = Node::booted();
    for kind in 0..=255 {
        let expected = if (241..=253).contains(&kind) { Err(Abort::VALUE.0) } else { Ok(()) };
        assert_eq!(node.write(0x1800, 2, &[kind]), expected, "{kind}");
        assert_eq!(node.write(0x1400, 2, &[kind]), expected, "{kind}");
    }
    assert_eq!(node.write(0x1400, 3, &[0; 2]), Err(Abort::NO_SUB_INDEX.0));
    assert_eq!(node.write(0x1800, 4, &[0]), Err(Abort::NO_SUB_INDEX.0));
    for restricted in [0u32, 0x601, 0x2000_0205, 0x7E5] {
        node.write(0x1403, 1, &0x8000_0000u32.to_le_bytes()).unwrap();
        assert_eq!(node.write(0x1403, 1, &restricted.to_le_bytes()), Err(Abort::VALUE.0));
    }
}
