//! Formats, told by the ending of a file's name; host.

use std::path::Path;

/// Column with the time of a row since the first one, s, in tables that this crate writes as MCAP.
pub const TIME: &str = "time_s";

/// Storage format of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// MCAP, <https://mcap.dev/spec>.
    Mcap,
    /// Apache Parquet, <https://parquet.apache.org/docs/file-format>.
    Parquet,
}

impl Format {
    /// The format that the ending of a file's name says; none for any other ending.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?;
        [("mcap", Self::Mcap), ("parquet", Self::Parquet)]
            .into_iter()
            .find_map(|(name, format)| ending.eq_ignore_ascii_case(name).then_some(format))
    }

    /// The format's name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mcap => "MCAP",
            Self::Parquet => "Parquet",
        }
    }
}
