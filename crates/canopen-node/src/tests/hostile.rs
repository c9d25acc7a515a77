//! Random and mutated frames: nothing panics, and nothing changes that the protocol does not allow. Overflow checks
//! are on in tests.

use super::*;
use proptest::prelude::*;

/// xorshift64*, so that a run can be repeated.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.next() >> 33) as usize % bound
    }

    fn bytes(&mut self) -> [u8; 8] {
        self.next().to_le_bytes()
    }

    /// Frame that might mean something to a node: its own identifiers, command specifiers that exist, its objects.
    fn frame(&mut self) -> Frame {
        let mut data = self.bytes();
        let id = match self.below(16) {
            0..=8 => 0x605,
            9 => 0,
            10 => 0x80,
            11 => 0x205 + 0x100 * self.below(4) as u16,
            12 => LSS_MASTER,
            13 => 0x701 + self.below(127) as u16,
            _ => self.below(0x800) as u16,
        };
        match id {
            0x605 => {
                let commands = [
                    0x20, 0x21, 0x22, 0x23, 0x2B, 0x2F, 0x40, 0x60, 0x70, 0x00, 0x10, 0x01, 0x11, 0x80, 0xA0, 0xA4,
                    0xA1, 0xA2, 0xA3, 0xC0, 0xC2, 0xC4, 0xC6, 0xC1, 0xC5, 0xDD, 0x02, 0x03, 0x81, 0x82, 0x83,
                ];
                let indices = [
                    0x2000, 0x2001, 0x2002, 0x2010, 0x2010, 0x2010, 0x2011, 0x1003, 0x1005, 0x1008, 0x1010, 0x1014,
                    0x1015, 0x1016, 0x1017, 0x1029, 0x1400, 0x1401, 0x1600, 0x1601, 0x1800, 0x1801, 0x1A00, 0x1A01,
                ];
                if self.below(8) != 0 {
                    data[0] = commands[self.below(commands.len())];
                }
                if self.below(8) != 0 {
                    let [low, high] = u16::to_le_bytes(indices[self.below(indices.len())]);
                    (data[1], data[2], data[3]) = (low, high, self.below(6) as u8);
                }
                if self.below(2) != 0 {
                    let number = [0u32, 1, 2, 5, 7, 8, 127, 2048, 2049, u32::MAX, U16.0, U64.0, 0x8000_0205, 0x205]
                        [self.below(14)];
                    data[4..].copy_from_slice(&number.to_le_bytes());
                }
            }
            0 => {
                data[..2].copy_from_slice(&[[1, 2, 0x80, 0x81, 0x82, 0x55][self.below(6)], [0, NODE, 9][self.below(3)]])
            }
            LSS_MASTER => data[0] = [0x04, 0x11, 0x13, 0x17, 0x51, 0x40, 0x46, 0x5E, 0x4C][self.below(9)],
            _ => {}
        }
        let length = if self.below(16) == 0 { self.below(9) } else { 8 };
        frame(id, &data[..length])
    }
}

/// Asserts what must hold after each frame: `before` is the state that the frame met.
fn check(node: &Node, frame: &Frame, before: NmtState, set_points: &BTreeMap<u32, u64>) {
    let after = node.shared.state();
    // Only NMT changes the state in the interrupt, as it does at once.
    if frame.id() != 0 {
        assert_eq!(before, after);
    }
    // Set-points come by RPDO or SYNC in OPERATIONAL only, and end with the state.
    if after != NmtState::Operational {
        assert!(node.image.set_points.is_empty());
    } else if before == after && (frame.id() == LSS_MASTER || frame.id() == 0) {
        assert_eq!(&node.image.set_points, set_points);
    }
    assert!(node.dictionary.opened - node.dictionary.closed <= 1);
    assert_eq!(node.dictionary.opened != node.dictionary.closed, node.dictionary.staging.is_some());
    if node.server.sdo_is_idle() {
        assert!(node.dictionary.staging.is_none());
    }
}

/// Asserts that what the node sends has an identifier that is its own, or one that PDOs and EMCY may be moved to.
fn check_sent(node: &Node, sent: &[Frame]) {
    let node_id = u16::from(node.shared.node_id());
    for frame in sent {
        let own = [SDO_TRANSMIT + node_id, HEARTBEAT + node_id, LSS_SLAVE].contains(&frame.id());
        assert!(own || parameters::is_free(frame.id().into()), "{frame:02x?}");
    }
}

#[test]
fn two_million_frames_of_a_hostile_bus_do_nothing_that_the_protocol_does_not_allow() {
    let mut noise = Noise(0x9E37_79B9_7F4A_7C15);
    let mut node = Node::booted();
    let mut states = BTreeMap::<u8, u64>::new();
    let (mut sent, mut aborts, mut finished) = (0u64, 0u64, 0u64);
    for number in 0..2_000_000u32 {
        let frame = noise.frame();
        let (before, set_points) = (node.shared.state(), node.image.set_points.clone());
        *states.entry(before as u8).or_default() += 1;
        let mut out = node.interrupt(&frame);
        check(&node, &frame, before, &set_points);
        // Sometimes the task is late.
        if noise.below(4) != 0 {
            let staged = node.dictionary.domain.clone();
            out.extend(node.task());
            finished += u64::from(staged != node.dictionary.domain);
        }
        check_sent(&node, &out);
        sent += out.len() as u64;
        aborts += out.iter().filter(|frame| frame.id() == 0x585 && frame.data()[0] == 0x80).count() as u64;
        node.now = node.now.wrapping_add(noise.below(if number % 1_000 == 0 { 600_000 } else { 300 }) as u32);
        node.dictionary.writes.clear();
        node.dictionary.events.clear();
        node.image.received.clear();
        node.image.states.clear();
        if node.shared.node_id() != NODE {
            // LSS gave it another node id, or none: that is allowed, and the end of this node.
            node = Node::booted();
        }
    }
    println!("2000000 frames in, {sent} out, {aborts} aborts, {finished} streams replaced, frames by state {states:?}");
    assert!(states.len() >= 3 && finished > 100 && aborts > 10_000);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    /// A download by block, any byte of any frame changed: whole, or nothing.
    #[test]
    fn a_mutated_transfer_is_whole_or_nothing(
        length in 1usize..200, which in 0usize..40, byte in 0usize..8, flip in 1u8..=255
    ) {
        let mut node = Node::booted();
        node.dictionary.domain = vec![0x55; 4];
        let data = pattern(length);
        let mut frames = vec![[0xC6, 0x10, 0x20, 0, length as u8, 0, 0, 0]];
        for (chunk, number) in data.chunks(7).zip(1u8..) {
            let mut segment = [0; 8];
            segment[0] = number | if usize::from(number) * 7 >= length { 0x80 } else { 0 };
            segment[1..=chunk.len()].copy_from_slice(chunk);
            frames.push(segment);
        }
        let [low, high] = client::crc(&data).to_le_bytes();
        let unused = ((7 - length % 7) % 7) as u8;
        frames.push([0xC1 | unused << 2, low, high, 0, 0, 0, 0, 0]);
        let which = which % frames.len();
        frames[which][byte] ^= flip;
        for frame in frames {
            node.sdo(frame);
        }
        node.run(600);
        prop_assert!(node.server.sdo_is_idle() && node.dictionary.staging.is_none());
        let domain = &node.dictionary.domain;
        // Another first byte is another request: a plain download, or one without a checksum.
        let another = which == 0 && byte == 0;
        prop_assert!(domain == &data || domain == &[0x55; 4] || another);
    }

    #[test]
    fn frames_of_any_content_do_not_panic(
        frames in prop::collection::vec((0u16..0x800, prop::collection::vec(any::<u8>(), 0..=8)), 0..60), node_id: u8
    ) {
        let mut node = Node::powered(node_id);
        for (id, data) in frames {
            node.bus(id, &data);
            node.now = node.now.wrapping_add(10_000);
        }
    }
}
