//! Writing an object: CiA 301 sections 7.2.4.3.3, 7.2.4.3.4 and 7.2.4.3.9 to 7.2.4.3.11; no I/O, host.

use super::super::error::Object;
use super::crc::crc;
use super::{Message, Method, SEGMENT, Step, TOGGLE, length, names, request};
use canopen_node::Abort;

/// Bytes up to which the segmented protocol needs no more frames than the block protocol.
const SEGMENTED: usize = 28;
const LAST: u8 = 0x80;
/// Number of blocks in a row of which nothing arrives that are no accident.
const FRUITLESS: u8 = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The node has to agree; expedited, that is all.
    Expedited,
    Initiated,
    /// The segment at this offset has to be confirmed.
    Segment(usize),
    BlockInitiated,
    /// Segments of a block that begins at `base` go out, `sent` of `size` so far.
    Block {
        base: usize,
        sent: u8,
        size: u8,
    },
    /// The block that begins at `base` is out.
    BlockAcknowledge {
        base: usize,
        sent: u8,
    },
    BlockEnd,
}

/// A write in progress.
#[derive(Debug)]
pub(super) struct Download {
    object: Object,
    data: Vec<u8>,
    phase: Phase,
    toggle: u8,
    may_fall_back: bool,
    crc: bool,
    /// Blocks in a row of which nothing arrived.
    fruitless: u8,
}

impl Download {
    /// Download with its first message.
    pub(super) fn new(object: Object, data: &[u8], method: Method) -> (Self, Message) {
        let (phase, first) = match (method, data) {
            (Method::Automatic, [_, rest @ ..]) if rest.len() < 4 => {
                let mut bytes = [0; 4];
                bytes.iter_mut().zip(data).for_each(|(byte, given)| *byte = *given);
                (Phase::Expedited, request(0x23 | (3 - rest.len() as u8) << 2, object, bytes))
            }
            (Method::Block, _) => (Phase::BlockInitiated, block(object, data)),
            (Method::Automatic, _) if data.len() > SEGMENTED => (Phase::BlockInitiated, block(object, data)),
            _ => (Phase::Initiated, request(0x21, object, length(data))),
        };
        let may_fall_back = method == Method::Automatic;
        (Self { object, data: data.to_vec(), phase, toggle: 0, may_fall_back, crc: false, fruitless: 0 }, first)
    }

    /// Returns `true` if the node has yet to agree.
    pub(super) fn is_beginning(&self) -> bool {
        matches!(self.phase, Phase::Expedited | Phase::Initiated | Phase::BlockInitiated)
    }

    /// The node has no block transfer: segmented, if that is allowed.
    pub(super) fn fall_back(&mut self) -> Option<Message> {
        if !self.may_fall_back || self.phase != Phase::BlockInitiated {
            return None;
        }
        self.phase = Phase::Initiated;
        Some(request(0x21, self.object, length(&self.data)))
    }

    /// The next segment of a block.
    pub(super) fn segment(&mut self) -> Option<Message> {
        let Phase::Block { base, sent, size } = self.phase else { return None };
        let offset = base + usize::from(sent) * SEGMENT;
        let (mut message, last) = self.bytes_from(offset);
        let sent = sent + 1;
        if let Some(command) = message.first_mut() {
            *command = sent | if last { LAST } else { 0 };
        }
        self.phase = match last || sent >= size {
            true => Phase::BlockAcknowledge { base, sent },
            false => Phase::Block { base, sent, size },
        };
        Some(message)
    }

    /// Message of up to seven bytes behind a first byte of 0, and whether they are the last.
    fn bytes_from(&self, offset: usize) -> (Message, bool) {
        let rest = self.data.get(offset..).unwrap_or_default();
        let mut message = [0; 8];
        message.iter_mut().skip(1).zip(rest).for_each(|(byte, given)| *byte = *given);
        (message, rest.len() <= SEGMENT)
    }

    /// The segment at `offset` of the segmented protocol.
    fn plain_segment(&mut self, offset: usize) -> Message {
        let (mut message, last) = self.bytes_from(offset);
        let bytes = self.data.len().saturating_sub(offset).min(SEGMENT);
        if let Some(command) = message.first_mut() {
            *command = self.toggle | ((SEGMENT - bytes) as u8) << 1 | u8::from(last);
        }
        self.phase = Phase::Segment(offset);
        message
    }

    pub(super) fn receive(&mut self, message: &Message) -> Step {
        let &[command, ..] = message;
        match self.phase {
            Phase::Expedited if command == 0x60 && names(message, self.object) => Step::Done(None, Vec::new()),
            Phase::Initiated if command == 0x60 && names(message, self.object) => {
                self.toggle = 0;
                Step::Answer(Some(self.plain_segment(0)))
            }
            Phase::Segment(offset) if command & 0xE0 == 0x20 => {
                if command & TOGGLE != self.toggle {
                    return Step::Wrong(Abort::TOGGLE, "the node confirmed another segment than was sent".into());
                }
                let next = offset + SEGMENT;
                if next >= self.data.len() {
                    return Step::Done(None, Vec::new());
                }
                self.toggle ^= TOGGLE;
                Step::Answer(Some(self.plain_segment(next)))
            }
            Phase::BlockInitiated if command & 0xE3 == 0xA0 && names(message, self.object) => {
                let &[_, _, _, _, size, ..] = message;
                self.crc = command & 4 != 0;
                self.block(0, size)
            }
            // The node may answer before the block is out, where it lost a segment that it took for the last.
            Phase::BlockAcknowledge { base, sent } | Phase::Block { base, sent, .. } if command & 0xE3 == 0xA2 => {
                let &[_, acknowledged, size, ..] = message;
                if acknowledged > sent {
                    let problem = format!("the node confirmed {acknowledged} segments of {sent}");
                    return Step::Wrong(Abort::SEQUENCE, problem);
                }
                self.fruitless = if acknowledged == 0 { self.fruitless + 1 } else { 0 };
                if self.fruitless == FRUITLESS {
                    return Step::Wrong(Abort::GENERAL, format!("nothing arrived of {FRUITLESS} blocks in a row"));
                }
                let base = base + usize::from(acknowledged) * SEGMENT;
                let whole = base >= self.data.len() && (acknowledged > 0 || base > 0);
                if !whole {
                    return self.block(base, size);
                }
                self.phase = Phase::BlockEnd;
                let unused = base - self.data.len();
                let [low, high] = if self.crc { crc(&self.data) } else { 0 }.to_le_bytes();
                Step::Answer(Some([0xC1 | (unused as u8) << 2, low, high, 0, 0, 0, 0, 0]))
            }
            Phase::BlockEnd if command & 0xE3 == 0xA1 => Step::Done(None, Vec::new()),
            _ => Step::Ignored,
        }
    }

    fn block(&mut self, base: usize, size: u8) -> Step {
        if !(1..=127).contains(&size) {
            return Step::Wrong(Abort::BLOCK_SIZE, format!("the node asks for blocks of {size} segments (1 to 127)"));
        }
        self.phase = Phase::Block { base, sent: 0, size };
        Step::Answer(None)
    }
}

/// "Initiate block download", with size and CRC.
fn block(object: Object, data: &[u8]) -> Message {
    request(0xC6, object, length(data))
}
