//! Stores by 1010h: their number, damaged records, and the date of the configuration.

use super::*;
use crate::joint::state_machine::{Controlword, State};
use crate::objects::store_budget::REFILL;
use friction_compensation::parameters::slots::{
    BLANK, DOUBLE_WORD, Layout, OVERHEAD, PAGE_WORDS, ReadError, SlotFlash, Slots, WriteError,
};

const NOT_NOW: u32 = 0x0800_0022;

impl Node {
    fn store(&mut self, sub_index: u8) -> Result<(), u32> {
        self.download(0x1010, sub_index, b"save")
    }

    /// Another value than the one before, of something that is stored.
    fn change(&mut self, number: u16) {
        self.download(0x1017, 0, &number.to_le_bytes()).unwrap();
    }

    fn writes(&mut self) -> u32 {
        self.objects.program().stores
    }

    /// Sets the time since power-up, ms, from then on.
    fn is_at(&mut self, now: u32) {
        self.now = now * 1_000;
        let observed = self.observed;
        self.objects.poll(now.into(), &observed);
    }
}

#[test]
fn what_is_stored_already_is_not_written_again_and_costs_nothing() {
    let mut node = Node::new();
    node.change(50);
    node.store(1).unwrap();
    for _ in 0..100 {
        node.store(1).unwrap();
        node.store(2).unwrap();
        node.store(3).unwrap();
    }
    assert_eq!((node.writes(), node.number(0x2304, 2)), (1, u64::from(STORES) - 1));
    node.change(51);
    node.store(1).unwrap();
    assert_eq!(node.writes(), 2);
    node.download(0x1011, 1, b"load").unwrap();
    node.download(0x1011, 1, b"load").unwrap();
    assert_eq!(node.writes(), 3);
}

#[test]
fn whoever_stores_in_a_loop_is_stopped_and_no_reset_over_the_bus_gives_anything_back() {
    let mut node = Node::new();
    for number in 1..=u16::from(STORES) {
        node.change(number);
        node.store(1).unwrap();
        assert_eq!(node.objects.program().stores_left, Some(STORES - number as u8));
    }
    let refused = |node: &mut Node, number| {
        node.change(number);
        assert_eq!([1, 2].map(|sub_index| node.store(sub_index)), [Err(NOT_NOW); 2]);
        assert_eq!(node.download(0x1011, 2, b"load"), Err(NOT_NOW));
        // LSS: configuration state, node id 7, store.
        node.receive(0x7E5, &[4, 1, 0, 0, 0, 0, 0, 0]);
        node.receive(0x7E5, &[0x11, 7, 0, 0, 0, 0, 0, 0]);
        let answers = node.receive(0x7E5, &[0x17, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(answers[0].data()[..2], [0x17, 2]);
        node.receive(0x7E5, &[0x11, NODE, 0, 0, 0, 0, 0, 0]);
        node.receive(0x7E5, &[4, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(node.writes(), u32::from(STORES));
    };
    refused(&mut node, 100);
    for command in [0x82, 0x81] {
        node.receive(0, &[command, NODE]);
        node.task();
        refused(&mut node, 101);
    }
    let life = LifeCycle::new(Target { product: 2, serial: 4 }, 0, 0);
    let start = Start { stores_left: STORES, ..Start::new(None, false, &BOARD.joint, &BOARD.bridge) };
    node.objects.restart(life, StoredImages::default(), &start);
    refused(&mut node, 102);
    // A program that is started anew has what was told last, which is none.
    assert_eq!(node.objects.program().stores_left, Some(0));
    node.is_at(REFILL - 1);
    refused(&mut node, 103);
    node.is_at(REFILL);
    assert_eq!((node.objects.program().stores_left, node.number(0x2304, 2)), (Some(1), 1));
    node.store(1).unwrap();
    node.change(104);
    assert_eq!(node.store(1), Err(NOT_NOW));
}

#[test]
fn a_program_that_starts_with_no_stores_left_waits_for_the_first() {
    let start = Start { stores_left: 0, ..Start::new(None, false, &BOARD.joint, &BOARD.bridge) };
    let mut node = Node::starting(Memory::default(), &start, &Guard::default());
    assert_eq!(node.store(1), Err(NOT_NOW));
    node.is_at(REFILL);
    node.store(1).unwrap();
}

/// A flash of two pages, in which any byte can be damaged.
#[derive(Clone)]
struct Flash(Vec<[u8; DOUBLE_WORD]>);

impl SlotFlash for Flash {
    fn erase_page(&mut self, page: usize) -> Result<(), WriteError> {
        self.0[page * PAGE_WORDS..][..PAGE_WORDS].fill(BLANK);
        Ok(())
    }

    fn program(&mut self, word: usize, bytes: [u8; DOUBLE_WORD]) -> Result<(), WriteError> {
        assert!(self.0[word] == BLANK || bytes == [0; DOUBLE_WORD]);
        self.0[word] = bytes;
        Ok(())
    }

    fn read(&mut self, word: usize) -> Result<[u8; DOUBLE_WORD], ReadError> {
        Ok(self.0[word])
    }
}

impl Flash {
    /// Slots, record and start as a program finds them.
    fn start(&mut self) -> (Slots, Option<Vec<u8>>, Start) {
        let mut slots = Slots::open(self, Layout::new(0, 1, 2).unwrap()).unwrap();
        let found = slots.usable(self).unwrap().and_then(|slot| slots.range(slot));
        let record = found.map(|range| self.0.as_flattened()[range].to_vec());
        let start = Start::new(record.as_deref(), slots.is_lost(), &BOARD.joint, &BOARD.bridge);
        (slots, record, Start { stores_left: STORES, ..start })
    }

    /// A joint that has found it, ready to be switched on as far as the rest of it goes.
    fn node(&mut self) -> Node {
        let (_, record, start) = self.start();
        let mut node = Node::starting(Memory { record, ..Memory::default() }, &start, &Guard::default());
        node.receive(0, &[1, NODE]);
        node.observed.telemetry.state = State::SwitchOnDisabled;
        node
    }
}

/// Records of two stiffnesses, the newer one last, each stored by a joint.
fn records(count: usize) -> (Flash, Vec<Vec<u8>>) {
    let mut node = Node::new();
    let mut flash = Flash(vec![BLANK; 2 * PAGE_WORDS]);
    let mut slots = Slots::open(&mut flash, Layout::new(0, 1, 2).unwrap()).unwrap();
    let stored = [0.5, 0.6].into_iter().take(count).map(|stiffness| {
        node.set_real(0x2104, 3, stiffness).unwrap();
        node.download(0x2100, 1, &[1]).unwrap();
        node.store(1).unwrap();
        let record = node.objects.program().record.clone().unwrap();
        slots.store(&mut flash, &record).unwrap();
        record
    });
    let stored = stored.collect();
    (flash, stored)
}

/// The joint's answer to "shutdown", the first step on the way to an enabled joint.
fn asked(node: &mut Node) -> Controlword {
    node.download(0x6040, 0, &[6, 0]).unwrap();
    node.image.demand().controlword
}

#[test]
fn a_configuration_that_is_damaged_at_any_byte_is_told_and_keeps_the_joint_off_at_every_start_until_one_is_stored() {
    for count in [1, 2] {
        let (whole, records) = records(count);
        let newest = PAGE_WORDS * DOUBLE_WORD * (count - 1);
        let mut locked = 0;
        for byte in 0..OVERHEAD + records[count - 1].len() + 8 {
            let mut flash = whole.clone();
            flash.0.as_flattened_mut()[newest + byte] ^= 0x10;
            // Some bytes carry nothing: the marks, of which there are several, and what is behind the record.
            let (_, record, start) = flash.start();
            if record.as_ref() == records.last() {
                assert!(!start.lost, "byte {byte}");
                continue;
            }
            locked += 1;
            assert_eq!(record.as_ref(), if count == 1 { None } else { records.first() }, "byte {byte}");
            for _ in 0..2 {
                assert!(flash.start().2.lost, "byte {byte}, at every start");
            }
            // Each way out costs a node of its own: at some bytes.
            if byte % 97 == 0 {
                keeps_the_joint_off(&flash);
            }
        }
        assert_eq!(locked, 8 + records[count - 1].len(), "every byte of header and record");
    }
}

/// The joint tells it, is not enabled, and each way out leads out.
fn keeps_the_joint_off(flash: &Flash) {
    let mut node = flash.clone().node();
    assert_eq!(node.number(0x1001, 0), 0x81);
    assert_eq!(node.number(0x1003, 1), 0x0002_6310);
    assert_eq!(node.number(0x2304, 1), 2);
    assert_eq!(asked(&mut node), Controlword::DISABLE_VOLTAGE);
    node.download(0x6040, 0, &[0x8F, 0]).unwrap();
    assert_eq!(node.image.demand().controlword, Controlword::FAULT_RESET);
    // The node id, or communication alone, brings no configuration back, and the next start knows it.
    node.receive(0x7E5, &[4, 1, 0, 0, 0, 0, 0, 0]);
    assert_eq!(node.receive(0x7E5, &[0x17, 0, 0, 0, 0, 0, 0, 0])[0].data()[..2], [0x17, 0]);
    node.store(2).unwrap();
    assert_eq!((asked(&mut node), node.number(0x1001, 0)), (Controlword::DISABLE_VOLTAGE, 0x81));
    let record = node.objects.program().record.clone();
    assert!(Start::new(record.as_deref(), false, &BOARD.joint, &BOARD.bridge).lost);
    for (index, sub_index, word) in
        [(0x1010, 1, b"save"), (0x1010, 3, b"save"), (0x1011, 1, b"load"), (0x1011, 3, b"load")]
    {
        let mut flash = flash.clone();
        let mut node = flash.node();
        node.download(index, sub_index, word).unwrap();
        assert_eq!((asked(&mut node), node.number(0x2304, 1)), (Controlword::SHUTDOWN, 0));
        assert_eq!((node.number(0x1001, 0), node.number(0x1003, 0)), (0, 1));
        let record = node.objects.program().record.clone().unwrap();
        let (mut slots, ..) = flash.start();
        slots.store(&mut flash, &record).unwrap();
        let (_, found, start) = flash.start();
        assert_eq!((found, start.lost), (Some(record), false));
    }
}

#[test]
fn a_configuration_that_is_whole_and_cannot_be_used_keeps_the_joint_off_too() {
    let (_, records) = records(1);
    let refused = {
        let mut node = Node::new();
        node.download(0x1010, 1, b"save").unwrap();
        let mut record = node.objects.program().record.clone().unwrap();
        let item = record.chunks_exact(1).map(|byte| byte[0]).collect::<Vec<_>>();
        let place = item.windows(3).position(|place| place == [0x01, 0x21, 4]).unwrap();
        // A torque constant that this program does not take.
        record[place + 3..place + 7].copy_from_slice(&1e6f32.to_le_bytes());
        record
    };
    for (record, lost) in [
        (Some(records[0].clone()), false),
        (None, false),
        (Some(vec![2, 255, 0]), true),
        (Some(vec![0x7F, 255, 0]), true),
        (Some(vec![1]), true),
        (Some(vec![0x81, 7, 0]), true),
        (Some(refused.clone()), true),
    ] {
        let start = Start::new(record.as_deref(), false, &BOARD.joint, &BOARD.bridge);
        assert_eq!(start.lost, lost, "{:?}", record.map(|record| record[..3.min(record.len())].to_vec()));
        assert!(start.configuration.prepare(&BOARD.bridge).is_ok());
    }
    // The node id is still good.
    let mut named = refused;
    named[1] = 17;
    assert_eq!(Start::new(Some(&named), false, &BOARD.joint, &BOARD.bridge).configuration.node_id, 17);
}

#[test]
fn date_and_time_of_the_configuration_are_those_of_the_application_too() {
    let date = |node: &mut Node| {
        node.download(0x1020, 1, &[1, 0, 0, 0]).unwrap();
        node.download(0x1020, 2, &[2, 0, 0, 0]).unwrap();
    };
    let dated = |node: &mut Node| (node.number(0x1020, 1), node.number(0x1020, 2));
    let real = |value: f32| value.to_le_bytes().to_vec();
    let before = |node: &mut Node, index, sub_index| node.upload(index, sub_index).unwrap();
    for (index, sub_index, value) in
        [(0x2101, 1, real(0.2)), (0x2012, 5, real(9.0)), (0x2200, 3, real(0.25)), (0x605A, 0, vec![5, 0])]
    {
        let mut node = Node::new();
        date(&mut node);
        let same = before(&mut node, index, sub_index);
        node.download(index, sub_index, &same).unwrap();
        assert_eq!(dated(&mut node), (1, 2), "{index:04X}h:{sub_index}");
        node.download(index, sub_index, &value).unwrap();
        assert_eq!(dated(&mut node), (0, 0), "{index:04X}h:{sub_index}");
    }
    let mut node = Node::new();
    node.set_real(0x2104, 3, 0.5).unwrap();
    date(&mut node);
    node.download(0x2100, 1, &[1]).unwrap();
    assert_eq!(dated(&mut node), (0, 0), "what is taken is in use only now");
    date(&mut node);
    // Set-points and modes are not stored.
    node.download(0x6060, 0, &[9]).unwrap();
    node.store(1).unwrap();
    let again = |node: &mut Node| Node::with(node.objects.program().record.clone(), false);
    let mut node = again(&mut node);
    assert_eq!((dated(&mut node), node.real(0x2104, 3)), ((1, 2), 0.5));
    // The same node id stored again changes nothing; a part of the configuration does.
    node.receive(0x7E5, &[4, 1, 0, 0, 0, 0, 0, 0]);
    node.receive(0x7E5, &[0x17, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(dated(&mut again(&mut node)), (1, 2));
    node.set_real(0x2200, 3, 0.25).unwrap();
    node.store(3).unwrap();
    assert_eq!(dated(&mut again(&mut node)), (0, 0));
}
