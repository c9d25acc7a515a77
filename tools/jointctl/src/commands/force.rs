//! `--force`: permission to replace files, and the check of output paths before any work.

use super::CommandError;
use clap::Args;
use report::output::check_writable;
use std::path::{Path, PathBuf};

/// Permission to replace files.
#[derive(Clone, Copy, Debug, Args)]
pub struct Force {
    /// Replace files that exist
    #[arg(long)]
    force: bool,
}

impl Force {
    /// Checks that every one of `paths` can be written, and is not there yet or may be replaced.
    ///
    /// # Errors
    /// A file exists and `--force` was not given; a path names a folder; its folder cannot be written to.
    pub fn permits<P: AsRef<Path>>(self, paths: impl IntoIterator<Item = P>) -> Result<(), CommandError> {
        for path in paths {
            let path = path.as_ref();
            check_writable(path)?;
            if !self.force && path.symlink_metadata().is_ok() {
                return Err(CommandError::Arguments(format!("{} exists; --force replaces it", path.display())));
            }
        }
        Ok(())
    }

    /// The same for the files `names` of `folder`.
    ///
    /// # Errors
    /// Those of [`Force::permits`].
    pub fn permits_in(self, folder: &Path, names: &[&str]) -> Result<(), CommandError> {
        self.permits(names.iter().map(|name| folder.join(name)).collect::<Vec<PathBuf>>())
    }
}
