//! A flash in memory with the rules of the STM32G4's: pages are erased, double words written once, zeros over anything.

use joint_firmware::parameters::slots::{BLANK, DOUBLE_WORD, PAGE_WORDS, ReadError, SlotFlash, WriteError, ZERO};

/// Double words, erased at first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flash {
    words: Vec<[u8; DOUBLE_WORD]>,
}

impl Flash {
    /// `pages` erased pages.
    #[must_use]
    pub fn erased(pages: usize) -> Self {
        Self { words: vec![BLANK; pages * PAGE_WORDS] }
    }
}

impl SlotFlash for Flash {
    fn erase_page(&mut self, page: usize) -> Result<(), WriteError> {
        let first = page * PAGE_WORDS;
        let words = self.words.get_mut(first..first + PAGE_WORDS).ok_or(WriteError { word: first })?;
        words.fill(BLANK);
        Ok(())
    }

    fn program(&mut self, word: usize, bytes: [u8; DOUBLE_WORD]) -> Result<(), WriteError> {
        let place = self.words.get_mut(word).ok_or(WriteError { word })?;
        if *place != BLANK && bytes != ZERO {
            return Err(WriteError { word });
        }
        *place = bytes;
        Ok(())
    }

    fn read(&mut self, word: usize) -> Result<[u8; DOUBLE_WORD], ReadError> {
        self.words.get(word).copied().ok_or(ReadError)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_double_word_is_written_once_until_its_page_is_erased_and_zeroed_at_any_time() {
        let mut flash = Flash::erased(2);
        let word = PAGE_WORDS + 3;
        flash.program(word, [1; 8]).unwrap();
        assert_eq!(flash.program(word, [1; 8]), Err(WriteError { word }));
        flash.program(word, ZERO).unwrap();
        assert_eq!(flash.read(word), Ok(ZERO));
        flash.erase_page(1).unwrap();
        assert_eq!(flash.read(word), Ok(BLANK));
        assert!(flash.erase_page(2).is_err() && flash.program(2 * PAGE_WORDS, ZERO).is_err());
        assert_eq!(flash.read(2 * PAGE_WORDS), Err(ReadError));
    }
}
