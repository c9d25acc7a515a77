//! Conversion of raw columns into the signals of each run in SI units, with what is missing and what is unused; host.

use super::condition::{all_hold, holds};
use super::description::Description;
use super::error::DatasetError;
use super::recordings::{Recordings, Run};
use crate::clean::{self, RawRun};
use std::collections::HashMap;

/// Place of each signal in `RawRun::signals`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Velocity, where a column of it is used.
    pub velocity: Option<usize>,
    /// Temperature, where it was recorded.
    pub temperature: Option<usize>,
}

impl Layout {
    /// Position.
    pub const POSITION: usize = 0;
    /// Effort.
    pub const EFFORT: usize = 1;

    /// The layout for a description; the recorded velocity is left out where the description does not use it.
    pub fn of(description: &Description, velocity_column: bool) -> Layout {
        let velocity = velocity_column.then_some(2);
        let temperature = description.columns.temperature.is_some().then_some(2 + usize::from(velocity_column));
        Layout { velocity, temperature }
    }
}

/// Counts of what the rules found, for the report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Findings {
    /// Rows that `select.keep` left out.
    pub left_out: usize,
    /// Rows with the time of the row before, left out.
    pub duplicates: usize,
    /// Rows that a dropout condition or a missing text marks.
    pub dropouts: usize,
    /// Single-sample outliers.
    pub jumps: usize,
    /// Values replaced by their run's median.
    pub steadied: usize,
    /// Rows around a frozen read-out.
    pub frozen: usize,
    /// Rows in saturation.
    pub saturated: usize,
}

/// The signals of one run.
#[derive(Debug)]
pub struct RunSignals {
    /// Index of the run in `Recordings::runs`.
    pub run: usize,
    /// The signals; rows are those of `rows`.
    pub raw: RawRun,
    /// Row of the table for each row.
    pub rows: Vec<usize>,
}

/// All runs, and for each row of the table whether it may be used.
#[derive(Debug)]
pub struct Extracted {
    /// The runs, in order of appearance, without those that have no row left.
    pub runs: Vec<RunSignals>,
    /// Flag of each row of the table that is used (`select.use`, saturation, frozen read-outs).
    pub used: Vec<bool>,
    /// Findings in the signals.
    pub findings: Findings,
}

/// Applies the rules of `select` and `clean` that look at raw columns, and scales the columns to signals.
pub fn extract(recordings: &Recordings, description: &Description, layout: Layout) -> Result<Extracted, DatasetError> {
    let table = &recordings.table;
    let mut findings = Findings::default();
    let keep = all_hold(&description.select.keep, table);
    findings.left_out = keep.iter().filter(|keep| !**keep).count();
    let mut missing = table.missing.clone();
    for condition in &description.clean.dropout {
        missing.iter_mut().zip(holds(condition, table)).for_each(|(missing, holds)| *missing |= holds);
    }
    let mut used = all_hold(&description.select.used, table);
    for saturation in &description.clean.saturation {
        let Some(values) = table.numbers.get(&saturation.column) else { continue };
        for (row, value) in values.iter().enumerate() {
            if value.abs() >= saturation.limit {
                findings.saturated += usize::from(keep[row]);
                used[row] = false;
            }
        }
    }
    let mut runs = Vec::new();
    for (index, run) in recordings.runs.iter().enumerate() {
        let mut rows: Vec<usize> = run.rows.iter().copied().filter(|&row| keep[row]).collect();
        let time = times(recordings, run, &mut rows, description, &mut findings)?;
        if rows.is_empty() {
            continue;
        }
        let mut columns = Columns { recordings, rows: &rows, steadied: HashMap::new() };
        let mut missing: Vec<bool> = rows.iter().map(|&row| missing[row]).collect();
        findings.dropouts += missing.iter().filter(|missing| **missing).count();
        repair(&mut columns, &mut missing, &mut used, description, &mut findings);
        let signals = signals(&columns, &missing, description, layout);
        runs.push(RunSignals { run: index, raw: RawRun { time, signals, missing }, rows });
    }
    Ok(Extracted { runs, used, findings })
}

/// Times of a run since its first row; drops rows that repeat a time.
fn times(
    recordings: &Recordings,
    run: &Run,
    rows: &mut Vec<usize>,
    description: &Description,
    findings: &mut Findings,
) -> Result<Vec<f64>, DatasetError> {
    let column = &description.columns.time;
    let Some(values) = recordings.table.numbers.get(&column.column) else { return Ok(Vec::new()) };
    // A row whose time is missing has no place.
    rows.retain(|&row| values[row].is_finite());
    let mut last = f64::NEG_INFINITY;
    let mut backwards = None;
    let before = rows.len();
    rows.retain(|&row| {
        let time = values[row];
        if time < last && backwards.is_none() {
            backwards = Some((row, last, time));
        }
        let keep = time > last;
        last = last.max(time);
        keep
    });
    if let Some((row, previous, time)) = backwards {
        let (file, line) = recordings.place(row);
        return Err(DatasetError::TimeNotIncreasing {
            file: file.to_owned(),
            line,
            run: run.label.clone(),
            previous: previous * column.scale,
            time: time * column.scale,
        });
    }
    findings.duplicates += before - rows.len();
    let start = rows.first().map_or(0.0, |&row| values[row]);
    Ok(rows.iter().map(|&row| (values[row] - start) * column.scale).collect())
}

/// The columns of one run, some of them steadied.
struct Columns<'a> {
    recordings: &'a Recordings,
    rows: &'a [usize],
    steadied: HashMap<&'a str, Vec<f64>>,
}

impl Columns<'_> {
    fn get(&self, name: &str) -> Vec<f64> {
        if let Some(values) = self.steadied.get(name) {
            return values.clone();
        }
        match self.recordings.table.numbers.get(name) {
            Some(values) => self.rows.iter().map(|&row| values[row]).collect(),
            None => Vec::new(),
        }
    }
}

/// Jumps become missing, steady columns are steadied, and rows around frozen read-outs unused.
fn repair<'a>(
    columns: &mut Columns<'a>,
    missing: &mut [bool],
    used: &mut [bool],
    description: &'a Description,
    findings: &mut Findings,
) {
    let position = &description.columns.position;
    for steady in &description.clean.steady {
        let mut values = columns.get(&steady.column);
        findings.steadied += clean::steady(&mut values, missing, steady.limit);
        columns.steadied.insert(&steady.column, values);
    }
    for jump in &description.clean.jump {
        let wrap = position.wrap.filter(|_| position.column == jump.column);
        let found = clean::spikes(&columns.get(&jump.column), missing, jump.limit, wrap);
        findings.jumps += found.len();
        found.into_iter().for_each(|row| missing[row] = true);
    }
    for frozen in &description.clean.frozen {
        let found = clean::frozen(&columns.get(&frozen.column), missing, frozen.step, frozen.margin);
        for (&row, _) in columns.rows.iter().zip(found).filter(|(_, found)| *found) {
            findings.frozen += usize::from(used[row]);
            used[row] = false;
        }
    }
}

fn signals(columns: &Columns, missing: &[bool], description: &Description, layout: Layout) -> Vec<Vec<f64>> {
    let described = &description.columns;
    let scaled = |name: &str, scale: f64| -> Vec<f64> { columns.get(name).into_iter().map(|x| x * scale).collect() };

    let mut position = columns.get(&described.position.column);
    if let Some(period) = described.position.wrap {
        clean::unwrap(&mut position, missing, period);
    }
    position.iter_mut().for_each(|x| *x *= described.position.scale);

    let mut effort = vec![described.effort.scale; columns.rows.len()];
    for factor in described.effort.factors() {
        effort.iter_mut().zip(columns.get(factor)).for_each(|(effort, x)| *effort *= x);
    }

    let mut signals = vec![position, effort];
    if let (Some(velocity), Some(_)) = (&described.velocity, layout.velocity) {
        signals.push(scaled(&velocity.column, velocity.scale));
    }
    if let Some(temperature) = &described.temperature {
        signals.push(scaled(&temperature.column, temperature.scale));
    }
    signals
}
