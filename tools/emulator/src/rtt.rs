//! Log of the program: SEGGER's real-time transfer read out of its memory, and the defmt messages in it.
//!
//! Host only. The control block is that of `defmt-rtt`: a name of 16 bytes, the number of channels in each direction,
//! then for each channel name, buffer, size, write offset, read offset, flags, a word each. A debug probe does the same
//! over its wire.

use crate::bus::{Bus, Refusal, Width};
use crate::program::Program;
use defmt_decoder::{DecodeError, StreamDecoder, Table};
use std::fmt;

/// Symbol of the control block.
const CONTROL_BLOCK: &str = "_SEGGER_RTT";
/// Offset of the first channel to the host, and in it of what is needed.
const CHANNEL: u32 = 24;
const BUFFER: u32 = 4;
const SIZE: u32 = 8;
const WRITE: u32 = 12;
const READ: u32 = 16;

/// The first channel from program to host.
#[derive(Clone, Copy, Debug)]
pub struct Rtt {
    channel: u32,
}

/// Reason for which nothing could be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RttError {
    /// Its memory does not answer.
    Memory(Refusal),
    /// The offsets lie outside of the buffer, or it outside of the address space: it is not set up, or overwritten.
    Damaged {
        /// Bytes of the buffer.
        size: u32,
        /// Offset at which the program writes next.
        write: u32,
        /// Offset at which the host reads next.
        read: u32,
    },
}

impl fmt::Display for RttError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Memory(refusal) => write!(f, "the log's memory does not answer: {refusal:?}"),
            Self::Damaged { size, write, read } => {
                write!(f, "the log's offsets {write} and {read} lie outside of its {size} bytes")
            }
        }
    }
}

impl std::error::Error for RttError {}

impl From<Refusal> for RttError {
    fn from(refusal: Refusal) -> Self {
        Self::Memory(refusal)
    }
}

impl Rtt {
    /// The channel of a program; None where it has no log.
    pub fn of(program: &Program) -> Option<Self> {
        let block = program.symbol(CONTROL_BLOCK)?;
        Some(Self { channel: block.address + CHANNEL })
    }

    /// Takes what has been written since it was last read. Nothing before the program has initialised its memory.
    pub fn read<B: Bus>(&self, bus: &mut B, now: u64) -> Result<Vec<u8>, RttError> {
        let mut word = |offset: u32| bus.read(now, self.channel + offset, Width::Word);
        let (buffer, size, write, start) = (word(BUFFER)?, word(SIZE)?, word(WRITE)?, word(READ)?);
        if size == 0 || write == start {
            return Ok(Vec::new());
        }
        // Memory that has just got its power holds anything.
        if write >= size || start >= size || buffer.checked_add(size).is_none() {
            return Err(RttError::Damaged { size, write, read: start });
        }
        let length = if write > start { write - start } else { size - start + write };
        let bytes = (0..length).map(|i| {
            let to_end = size - start;
            let offset = if i < to_end { start + i } else { i - to_end };
            bus.read(now, buffer + offset, Width::Byte).map(|byte| byte as u8)
        });
        let bytes = bytes.collect::<Result<Vec<u8>, Refusal>>()?;
        bus.write(now, self.channel + READ, Width::Word, write)?;
        Ok(bytes)
    }
}

/// The messages that a program can log.
pub struct Messages(Table);

impl Messages {
    /// Table of a program; None where it logs without defmt, an error where it is of another version.
    pub fn of(program: &Program) -> Result<Option<Self>, String> {
        Table::parse(program.elf()).map(|table| table.map(Self)).map_err(|error| format!("{error:#}"))
    }

    /// Decodes a stream from its beginning.
    pub fn decoder(&self) -> Decoder<'_> {
        Decoder { stream: self.0.new_stream_decoder(), recovers: self.0.encoding().can_recover() }
    }
}

/// Bytes become messages, as they come.
pub struct Decoder<'t> {
    stream: Box<dyn StreamDecoder + Send + Sync + 't>,
    /// `true` if the encoding shows where the next message begins.
    recovers: bool,
}

/// A message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Its timestamp as the program formats it; empty where it has none.
    pub timestamp: String,
    /// "error", "warn", "info", "debug", "trace"; None for what is printed without a level.
    pub level: Option<&'static str>,
    /// Text of the message.
    pub text: String,
}

impl Decoder<'_> {
    /// The messages that are complete with these bytes. A damaged one is told as what it is.
    pub fn decode(&mut self, bytes: &[u8]) -> Vec<Message> {
        self.stream.received(bytes);
        let mut messages = Vec::new();
        loop {
            match self.stream.decode() {
                Ok(frame) => messages.push(Message {
                    timestamp: frame.display_timestamp().map(|time| time.to_string()).unwrap_or_default(),
                    level: frame.level().map(|level| level.as_str()),
                    text: frame.display_message().to_string(),
                }),
                Err(DecodeError::UnexpectedEof) => return messages,
                Err(DecodeError::Malformed) => {
                    let text = "a message that the table does not explain".to_owned();
                    messages.push(Message { timestamp: String::new(), level: Some("error"), text });
                    if !self.recovers {
                        return messages;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::Memory;

    const BLOCK: u32 = 0x2000_0000;
    const TEXT: u32 = 0x2000_0100;

    /// A channel of 8 bytes that hold "ABCDEFGH".
    fn channel(write: u32, read: u32) -> (Memory, Rtt) {
        let mut memory = Memory::new().with(BLOCK..BLOCK + 0x200, false);
        let words = [0, TEXT, 8, write, read, 0].map(u32::to_le_bytes).concat();
        assert!(memory.set(BLOCK + CHANNEL, &words) && memory.set(TEXT, b"ABCDEFGH"));
        (memory, Rtt { channel: BLOCK + CHANNEL })
    }

    #[test]
    fn what_was_written_is_read_once() {
        let (mut memory, rtt) = channel(5, 2);
        assert_eq!(rtt.read(&mut memory, 0), Ok(b"CDE".to_vec()));
        assert_eq!(rtt.read(&mut memory, 0), Ok(Vec::new()));
    }

    #[test]
    fn the_buffer_is_a_ring() {
        let (mut memory, rtt) = channel(1, 6);
        assert_eq!(rtt.read(&mut memory, 0), Ok(b"GHA".to_vec()));
    }

    #[test]
    fn offsets_that_cannot_be_are_told() {
        let (mut memory, rtt) = channel(9, 0);
        assert_eq!(rtt.read(&mut memory, 0), Err(RttError::Damaged { size: 8, write: 9, read: 0 }));
        // Contents of memory as it comes up: a buffer that ends beyond the address space, one that ends with it, and
        // one as large as it.
        for (buffer, size, write, read) in [
            (u32::MAX - 6, 8, 5, 2),
            (u32::MAX - 8, 8, 5, 2),
            (TEXT, u32::MAX - TEXT, 0xC000_0000, 1),
            (0, u32::MAX, 1, 0xC000_0000),
        ] {
            let (mut memory, rtt) = channel(0, 0);
            let words = [0, buffer, size, write, read, 0].map(u32::to_le_bytes).concat();
            assert!(memory.set(BLOCK + CHANNEL, &words));
            let ends_beyond = buffer.checked_add(size).is_none();
            let damaged = RttError::Damaged { size, write, read };
            let expected = if ends_beyond { damaged } else { RttError::Memory(Refusal::NoAnswer) };
            assert_eq!(rtt.read(&mut memory, 0), Err(expected), "{buffer:#x}, {size:#x}");
        }
        let (_, rtt) = channel(1, 0);
        let mut nothing = Memory::new();
        assert_eq!(rtt.read(&mut nothing, 0), Err(RttError::Memory(Refusal::NoAnswer)));
    }
}
