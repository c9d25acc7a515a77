//! The cells of the flash: double words with their error correction, and what a loss of power makes of them.
//!
//! RM0440, 3.3.2 and 5.3.2 "Error code correction": eight check bits a double word, so a double word is written once
//! after an erase. What a cell holds whose programming or erasing did not end is in no document; [`Torn`] lists what
//! storage has to survive.

use super::super::memory;
use crate::bus::Width;
use std::collections::BTreeMap;
use std::ops::Range;

/// Bytes of a double word.
pub const DOUBLE_WORD: u32 = 8;
/// Bytes of a page, in one bank and in two (3.3.1 and 5.3.1).
pub const PAGE: u32 = 2048;

/// Reading of a double word whose programming or erasing the power did not last for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Torn {
    /// Junk, and the error correction finds two wrong bits.
    Error,
    /// Zeros.
    Zeros,
    /// Ones, though it is not erased.
    Ones,
    /// Junk, the same at every read.
    Junk,
    /// Junk, other at every read; at every second read on average the error correction finds two wrong bits.
    Flicker,
}

impl Torn {
    /// All kinds.
    pub const ALL: [Self; 5] = [Self::Error, Self::Zeros, Self::Ones, Self::Junk, Self::Flicker];
}

/// A value, and the offset of the double word in which two bits are wrong; none where none is.
pub type Read = (u32, Option<u32>);

/// Double words before an operation: value, whether written, how torn.
#[derive(Clone, Debug)]
pub struct Part {
    pub(super) first: u32,
    pub(super) cells: Vec<(u64, bool, Option<Torn>)>,
}

impl Part {
    /// Range in which they lie.
    pub fn offsets(&self) -> Range<u32> {
        self.first * DOUBLE_WORD..(self.first + self.cells.len() as u32) * DOUBLE_WORD
    }
}

/// The cells.
#[derive(Clone, Debug)]
pub struct Array {
    bytes: Vec<u8>,
    /// Double words that are not erased.
    written: Vec<bool>,
    torn: BTreeMap<u32, Torn>,
    random: u64,
}

impl Array {
    /// Erased.
    pub fn new(size: u32) -> Self {
        Self {
            bytes: vec![0xff; size as usize],
            written: vec![false; (size / DOUBLE_WORD) as usize],
            torn: BTreeMap::new(),
            random: 0x9e37_79b9_7f4a_7c15,
        }
    }

    /// Chooses what losses of power do, where it is left to chance.
    pub fn seed(&mut self, seed: u64) {
        self.random = seed ^ 0x9e37_79b9_7f4a_7c15;
    }

    fn random(&mut self) -> u64 {
        // SplitMix64: any seed will do, zero included.
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.random ^ self.random >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }

    /// Bytes, torn ones as if they were whole.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Torn double words by their number.
    pub fn torn(&self) -> &BTreeMap<u32, Torn> {
        &self.torn
    }

    /// Writes what a programmer writes beforehand, over whatever is there. False where it does not fit.
    pub fn flash(&mut self, offset: u32, bytes: &[u8]) -> bool {
        let end = offset as usize + bytes.len();
        if end > self.bytes.len() {
            return false;
        }
        self.bytes[offset as usize..end].copy_from_slice(bytes);
        for word in offset / DOUBLE_WORD..(end as u32).div_ceil(DOUBLE_WORD) {
            self.torn.remove(&word);
            self.written[word as usize] = self.word(word) != u64::MAX;
        }
        true
    }

    fn word(&self, word: u32) -> u64 {
        let place = (word * DOUBLE_WORD) as usize;
        self.bytes[place..].first_chunk().map_or(u64::MAX, |bytes| u64::from_le_bytes(*bytes))
    }

    fn set_word(&mut self, word: u32, value: u64) {
        let place = (word * DOUBLE_WORD) as usize;
        if let Some(bytes) = self.bytes[place..].first_chunk_mut() {
            *bytes = value.to_le_bytes();
        }
    }

    /// A load; none where the flash ends before.
    #[inline(always)]
    pub fn read(&mut self, offset: u32, width: Width) -> Option<Read> {
        if self.torn.is_empty() {
            return Some((memory::load(&self.bytes, offset as usize, width)?, None));
        }
        self.read_with_torn(offset, width)
    }

    /// A word, where none of it is torn.
    pub fn intact(&self, offset: u32) -> Option<u32> {
        let torn =
            self.torn.contains_key(&(offset / DOUBLE_WORD)) || self.torn.contains_key(&((offset + 3) / DOUBLE_WORD));
        if torn { None } else { memory::load(&self.bytes, offset as usize, Width::Word) }
    }

    fn read_with_torn(&mut self, offset: u32, width: Width) -> Option<Read> {
        let last = offset + width.bytes() - 1;
        let mut wrong = None;
        for word in offset / DOUBLE_WORD..=last / DOUBLE_WORD {
            match self.torn.get(&word) {
                Some(Torn::Error) => wrong = wrong.or(Some(word * DOUBLE_WORD)),
                Some(Torn::Flicker) => {
                    let junk = self.random();
                    self.set_word(word, junk);
                    if self.random() & 1 == 0 {
                        wrong = wrong.or(Some(word * DOUBLE_WORD));
                    }
                }
                _ => {}
            }
        }
        Some((memory::load(&self.bytes, offset as usize, width)?, wrong))
    }

    /// Returns `true` if a double word may be programmed: erased, or overwritten by zeros (3.3.7 "Main memory
    /// programming sequences").
    pub fn accepts(&self, word: u32, value: u64) -> bool {
        value == 0 || !self.written[word as usize]
    }

    /// Programs a double word that [accepts](Self::accepts) it.
    pub fn program(&mut self, word: u32, value: u64) {
        self.torn.remove(&word);
        self.set_word(word, value);
        self.written[word as usize] = true;
    }

    /// Erases a page.
    pub fn erase(&mut self, page: u32) {
        for word in Self::words(page) {
            self.erase_word(word);
        }
    }

    fn words(page: u32) -> Range<u32> {
        page * (PAGE / DOUBLE_WORD)..(page + 1) * (PAGE / DOUBLE_WORD)
    }

    fn erase_word(&mut self, word: u32) {
        self.torn.remove(&word);
        self.set_word(word, u64::MAX);
        self.written[word as usize] = false;
    }

    /// Double words as they are.
    pub fn part(&self, offsets: Range<u32>) -> Part {
        let words = offsets.start / DOUBLE_WORD..offsets.end / DOUBLE_WORD;
        let cell = |word: u32| (self.word(word), self.written[word as usize], self.torn.get(&word).copied());
        Part { first: words.start, cells: words.map(cell).collect() }
    }

    /// An operation on a part did not end: a double word is torn; of a page, each is erased, torn, or as it was.
    pub fn tear(&mut self, before: Part, kind: Torn) {
        let page = before.cells.len() > 1;
        for (word, (value, written, torn)) in (before.first..).zip(before.cells) {
            match if page { self.random() % 3 } else { 1 } {
                0 => self.erase_word(word),
                1 => self.tear_word(word, kind),
                _ => self.put_word(word, value, written, torn),
            }
        }
    }

    /// Makes double words what they were.
    pub fn put(&mut self, part: Part) {
        for (word, (value, written, torn)) in (part.first..).zip(part.cells) {
            self.put_word(word, value, written, torn);
        }
    }

    fn put_word(&mut self, word: u32, value: u64, written: bool, torn: Option<Torn>) {
        self.set_word(word, value);
        self.written[word as usize] = written;
        match torn {
            Some(kind) => self.torn.insert(word, kind),
            None => self.torn.remove(&word),
        };
    }

    fn tear_word(&mut self, word: u32, kind: Torn) {
        let junk = self.random();
        let value = match kind {
            Torn::Zeros => 0,
            Torn::Ones => u64::MAX,
            Torn::Error | Torn::Junk | Torn::Flicker => junk,
        };
        self.set_word(word, value);
        self.written[word as usize] = true;
        self.torn.insert(word, kind);
    }
}
