//! Parameters from sums: ordinary least squares by the normal equations; host.
//!
//! Standard errors are those of independent windows, s^2 (A'A)^-1 with s^2 = RSS/(n - p) (G. A. F. Seber, A. J. Lee,
//! "Linear Regression Analysis", 2nd edition, theorem 3.1 and equation 3.5). Windows that follow each other are not
//! independent: the scatter between days is larger.

use crate::sums::{Sums, TRIANGLE};
use crate::windows::{OFFSET, UNKNOWNS};
use nalgebra::{Cholesky, SMatrix, SVector};

type Matrix = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
type Vector = SVector<f64, UNKNOWNS>;

/// Fewest windows of an estimate: two seconds of motion.
pub const FEWEST: f64 = 50.0;
/// Largest condition number of the scaled normal equations; beyond, the motion does not tell the parameters apart.
pub const CONDITION: f64 = 1e6;

/// Parameters of one joint over some days.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Values in the order of [`crate::windows::NAMES`]: kg m^2, Nm, Nm, Nm, Nm, Nm s/rad.
    pub values: [f64; UNKNOWNS],
    /// Standard errors of independent windows.
    pub errors: [f64; UNKNOWNS],
    /// RMS of the torque that is left, Nm.
    pub residual: f64,
    /// RMS of the torque, Nm.
    pub torque: f64,
}

/// Solves the sums; none where there are fewer than [`FEWEST`] windows, or the motion does not determine the
/// parameters.
pub fn estimate(sums: &Sums) -> Option<Estimate> {
    let finite = sums.products.iter().chain(&sums.with_torque).all(|sum| sum.is_finite());
    if !finite || sums.windows < FEWEST {
        return None;
    }
    let products = matrix(&sums.products);
    let scales = products.diagonal().map(f64::sqrt);
    if scales.iter().any(|scale| *scale <= 0.0) {
        return None;
    }
    let scaled = Matrix::from_fn(|i, j| products[(i, j)] / (scales[i] * scales[j]));
    let eigenvalues = scaled.symmetric_eigenvalues();
    if eigenvalues.max() >= CONDITION * eigenvalues.min() {
        return None;
    }
    let cholesky = Cholesky::new(scaled)?;
    let right = Vector::from(sums.with_torque);
    let values = cholesky.solve(&right.component_div(&scales)).component_div(&scales);
    let squares = (sums.torque_squares - 2.0 * values.dot(&right) + (products * values).dot(&values)).max(0.0);
    let variance = squares / (sums.windows - UNKNOWNS as f64);
    let inverse = cholesky.inverse();
    let errors = Vector::from_fn(|i, _| (variance * inverse[(i, i)]).sqrt() / scales[i]);
    Some(Estimate {
        values: values.into(),
        errors: errors.into(),
        residual: (squares / sums.windows).sqrt(),
        torque: (sums.torque_squares / sums.windows).sqrt(),
    })
}

/// Parts of the torque that the parameters `one` and `other` give over the same motion, as the factor of `other` that
/// is nearest to `one` in the mean of squares; `which` are the unknowns of the part. None without such a torque.
pub fn factor(sums: &Sums, which: &[usize], one: &Estimate, other: &Estimate) -> Option<f64> {
    let squares = product(sums, which, other, other);
    (squares > 0.0).then(|| product(sums, which, one, other) / squares)
}

/// RMS of a part of the torque, Nm.
pub fn rms(sums: &Sums, which: &[usize], of: &Estimate) -> f64 {
    (product(sums, which, of, of).max(0.0) / sums.windows).sqrt()
}

/// Mean of a part of the torque, Nm.
pub fn mean(sums: &Sums, which: &[usize], of: &Estimate) -> f64 {
    let products = matrix(&sums.products);
    // The offset's factor is 1 in every window.
    which.iter().map(|j| of.values[*j] * products[(OFFSET, *j)]).sum::<f64>() / sums.windows
}

/// Sum over the windows of the product of two torques.
fn product(sums: &Sums, which: &[usize], one: &Estimate, other: &Estimate) -> f64 {
    let products = matrix(&sums.products);
    let of_row = |i: &usize| which.iter().map(|j| one.values[*i] * products[(*i, *j)] * other.values[*j]).sum::<f64>();
    which.iter().map(of_row).sum()
}

fn matrix(triangle: &[f64; TRIANGLE]) -> Matrix {
    let place = |i: usize, j: usize| i * UNKNOWNS - i * (i + 1) / 2 + j;
    Matrix::from_fn(|i, j| triangle[place(i.min(j), i.max(j))])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::windows::{Recorded, Window};

    const TRUTH: [f64; UNKNOWNS] = [0.5, 2.0, 0.1, 0.2, 1.5, 0.3];

    /// Windows of a motion, with a torque error that is the same for all seeds of one length.
    fn recorded(count: usize, noise: f64) -> Recorded {
        let window = |at: usize| {
            let t = at as f64 * 0.04;
            let (q, v, a) =
                ((1.7 * t).sin() + 0.3 * t.cos(), 1.7 * (1.7 * t).cos() - 0.3 * t.sin(), -2.9 * (1.7 * t).sin());
            let row = [a, q.sin(), q.cos(), 1.0, v.signum(), v];
            let error = noise * ((at * 7_919 % 1_009) as f64 / 504.0 - 1.0);
            let torque = row.iter().zip(TRUTH).map(|(factor, value)| factor * value).sum::<f64>() + error;
            Window { row, torque, duration: 0.04 }
        };
        Recorded { windows: (0..count).map(window).collect(), seconds: count as f64 * 0.04, temperature: f64::NAN }
    }

    fn sums(count: usize, noise: f64) -> Sums {
        Sums::of(&[recorded(count, noise)], |_| None)
    }

    #[test]
    fn exact_windows_give_their_parameters_and_noise_the_error_that_is_told() {
        let exact = estimate(&sums(500, 0.0)).unwrap();
        assert!(exact.values.iter().zip(TRUTH).all(|(value, truth)| (value - truth).abs() < 1e-9), "{exact:?}");
        assert!(exact.residual < 1e-6);
        let noisy = estimate(&sums(2_000, 0.2)).unwrap();
        // RMS of a uniform error.
        assert!((noisy.residual / (0.2 / 3f64.sqrt()) - 1.0).abs() < 0.05, "{noisy:?}");
        for ((value, truth), error) in noisy.values.iter().zip(TRUTH).zip(noisy.errors) {
            assert!((value - truth).abs() < 4.0 * error && error < 0.05, "{noisy:?}");
        }
    }

    #[test]
    fn too_few_windows_or_a_motion_that_tells_nothing_apart_give_no_estimate() {
        assert!(estimate(&sums(49, 0.1)).is_none());
        assert!(estimate(&sums(50, 0.1)).is_some());
        let mut still = recorded(500, 0.1);
        still.windows.iter_mut().for_each(|window| window.row = [0.0, 0.5, 0.8, 1.0, 1.0, 0.4]);
        assert!(estimate(&Sums::of(&[still], |_| None)).is_none());
        // A swing so small that gravity's cosine looks like the offset.
        let swing = |amplitude: f64| {
            let mut swing = recorded(500, 0.0);
            swing.windows.iter_mut().enumerate().for_each(|(at, window)| {
                let q = amplitude * (0.068 * at as f64).sin();
                (window.row[1], window.row[2]) = (q.sin(), q.cos());
            });
            estimate(&Sums::of(&[swing], |_| None))
        };
        assert!(swing(0.05).is_none() && swing(0.5).is_some());
        let mut broken = sums(500, 0.1);
        broken.products[3] = f64::NAN;
        assert!(estimate(&broken).is_none());
    }

    #[test]
    fn a_torque_that_is_scaled_has_that_factor_in_every_part() {
        let sums = sums(500, 0.0);
        let one = estimate(&sums).unwrap();
        let mut scaled = one;
        scaled.values = scaled.values.map(|value| 0.7 * value);
        for part in [&[0, 1, 2][..], &[4, 5], &[4]] {
            assert!((factor(&sums, part, &scaled, &one).unwrap() - 0.7).abs() < 1e-12);
        }
        let all: Vec<usize> = (0..UNKNOWNS).collect();
        assert!((rms(&sums, &all, &one) - one.torque).abs() < 1e-6);
    }

    #[test]
    fn sums_of_parts_are_the_sums_of_the_whole() {
        let (mut whole, part) = (recorded(600, 0.1), recorded(300, 0.1));
        let mut joined = Sums::of(std::slice::from_ref(&part), |_| None);
        joined.add(&Sums::of(std::slice::from_ref(&part), |_| None));
        whole.windows = [part.windows.clone(), part.windows].concat();
        let (one, other) = (estimate(&joined).unwrap(), estimate(&Sums::of(&[whole], |_| None)).unwrap());
        assert!(one.values.iter().zip(other.values).all(|(a, b)| (a - b).abs() < 1e-9));
    }
}
