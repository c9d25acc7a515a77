//! The samples of a fit as a table of text, so that other programs can judge on the same signals, splits and
//! predictions; host.
//!
//! One row a sample, in the order of the recording. The columns are documented in `docs/baselines.md`.

use crate::dataset::Prepared;
use crate::evaluate::Prediction;
use crate::fit::{rigid_model, units};
use crate::joint_model::rigid_state;
use crate::rigid::{RigidParameters, RigidRegressor};
use crate::samples::Part;
use flate2::Compression;
use flate2::write::GzEncoder;
use report::output::{OutputError, write_file};
use std::io::{self, Write};
use std::path::Path;

/// Writes all samples of `prepared` and what `predictions` say of each to `path`, as gzip where its name ends in `.gz`.
///
/// # Errors
/// [`OutputError`]; the file is then as it was.
pub fn write_sample_table(prepared: &Prepared, predictions: &[Prediction], path: &Path) -> Result<(), OutputError> {
    let made = match path.extension().is_some_and(|extension| extension == "gz") {
        true => {
            table(prepared, predictions, GzEncoder::new(Vec::new(), Compression::fast())).and_then(GzEncoder::finish)
        }
        false => table(prepared, predictions, Vec::new()),
    };
    let contents = made.map_err(|source| OutputError::Io { action: "write", path: path.to_owned(), source })?;
    write_file(path, &contents)
}

/// One column: its name, and its text in a row.
type Column<'a> = (String, Box<dyn Fn(usize) -> String + 'a>);

fn table<W: Write>(prepared: &Prepared, predictions: &[Prediction], to: W) -> io::Result<W> {
    let columns = columns(prepared, predictions);
    let mut writer = csv::Writer::from_writer(to);
    writer.write_record(columns.iter().map(|(name, _)| name))?;
    for i in 0..prepared.samples.len() {
        writer.write_record(columns.iter().map(|(_, text)| text(i)))?;
    }
    writer.into_inner().map_err(csv::IntoInnerError::into_error)
}

fn columns<'a>(prepared: &'a Prepared, predictions: &'a [Prediction]) -> Vec<Column<'a>> {
    let samples = &prepared.samples;
    let units = units(prepared);
    let (position, effort) = (&units.position, &units.effort);
    let mut columns: Vec<Column> = Vec::new();
    let mut text = |name: &str, text: Box<dyn Fn(usize) -> String + 'a>| columns.push((name.to_owned(), text));
    text("run", Box::new(|i| samples.run[i].to_string()));
    text("recording", Box::new(|i| prepared.recordings[samples.run[i] as usize].label.clone()));
    text("part", Box::new(|i| part(samples.part[i]).to_owned()));
    for set in &prepared.test_sets {
        let mut member = vec![false; samples.len()];
        set.indices.iter().for_each(|&i| member[i] = true);
        text(&format!("test {}", set.name), Box::new(move |i| u8::from(member[i]).to_string()));
    }
    let mut number = |name: String, value: &'a [f64]| text(&name, Box::new(|i| value[i].to_string()));
    number("time_s".to_owned(), &samples.time);
    number(format!("position_{position}"), &samples.position);
    number(format!("velocity_{position}_s"), &samples.velocity);
    number(format!("acceleration_{position}_s2"), &samples.acceleration);
    number(format!("effort_{effort}"), &samples.effort);
    if prepared.description.columns.temperature.is_some() {
        number("temperature_C".to_owned(), &samples.temperature);
    }
    if !samples.load.is_empty() {
        number(format!("load_{effort}"), &samples.load);
    }
    for (name, values) in &samples.extra {
        number(name.clone(), values);
    }
    for prediction in predictions {
        number(format!("predicted {}", prediction.model), &prediction.effort);
    }
    // Lagged accelerations are not among them: baselines have a rigid body.
    for regressor in rigid_model(&prepared.description.rigid).regressors() {
        let value = move |i| RigidParameters::regressor_values(&rigid_state(samples, i))[regressor.index()];
        text(&format!("rigid {}", key(regressor)), Box::new(move |i| value(i).to_string()));
    }
    columns
}

fn part(part: Part) -> &'static str {
    match part {
        Part::Train => "train",
        Part::Validation => "validation",
        Part::Test => "test",
        Part::Unused => "unused",
    }
}

/// A regressor's name in the table.
fn key(regressor: RigidRegressor) -> String {
    let key = match regressor {
        RigidRegressor::Inertia => "inertia",
        RigidRegressor::GravitySine => "gravity_sine",
        RigidRegressor::GravityCosine => "gravity_cosine",
        RigidRegressor::LoadInertia => "load_inertia",
        RigidRegressor::LoadGravitySine => "load_gravity_sine",
        RigidRegressor::LoadGravityCosine => "load_gravity_cosine",
        RigidRegressor::Given => "given",
        RigidRegressor::LaggedAcceleration(lag) => return format!("lagged_acceleration_{lag}"),
    };
    key.to_owned()
}
