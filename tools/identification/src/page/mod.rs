//! The report of one identification: what was done to the data, what was found, how good it is; host.
//!
//! The pipeline fills a [`Report`]; [`write()`] turns it into one self-contained page, one file per figure and all
//! numbers as JSON. Nothing here computes a model: errors come from [`crate::metrics`], predictions from the stages.
//! The outcome is a pure function of the report, so that equal reports give equal bytes.

mod choice;
pub mod console;
mod figures;
mod html;
mod summary;
mod tables;

pub use figures::figures;
pub use summary::{Verdict, verdict};

use crate::dataset::Warning;
use crate::metrics::{ByState, Metrics};
use report::figures::FigureError;
use report::output::{OutputError, OutputFile, write_directory};
use serde::Serialize;
use std::path::Path;

/// Content of the report.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// Heading of the page.
    pub title: String,
    /// Name of the data set.
    pub data_set: String,
    /// Units of the joint's quantities.
    pub units: Units,
    /// Provenance of the result: what it was made from and with.
    pub provenance: Provenance,
    /// Suspected defects of the data.
    pub warnings: Vec<Warning>,
    /// Notes on what each stage did to the data, in order.
    pub stages: Vec<StageNote>,
    /// Identified physical parameters.
    pub parameters: Vec<Parameter>,
    /// The models that were compared on motions that were left out, best first.
    pub candidates: Vec<Candidate>,
    /// Choice of the model.
    pub choice: Choice,
    /// Outcome of the network.
    pub network: NetworkOutcome,
    /// Errors on test data, one table for each test set. The verdict looks at all of them.
    pub errors: Vec<ErrorTable>,
    /// Cost of fixed-point arithmetic. None where no image was made.
    pub fixed_point: Option<FixedPointDifference>,
    /// Training of the network, one curve for each seed.
    pub training: Vec<TrainingCurve>,
    /// Part of the image's friction that the joint may not have. None where the recording does not tell.
    pub uncertainty: Option<Uncertainty>,
    /// The certificate of the image, item by item.
    pub certificate: Vec<CertificateItem>,
    /// Samples of all test sets, for the figures. Not part of the JSON file.
    #[serde(skip)]
    pub test: TestSamples,
}

/// Part of an image's friction that the joint may not have, for `compensation.uncertainty`.
#[derive(Clone, Debug, Serialize)]
pub struct Uncertainty {
    /// The part, 0.1 to 1.
    pub value: f64,
    /// Cell in which it was found.
    pub worst: String,
    /// Directions, speeds and loads of motions that were judged.
    pub cells: usize,
}

impl Uncertainty {
    /// Sentence on what it is and what to do with it.
    pub fn sentence(&self) -> String {
        let Self { value, worst, cells } = self;
        format!(
            "Friction is at least {:.0} % of the image's on motions that were left out (least: {worst}; {cells} means over \
             directions, speeds and loads). compensation.uncertainty = {value} lets torque mode give as much wherever the \
             joint moves; add what friction may lose later",
            100.0 * (1.0 - value)
        )
    }
}

/// Names of the units, as printed on axes and in tables.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Units {
    /// rad or m.
    pub position: String,
    /// rad/s or m/s.
    pub velocity: String,
    /// Nm, N, A or V.
    pub effort: String,
}

/// Provenance of a result: what it was made from and with; enough to make it again.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Provenance {
    /// Version of the program.
    pub tool_version: String,
    /// SHA-256 of the data files, hexadecimal.
    pub data_sha256: String,
    /// File name of the data set's description.
    pub description: String,
    /// Options and their values.
    pub options: Vec<(String, String)>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Time, as text (ISO 8601).
    pub created: String,
}

/// Note on one stage of the pipeline.
#[derive(Clone, Debug, Default, Serialize)]
pub struct StageNote {
    /// Name of the stage: clean, filter, classify, split.
    pub stage: String,
    /// Action of the stage, in a sentence.
    pub note: String,
    /// Numbers of samples, by what happened to them.
    pub counts: Vec<(String, u64)>,
}

/// One identified parameter.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Parameter {
    /// Name in the field's words: Coulomb friction, viscous coefficient.
    pub name: String,
    /// Symbol in the formula.
    pub symbol: String,
    /// Value in `unit`.
    pub value: f64,
    /// Unit, or empty.
    pub unit: String,
    /// Standard error in `unit`; None where the data do not determine it.
    pub standard_error: Option<f64>,
    /// The value lies at the bound of its range: the data would like to go further.
    pub at_bound: bool,
    /// The true value, where it is known: of a virtual joint.
    pub truth: Option<f64>,
}

/// Choice of the model.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Choice {
    /// The groupings of the folds, in words.
    pub grouping: String,
    /// False: blocks of time, which say nothing about other motions.
    pub motions: bool,
    /// Names of the physical models whose errors the folds have.
    pub models: Vec<String>,
    /// The folds.
    pub folds: Vec<FoldRow>,
    /// Terms of the chosen model.
    pub terms: Vec<String>,
    /// Steps of the choice.
    pub notes: Vec<String>,
    /// Decisions that a person made instead.
    pub overruled: Vec<String>,
}

/// One fold.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FoldRow {
    /// Motions that it leaves out.
    pub left_out: String,
    /// RMSE there of each physical model, fitted without it, unit of effort.
    pub errors: Vec<f64>,
}

/// One model that was compared on motions that were left out.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Candidate {
    /// Name of the preset, or what was added to it.
    pub model: String,
    /// Number of free parameters.
    pub parameters: usize,
    /// RMSE over the folds, each left out, unit of effort.
    pub unseen_rmse: f64,
    /// `true` if this is the model that is used.
    pub kept: bool,
    /// Reason for which it is, or is not.
    pub reason: String,
}

/// Outcome of the network.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NetworkOutcome {
    /// None was trained.
    #[default]
    NotTrained,
    /// Network that lowers the error on validation data and is part of the image.
    Kept,
    /// Network that does not pay; the image holds the physical model alone.
    Rejected {
        /// Reason, as a clause: "it raises the validation error by 2 %".
        reason: String,
    },
}

/// Role of a row of an error table in the comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// The rigid body alone: no friction compensation.
    Nothing,
    /// A physical preset that was not chosen.
    Preset,
    /// The chosen physical model.
    Physical,
    /// The chosen physical model plus the network, floating point.
    PhysicalAndNetwork,
    /// The image that the joint would run, in its own integers.
    FixedPoint,
    /// The image on another view of the same motion: the joint's observer's, or the one without delay.
    OtherMotion,
    /// A model of others, for comparison only.
    Reference,
}

/// Errors of all models on one test set.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ErrorTable {
    /// Name of the test set.
    pub test_set: String,
    /// One row for each model.
    pub rows: Vec<ErrorRow>,
}

/// Errors of one model on one test set.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorRow {
    /// Name of the model.
    pub model: String,
    /// Its part in the comparison.
    pub role: Role,
    /// Errors for all samples and for each motion state.
    pub errors: ByState<Option<Metrics>>,
    /// Torque error of all samples, % of the friction (see [`crate::torque_error`]). None where no row is without
    /// friction.
    pub torque_error: Option<f64>,
}

impl ErrorTable {
    /// The first row with this role.
    pub fn row(&self, role: Role) -> Option<&ErrorRow> {
        self.rows.iter().find(|row| row.role == role)
    }

    /// The physical model with the lowest error, whether it was chosen or not.
    pub fn best_simple(&self) -> Option<(&ErrorRow, f64)> {
        let simple = self.rows.iter().filter(|row| matches!(row.role, Role::Preset | Role::Physical));
        let judged = simple.filter_map(|row| Some((row, row.errors.overall.as_ref()?.rmse)));
        judged.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The row of what the joint would run: the image, else the network, else the physical model.
    pub fn compensated(&self) -> Option<&ErrorRow> {
        [Role::FixedPoint, Role::PhysicalAndNetwork, Role::Physical].into_iter().find_map(|role| self.row(role))
    }
}

/// Difference between the fixed-point image and the same model in floating point, over the test samples.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FixedPointDifference {
    /// Root mean square, unit of effort.
    pub rms: f64,
    /// Largest absolute difference, unit of effort.
    pub max: f64,
    /// Largest absolute difference, % of the largest friction estimate.
    pub max_percent_of_full_scale: f64,
}

/// Training of the network from one seed.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TrainingCurve {
    /// Seed of the first weights.
    pub seed: u64,
    /// Mean square error on training data after each epoch, from epoch 0.
    pub train: Vec<f64>,
    /// Mean square error on validation data after each epoch.
    pub validation: Vec<f64>,
    /// Epoch whose weights are kept.
    pub best_epoch: usize,
    /// `true` if this is the seed whose network is used.
    pub chosen: bool,
    /// Reason for the end of training.
    pub stop: String,
}

/// One proof of the certificate.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CertificateItem {
    /// Name of what is proven.
    pub name: String,
    /// The value that the proof gives.
    pub value: f64,
    /// The value that it must not exceed.
    pub limit: f64,
    /// Unit of value, limit and worst found.
    pub unit: String,
    /// Largest value that a search found, as a check of the proof. None where no search was made.
    pub worst_found: Option<f64>,
    /// The image may be used.
    pub passed: bool,
}

/// Columns of equal length, in the data set's units. Rows of a run are contiguous and ordered in time.
#[derive(Clone, Debug, Default)]
pub struct TestSamples {
    /// Time since the start of the run, s.
    pub time: Vec<f64>,
    /// Index of the run.
    pub run: Vec<u32>,
    /// Position.
    pub position: Vec<f64>,
    /// Velocity.
    pub velocity: Vec<f64>,
    /// Temperature, degrees Celsius. None where it was not recorded.
    pub temperature: Option<Vec<f64>>,
    /// Measured effort.
    pub effort: Vec<f64>,
    /// Effort predicted by the rigid body alone.
    pub rigid: Vec<f64>,
    /// Effort predicted by the rigid body and the physical friction.
    pub physical: Vec<f64>,
    /// Effort predicted by the rigid body and the image (physical friction and network, fixed point). None where there
    /// is no network.
    pub network: Option<Vec<f64>>,
}

impl TestSamples {
    /// The last prediction of the chain: with the network where there is one.
    pub fn compensated(&self) -> &[f64] {
        self.network.as_deref().unwrap_or(&self.physical)
    }

    /// Checks that all columns have the same length and hold finite numbers only.
    ///
    /// # Errors
    /// [`ReportError::Length`], [`ReportError::NotFinite`].
    pub fn check(&self) -> Result<(), ReportError> {
        let expected = self.time.len();
        let length = |column, length| match length == expected {
            true => Ok(()),
            false => Err(ReportError::Length { column, length, expected }),
        };
        length("run", self.run.len())?;
        let optional = [("temperature", &self.temperature), ("network", &self.network)];
        let columns = [
            ("time", &self.time),
            ("position", &self.position),
            ("velocity", &self.velocity),
            ("effort", &self.effort),
            ("rigid", &self.rigid),
            ("physical", &self.physical),
        ];
        let recorded = optional.iter().filter_map(|(name, column)| column.as_ref().map(|column| (*name, column)));
        for (name, column) in columns.into_iter().chain(recorded) {
            length(name, column.len())?;
            if let Some(index) = column.iter().position(|value| !value.is_finite()) {
                return Err(ReportError::NotFinite { column: name, index, value: column[index] });
            }
        }
        Ok(())
    }
}

/// Reason for which a report was not written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A test column has another length than the time column.
    #[error("test column {column} has {length} samples, time has {expected}")]
    Length {
        /// Name of the column.
        column: &'static str,
        /// Its length.
        length: usize,
        /// Length of the time column.
        expected: usize,
    },
    /// A test column holds an infinite number or none.
    #[error("test column {column} is {value} at sample {index}")]
    NotFinite {
        /// Name of the column.
        column: &'static str,
        /// Index of the sample.
        index: usize,
        /// The value.
        value: f64,
    },
    /// A figure could not be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// The numbers could not be serialised.
    #[error("cannot serialise the report: {0}")]
    Json(#[from] serde_json::Error),
    /// The files could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// The files of a report: `report.html`, `report.json` and `figures/*.svg`.
///
/// In the JSON file a number that is infinite or not a number is `null`; on the page it is a dash.
///
/// # Errors
/// [`ReportError`] but [`ReportError::Output`].
pub fn render(report: &Report) -> Result<Vec<OutputFile>, ReportError> {
    report.test.check()?;
    let figures = figures(report)?;
    let mut files = vec![
        OutputFile::new("report.html", html::page(report, &figures)),
        OutputFile::new("report.json", numbers(report)?),
    ];
    for figure in &figures {
        files.push(OutputFile::new(format!("figures/{}.svg", figure.name), figure.standalone()));
    }
    Ok(files)
}

/// The content of `report.json`: the report without its samples, and the verdict.
///
/// # Errors
/// A number that has no place in JSON.
pub fn numbers(report: &Report) -> Result<String, ReportError> {
    #[derive(Serialize)]
    struct Numbers<'a> {
        verdict: Verdict,
        #[serde(flatten)]
        report: &'a Report,
    }
    Ok(serde_json::to_string_pretty(&Numbers { verdict: verdict(report), report })? + "\n")
}

/// Writes the report into `directory`; files of others in it stay.
///
/// # Errors
/// [`ReportError`]; the directory is then as it was.
pub fn write(report: &Report, directory: &Path) -> Result<(), ReportError> {
    Ok(write_directory(directory, &render(report)?)?)
}

#[cfg(test)]
mod example;
#[cfg(test)]
mod tests;
