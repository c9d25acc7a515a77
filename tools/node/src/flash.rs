//! A flash with the rules of the STM32G4's: pages are erased, double words written once, zeros over anything. In
//! memory, and where a file is given there, too.

use friction_compensation::parameters::slots::{
    BLANK, DOUBLE_WORD, PAGE, PAGE_WORDS, ReadError, SlotFlash, WriteError, ZERO,
};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::Arc;

/// Double words, erased at first. A clone of one with a file shares the file: let only one of them write.
#[derive(Clone, Debug)]
pub struct Flash {
    words: Vec<[u8; DOUBLE_WORD]>,
    file: Option<Arc<File>>,
}

impl PartialEq for Flash {
    fn eq(&self, other: &Self) -> bool {
        self.words == other.words
    }
}

impl Eq for Flash {}

impl Flash {
    /// `pages` erased pages.
    #[must_use]
    pub fn erased(pages: usize) -> Self {
        Self { words: vec![BLANK; pages * PAGE_WORDS], file: None }
    }

    /// `pages` pages that are kept in a file: as it holds them, or erased where there is none yet.
    ///
    /// # Errors
    /// The file cannot be made, read or written, or is of another length.
    pub fn file(path: &Path, pages: usize) -> io::Result<Self> {
        let mut file = File::options().read(true).write(true).create(true).truncate(false).open(path)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        if bytes.is_empty() {
            bytes = vec![0xFF; pages * PAGE];
            file.write_all(&bytes)?;
        }
        if bytes.len() != pages * PAGE {
            let problem = format!("{} has {} bytes instead of {}", path.display(), bytes.len(), pages * PAGE);
            return Err(io::Error::new(io::ErrorKind::InvalidData, problem));
        }
        let words = bytes.as_chunks().0.to_vec();
        Ok(Self { words, file: Some(Arc::new(file)) })
    }

    /// Writes `count` words from `first` on to the file.
    fn keep(&mut self, first: usize, count: usize) -> Result<(), WriteError> {
        let Some(file) = &self.file else { return Ok(()) };
        let mut file = &**file;
        let bytes = self.words.get(first..first + count).unwrap_or_default().as_flattened();
        let kept = file.seek(SeekFrom::Start((first * DOUBLE_WORD) as u64)).and_then(|_| file.write_all(bytes));
        kept.map_err(|_| WriteError { word: first })
    }
}

impl SlotFlash for Flash {
    fn erase_page(&mut self, page: usize) -> Result<(), WriteError> {
        let first = page * PAGE_WORDS;
        let words = self.words.get_mut(first..first + PAGE_WORDS).ok_or(WriteError { word: first })?;
        words.fill(BLANK);
        self.keep(first, PAGE_WORDS)
    }

    fn program(&mut self, word: usize, bytes: [u8; DOUBLE_WORD]) -> Result<(), WriteError> {
        let place = self.words.get_mut(word).ok_or(WriteError { word })?;
        if *place != BLANK && bytes != ZERO {
            return Err(WriteError { word });
        }
        *place = bytes;
        self.keep(word, 1)
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

    #[test]
    fn a_file_holds_every_word_the_moment_it_is_written_and_another_length_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flash.bin");
        let mut flash = Flash::file(&path, 2).unwrap();
        flash.program(3, [7; 8]).unwrap();
        flash.program(PAGE_WORDS + 1, [9; 8]).unwrap();
        assert_eq!(Flash::file(&path, 2).unwrap(), flash);
        flash.erase_page(1).unwrap();
        let mut again = Flash::file(&path, 2).unwrap();
        assert_eq!((again.read(3), again.read(PAGE_WORDS + 1)), (Ok([7; 8]), Ok(BLANK)));
        assert!(Flash::file(&path, 3).unwrap_err().to_string().contains("4096"));
    }
}
