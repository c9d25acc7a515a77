//! Files of an excitation: a table of every joint, and all coefficients; host.

use super::Effort;
use super::Task;
use super::regressor::Score;
use super::search::Found;
use excitation::file::table_in;
use report::output::OutputFile;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Name of the file with all coefficients.
pub const COEFFICIENTS: &str = "excitation.toml";

#[derive(Serialize)]
struct Coefficients<'a> {
    duration: f64,
    fundamental: f64,
    seed: u64,
    condition_number: f64,
    least_singular_value: f64,
    random_condition_number: f64,
    random_least_singular_value: f64,
    joint: BTreeMap<&'a str, Joint<'a>>,
}

#[derive(Serialize)]
struct Joint<'a> {
    centre: f64,
    cosine: &'a [f64],
    sine: &'a [f64],
}

/// `JOINT.csv` for every joint, as `jointctl excite` writes it, and [`COEFFICIENTS`].
///
/// # Errors
/// A number that TOML cannot write: none that is one.
pub fn files(task: &Task, effort: &Effort, found: &Found) -> Result<Vec<OutputFile>, toml::ser::Error> {
    let mut files = Vec::new();
    let mut joints = BTreeMap::new();
    for (j, (joint, excitation)) in task.robot.tree.joints.iter().zip(&found.excitations).enumerate() {
        files.push(OutputFile::new(format!("{}.csv", joint.name), table_in(excitation, task.unit(j))));
        let series = &excitation.series;
        let own = Joint { centre: excitation.centre, cosine: &series.cosine, sine: &series.sine };
        joints.insert(joint.name.as_str(), own);
    }
    let heading = "# q(t) = centre + sum over l of cosine_l / (w l) sin(w l t) - sine_l / (w l) cos(w l t), w = fundamental,\n\
                   # faded in over the first second and out over the last. Positions in rad (m), coefficients in rad/s\n\
                   # (m/s), w in rad/s, time in s. Singular values: of the regressor of base parameters, rotors and\n\
                   # friction.\n\n";
    let coefficients = Coefficients {
        duration: effort.duration,
        fundamental: found.excitations.first().map_or(0.0, |excitation| excitation.series.fundamental),
        seed: effort.seed,
        condition_number: found.score.condition,
        least_singular_value: found.score.least,
        random_condition_number: found.random_score.condition,
        random_least_singular_value: found.random_score.least,
        joint: joints,
    };
    files.push(OutputFile::new(COEFFICIENTS, heading.to_owned() + &toml::to_string(&coefficients)?));
    Ok(files)
}

/// Limits and singular values as a table.
pub fn table(task: &Task, found: &Found) -> String {
    let mut text = format!("{:<24}{:>18}{:>18}{:>18}\n", "joint", "position", "velocity", "acceleration");
    for (extremes, bounds) in found.findings.joints.iter().zip(&task.bounds) {
        let (low, high) = extremes.position;
        let _ = writeln!(
            text,
            "{:<24}{:>18}{:>18}{:>18}",
            format!("{}, {}", extremes.joint, extremes.unit),
            format!("{low:.3} to {high:.3}"),
            format!("{:.3} of {:.3}", extremes.velocity, bounds.velocity),
            format!("{:.3} of {:.3}", extremes.acceleration, bounds.acceleration)
        );
    }
    if let Some(lowest) = &found.findings.lowest {
        let floor = task.floor.map_or("no floor".to_owned(), |floor| format!("floor {floor:.3} m"));
        let _ = writeln!(text, "lowest frame: {} at {:.3} m ({floor})", lowest.frame, lowest.height);
    }
    let Score { condition, least } = found.score;
    let random = found.random_score;
    let _ = writeln!(text, "condition number {condition:.1}, of a random motion {:.1} (median)", random.condition);
    let _ = write!(text, "least singular value {least:.4}, of a random motion {:.4}", random.least);
    text
}

/// The same as JSON.
pub fn summary(task: &Task, found: &Found) -> Value {
    json!({
        "joints": found.findings.joints,
        "lowest": found.findings.lowest,
        "floor": task.floor,
        "condition_number": found.score.condition,
        "least_singular_value": found.score.least,
        "random": {
            "condition_number": found.random_score.condition,
            "least_singular_value": found.random_score.least,
        },
    })
}
