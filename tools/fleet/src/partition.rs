//! Partitions of a fleet's folder: `joint=NAME/day=YYYY-MM-DD/*.parquet`; host.
//!
//! Names that begin with `_` or `.` are not data, as in other programs that read such folders.

use rayon::prelude::*;
use std::collections::BTreeSet;
use std::fs::{DirEntry, File, FileType};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// The files of one joint on one day.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Partition {
    /// Name of the joint.
    pub joint: String,
    /// The day, YYYY-MM-DD.
    pub day: String,
    /// Its files, by name.
    pub files: Vec<PathBuf>,
}

/// A folder or file whose place or name is not that of a partition.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Misplaced {
    /// Path of it.
    pub path: PathBuf,
    /// Defect of it.
    pub reason: String,
}

/// A folder that cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be read: {source}", path.display())]
pub struct FolderError {
    /// The folder.
    pub path: PathBuf,
    /// The system's answer.
    pub source: io::Error,
}

/// All partitions below a folder, by joint and day, and what is none; of `joints` alone where there are any, whose
/// folders must exist ([`is_joint`]).
///
/// # Errors
/// [`FolderError`], of the folder itself; what cannot be read below is misplaced.
pub fn partitions(folder: &Path, joints: &[String]) -> Result<(Vec<Partition>, Vec<Misplaced>), FolderError> {
    let folders = match joints {
        [] => entries(folder)?,
        // A joint that is named twice is one joint.
        named => named.iter().collect::<BTreeSet<_>>().into_iter().map(|name| joint_folder(folder, name)).collect(),
    };
    let parts: Vec<_> = folders.par_iter().map(of_joint).collect();
    let (found, misplaced): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    let (mut found, mut misplaced) = (found.concat(), misplaced.concat());
    found.sort();
    misplaced.sort_by(|one, other| one.path.cmp(&other.path));
    Ok((found, misplaced))
}

/// Partitions of one joint's folder, and what is none.
fn of_joint(folder: &Found) -> (Vec<Partition>, Vec<Misplaced>) {
    let (mut found, mut misplaced) = (Vec::new(), Vec::new());
    let wrong = |path: PathBuf, reason: &str| Misplaced { path, reason: reason.into() };
    let Some(joint) = folder.value("joint=") else {
        return (found, vec![wrong(folder.path.clone(), "expected a folder joint=NAME")]);
    };
    for day_folder in entries(&folder.path).unwrap_or_default() {
        let Some(day) = day_folder.value("day=").filter(|day| is_day(day)) else {
            misplaced.push(wrong(day_folder.path, "expected a folder day=YYYY-MM-DD"));
            continue;
        };
        let (files, other): (Vec<Found>, Vec<Found>) = entries(&day_folder.path)
            .unwrap_or_default()
            .into_iter()
            .partition(|file| file.kind == Kind::File && file.path.extension().is_some_and(|end| end == "parquet"));
        misplaced.extend(other.into_iter().map(|other| wrong(other.path, "expected a file *.parquet")));
        if files.is_empty() {
            misplaced.push(wrong(day_folder.path, "no file *.parquet"));
        } else {
            let files = files.into_iter().map(|file| file.path).collect();
            found.push(Partition { joint: joint.clone(), day, files });
        }
    }
    (found, misplaced)
}

/// True where a fleet has a folder of this joint.
pub fn is_joint(folder: &Path, name: &str) -> bool {
    joint_folder(folder, name).value("joint=").is_some_and(|value| value == name)
}

fn joint_folder(folder: &Path, name: &str) -> Found {
    let path = folder.join(format!("joint={name}"));
    Found { kind: Kind::of(&path), path }
}

/// A path below a fleet's folder.
#[derive(Clone, Debug)]
struct Found {
    path: PathBuf,
    kind: Kind,
}

/// Kind of a path; of a link that of its target.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Folder,
    File,
    Other,
}

impl Kind {
    fn of(path: &Path) -> Self {
        path.metadata().map_or(Self::Other, |data| data.file_type().into())
    }
}

impl From<FileType> for Kind {
    fn from(found: FileType) -> Self {
        match found {
            found if found.is_dir() => Self::Folder,
            found if found.is_file() => Self::File,
            _ => Self::Other,
        }
    }
}

impl Found {
    /// Kind as the folder's listing tells it: asking for each path by itself takes longer than reading its name.
    fn of(entry: &DirEntry) -> Self {
        let path = entry.path();
        let kind = match entry.file_type() {
            Ok(found) if !found.is_symlink() => found.into(),
            _ => Kind::of(&path),
        };
        Self { path, kind }
    }

    /// The value of a folder whose name is `key` and a value that is one plain name.
    fn value(&self, key: &str) -> Option<String> {
        let value = self.path.file_name()?.to_str()?.strip_prefix(key)?;
        (self.kind == Kind::Folder && !value.is_empty()).then(|| value.to_owned())
    }
}

/// Paths in a folder that are data, by name.
fn entries(folder: &Path) -> Result<Vec<Found>, FolderError> {
    let unreadable = |source| FolderError { path: folder.to_owned(), source };
    let entries = std::fs::read_dir(folder).and_then(Iterator::collect::<io::Result<Vec<_>>>).map_err(unreadable)?;
    let data = |path: &PathBuf| {
        !path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.starts_with(['_', '.']))
    };
    let mut found: Vec<Found> = entries.iter().map(Found::of).filter(|found| data(&found.path)).collect();
    found.sort_by(|one, other| one.path.cmp(&other.path));
    Ok(found)
}

/// True for YYYY-MM-DD with a month and a day that exist in some year.
pub fn is_day(text: &str) -> bool {
    let digits = |part: &str, length: usize| part.len() == length && part.bytes().all(|byte| byte.is_ascii_digit());
    let parts: Vec<&str> = text.split('-').collect();
    let [year, month, day] = parts[..] else { return false };
    let within = |part: &str, most: u32| digits(part, 2) && (1..=most).contains(&part.parse().unwrap_or(0));
    digits(year, 4) && within(month, 12) && within(day, 31)
}

/// A file of a partition.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// Size and BLAKE3 of it, as text.
    pub fingerprint: String,
    /// Bytes of it; none of one that is longer than was to be kept.
    pub bytes: Option<Vec<u8>>,
}

/// Reads a file, and keeps its bytes where they are at most `most`.
///
/// # Errors
/// Those of the system.
pub fn load(path: &Path, most: u64) -> io::Result<Loaded> {
    let told = |size: u64, hash: blake3::Hash| format!("{size}:{hash}");
    let mut file = File::open(path)?;
    let size = file.metadata()?.len();
    if size > most {
        let mut digest = blake3::Hasher::new();
        digest.update_reader(&mut file)?;
        return Ok(Loaded { fingerprint: told(digest.count(), digest.finalize()), bytes: None });
    }
    let mut bytes = Vec::with_capacity(size.try_into().unwrap_or(0));
    file.read_to_end(&mut bytes)?;
    Ok(Loaded { fingerprint: told(bytes.len() as u64, blake3::hash(&bytes)), bytes: Some(bytes) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn partitions_come_by_joint_and_day_and_what_is_none_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str| {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "x").unwrap();
        };
        for name in [
            "joint=b/day=2026-01-02/1.parquet",
            "joint=a/day=2026-01-10/2.parquet",
            "joint=a/day=2026-01-10/1.parquet",
            "joint=a/day=2026-01-09/1.parquet",
            "joint=a/day=2026-13-01/1.parquet",
            "joint=a/day=2026-01-11/notes.txt",
            "joint=a/_tmp/1.parquet",
            "_sums/joint=a.parquet",
            "robot=c/day=2026-01-01/1.parquet",
        ] {
            write(name);
        }
        let (found, misplaced) = partitions(folder.path(), &[]).unwrap();
        let names: Vec<(&str, &str, usize)> =
            found.iter().map(|p| (p.joint.as_str(), p.day.as_str(), p.files.len())).collect();
        assert_eq!(names, [("a", "2026-01-09", 1), ("a", "2026-01-10", 2), ("b", "2026-01-02", 1)]);
        assert!(found[1].files[0].ends_with("1.parquet"));
        let told: Vec<&str> = misplaced.iter().map(|m| m.reason.as_str()).collect();
        assert_eq!(
            told,
            [
                "no file *.parquet",
                "expected a file *.parquet",
                "expected a folder day=YYYY-MM-DD",
                "expected a folder joint=NAME"
            ]
        );
        let nowhere = partitions(&folder.path().join("nowhere"), &[]);
        assert!(nowhere.unwrap_err().to_string().contains("nowhere: cannot be"));

        let (of_b, misplaced) = partitions(folder.path(), &["b".into(), "b".into()]).unwrap();
        assert_eq!((of_b.as_slice(), misplaced.len()), (&found[2..], 0));
        for (name, there) in [("a", true), ("b", true), ("c", false), ("", false), ("a/day=2026-01-09", false)] {
            assert_eq!(is_joint(folder.path(), name), there, "{name:?}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_what_it_leads_to() {
        use std::os::unix::fs::symlink;
        let [fleet, elsewhere] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let day = elsewhere.path().join("day=2026-01-01");
        fs::create_dir(&day).unwrap();
        fs::write(elsewhere.path().join("log"), "x").unwrap();
        symlink(elsewhere.path().join("log"), day.join("1.parquet")).unwrap();
        symlink(elsewhere.path().join("nowhere"), day.join("2.parquet")).unwrap();
        symlink(elsewhere.path(), fleet.path().join("joint=a")).unwrap();
        let (found, misplaced) = partitions(fleet.path(), &[]).unwrap();
        assert_eq!((found.len(), &found[0].joint, found[0].files.len()), (1, &"a".to_owned(), 1));
        assert_eq!(misplaced.len(), 2, "{misplaced:?}");
        assert!(is_joint(fleet.path(), "a"));
    }

    #[test]
    fn a_file_is_known_by_size_and_digest_whether_its_bytes_are_kept_or_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("1.parquet");
        fs::write(&path, "abc").unwrap();
        let [kept, passed] = [3, 2].map(|most| load(&path, most).unwrap());
        assert_eq!((kept.bytes.as_deref(), &passed.bytes), (Some(&b"abc"[..]), &None));
        // BLAKE3 of "abc", of the algorithm's test vectors as its command-line program prints it.
        let digest = "6437b3ac38465133ffb63b75273a8db548c558465d79db03fd359c6cd5bd9d85";
        assert_eq!(kept.fingerprint, format!("3:{digest}"));
        assert_eq!(passed.fingerprint, kept.fingerprint);
        fs::write(&path, "abd").unwrap();
        assert_ne!(load(&path, 3).unwrap().fingerprint, kept.fingerprint);
        assert!(load(&folder.path().join("2.parquet"), 3).is_err());
    }

    #[test]
    fn a_day_is_year_month_and_day() {
        for day in ["2026-01-01", "2026-12-31"] {
            assert!(is_day(day), "{day}");
        }
        for day in ["2026-00-01", "2026-13-01", "2026-01-00", "2026-01-32", "2026-1-01", "26-01-01", "2026-01", "x"] {
            assert!(!is_day(day), "{day}");
        }
    }
}
