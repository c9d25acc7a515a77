//! Block upload: CiA 301 sections 7.2.4.3.12 to 7.2.4.3.15.

use super::Message;
use super::crc::BlockCrc;
use crate::abort::Abort;
use crate::access::{Objects, Source};
use crate::dictionary::ObjectDictionary;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The client was told the length and has to say start.
    Start,
    /// Segments go out, one in each poll.
    Sending,
    /// A block is out.
    Acknowledge,
    /// The client was told that all was sent.
    End,
}

/// A block upload in progress.
#[derive(Debug)]
pub(super) struct BlockUpload {
    source: Source,
    phase: Phase,
    block_size: u8,
    /// Offset at which the block begins; a multiple of seven.
    base: u32,
    /// Segments of the block that were sent.
    sent: u8,
    /// `true` if the last of them ends the data.
    complete: bool,
    crc: Option<BlockCrc>,
    /// Offset up to which the CRC has come: what is sent again is not counted again.
    counted: u32,
}

impl BlockUpload {
    pub(super) fn new(source: Source, block_size: u8, crc: bool) -> Result<Self, Abort> {
        let block_size = checked(block_size)?;
        let crc = crc.then(BlockCrc::default);
        Ok(Self { source, phase: Phase::Start, block_size, base: 0, sent: 0, complete: false, crc, counted: 0 })
    }

    /// Command specifier of the answer to "initiate": size indicated, and CRC where the client has it, too.
    pub(super) fn command(&self) -> u8 {
        0xC2 | if self.crc.is_some() { 4 } else { 0 }
    }

    pub(super) fn is_sending(&self) -> bool {
        self.phase == Phase::Sending
    }

    /// Returns `true` if the client confirms the end.
    pub(super) fn is_over(&self, request: &Message) -> bool {
        let [command, ..] = *request;
        self.phase == Phase::End && command & 0xE3 == 0xA1
    }

    /// The next segment of the block.
    pub(super) fn segment<D: ObjectDictionary>(&mut self, objects: &mut Objects<'_, '_, D>) -> Result<Message, Abort> {
        let offset = self.base.saturating_add(u32::from(self.sent).saturating_mul(7));
        let (data @ [a, b, c, d, e, f, g], bytes, last) = self.source.segment(objects, offset)?;
        let end = offset.saturating_add(bytes.into());
        if end > self.counted
            && let Some(crc) = &mut self.crc
        {
            crc.update(data.get(..bytes.into()).unwrap_or(&data));
            self.counted = end;
        }
        self.sent = self.sent.saturating_add(1);
        self.complete = last;
        if last || self.sent >= self.block_size {
            self.phase = Phase::Acknowledge;
        }
        Ok([self.sent | if last { 0x80 } else { 0 }, a, b, c, d, e, f, g])
    }

    /// Takes "start" or the acknowledgement of a block.
    pub(super) fn receive(&mut self, request: &Message) -> Result<Option<Message>, Abort> {
        let [command, acknowledged, block_size, ..] = *request;
        match (self.phase, command & 0xE3) {
            (Phase::Start, 0xA3) => {
                self.phase = Phase::Sending;
                Ok(None)
            }
            (Phase::Acknowledge, 0xA2) => self.acknowledge(acknowledged, block_size),
            // A frame may be repeated; what it asked for is under way.
            (Phase::Sending, 0xA3) if self.base == 0 => Ok(None),
            _ => Err(Abort::COMMAND),
        }
    }

    fn acknowledge(&mut self, acknowledged: u8, block_size: u8) -> Result<Option<Message>, Abort> {
        if acknowledged > self.sent {
            return Err(Abort::SEQUENCE);
        }
        if acknowledged == self.sent && self.complete {
            self.phase = Phase::End;
            let length = self.source.length();
            // Seven unused bytes in the only segment of an empty entry, else what the last one lacks.
            let unused = if length == 0 { 7 } else { (7 - length % 7) % 7 } as u8;
            let [low, high] = self.crc.map_or(0, BlockCrc::value).to_le_bytes();
            return Ok(Some([0xC1 | unused << 2, low, high, 0, 0, 0, 0, 0]));
        }
        // Unacknowledged segments begin the next block.
        self.block_size = checked(block_size)?;
        self.base = self.base.saturating_add(u32::from(acknowledged).saturating_mul(7));
        self.sent = 0;
        self.complete = false;
        self.phase = Phase::Sending;
        Ok(None)
    }
}

/// 1 to 127 segments.
fn checked(block_size: u8) -> Result<u8, Abort> {
    if matches!(block_size, 1..=127) { Ok(block_size) } else { Err(Abort::BLOCK_SIZE) }
}
