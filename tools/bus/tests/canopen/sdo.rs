//! SDO in simulated time: every length, every way, and every single frame lost or late.

use crate::node::{Node, pattern};
use bus::Frame;
use bus::client::sdo::{Failure, Method, Settings, Transfer};
use bus::client::{Abort, Object};
use std::collections::VecDeque;
use std::time::Duration;

const NODE: u8 = 5;
const DOMAIN: Object = Object { node: NODE, index: 0x2001, sub_index: 0 };
const NUMBER: Object = Object { node: NODE, index: 0x2000, sub_index: 0 };
/// About one full frame.
const FRAME: Duration = Duration::from_micros(130);

/// Fate of a frame on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    Arrives,
    Lost,
    Late(Duration),
}

/// A client and a node on a wire without arbitration, each with one frame in each step.
struct Wire {
    node: Node,
    now: Duration,
    /// Frames of either direction that are under way, and when they arrive.
    to_node: VecDeque<(Duration, Frame)>,
    to_client: VecDeque<(Duration, Frame)>,
    sent: usize,
}

impl Wire {
    fn new() -> Self {
        let mut node = Node::new(NODE, 1, 0);
        assert!(node.poll(Duration::ZERO).is_some(), "boots");
        let (to_node, to_client) = (VecDeque::new(), VecDeque::new());
        Self { node, now: FRAME, to_node, to_client, sent: 0 }
    }

    fn put(&mut self, frame: Frame, client: bool, fate: &mut impl FnMut(usize) -> Fate) {
        let delay = match fate(self.sent) {
            Fate::Arrives => Some(FRAME),
            Fate::Lost => None,
            Fate::Late(delay) => Some(delay),
        };
        self.sent += 1;
        let direction = if client { &mut self.to_node } else { &mut self.to_client };
        direction.extend(delay.map(|delay| (self.now + delay, frame)));
    }

    fn due(queue: &mut VecDeque<(Duration, Frame)>, now: Duration) -> Option<Frame> {
        let at = queue.iter().position(|(at, _)| *at <= now)?;
        queue.remove(at).map(|(_, frame)| frame)
    }

    /// Runs a transfer to its end.
    fn run(&mut self, mut transfer: Transfer, mut fate: impl FnMut(usize) -> Fate) -> Result<Vec<u8>, Failure> {
        self.sent = 0;
        let began = self.now;
        loop {
            if let Some(message) = transfer.poll(self.now) {
                self.put(Frame::new(0x600 + u16::from(NODE), &message).unwrap(), true, &mut fate);
            } else if let Some(outcome) = transfer.outcome() {
                return outcome.clone();
            }
            while let Some(frame) = Self::due(&mut self.to_node, self.now) {
                for answer in self.node.receive(&frame, self.now) {
                    self.put(answer, false, &mut fate);
                }
            }
            if let Some(frame) = self.node.poll(self.now) {
                self.put(frame, false, &mut fate);
            }
            while let Some(frame) = Self::due(&mut self.to_client, self.now) {
                transfer.receive(frame.data(), self.now);
            }
            self.now += FRAME;
            assert!(self.now - began < Duration::from_secs(60), "it ends");
        }
    }

    /// Lets everything arrive and time out that still can.
    fn settle(&mut self) {
        for _ in 0..3_000 {
            self.now += Duration::from_millis(1);
            while let Some(frame) = Self::due(&mut self.to_node, self.now) {
                self.node.receive(&frame, self.now);
            }
            while self.node.poll(self.now).is_some() {}
        }
        self.to_client.clear();
    }

    fn write(&mut self, data: &[u8], method: Method, fate: impl FnMut(usize) -> Fate) -> Result<(), Failure> {
        self.run(Transfer::download(DOMAIN, data, method, Settings::default()), fate).map(drop)
    }

    fn read(&mut self, method: Method, fate: impl FnMut(usize) -> Fate) -> Result<Vec<u8>, Failure> {
        self.run(Transfer::upload(DOMAIN, method, Settings::default()), fate)
    }
}

fn arrives(_: usize) -> Fate {
    Fate::Arrives
}

#[test]
fn every_length_goes_both_ways_in_every_way() {
    let mut wire = Wire::new();
    for length in 0..=2048 {
        for method in [Method::Automatic, Method::Segmented, Method::Block] {
            let mut data = pattern(length);
            data.rotate_left(length.min(method as usize));
            wire.node.dictionary.domain = vec![0xEE; 3];
            wire.write(&data, method, arrives).unwrap();
            assert_eq!(wire.node.dictionary.domain, data, "{length} bytes, {method:?}");
            assert_eq!(wire.read(method, arrives).unwrap(), data, "{length} bytes, {method:?}");
        }
    }
}

#[test]
fn small_blocks_carry_everything_too() {
    let mut wire = Wire::new();
    for length in [0, 1, 6, 7, 8, 13, 14, 15, 100, 889, 890] {
        wire.node.dictionary.domain = pattern(length);
        for block_size in [1, 2, 3, 126] {
            let settings = Settings { block_size, ..Settings::default() };
            let transfer = Transfer::upload(DOMAIN, Method::Block, settings);
            assert_eq!(
                wire.run(transfer, arrives).unwrap(),
                pattern(length),
                "{length} bytes in blocks of {block_size}"
            );
        }
    }
}

#[test]
fn expedited_numbers_are_whole_and_other_lengths_are_refused() {
    let mut wire = Wire::new();
    wire.run(Transfer::download(NUMBER, &[1, 2, 3, 4], Method::Automatic, Settings::default()), arrives).unwrap();
    assert_eq!(wire.sent, 2);
    let read = Transfer::upload(NUMBER, Method::Automatic, Settings::default());
    assert_eq!((wire.run(read, arrives).unwrap(), wire.sent), (vec![1, 2, 3, 4], 2));
    for length in [1, 2, 3, 5, 8, 100] {
        let write = Transfer::download(NUMBER, &pattern(length), Method::Automatic, Settings::default());
        let expected = if length < 4 { Abort::TOO_SHORT } else { Abort::TOO_LONG };
        assert_eq!(wire.run(write, arrives), Err(Failure::Aborted(expected)), "{length} bytes");
    }
    assert_eq!(wire.node.dictionary.number, [1, 2, 3, 4]);
}

/// Every single frame of transfers of several lengths meets `fate`: the data arrive whole or the transfer fails with
/// nothing half done, and the next one works. The number of failures is given back for each method: reading, writing.
fn with_every_frame(fate: Fate) -> Vec<(Method, [usize; 2], [usize; 2])> {
    let mut counts = Vec::new();
    for method in [Method::Segmented, Method::Block] {
        let (mut failures, mut cases) = ([0; 2], [0; 2]);
        for length in [1, 7, 8, 60, 889, 900, 1800] {
            for direction in [0, 1] {
                for number in 0.. {
                    let mut wire = Wire::new();
                    let (old, new) = (vec![0xEE; 9], pattern(length));
                    let at_number = |frame| if frame == number { fate } else { Fate::Arrives };
                    wire.node.dictionary.domain = if direction == 0 { new.clone() } else { old.clone() };
                    let outcome = match direction {
                        0 => wire.read(method, at_number).inspect(|data| assert_eq!(*data, new)).map(drop),
                        _ => wire.write(&new, method, at_number),
                    };
                    if wire.sent <= number {
                        break;
                    }
                    cases[direction] += 1;
                    let domain = &wire.node.dictionary.domain;
                    match &outcome {
                        Ok(()) => assert_eq!(*domain, new),
                        Err(failure) => {
                            failures[direction] += 1;
                            let told = matches!(failure, Failure::Timeout | Failure::Aborted(_) | Failure::Protocol(_));
                            assert!(told && (*domain == old || *domain == new), "{failure:?}");
                        }
                    }
                    // The next transfer may still meet what is late; the one after it does not.
                    let next = wire.read(method, arrives);
                    let whole = wire.node.dictionary.domain.clone();
                    let right = next == Ok(whole.clone()) || next.is_err() && fate != Fate::Lost;
                    assert!(right, "{method:?}, {length} bytes, frame {number}: {next:?}");
                    wire.settle();
                    assert_eq!(wire.read(method, arrives), Ok(whole), "{method:?}, {length} bytes, frame {number}");
                }
            }
        }
        counts.push((method, failures, cases));
    }
    counts
}

#[test]
fn any_lost_frame_is_sent_again_or_ends_the_transfer_with_nothing_half_done() {
    let counts = with_every_frame(Fate::Lost);
    println!("lost: method, failures and cases of reading and writing: {counts:?}");
    for (method, failures, cases) in counts {
        match method {
            // Segmented transfers confirm every frame and repeat none.
            Method::Segmented => assert_eq!(failures, cases),
            // Most frames are segments of blocks, and those come again.
            _ => assert!(failures[0] * 10 < cases[0] && failures[1] * 10 < cases[1], "{failures:?} of {cases:?}"),
        }
    }
}

#[test]
fn any_late_frame_costs_the_transfer_at_most() {
    for delay in [300, 600, 1_100, 1_700].map(Duration::from_millis) {
        println!("late by {delay:?}: {:?}", with_every_frame(Fate::Late(delay)));
    }
}

#[test]
fn a_block_survives_many_losses() {
    let mut wire = Wire::new();
    let data = pattern(2048);
    for seed in 0..200u32 {
        let mut random = seed;
        // One segment in ten is lost, of which the protocol's own frames are spared.
        let mut lossy = |number: usize| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if (3..120).contains(&number) && random >> 16 & 0xFF < 26 { Fate::Lost } else { Fate::Arrives }
        };
        wire.node.dictionary.domain.clear();
        wire.write(&data, Method::Block, &mut lossy).unwrap();
        assert_eq!(wire.node.dictionary.domain, data, "seed {seed}");
        assert_eq!(wire.read(Method::Block, &mut lossy).unwrap(), data, "seed {seed}");
    }
}

#[test]
fn damage_is_found_by_the_crc() {
    let mut wire = Wire::new();
    wire.node.dictionary.domain = pattern(500);
    let mut transfer = Transfer::upload(DOMAIN, Method::Block, Settings::default());
    let mut segments = 0;
    while transfer.outcome().is_none() {
        while let Some(message) = transfer.poll(wire.now) {
            let mut frames = wire.node.receive(&Frame::new(0x605, &message).unwrap(), wire.now);
            frames.extend(std::iter::from_fn(|| wire.node.poll(wire.now)));
            for frame in frames {
                let mut data = frame.data().to_vec();
                segments += 1;
                data[7] ^= u8::from(segments == 20);
                transfer.receive(&data, wire.now);
            }
        }
    }
    let Some(Err(Failure::Protocol(problem))) = transfer.outcome() else { panic!("{:?}", transfer.outcome()) };
    assert!(problem.contains("CRC"), "{problem}");
}

#[test]
fn a_node_without_block_transfer_is_written_segmented() {
    let data = pattern(100);
    let mut transfer = Transfer::download(DOMAIN, &data, Method::Automatic, Settings::default());
    let first = transfer.poll(Duration::ZERO).unwrap();
    assert_eq!(first[0], 0xC6);
    let refusal = [0x80, 0x01, 0x20, 0, 0x01, 0, 0x04, 0x05];
    // The first refusal may be that of a transfer that another client left.
    transfer.receive(&refusal, Duration::ZERO);
    assert_eq!(transfer.poll(Duration::ZERO), Some(first));
    transfer.receive(&refusal, Duration::ZERO);
    assert_eq!(transfer.outcome(), None);
    assert_eq!(transfer.poll(Duration::ZERO), Some([0x21, 0x01, 0x20, 0, 100, 0, 0, 0]));
    let mut forced = Transfer::download(DOMAIN, &data, Method::Block, Settings::default());
    for _ in 0..2 {
        forced.poll(Duration::ZERO);
        forced.receive(&refusal, Duration::ZERO);
    }
    assert_eq!(forced.outcome(), Some(&Err(Failure::Aborted(Abort::COMMAND))));
}

#[test]
fn more_than_the_limit_is_not_read() {
    let mut wire = Wire::new();
    wire.node.dictionary.domain = pattern(200);
    for method in [Method::Segmented, Method::Block] {
        let settings = Settings { limit: 199, ..Settings::default() };
        let outcome = wire.run(Transfer::upload(DOMAIN, method, settings), arrives);
        let Err(Failure::Protocol(problem)) = outcome else { panic!("{outcome:?}") };
        assert!(problem.contains("200") && problem.contains("199"), "{problem}");
    }
}

#[test]
fn a_node_that_confirms_nothing_or_too_much_is_given_up() {
    let step = |answers: &[[u8; 8]]| {
        let mut transfer = Transfer::download(DOMAIN, &pattern(100), Method::Block, Settings::default());
        let now = Duration::ZERO;
        for answer in [[0xA4, 0x01, 0x20, 0, 127, 0, 0, 0]].iter().chain(answers.iter().cycle().take(100)) {
            while transfer.poll(now).is_some() {}
            transfer.receive(answer, now);
        }
        transfer.poll(now);
        transfer.outcome().cloned()
    };
    for (answer, problem) in [
        ([0xA2, 0, 127, 0, 0, 0, 0, 0], "nothing arrived"),
        ([0xA2, 99, 127, 0, 0, 0, 0, 0], "99 segments of 15"),
        ([0xA2, 1, 0, 0, 0, 0, 0, 0], "blocks of 0"),
    ] {
        let Some(Err(Failure::Protocol(told))) = step(&[answer]) else { panic!("{answer:x?}") };
        assert!(told.contains(problem), "{told}");
    }
}

proptest::proptest! {
    /// Any answers: no panic, nothing endless, and data only within the limit.
    #[test]
    fn no_answers_confuse_a_client(answers in proptest::collection::vec(proptest::array::uniform8(proptest::prelude::any::<u8>()), 0..80), names in proptest::prelude::any::<bool>(), method in 0usize..3, write in proptest::prelude::any::<bool>(), length in 0usize..60) {
        let method = [Method::Automatic, Method::Segmented, Method::Block][method];
        let settings = Settings { limit: 300, ..Settings::default() };
        let mut transfer = match write {
            true => Transfer::download(DOMAIN, &pattern(length), method, settings),
            false => Transfer::upload(DOMAIN, method, settings),
        };
        for mut answer in answers {
            let mut sent = 0;
            while transfer.poll(Duration::ZERO).is_some() {
                sent += 1;
                proptest::prop_assert!(sent <= 130);
            }
            if names {
                answer[1..4].copy_from_slice(&[0x01, 0x20, 0]);
            }
            transfer.receive(&answer, Duration::ZERO);
        }
        // A message that waits to be sent, a confirmation of half a block, the abort.
        for seconds in [9, 18, 27] {
            while transfer.poll(Duration::from_secs(seconds)).is_some() {}
        }
        proptest::prop_assert!(transfer.outcome().is_some());
        if let Some(Ok(data)) = transfer.outcome() {
            proptest::prop_assert!(data.len() <= 300);
        }
    }
}
