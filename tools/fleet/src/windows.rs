//! Rows of a recording to equations of a linear model, without differentiating: the momentum balance over a window;
//! host.
//!
//! ```text
//! integral of torque dt = I (v1 - v0) + integral of (g_s sin q + g_c cos q + o + F_c sign v + f_v v) dt
//! ```
//!
//! Divided by the window's duration, everything is a mean torque in Nm. Windows in which the joint turns round or is
//! slower than [`SLOWEST`] are left out: at standstill friction is whatever it has to be.

use logs::{LogError, Table, Wanted, parquet_log};
use std::path::Path;

/// Unknowns of the model, in this order.
pub const NAMES: [&str; 6] = ["inertia", "gravity_sine", "gravity_cosine", "offset", "dry", "viscous"];
/// Number of unknowns.
pub const UNKNOWNS: usize = NAMES.len();
/// Place of the offset.
pub const OFFSET: usize = 3;
/// Columns of a recording: time, s; position, rad; velocity, rad/s; torque at the joint's side of the gear, Nm.
pub const COLUMNS: [&str; 4] = ["time_s", "position_rad", "velocity_rad_s", "torque_Nm"];
/// Temperature of the gear, °C; a column that may be absent.
pub const TEMPERATURE: &str = "temperature_C";
/// Duration of a window, s.
pub const WINDOW: f64 = 0.04;
/// Speed below which a window is left out, rad/s.
pub const SLOWEST: f64 = 0.03;
/// Longest time between two rows of a window, s; a longer one is a gap.
pub const LONGEST_PERIOD: f64 = 0.01;
/// Angle up to which sine and cosine are summed up as their series, rad: 20 rad/s for half a window.
const SMALL: f64 = 0.4;
/// Series of sine, divided by the angle, and of cosine, by powers of the angle's square.
const SERIES: [[f64; 2]; 7] = [
    [1.0, 1.0],
    [-1.0 / 6.0, -1.0 / 2.0],
    [1.0 / 120.0, 1.0 / 24.0],
    [-1.0 / 5_040.0, -1.0 / 720.0],
    [1.0 / 362_880.0, 1.0 / 40_320.0],
    [-1.0 / 39_916_800.0, -1.0 / 3_628_800.0],
    [1.0 / 6_227_020_800.0, 1.0 / 479_001_600.0],
];
/// Longest time within one file, s: a file is of one day.
pub const LONGEST_FILE: f64 = 86_400.0;

/// One equation: the mean torque, and what each unknown is multiplied by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Factors of the unknowns.
    pub row: [f64; UNKNOWNS],
    /// Mean torque, Nm.
    pub torque: f64,
    /// Duration, s.
    pub duration: f64,
}

/// The recording of a file.
#[derive(Clone, Debug, Default)]
pub struct Recorded {
    /// Equations, in time.
    pub windows: Vec<Window>,
    /// Time of all rows, gaps left out, s.
    pub seconds: f64,
    /// Mean temperature, °C; NaN where there is none.
    pub temperature: f64,
}

/// Reason for which a file is not used.
#[derive(Debug, thiserror::Error)]
pub enum BadFile {
    /// The file, a column, or a value.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A clock that jumps.
    #[error("{file} row {row}: the clock jumps from {from} to {to} s: {limit}")]
    Clock {
        /// Name of the file.
        file: String,
        /// The row behind the jump, from 1.
        row: usize,
        /// Time of the row before, s.
        from: f64,
        /// Time of the row, s.
        to: f64,
        /// Limit that is expected.
        limit: &'static str,
    },
}

/// Reads the windows of a file, from its bytes where they are here already.
///
/// # Errors
/// [`BadFile`] with file, column and row.
pub fn read(path: &Path, bytes: Option<Vec<u8>>) -> Result<Recorded, BadFile> {
    let wanted = Wanted::numbers(COLUMNS);
    let table = match bytes {
        Some(bytes) => parquet_log::read_bytes_with(path, bytes, &wanted, &[TEMPERATURE])?,
        None => parquet_log::read_with(path, &wanted, &[TEMPERATURE])?,
    };
    table.all_finite(path)?;
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    of_table(&table, &file)
}

/// The windows of a table whose values are finite; `file` is told in an error.
///
/// # Errors
/// [`BadFile::Clock`].
pub fn of_table(table: &Table, file: &str) -> Result<Recorded, BadFile> {
    let [time, position, velocity, torque] = COLUMNS.map(|name| table.number(name).unwrap_or_default());
    check_clock(time, file)?;
    let mut recorded =
        Recorded { temperature: mean(table.number(TEMPERATURE).unwrap_or_default()), ..Recorded::default() };
    let gap = |one: &f64, next: &f64| next - one > LONGEST_PERIOD;
    let mut begin = 0;
    for run in time.chunk_by(|one, next| !gap(one, next)) {
        let rows = begin..begin + run.len();
        begin = rows.end;
        recorded.seconds += run[run.len() - 1] - run[0];
        windows_of(run, [position, velocity, torque].map(|values| &values[rows.clone()]), &mut recorded.windows);
    }
    Ok(recorded)
}

/// Windows of a run without a gap: its times; position, velocity and torque.
fn windows_of(time: &[f64], [position, velocity, torque]: [&[f64]; 3], windows: &mut Vec<Window>) {
    let mut first = 0;
    for last in 1..time.len() {
        let duration = time[last] - time[first];
        // Rows whose times are rounded: the window ends at the row that is nearest.
        if duration < WINDOW - 0.5 * (time[last] - time[last - 1]) {
            continue;
        }
        let rows = first..last + 1;
        first = last;
        let [slowest, fastest] = extremes(&velocity[rows.clone()]);
        let direction = match () {
            () if slowest >= SLOWEST => 1.0,
            () if fastest <= -SLOWEST => -1.0,
            () => continue,
        };
        let [q, v, torque] = [position, velocity, torque].map(|values| &values[rows.clone()]);
        let [sine, cosine, speed, torque] = means(&time[rows], q, v, torque);
        let row = [(v[v.len() - 1] - v[0]) / duration, sine, cosine, 1.0, direction, speed];
        windows.push(Window { row, torque, duration });
    }
}

/// Least and greatest of some values.
fn extremes(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], value| [least.min(*value), most.max(*value)])
}

/// Means over time by the trapezium rule: of sine and cosine of the position, of velocity and of torque.
fn means(time: &[f64], position: &[f64], velocity: &[f64], torque: &[f64]) -> [f64; 4] {
    // About the middle row, an angle whose sine and cosine are known: the others are small, and few terms are exact.
    let middle = position[position.len() / 2];
    let (sine, cosine) = middle.sin_cos();
    let mut sums = [0.0; 4];
    for row in 0..time.len() {
        let weight = 0.5 * (time[(row + 1).min(time.len() - 1)] - time[row.saturating_sub(1)]);
        let [small_sine, small_cosine] = sine_and_cosine(position[row] - middle);
        let values = [small_sine, small_cosine, velocity[row], torque[row]];
        sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
    }
    let [small_sine, small_cosine, velocity, torque] = sums.map(|sum| sum / (time[time.len() - 1] - time[0]));
    [sine * small_cosine + cosine * small_sine, cosine * small_cosine - sine * small_sine, velocity, torque]
}

/// Sine and cosine of an angle; within [`SMALL`] by their series, up to the terms that a double cannot tell.
fn sine_and_cosine(angle: f64) -> [f64; 2] {
    if angle.abs() > SMALL {
        let (sine, cosine) = angle.sin_cos();
        return [sine, cosine];
    }
    let square = angle * angle;
    let [sine, cosine] = SERIES.iter().rev().fold([0.0; 2], |[a, b], [c, d]| [a * square + c, b * square + d]);
    [angle * sine, cosine]
}

fn check_clock(time: &[f64], file: &str) -> Result<(), BadFile> {
    let jump = |at: usize, limit| {
        Err(BadFile::Clock { file: file.to_owned(), row: at + 1, from: time[at - 1], to: time[at], limit })
    };
    for at in 1..time.len() {
        if time[at] <= time[at - 1] {
            return jump(at, "expected time to increase");
        }
        if time[at] - time[0] > LONGEST_FILE {
            return jump(at, "expected at most 86400 s in a file");
        }
    }
    Ok(())
}

fn mean(values: &[f64]) -> f64 {
    // NaN without a value.
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A joint that follows the model exactly, for `rows` rows of 4 ms.
    fn exact(rows: usize) -> Table {
        let mut columns: [Vec<f64>; 4] = Default::default();
        for row in 0..rows {
            let t = row as f64 * 0.004;
            let (q, v, a) = ((3.0 * t).sin(), 3.0 * (3.0 * t).cos(), -9.0 * (3.0 * t).sin());
            let torque = 0.5 * a + 2.0 * q.sin() + 0.1 * q.cos() + 0.2 + 1.5 * v.signum() + 0.3 * v;
            columns.iter_mut().zip([t, q, v, torque]).for_each(|(column, value)| column.push(value));
        }
        Table::of_numbers(COLUMNS.into_iter().zip(columns))
    }

    #[test]
    fn a_window_is_the_momentum_balance_of_the_model() {
        let recorded = of_table(&exact(2_500), "a").unwrap();
        assert!(recorded.windows.len() > 200, "{}", recorded.windows.len());
        for window in &recorded.windows {
            let model: f64 = window.row.iter().zip([0.5, 2.0, 0.1, 0.2, 1.5, 0.3]).map(|(a, b)| a * b).sum();
            // The trapezium rule over 4 ms.
            assert!((model - window.torque).abs() < 1e-3, "{window:?}");
            assert!((window.duration - WINDOW).abs() < 1e-9);
        }
        assert!((recorded.seconds - 9.996).abs() < 1e-9 && recorded.temperature.is_nan());
    }

    #[test]
    fn sine_and_cosine_are_those_of_the_standard_library() {
        let close = |angle: f64, [sine, cosine]: [f64; 2]| {
            let errors = [sine - angle.sin(), cosine - angle.cos()];
            assert!(errors.iter().all(|error| error.abs() < 1e-15), "{angle}: {errors:?}");
        };
        // All of the series, both of its ends, and beyond them.
        for angle in (-5_000..=5_000).map(|i| 1e-4 * f64::from(i)) {
            close(angle, sine_and_cosine(angle));
        }
        // Means over a window in which a joint does not move, after many turns.
        for middle in (-20_000..20_000).map(|i| 0.037 * f64::from(i)) {
            let [sine, cosine, ..] = means(&[0.0, 0.1, 0.2], &[middle; 3], &[0.0; 3], &[0.0; 3]);
            close(middle, [sine, cosine]);
        }
    }

    #[test]
    fn means_are_of_the_trapezium_rule_for_a_slow_joint_and_a_fast_one() {
        let time = [1.0, 1.003, 1.01, 1.012, 1.02];
        for speed in [0.1, 30.0, 60.0] {
            let position = time.map(|t| 0.3 + speed * (t - 1.0));
            let trapezia = |of: fn(f64) -> f64| {
                let pairs = time.windows(2).zip(position.windows(2));
                pairs.map(|(t, q)| 0.5 * (t[1] - t[0]) * (of(q[0]) + of(q[1]))).sum::<f64>() / (time[4] - time[0])
            };
            let [sine, cosine, mean, torque] = means(&time, &position, &[speed; 5], &[0.0, 1.0, 0.0, 0.0, 0.0]);
            let errors = [sine - trapezia(f64::sin), cosine - trapezia(f64::cos), mean - speed, torque - 0.25];
            assert!(errors.iter().all(|error| error.abs() < 1e-13), "{speed}: {errors:?}");
        }
    }

    #[test]
    fn a_temperature_is_read_where_there_is_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.parquet");
        let of = |table: &Table| {
            std::fs::write(&path, logs::encode(table, logs::Format::Parquet, "", 0).unwrap()).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            let [whole, by_place] = [Some(bytes), None].map(|bytes| read(&path, bytes).unwrap());
            assert!(whole.windows == by_place.windows);
            whole
        };
        let mut table = exact(100);
        assert!(of(&table).temperature.is_nan());
        table.numbers.push((TEMPERATURE.to_owned(), (0..100).map(|row| f64::from(row % 2) + 30.0).collect()));
        assert_eq!(of(&table).temperature, 30.5);
    }

    #[test]
    fn no_window_spans_a_gap_a_reversal_or_a_standstill() {
        let mut table = exact(2_500);
        let whole = of_table(&table, "a").unwrap().windows.len();
        table.numbers[0].1[1_000..].iter_mut().for_each(|time| *time += LONGEST_PERIOD);
        assert!(of_table(&table, "a").unwrap().windows.len() < whole);
        let mut slow = exact(2_500);
        slow.numbers[2].1.iter_mut().for_each(|v| *v = SLOWEST * 0.999);
        assert!(of_table(&slow, "a").unwrap().windows.is_empty());
        slow.numbers[2].1.iter_mut().for_each(|v| *v = SLOWEST);
        assert!(of_table(&slow, "a").unwrap().windows.len() > 240);
        slow.numbers[2].1.iter_mut().enumerate().for_each(|(row, v)| *v = if row % 5 == 0 { -1.0 } else { 1.0 });
        assert!(of_table(&slow, "a").unwrap().windows.is_empty());
    }

    #[test]
    fn a_clock_that_jumps_is_told_with_row_and_limit() {
        let mut table = exact(100);
        table.numbers[0].1[50] = table.numbers[0].1[49];
        let error = of_table(&table, "a.parquet").unwrap_err().to_string();
        assert_eq!(error, "a.parquet row 51: the clock jumps from 0.196 to 0.196 s: expected time to increase");
        let mut table = exact(100);
        table.numbers[0].1[99] = LONGEST_FILE;
        assert!(of_table(&table, "a").is_ok());
        table.numbers[0].1[99] = LONGEST_FILE + 1e-3;
        let error = of_table(&table, "a").unwrap_err().to_string();
        assert!(error.ends_with("86400.001 s: expected at most 86400 s in a file"), "{error}");
    }
}
