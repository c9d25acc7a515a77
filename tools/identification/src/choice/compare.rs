//! The rule: the simpler model unless a richer one wins beyond the spread of the folds; host.
//!
//! Two models are compared fold by fold on the same left-out samples, by ln(error of one / error of the other): the
//! mean over the folds is the relative change, and its standard error is the spread of the folds over the root of their
//! number. One large motion does not drown small ones that way.

/// A richer model must lower the error by at least this fraction beyond one standard error.
pub const LEAST_WORTH: f64 = 0.002;
/// One standard error of few folds: the quantile of Student's t distribution with one degree of freedom less than folds
/// that the normal distribution reaches at one (0.8413), for two to eight folds. The spread of two folds is itself
/// hardly known.
const ONE_STANDARD_ERROR: [f64; 7] = [1.837, 1.321, 1.197, 1.142, 1.111, 1.091, 1.077];
/// No left-out motion may become worse than with the simplest model by more than this fraction.
pub const WORST_FOLD: f64 = 0.02;

/// Change of the error from one model to another over the folds, as natural logarithms of ratios.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Mean over the folds; negative where the second model is better.
    pub mean: f64,
    /// Standard error of the mean, widened where there are few folds; infinite with fewer than two.
    pub standard_error: f64,
    /// Largest value of any fold.
    pub worst: f64,
}

impl Comparison {
    /// True where the second model is better by `worth` (a fraction of the error) beyond one standard error.
    pub fn wins(&self, worth: f64) -> bool {
        self.mean + self.standard_error <= (1.0 - worth).ln()
    }

    /// True where no fold is worse by more than [`WORST_FOLD`].
    pub fn harmless(&self) -> bool {
        self.worst <= (1.0 + WORST_FOLD).ln()
    }

    /// Mean change in percent; negative where the second model is better.
    pub fn percent(&self) -> f64 {
        100.0 * self.mean.exp_m1()
    }
}

/// Compares two models by their errors in every fold (as many of both, > 0).
pub fn compare(simple: &[f64], rich: &[f64]) -> Comparison {
    let ratio = |(simple, rich): (&f64, &f64)| (rich.max(f64::MIN_POSITIVE) / simple.max(f64::MIN_POSITIVE)).ln();
    let ratios: Vec<f64> = simple.iter().zip(rich).map(ratio).collect();
    let n = ratios.len() as f64;
    let mean = ratios.iter().sum::<f64>() / n.max(1.0);
    let squares: f64 = ratios.iter().map(|r| (r - mean).powi(2)).sum();
    let standard_error = match ratios.len() {
        0 | 1 => f64::INFINITY,
        folds => {
            let widened = ONE_STANDARD_ERROR.get(folds - 2).unwrap_or(&1.0);
            widened * (squares / (n - 1.0) / n).sqrt()
        }
    };
    Comparison { mean, standard_error, worst: ratios.into_iter().fold(f64::NEG_INFINITY, f64::max) }
}

/// Models in the order of preference, from their errors in every fold and their numbers of parameters. The first is the
/// simplest of those over which the best one does not win beyond one standard error; the others follow by their errors.
pub fn rank(errors: &[Vec<f64>], parameters: &[usize]) -> Vec<usize> {
    let mut by_size: Vec<usize> = (0..errors.len()).collect();
    by_size.sort_by_key(|&i| parameters[i]);
    let Some(&simplest) = by_size.first() else { return vec![] };
    let mean = |i: usize| compare(&errors[simplest], &errors[i]).mean;
    let mut order = by_size.clone();
    order.sort_by(|&a, &b| mean(a).total_cmp(&mean(b)));
    let best = order[0];
    let beaten = |&i: &usize| i != best && compare(&errors[i], &errors[best]).wins(LEAST_WORTH);
    if let Some(chosen) = by_size.into_iter().find(|i| !beaten(i)) {
        order.retain(|&i| i != chosen);
        order.insert(0, chosen);
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_within_one_standard_error_does_not_win() {
        // Changes of -1 and -3 %: mean -2 %, standard error 1 %, widened to 1.837 %; ln(1 - 0.00163) = -0.163 %.
        let rich = [(-0.01f64).exp(), (-0.03f64).exp()];
        let found = compare(&[1.0, 1.0], &rich);
        assert!((found.mean + 0.02).abs() < 1e-12 && (found.standard_error - 0.01837).abs() < 1e-12, "{found:?}");
        assert!(found.wins(0.0016) && !found.wins(0.0017));
        assert!(!compare(&[1.0, 1.0], &[0.9, 1.0]).wins(0.001), "one of two folds gains nothing");
    }

    #[test]
    fn the_spread_of_many_folds_is_taken_as_it_is() {
        let error = |folds: usize| {
            let rich: Vec<f64> = (0..folds).map(|n| if n % 2 == 0 { 1.0 } else { 0.9 }).collect();
            let (spread, n) = (0.5 * (0.9f64).ln().abs(), folds as f64);
            compare(&vec![1.0; folds], &rich).standard_error / (spread / (n - 1.0).sqrt())
        };
        assert!((error(8) - 1.077).abs() < 1e-9 && (error(10) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn one_fold_decides_nothing() {
        assert!(!compare(&[1.0], &[0.5]).wins(0.0));
    }

    #[test]
    fn a_motion_may_become_two_percent_worse_and_no_more() {
        assert!(compare(&[1.0, 1.0], &[0.5, 1.0199]).harmless());
        assert!(!compare(&[1.0, 1.0], &[0.5, 1.0201]).harmless());
    }

    #[test]
    fn the_simplest_model_that_the_best_does_not_beat_is_first() {
        let errors = [vec![1.0, 1.0, 1.0], vec![0.80, 0.81, 0.79], vec![0.795, 0.80, 0.80], vec![0.81, 0.90, 0.85]];
        assert_eq!(rank(&errors, &[3, 5, 9, 20]), [1, 2, 3, 0]);
        // The order of the list does not matter, the number of parameters does.
        assert_eq!(rank(&errors, &[3, 9, 5, 20])[0], 2);
    }

    #[test]
    fn without_a_clear_winner_the_simplest_model_stays() {
        assert_eq!(rank(&[vec![1.0, 1.0, 1.0], vec![0.7, 1.01, 1.01]], &[3, 20]), [0, 1]);
        assert_eq!(rank(&[], &[]), [0usize; 0]);
    }
}
