//! Pages of the flash as bytes, to be kept while the emulator does not run: each double word with its state, torn ones
//! included.

use super::array::{DOUBLE_WORD, Part, Torn};
use super::{Array, Flash};
use std::fmt;
use std::ops::Range;

/// First of all; the last digit is the version.
const MAGIC: [u8; 8] = *b"EMFLASH1";
/// Bytes of a cell: the double word, and its state.
const CELL: usize = 9;
/// States; a torn cell has the number of its kind more than [`TORN`].
const ERASED: u8 = 0;
const WRITTEN: u8 = 1;
const TORN: u8 = 2;

/// Reason for which bytes are no kept pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeptError {
    /// Foreign bytes: they are something else.
    Foreign,
    /// Wrong length: they are of another number of pages.
    Length {
        /// Bytes that there are.
        found: usize,
        /// Bytes that there should be.
        expected: usize,
    },
    /// A cell has a state that is none.
    State {
        /// Its offset in the flash.
        offset: u32,
        /// The state.
        state: u8,
    },
}

impl fmt::Display for KeptError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Foreign => f.write_str("it does not begin as the flash of an emulated board"),
            Self::Length { found, expected } => write!(f, "it has {found} bytes instead of {expected}"),
            Self::State { offset, state } => write!(f, "the double word at {offset:#x} of the flash has state {state}"),
        }
    }
}

impl std::error::Error for KeptError {}

impl Flash {
    /// Number of operations that have begun, and whether one is under way: kept pages change with it.
    pub const fn progress(&self) -> (u64, bool) {
        (self.operations, self.busy.is_some())
    }

    /// Pages in a range of offsets as a loss of power would leave them now: an operation under way tears them.
    pub fn kept(&self, offsets: Range<u32>) -> Vec<u8> {
        let cells = match self.busy.as_ref().and_then(|busy| busy.before.as_ref()) {
            None => self.array.part(offsets),
            Some(before) => {
                let mut array: Array = self.array.clone();
                array.tear(before.clone(), Torn::Error);
                array.part(offsets)
            }
        };
        let mut bytes = MAGIC.to_vec();
        for (value, written, torn) in cells.cells {
            bytes.extend(value.to_le_bytes());
            bytes.push(match torn {
                Some(kind) => TORN + kind as u8,
                None if written => WRITTEN,
                None => ERASED,
            });
        }
        bytes
    }

    /// Puts pages back as they were [kept](Self::kept), before the run.
    ///
    /// # Errors
    /// Bytes that are no such pages; nothing has changed then.
    pub fn restore(&mut self, offsets: Range<u32>, bytes: &[u8]) -> Result<(), KeptError> {
        let words = (offsets.len() as u32 / DOUBLE_WORD) as usize;
        let cells = bytes.strip_prefix(&MAGIC).ok_or(KeptError::Foreign)?;
        if cells.len() != words * CELL {
            return Err(KeptError::Length { found: bytes.len(), expected: MAGIC.len() + words * CELL });
        }
        let first = offsets.start / DOUBLE_WORD;
        let cell = |(word, [value @ .., state]): (u32, &[u8; CELL])| {
            let torn = state.checked_sub(TORN).map(usize::from);
            let kind = torn.and_then(|kind| Torn::ALL.get(kind)).copied();
            match torn.is_some() && kind.is_none() {
                true => Err(KeptError::State { offset: word * DOUBLE_WORD, state: *state }),
                false => Ok((u64::from_le_bytes(*value), *state != ERASED, kind)),
            }
        };
        let cells = (first..).zip(cells.as_chunks().0).map(cell).collect::<Result<_, _>>()?;
        self.array.put(Part { first, cells });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::variant::STM32G431CB;

    #[test]
    fn torn_erased_and_written_cells_are_there_again() {
        let mut flash = Flash::new(&STM32G431CB);
        flash.array.program(256, 7);
        flash.array.program(257, u64::MAX);
        for (word, kind) in (258..).zip(Torn::ALL) {
            flash.array.tear(flash.array.part(word * 8..word * 8 + 8), kind);
        }
        let kept = flash.kept(2048..4096);
        let mut other = Flash::new(&STM32G431CB);
        other.restore(2048..4096, &kept).unwrap();
        assert_eq!(other.kept(2048..4096), kept);
        assert_eq!(other.array.bytes()[..4096], flash.array.bytes()[..4096]);
        assert_eq!(other.array.torn(), flash.array.torn());
        assert!(!other.array.accepts(257, 1) && other.array.accepts(300, 1), "ones that were written are not erased");
    }

    #[test]
    fn what_is_no_kept_flash_is_refused_and_changes_nothing() {
        let mut flash = Flash::new(&STM32G431CB);
        let kept = flash.kept(0..2048);
        assert_eq!(flash.restore(0..2048, b"something else"), Err(KeptError::Foreign));
        assert_eq!(flash.restore(0..4096, &kept), Err(KeptError::Length { found: 2_312, expected: 4_616 }));
        for (state, good) in [(6, true), (7, false)] {
            let mut wrong = kept.clone();
            wrong[8 + 8] = state;
            let outcome = flash.restore(0..2048, &wrong);
            assert_eq!(outcome, if good { Ok(()) } else { Err(KeptError::State { offset: 0, state: 7 }) });
        }
    }
}
