//! Judgements as a table for a terminal: plain text, aligned, for each part of a scenario one row without and one with
//! compensation; host.

use super::{Ending, Judgement};
use report::number::{optional, percent};

/// Share of the samples in motion, %, from which a row says that the image was faded out.
const TOLD_FADED: f64 = 5.0;

/// One row: a part of a scenario, with or without compensation.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// The scenario.
    pub scenario: &'static str,
    /// Its part, where it has several.
    pub part: Option<&'static str>,
    /// `true` if compensation acted.
    pub compensated: bool,
    /// Judgement of the joint.
    pub judgement: Judgement,
    /// End of the run.
    pub ending: Ending,
}

impl Line {
    /// The scenario, with its part where it has several.
    #[must_use]
    pub fn name(&self) -> String {
        self.part.map_or_else(|| self.scenario.to_owned(), |part| format!("{}/{part}", self.scenario))
    }

    /// "on" or "off".
    #[must_use]
    pub const fn compensation(&self) -> &'static str {
        if self.compensated { "on" } else { "off" }
    }

    /// Compensation was on, but a signal left the image's trained box, so that less or nothing of it acted.
    #[must_use]
    pub fn faded(&self) -> Option<String> {
        (self.compensated && self.judgement.faded > TOLD_FADED).then(|| {
            format!(
                "{}, compensation on: outside the image's trained box in {:.0} % of the motion",
                self.name(),
                self.judgement.faded
            )
        })
    }

    /// Reason for which the run did not come to its end, in a sentence.
    #[must_use]
    pub fn stop(&self) -> Option<String> {
        (self.ending != Ending::Whole)
            .then(|| format!("{}, compensation {}: {}", self.name(), self.compensation(), self.ending))
    }

    /// The cells, in the order of [`HEADING`].
    #[must_use]
    pub fn cells(&self) -> [String; 7] {
        let judged = &self.judgement;
        let milli = |value: Option<f64>| optional(value.map(|value| 1e3 * value));
        let relative = judged.torque.as_ref().and_then(|metrics| metrics.relative_torque_error);
        let compensation = if self.faded().is_some() { "faded" } else { self.compensation() };
        [
            self.name(),
            compensation.to_owned(),
            milli(judged.position_rms),
            milli(judged.position_max),
            percent(judged.torque_error),
            percent(judged.torque_error_in_motion),
            percent(relative),
        ]
    }
}

/// Names of the columns.
pub const HEADING: [&str; 7] = [
    "scenario",
    "compensation",
    "position error RMS [mrad]",
    "largest [mrad]",
    "torque error [%]",
    "in motion [%]",
    "001 eq. 11 [%]",
];

/// The same as a JSON array: an object for each row, in rad and per cent; what was not measured is null.
#[must_use]
pub fn json(lines: &[Line]) -> serde_json::Value {
    let object = |line: &Line| {
        let judged = &line.judgement;
        serde_json::json!({
            "scenario": line.scenario,
            "part": line.part,
            "compensated": line.compensated,
            "position_rms": judged.position_rms,
            "position_max": judged.position_max,
            "torque_error": judged.torque_error,
            "torque_error_in_motion": judged.torque_error_in_motion,
            "faded": judged.faded,
            "ending": line.ending.to_string(),
        })
    };
    lines.iter().map(object).collect()
}

/// The table, ending in a line feed; below it, what stopped on the way.
#[must_use]
pub fn table(lines: &[Line]) -> String {
    let rows: Vec<[String; 7]> =
        [HEADING.map(str::to_owned)].into_iter().chain(lines.iter().map(Line::cells)).collect();
    let widths: [usize; 7] =
        std::array::from_fn(|column| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0));
    let mut text = String::new();
    for (number, row) in rows.iter().enumerate() {
        for (column, (cell, width)) in row.iter().zip(widths).enumerate() {
            match column {
                0 => text += &format!("{cell:<width$}"),
                1 => text += &format!("  {cell:<width$}"),
                _ => text += &format!("  {cell:>width$}"),
            }
        }
        text.push('\n');
        if number == 0 {
            text += &"-".repeat(widths.iter().sum::<usize>() + 2 * (widths.len() - 1));
            text.push('\n');
        }
    }
    for stop in lines.iter().filter_map(Line::stop).chain(lines.iter().filter_map(Line::faded)) {
        text += &stop;
        text.push('\n');
    }
    text
}
