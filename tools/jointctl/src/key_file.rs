//! A joint's key as a file: 64 hexadecimal digits, readable by nobody but its owner; host.

use friction_compensation::parameters::authentication::{KEY, Key, KeyRefusal};
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Reason for which a key is not read or not made.
#[derive(Debug, thiserror::Error)]
pub enum KeyFileError {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// Action that was tried.
        action: &'static str,
        /// Path of the action.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// A key is never overwritten: joints that have it would take no image any more.
    #[error("{} exists; a key is never overwritten, choose another name or move it away", .0.display())]
    Exists(PathBuf),
    /// File with something else in it.
    #[error("{} holds {found} characters beside blanks, a key is {} hexadecimal digits", path.display(), 2 * KEY)]
    Length {
        /// The file.
        path: PathBuf,
        /// Characters.
        found: usize,
    },
    /// A character that is no digit.
    #[error("{}: {character:?} at place {place} is no hexadecimal digit", path.display())]
    Digit {
        /// The file.
        path: PathBuf,
        /// The character.
        character: char,
        /// Its place, from 1.
        place: usize,
    },
    /// A key that no joint takes.
    #[error("{}: {source}", path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: KeyRefusal,
    },
    /// No random numbers.
    #[error("the system gives no random numbers: {0}")]
    Random(getrandom::Error),
}

/// Makes a key from the system's random numbers and writes it to a new file.
///
/// # Errors
/// A file that exists, which stays as it is; what the system refuses.
pub fn create(path: &Path) -> Result<Key, KeyFileError> {
    let mut bytes = [0; KEY];
    getrandom::fill(&mut bytes).map_err(KeyFileError::Random)?;
    let refused = |source| KeyFileError::Refused { path: path.to_owned(), source };
    let key = Key::new(bytes).map_err(refused)?;
    let digits: String = key.to_bytes().iter().map(|byte| format!("{byte:02x}")).collect();
    let written = open_new(path).and_then(|mut file| {
        let whole = writeln!(file, "{digits}").and_then(|()| file.sync_all());
        if whole.is_err() {
            // Half a key is none; the error that is reported is the first one.
            let _ = fs::remove_file(path);
        }
        whole
    });
    match written {
        Ok(()) => Ok(key),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Err(KeyFileError::Exists(path.to_owned())),
        Err(source) => Err(KeyFileError::Io { action: "write", path: path.to_owned(), source }),
    }
}

fn open_new(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(path)
}

/// Reads a key; blanks and line ends around and between digits do not count.
///
/// # Errors
/// Defects of the file.
pub fn read(path: &Path) -> Result<Key, KeyFileError> {
    let unreadable = |source| KeyFileError::Io { action: "read", path: path.to_owned(), source };
    let text = fs::read_to_string(path).map_err(unreadable)?;
    let characters: Vec<char> = text.chars().filter(|character| !character.is_whitespace()).collect();
    if characters.len() != 2 * KEY {
        return Err(KeyFileError::Length { path: path.to_owned(), found: characters.len() });
    }
    let mut bytes = [0u8; KEY];
    for (place, &character) in characters.iter().enumerate() {
        let digit = character.to_digit(16);
        let digit = digit.ok_or(KeyFileError::Digit { path: path.to_owned(), character, place: place + 1 })?;
        bytes[place / 2] = bytes[place / 2] << 4 | digit as u8;
    }
    Key::new(bytes).map_err(|source| KeyFileError::Refused { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_key_reads_back_and_is_its_owners_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("joint.key");
        let key = create(&path).unwrap();
        assert_eq!(read(&path).unwrap().to_bytes(), key.to_bytes());
        assert_ne!(create(&folder.path().join("other.key")).unwrap().to_bytes(), key.to_bytes());
        #[cfg(unix)]
        {
            let mode = std::os::unix::fs::PermissionsExt::mode(&fs::metadata(&path).unwrap().permissions());
            assert_eq!(mode & 0o777, 0o600);
        }
    }

    #[test]
    fn a_key_that_exists_is_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("joint.key");
        fs::write(&path, "mine").unwrap();
        assert!(matches!(create(&path), Err(KeyFileError::Exists(_))));
        assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
    }

    #[test]
    fn what_is_no_key_is_refused_with_what_and_where() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("joint.key");
        let refusal = |text: &str| {
            fs::write(&path, text).unwrap();
            read(&path).unwrap_err().to_string()
        };
        assert!(refusal("12 34\n").ends_with("holds 4 characters beside blanks, a key is 64 hexadecimal digits"));
        assert!(refusal(&"0g".repeat(32)).ends_with("'g' at place 2 is no hexadecimal digit"));
        assert!(refusal(&"00".repeat(32)).ends_with("all 32 bytes of the key are equal"));
        assert!(read(Path::new("nowhere.key")).unwrap_err().to_string().starts_with("cannot read nowhere.key"));
    }
}
