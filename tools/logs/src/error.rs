//! Defects of a log, with file, column and row; host.

use crate::format::Format;
use std::path::PathBuf;

/// Reason for which a log is not read or not written. Rows count from 1.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// A name that says no format.
    #[error("{}: a log's name ends in .mcap or .parquet", file.display())]
    Ending {
        /// The file.
        file: PathBuf,
    },
    /// The operating system refused.
    #[error("{}: cannot be read: {source}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// Another format than the one that the name says.
    #[error("{}: is no {} file: {reason}", file.display(), format.name())]
    Foreign {
        /// The file.
        file: PathBuf,
        /// The format that its name says.
        format: Format,
        /// Error of the reader.
        reason: String,
    },
    /// A file that ends early, or whose bytes were changed.
    #[error("{}: damaged after row {row}: {reason}", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// Rows that were read before.
        row: usize,
        /// Error of the reader.
        reason: String,
    },
    /// No row.
    #[error("{}: no rows", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// A column that does not exist.
    #[error("{}: no column {column:?}; available: {}", file.display(), available.join(", "))]
    MissingColumn {
        /// The file.
        file: PathBuf,
        /// The column.
        column: String,
        /// Columns that exist.
        available: Vec<String>,
    },
    /// Columns that no single topic has.
    #[error(
        "{}: no topic has all of the columns {}; topics: {}; rows are the messages of one topic",
        file.display(), columns.join(", "), topics.join(", ")
    )]
    Apart {
        /// The file.
        file: PathBuf,
        /// The columns.
        columns: Vec<String>,
        /// Topics that have some of them.
        topics: Vec<String>,
    },
    /// Columns that several topics have.
    #[error(
        "{}: the columns {} are in more than one topic ({}): write topic.column, as in \"{}.{}\"",
        file.display(), columns.join(", "), topics.join(", "), topics.first().map_or("", String::as_str),
        columns.first().map_or("", String::as_str)
    )]
    Ambiguous {
        /// The file.
        file: PathBuf,
        /// The columns.
        columns: Vec<String>,
        /// The topics.
        topics: Vec<String>,
    },
    /// A column or value of another type.
    #[error("{}{}, column {column:?}: {found}: expected {expected}", file.display(), place(*row))]
    Type {
        /// The file.
        file: PathBuf,
        /// The row; none where it is the whole column.
        row: Option<usize>,
        /// The column.
        column: String,
        /// Its type or value.
        found: String,
        /// A number or a text.
        expected: &'static str,
    },
    /// A value that is missing, NaN or infinite, where a finite number is needed.
    #[error("{} row {row}, column {column:?}: {found}: expected a finite number", file.display())]
    NotFinite {
        /// The file.
        file: PathBuf,
        /// The row.
        row: usize,
        /// The column.
        column: String,
        /// The value.
        found: f64,
    },
    /// A table that cannot be written.
    #[error("table: column {column:?}: {reason}")]
    Shape {
        /// The column.
        column: String,
        /// Defect of it.
        reason: String,
    },
}

fn place(row: Option<usize>) -> String {
    row.map_or_else(String::new, |row| format!(" row {row}"))
}
