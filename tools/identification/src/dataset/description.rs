//! The TOML description of a data set: its keys, units and defaults. The full reference is `docs/dataset.md`; host.
//!
//! A joint that was never seen before needs only such a file. Unknown keys are errors, so that a misspelt filter does
//! not silently mean no filter. Every time is in seconds, every frequency in hertz; "unit" is the position's unit,
//! rad or m. The keys of the signal treatment are in `treatment.rs`; what each value may be is checked in
//! `validate.rs`.

use super::choice_keys::Choice;
use super::condition_keys::{Condition, Value};
use super::treatment::{Classify, Clean, Differentiate, Filter};
use serde::Deserialize;
use std::collections::BTreeMap;

/// A whole data set.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// Short name, for reports.
    pub name: String,
    /// Origin of the recordings.
    pub origin: Option<String>,
    /// Under which licence.
    pub licence: Option<String>,
    /// Day of the recording.
    pub recorded: Option<toml::value::Datetime>,
    /// Temperature that stands for all samples where none was recorded, degrees Celsius.
    #[serde(default = "reference_temperature")]
    pub reference_temperature: f64,
    /// Files.
    pub source: Source,
    /// Assignment of columns to signals.
    pub columns: Columns,
    /// Rows that are used.
    #[serde(default)]
    pub select: Select,
    /// Dropouts, outliers, gaps, uneven sampling.
    #[serde(default)]
    pub clean: Clean,
    /// Low-pass filters, delays and decimation.
    #[serde(default)]
    pub filter: Filter,
    /// Method of obtaining velocity.
    #[serde(default)]
    pub differentiate: Differentiate,
    /// Thresholds of the motion states.
    #[serde(default)]
    pub classify: Classify,
    /// The rigid body that is identified beside the friction.
    #[serde(default)]
    pub rigid: RigidDescription,
    /// Parts that are kept for training, validation and judging.
    #[serde(default)]
    pub split: Split,
    /// Choice of the model.
    #[serde(default)]
    pub choice: Choice,
}

/// Location of the tables.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Folder of the files: relative to the description's own folder, absolute, or beginning with `$NAME`, `${NAME}`
    /// or `${NAME:-default}`. Absent: the description's own folder.
    pub root: Option<String>,
    /// CSV tables with one header line, plain or gzip, in this order.
    pub files: Vec<String>,
    /// Table with one row a run, joined on the run column.
    pub runs: Option<String>,
    /// Separator of the fields.
    #[serde(default = "comma")]
    pub delimiter: char,
    /// Separator between the whole and the fraction of a number: `.` or `,`.
    #[serde(default = "point")]
    pub decimal: char,
}

/// Assignment of columns to signals.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Columns {
    /// Column whose text tells runs apart. Absent: one run a file, labelled with the file's name as listed.
    pub run: Option<String>,
    /// Time.
    pub time: TimeColumn,
    /// Position.
    pub position: PositionColumn,
    /// Velocity; absent: differentiated from the position.
    pub velocity: Option<ScaledColumn>,
    /// Effort: torque, force, current or voltage.
    pub effort: EffortColumn,
    /// Temperature, degrees Celsius after scaling.
    pub temperature: Option<ScaledColumn>,
    /// Further values that are constant over a run, by the name under which the rigid body uses them (`mass` in kg,
    /// `length` in m); from the recordings or from the table of runs.
    #[serde(default)]
    pub extra: BTreeMap<String, String>,
}

/// The column of time.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeColumn {
    /// Column's name.
    pub column: String,
    /// Factor from the column's unit to s.
    #[serde(default = "one")]
    pub scale: f64,
}

/// Any scaled column.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaledColumn {
    /// Column's name.
    pub column: String,
    /// Factor from the column's unit to the signal's unit.
    #[serde(default = "one")]
    pub scale: f64,
}

/// The column of the position.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionColumn {
    /// Column's name.
    pub column: String,
    /// Unit after scaling.
    #[serde(default)]
    pub unit: PositionUnit,
    /// Factor from the column's unit to rad or m.
    #[serde(default = "one")]
    pub scale: f64,
    /// Period at which the column wraps, in the column's own unit (before scaling); absent: it does not wrap.
    pub wrap: Option<f64>,
}

/// Unit of the position.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
pub enum PositionUnit {
    /// Revolute joint.
    #[default]
    #[serde(rename = "rad")]
    Radian,
    /// Prismatic joint.
    #[serde(rename = "m")]
    Metre,
}

impl PositionUnit {
    /// The unit's symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            PositionUnit::Radian => "rad",
            PositionUnit::Metre => "m",
        }
    }
}

/// The column, or the product of columns, of the effort.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffortColumn {
    /// Column's name; either this or `product`.
    pub column: Option<String>,
    /// Columns to multiply (duty and supply voltage).
    pub product: Option<Vec<String>>,
    /// Unit after scaling.
    pub unit: EffortUnit,
    /// Factor to the unit; negative where the recording's sign is opposite to the position's.
    #[serde(default = "one")]
    pub scale: f64,
}

impl EffortColumn {
    /// The columns that are multiplied.
    pub fn factors(&self) -> Vec<&str> {
        self.product.iter().flatten().chain(&self.column).map(String::as_str).collect()
    }
}

/// Unit of the effort.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
pub enum EffortUnit {
    /// Torque, Nm.
    #[serde(rename = "Nm")]
    NewtonMetre,
    /// Force, N.
    #[serde(rename = "N")]
    Newton,
    /// Motor current, A.
    #[serde(rename = "A")]
    Ampere,
    /// Motor voltage, V.
    #[serde(rename = "V")]
    Volt,
}

impl EffortUnit {
    /// The unit's symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            EffortUnit::NewtonMetre => "Nm",
            EffortUnit::Newton => "N",
            EffortUnit::Ampere => "A",
            EffortUnit::Volt => "V",
        }
    }
}

/// Rows that are used.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Select {
    /// Rows that fail one of these do not exist: they are left out before anything else, and time has a gap there.
    #[serde(default)]
    pub keep: Vec<Condition>,
    /// Rows that fail one of these still feed the filters, but are marked unused.
    #[serde(default, rename = "use")]
    pub used: Vec<Condition>,
    /// First and last time within each run, s; the rest is cut off after filtering.
    pub time: Option<[f64; 2]>,
    /// Time to cut off at the start of each run after filtering, s.
    #[serde(default)]
    pub trim_start: f64,
    /// Time to cut off at the end of each run after filtering, s.
    #[serde(default)]
    pub trim_end: f64,
    /// Samples whose filtered speed is below this are unused, unit/s.
    #[serde(default)]
    pub minimum_speed: f64,
}

/// Form of the gravity torque.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
pub enum Gravity {
    /// Vertical axis or balanced joint.
    #[default]
    #[serde(rename = "none")]
    None,
    /// Proportional to sin(q).
    #[serde(rename = "sin")]
    Sine,
    /// Proportional to cos(q).
    #[serde(rename = "cos")]
    Cosine,
    /// Both, for an unknown direction of the centre of mass.
    #[serde(rename = "sin-cos")]
    SineAndCosine,
}

/// The rigid body that is identified beside the friction: effort = inertia a + gravity(q) + back-EMF v + offset +
/// friction.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq)]
#[serde(deny_unknown_fields, default)]
pub struct RigidDescription {
    /// A constant inertia (or mass).
    pub inertia: bool,
    /// A gravity torque.
    pub gravity: Gravity,
    /// Inertia proportional to mass * length^2 and gravity torque proportional to mass * length, in addition.
    pub mass_and_length: bool,
    /// A voltage proportional to the velocity; only where the effort is in V.
    pub back_emf: bool,
    /// A constant effort.
    pub offset: bool,
    /// A rigid part that is computed elsewhere; no key of the file, but set by `robot::fit`.
    #[serde(skip)]
    pub given: bool,
}

impl Default for RigidDescription {
    fn default() -> Self {
        RigidDescription {
            inertia: true,
            gravity: Gravity::None,
            mass_and_length: false,
            back_emf: false,
            offset: true,
            given: false,
        }
    }
}

/// Parts that are kept for training, validation and judging.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Split {
    /// Named test sets; they may overlap. Absent: 30 % of the time, in blocks, named `test`.
    #[serde(default)]
    pub test: Vec<Rule>,
    /// Part of the rest for validation. Absent: two sevenths of the time, in blocks.
    pub validation: Option<Rule>,
}

/// Samples that belong to a part; the tests that are given must all hold.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rule {
    /// Name of a test set.
    pub name: Option<String>,
    /// Files, as listed in `source.files`.
    pub files: Option<Vec<String>>,
    /// Labels of runs.
    pub runs: Option<Vec<Value>>,
    /// Tests on columns of the recordings or of the table of runs.
    #[serde(default, rename = "where")]
    pub conditions: Vec<Condition>,
    /// Samples for which all of these hold are left out.
    #[serde(default)]
    pub unless: Vec<Condition>,
    /// A repeating pattern of blocks of time.
    pub blocks: Option<Blocks>,
    /// A share, drawn at random, of what the other tests leave.
    pub fraction: Option<Fraction>,
}

/// A repeating pattern of blocks of time. Blocks are numbered through all runs; each run begins a new one.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blocks {
    /// Length of a block, s.
    pub length: f64,
    /// Length of the pattern, blocks.
    pub modulo: usize,
    /// Blocks of each pattern, from 0.
    pub index: Vec<usize>,
}

/// A share drawn at random.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fraction {
    /// The share, between 0 and 1.
    pub of: f64,
    /// Unit of the draw.
    #[serde(default)]
    pub by: FractionBy,
    /// Length of a block, s. Absent: a fortieth of the whole recording.
    pub length: Option<f64>,
    /// Seed of the draw.
    #[serde(default)]
    pub seed: u64,
}

/// Unit that a share is drawn from.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum FractionBy {
    /// Blocks of time.
    #[default]
    Blocks,
    /// Whole runs.
    Runs,
}

fn one() -> f64 {
    1.0
}

fn point() -> char {
    '.'
}

fn comma() -> char {
    ','
}

fn reference_temperature() -> f64 {
    25.0
}
