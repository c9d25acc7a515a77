//! Registry of images: which was made for which joint from which days with which key, and which joint runs
//! which, since when; host.
//!
//! Append-only: a file for each batch, `_registry/TIME-DIGEST.parquet`, written beside its place and renamed. No
//! file is ever changed, so that writers at the same time lose nothing. What is written twice counts once: an
//! image that was made for a joint by its first record, an image that a joint runs by the first of the records
//! that follow each other.
//!
//! Columns: `time_ms`, ms since 1970-01-01 UTC; `event`, made or runs; `joint`; `product`, `serial`, of a joint
//! that runs an image, else absent; `version`; `image`, SHA-256; `days`, `data`: first and last day, and SHA-256
//! of the digests of all files that were learned from; `key`: number of the key that signed it.

use crate::partition::Misplaced;
use logs::{LogError, Table, Texts, Wanted};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::{fs, io};

/// Folder of the registry in a fleet's folder; its name is no partition's.
pub const FOLDER: &str = "_registry";
const NUMBERS: [&str; 4] = ["time_ms", "product", "serial", "version"];
const TEXTS: [&str; 6] = ["event", "joint", "image", "days", "data", "key"];

/// Event of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Event {
    /// An image was made.
    Made,
    /// A joint said that it runs an image.
    Runs,
}

/// Identity of a joint on a bus: product code and serial number (1018h:2, 4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Identity {
    /// Product code.
    pub product: u32,
    /// Serial number.
    pub serial: u32,
}

/// A row.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Record {
    /// Time since 1970-01-01 UTC, ms.
    pub time_ms: u64,
    /// Event.
    pub event: Event,
    /// Name of the joint.
    pub joint: String,
    /// Identity of a joint that runs an image.
    pub identity: Option<Identity>,
    /// Version of the image.
    pub version: u32,
    /// SHA-256 of the image without its tag, 64 hexadecimal digits; empty where a joint runs none.
    pub image: String,
    /// First and last day that were learned from; empty where nobody knows.
    pub days: String,
    /// SHA-256 over the digests of these days' files; empty where nobody knows.
    pub data: String,
    /// Number of the key that signed it, 8 hexadecimal digits; empty without one.
    pub key: String,
}

/// SHA-256 as 64 hexadecimal digits.
#[must_use]
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Adds records as one new file, whole or not at all.
///
/// # Errors
/// Those of the system.
pub fn append(fleet: &Path, records: &[Record]) -> io::Result<PathBuf> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let bytes = logs::encode(&table(records), logs::Format::Parquet, "", 0).map_err(io::Error::other)?;
    let folder = fleet.join(FOLDER);
    fs::create_dir_all(&folder)?;
    let time = records.iter().map(|record| record.time_ms).max().unwrap_or(0);
    // By its content: two files of a name are the same file.
    let path = folder.join(format!("{time:014}-{}.parquet", &sha256(&bytes)[..32]));
    let partial = format!(".partial-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    let partial = folder.join(partial);
    fs::write(&partial, bytes)?;
    fs::File::open(&partial)?.sync_all()?;
    fs::rename(&partial, &path)?;
    Ok(path)
}

/// All records by time, each once, and files that are none.
///
/// # Errors
/// A folder cannot be read; a fleet without a registry has no records.
pub fn read(fleet: &Path) -> io::Result<(Vec<Record>, Vec<Misplaced>)> {
    let folder = fleet.join(FOLDER);
    let found = match fs::read_dir(&folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound && fleet.is_dir() => return Ok((Vec::new(), Vec::new())),
        found => found?.map(|entry| entry.map(|entry| entry.path())).collect::<io::Result<BTreeSet<PathBuf>>>()?,
    };
    let (mut records, mut misplaced) = (Vec::new(), Vec::new());
    let hidden = |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(['.', '_']));
    for path in found.into_iter().filter(|path| !hidden(path)) {
        match file(&path) {
            Ok(rows) => records.extend(rows),
            Err(error) => misplaced.push(Misplaced { path, reason: error.to_string() }),
        }
    }
    records.sort();
    let (mut made, mut last) = (BTreeSet::new(), BTreeMap::new());
    records.retain(|record: &Record| match record.identity {
        None => made.insert((record.joint.clone(), record.image.clone())),
        Some(identity) => {
            let now = (record.joint.clone(), record.image.clone());
            last.insert(identity, now.clone()).as_ref() != Some(&now)
        }
    });
    Ok((records, misplaced))
}

/// Latest record of each joint that runs an image.
#[must_use]
pub fn running(records: &[Record]) -> BTreeMap<Identity, &Record> {
    records.iter().filter_map(|record| Some((record.identity?, record))).collect()
}

/// Record of the making of an image.
#[must_use]
pub fn made<'a>(records: &'a [Record], image: &str) -> Option<&'a Record> {
    records.iter().find(|record| record.event == Event::Made && record.image == image)
}

fn table(records: &[Record]) -> Table {
    let column = |of: fn(&Record) -> f64| records.iter().map(of).collect::<Vec<f64>>();
    let identity =
        |record: &Record, part: fn(Identity) -> u32| record.identity.map_or(f64::NAN, |i| f64::from(part(i)));
    let numbers = [
        column(|record| record.time_ms as f64),
        records.iter().map(|record| identity(record, |identity| identity.product)).collect(),
        records.iter().map(|record| identity(record, |identity| identity.serial)).collect(),
        column(|record| f64::from(record.version)),
    ];
    let mut table = Table::of_numbers(NUMBERS.into_iter().zip(numbers));
    let texts = |of: fn(&Record) -> &str| records.iter().map(of).collect::<Texts>();
    let columns = [
        texts(|record| if record.event == Event::Made { "made" } else { "runs" }),
        texts(|record| &record.joint),
        texts(|record| &record.image),
        texts(|record| &record.days),
        texts(|record| &record.data),
        texts(|record| &record.key),
    ];
    table.texts = TEXTS.iter().map(|name| (*name).to_owned()).zip(columns).collect();
    table
}

fn file(path: &Path) -> Result<Vec<Record>, LogError> {
    let mut wanted = Wanted::numbers(NUMBERS);
    wanted.texts = TEXTS.iter().map(|name| (*name).to_owned()).collect();
    let table = logs::read(path, &wanted)?;
    let number = |name: &str, row: usize| table.number(name).map_or(f64::NAN, |column| column[row]);
    let text = |name: &str, row: usize| {
        table.text(name).map_or_else(String::new, |texts| texts.words[texts.codes[row] as usize].clone())
    };
    let record = |row: usize| {
        let [time, product, serial, version] = NUMBERS.map(|name| number(name, row));
        let [event, joint, image, days, data, key] = TEXTS.map(|name| text(name, row));
        let event = if event == "runs" { Event::Runs } else { Event::Made };
        let identity = (event == Event::Runs).then_some(Identity { product: product as u32, serial: serial as u32 });
        Record { time_ms: time as u64, event, joint, identity, version: version as u32, image, days, data, key }
    };
    Ok((0..table.rows()).map(record).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made_record(time_ms: u64, joint: &str, version: u32) -> Record {
        Record {
            time_ms,
            event: Event::Made,
            joint: joint.into(),
            identity: None,
            version,
            image: sha256(&version.to_le_bytes()),
            days: "2026-01-06 to 2026-01-08".into(),
            data: sha256(b"days"),
            key: "00c0ffee".into(),
        }
    }

    fn runs(time_ms: u64, joint: &str, serial: u32, version: u32) -> Record {
        let identity = Some(Identity { product: u32::MAX, serial });
        Record { event: Event::Runs, identity, ..made_record(time_ms, joint, version) }
    }

    #[test]
    fn records_come_back_by_time_and_each_once() {
        let fleet = tempfile::tempdir().unwrap();
        assert_eq!(read(fleet.path()).unwrap(), (Vec::new(), Vec::new()));
        assert_eq!(read(&fleet.path().join("nowhere")).unwrap_err().kind(), io::ErrorKind::NotFound);
        let batch = [made_record(30, "a", 2), made_record(30, "b", u32::MAX), made_record(u64::from(u32::MAX), "a", 3)];
        append(fleet.path(), &batch).unwrap();
        append(fleet.path(), &batch).unwrap();
        assert_eq!(fs::read_dir(fleet.path().join(FOLDER)).unwrap().count(), 1);
        // Made once more in a night that was ended; run, said again, rolled back.
        append(fleet.path(), &[made_record(40, "a", 2)]).unwrap();
        for (time, version) in [(50, 2), (60, 2), (70, 1), (80, 2)] {
            append(fleet.path(), &[runs(time, "a", u32::MAX, version)]).unwrap();
        }
        fs::write(fleet.path().join("_registry/torn.parquet"), "PAR1").unwrap();
        fs::write(fleet.path().join("_registry/.partial-1-1"), "PAR1").unwrap();
        let (records, misplaced) = read(fleet.path()).unwrap();
        let expected = [
            batch[0].clone(),
            batch[1].clone(),
            runs(50, "a", u32::MAX, 2),
            runs(70, "a", u32::MAX, 1),
            runs(80, "a", u32::MAX, 2),
            batch[2].clone(),
        ];
        assert_eq!(records, expected);
        assert!(misplaced.len() == 1 && misplaced[0].path.ends_with("torn.parquet"), "{misplaced:?}");
        let identity = Identity { product: u32::MAX, serial: u32::MAX };
        assert_eq!(running(&records)[&identity].time_ms, 80);
        assert_eq!(made(&records, &batch[0].image).unwrap().joint, "a");
    }

    #[test]
    fn writers_at_the_same_time_lose_nothing_and_leave_no_half() {
        let fleet = tempfile::tempdir().unwrap();
        let (writers, each) = (8, 12);
        std::thread::scope(|scope| {
            for writer in 0..writers {
                let fleet = fleet.path();
                scope.spawn(move || {
                    for number in 0..each {
                        append(fleet, &[runs(100, &format!("j{writer}"), writer, number)]).unwrap();
                        assert!(read(fleet).unwrap().1.is_empty(), "a half was read");
                    }
                });
            }
        });
        let (records, misplaced) = read(fleet.path()).unwrap();
        assert_eq!((records.len(), misplaced.len()), ((writers * each) as usize, 0));
        assert_eq!(fs::read_dir(fleet.path().join(FOLDER)).unwrap().count(), records.len());
    }
}
