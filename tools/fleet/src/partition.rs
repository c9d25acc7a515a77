//! Partitions of a fleet's folder: `joint=NAME/day=YYYY-MM-DD/*.parquet`; host.
//!
//! Names that begin with `_` or `.` are not data, as in other programs that read such folders.

use std::collections::BTreeSet;
use std::fs::File;
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
    let (mut found, mut misplaced) = (Vec::new(), Vec::new());
    let wrong = |path: PathBuf, reason: &str| Misplaced { path, reason: reason.into() };
    let joint_folders = match joints {
        [] => entries(folder)?,
        // A joint that is named twice is one joint.
        named => named.iter().collect::<BTreeSet<_>>().into_iter().map(|name| joint_folder(folder, name)).collect(),
    };
    for joint_folder in joint_folders {
        let Some(joint) = value(&joint_folder, "joint=") else {
            misplaced.push(wrong(joint_folder, "expected a folder joint=NAME"));
            continue;
        };
        for day_folder in entries(&joint_folder).unwrap_or_default() {
            let Some(day) = value(&day_folder, "day=").filter(|day| is_day(day)) else {
                misplaced.push(wrong(day_folder, "expected a folder day=YYYY-MM-DD"));
                continue;
            };
            let (files, other): (Vec<PathBuf>, Vec<PathBuf>) = entries(&day_folder)
                .unwrap_or_default()
                .into_iter()
                .partition(|file| file.is_file() && file.extension().is_some_and(|ending| ending == "parquet"));
            misplaced.extend(other.into_iter().map(|path| wrong(path, "expected a file *.parquet")));
            if files.is_empty() {
                misplaced.push(wrong(day_folder, "no file *.parquet"));
            } else {
                found.push(Partition { joint: joint.clone(), day, files });
            }
        }
    }
    found.sort();
    misplaced.sort_by(|one, other| one.path.cmp(&other.path));
    Ok((found, misplaced))
}

/// True where a fleet has a folder of this joint.
pub fn is_joint(folder: &Path, name: &str) -> bool {
    value(&joint_folder(folder, name), "joint=").is_some_and(|value| value == name)
}

fn joint_folder(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("joint={name}"))
}

/// Paths in a folder that are data, by name.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, FolderError> {
    let unreadable = |source| FolderError { path: folder.to_owned(), source };
    let entries = std::fs::read_dir(folder).and_then(Iterator::collect::<io::Result<Vec<_>>>).map_err(unreadable)?;
    let data = |path: &PathBuf| {
        !path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.starts_with(['_', '.']))
    };
    let mut paths: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).filter(data).collect();
    paths.sort();
    Ok(paths)
}

/// The value of a folder whose name is `key` and a value that is one plain name.
fn value(path: &Path, key: &str) -> Option<String> {
    let value = path.file_name()?.to_str()?.strip_prefix(key)?;
    (path.is_dir() && !value.is_empty()).then(|| value.to_owned())
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
