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
    /// Nearest good row of the run for each sample.
    pub row: Vec<usize>,
}

/// Repairs of a run.
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

/// Flag of each row that belongs to a frozen read-out: good rows that repeat one value before a step larger than `step`
/// a row, with `margin` rows before them and `margin` rows after the first one behind the step.
pub fn frozen(values: &[f64], missing: &[bool], step: f64, margin: usize) -> Vec<bool> {
    let mut unused = vec![false; values.len()];
    let good: Vec<usize> = (0..values.len()).filter(|&i| !missing[i]).collect();
    for at in 1..good.len() {
        let rows = (good[at] - good[at - 1]) as f64;
        if (values[good[at]] - values[good[at - 1]]).abs() <= step * rows {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn run(time: &[f64], signal: &[f64], missing: &[usize]) -> RawRun {
        let missing = (0..time.len()).map(|i| missing.contains(&i)).collect();
        RawRun { time: time.to_vec(), signals: vec![signal.to_vec()], missing }
    }

    fn even(count: usize) -> Vec<f64> {
        (0..count).map(|i| i as f64 * 0.01).collect()
    }

    #[test]
    fn a_spike_is_found_and_neither_a_slope_nor_its_ends_nor_its_neighbours_are() {
        let mut values: Vec<f64> = (0..20).map(|i| 0.1 * f64::from(i)).collect();
        let none = vec![false; 20];
        assert!(spikes(&values, &none, 0.5, None).is_empty());
        for at in [0, 1, 7, 18, 19] {
            let right = values[at];
            values[at] = -9.0;
            assert_eq!(spikes(&values, &none, 0.5, None), [at]);
            values[at] = right;
        }
    }

    #[test]
    fn the_edge_of_a_wrapping_angle_is_no_spike_and_unwraps_to_a_straight_line() {
        let straight: Vec<f64> = (0..60).map(|i| 0.7 * f64::from(i)).collect();
        let mut wrapped: Vec<f64> = straight.iter().map(|x| (x + 12.5).rem_euclid(25.0) - 12.5).collect();
        let mut missing = vec![false; 60];
        assert!(spikes(&wrapped, &missing, 2.0, Some(25.0)).is_empty());
        missing[20] = true;
        wrapped[20] = 7.77;
        unwrap(&mut wrapped, &missing, 25.0);
        for i in (0..60).filter(|&i| i != 20) {
            assert!((wrapped[i] - straight[i]).abs() < 1e-9, "{i}");
        }
    }

    #[test]
    fn a_steady_column_takes_the_median_where_it_is_misread() {
        let mut values = vec![12.1, 12.0, 0.0, 22.6, 12.2, 99.0];
        let missing = [false, false, false, false, false, true];
        assert_eq!(steady(&mut values, &missing, 1.2), 2);
        assert_eq!(values, [12.1, 12.0, 12.1, 12.1, 12.2, 99.0]);
    }

    #[test]
    fn a_frozen_read_out_is_unused_from_before_it_repeats_until_after_it_steps() {
        let mut values: Vec<f64> = (0..40).map(|i| 0.05 * f64::from(i)).collect();
        values[10..20].fill(0.5);
        let unused = frozen(&values, &[false; 40], 0.2, 3);
        let expected: Vec<usize> = (7..=23).collect();
        assert_eq!((0..40).filter(|&i| unused[i]).collect::<Vec<_>>(), expected);
    }

    #[test]
    fn a_fast_motion_across_missing_rows_is_not_a_step() {
        let values: Vec<f64> = (0..40).map(|i| 0.15 * f64::from(i)).collect();
        let mut missing = [false; 40];
        missing[20..23].fill(true);
        assert!(!frozen(&values, &missing, 0.2, 3).contains(&true));
    }

    #[test]
    fn a_short_gap_is_bridged_on_a_straight_line() {
        let mut signal: Vec<f64> = (0..50).map(f64::from).collect();
        signal[20..23].fill(f64::NAN);
        let (found, repairs) = stretches(&run(&even(50), &signal, &[20, 21, 22]), &Clean::default(), 3);
        assert_eq!(found.len(), 1);
        assert_eq!(repairs, Repairs { bridged: 3, ..Repairs::default() });
        for (i, x) in found[0].signals[0].iter().enumerate() {
            assert!((x - i as f64).abs() < 1e-9);
        }
    }

    #[test]
    fn a_long_gap_ends_a_recording_and_short_pieces_are_left_out() {
        let missing: Vec<usize> = (10..30).collect();
        let signal = vec![1.0; 50];
        let (found, repairs) = stretches(&run(&even(50), &signal, &missing), &Clean::default(), 15);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].row, (30..50).collect::<Vec<_>>());
        assert_eq!(repairs, Repairs { gaps: 1, too_short: 10, ..Repairs::default() });
    }

    #[test]
    fn uneven_times_are_interpolated_onto_even_ones_with_the_nearest_row_beside() {
        let time: Vec<f64> = (0..50).map(|i| f64::from(i) * 0.011 + if i % 2 == 1 { 0.001 } else { 0.0 }).collect();
        let signal: Vec<f64> = time.iter().map(|t| 3.0 * t).collect();
        let options = Clean { sample_period: Some(0.01), ..Clean::default() };
        let (found, repairs) = stretches(&run(&time, &signal, &[]), &options, 3);
        let stretch = &found[0];
        assert_eq!(repairs.resampled, stretch.time.len());
        for (i, (&t, &x)) in stretch.time.iter().zip(&stretch.signals[0]).enumerate() {
            assert!((t - 0.01 * i as f64).abs() < 1e-12 && (x - 3.0 * t).abs() < 1e-12);
            assert!((time[stretch.row[i]] - t).abs() <= 0.006 + 1e-12);
        }
    }

    #[test]
    fn resampling_can_be_refused() {
        let time: Vec<f64> = (0..50).map(|i| f64::from(i) * 0.01 + if i % 2 == 1 { 0.002 } else { 0.0 }).collect();
        let options = Clean { resample: Resample::Never, ..Clean::default() };
        let (found, repairs) = stretches(&run(&time, &time, &[]), &options, 3);
        assert_eq!((found[0].time.clone(), repairs.resampled), (time, 0));
    }

    #[test]
    fn a_single_row_makes_no_recording() {
        let (found, repairs) = stretches(&run(&[0.0], &[1.0], &[]), &Clean::default(), 3);
        assert!(found.is_empty());
        assert_eq!(repairs.too_short, 1);
    }
}
