//! The parameter pages of an emulated board in a file.
//!
//! [`FlashFile::keep`] writes them whenever the flash has worked, as a loss of power at that moment would leave them:
//! an operation under way is torn. Whoever calls it after every part of a run loses no more than that part when the
//! process is killed. A file is replaced as a whole.

use emulator::board::Wired;
use emulator::chip::flash::KeptError;
use emulator::emulation::Emulation;
use emulator::program::Program;
use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Reason for which a flash is not kept.
#[derive(Debug, thiserror::Error)]
pub enum FlashFileError {
    /// The program has no parameter pages.
    #[error("the program keeps no parameters: it has no region __parameters_start to __parameters_end in the flash")]
    NoPages,
    /// The file or its folder.
    #[error("{}: {source}", path.display())]
    File {
        /// Path of it.
        path: PathBuf,
        /// Error.
        source: io::Error,
    },
    /// The file holds something else. It stays as it is.
    #[error("{}: {source}", path.display())]
    Foreign {
        /// Path of it.
        path: PathBuf,
        /// Error.
        source: KeptError,
    },
}

/// File in which the pages are kept.
#[derive(Debug)]
pub struct FlashFile {
    path: PathBuf,
    addresses: Range<u32>,
    /// Progress of the flash when it was last looked at.
    progress: (u64, bool),
}

impl FlashFile {
    /// Below a folder, which is made where it is missing, by the name of the board. What the file holds is in the
    /// board's flash from now on.
    ///
    /// # Errors
    /// A program without parameters, a file that cannot be used.
    pub fn open<W: Wired>(
        folder: &Path,
        emulation: &mut Emulation<W>,
        program: &Program,
    ) -> Result<Self, FlashFileError> {
        let symbol = |name| program.symbol(name).map(|symbol| symbol.address);
        let addresses = symbol("__parameters_start").zip(symbol("__parameters_end"));
        let addresses = addresses.map(|(start, end)| start..end).filter(|addresses| !addresses.is_empty());
        let addresses = addresses.ok_or(FlashFileError::NoPages)?;
        let path = folder.join(format!("{}.flash", W::NAME));
        let failed = |path: &Path, source| FlashFileError::File { path: path.to_owned(), source };
        fs::create_dir_all(folder).map_err(|source| failed(folder, source))?;
        match fs::read(&path) {
            Ok(bytes) => emulation
                .cpu
                .bus
                .restore(addresses.clone(), &bytes)
                .map_err(|source| FlashFileError::Foreign { path: path.clone(), source })?,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(source) => return Err(failed(&path, source)),
        }
        let progress = emulation.cpu.bus.flash().progress();
        let kept = Self { path, addresses, progress };
        // A folder that cannot be written is found now, not at the first store.
        kept.write(emulation)?;
        Ok(kept)
    }

    /// Writes what changed since the last call.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn keep<W: Wired>(&mut self, emulation: &Emulation<W>) -> Result<(), FlashFileError> {
        let progress = emulation.cpu.bus.flash().progress();
        if progress == self.progress {
            return Ok(());
        }
        self.progress = progress;
        self.write(emulation)
    }

    fn write<W: Wired>(&self, emulation: &Emulation<W>) -> Result<(), FlashFileError> {
        let bytes = emulation.cpu.bus.kept(self.addresses.clone()).ok_or(FlashFileError::NoPages)?;
        let new = self.path.with_extension("new");
        let written = fs::write(&new, bytes).and_then(|()| fs::rename(&new, &self.path));
        written.map_err(|source| FlashFileError::File { path: self.path.clone(), source })
    }
}
