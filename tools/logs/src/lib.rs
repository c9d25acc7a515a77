//! Recordings as tables of named columns in MCAP (what robots log) and Parquet (what fleets are archived in); host.
//!
//! A [`Table`] has columns of `f64`, and where it is asked for, columns of text. A missing value is NaN. Readers
//! stream: memory is that of the columns asked for and of one chunk or row batch. [`Format::of`] tells the format by
//! the ending of a file's name.
//!
//! MCAP: messages of channels in JSON (message encoding `json`), one message a row; see [`mcap_log`]. Parquet: flat
//! numeric and text columns, nulls allowed; see [`parquet_log`].

mod error;
mod format;
pub mod mcap_log;
pub mod parquet_log;
mod table;

pub use error::LogError;
pub use format::{Format, TIME};
pub use table::{Table, Texts, Wanted};

use std::path::Path;

/// Reads the wanted columns of a file, all of the same length.
///
/// # Errors
/// [`LogError`] with file, column and row.
pub fn read(path: &Path, wanted: &Wanted) -> Result<Table, LogError> {
    match format(path)? {
        Format::Mcap => mcap_log::read(path, wanted),
        Format::Parquet => parquet_log::read(path, wanted),
    }
}

/// Names of a file's columns.
///
/// # Errors
/// [`LogError`] with the file.
pub fn columns(path: &Path) -> Result<Vec<String>, LogError> {
    match format(path)? {
        Format::Mcap => mcap_log::columns(path),
        Format::Parquet => parquet_log::columns(path),
    }
}

/// The bytes of a file with this table. `topic` and `start`, time of [`TIME`] 0 in ns since 1970, are those of an
/// MCAP's messages.
///
/// # Errors
/// [`LogError::Shape`].
pub fn encode(table: &Table, format: Format, topic: &str, start: u64) -> Result<Vec<u8>, LogError> {
    match format {
        Format::Mcap => mcap_log::encode(table, topic, start),
        Format::Parquet => parquet_log::encode(table),
    }
}

fn format(path: &Path) -> Result<Format, LogError> {
    Format::of(path).ok_or_else(|| LogError::Ending { file: path.to_owned() })
}
