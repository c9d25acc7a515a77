//! The four double words at the start of a slot; task or host.
//!
//! | double word | content |
//! |---|---|
//! | 0 | header: payload length (2 bytes), sequence number (2), CRC-32 (4), little-endian |
//! | 1, 2 | confirmations, [`CONFIRMED`] |
//! | 3 | settled, once it is all zeros |
//!
//! The CRC-32 (ISO-HDLC) is of the content's kind (4 bytes), length, sequence number and payload. The reason for the
//! other three is told in the [module](super).

use super::flash::{DOUBLE_WORD, SlotFlash};

/// Double words before the payload.
pub(super) const HEADER_WORDS: usize = 4;
/// Double word of the header.
pub(super) const HEADER: usize = 0;
/// Double words of the two confirmations.
pub(super) const CONFIRMATIONS: [usize; 2] = [1, 2];
/// Double word that is zero in a settled slot.
pub(super) const SETTLED: usize = 3;
/// Content of a confirmation: neither blank nor zero, nor anything that a half-done write of zeros looks like.
pub(super) const CONFIRMED: [u8; DOUBLE_WORD] = *b"\x5a\xc3confir";

const CRC: crc::Crc<u32, crc::NoTable> = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);

/// Fields of the header about the payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) length: u16,
    pub(super) sequence: u16,
    pub(super) checksum: u32,
}

impl Header {
    pub(super) fn encode(self) -> [u8; DOUBLE_WORD] {
        let [l0, l1] = self.length.to_le_bytes();
        let [s0, s1] = self.sequence.to_le_bytes();
        let [c0, c1, c2, c3] = self.checksum.to_le_bytes();
        [l0, l1, s0, s1, c0, c1, c2, c3]
    }

    /// None for a length that no payload has; blank and zero double words are among these.
    pub(super) fn decode(bytes: [u8; DOUBLE_WORD], capacity: usize) -> Option<Self> {
        let [l0, l1, s0, s1, c0, c1, c2, c3] = bytes;
        let length = u16::from_le_bytes([l0, l1]);
        let sequence = u16::from_le_bytes([s0, s1]);
        let checksum = u32::from_le_bytes([c0, c1, c2, c3]);
        (length != 0 && usize::from(length) <= capacity).then_some(Self { length, sequence, checksum })
    }
}

/// The checksum of a payload, taken piece by piece.
pub(super) struct Checksum(crc::Digest<'static, u32, crc::NoTable>);

impl Checksum {
    pub(super) fn new(kind: u32, length: u16, sequence: u16) -> Self {
        let mut digest = CRC.digest();
        digest.update(&kind.to_le_bytes());
        digest.update(&length.to_le_bytes());
        digest.update(&sequence.to_le_bytes());
        Self(digest)
    }

    pub(super) fn add(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    pub(super) fn value(self) -> u32 {
        self.0.finalize()
    }
}

/// True when `a` was written after `b`: sequence numbers wrap, and two slots are never further apart than a few.
pub(super) const fn newer(a: u16, b: u16) -> bool {
    (a.wrapping_sub(b) as i16) > 0
}

/// The double words of a slot's start as one boot has read them; what cannot be read is none.
pub(super) struct Marks([Option<[u8; DOUBLE_WORD]>; HEADER_WORDS]);

impl Marks {
    pub(super) fn read(flash: &mut impl SlotFlash, start: usize) -> Self {
        let mut words = [None; HEADER_WORDS];
        for (offset, word) in words.iter_mut().enumerate() {
            *word = flash.read(start + offset).ok();
        }
        Self(words)
    }

    pub(super) fn header(&self, capacity: usize) -> Option<Header> {
        let [header, ..] = self.0;
        Header::decode(header?, capacity)
    }

    /// True where double word `index` was read as `bytes`.
    pub(super) fn is(&self, index: usize, bytes: [u8; DOUBLE_WORD]) -> bool {
        self.0.get(index).is_some_and(|word| *word == Some(bytes))
    }

    /// True where every double word was read as `bytes`.
    pub(super) fn all(&self, bytes: [u8; DOUBLE_WORD]) -> bool {
        self.0.iter().all(|word| *word == Some(bytes))
    }
}
