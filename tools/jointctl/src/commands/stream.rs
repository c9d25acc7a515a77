//! `-` in place of a file's name: standard input, or standard output.

use super::CommandError;
use super::force::Force;
use report::output::write_file;
use std::io::{self, Read, Write};
use std::path::Path;

/// True for `-`.
pub fn is_stream(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// The bytes of a file, or of standard input.
///
/// # Errors
/// [`CommandError::Read`].
pub fn read(path: &Path) -> Result<Vec<u8>, CommandError> {
    let mut bytes = Vec::new();
    let read = match is_stream(path) {
        true => io::stdin().read_to_end(&mut bytes).map(drop),
        false => std::fs::read(path).map(|all| bytes = all),
    };
    read.map(|()| bytes).map_err(|source| CommandError::Read { path: path.to_owned(), source })
}

/// Checks that a file can be written, as [`Force::permits`]; standard output always can.
///
/// # Errors
/// Those of [`Force::permits`].
pub fn permits(force: Force, path: &Path) -> Result<(), CommandError> {
    if is_stream(path) { Ok(()) } else { force.permits([path]) }
}

/// Writes a file and says so, or standard output and nothing else.
///
/// # Errors
/// [`CommandError`]; what was there before is still there.
pub fn write(path: &Path, contents: &[u8], said: &str) -> Result<(), CommandError> {
    if is_stream(path) {
        // A reader that closes the pipe, as `head` does, has seen enough.
        let _ = io::stdout().write_all(contents).and_then(|()| io::stdout().flush());
        return Ok(());
    }
    write_file(path, contents)?;
    if !said.is_empty() {
        println!("{said}");
    }
    Ok(())
}
