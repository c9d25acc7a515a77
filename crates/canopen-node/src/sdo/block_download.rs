//! Block download: CiA 301 sections 7.2.4.3.9 to 7.2.4.3.11.

use super::Message;
use super::crc::BlockCrc;
use crate::abort::Abort;
use crate::access::{Objects, Sink};
use crate::dictionary::ObjectDictionary;

/// Answer to "initiate block download", with CRC support.
pub(super) const COMMAND: u8 = 0xA4;

/// "More segments follow" is the absence of this bit.
const LAST: u8 = 0x80;

/// A block download in progress.
#[derive(Debug)]
pub(super) struct BlockDownload {
    block_size: u8,
    /// The last segment of this block that came in its order.
    sequence: u8,
    /// The newest segment. How many of its bytes count is known only when another one follows, or at the end.
    held: Option<[u8; 7]>,
    /// The message that closed the block before. CAN may repeat a frame whose end was disturbed (ISO 11898-1); this
    /// one would be taken for a block of which everything else was lost.
    closing: Option<Message>,
    /// `true` once the last segment came, so that the client is about to end.
    complete: bool,
    crc: Option<BlockCrc>,
}

impl BlockDownload {
    pub(super) fn new(block_size: u8, crc: bool) -> Self {
        let crc = crc.then(BlockCrc::default);
        Self { block_size, sequence: 0, held: None, closing: None, complete: false, crc }
    }

    /// Takes a segment or the end; the answer, and whether the transfer is whole.
    pub(super) fn receive<D: ObjectDictionary>(
        &mut self,
        request: &Message,
        sink: &mut Sink,
        objects: &mut Objects<'_, '_, D>,
    ) -> Result<(Option<Message>, bool), Abort> {
        if self.complete { self.end(request, sink, objects) } else { self.segment(request, sink, objects) }
    }

    fn segment<D: ObjectDictionary>(
        &mut self,
        request: &Message,
        sink: &mut Sink,
        objects: &mut Objects<'_, '_, D>,
    ) -> Result<(Option<Message>, bool), Abort> {
        let &[command, ref data @ ..] = request;
        let (sequence, last) = (command & !LAST, command & LAST != 0);
        if sequence == 0 || sequence > self.block_size {
            return Err(Abort::SEQUENCE);
        }
        if sequence == self.sequence.saturating_add(1) {
            if let Some(held) = self.held.replace(*data) {
                self.deliver(&held, sink, objects)?;
            }
            self.sequence = sequence;
            self.complete = last;
        } else if self.sequence == 0 && self.closing == Some(*request) {
            return Ok((None, false));
        }
        // Segments out of order are dropped; what is missing comes again after the answer.
        if sequence < self.block_size && !last {
            return Ok((None, false));
        }
        let acknowledged = core::mem::take(&mut self.sequence);
        self.closing = Some(*request);
        Ok((Some([0xA2, acknowledged, self.block_size, 0, 0, 0, 0, 0]), false))
    }

    fn end<D: ObjectDictionary>(
        &mut self,
        request: &Message,
        sink: &mut Sink,
        objects: &mut Objects<'_, '_, D>,
    ) -> Result<(Option<Message>, bool), Abort> {
        let &[command, low, high, ..] = request;
        let held = self.held.unwrap_or_default();
        let bytes = 7u8.saturating_sub(command >> 2 & 7);
        let data = held.get(..bytes.into()).unwrap_or(&held);
        let crc = self.crc.map(|mut crc| {
            crc.update(data);
            crc.value()
        });
        let crc_matches = crc.map(|crc| crc == u16::from_le_bytes([low, high]));
        let is_end = command & 0xE3 == 0xC1;
        // The last segment may look like an end when it is repeated; only a checksum tells them apart.
        if self.closing == Some(*request) && !(is_end && crc_matches == Some(true)) {
            return Ok((None, false));
        }
        if !is_end {
            return Err(Abort::COMMAND);
        }
        if crc_matches == Some(false) {
            return Err(Abort::CRC);
        }
        sink.push(objects, data)?;
        Ok((Some([0xA1, 0, 0, 0, 0, 0, 0, 0]), true))
    }

    fn deliver<D: ObjectDictionary>(
        &mut self,
        segment: &[u8; 7],
        sink: &mut Sink,
        objects: &mut Objects<'_, '_, D>,
    ) -> Result<(), Abort> {
        if let Some(crc) = &mut self.crc {
            crc.update(segment);
        }
        sink.push(objects, segment)
    }
}
