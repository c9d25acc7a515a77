//! Correlated noise: the covariance of least-squares unknowns where residuals are filtered; host.
//!
//! Filters make neighbouring samples of an effort alike, so N samples are worth fewer. With the autocorrelation rho of
//! a joint's residuals, the sum of rows `X^T X` in the covariance becomes `X^T T X`, T the Toeplitz matrix of rho (W.
//! Newey, K. West, A Simple, Positive Semi-Definite, Heteroskedasticity and Autocorrelation Consistent Covariance
//! Matrix, 1987, with stationary noise). rho is tapered linearly, which keeps T positive semidefinite.
//!
//! The taper ends at `REACH` times the correlation time 1 + 2 sum rho (A. Sokal, Monte Carlo Methods in Statistical
//! Mechanics, 1997, section 3). A longer one would resolve the spectrum near the motion's own frequencies, where least
//! squares has taken noise out of the residuals. All of it is scaled to the longest correlation time that a sum without
//! taper reaches: the taper alone states errors that are too small.
//!
//! Residuals are smaller than the noise, since unknowns were fitted to them: they have N - w tr((X^T W X)^-1 X^T T X)
//! degrees of freedom, w the joint's weight.

use super::equations::Rows;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Lags of the taper over the correlation time.
const REACH: f64 = 3.0;

/// Noise of one joint's effort.
#[derive(Clone, Debug)]
pub struct Noise {
    /// `X^T T X` over the unknowns that are solved for.
    pub rows: DMatrix<f64>,
    /// Sum of the squared residuals.
    pub square: f64,
    /// Samples.
    pub count: usize,
}

impl Noise {
    /// Noise of joint `j` beside a solution over the unknowns `solved`.
    pub fn of(rows: &Rows, unknowns: &DVector<f64>, j: usize, solved: &[usize]) -> Self {
        let stretches = rows.stretches();
        let residuals: Vec<Vec<f64>> = (stretches.iter())
            .map(|stretch| stretch.clone().map(|i| rows.residual(unknowns, j, i)).collect())
            .collect();
        let rho = autocorrelation(&residuals);
        let own = rows.active(j);
        let columns: Vec<usize> = solved.iter().copied().filter(|column| own.contains(column)).collect();
        let mut sum = DMatrix::zeros(columns.len(), columns.len());
        for stretch in &stretches {
            sum += correlated(rows, j, stretch, &columns, &rho);
        }
        let places: Vec<usize> = (0..solved.len()).filter(|&at| own.contains(&solved[at])).collect();
        let mut all = DMatrix::zeros(solved.len(), solved.len());
        for (a, &row) in places.iter().enumerate() {
            places.iter().enumerate().for_each(|(b, &column)| all[(row, column)] = sum[(a, b)]);
        }
        let square = residuals.iter().flatten().map(|r| r * r).sum();
        Self { rows: all, square, count: residuals.iter().map(Vec::len).sum() }
    }

    /// Variance of the noise; `inverse` is that of the weighted normal equations and `weight` that of this joint. None
    /// where less than one degree of freedom is left.
    pub fn variance(&self, inverse: &DMatrix<f64>, weight: f64) -> Option<f64> {
        let freedom = self.count as f64 - weight * inverse.dot(&self.rows);
        (freedom >= 1.0).then(|| self.square / freedom)
    }
}

/// `X^T T X` over one stretch.
fn correlated(rows: &Rows, j: usize, stretch: &Range<usize>, columns: &[usize], rho: &[f64]) -> DMatrix<f64> {
    let samples: Vec<usize> = stretch.clone().collect();
    let matrix = rows.columns(j, &samples, columns);
    let n = samples.len();
    let mut smoothed = matrix.clone();
    for (lag, &rho) in rho.iter().enumerate().skip(1).take_while(|(lag, _)| *lag < n) {
        let mut later = smoothed.rows_mut(lag, n - lag);
        later += rho * matrix.rows(0, n - lag);
        let mut earlier = smoothed.rows_mut(0, n - lag);
        earlier += rho * matrix.rows(lag, n - lag);
    }
    matrix.tr_mul(&smoothed)
}

/// Autocorrelation of residuals at lags 0, 1, ... with its taper; samples of different stretches are independent.
pub fn autocorrelation(stretches: &[Vec<f64>]) -> Vec<f64> {
    let square: f64 = stretches.iter().flatten().map(|r| r * r).sum();
    let longest = stretches.iter().map(Vec::len).max().unwrap_or(0);
    let mut rho = vec![1.0];
    let (mut time, mut longest_time) = (1.0, 1.0);
    while rho.len() < longest && (rho.len() as f64) < REACH * time {
        let lag = rho.len();
        let product: f64 = stretches.iter().flat_map(|r| r.iter().zip(r.iter().skip(lag))).map(|(a, b)| a * b).sum();
        let next = product / square.max(f64::MIN_POSITIVE);
        time = f64::max(time + 2.0 * next, 1.0);
        longest_time = f64::max(longest_time, time);
        rho.push(next);
    }
    let lags = rho.len() as f64;
    let tapered: Vec<f64> = rho.iter().enumerate().map(|(lag, rho)| rho * (1.0 - lag as f64 / lags)).collect();
    let scale = longest_time / (2.0 * tapered.iter().sum::<f64>() - 1.0).max(1.0);
    tapered.iter().map(|rho| scale * rho).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use identification::filter::LowPassFilter;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn white(count: usize, seed: u64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(|_| StandardNormal.sample(&mut random)).collect()
    }

    /// Samples over independent samples.
    fn correlation_time(stretches: &[Vec<f64>]) -> f64 {
        let rho = autocorrelation(stretches);
        2.0 * rho.iter().sum::<f64>() - rho[0]
    }

    #[test]
    fn white_noise_is_worth_its_samples_and_filtered_noise_twice_its_bandwidth() {
        let white = white(40_000, 1);
        assert!((correlation_time(std::slice::from_ref(&white)) - 1.0).abs() < 0.05);
        // Zero-phase, order 4, 10 Hz of a Nyquist frequency of 50 Hz: flat up to the cut-off, so that a second has 20
        // independent samples of 100; the sum up to the first zero is larger.
        let filtered = LowPassFilter::butterworth(4, 0.2).unwrap().zero_phase(&white).unwrap();
        let time = correlation_time(&[filtered]);
        assert!((5.0..6.8).contains(&time), "{time}");
    }

    #[test]
    fn stretches_are_not_correlated_with_each_other() {
        // One stretch of a constant is correlated throughout; the same samples one by one are not.
        let joined = vec![vec![1.0; 30]];
        let apart = vec![vec![1.0]; 30];
        assert!(correlation_time(&joined) > 10.0);
        assert_eq!(autocorrelation(&apart), [1.0]);
    }
}
