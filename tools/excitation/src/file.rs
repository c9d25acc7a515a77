//! A series as coefficients (TOML) and as a table of samples (CSV); host.

use super::{Excitation, Found};
use plant::excitation::Reference;
use plant::fourier::FourierSeries;
use serde::{Deserialize, Serialize};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Time between two samples of a table, s.
pub const SAMPLE_PERIOD: f64 = 1e-3;

/// Columns of a table.
const COLUMNS: [&str; 4] = ["time_s", "position_rad", "velocity_rad_s", "acceleration_rad_s2"];

/// Reason for which a file is no excitation.
#[derive(Debug, thiserror::Error)]
pub enum ExcitationFileError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {source}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Not TOML, an unknown key, a missing key or a value of the wrong type.
    #[error("{}: {message}", file.display())]
    Toml {
        /// The file.
        file: PathBuf,
        /// Line, column and reason.
        message: String,
    },
    /// Coefficients of which no series can be made.
    #[error("{}: {reason}", file.display())]
    Coefficients {
        /// The file.
        file: PathBuf,
        /// Defect.
        reason: String,
    },
    /// Not a table with the columns of an excitation.
    #[error("{}: {reason}; expected the columns {}", file.display(), COLUMNS.join(", "))]
    Table {
        /// The file.
        file: PathBuf,
        /// Defect, with its line.
        reason: String,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Coefficients {
    centre: f64,
    duration: f64,
    fundamental: f64,
    cosine: Vec<f64>,
    sine: Vec<f64>,
}

/// The coefficients as text.
///
/// # Errors
/// A coefficient that TOML cannot write: none that is a number.
pub fn coefficients(found: &Found) -> Result<String, toml::ser::Error> {
    let Excitation { series, centre, duration } = found.excitation.clone();
    let FourierSeries { fundamental, cosine, sine } = series;
    let heading = format!(
        "# q(t) = centre + sum over l of cosine_l / (w l) sin(w l t) - sine_l / (w l) cos(w l t), w = fundamental,\n\
         # faded in over the first second and out over the last. Positions in rad, coefficients in rad/s, w in rad/s, time in s.\n\
         # Condition number of the regressor: {:.3}; median of series drawn at random: {:.3}.\n\n",
        found.condition_number, found.random
    );
    Ok(heading + &toml::to_string(&Coefficients { centre, duration, fundamental, cosine, sine })?)
}

/// The samples as a table.
#[must_use]
pub fn table(excitation: &Excitation) -> String {
    table_in(excitation, "rad")
}

/// Table as of [`table`], with positions in `unit` (rad or m).
#[must_use]
pub fn table_in(excitation: &Excitation, unit: &str) -> String {
    let mut text = COLUMNS.join(",").replace("rad", unit) + "\n";
    for (time, motion) in excitation.samples(SAMPLE_PERIOD) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{time:.4},{:.7},{:.6},{:.5}", motion.position, motion.velocity, motion.acceleration);
    }
    text
}

/// Samples at their times, s.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    /// Time, s.
    pub time: Vec<f64>,
    /// Reference motion of the joint.
    pub motion: Vec<Reference>,
}

/// Reads coefficients where the name ends in `.toml`, else a table.
///
/// # Errors
/// [`ExcitationFileError`].
pub fn read(file: &Path) -> Result<Samples, ExcitationFileError> {
    let text = std::fs::read_to_string(file)
        .map_err(|source| ExcitationFileError::Unreadable { file: file.to_owned(), source })?;
    parse(&text, file)
}

/// Parses as [`read`], from the text of a file that is only named.
pub(super) fn parse(text: &str, file: &Path) -> Result<Samples, ExcitationFileError> {
    if file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
        let (time, motion) = parse_coefficients(text, file)?.samples(SAMPLE_PERIOD).unzip();
        return Ok(Samples { time, motion });
    }
    parse_table(text, file)
}

fn parse_coefficients(text: &str, file: &Path) -> Result<Excitation, ExcitationFileError> {
    let Coefficients { centre, duration, fundamental, cosine, sine } = toml::from_str(text).map_err(|error| {
        ExcitationFileError::Toml { file: file.to_owned(), message: error.to_string().trim_end().to_owned() }
    })?;
    let refused = |reason: String| Err(ExcitationFileError::Coefficients { file: file.to_owned(), reason });
    if cosine.is_empty() || cosine.len() != sine.len() {
        return refused(format!(
            "{} cosine and {} sine coefficients, expected as many of each",
            cosine.len(),
            sine.len()
        ));
    }
    let numbers = [("duration", duration, 0.01, 3600.0), ("fundamental", fundamental, 1e-3, 1e3)];
    for (name, value, low, high) in numbers {
        if !(low..=high).contains(&value) {
            return refused(format!("{name} is {value}, must lie in {low} to {high}"));
        }
    }
    if let Some(value) = cosine.iter().chain(&sine).chain([&centre]).find(|value| !value.is_finite()) {
        return refused(format!("a coefficient is {value}, must be finite"));
    }
    Ok(Excitation { series: FourierSeries { fundamental, cosine, sine }, centre, duration })
}

fn parse_table(text: &str, file: &Path) -> Result<Samples, ExcitationFileError> {
    let refused = |reason: String| ExcitationFileError::Table { file: file.to_owned(), reason };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let header = reader.headers().map_err(|error| refused(error.to_string()))?.clone();
    let mut places = [0; COLUMNS.len()];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        let found = header.iter().position(|column| column == name);
        *place = found.ok_or_else(|| refused(format!("no column {name}")))?;
    }
    let mut samples = Samples { time: Vec::new(), motion: Vec::new() };
    for record in reader.records() {
        let record = record.map_err(|error| refused(error.to_string()))?;
        let line = record.position().map_or(0, csv::Position::line);
        let value = |column: usize| -> Result<f64, ExcitationFileError> {
            let text = record.get(places[column]).unwrap_or_default();
            let value = text.parse().ok().filter(|value: &f64| value.is_finite());
            value.ok_or_else(|| refused(format!("line {line}, column {}: {text:?} is not a number", COLUMNS[column])))
        };
        samples.time.push(value(0)?);
        samples.motion.push(Reference { position: value(1)?, velocity: value(2)?, acceleration: value(3)? });
    }
    if samples.time.len() < 2 {
        return Err(refused(format!("{} samples, expected at least 2", samples.time.len())));
    }
    Ok(samples)
}
