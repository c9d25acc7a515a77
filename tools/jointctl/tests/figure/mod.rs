//! The figure of README: the demo's joint in slow reversals, without compensation and with the image that it learned.
//! `UPDATE_DOCS=1 cargo test -p jointctl --test cli` draws it anew.

use report::figures::{Curve, Ink, Plot, over_time};
use std::path::Path;

const FIGURE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/figures/slow-reversal.svg");
const README: &str = include_str!("../../../../README.md");
/// Every how many samples of a log there is a point.
const EVERY: usize = 10;
/// Largest departure of a number of the drawing, tenths of a pixel: mathematical functions differ between hosts.
const DEPARTURE: f64 = 20.0;

/// Position error, mrad, and torque that friction took, Nm, over time of a log of `sim`.
fn curves(log: &Path) -> [Vec<(f64, f64)>; 2] {
    let mut reader = csv::Reader::from_path(log).unwrap();
    let header = reader.headers().unwrap().clone();
    let column = |name: &str| header.iter().position(|title| title == name).unwrap_or_else(|| panic!("no {name}"));
    let [time, reference, position, asked, motor, friction] = [
        "time_s",
        "reference_position_rad",
        "true_position_rad",
        "commanded_torque_Nm",
        "true_motor_torque_Nm",
        "true_friction_torque_Nm",
    ]
    .map(column);
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).step_by(EVERY).collect();
    let value = |row: &csv::StringRecord, at: usize| row[at].parse::<f64>().unwrap();
    let error = |row| (value(row, time), 1e3 * (value(row, reference) - value(row, position)));
    let lost = |row| (value(row, time), value(row, asked) - value(row, motor) + value(row, friction));
    [rows.iter().map(error).collect(), rows.iter().map(lost).collect()]
}

fn drawn(off: &Path, on: &Path) -> String {
    let both = [(Ink::Nothing, "without compensation", curves(off)), (Ink::Network, "with compensation", curves(on))];
    let plot = |label, at: usize| {
        let curve = |(ink, name, curves): &(Ink, &'static str, [Vec<(f64, f64)>; 2])| Curve {
            ink: *ink,
            name,
            points: curves[at].clone(),
        };
        Plot { label, curves: both.iter().map(curve).collect() }
    };
    let plots = [plot("position error [mrad]", 0), plot("torque lost [Nm]", 1)];
    over_time("slow-reversal", "Slow reversals without and with compensation", "", &plots).unwrap().standalone()
}

/// Returns `true` if two drawings are the same but for numbers that are near each other.
fn is_near(one: &str, other: &str) -> bool {
    let parts = |text: &str| -> (String, Vec<f64>) {
        let is_of_number = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
        let words = text.split(|c| !is_of_number(c)).filter_map(|word| word.parse().ok());
        (text.chars().filter(|&c| !is_of_number(c)).collect(), words.collect())
    };
    let ((frame, numbers), (other_frame, others)) = (parts(one), parts(other));
    let near = numbers.iter().zip(&others).all(|(a, b): (&f64, &f64)| (a - b).abs() <= DEPARTURE);
    frame == other_frame && numbers.len() == others.len() && near
}

/// README shows what the joint did in `folder`: logs of `sim`, and its table as JSON.
pub fn is_shown_by_readme(folder: &Path, judged: &serde_json::Value) {
    let figure = drawn(&folder.join("slow-reversal-off.csv"), &folder.join("slow-reversal-on.csv"));
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(FIGURE, &figure).unwrap();
    }
    assert!(is_near(&figure, &std::fs::read_to_string(FIGURE).unwrap()), "UPDATE_DOCS=1 draws {FIGURE} anew");
    let number = |row: usize, name: &str| judged[row][name].as_f64().unwrap();
    let [off, on] = [0, 1].map(|row| 1e3 * number(row, "position_rms"));
    let [off_torque, on_torque] = [0, 1].map(|row| number(row, "torque_error"));
    let readme = README.split_whitespace().collect::<Vec<_>>().join(" ");
    for said in [format!("from {off:.1} to {on:.2} mrad"), format!("from {off_torque:.0} to {on_torque:.1} %")] {
        assert!(readme.contains(&said), "README does not say '{said}'");
    }
}
