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
use wide::f64x4;

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
    let [sines, cosines] = sines_and_cosines(position);
    let mut first = 0;
    for last in 1..time.len() {
        let period = time[last] - time[last - 1];
        if period > LONGEST_PERIOD {
            first = last;
            continue;
        }
        recorded.seconds += period;
        let duration = time[last] - time[first];
        // Rows whose times are rounded: the window ends at the row that is nearest.
        if duration < WINDOW - 0.5 * period {
            continue;
        }
        let rows = first..last + 1;
        let forward = velocity[first] > 0.0;
        let moves = |v: &f64| if forward { *v >= SLOWEST } else { *v <= -SLOWEST };
        if velocity[rows.clone()].iter().all(moves) {
            let columns = [&sines, &cosines, velocity, torque].map(|values| &values[rows.clone()]);
            let [sine, cosine, speed, torque] = means(columns, &time[rows.clone()]);
            let row = [
                (velocity[last] - velocity[first]) / duration,
                sine,
                cosine,
                1.0,
                if forward { 1.0 } else { -1.0 },
                speed,
            ];
            recorded.windows.push(Window { row, torque, duration });
        }
        first = last;
    }
    Ok(recorded)
}

/// Sine and cosine of each angle, four at a time.
fn sines_and_cosines(angles: &[f64]) -> [Vec<f64>; 2] {
    let mut both = [(); 2].map(|()| Vec::with_capacity(angles.len() + 3));
    for four in angles.chunks(4) {
        let mut lanes = [0.0; 4];
        lanes[..four.len()].copy_from_slice(four);
        let (sine, cosine) = f64x4::from(lanes).sin_cos();
        both[0].extend(sine.to_array());
        both[1].extend(cosine.to_array());
    }
    both.map(|mut values| {
        values.truncate(angles.len());
        values
    })
}

/// Means over time by the trapezium rule, of columns as long as `time`.
fn means<const N: usize>(columns: [&[f64]; N], time: &[f64]) -> [f64; N] {
    let mut integrals = [0.0; N];
    for row in 1..time.len() {
        let half = 0.5 * (time[row] - time[row - 1]);
        for (integral, values) in integrals.iter_mut().zip(columns) {
            *integral += half * (values[row - 1] + values[row]);
        }
    }
    integrals.map(|integral| integral / (time[time.len() - 1] - time[0]))
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
    fn sines_and_cosines_are_those_of_the_standard_library() {
        for length in 0..9 {
            let angles: Vec<f64> = (0..length).map(|i| 1.7 * f64::from(i)).collect();
            assert_eq!(sines_and_cosines(&angles).map(|values| values.len()), [angles.len(); 2]);
        }
        // Turns of a joint, and many of them.
        let angles: Vec<f64> = (-20_000..20_000).map(|i| 0.037 * f64::from(i)).collect();
        let [sines, cosines] = sines_and_cosines(&angles);
        for ((angle, sine), cosine) in angles.iter().zip(sines).zip(cosines) {
            let errors = [sine - angle.sin(), cosine - angle.cos()];
            assert!(errors.iter().all(|error| error.abs() < 1e-15), "{angle}: {errors:?}");
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
