//! One continuous recording through filters, differentiation, trimming and decimation; host.
//!
//! The order is fixed: lag, low-pass, velocity, acceleration, the observer's view, trimming, decimation. Trimming comes
//! after the filters, so that it
//! can remove what they do at the ends, and before decimation, as in the EMPS benchmark's protocol.

use super::description::Description;
use super::error::DatasetError;
use super::observed::observe;
use super::signals::Layout;
use super::treatment::{Keep, LowPass};
use crate::clean::Stretch;
use crate::differentiate::central_difference;
use crate::filter::{FilterError, LowPassFilter, advance};
use crate::samples::Track;

/// Filter before decimation: that of the `decimate` of MATLAB and SciPy.
const ANTI_ALIAS_ORDER: usize = 8;
const ANTI_ALIAS_RIPPLE: f64 = 0.05;
const ANTI_ALIAS_CUTOFF: f64 = 0.8;

/// The filtered signals of one continuous recording, evenly spaced.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Sampling period, s.
    pub period: f64,
    /// Time since the start of the run, s.
    pub time: Vec<f64>,
    /// Position.
    pub position: Vec<f64>,
    /// Velocity.
    pub velocity: Vec<f64>,
    /// Position and velocity as the joint's observer sees them; none where the filters are causal themselves.
    pub seen: Option<Track>,
    /// Acceleration.
    pub acceleration: Vec<f64>,
    /// Effort.
    pub effort: Vec<f64>,
    /// Temperature, where recorded.
    pub temperature: Option<Vec<f64>>,
    /// Nearest row of the run for each sample.
    pub row: Vec<usize>,
}

/// Fewest samples that a stretch needs: those of `clean.minimum_run` or of the longest filter.
pub fn minimum_samples(description: &Description) -> usize {
    let filter = &description.filter;
    let low_passes = [&filter.position, &filter.velocity, &filter.acceleration, &filter.effort, &filter.temperature];
    // The number of samples depends on the order alone, so any cut-off serves here.
    let orders = low_passes.into_iter().flatten().filter(|_| filter.zero_phase).map(|low_pass| low_pass.order);
    let longest = orders
        .filter_map(|order| LowPassFilter::butterworth(order, 0.5).ok())
        .map(|filter| filter.minimum_samples())
        .max();
    description.clean.minimum_run.max(longest.unwrap_or(0)).max(minimum_for_decimation(description))
}

fn minimum_for_decimation(description: &Description) -> usize {
    match &description.filter.decimate {
        Some(decimate) if decimate.anti_alias => 3 * (ANTI_ALIAS_ORDER + 1) + 1,
        _ => 1,
    }
}

/// Filters, differentiates, trims and decimates one stretch. `last_time` is the time of the run's last row, s.
///
/// `Ok(None)` where trimming leaves too little.
pub fn treat(
    stretch: Stretch,
    description: &Description,
    layout: Layout,
    run: &str,
    last_time: f64,
) -> Result<Option<Motion>, DatasetError> {
    let Stretch { period, time, signals, row } = stretch;
    let filter = &description.filter;
    let low_pass = |signal: &'static str, setting: &Option<LowPass>, values: &[f64]| match setting {
        Some(setting) => apply(setting, values, period, filter.zero_phase, signal, run),
        None => Ok(values.to_vec()),
    };
    let position = low_pass("position", &filter.position, &signals[Layout::POSITION])?;
    let effort = &signals[Layout::EFFORT];
    let effort = match filter.effort_lag {
        None | Some(0.0) => low_pass("effort", &filter.effort, effort)?,
        Some(lag) => low_pass("effort", &filter.effort, &advance(effort, lag / period))?,
    };
    let velocity = match layout.velocity {
        Some(column) => low_pass("velocity", &filter.velocity, &signals[column])?,
        None => low_pass("velocity", &filter.velocity, &central_difference(&position, period))?,
    };
    let acceleration = low_pass("acceleration", &filter.acceleration, &central_difference(&velocity, period))?;
    let seen = match filter.zero_phase {
        true => Some(seen(&signals, description, layout, run, period)?),
        false => None,
    };
    let temperature = match layout.temperature {
        Some(column) => Some(low_pass("temperature", &filter.temperature, &signals[column])?),
        None => None,
    };
    let mut motion = Motion { period, time, position, velocity, seen, acceleration, effort, temperature, row };
    trim(&mut motion, description, last_time);
    if motion.time.len() < minimum_for_decimation(description) {
        return Ok(None);
    }
    decimate(&mut motion, description, run)?;
    Ok(Some(motion))
}

/// Position and velocity by the joint's observer: from the recorded position, the velocity from a recorded one where
/// that is used.
fn seen(
    signals: &[Vec<f64>],
    description: &Description,
    layout: Layout,
    run: &str,
    period: f64,
) -> Result<Track, DatasetError> {
    let bandwidth_hz = description.filter.observer_hz;
    let refused = |error| DatasetError::Observer { run: run.to_owned(), bandwidth_hz, error };
    let mut seen = observe(&signals[Layout::POSITION], period, bandwidth_hz).map_err(refused)?;
    if let Some(column) = layout.velocity {
        let mut way = 0.0;
        let ways: Vec<f64> = signals[column]
            .iter()
            .map(|velocity| {
                way += velocity * period;
                way
            })
            .collect();
        seen.velocity = observe(&ways, period, bandwidth_hz).map_err(refused)?.velocity;
    }
    Ok(seen)
}

fn apply(
    setting: &LowPass,
    values: &[f64],
    period: f64,
    zero_phase: bool,
    signal: &'static str,
    run: &str,
) -> Result<Vec<f64>, DatasetError> {
    let nyquist_hz = 0.5 / period;
    let fraction = match (setting.cutoff_hz, setting.cutoff_nyquist) {
        (Some(hertz), _) => hertz / nyquist_hz,
        (None, fraction) => fraction.unwrap_or(f64::NAN),
    };
    let located = |error| located(error, signal, run, nyquist_hz);
    let filter = LowPassFilter::butterworth(setting.order, fraction).map_err(located)?;
    if zero_phase { filter.zero_phase(values).map_err(located) } else { Ok(filter.causal(values)) }
}

fn located(error: FilterError, signal: &'static str, run: &str, nyquist_hz: f64) -> DatasetError {
    let run = run.to_owned();
    match error {
        FilterError::Cutoff(fraction) => {
            DatasetError::Cutoff { signal, run, cutoff_hz: fraction * nyquist_hz, nyquist_hz }
        }
        error => DatasetError::Filter { signal, run, error },
    }
}

fn trim(motion: &mut Motion, description: &Description, last_time: f64) {
    // Times are sums of periods: without the tolerance, rounding would decide about the sample on the border.
    let tolerance = 1e-6 * motion.period;
    let select = &description.select;
    let [mut first, mut last] = select.time.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
    first = first.max(select.trim_start) - tolerance;
    last = last.min(last_time - select.trim_end) + tolerance;
    let begin = motion.time.partition_point(|&time| time < first);
    let end = motion.time.partition_point(|&time| time <= last).max(begin);
    for_each_column(motion, |values| *values = values[begin..end].to_vec());
    motion.row = motion.row[begin..end].to_vec();
}

fn for_each_column(motion: &mut Motion, operation: impl Fn(&mut Vec<f64>)) {
    let Motion { time, position, velocity, seen, acceleration, effort, temperature, .. } = motion;
    let seen = seen.iter_mut().flat_map(|Track { position, velocity }| [position, velocity]);
    let columns = [time, position, velocity, acceleration, effort].into_iter().chain(temperature).chain(seen);
    columns.for_each(operation);
}

fn decimate(motion: &mut Motion, description: &Description, run: &str) -> Result<(), DatasetError> {
    let Some(setting) = &description.filter.decimate else { return Ok(()) };
    if setting.factor == 1 {
        return Ok(());
    }
    if setting.anti_alias {
        let cutoff = ANTI_ALIAS_CUTOFF / setting.factor as f64;
        let nyquist_hz = 0.5 / motion.period;
        let located = |error| located(error, "decimate", run, nyquist_hz);
        let filter = LowPassFilter::chebyshev(ANTI_ALIAS_ORDER, ANTI_ALIAS_RIPPLE, cutoff).map_err(located)?;
        let Motion { position, velocity, acceleration, effort, temperature, .. } = &mut *motion;
        // A joint has no decimation, so a motion as it sees it is only thinned.
        for column in [position, velocity, acceleration, effort].into_iter().chain(temperature) {
            *column = filter.zero_phase(column).map_err(located)?;
        }
    }
    let skip = match setting.keep {
        Keep::First => 0,
        Keep::Last => (motion.time.len() + setting.factor - 1) % setting.factor,
    };
    let thin = |values: &mut Vec<f64>| *values = values.iter().skip(skip).step_by(setting.factor).copied().collect();
    for_each_column(motion, thin);
    motion.row = motion.row.iter().skip(skip).step_by(setting.factor).copied().collect();
    motion.period *= setting.factor as f64;
    Ok(())
}
