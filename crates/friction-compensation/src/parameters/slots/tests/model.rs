//! A model of STM32G4 flash whose power can go at any erase or write; host.
//!
//! Double words under work at that instant are torn: they read in one of five ways, of which the worst gives the old
//! value, the new one, an error or anything else at every read anew. Noise is drawn from a seed, so that a case can be
//! repeated.

use super::super::flash::{BLANK, DOUBLE_WORD, PAGE_WORDS, ReadError, SlotFlash, WriteError, ZERO};

type Bytes = [u8; DOUBLE_WORD];

/// Reading of torn double words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Torn {
    Error,
    Zeros,
    Ones,
    /// One value for good: old, new, their AND, or noise.
    Stable,
    /// Old, new, blank, zero, noise or an error, drawn at every read.
    Flicker,
}

impl Torn {
    pub const ALL: [Self; 5] = [Self::Error, Self::Zeros, Self::Ones, Self::Stable, Self::Flicker];
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Word {
    Blank,
    Written(Bytes),
    Torn { old: Bytes, new: Bytes, stable: Bytes },
}

/// The flash. Once its power has gone it refuses everything until [`Flash::power_on`].
#[derive(Clone, Debug)]
pub struct Flash {
    words: Vec<Word>,
    torn: Torn,
    noise: u64,
    /// Operations until the power goes; none: it stays.
    left: Option<usize>,
    /// A double word whose next write takes another value, and reports success.
    weak: Option<usize>,
    /// Erases and writes so far.
    pub operations: usize,
    pub off: bool,
}

impl Flash {
    pub fn new(pages: usize, torn: Torn, seed: u64) -> Self {
        let words = vec![Word::Blank; pages * PAGE_WORDS];
        Self { words, torn, noise: seed | 1, left: None, weak: None, operations: 0, off: false }
    }

    /// Power goes in the middle of the operation number `operation` (from 1) from now.
    pub fn cut_at(&mut self, operation: usize) {
        self.left = Some(operation);
    }

    pub fn power_on(&mut self) {
        self.left = None;
        self.off = false;
    }

    /// Flips a bit of a written double word that its ECC does not see: bit rot.
    pub fn rot(&mut self, word: usize, bit: usize) {
        if let Word::Written(bytes) = &mut self.words[word] {
            bytes[bit / 8 % DOUBLE_WORD] ^= 1 << (bit % 8);
        }
    }

    /// The next write of a double word has one bit wrong, without an error of the flash or of its ECC.
    pub fn weaken(&mut self, word: usize) {
        self.weak = Some(word);
    }

    /// A double word that was written whole reads as an error, or at random, from now on.
    pub fn wear(&mut self, word: usize) {
        if let Word::Written(bytes) = self.words[word] {
            let stable = self.draw().to_le_bytes();
            self.words[word] = Word::Torn { old: bytes, new: bytes, stable };
        }
    }

    fn draw(&mut self) -> u64 {
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 7;
        self.noise ^= self.noise << 17;
        self.noise.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// True when the power stays for one more operation.
    fn powered(&mut self, word: usize) -> Result<bool, WriteError> {
        if self.off {
            return Err(WriteError { word });
        }
        self.operations += 1;
        if let Some(left) = &mut self.left {
            *left -= 1;
            self.off = *left == 0;
        }
        Ok(!self.off)
    }

    fn tear(&mut self, word: usize, new: Bytes) {
        let (old, noise) = match self.words[word] {
            Word::Blank => (BLANK, self.draw()),
            Word::Written(old) => (old, self.draw()),
            Word::Torn { stable, .. } => (stable, self.draw()),
        };
        let stable = match noise >> 60 {
            0..4 => old,
            4..8 => new,
            8..12 => core::array::from_fn(|i| old[i] & new[i]),
            _ => noise.to_le_bytes(),
        };
        self.words[word] = Word::Torn { old, new, stable };
    }
}

impl SlotFlash for Flash {
    fn erase_page(&mut self, page: usize) -> Result<(), WriteError> {
        let words = page * PAGE_WORDS..(page + 1) * PAGE_WORDS;
        if self.powered(words.start)? {
            self.words[words].fill(Word::Blank);
            return Ok(());
        }
        // Cut early all is still there, cut late nearly nothing; in between, any mixture.
        let share = self.draw() % 4;
        for word in words.clone() {
            match self.draw() % 4 {
                3 if share < 3 => self.words[word] = Word::Blank,
                part if part >= share => self.tear(word, BLANK),
                _ => {}
            }
        }
        Err(WriteError { word: words.start })
    }

    fn program(&mut self, word: usize, bytes: Bytes) -> Result<(), WriteError> {
        let refused = WriteError { word };
        if !self.powered(word)? {
            self.tear(word, bytes);
            return Err(refused);
        }
        if self.words[word] != Word::Blank && bytes != ZERO {
            return Err(refused);
        }
        self.words[word] = Word::Written(bytes);
        if self.weak == Some(word) && bytes != ZERO {
            self.weak = None;
            self.rot(word, 0);
        }
        Ok(())
    }

    fn read(&mut self, word: usize) -> Result<Bytes, ReadError> {
        let (old, new, stable) = match self.words[word] {
            Word::Blank => return Ok(BLANK),
            Word::Written(bytes) => return Ok(bytes),
            Word::Torn { old, new, stable } => (old, new, stable),
        };
        match self.torn {
            Torn::Error => Err(ReadError),
            Torn::Zeros => Ok(ZERO),
            Torn::Ones => Ok(BLANK),
            Torn::Stable => Ok(stable),
            Torn::Flicker => {
                let noise = self.draw();
                match noise >> 61 {
                    0 | 1 => Ok(old),
                    2 | 3 => Ok(new),
                    4 => Ok(BLANK),
                    5 => Ok(ZERO),
                    6 => Ok(noise.to_le_bytes()),
                    _ => Err(ReadError),
                }
            }
        }
    }
}
