//! Output that is either whole or not there: files are written beside their target and renamed over it; host.
//!
//! The rule: only the files that a command writes are replaced, anything else in an existing directory stays. All new
//! files are staged in full before the first one is renamed; if a rename fails, the earlier ones are undone. A process
//! that is killed between two renames leaves every single file either old or new.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Component, Path, PathBuf};

/// Reason for which an output was not written. What was there before is still there.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
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
    /// A file name leaves the output directory.
    #[error("{} is not a path inside the output directory", .0.display())]
    Outside(PathBuf),
    /// The target has no name that a file could be written beside.
    #[error("{} does not name a file or directory", .0.display())]
    NoName(PathBuf),
}

/// One file of an output directory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputFile {
    /// Path relative to the output directory, made of plain names only.
    pub path: PathBuf,
    /// Contents.
    pub contents: Vec<u8>,
}

impl OutputFile {
    /// A file from its relative path and contents.
    pub fn new(path: impl Into<PathBuf>, contents: impl Into<Vec<u8>>) -> Self {
        Self { path: path.into(), contents: contents.into() }
    }
}

/// Checks that a file could be written: `path` names no folder, and the nearest folder above it that exists takes a
/// file.
///
/// # Errors
/// [`OutputError`]; nothing is left behind.
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    if path.file_name().is_none() {
        return Err(OutputError::NoName(path.to_owned()));
    }
    if path.is_dir() {
        return Err(io_error("replace", path, io::ErrorKind::IsADirectory.into()));
    }
    let above = path.ancestors().skip(1).find(|folder| folder.symlink_metadata().is_ok());
    let folder = above.filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let probe = folder.join(format!(".writable-{}", std::process::id()));
    let tried = File::create(&probe).and_then(|_| fs::remove_file(&probe));
    tried.map_err(|source| io_error("write", path, source))
}

/// Writes one file, replacing an existing one at once. Missing parent directories are made.
///
/// # Errors
/// [`OutputError`]; the target is then as it was.
pub fn write_file(path: &Path, contents: &[u8]) -> Result<(), OutputError> {
    let name = path.file_name().ok_or_else(|| OutputError::NoName(path.to_owned()))?;
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    make_directory(parent)?;
    let mut partial_name = name.to_owned();
    partial_name.push(format!(".partial-{}", std::process::id()));
    let partial = parent.join(partial_name);
    let written = write_synced(&partial, contents)
        .and_then(|()| fs::rename(&partial, path).map_err(|source| io_error("replace", path, source)));
    if written.is_err() {
        // The error that is reported is the first one; a partial file that cannot be removed either is named by it.
        let _ = fs::remove_file(&partial);
    }
    written
}

/// Writes `files` into `directory`: a new directory appears whole, in an existing one only these files are replaced.
///
/// # Errors
/// [`OutputError`]; the directory is then as it was.
pub fn write_directory(directory: &Path, files: &[OutputFile]) -> Result<(), OutputError> {
    write_directory_with(directory, files, |from, to| fs::rename(from, to))
}

/// Implementation of [`write_directory`] with the renaming passed in, because that is the step whose failure must be
/// undone.
fn write_directory_with(
    directory: &Path,
    files: &[OutputFile],
    mut rename: impl FnMut(&Path, &Path) -> io::Result<()>,
) -> Result<(), OutputError> {
    for file in files {
        let plain = file.path.components().all(|part| matches!(part, Component::Normal(_)));
        if !plain || file.path.file_name().is_none() {
            return Err(OutputError::Outside(file.path.clone()));
        }
    }
    let exists = directory.is_dir();
    // Inside an existing directory, because a rename cannot leave the file system of a mount point.
    let staging = Staging::new(directory, exists)?;
    for file in files {
        let staged = staging.new_files.join(&file.path);
        make_directory(staged.parent().unwrap_or(&staging.new_files))?;
        write_synced(&staged, &file.contents)?;
    }
    if !exists {
        return rename(&staging.new_files, directory).map_err(|source| io_error("create", directory, source));
    }
    let mut done: Vec<Undo> = Vec::new();
    let result = files.iter().try_for_each(|file| replace(directory, &staging, &file.path, &mut done, &mut rename));
    if result.is_err() {
        for step in done.iter().rev() {
            // Undoing is best effort: the error that is reported is the one that made it necessary.
            let _ = match step {
                Undo::Rename { from, to } => rename(from, to),
                Undo::RemoveDirectory(path) => fs::remove_dir(path),
            };
        }
    }
    result
}

/// Reversal of one step.
enum Undo {
    Rename { from: PathBuf, to: PathBuf },
    RemoveDirectory(PathBuf),
}

/// Moves the old file aside and the staged one into its place, recording how to take each step back.
fn replace(
    directory: &Path,
    staging: &Staging,
    path: &Path,
    done: &mut Vec<Undo>,
    rename: &mut impl FnMut(&Path, &Path) -> io::Result<()>,
) -> Result<(), OutputError> {
    let (target, staged, aside) = (directory.join(path), staging.new_files.join(path), staging.old_files.join(path));
    let parents: Vec<&Path> = path.ancestors().skip(1).filter(|parent| !parent.as_os_str().is_empty()).collect();
    for parent in parents.into_iter().rev() {
        let made = directory.join(parent);
        if !made.is_dir() {
            fs::create_dir(&made).map_err(|source| io_error("create", &made, source))?;
            done.push(Undo::RemoveDirectory(made));
        }
    }
    if target.is_dir() {
        let source = io::Error::from(io::ErrorKind::IsADirectory);
        return Err(io_error("replace", &target, source));
    }
    if target.symlink_metadata().is_ok() {
        make_directory(aside.parent().unwrap_or(&staging.old_files))?;
        rename(&target, &aside).map_err(|source| io_error("move aside", &target, source))?;
        done.push(Undo::Rename { from: aside, to: target.clone() });
    }
    rename(&staged, &target).map_err(|source| io_error("replace", &target, source))?;
    done.push(Undo::Rename { from: target, to: staged });
    Ok(())
}

/// The hidden place where new files wait and old ones are kept until all is done; gone when this is dropped.
struct Staging {
    root: PathBuf,
    new_files: PathBuf,
    old_files: PathBuf,
}

impl Staging {
    fn new(directory: &Path, exists: bool) -> Result<Self, OutputError> {
        let suffix = format!(".partial-{}", std::process::id());
        let root = if exists {
            directory.join(suffix)
        } else {
            let name = directory.file_name().ok_or_else(|| OutputError::NoName(directory.to_owned()))?;
            let mut beside = name.to_owned();
            beside.push(suffix);
            directory.with_file_name(beside)
        };
        let staging = Self { new_files: root.join("new"), old_files: root.join("old"), root };
        make_directory(&staging.new_files)?;
        Ok(staging)
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // Files left here are of no use to anyone, and the output is already decided.
        let _ = fs::remove_dir_all(&self.root);
    }
}

fn make_directory(path: &Path) -> Result<(), OutputError> {
    fs::create_dir_all(path).map_err(|source| io_error("create", path, source))
}

fn write_synced(path: &Path, contents: &[u8]) -> Result<(), OutputError> {
    let write = || -> io::Result<()> {
        let mut file = File::create(path)?;
        file.write_all(contents)?;
        file.sync_all()
    };
    write().map_err(|source| io_error("write", path, source))
}

fn io_error(action: &'static str, path: &Path, source: io::Error) -> OutputError {
    OutputError::Io { action, path: path.to_owned(), source }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Every path below `root` with its contents (None for a directory).
    fn snapshot(root: &Path) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
        let mut found = BTreeMap::new();
        let mut waiting = vec![root.to_owned()];
        while let Some(directory) = waiting.pop() {
            for entry in fs::read_dir(directory).unwrap() {
                let path = entry.unwrap().path();
                let contents = if path.is_dir() { None } else { Some(fs::read(&path).unwrap()) };
                if contents.is_none() {
                    waiting.push(path.clone());
                }
                found.insert(path, contents);
            }
        }
        found
    }

    fn new_files() -> Vec<OutputFile> {
        vec![
            OutputFile::new("report.html", "new page"),
            OutputFile::new("figures/a.svg", "new a"),
            OutputFile::new("report.json", "new numbers"),
        ]
    }

    #[test]
    fn a_path_that_cannot_be_written_is_told_before_and_nothing_is_left_behind() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("file"), "old").unwrap();
        for good in ["file", "new", "new/folder/file"] {
            check_writable(&place.path().join(good)).unwrap();
        }
        for (bad, told) in [("file/below", "Not a directory"), (".", "directory"), ("..", "does not name a file")] {
            let error = check_writable(&place.path().join(bad)).unwrap_err().to_string();
            assert!(error.contains(told), "{bad}: {error}");
        }
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_new_directory_appears_with_all_files_and_nothing_else() {
        let place = tempfile::tempdir().unwrap();
        let out = place.path().join("out");
        write_directory(&out, &new_files()).unwrap();
        assert_eq!(fs::read(out.join("figures/a.svg")).unwrap(), b"new a");
        assert_eq!(snapshot(place.path()).len(), 5);
    }

    #[test]
    fn only_the_files_that_are_written_are_replaced() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("report.html"), "old page").unwrap();
        fs::write(place.path().join("notes.txt"), "the user's").unwrap();
        write_directory(place.path(), &new_files()).unwrap();
        assert_eq!(fs::read(place.path().join("report.html")).unwrap(), b"new page");
        assert_eq!(fs::read(place.path().join("notes.txt")).unwrap(), b"the user's");
        assert_eq!(snapshot(place.path()).len(), 5);
    }

    #[test]
    fn whichever_rename_fails_the_existing_output_is_left_as_it_was() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("report.html"), "old page").unwrap();
        fs::write(place.path().join("report.json"), "old numbers").unwrap();
        let before = snapshot(place.path());
        let mut renames = 0;
        // Two files are moved aside and three moved in: the sixth rename does not happen, so the sixth run succeeds.
        for failing in 1..=5 {
            renames = 0;
            let result = write_directory_with(place.path(), &new_files(), |from, to| {
                renames += 1;
                if renames == failing { Err(io::Error::other("injected")) } else { fs::rename(from, to) }
            });
            assert!(matches!(result, Err(OutputError::Io { .. })), "rename {failing} of {renames}");
            assert_eq!(snapshot(place.path()), before, "after rename {failing} failed");
        }
        assert!(renames >= 5);
        write_directory(place.path(), &new_files()).unwrap();
    }

    #[test]
    fn a_failed_new_directory_leaves_nothing_behind() {
        let place = tempfile::tempdir().unwrap();
        let out = place.path().join("out");
        let result = write_directory_with(&out, &new_files(), |_, _| Err(io::Error::other("injected")));
        assert!(result.is_err() && snapshot(place.path()).is_empty());
    }

    #[test]
    fn a_directory_where_a_file_should_go_is_an_error_that_changes_nothing() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("report.html"), "old page").unwrap();
        fs::create_dir(place.path().join("report.json")).unwrap();
        let before = snapshot(place.path());
        assert!(write_directory(place.path(), &new_files()).is_err());
        assert_eq!(snapshot(place.path()), before);
    }

    #[test]
    fn paths_that_leave_the_directory_are_refused() {
        let place = tempfile::tempdir().unwrap();
        for path in ["../escape", "/escape", ""] {
            let refused = write_directory(place.path(), &[OutputFile::new(path, "x")]);
            assert!(matches!(refused, Err(OutputError::Outside(_))), "{path:?}");
        }
    }

    #[test]
    fn a_single_file_is_replaced_or_kept() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("deep/image.bin");
        write_file(&path, b"old").unwrap();
        write_file(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        let directory = place.path().join("deep");
        assert!(write_file(&directory, b"x").is_err());
        assert_eq!(snapshot(place.path()).len(), 2);
    }
}
