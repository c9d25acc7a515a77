//! Judgements as a table for a terminal: plain text, aligned, for each part of a scenario one row without and one with
//! compensation; host.

use super::{Ending, Judgement};
use crate::report::number::{optional, percent};

/// One row: a part of a scenario, with or without compensation.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// The scenario.
    pub scenario: &'static str,
    /// Its part, where it has several.
    pub part: Option<&'static str>,
    /// Whether compensation acted.
    pub compensated: bool,
    /// How well the joint did.
    pub judgement: Judgement,
    /// How the run ended.
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

    /// Why the run did not come to its end, in a sentence.
    #[must_use]
    pub fn stop(&self) -> Option<String> {
        (self.ending != Ending::Whole)
            .then(|| format!("{}, compensation {}: {}", self.name(), self.compensation(), self.ending))
    }

    /// The cells, in the order of [`HEADING`].
    #[must_use]
    pub fn cells(&self) -> [String; 6] {
        let judged = &self.judgement;
        let milli = |value: Option<f64>| optional(value.map(|value| 1e3 * value));
        let relative = |metrics: &Option<crate::metrics::Metrics>| {
            percent(metrics.as_ref().and_then(|metrics| metrics.relative_torque_error))
        };
        [
            self.name(),
            self.compensation().to_owned(),
            milli(judged.position_rms),
            milli(judged.position_max),
            relative(&judged.torque),
            relative(&judged.torque_in_motion),
        ]
    }
}

/// Names of the columns.
pub const HEADING: [&str; 6] = [
    "scenario",
    "compensation",
    "position error RMS [mrad]",
    "largest [mrad]",
    "rel. torque error [%]",
    "in motion [%]",
];

/// The table, ending in a line feed; below it, what stopped on the way.
#[must_use]
pub fn table(lines: &[Line]) -> String {
    let rows: Vec<[String; 6]> =
        [HEADING.map(str::to_owned)].into_iter().chain(lines.iter().map(Line::cells)).collect();
    let widths: [usize; 6] =
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
    for stop in lines.iter().filter_map(Line::stop) {
        text += &stop;
        text.push('\n');
    }
    text
}
