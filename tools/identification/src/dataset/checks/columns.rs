//! Checks of the raw signals, run by run, before any filter: units, wrapping, stuck values, clipping, sampling; host.

use crate::dataset::description::Description;
use crate::dataset::error::DatasetError;
use crate::dataset::recordings::Recordings;
use crate::dataset::signals::{Extracted, Layout, RunSignals};
use crate::dataset::warning::Warning;

/// Time over which the recorded velocity is integrated and compared with the way, s: long against delays of some
/// milliseconds.
const WINDOW: f64 = 0.25;
/// Ratio of velocity to derivative of position that is accepted; its inverse likewise.
const RATIO: f64 = 1.25;
/// Correlation of way and integrated velocity below which they are not of one motion.
const CORRELATION: f64 = 0.8;
/// Windows below which nothing is said about units.
const LEAST_WINDOWS: usize = 20;
/// A step of this share of the whole range from one row to the next is no motion.
const WRAP_SHARE: f64 = 0.8;
/// Rows within which a step that is taken back is an outlier and not a wrap.
const OUTLIER_ROWS: usize = 3;
/// A value that repeats for this time and this many rows is stuck, where the joint moves meanwhile.
const STUCK_TIME: f64 = 0.2;
const STUCK_ROWS: usize = 20;
/// Way, as a share of the position's range, that counts as moving meanwhile.
const STUCK_SHARE: f64 = 0.05;
/// Time before and after a row in which the joint keeps its direction, s, at this share of its greatest speed at least.
const STEADY: f64 = 0.1;
const STEADY_SHARE: f64 = 0.05;
/// Share of such rows whose velocity may be against the motion.
const TREMBLING_SHARE: f64 = 0.005;
/// Rows in a row at the very largest value that count as clipped, and the share of all rows from which it is told.
const CLIPPED_ROWS: usize = 5;
const CLIPPED_SHARE: f64 = 0.005;
/// Sampling periods that a joint's recording can have, s.
const PERIODS: (f64, f64) = (1e-5, 0.1);

/// All checks of the raw signals.
///
/// # Errors
/// A velocity that runs against the position.
pub fn check(
    recordings: &Recordings,
    extracted: &Extracted,
    description: &Description,
    layout: Layout,
) -> Result<Vec<Warning>, DatasetError> {
    let seen = Seen { recordings, extracted, description, layout };
    let mut warnings = Vec::new();
    warnings.extend(seen.sampling());
    warnings.extend(seen.units()?);
    warnings.extend(seen.wrapping());
    warnings.extend(seen.stuck());
    warnings.extend(seen.clipping());
    warnings.extend(seen.trembling());
    Ok(warnings)
}

struct Seen<'a> {
    recordings: &'a Recordings,
    extracted: &'a Extracted,
    description: &'a Description,
    layout: Layout,
}

/// Sums over windows of the way and of the integrated velocity.
#[derive(Default)]
struct Ways {
    windows: usize,
    way: f64,
    both: f64,
    integrated: f64,
}

impl Seen<'_> {
    fn label(&self, run: &RunSignals) -> &str {
        &self.recordings.runs[run.run].label
    }

    fn position_column(&self) -> &str {
        &self.description.columns.position.column
    }

    /// The recorded velocity of a run, scaled, whether the description uses it or not.
    fn velocity(&self, run: &RunSignals) -> Option<Vec<f64>> {
        if let Some(at) = self.layout.velocity {
            return Some(run.raw.signals[at].clone());
        }
        let column = self.description.columns.velocity.as_ref()?;
        let values = self.recordings.table.numbers.get(&column.column)?;
        Some(run.rows.iter().map(|&row| values[row] * column.scale).collect())
    }

    fn sampling(&self) -> Option<Warning> {
        let mut periods: Vec<f64> = Vec::new();
        for run in &self.extracted.runs {
            periods.extend(run.raw.time.windows(2).map(|pair| pair[1] - pair[0]));
        }
        periods.sort_by(f64::total_cmp);
        let median = *periods.get(periods.len() / 2)?;
        let (low, high) = PERIODS;
        (median < low || median > high).then(|| Warning {
            check: "sampling",
            column: format!("time ({:?})", self.description.columns.time.column),
            rows: "all runs".to_owned(),
            finding: format!("the median period is {median:.4e} s, expected {low:.0e} to {high} s"),
            remedy: "give columns.time.scale the factor from the column's unit to seconds".to_owned(),
        })
    }

    fn units(&self) -> Result<Option<Warning>, DatasetError> {
        let Some(column) = &self.description.columns.velocity else { return Ok(None) };
        let mut ways = Ways::default();
        for run in &self.extracted.runs {
            if let Some(velocity) = self.velocity(run) {
                ways.add(&run.raw.time, &run.raw.signals[Layout::POSITION], &velocity, &run.raw.missing);
            }
        }
        if ways.windows < LEAST_WINDOWS || ways.way <= 0.0 || ways.integrated <= 0.0 {
            return Ok(None);
        }
        let ratio = ways.both / ways.way;
        let correlation = ways.both / (ways.way * ways.integrated).sqrt();
        if correlation <= -CORRELATION {
            return Err(DatasetError::VelocitySign {
                position: self.position_column().to_owned(),
                velocity: column.column.clone(),
                correlation,
            });
        }
        let columns = format!("velocity ({:?}) and position ({:?})", column.column, self.position_column());
        let rows = format!("all runs, {} windows of {WINDOW} s", ways.windows);
        let warning = |finding, remedy| Some(Warning { check: "units", column: columns, rows, finding, remedy });
        if correlation < CORRELATION {
            let finding = format!(
                "the integrated velocity and the way are correlated by {correlation:.2} only, expected {CORRELATION} or more"
            );
            return Ok(warning(
                finding,
                "check that both columns are of one joint and one side of the gear".to_owned(),
            ));
        }
        if (1.0 / RATIO..=RATIO).contains(&ratio) {
            return Ok(None);
        }
        let scale = self.description.columns.position.scale;
        let finding = format!(
            "velocity over the derivative of the position is {ratio:.4}, expected 1 within {:.0} %{}",
            100.0 * (RATIO - 1.0),
            named(ratio)
        );
        let remedy = format!(
            "columns.position.scale = {:.6} or columns.velocity.scale = {:.6} makes them agree",
            scale * ratio,
            column.scale / ratio
        );
        Ok(warning(finding, remedy))
    }

    fn range(&self) -> (f64, f64) {
        let mut range = (f64::INFINITY, f64::NEG_INFINITY);
        for run in &self.extracted.runs {
            for (&q, _) in run.raw.signals[Layout::POSITION].iter().zip(&run.raw.missing).filter(|(_, m)| !**m) {
                range = (range.0.min(q), range.1.max(q));
            }
        }
        range
    }

    fn wrapping(&self) -> Option<Warning> {
        let (low, high) = self.range();
        let span = high - low;
        let mut first = None;
        let (mut wraps, mut outliers) = (0, 0);
        for run in &self.extracted.runs {
            let good: Vec<(f64, f64)> = good(run, Layout::POSITION);
            for at in 1..good.len() {
                let step = good[at].1 - good[at - 1].1;
                if step.abs() < WRAP_SHARE * span {
                    continue;
                }
                first.get_or_insert((self.label(run).to_owned(), good[at].0, step.abs()));
                let before = good[at - 1].1;
                let back = good[at..].iter().take(OUTLIER_ROWS).any(|(_, q)| (q - before).abs() < 0.5 * step.abs());
                // The way back from an outlier is one, too.
                let from = at.saturating_sub(OUTLIER_ROWS + 1);
                let returns = good[from..at - 1].iter().any(|(_, q)| (q - good[at].1).abs() < 0.5 * step.abs());
                *(if back || returns { &mut outliers } else { &mut wraps }) += 1;
            }
        }
        let (label, time, step) = first?;
        let scale = self.description.columns.position.scale.abs();
        let remedy = match wraps > 0 {
            true => format!("columns.position.wrap = {:.4} makes a wrapping angle continuous", step / scale),
            false => format!(
                "clean.jump = [{{ column = {:?}, limit = {:.3} }}] takes single outliers out",
                self.position_column(),
                0.25 * step / scale
            ),
        };
        Some(Warning {
            check: "wrapping",
            column: format!("position ({:?})", self.position_column()),
            rows: format!("run {label:?} from {time:.3} s on"),
            finding: format!(
                "{} steps of at least {:.0} % of the whole range of {span:.4} from one row to the next, {outliers} of them outliers",
                wraps + outliers,
                100.0 * WRAP_SHARE
            ),
            remedy,
        })
    }

    fn stuck(&self) -> Vec<Warning> {
        let (low, high) = self.range();
        let columns = &self.description.columns;
        let mut signals = vec![("effort", Layout::EFFORT, columns.effort.factors().join(" x "))];
        signals.push(("position", Layout::POSITION, self.position_column().to_owned()));
        if let (Some(at), Some(column)) = (self.layout.velocity, &columns.velocity) {
            signals.push(("velocity", at, column.column.clone()));
        }
        let mut warnings = Vec::new();
        for (signal, at, column) in signals {
            let mut found: Vec<(String, f64, f64, f64)> = Vec::new();
            let mut rows = 0;
            for run in &self.extracted.runs {
                for (begin, end) in self.repeats(run, at) {
                    let time = &run.raw.time;
                    if end - begin < STUCK_ROWS || time[end - 1] - time[begin] < STUCK_TIME {
                        continue;
                    }
                    if self.moves(run, at, begin, end, STUCK_SHARE * (high - low)) {
                        let value = run.raw.signals[at][begin];
                        found.push((self.label(run).to_owned(), time[begin], time[end - 1], value));
                        rows += end - begin;
                    }
                }
            }
            if let Some((label, from, to, value)) = found.first() {
                warnings.push(Warning {
                    check: "stuck",
                    column: format!("{signal} ({column:?})"),
                    rows: format!(
                        "run {label:?} from {from:.3} to {to:.3} s; {} such stretches, {rows} rows",
                        found.len()
                    ),
                    finding: format!(
                        "{value} repeats for {:.2} s while the joint moves, limit {STUCK_TIME} s",
                        to - from
                    ),
                    remedy: "leave these rows out (select.use), or mark the read-outs (clean.frozen, clean.dropout)"
                        .to_owned(),
                });
            }
        }
        warnings
    }

    /// Stretches of used rows with one and the same value.
    fn repeats(&self, run: &RunSignals, at: usize) -> Vec<(usize, usize)> {
        let values = &run.raw.signals[at];
        let counts = |i: usize| self.extracted.used[run.rows[i]] && !run.raw.missing[i];
        let mut stretches = Vec::new();
        let mut begin = 0;
        for i in 1..=values.len() {
            if i == values.len() || values[i] != values[begin] || !counts(i) || !counts(begin) {
                stretches.push((begin, i));
                begin = i;
            }
        }
        stretches
    }

    /// The joint moves by more than `way` in these rows, although the signal at `at` stands still.
    fn moves(&self, run: &RunSignals, at: usize, begin: usize, end: usize, way: f64) -> bool {
        let position = &run.raw.signals[Layout::POSITION];
        let time = &run.raw.time;
        let moved = position[end - 1] - position[begin];
        let range = |(low, high): (f64, f64), &q: &f64| (low.min(q), high.max(q));
        let (low, high) = position[begin..end].iter().fold((f64::INFINITY, f64::NEG_INFINITY), range);
        let elapsed = time[end - 1] - time[begin];
        match at {
            // A constant speed is a constant velocity.
            _ if Some(at) == self.layout.velocity => (moved - run.raw.signals[at][begin] * elapsed).abs() > way,
            Layout::POSITION => match self.velocity(run) {
                Some(velocity) => {
                    let mean = velocity[begin..end].iter().map(|v| v.abs()).sum::<f64>() / (end - begin) as f64;
                    mean * elapsed > way
                }
                None => end < position.len() && !run.raw.missing[end] && (position[end] - position[begin]).abs() > way,
            },
            _ => high - low > way,
        }
    }

    /// Friction follows every turn of a joint that trembles, and is hardly there in the mean.
    fn trembling(&self) -> Option<Warning> {
        let column = self.description.columns.velocity.as_ref()?;
        let mut rows: Vec<(f64, f64)> = Vec::new();
        for run in &self.extracted.runs {
            let velocity = self.velocity(run)?;
            let position = &run.raw.signals[Layout::POSITION];
            let time = &run.raw.time;
            let (mut before, mut after) = (0, 0);
            for i in 0..time.len() {
                before += time[before..].iter().take_while(|t| **t < time[i] - STEADY).count();
                after += time[after..].iter().take_while(|t| **t < time[i] + STEADY).count();
                let whole = after < time.len() && time[after] - time[before] < 3.0 * STEADY;
                if !whole || run.raw.missing[before..=after].contains(&true) || !self.extracted.used[run.rows[i]] {
                    continue;
                }
                let mean = |from: usize, to: usize| (position[to] - position[from]) / (time[to] - time[from]);
                if before < i && i < after {
                    let (then, now) = (mean(before, i), mean(i, after));
                    let steady = if then * now > 0.0 { then.abs().min(now.abs()) } else { 0.0 };
                    rows.push((steady, velocity[i] * then));
                }
            }
        }
        let mut speeds: Vec<f64> = rows.iter().map(|(steady, _)| *steady).collect();
        speeds.sort_by(f64::total_cmp);
        let least = STEADY_SHARE * speeds.get(speeds.len() * 99 / 100)?;
        let moving = rows.iter().filter(|(steady, _)| *steady > least);
        let (against, count) =
            moving.fold((0, 0), |(against, count), (_, with)| (against + usize::from(*with < 0.0), count + 1));
        let share = against as f64 / f64::from(count.max(1));
        (share > TREMBLING_SHARE).then(|| Warning {
            check: "trembling",
            column: format!("velocity ({:?})", column.column),
            rows: format!("{against} of {count} rows in which the joint keeps its direction for {STEADY} s either way"),
            finding: format!(
                "the velocity is against the motion in {:.1} % of them, limit {} %",
                100.0 * share,
                100.0 * TREMBLING_SHARE
            ),
            remedy: "a joint that hunts shows hardly any dry friction: lower its gains (damping first, a light rotor behind \
                     an elastic gear or backlash bears little) and record again; noise of the sensor alone needs \
                     differentiate.velocity_from = \"position\""
                .to_owned(),
        })
    }

    fn clipping(&self) -> Vec<Warning> {
        let effort = &self.description.columns.effort;
        let mut warnings = Vec::new();
        for column in effort.factors() {
            let Some(values) = self.recordings.table.numbers.get(column) else { continue };
            let used: Vec<Vec<f64>> = self
                .extracted
                .runs
                .iter()
                .map(|run| {
                    let rows = run.rows.iter().zip(&run.raw.missing);
                    rows.filter(|(row, missing)| self.extracted.used[**row] && !**missing)
                        .map(|(&r, _)| values[r])
                        .collect()
                })
                .collect();
            let all = || used.iter().flatten();
            let (low, high) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)));
            // A supply's voltage is one factor of a product and need not change at all.
            if low >= high || (effort.product.is_some() && low >= 0.0) {
                continue;
            }
            let count = all().count();
            for limit in [low, high] {
                let clipped: usize = used.iter().map(|run| in_a_row(run, limit, CLIPPED_ROWS)).sum();
                if limit != 0.0 && clipped as f64 > CLIPPED_SHARE * count as f64 {
                    warnings.push(Warning {
                        check: "clipping",
                        column: format!("effort ({column:?})"),
                        rows: format!("{clipped} of {count} used rows"),
                        finding: format!(
                            "its extreme, {limit}, stands for {CLIPPED_ROWS} rows and more in {:.1} % of the rows, limit {} %",
                            100.0 * clipped as f64 / count as f64,
                            100.0 * CLIPPED_SHARE
                        ),
                        remedy: format!("clean.saturation = [{{ column = {column:?}, limit = {} }}] leaves them out", limit.abs()),
                    });
                }
            }
        }
        warnings
    }
}

/// The factor between two units, in words.
fn named(ratio: f64) -> &'static str {
    const NAMED: [(f64, &str); 7] = [
        (57.2958, ": degrees/s beside rad"),
        (1.0 / 57.2958, ": rad/s beside degrees"),
        (9.5493, ": revolutions per minute beside rad"),
        (1.0 / 6.0, ": revolutions per minute beside degrees"),
        (1.0 / std::f64::consts::TAU, ": turns/s beside rad"),
        (1000.0, ": a factor of 1000"),
        (0.001, ": a factor of 1000"),
    ];
    NAMED.iter().find(|(factor, _)| (ratio / factor - 1.0).abs() < 0.05).map_or("", |(_, words)| words)
}

/// Times and values of the rows that are not missing.
fn good(run: &RunSignals, at: usize) -> Vec<(f64, f64)> {
    let pairs = run.raw.time.iter().zip(&run.raw.signals[at]).zip(&run.raw.missing);
    pairs.filter(|(_, missing)| !**missing).map(|((&time, &value), _)| (time, value)).collect()
}

/// Number of values that equal `limit` in stretches of at least `least`.
fn in_a_row(values: &[f64], limit: f64, least: usize) -> usize {
    let stretches = values.chunk_by(|a, b| (*a == limit) == (*b == limit));
    stretches.filter(|stretch| stretch[0] == limit && stretch.len() >= least).map(<[f64]>::len).sum()
}

impl Ways {
    fn add(&mut self, time: &[f64], position: &[f64], velocity: &[f64], missing: &[bool]) {
        let mut begin = 0;
        let mut integrated = 0.0;
        for i in 1..time.len() {
            let step = time[i] - time[i - 1];
            if missing[i] || missing[i - 1] || step > WINDOW || !velocity[i].is_finite() || !velocity[i - 1].is_finite()
            {
                (begin, integrated) = (i, 0.0);
                continue;
            }
            integrated += 0.5 * step * (velocity[i] + velocity[i - 1]);
            if time[i] - time[begin] >= WINDOW {
                let way = position[i] - position[begin];
                self.windows += 1;
                self.way += way * way;
                self.both += way * integrated;
                self.integrated += integrated * integrated;
                (begin, integrated) = (i, 0.0);
            }
        }
    }
}
