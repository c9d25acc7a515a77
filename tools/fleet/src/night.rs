//! One night's work on a folder: sums of every partition that is new or has changed, and all of them as one table;
//! host.
//!
//! A partition is the unit of work: one thread reads its files in the order of their names. Sums are joined by joint
//! and day. The bytes of all tables therefore depend on the data alone, not on the number of threads, nor on how often
//! the work was interrupted.

use crate::estimate::estimate;
use crate::partition::{FolderError, Misplaced, Partition, fingerprint, is_joint, partitions};
use crate::stored::{self, Entry, FOLDER};
use crate::sums::Sums;
use crate::windows;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Part of a fleet that is worked on, and the source of its sums.
#[derive(Clone, Debug, Default)]
pub struct Scope {
    /// Names of joints, all where there are none. The table of all is written where there are none.
    pub joints: Vec<String>,
    /// Stored sums are taken as they are: no partition is read.
    pub stored: bool,
}

/// The outcome.
#[derive(Debug)]
pub struct Night {
    /// Sums of all partitions, by joint and day.
    pub entries: Vec<Entry>,
    /// Folders and files that are no partition.
    pub misplaced: Vec<Misplaced>,
    /// Partitions that were read.
    pub read: usize,
    /// Partitions whose sums were there.
    pub kept: usize,
}

/// Reason for the end of a night's work.
#[derive(Debug, thiserror::Error)]
pub enum NightError {
    /// The folder.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A joint that is not there.
    #[error("{}: no folder joint={joint}; --joint takes a name that follows \"joint=\" there", fleet.display())]
    NoJoint {
        /// The fleet's folder.
        fleet: PathBuf,
        /// Name that was asked for.
        joint: String,
    },
    /// Sums that cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// Threads.
    #[error("{threads} threads cannot be started: {reason}")]
    Threads {
        /// Number of threads.
        threads: usize,
        /// The system's answer.
        reason: String,
    },
}

/// Does the work with `threads` threads, 0 for one a core. `more` is asked before each partition; where it says no, the
/// rest is left for another time, and the table of all is not written.
///
/// # Errors
/// [`NightError`]; bad partitions are none, they are entries with a defect.
pub fn night(
    fleet: &Path,
    scope: &Scope,
    threads: usize,
    more: &(dyn Fn() -> bool + Sync),
) -> Result<Night, NightError> {
    if let Some(joint) = scope.joints.iter().find(|joint| !is_joint(fleet, joint)) {
        return Err(NightError::NoJoint { fleet: fleet.to_owned(), joint: joint.clone() });
    }
    let (found, misplaced) = partitions(fleet, &scope.joints)?;
    let mut night = match scope.stored {
        true => as_stored(fleet, &found),
        false => summed(fleet, &found, threads, more)?,
    };
    night.misplaced.extend(misplaced);
    night.misplaced.sort_by(|one, other| one.path.cmp(&other.path));
    tell_copies(&mut night.entries);
    if scope.joints.is_empty() && night.entries.len() == found.len() && !found.is_empty() {
        let path = fleet.join(FOLDER).join("all.parquet");
        stored::write(&path, &night.entries).map_err(|source| NightError::Write { path, source })?;
    }
    Ok(night)
}

/// Stored sums of partitions; a partition without, or with other files since, is misplaced.
fn as_stored(fleet: &Path, found: &[Partition]) -> Night {
    let mut night = Night { entries: Vec::new(), misplaced: Vec::new(), read: 0, kept: 0 };
    for partition in found {
        let reason = match stored::read(&stored::place(fleet, partition)).as_deref() {
            Ok([known]) if of_these_files(partition, known) => {
                night.entries.push(known.clone());
                continue;
            }
            Ok(_) => "files have changed since they were summed up: `jointctl fleet sums` does it anew",
            Err(_) => "not summed up: `jointctl fleet sums` does it",
        };
        let path = fleet.join(format!("joint={}", partition.joint)).join(format!("day={}", partition.day));
        night.misplaced.push(Misplaced { path, reason: reason.into() });
    }
    night.kept = night.entries.len();
    night
}

/// True where an entry is of files with these names and sizes. One without sources is of files that are not
/// readable.
fn of_these_files(partition: &Partition, known: &Entry) -> bool {
    let line = |file: &PathBuf| {
        let size = fs::metadata(file).ok()?.len();
        Some(format!("{}/{size}:", file.file_name()?.to_string_lossy()))
    };
    let known: Vec<&str> = known.source.lines().collect();
    let same = |(file, known): (&PathBuf, &&str)| line(file).is_some_and(|line| known.starts_with(&line));
    known.is_empty() || known.len() == partition.files.len() && partition.files.iter().zip(&known).all(same)
}

/// Sums of partitions, read where they are new or have changed.
fn summed(
    fleet: &Path,
    found: &[Partition],
    threads: usize,
    more: &(dyn Fn() -> bool + Sync),
) -> Result<Night, NightError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| NightError::Threads { threads, reason: error.to_string() })?;
    let one = |partition: &Partition| more().then(|| entry(fleet, partition)).transpose();
    let done: Vec<Option<(Entry, bool)>> = pool.install(|| found.par_iter().map(one).collect::<Result<_, _>>())?;
    let (entries, fresh): (Vec<Entry>, Vec<bool>) = done.into_iter().flatten().unzip();
    let read = fresh.iter().filter(|fresh| **fresh).count();
    Ok(Night { kept: fresh.len() - read, read, entries, misplaced: Vec::new() })
}

/// Sums of a partition, and whether it was read.
fn entry(fleet: &Path, partition: &Partition) -> Result<(Entry, bool), NightError> {
    let place = stored::place(fleet, partition);
    let source = source(partition);
    // Sums that cannot be read are made anew.
    if let Ok([known]) = stored::read(&place).as_deref()
        && source.as_ref().is_ok_and(|source| *source == known.source)
    {
        return Ok((known.clone(), false));
    }
    let recorded = source.clone().and_then(|source| copied(partition, &source)).and_then(|()| {
        let read = |file: &PathBuf| windows::read(file).map_err(|error| error.to_string());
        partition.files.iter().map(read).collect::<Result<Vec<_>, _>>()
    });
    let (sums, defect) = match recorded {
        Ok(recorded) => (Sums::of(&recorded, |sums| estimate(sums).map(|found| found.values)), String::new()),
        Err(reason) => (Sums::default(), below(fleet, &reason)),
    };
    let (joint, day) = (partition.joint.clone(), partition.day.clone());
    let entry = Entry { joint, day, source: source.unwrap_or_default(), defect, sums };
    stored::write(&place, std::slice::from_ref(&entry))
        .map_err(|source| NightError::Write { path: place.clone(), source })?;
    Ok((entry, true))
}

/// Name, size and SHA-256 of each file, a line each; no name has a slash.
fn source(partition: &Partition) -> Result<String, String> {
    let line = |file: &PathBuf| {
        let print = fingerprint(file).map_err(|error| format!("{}: cannot be read: {error}", file.display()))?;
        Ok(format!("{}/{print}", file.file_name().unwrap_or_default().to_string_lossy()))
    };
    Ok(partition.files.iter().map(line).collect::<Result<Vec<_>, String>>()?.join("\n"))
}

/// Refuses a partition with two files of the same bytes.
fn copied(partition: &Partition, source: &str) -> Result<(), String> {
    let mut known = BTreeMap::new();
    for (file, line) in partition.files.iter().zip(source.lines()) {
        let Some((name, print)) = line.split_once('/') else { continue };
        if let Some(first) = known.insert(print, name) {
            return Err(format!("{}: the same bytes as {first}", file.display()));
        }
    }
    Ok(())
}

/// A text in which files are named relative to the fleet's folder: the sums of a folder that was moved are the same.
fn below(fleet: &Path, text: &str) -> String {
    text.replace(&format!("{}/", fleet.display()), "")
}

/// Days of a joint whose files are those of an earlier day: copies of it, which would count twice.
fn tell_copies(entries: &mut [Entry]) {
    let mut known: BTreeMap<(String, String), String> = BTreeMap::new();
    for entry in entries.iter_mut().filter(|entry| entry.defect.is_empty()) {
        let prints: Vec<&str> = entry.source.lines().filter_map(|line| line.split_once('/')).map(|(_, p)| p).collect();
        let copied = prints.iter().find_map(|print| known.get(&(entry.joint.clone(), (*print).to_owned())));
        if let Some(day) = copied {
            entry.defect = format!("joint={}/day={}: the same bytes as day={day}", entry.joint, entry.day);
            entry.sums = Sums::default();
            continue;
        }
        let keys: Vec<_> = prints.iter().map(|print| (entry.joint.clone(), (*print).to_owned())).collect();
        known.extend(keys.into_iter().map(|key| (key, entry.day.clone())));
    }
}
