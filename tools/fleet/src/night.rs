//! One night's work on a folder: sums of every partition that is new or has changed, and all of them as one table;
//! host.
//!
//! A partition is the unit of work: one thread reads its files in the order of their names. Sums are joined by joint
//! and day. The bytes of all tables therefore depend on the data alone, not on the number of threads, nor on how often
//! the work was interrupted.

use crate::estimate::estimate;
use crate::partition::{FolderError, Misplaced, Partition, fingerprint, partitions};
use crate::stored::{self, Entry, FOLDER};
use crate::sums::Sums;
use crate::windows;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

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
pub fn night(fleet: &Path, threads: usize, more: &(dyn Fn() -> bool + Sync)) -> Result<Night, NightError> {
    let (found, misplaced) = partitions(fleet)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| NightError::Threads { threads, reason: error.to_string() })?;
    let one = |partition: &Partition| more().then(|| entry(fleet, partition)).transpose();
    let done: Vec<Option<(Entry, bool)>> = pool.install(|| found.par_iter().map(one).collect::<Result<_, _>>())?;
    let whole = done.iter().all(Option::is_some);
    let (mut entries, fresh): (Vec<Entry>, Vec<bool>) = done.into_iter().flatten().unzip();
    tell_copies(&mut entries);
    if whole && !entries.is_empty() {
        let path = fleet.join(FOLDER).join("all.parquet");
        stored::write(&path, &entries).map_err(|source| NightError::Write { path, source })?;
    }
    let read = fresh.iter().filter(|fresh| **fresh).count();
    Ok(Night { kept: fresh.len() - read, read, entries, misplaced })
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
