//! Interface of a flash to a store of slots, with the rules of the STM32G4's; task, or host with a model.
//!
//! Double words of 8 bytes are written once after an erase, even 0xFF bytes; only all zeros may be written over
//! anything. Pages of 2 KiB are erased to 0xFF (RM0440, embedded flash memory). A double word or page whose writing is
//! cut off by a loss of power is torn: it may read as an ECC error, as what was there, as what was to be there, as
//! anything else, and differently each time.

/// Bytes of a page, the least that can be erased.
pub const PAGE: usize = 2048;
/// Bytes of a double word, the least that can be written.
pub const DOUBLE_WORD: usize = 8;
/// Double words of a page.
pub const PAGE_WORDS: usize = PAGE / DOUBLE_WORD;
/// An erased double word.
pub const BLANK: [u8; DOUBLE_WORD] = [0xff; DOUBLE_WORD];
/// The only value that may be written over another one, any number of times.
pub const ZERO: [u8; DOUBLE_WORD] = [0; DOUBLE_WORD];

/// A double word cannot be read: its ECC finds two wrong bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadError;

impl core::fmt::Display for ReadError {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        f.write_str("a double word of the flash reads with a double ECC error")
    }
}

impl core::error::Error for ReadError {}

/// The flash refuses to erase or to write (write protection, a double word that is not blank, a supply too low).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WriteError {
    /// Double word, or first double word of the page.
    pub word: usize,
}

impl core::fmt::Display for WriteError {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        write!(f, "the flash refuses to write double word {} of the parameters", self.word)
    }
}

impl core::error::Error for WriteError {}

/// The flash pages set aside for parameters. Pages and double words count from the first page's start.
pub trait SlotFlash {
    /// Erases a page: all its double words are [`BLANK`]. Returns when that is done.
    fn erase_page(&mut self, page: usize) -> Result<(), WriteError>;
    /// Writes a double word, which must be [`BLANK`] unless `bytes` is [`ZERO`]. Returns when that is done.
    fn program(&mut self, word: usize, bytes: [u8; DOUBLE_WORD]) -> Result<(), WriteError>;
    /// Reads a double word. A torn one must not stop the program: see [`ecc`](crate::parameters::ecc).
    fn read(&mut self, word: usize) -> Result<[u8; DOUBLE_WORD], ReadError>;
}
