//! The way from a description to samples: load, clean, filter, differentiate, split, classify; host.

use super::checks;
use super::condition::all_hold;
use super::description::{Description, Rule};
use super::error::DatasetError;
use super::lag::{self, Lag};
use super::load::Environment;
use super::recordings::Recordings;
use super::signals::{Extracted, Findings, Layout, extract};
use super::treat::{Motion, minimum_samples, treat};
use super::treatment::VelocityFrom;
use super::validate;
use super::warning::Warning;
use crate::choice::Folds;
use crate::choice::grouping::{self, Labels};
use crate::classify::{Thresholds, classify};
use crate::clean::{Repairs, stretches};
use crate::fit::rigid_model;
use crate::samples::{MotionState, Part, Samples, Track};
use crate::split::{Recorded, TestSet, split};
use std::fmt;
use std::path::Path;

/// Largest magnitude of a signal: Q16.16 ends at 32768, and what is computed from a signal needs some room.
pub const SIGNAL_LIMIT: f64 = 32_000.0;
/// Fewest usable samples of a data set: below, not even the physical parameters can be told apart.
pub const MINIMUM_SAMPLES: usize = 100;

/// A data set, ready for identification.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The description it was made from.
    pub description: Description,
    /// All samples that are left, used or not.
    pub samples: Samples,
    /// Origin of each value of `samples.run`: where it was recorded.
    pub recordings: Vec<Recording>,
    /// The test sets, in the order described. Every index is of a sample with `Part::Test`.
    pub test_sets: Vec<TestSet>,
    /// Motions to be left out in turn when a model is chosen.
    pub folds: Folds,
    /// Boundaries of the motion states.
    pub thresholds: Thresholds,
    /// Notes on what each stage did.
    pub notes: Vec<Note>,
    /// Position and velocity as the joint's observer sees them; where `samples` has those (`filter.causal_motion`), as
    /// filtered. None where nothing is filtered zero-phase.
    pub other: Option<Track>,
    /// Delay of the effort, where it was identified.
    pub lag: Option<Lag>,
    /// Suspected defects of the recording.
    pub warnings: Vec<Warning>,
    /// SHA-256 over the bytes of the description, of the files in the order listed and of the table of runs.
    pub sha256: [u8; 32],
}

impl Prepared {
    /// The samples on the other motion, and its name: as the joint's observer sees it, or without delay.
    pub fn on_other_motion(&self) -> Option<(&'static str, Samples)> {
        let Track { position, velocity } = self.other.clone()?;
        let name = if self.description.filter.causal_motion { "zero-phase motion" } else { "joint's observer" };
        Some((name, Samples { position, velocity, bent: vec![], ..self.samples.clone() }))
    }
}

/// One continuous recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Text of the run column, or the file's name.
    pub label: String,
    /// The file, as listed in the description.
    pub file: String,
    /// Sampling period after decimation, s.
    pub period: f64,
}

/// Note on what a stage did, for the report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Stage of the preparation.
    pub stage: &'static str,
    /// Number of things it was done to.
    pub count: usize,
    /// Treatment, to follow the number.
    pub what: &'static str,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} {}", self.stage, self.count, self.what)
    }
}

/// Prepares the data set that the TOML file at `path` describes, with the environment of this process.
pub fn prepare(path: &Path) -> Result<Prepared, DatasetError> {
    prepare_with(path, &|name| std::env::var(name).ok())
}

/// Prepares as [`prepare`], with the description changed by `change` after it was read.
pub fn prepare_as(path: &Path, change: impl FnOnce(&mut Description)) -> Result<Prepared, DatasetError> {
    prepare_changed(path, &|name| std::env::var(name).ok(), change)
}

/// Prepares the data set that the TOML file at `path` describes; `environment` gives the variables in `source.root`.
pub fn prepare_with(path: &Path, environment: Environment) -> Result<Prepared, DatasetError> {
    prepare_changed(path, environment, |_| ())
}

fn prepare_changed(
    path: &Path,
    environment: Environment,
    change: impl FnOnce(&mut Description),
) -> Result<Prepared, DatasetError> {
    let text =
        std::fs::read_to_string(path).map_err(|source| DatasetError::Unreadable { file: path.to_owned(), source })?;
    prepare_text(&text, path, environment, change)
}

/// Prepares as [`prepare_with`], from a description's text; what it names is relative to `path`.
pub fn prepare_text(
    text: &str,
    path: &Path,
    environment: Environment,
    change: impl FnOnce(&mut Description),
) -> Result<Prepared, DatasetError> {
    let mut description = validate::parse(text, path)?;
    change(&mut description);
    let recordings = Recordings::load(&description, path, text, environment)?;
    let layout = Layout::of(&description, uses_velocity_column(&description));
    let extracted = extract(&recordings, &description, layout)?;
    let (treated, repairs) = motions(&recordings, &extracted, &description, layout)?;
    let assembled = assemble(&treated, &recordings, &extracted, &description);
    drop(treated);
    let Assembled { mut samples, seen, row, parent, usable, recordings: continuous, slow } = assembled;
    let mut warnings = checks::columns::check(&recordings, &extracted, &description, layout)?;

    enough(usable.iter().filter(|usable| **usable).count(), "after cleaning and selection")?;
    let recorded = Recorded { time: &samples.time, run: &parent, usable: &usable };
    let matches = |rule: &Rule| -> Vec<bool> {
        let table = static_match(rule, &recordings, &description);
        row.iter().map(|&row| table[row]).collect()
    };
    let assignment = split(&description.split, recorded, matches).map_err(|empty| DatasetError::EmptyPart {
        part: empty.part,
        usable: usable.iter().filter(|usable| **usable).count(),
        hint: "compare [split] with the files, runs and columns of the recordings".to_owned(),
    })?;
    samples.part = assignment.part;
    warnings.extend(assignment.empty.iter().map(|name| empty_test_set(name)));
    let rigid = rigid_model(&description.rigid);
    let lag = match (description.filter.effort_lag, description.filter.lag_limit) {
        (None, limit) if limit > 0.0 => lag::identify(&samples, &rigid, &parent, period(&continuous), limit),
        _ => None,
    };
    if let Some(found) = lag.filter(Lag::applies) {
        description.filter.effort_lag = Some(found.lag);
        let (moved, _) = motions(&recordings, &extracted, &description, layout)?;
        samples.effort = moved.into_iter().flat_map(|(_, motion)| motion.effort).collect();
    }
    warnings.extend(lag.filter(|lag| lag.beyond && lag.significant()).map(|lag| lag_warning(&lag, &description)));
    let label = |run: u32| recordings.runs[run as usize].label.clone();
    warnings.extend(checks::model::check(&samples, &rigid, &description, &parent, &label)?);
    in_range(&samples, &continuous, &description)?;
    let labels = labels(&recordings, &row);
    let folds = grouping::find(&samples, &continuous, &labels, &description.choice.group_by)?;
    drop(labels);
    let thresholds = Thresholds::of(&samples, &description.classify);
    classify(&mut samples, thresholds);
    let notes = notes(&recordings, &extracted.findings, repairs, slow, &samples, continuous.len());
    let other = match description.filter.causal_motion {
        true => seen.map(|seen| Track {
            position: std::mem::replace(&mut samples.position, seen.position),
            velocity: std::mem::replace(&mut samples.velocity, seen.velocity),
        }),
        false => seen,
    };
    Ok(Prepared {
        description,
        samples,
        other,
        lag,
        warnings,
        recordings: continuous,
        folds,
        test_sets: assignment.test_sets,
        thresholds,
        notes,
        sha256: recordings.sha256,
    })
}

/// The middle one of the sampling periods, s.
fn period(continuous: &[Recording]) -> f64 {
    let mut periods: Vec<f64> = continuous.iter().map(|recording| recording.period).collect();
    periods.sort_by(f64::total_cmp);
    periods.get(periods.len() / 2).copied().unwrap_or(1.0)
}

fn empty_test_set(name: &str) -> Warning {
    Warning {
        check: "split",
        column: format!("split.test {name:?}"),
        rows: "no row".to_owned(),
        finding: "no usable sample belongs to it; it is skipped".to_owned(),
        remedy: "compare it with the files, runs and columns of the recordings".to_owned(),
    }
}

fn lag_warning(lag: &Lag, description: &Description) -> Warning {
    Warning {
        check: "lag",
        column: format!("effort ({:?})", description.columns.effort.factors().join(" x ")),
        rows: "training rows".to_owned(),
        finding: format!(
            "it fits the position best when moved by {:.1} ms or more, limit {:.1} ms; it is not moved",
            1e3 * lag.lag,
            1e3 * lag.limit
        ),
        remedy:
            "check the clocks of both signals; filter.lag_limit widens the search, filter.effort_lag sets a known delay"
                .to_owned(),
    }
}

fn uses_velocity_column(description: &Description) -> bool {
    description.columns.velocity.is_some() && description.differentiate.velocity_from != Some(VelocityFrom::Position)
}

fn enough(found: usize, stage: &'static str) -> Result<(), DatasetError> {
    match found {
        0..MINIMUM_SAMPLES => Err(DatasetError::TooFewSamples { stage, found, required: MINIMUM_SAMPLES }),
        _ => Ok(()),
    }
}

/// The motions of every continuous recording, with the index of its run in `Extracted::runs`.
fn motions(
    recordings: &Recordings,
    extracted: &Extracted,
    description: &Description,
    layout: Layout,
) -> Result<(Vec<(usize, Motion)>, Repairs), DatasetError> {
    let minimum = minimum_samples(description);
    let mut total = Repairs::default();
    let mut motions = Vec::new();
    let mut spans = vec![(f64::INFINITY, f64::NEG_INFINITY); 4];
    let mut rows = 0;
    for (index, run) in extracted.runs.iter().enumerate() {
        let (found, repairs) = stretches(&run.raw, &description.clean, minimum);
        total.bridged += repairs.bridged;
        total.gaps += repairs.gaps;
        total.too_short += repairs.too_short;
        total.resampled += repairs.resampled;
        let last_time = run.raw.time.last().copied().unwrap_or(0.0);
        for stretch in found {
            for (span, signal) in spans.iter_mut().zip(&stretch.signals) {
                *span = signal.iter().fold(*span, |(low, high), &x| (low.min(x), high.max(x)));
            }
            rows += stretch.time.len();
            let label = &recordings.runs[run.run].label;
            if let Some(motion) = treat(stretch, description, layout, label, last_time)? {
                motions.push((index, motion));
            }
        }
    }
    enough(rows, "after cleaning")?;
    varies(&spans, rows, description, layout)?;
    Ok((motions, total))
}

fn varies(spans: &[(f64, f64)], count: usize, d: &Description, layout: Layout) -> Result<(), DatasetError> {
    let velocity = layout.velocity.map(|at| ("velocity", at));
    for (signal, at) in [("position", Layout::POSITION), ("effort", Layout::EFFORT)].into_iter().chain(velocity) {
        let (low, high) = spans[at];
        if low == high {
            return Err(DatasetError::Constant { signal, column: column_of(signal, d), value: low, count });
        }
    }
    Ok(())
}

/// The column or columns behind a signal, for errors.
fn column_of(signal: &str, description: &Description) -> String {
    let columns = &description.columns;
    let velocity = columns.velocity.as_ref().filter(|_| uses_velocity_column(description)).map(|c| &c.column);
    match signal {
        "effort" => columns.effort.factors().join(" x "),
        "temperature" => columns.temperature.as_ref().map_or(String::new(), |c| c.column.clone()),
        "velocity" | "acceleration" => velocity.unwrap_or(&columns.position.column).clone(),
        _ => columns.position.column.clone(),
    }
}

/// All motions one after the other.
struct Assembled {
    samples: Samples,
    /// Position and velocity as the joint's observer sees them.
    seen: Option<Track>,
    /// Row of the table for each sample.
    row: Vec<usize>,
    /// Run of each sample as recorded (gaps do not count).
    parent: Vec<u32>,
    usable: Vec<bool>,
    recordings: Vec<Recording>,
    /// Samples that are unused for their speed.
    slow: usize,
}

fn assemble(
    motions: &[(usize, Motion)],
    recordings: &Recordings,
    extracted: &Extracted,
    description: &Description,
) -> Assembled {
    let mut samples = Samples::default();
    let (mut row, mut parent, mut continuous) = (Vec::new(), Vec::new(), Vec::new());
    let mut seen = Track::default();
    for (number, (index, motion)) in motions.iter().enumerate() {
        let run = &extracted.runs[*index];
        let recorded = &recordings.runs[run.run];
        let count = motion.time.len();
        samples.time.extend(&motion.time);
        samples.position.extend(&motion.position);
        samples.velocity.extend(&motion.velocity);
        samples.acceleration.extend(&motion.acceleration);
        samples.effort.extend(&motion.effort);
        if let Some(observed) = &motion.seen {
            seen.position.extend(&observed.position);
            seen.velocity.extend(&observed.velocity);
        }
        match &motion.temperature {
            Some(temperature) => samples.temperature.extend(temperature),
            None => samples.temperature.resize(samples.time.len(), description.reference_temperature),
        }
        samples.run.resize(samples.time.len(), number as u32);
        row.extend(motion.row.iter().map(|&row| run.rows[row]));
        parent.extend(std::iter::repeat_n(run.run as u32, count));
        continuous.push(Recording {
            label: recorded.label.clone(),
            file: description.source.files[recorded.file].clone(),
            period: motion.period,
        });
    }
    for (name, column) in &description.columns.extra {
        if let Some(values) = recordings.table.numbers.get(column) {
            samples.extra.insert(name.clone(), row.iter().map(|&row| values[row]).collect());
        }
    }
    let mut slow = 0;
    let mut usable: Vec<bool> = row.iter().map(|&row| extracted.used[row]).collect();
    for (usable, velocity) in usable.iter_mut().zip(&samples.velocity) {
        if *usable && velocity.abs() < description.select.minimum_speed {
            *usable = false;
            slow += 1;
        }
    }
    samples.part = vec![Part::Unused; samples.time.len()];
    samples.state = vec![MotionState::default(); samples.time.len()];
    let seen = (!seen.position.is_empty()).then_some(seen);
    Assembled { samples, seen, row, parent, usable, recordings: continuous, slow }
}

/// Flag of each row of the table for which the tests of a rule on files, runs and columns hold.
fn static_match(rule: &Rule, recordings: &Recordings, description: &Description) -> Vec<bool> {
    let mut mask = all_hold(&rule.conditions, &recordings.table);
    if !rule.unless.is_empty() {
        let unless = all_hold(&rule.unless, &recordings.table);
        mask.iter_mut().zip(unless).for_each(|(mask, unless)| *mask &= !unless);
    }
    for run in &recordings.runs {
        let file = &description.source.files[run.file];
        let matches = rule.files.as_ref().is_none_or(|files| files.contains(file))
            && rule.runs.as_ref().is_none_or(|runs| runs.iter().any(|value| value.text() == run.label));
        if !matches {
            run.rows.iter().for_each(|&row| mask[row] = false);
        }
    }
    mask
}

/// The texts that may tell motions apart, sample by sample.
fn labels(recordings: &Recordings, row: &[usize]) -> Vec<Labels> {
    let columns = recordings.conditions.iter().filter_map(|name| Some((name, recordings.table.texts.get(name)?)));
    let labels = columns.map(|(name, column)| Labels {
        column: name.clone(),
        words: column.words.clone(),
        codes: row.iter().map(|&row| column.codes[row]).collect(),
    });
    labels.collect()
}

fn in_range(samples: &Samples, runs: &[Recording], description: &Description) -> Result<(), DatasetError> {
    let signals: [(&'static str, &[f64]); 5] = [
        ("position", &samples.position),
        ("velocity", &samples.velocity),
        ("acceleration", &samples.acceleration),
        ("effort", &samples.effort),
        ("temperature", &samples.temperature),
    ];
    for (signal, values) in signals {
        let used = (0..values.len()).filter(|&i| samples.part[i] != Part::Unused);
        if let Some(i) = used.max_by(|&a, &b| values[a].abs().total_cmp(&values[b].abs()))
            && (values[i].is_nan() || values[i].abs() > SIGNAL_LIMIT)
        {
            return Err(DatasetError::OutOfRange {
                signal,
                column: column_of(signal, description),
                run: runs[samples.run[i] as usize].label.clone(),
                time: samples.time[i],
                value: values[i],
                limit: SIGNAL_LIMIT,
            });
        }
    }
    Ok(())
}

fn notes(
    recordings: &Recordings,
    findings: &Findings,
    repairs: Repairs,
    slow: usize,
    samples: &Samples,
    continuous: usize,
) -> Vec<Note> {
    let part = |part: Part| samples.part.iter().filter(|&&p| p == part).count();
    let always = [("load", recordings.table.len(), "rows read"), ("load", recordings.runs.len(), "runs")];
    let where_any = [
        ("select", findings.left_out, "rows left out"),
        ("clean", findings.duplicates, "rows with a repeated time left out"),
        ("clean", findings.dropouts, "rows missing by a dropout rule"),
        ("clean", findings.jumps, "rows missing by a single-sample jump"),
        ("clean", findings.steadied, "values replaced by their run's median"),
        ("clean", findings.frozen, "rows unused around a frozen read-out"),
        ("clean", findings.saturated, "rows unused in saturation"),
        ("clean", repairs.bridged, "missing rows bridged by interpolation"),
        ("clean", repairs.gaps, "gaps that end a continuous recording"),
        ("clean", repairs.too_short, "rows left out in recordings too short to filter"),
        ("clean", repairs.resampled, "samples interpolated onto even times"),
        ("select", slow, "samples unused below the minimum speed"),
    ];
    let result = [
        ("filter", continuous, "continuous recordings"),
        ("filter", samples.len(), "samples"),
        ("split", part(Part::Train), "samples for training"),
        ("split", part(Part::Validation), "samples for validation"),
        ("split", part(Part::Test), "samples for test"),
        ("split", part(Part::Unused), "samples unused"),
    ];
    let where_any = where_any.into_iter().filter(|(_, count, _)| *count > 0);
    let all = always.into_iter().chain(where_any).chain(result);
    all.map(|(stage, count, what)| Note { stage, count, what }).collect()
}
