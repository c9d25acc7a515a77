//! Repair of a recording: outliers, frozen read-outs, wrapped angles, gaps, uneven sampling; pure functions; host.
//!
//! A row is either good or missing. Missing rows are bridged by linear interpolation where the time between the good
//! rows on both sides is short, and end the continuous recording where it is long.

use crate::dataset::treatment::{Clean, Resample};

/// Longest bridged time in sampling periods, when the description does not say: less than five missing rows leave a
/// low-passed signal almost untouched.
const MAX_GAP_PERIODS: f64 = 5.5;
/// Deviation of a period from the sampling period beyond which rows count as unevenly spaced.
const JITTER: f64 = 0.02;

/// One run as recorded: signals in SI units, one value a row.
#[derive(Clone, Debug, Default)]
pub struct RawRun {
    /// Time since the first row, s, increasing.
    pub time: Vec<f64>,
    /// The signals, in any order; each as long as `time`.
    pub signals: Vec<Vec<f64>>,
    /// Rows that are missing.
    pub missing: Vec<bool>,
}

/// A continuous, evenly spaced recording without missing rows.
#[derive(Clone, Debug)]
pub struct Stretch {
    /// Sampling period, s.
    pub period: f64,
    /// Time since the first row of the run, s.
    pub time: Vec<f64>,
    /// The signals, in the order of the raw run.
    pub signals: Vec<Vec<f64>>,
    /// For each sample the nearest good row of the run.
    pub row: Vec<usize>,
}

/// What was done to a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Repairs {
    /// Missing rows that were bridged.
    pub bridged: usize,
    /// Places where a gap ended a continuous recording.
    pub gaps: usize,
    /// Good rows that were left out because their continuous recording is too short.
    pub too_short: usize,
    /// Samples on interpolated times.
    pub resampled: usize,
}

/// Good rows that lie farther than `limit` from the median of the four nearest good rows.
///
/// `wrap` is the period of a wrapping angle; distances are then taken the short way round.
pub fn spikes(values: &[f64], missing: &[bool], limit: f64, wrap: Option<f64>) -> Vec<usize> {
    let good: Vec<usize> = (0..values.len()).filter(|&i| !missing[i]).collect();
    let mut distances: Vec<f64> = Vec::with_capacity(4);
    let mut found = Vec::new();
    for (at, &row) in good.iter().enumerate() {
        let first = at.saturating_sub(2).min(good.len().saturating_sub(5));
        distances.clear();
        distances.extend(
            good[first..good.len().min(first + 5)]
                .iter()
                .filter(|&&other| other != row)
                .map(|&other| shortest(values[row] - values[other], wrap)),
        );
        if median(&mut distances).is_some_and(|distance| distance.abs() > limit) {
            found.push(row);
        }
    }
    found
}

/// Replaces values farther than `limit` from the median of the good rows by that median; returns how many.
pub fn steady(values: &mut [f64], missing: &[bool], limit: f64) -> usize {
    let mut good: Vec<f64> = values.iter().zip(missing).filter(|(_, missing)| !**missing).map(|(x, _)| *x).collect();
    let Some(median) = median(&mut good) else { return 0 };
    let mut replaced = 0;
    for (value, _) in values.iter_mut().zip(missing).filter(|(_, missing)| !**missing) {
        if (*value - median).abs() > limit {
            *value = median;
            replaced += 1;
        }
    }
    replaced
}

/// For each row whether it belongs to a frozen read-out: good rows that repeat one value before a step larger than
/// `step`, with `margin` rows before them and `margin` rows after the first one behind the step.
pub fn frozen(values: &[f64], missing: &[bool], step: f64, margin: usize) -> Vec<bool> {
    let mut unused = vec![false; values.len()];
    let good: Vec<usize> = (0..values.len()).filter(|&i| !missing[i]).collect();
    for at in 1..good.len() {
        if (values[good[at]] - values[good[at - 1]]).abs() <= step {
            continue;
        }
        let repeats = (1..at).rev().take_while(|&k| values[good[k]] == values[good[k - 1]]).count();
        let first = good[at - 1 - repeats].saturating_sub(margin);
        let last = (good[at] + margin).min(values.len() - 1);
        unused[first..=last].fill(true);
    }
    unused
}

/// Makes a wrapping angle continuous over the good rows, assuming less than half a period between two of them.
pub fn unwrap(values: &mut [f64], missing: &[bool], period: f64) {
    let mut last: Option<f64> = None;
    for (value, _) in values.iter_mut().zip(missing).filter(|(_, missing)| !**missing) {
        if let Some(last) = last {
            *value = last + shortest(*value - last, Some(period));
        }
        last = Some(*value);
    }
}

/// The median sampling period of a run, s; `None` with fewer than two rows.
pub fn median_period(time: &[f64]) -> Option<f64> {
    median(&mut time.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>())
}

/// Cuts a run at its gaps, bridges what is missing and spaces the rows evenly.
///
/// Stretches of fewer than `minimum` samples are left out.
pub fn stretches(raw: &RawRun, options: &Clean, minimum: usize) -> (Vec<Stretch>, Repairs) {
    let mut repairs = Repairs::default();
    let good: Vec<usize> = (0..raw.time.len()).filter(|&i| !raw.missing[i]).collect();
    let Some(period) = options.sample_period.or_else(|| median_period(&raw.time)) else {
        repairs.too_short = good.len();
        return (Vec::new(), repairs);
    };
    let max_gap = options.max_gap.unwrap_or(MAX_GAP_PERIODS * period);
    let mut found = Vec::new();
    for rows in good.chunk_by(|&a, &b| raw.time[b] - raw.time[a] <= max_gap) {
        repairs.gaps += 1;
        let stretch = stretch(raw, rows, period, options.resample, &mut repairs);
        if stretch.time.len() < minimum {
            repairs.too_short += rows.len();
        } else {
            found.push(stretch);
        }
    }
    repairs.gaps = repairs.gaps.saturating_sub(1);
    (found, repairs)
}

/// One continuous recording from the good `rows`.
fn stretch(raw: &RawRun, rows: &[usize], period: f64, resample: Resample, repairs: &mut Repairs) -> Stretch {
    let (first, last) = (rows[0], rows[rows.len() - 1]);
    let recorded = &raw.time[first..=last];
    let uneven = recorded.windows(2).any(|pair| (pair[1] - pair[0] - period).abs() > JITTER * period);
    let onto_grid = match resample {
        Resample::Always => true,
        Resample::Auto => uneven,
        Resample::Never => false,
    };
    let bridged = recorded.len() - rows.len();
    repairs.bridged += bridged;
    let time: Vec<f64> = if onto_grid {
        let count = ((raw.time[last] - raw.time[first]) / period + 1e-6).floor() as usize + 1;
        (0..count).map(|i| raw.time[first] + i as f64 * period).collect()
    } else {
        recorded.to_vec()
    };
    if onto_grid {
        repairs.resampled += time.len();
    }
    if !onto_grid && bridged == 0 {
        let signals = raw.signals.iter().map(|signal| signal[first..=last].to_vec()).collect();
        return Stretch { period, time, signals, row: rows.to_vec() };
    }
    let mut signals: Vec<Vec<f64>> = raw.signals.iter().map(|_| Vec::with_capacity(time.len())).collect();
    let mut row = Vec::with_capacity(time.len());
    let mut at = 0;
    for &t in &time {
        while at + 2 < rows.len() && raw.time[rows[at + 1]] <= t {
            at += 1;
        }
        let (before, after) = (rows[at], rows[(at + 1).min(rows.len() - 1)]);
        let span = raw.time[after] - raw.time[before];
        let fraction = if span > 0.0 { ((t - raw.time[before]) / span).clamp(0.0, 1.0) } else { 0.0 };
        for (out, signal) in signals.iter_mut().zip(&raw.signals) {
            out.push(signal[before] + fraction * (signal[after] - signal[before]));
        }
        row.push(if fraction < 0.5 { before } else { after });
    }
    Stretch { period, time, signals, row }
}

/// `difference` reduced to plus or minus half a period.
fn shortest(difference: f64, period: Option<f64>) -> f64 {
    match period {
        Some(period) => difference - period * (difference / period).round(),
        None => difference,
    }
}

/// The median, the mean of the two middle values where their number is even. Sorts its argument.
fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    values.sort_unstable_by(f64::total_cmp);
    Some(if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) })
}
