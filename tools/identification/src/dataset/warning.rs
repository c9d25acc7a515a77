//! A finding about a recording that does not stop the work but makes its result doubtful; host.

use serde::Serialize;
use std::fmt;

/// A defect that a data check suspects: where, how large, and the remedy.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// Name of the check: units, wrapping, stuck, clipping, sampling, sign, excitation, drift, inertia, lag, split,
    /// slope.
    pub check: &'static str,
    /// Column or columns of the recording, or the key of the description.
    pub column: String,
    /// Rows concerned: run, and where it is local the time within the run.
    pub rows: String,
    /// The finding, with its number and the limit.
    pub finding: String,
    /// The remedy.
    pub remedy: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Warning { check, column, rows, finding, remedy } = self;
        write!(f, "{check}: {column}, {rows}: {finding}; {remedy}")
    }
}
