//! Sums of a joint's days as a small Parquet table, a row each, with what they are of; host.
//!
//! Opening and writing a table takes longer than what a day adds to it: one table a joint, and not one a day.
//! Columns: the numbers of [`Sums::names`]; `joint`, `day`; `source`, name, size and BLAKE3 of each file; `defect`,
//! why the partition is not used, or nothing.

use crate::sums::Sums;
use logs::{LogError, Table, Texts, Wanted};
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Folder of the sums in a fleet's folder; its name is no partition's.
pub const FOLDER: &str = "_sums";
/// Columns of text.
const TEXTS: [&str; 4] = ["joint", "day", "source", "defect"];

/// Sums of one partition, or why there are none.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Name of the joint.
    pub joint: String,
    /// The day.
    pub day: String,
    /// Files with size and BLAKE3.
    pub source: String,
    /// Reason for which the partition is not used; empty where it is.
    pub defect: String,
    /// The sums; zeros with a defect.
    pub sums: Sums,
}

/// File of the sums of a joint's days.
pub fn place(fleet: &Path, joint: &str) -> PathBuf {
    fleet.join(FOLDER).join(format!("joint={joint}.parquet"))
}

/// Entries as a table, a row each.
pub fn table(entries: &[Entry]) -> Table {
    let numbers: Vec<Vec<f64>> = entries.iter().map(|entry| entry.sums.numbers().collect()).collect();
    let column = |at: usize| numbers.iter().map(|row| row[at]).collect();
    let names = Sums::names().into_iter().enumerate();
    let mut table = Table::of_numbers(names.map(|(at, name)| (name, column(at))).collect::<Vec<_>>());
    let texts = |of: fn(&Entry) -> &str| entries.iter().map(of).collect::<Texts>();
    let columns = [
        texts(|entry| &entry.joint),
        texts(|entry| &entry.day),
        texts(|entry| &entry.source),
        texts(|entry| &entry.defect),
    ];
    table.texts = TEXTS.iter().map(|name| (*name).to_owned()).zip(columns).collect();
    table
}

/// Entries of a table that [`table`] made.
///
/// # Errors
/// [`LogError`]: no such table.
pub fn read(path: &Path) -> Result<Vec<Entry>, LogError> {
    let names = Sums::names();
    let mut wanted = Wanted::numbers(names.iter().map(String::as_str));
    wanted.texts = TEXTS.iter().map(|name| (*name).to_owned()).collect();
    let table = logs::read(path, &wanted)?;
    let text = |name: &str, row: usize| {
        let texts = table.text(name);
        texts.map_or_else(String::new, |texts| texts.words[texts.codes[row] as usize].clone())
    };
    let entry = |row: usize| {
        let mut sums = Sums::default();
        let numbers = names.iter().map(|name| table.number(name).map_or(f64::NAN, |column| column[row]));
        sums.numbers_mut().zip(numbers).for_each(|(sum, number)| *sum = number);
        let [joint, day, source, defect] = TEXTS.map(|name| text(name, row));
        Entry { joint, day, source, defect, sums }
    };
    Ok((0..table.rows()).map(entry).collect())
}

/// Writes entries, whole or not at all: beside the target, then renamed over it.
///
/// # Errors
/// Those of the system.
pub fn write(path: &Path, entries: &[Entry]) -> io::Result<()> {
    let bytes = logs::encode(&table(entries), logs::Format::Parquet, "", 0).map_err(io::Error::other)?;
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let partial = path.with_extension(format!("partial-{}", std::process::id()));
    fs::write(&partial, bytes)?;
    fs::rename(&partial, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_come_back_bit_by_bit() {
        let folder = tempfile::tempdir().unwrap();
        let entry = |at: usize| {
            let mut sums = Sums::default();
            sums.numbers_mut().enumerate().for_each(|(i, number)| *number = (at * 31 + i) as f64 / 7.0);
            let text = |name: &str| format!("{name}{at}");
            Entry { joint: text("j"), day: text("d"), source: text("s"), defect: String::new(), sums }
        };
        let entries = [entry(1), Entry { defect: "truncated".into(), sums: Sums::default(), ..entry(2) }];
        let path = folder.path().join("deep/all.parquet");
        write(&path, &entries).unwrap();
        assert_eq!(read(&path).unwrap(), entries);
        assert_eq!(fs::read_dir(folder.path().join("deep")).unwrap().count(), 1);
    }
}
