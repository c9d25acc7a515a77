//! Errors of a data set, said so that the file, line or column can be corrected without a debugger; host.

use crate::choice::grouping::NoGroups;
use crate::filter::FilterError;
use std::path::PathBuf;
use thiserror::Error;

/// Reason for which a data set could not be prepared.
#[derive(Debug, Error)]
pub enum DatasetError {
    /// A file that is named by the command line or by the description cannot be read.
    #[error("{}: cannot be read: {source}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The description is not TOML, has an unknown key, lacks one, or a value has the wrong type.
    #[error("{}: {message}", file.display())]
    Toml {
        /// The description.
        file: PathBuf,
        /// Line, column and reason.
        message: String,
    },
    /// A value in the description is of the right type but makes no sense.
    #[error("{}: {key} = {value}: expected {expected}", file.display())]
    Description {
        /// The description.
        file: PathBuf,
        /// The key, with the tables that it is in.
        key: String,
        /// The value that was found.
        value: String,
        /// Values that would have been accepted.
        expected: String,
    },
    /// The root folder begins with an environment variable that is not set and has no default.
    #[error("{}: source.root = {root:?}: environment variable {variable} is not set; set it or write ${{{variable}:-default}}", file.display())]
    Environment {
        /// The description.
        file: PathBuf,
        /// The root as written.
        root: String,
        /// The variable's name.
        variable: String,
    },
    /// A file ends in the middle of its compressed stream or fails its checksum.
    #[error("{}: not a whole gzip file: {source}", file.display())]
    Gzip {
        /// The file.
        file: PathBuf,
        /// Error of the decompressor.
        source: std::io::Error,
    },
    /// A file without any row of data.
    #[error("{}: no rows: expected a header line and at least one line of values", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// A row with more or fewer fields than the header.
    #[error("{} line {line}: {found} fields, expected {expected} as in the header", file.display())]
    Ragged {
        /// The file.
        file: PathBuf,
        /// Line, the header being line 1.
        line: u64,
        /// Fields in the header.
        expected: u64,
        /// Fields in the line.
        found: u64,
    },
    /// Any other defect of the table's form.
    #[error("{}: not a table of comma-separated values: {message}", file.display())]
    Csv {
        /// The file.
        file: PathBuf,
        /// Error of the reader.
        message: String,
    },
    /// A column that the description names does not exist.
    #[error("{}: no column {column:?}; available: {}{hint}", file.display(), available.join(", "))]
    MissingColumn {
        /// The file.
        file: PathBuf,
        /// The column that was asked for.
        column: String,
        /// The columns that exist.
        available: Vec<String>,
        /// Hint at what may be meant, or nothing.
        hint: String,
    },
    /// A column that the description names exists twice.
    #[error("{}: column {column:?} appears more than once in the header", file.display())]
    AmbiguousColumn {
        /// The file.
        file: PathBuf,
        /// The column's name.
        column: String,
    },
    /// A field that should be a number is not.
    #[error("{} line {line}, column {column:?}: {text:?}: expected a number{hint}", file.display())]
    NotANumber {
        /// The file.
        file: PathBuf,
        /// Line, the header being line 1.
        line: u64,
        /// The column's name.
        column: String,
        /// The text in the field.
        text: String,
        /// Hint at what may be meant, or nothing.
        hint: &'static str,
    },
    /// A field that should be a finite number is NaN or infinite.
    #[error("{} line {line}, column {column:?}: {text}: expected a finite number (name it in clean.missing_text if it marks a missing sample)", file.display())]
    NotFinite {
        /// The file.
        file: PathBuf,
        /// Line, the header being line 1.
        line: u64,
        /// The column's name.
        column: String,
        /// The text in the field.
        text: String,
    },
    /// Time runs backwards within a run.
    #[error("{} line {line}: time {time} s after {previous} s in run {run:?}: expected time to increase", file.display())]
    TimeNotIncreasing {
        /// The file.
        file: PathBuf,
        /// Line of the later row.
        line: u64,
        /// The run's label.
        run: String,
        /// Time of the row before, s.
        previous: f64,
        /// Time of this row, s.
        time: f64,
    },
    /// A run of the recordings has no row in the table of runs.
    #[error("{}: no row for run {run:?}", file.display())]
    MissingRun {
        /// The table of runs.
        file: PathBuf,
        /// The run's label.
        run: String,
    },
    /// Two rows of the table of runs have the same label.
    #[error("{}: more than one row for run {run:?}", file.display())]
    AmbiguousRun {
        /// The table of runs.
        file: PathBuf,
        /// The run's label.
        run: String,
    },
    /// A signal never changes.
    #[error("{signal} (column {column:?}) is {value} in all {count} samples: expected a signal that varies")]
    Constant {
        /// Position, velocity or effort.
        signal: &'static str,
        /// The column or columns that it is made from.
        column: String,
        /// The constant value.
        value: f64,
        /// Number of samples.
        count: usize,
    },
    /// Too few samples, or none, are left to identify from.
    #[error("{found} usable samples are left {stage}: expected at least {required}")]
    TooFewSamples {
        /// Name of the stage after which they are left.
        stage: &'static str,
        /// Number of samples left.
        found: usize,
        /// Number of samples required.
        required: usize,
    },
    /// A filter's cut-off does not lie below half of the sampling rate.
    #[error(
        "filter.{signal}: cut-off {cutoff_hz} Hz in run {run:?}: expected more than 0 and less than the Nyquist frequency of {nyquist_hz} Hz"
    )]
    Cutoff {
        /// The filtered signal.
        signal: &'static str,
        /// The run's label.
        run: String,
        /// Cut-off, Hz.
        cutoff_hz: f64,
        /// Half of the sampling rate, Hz.
        nyquist_hz: f64,
    },
    /// A filter cannot be applied for another reason.
    #[error("filter.{signal} in run {run:?}: {error}")]
    Filter {
        /// The filtered signal.
        signal: &'static str,
        /// The run's label.
        run: String,
        /// The reason.
        error: FilterError,
    },
    /// A signal does not fit the firmware's number format.
    #[error(
        "{signal} (column {column:?}) reaches {value} in run {run:?} at {time} s: the limit of Q16.16 is +-{limit}; give columns.{signal}.scale a smaller value"
    )]
    OutOfRange {
        /// Position, velocity, acceleration, effort or temperature.
        signal: &'static str,
        /// The column or columns that it is made from.
        column: String,
        /// The run's label.
        run: String,
        /// Time within the run, s.
        time: f64,
        /// The value.
        value: f64,
        /// Largest accepted magnitude.
        limit: f64,
    },
    /// Friction drives the joint, which it cannot.
    #[error(
        "effort (column {column:?}) has the wrong sign: friction at the mean speed of {speed:.3} comes out as {friction:.4} +- {error:.4} \
         {unit} and drives the joint; give columns.effort.scale the value {}", -scale
    )]
    EffortSign {
        /// The column or columns that it is made from.
        column: String,
        /// Coulomb and viscous friction of the simplest model at the mean speed, unit of effort.
        friction: f64,
        /// Its standard error.
        error: f64,
        /// Unit of the effort.
        unit: &'static str,
        /// Mean speed, rad/s or m/s.
        speed: f64,
        /// The scale as described.
        scale: f64,
    },
    /// The recorded velocity runs against the recorded position.
    #[error(
        "velocity (column {velocity:?}) runs against position (column {position:?}): correlation {correlation:.2} with its derivative; \
         give columns.velocity.scale or columns.position.scale the other sign"
    )]
    VelocitySign {
        /// The column of the position.
        position: String,
        /// The column of the velocity.
        velocity: String,
        /// Correlation of integrated velocity and way.
        correlation: f64,
    },
    /// The observer of the joint cannot be applied.
    #[error("filter.observer_hz = {bandwidth_hz} in run {run:?}: {error}")]
    Observer {
        /// The run's label.
        run: String,
        /// Bandwidth, Hz.
        bandwidth_hz: f64,
        /// The reason.
        error: joint_firmware::motor::setting::SettingError,
    },
    /// The split leaves nothing to train with, to validate with, or to judge by.
    #[error("the split leaves {part} without samples ({usable} usable samples in all): {hint}")]
    EmptyPart {
        /// The part or the test set's name.
        part: String,
        /// Usable samples in the whole data set.
        usable: usize,
        /// Hint at what to look at.
        hint: String,
    },
    /// MCAP or Parquet.
    #[cfg(feature = "logs")]
    #[error(transparent)]
    Log(#[from] ::logs::LogError),
    /// MCAP or Parquet, and a program without them.
    #[error(
        "{}: this jointctl was built without MCAP and Parquet: cargo install or cargo run with --features logs", file.display()
    )]
    WithoutLogs {
        /// The file.
        file: PathBuf,
    },
    /// A column that tells motions apart is missing or has one value.
    #[error(transparent)]
    Groups(#[from] NoGroups),
}
