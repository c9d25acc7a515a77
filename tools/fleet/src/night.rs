//! One night's work on a folder: sums of every partition that is new or has changed, and all of them as one table;
//! host.
//!
//! One thread reads the files of a partition in the order of their names. Sums are joined by joint and day: a table for
//! each joint, written after some partitions, and one of all. The bytes of all tables therefore depend on the data
//! alone, not on the number of threads, nor on how often the work was interrupted.

use crate::estimate::estimate;
use crate::partition::{FolderError, Loaded, Misplaced, Partition, is_joint, load, partitions};
use crate::stored::{self, Entry, FOLDER};
use crate::sums::Sums;
use crate::windows;
use logs::parquet_log::WHOLE;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Partitions of a joint that are summed up between two writings of its table: what a process that is killed loses.
const PIECE: usize = 32;

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

/// Does the work with `threads` threads, 0 for one a core. `more` is asked before each 32
/// partitions of a joint; where it says no, the rest is left for another time, and the table of all is not written.
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
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| NightError::Threads { threads, reason: error.to_string() })?;
    let (found, misplaced) = pool.install(|| partitions(fleet, &scope.joints))?;
    let mut night = match scope.stored {
        true => as_stored(fleet, &found),
        false => pool.install(|| summed(fleet, &found, more))?,
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
    for days in of_joints(found) {
        let mut known = known(&stored::place(fleet, &days[0].joint));
        for partition in days {
            let reason = match known.remove(&partition.day) {
                Some(known) if of_these_files(partition, &known) => {
                    night.entries.push(known);
                    continue;
                }
                Some(_) => "files have changed since they were summed up: `jointctl fleet sums` does it anew",
                None => "not summed up: `jointctl fleet sums` does it",
            };
            let path = fleet.join(format!("joint={}", partition.joint)).join(format!("day={}", partition.day));
            night.misplaced.push(Misplaced { path, reason: reason.into() });
        }
    }
    night.kept = night.entries.len();
    night
}

/// Partitions of each joint.
fn of_joints(found: &[Partition]) -> Vec<&[Partition]> {
    found.chunk_by(|one, other| one.joint == other.joint).collect()
}

/// Entries of a joint's table by day; none where it is not there, or cannot be read: it is made anew.
fn known(place: &Path) -> BTreeMap<String, Entry> {
    let entries = stored::read(place).unwrap_or_default();
    entries.into_iter().map(|entry| (entry.day.clone(), entry)).collect()
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
fn summed(fleet: &Path, found: &[Partition], more: &(dyn Fn() -> bool + Sync)) -> Result<Night, NightError> {
    let one = |days: &&[Partition]| of_joint(fleet, days, more);
    let joints = of_joints(found);
    let done: Vec<Vec<(Entry, bool)>> = joints.par_iter().map(one).collect::<Result<_, _>>()?;
    let (entries, fresh): (Vec<Entry>, Vec<bool>) = done.into_iter().flatten().unzip();
    let read = fresh.iter().filter(|fresh| **fresh).count();
    Ok(Night { kept: fresh.len() - read, read, entries, misplaced: Vec::new() })
}

/// Sums of a joint's days, as far as `more` says yes, and whether each was read.
fn of_joint(
    fleet: &Path,
    days: &[Partition],
    more: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<(Entry, bool)>, NightError> {
    let place = stored::place(fleet, &days[0].joint);
    let mut known = known(&place);
    let mut done: Vec<(Entry, bool)> = Vec::with_capacity(days.len());
    for piece in days.chunks(PIECE) {
        if !more() {
            return Ok(done);
        }
        let summed = piece.par_iter().map(|day| entry(fleet, day, known.get(&day.day)));
        done.extend(summed.collect::<Vec<_>>());
        for day in piece {
            known.remove(&day.day);
        }
        let last = done.len() == days.len();
        // What is known of later days stays until they are reached; days that are no more go with the last piece.
        if done[done.len() - piece.len()..].iter().any(|(_, fresh)| *fresh) || last && !known.is_empty() {
            let later = known.values().filter(|_| !last);
            let all: Vec<Entry> = done.iter().map(|(entry, _)| entry).chain(later).cloned().collect();
            stored::write(&place, &all).map_err(|source| NightError::Write { path: place.clone(), source })?;
        }
    }
    Ok(done)
}

/// Sums of a partition, and whether it was read.
fn entry(fleet: &Path, partition: &Partition, known: Option<&Entry>) -> (Entry, bool) {
    let loaded = loaded(partition);
    let source = loaded.as_ref().map(|files| source(partition, files)).map_err(Clone::clone);
    if let Some(known) = known.filter(|known| source.as_ref().is_ok_and(|source| *source == known.source)) {
        return (known.clone(), false);
    }
    let recorded = loaded.and_then(|files| {
        copied(partition, source.as_deref().unwrap_or_default())?;
        let read = |(file, loaded): (&PathBuf, Loaded)| windows::read(file, loaded.bytes).map_err(|e| e.to_string());
        partition.files.iter().zip(files).map(read).collect::<Result<Vec<_>, _>>()
    });
    let (sums, defect) = match recorded {
        Ok(recorded) => (Sums::of(&recorded, |sums| estimate(sums).map(|found| found.values)), String::new()),
        Err(reason) => (Sums::default(), below(fleet, &reason)),
    };
    let (joint, day) = (partition.joint.clone(), partition.day.clone());
    (Entry { joint, day, source: source.unwrap_or_default(), defect, sums }, true)
}

/// The files of a partition, with the bytes of those that are short and the first.
fn loaded(partition: &Partition) -> Result<Vec<Loaded>, String> {
    let mut left = WHOLE;
    let load = |file: &PathBuf| {
        let loaded = load(file, left).map_err(|error| format!("{}: cannot be read: {error}", file.display()))?;
        left -= loaded.bytes.as_ref().map_or(0, |bytes| bytes.len() as u64);
        Ok(loaded)
    };
    partition.files.iter().map(load).collect()
}

/// Name, size and digest of each file, a line each; no name has a slash.
fn source(partition: &Partition, files: &[Loaded]) -> String {
    let line = |(file, loaded): (&PathBuf, &Loaded)| {
        format!("{}/{}", file.file_name().unwrap_or_default().to_string_lossy(), loaded.fingerprint)
    };
    partition.files.iter().zip(files).map(line).collect::<Vec<_>>().join("\n")
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
