//! Error of a predicted effort against the measured one, overall and per motion state; host.
//!
//! RMSE as a percentage of the RMS of the measured effort is the relative error that the EMPS benchmark publishes.
//! The relative torque error is equation 11 of the mobile-robot paper (001), whose section 3.1 also defines the four
//! motion states. Nothing here divides by zero: a number that has no meaning on the given samples is `None`.

use crate::samples::MotionState;
use serde::Serialize;

/// Samples whose measured effort is below this fraction of the RMS of the measured effort have no relative torque
/// error. The paper excludes "data that are too small" without saying how small.
pub const RELATIVE_FLOOR: f64 = 0.1;

/// Reason for which an error could not be computed.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum MetricsError {
    /// The columns are not of equal length.
    #[error("{measured} measured samples, {column} of length {length}")]
    Length {
        /// Number of measured samples.
        measured: usize,
        /// The column that differs.
        column: &'static str,
        /// Its length.
        length: usize,
    },
    /// An effort is infinite or not a number.
    #[error("{column} effort of sample {index} is {value}")]
    NotFinite {
        /// The column with the value.
        column: &'static str,
        /// Index of the sample.
        index: usize,
        /// The value.
        value: f64,
    },
    /// The threshold of the relative error is negative, infinite or not a number.
    #[error("floor of the relative torque error is {0}, it must be finite and not negative")]
    Floor(f64),
}

/// Errors of one model on one set of samples. Efforts are in the data set's unit (Nm, N, A or V).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// Number of samples.
    pub samples: usize,
    /// Root of the mean square error.
    pub rmse: f64,
    /// Mean absolute error.
    pub mae: f64,
    /// Mean square error.
    pub mse: f64,
    /// Largest absolute error.
    pub max_error: f64,
    /// 100 RMSE / RMS(measured), %. None where nothing but zero was measured.
    pub percent_of_rms: Option<f64>,
    /// Coefficient of determination, 1 - sum(error^2) / sum((measured - mean)^2). None where the measured effort is
    /// constant.
    pub r2: Option<f64>,
    /// Mean |predicted - measured| / |measured|, % (001 eq. 11). None where every sample is below the floor.
    pub relative_torque_error: Option<f64>,
    /// |measured| below which the relative torque error leaves a sample out.
    pub relative_floor: f64,
    /// Number of samples that it leaves out.
    pub relative_excluded: usize,
}

/// One value for all samples, and one for each motion state. A sample counts in two states: accelerating or uniform,
/// and fast or slow.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ByState<T> {
    /// All samples.
    pub overall: T,
    /// |acceleration| above its threshold.
    pub accelerating: T,
    /// |acceleration| below its threshold.
    pub uniform: T,
    /// |velocity| above its threshold.
    pub fast: T,
    /// |velocity| below its threshold.
    pub slow: T,
}

impl<T> ByState<T> {
    /// The values with the names of their states, overall first.
    pub fn named(&self) -> [(&'static str, &T); 5] {
        [
            ("overall", &self.overall),
            ("accelerating", &self.accelerating),
            ("uniform", &self.uniform),
            ("fast", &self.fast),
            ("slow", &self.slow),
        ]
    }
}

/// The |measured| effort below which a sample has no relative torque error: `fraction` of the RMS of `measured`.
pub fn relative_floor(measured: &[f64], fraction: f64) -> f64 {
    match measured.len() {
        0 => 0.0,
        n => fraction * (measured.iter().map(|y| y * y).sum::<f64>() / n as f64).sqrt(),
    }
}

/// Errors of `predicted` against `measured` (same length, same unit), or None where there is no sample.
///
/// `floor` is the |measured| effort below which a sample has no relative torque error, see [`relative_floor`].
///
/// # Errors
/// Columns of unlike length, efforts that are not finite, a floor that is not finite or negative.
pub fn metrics(measured: &[f64], predicted: &[f64], floor: f64) -> Result<Option<Metrics>, MetricsError> {
    check(measured, predicted, floor)?;
    Ok(over(measured, predicted, floor, |_| true))
}

/// Errors of `predicted` against `measured` for all samples and for each motion state; None for a state without
/// samples.
///
/// Each state is judged against its own RMS and mean, all with the same `floor`.
///
/// # Errors
/// Those of [`metrics`], and `state` of another length than `measured`.
pub fn metrics_by_state(
    measured: &[f64],
    predicted: &[f64],
    state: &[MotionState],
    floor: f64,
) -> Result<ByState<Option<Metrics>>, MetricsError> {
    check(measured, predicted, floor)?;
    if state.len() != measured.len() {
        return Err(MetricsError::Length { measured: measured.len(), column: "motion state", length: state.len() });
    }
    Ok(ByState {
        overall: over(measured, predicted, floor, |_| true),
        accelerating: over(measured, predicted, floor, |i| state[i].accelerating),
        uniform: over(measured, predicted, floor, |i| !state[i].accelerating),
        fast: over(measured, predicted, floor, |i| state[i].fast),
        slow: over(measured, predicted, floor, |i| !state[i].fast),
    })
}

fn check(measured: &[f64], predicted: &[f64], floor: f64) -> Result<(), MetricsError> {
    if predicted.len() != measured.len() {
        return Err(MetricsError::Length {
            measured: measured.len(),
            column: "predicted effort",
            length: predicted.len(),
        });
    }
    for (column, values) in [("measured", measured), ("predicted", predicted)] {
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            return Err(MetricsError::NotFinite { column, index, value: values[index] });
        }
    }
    if !floor.is_finite() || floor < 0.0 {
        return Err(MetricsError::Floor(floor));
    }
    Ok(())
}

fn over(measured: &[f64], predicted: &[f64], floor: f64, belongs: impl Fn(usize) -> bool) -> Option<Metrics> {
    let chosen: Vec<(f64, f64)> =
        (0..measured.len()).filter(|&i| belongs(i)).map(|i| (measured[i], predicted[i])).collect();
    if chosen.is_empty() {
        return None;
    }
    let n = chosen.len() as f64;
    let mean = chosen.iter().map(|(y, _)| y).sum::<f64>() / n;
    let spread = chosen.iter().map(|(y, _)| (y - mean) * (y - mean)).sum::<f64>();
    let squares = chosen.iter().map(|(y, _)| y * y).sum::<f64>();
    let error_squares = chosen.iter().map(|(y, p)| (p - y) * (p - y)).sum::<f64>();
    let relative: Vec<f64> = chosen
        .iter()
        .filter(|(y, _)| *y != 0.0 && y.abs() >= floor)
        .map(|(y, p)| ((p - y) / y).abs() * 100.0)
        .collect();
    let mse = error_squares / n;
    // A constant that is not a binary fraction leaves rounding errors about its mean.
    let constant = spread <= squares * f64::EPSILON * f64::EPSILON * n;
    Some(Metrics {
        samples: chosen.len(),
        rmse: mse.sqrt(),
        mae: chosen.iter().map(|(y, p)| (p - y).abs()).sum::<f64>() / n,
        mse,
        max_error: chosen.iter().map(|(y, p)| (p - y).abs()).fold(0.0, f64::max),
        percent_of_rms: (squares > 0.0).then(|| 100.0 * (error_squares / squares).sqrt()),
        r2: (!constant).then(|| 1.0 - error_squares / spread),
        relative_torque_error: (!relative.is_empty()).then(|| relative.iter().sum::<f64>() / relative.len() as f64),
        relative_floor: floor,
        relative_excluded: chosen.len() - relative.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-12
    }

    #[test]
    fn errors_are_those_computed_by_hand() {
        // errors 1, -1, 0, 2; mean 2.5; spread 2.25 + 0.25 + 0.25 + 2.25 = 5; squares 1 + 4 + 9 + 16 = 30
        let found = metrics(&[1.0, 2.0, 3.0, 4.0], &[2.0, 1.0, 3.0, 6.0], 0.0).unwrap().unwrap();
        assert_eq!(found.samples, 4);
        assert!(close(found.mse, 1.5) && close(found.rmse, 1.5f64.sqrt()), "{found:?}");
        assert!(close(found.mae, 1.0) && close(found.max_error, 2.0), "{found:?}");
        assert!(close(found.percent_of_rms.unwrap(), 100.0 * (6.0f64 / 30.0).sqrt()), "{found:?}");
        assert!(close(found.r2.unwrap(), 1.0 - 6.0 / 5.0), "{found:?}");
        // 1/1, 1/2, 0/3, 2/4
        assert!(close(found.relative_torque_error.unwrap(), 50.0), "{found:?}");
        assert_eq!(found.relative_excluded, 0);
    }

    #[test]
    fn small_efforts_have_no_relative_torque_error_and_are_counted() {
        let found = metrics(&[-1.0, 0.0, 0.09, 2.0], &[-1.5, 1.0, 1.0, 2.0], 0.1).unwrap().unwrap();
        assert!(close(found.relative_torque_error.unwrap(), 25.0), "{found:?}");
        assert_eq!(found.relative_excluded, 2);
        let none = metrics(&[0.0, 0.0], &[1.0, 1.0], 0.0).unwrap().unwrap();
        assert_eq!((none.relative_torque_error, none.relative_excluded, none.percent_of_rms), (None, 2, None));
    }

    #[test]
    fn the_floor_is_a_fraction_of_the_rms() {
        assert!(close(relative_floor(&[3.0, -4.0, 0.0, 0.0], 0.1), 0.25));
        assert_eq!(relative_floor(&[], 0.1), 0.0);
    }

    #[test]
    fn a_constant_effort_has_no_coefficient_of_determination() {
        let found = metrics(&[0.1; 7], &[0.2; 7], 0.0).unwrap().unwrap();
        assert_eq!(found.r2, None);
        assert!(close(found.percent_of_rms.unwrap(), 100.0), "{found:?}");
    }

    #[test]
    fn each_state_is_judged_on_its_own_samples() {
        let state = |accelerating, fast| MotionState { accelerating, fast };
        let states = [state(true, true), state(true, false), state(false, false)];
        let found = metrics_by_state(&[1.0, 2.0, 4.0], &[2.0, 4.0, 7.0], &states, 0.0).unwrap();
        let mae = |m: &Option<Metrics>| m.as_ref().unwrap().mae;
        assert!(close(mae(&found.overall), 2.0) && close(mae(&found.accelerating), 1.5), "{found:?}");
        assert!(close(mae(&found.uniform), 3.0) && close(mae(&found.fast), 1.0), "{found:?}");
        assert!(close(mae(&found.slow), 2.5), "{found:?}");
    }

    #[test]
    fn a_state_without_samples_has_no_errors_rather_than_not_a_number() {
        let states = [MotionState { accelerating: true, fast: true }];
        let found = metrics_by_state(&[1.0], &[1.0], &states, 0.0).unwrap();
        assert!(found.uniform.is_none() && found.slow.is_none() && found.fast.is_some());
        assert_eq!(metrics(&[], &[], 0.0), Ok(None));
    }

    #[test]
    fn bad_columns_are_refused_with_their_place() {
        assert_eq!(
            metrics(&[1.0], &[], 0.0),
            Err(MetricsError::Length { measured: 1, column: "predicted effort", length: 0 })
        );
        assert_eq!(
            metrics_by_state(&[1.0], &[1.0], &[], 0.0),
            Err(MetricsError::Length { measured: 1, column: "motion state", length: 0 })
        );
        let refused = metrics(&[1.0, 2.0], &[1.0, f64::INFINITY], 0.0);
        let place = MetricsError::NotFinite { column: "predicted", index: 1, value: f64::INFINITY };
        assert_eq!(refused, Err(place));
        assert_eq!(metrics(&[1.0], &[1.0], -1.0), Err(MetricsError::Floor(-1.0)));
    }
}
