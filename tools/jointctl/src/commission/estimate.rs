//! Estimates with their standard errors: means, and the straight line through points.

/// A value and its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Value.
    pub value: f64,
    /// Standard error, in the value's unit; NaN from fewer samples than it takes.
    pub error: f64,
}

impl Estimate {
    /// The mean of samples, with its standard error; NaN of none.
    pub fn mean(samples: &[f64]) -> Self {
        let count = samples.len() as f64;
        let value = samples.iter().sum::<f64>() / count;
        let squares = samples.iter().map(|sample| (sample - value).powi(2)).sum::<f64>();
        Self { value, error: (squares / (count - 1.0) / count).sqrt() }
    }

    /// The standard error as a part of the value.
    pub fn relative(&self) -> f64 {
        (self.error / self.value).abs()
    }

    /// The same in another unit.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self { value: factor * self.value, error: factor.abs() * self.error }
    }
}

/// Slope and intercept of the straight line through points (x, y) by least squares, with standard errors by what is
/// left.
pub fn line(points: &[(f64, f64)]) -> (Estimate, Estimate) {
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let squares = points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>();
    let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / squares;
    let intercept = y - slope * x;
    let left = points.iter().map(|p| (p.1 - intercept - slope * p.0).powi(2)).sum::<f64>() / (count - 2.0);
    let error = (left / squares).sqrt();
    let at_zero = (left * (1.0 / count + x * x / squares)).sqrt();
    (Estimate { value: slope, error }, Estimate { value: intercept, error: at_zero })
}

/// The difference of two angles of 2^32 a turn, in turns, -0.5 to 0.5.
pub fn turns_between(from: u32, to: u32) -> f64 {
    f64::from(to.wrapping_sub(from) as i32) / 4_294_967_296.0
}

/// Turns within half a turn of zero: -0.5 to 0.5.
pub fn wrapped(turns: f64) -> f64 {
    turns - turns.round()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_with_the_errors_of_the_textbook() {
        // D. C. Montgomery, "Introduction to Linear Regression Analysis", sums by hand: x mean 2.5, Sxx 5, residuals
        // (-0.1, 0.2, -0.1, 0) about 1 + 2 x, which they do not tilt.
        let (slope, intercept) = line(&[(1.0, 3.0), (2.0, 5.0), (3.0, 7.0), (4.0, 9.0)]);
        assert!((slope.value - 2.0).abs() < 1e-12 && (intercept.value - 1.0).abs() < 1e-12);
        assert!(slope.error < 1e-12 && intercept.error < 1e-12);
        let (slope, intercept) = line(&[(1.0, 3.1), (2.0, 4.9), (3.0, 6.9), (4.0, 9.1)]);
        // Residuals 0.1, -0.1, -0.1, 0.1: s^2 = 0.02.
        assert!((slope.value - 2.0).abs() < 1e-12 && (intercept.value - 1.0).abs() < 1e-12);
        assert!((slope.error - (0.02f64 / 5.0).sqrt()).abs() < 1e-12);
        assert!((intercept.error - (0.02f64 * (0.25 + 6.25 / 5.0)).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_mean_has_the_standard_error_of_its_samples() {
        let mean = Estimate::mean(&[1.0, 2.0, 3.0, 4.0]);
        assert_eq!(mean.value, 2.5);
        assert!((mean.error - (5.0f64 / 12.0).sqrt()).abs() < 1e-12);
        assert!(Estimate::mean(&[1.0]).error.is_nan());
    }

    #[test]
    fn angles_differ_the_shorter_way() {
        assert_eq!(turns_between(0xC000_0000, 0x4000_0000), -0.5);
        assert_eq!(turns_between(0xF000_0000, 0x1000_0000), 0.125);
        assert_eq!(wrapped(1.75), -0.25);
    }
}
