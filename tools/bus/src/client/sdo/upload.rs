//! Reading an object: CiA 301 sections 7.2.4.3.5, 7.2.4.3.6 and 7.2.4.3.12 to 7.2.4.3.15; no I/O, host.

use super::super::error::Object;
use super::crc::crc;
use super::{Message, Method, SEGMENT, Settings, Step, TOGGLE, names, request};
use canopen_node::Abort;

const LAST: u8 = 0x80;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Initiated,
    Segments,
    BlockInitiated,
    /// Segments of a block come.
    Block {
        /// The last one that came in its order.
        sequence: u8,
        /// `true` if it was the last of all.
        last: bool,
    },
    /// All came; length of the last segment and CRC follow.
    BlockEnd,
}

/// A read in progress.
#[derive(Debug)]
pub(super) struct Upload {
    object: Object,
    phase: Phase,
    block_size: u8,
    limit: usize,
    toggle: u8,
    /// Size that the node announced.
    announced: Option<usize>,
    crc: bool,
    data: Vec<u8>,
}

impl Upload {
    /// Upload with its first message.
    pub(super) fn new(object: Object, method: Method, settings: Settings) -> (Self, Message) {
        let block_size = settings.block_size.clamp(1, 127);
        let (phase, first) = match method {
            // Without a threshold, so that the node does not change the protocol.
            Method::Block => (Phase::BlockInitiated, request(0xA4, object, [block_size, 0, 0, 0])),
            Method::Automatic | Method::Segmented => (Phase::Initiated, request(0x40, object, [0; 4])),
        };
        let upload = Self {
            object,
            phase,
            block_size,
            limit: settings.limit,
            toggle: 0,
            announced: None,
            crc: false,
            data: Vec::new(),
        };
        (upload, first)
    }

    /// Returns `true` if the node has yet to agree.
    pub(super) fn is_beginning(&self) -> bool {
        matches!(self.phase, Phase::Initiated | Phase::BlockInitiated)
    }

    /// Returns `true` if silence may mean that the end of a block was lost.
    pub(super) fn may_acknowledge(&self) -> bool {
        matches!(self.phase, Phase::Block { sequence: 1.., last: false })
    }

    /// The rest of the block was lost: confirms what came, so that the node sends the rest. Where nothing of the block
    /// came, the loss may be that of the last confirmation, and confirming again could be taken for this block's.
    pub(super) fn acknowledge_after_silence(&mut self) -> Option<Message> {
        self.may_acknowledge().then(|| self.acknowledge()).flatten()
    }

    fn acknowledge(&mut self) -> Option<Message> {
        let Phase::Block { sequence, last } = self.phase else { return None };
        self.phase = if last { Phase::BlockEnd } else { Phase::Block { sequence: 0, last: false } };
        Some([0xA2, sequence, self.block_size, 0, 0, 0, 0, 0])
    }

    pub(super) fn receive(&mut self, message: &Message) -> Step {
        let &[command, _, _, _, data @ ..] = message;
        match self.phase {
            Phase::Initiated | Phase::BlockInitiated if command & 0xE0 == 0x40 && names(message, self.object) => {
                self.initiated(command, data)
            }
            Phase::Segments if command & 0xE0 == 0x00 => self.segment(message),
            Phase::BlockInitiated if command & 0xE1 == 0xC0 && names(message, self.object) => {
                self.crc = command & 4 != 0;
                if command & 2 != 0
                    && let Err(wrong) = self.announce(data)
                {
                    return wrong;
                }
                self.phase = Phase::Block { sequence: 0, last: false };
                Step::Answer(Some([0xA3, 0, 0, 0, 0, 0, 0, 0]))
            }
            Phase::Block { sequence, last: false } => self.block_segment(message, sequence),
            Phase::BlockEnd if command & 0xE3 == 0xC1 => self.end(message),
            _ => Step::Ignored,
        }
    }

    /// The node's answer to a plain request.
    fn initiated(&mut self, command: u8, data: [u8; 4]) -> Step {
        if command & 2 != 0 {
            // Expedited; without a size all four bytes count.
            let unused = if command & 1 != 0 { usize::from(command >> 2 & 3) } else { 0 };
            return Step::Done(None, data.iter().copied().take(4 - unused).collect());
        }
        if command & 1 != 0
            && let Err(wrong) = self.announce(data)
        {
            return wrong;
        }
        self.phase = Phase::Segments;
        Step::Answer(Some([0x60, 0, 0, 0, 0, 0, 0, 0]))
    }

    fn announce(&mut self, length: [u8; 4]) -> Result<(), Step> {
        let length = u32::from_le_bytes(length) as usize;
        self.announced = Some(length);
        if length > self.limit {
            let problem = format!("the object has {length} bytes, the limit is {}", self.limit);
            return Err(Step::Wrong(Abort::MEMORY, problem));
        }
        Ok(())
    }

    fn segment(&mut self, message: &Message) -> Step {
        let &[command, ref data @ ..] = message;
        if command & TOGGLE != self.toggle {
            return Step::Wrong(Abort::TOGGLE, "the node sent another segment than was asked for".into());
        }
        self.toggle ^= TOGGLE;
        let bytes = SEGMENT - usize::from(command >> 1 & 7);
        self.data.extend(data.iter().take(bytes));
        if self.data.len() > self.limit {
            return Step::Wrong(Abort::MEMORY, format!("the object has more than {} bytes, the limit", self.limit));
        }
        if command & 1 != 0 {
            return self.whole(None);
        }
        Step::Answer(Some([0x60 | self.toggle, 0, 0, 0, 0, 0, 0, 0]))
    }

    fn block_segment(&mut self, message: &Message, sequence: u8) -> Step {
        let &[command, ref data @ ..] = message;
        let (number, last) = (command & !LAST, command & LAST != 0);
        if number == 0 || number > self.block_size {
            return Step::Wrong(
                Abort::SEQUENCE,
                format!("the node sent segment {number} of a block of {}", self.block_size),
            );
        }
        if number == sequence + 1 {
            self.data.extend(data);
            self.phase = Phase::Block { sequence: number, last };
            if self.data.len() > self.limit + SEGMENT {
                return Step::Wrong(Abort::MEMORY, format!("the object has more than {} bytes, the limit", self.limit));
            }
        }
        // Segments out of order are not kept: the node sends them again after the confirmation.
        if last || number == self.block_size { Step::Answer(self.acknowledge()) } else { Step::Answer(None) }
    }

    fn end(&mut self, message: &Message) -> Step {
        let &[command, low, high, ..] = message;
        let unused = usize::from(command >> 2 & 7);
        self.data.truncate(self.data.len().saturating_sub(unused));
        if self.crc && crc(&self.data) != u16::from_le_bytes([low, high]) {
            return Step::Wrong(Abort::CRC, "the CRC of what was read is wrong".into());
        }
        self.whole(Some([0xA1, 0, 0, 0, 0, 0, 0, 0]))
    }

    fn whole(&mut self, last: Option<Message>) -> Step {
        let data = std::mem::take(&mut self.data);
        match self.announced {
            Some(announced) if announced != data.len() => {
                let problem = format!("the node announced {announced} bytes and sent {}", data.len());
                Step::Wrong(Abort::LENGTH, problem)
            }
            _ => Step::Done(last, data),
        }
    }
}
