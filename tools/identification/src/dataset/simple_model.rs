//! The simplest model of a joint, linear in its coefficients, for checks of a recording and its delays; host.
//!
//! effort = rigid part + viscous coefficient v + Coulomb friction tanh(v / edge) + offset, without bounds on any sign.
//! Sums are kept for groups of rows (runs, or blocks of time), so that a group can be left out without a second pass
//! over the rows.

use crate::joint_model::rigid_state;
use crate::rigid::{RigidModel, RigidParameters, RigidRegressor};
use crate::samples::Samples;
use nalgebra::{DMatrix, DVector};

/// Width of the Coulomb step, as a fraction of the 99 % quantile of the speed.
const EDGE: f64 = 0.02;
/// Eigenvalues of the scaled normal equations below this fraction of the largest count as zero.
const RANK: f64 = 1e-10;

/// A regressor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Term {
    /// Regressor of the rigid part.
    Rigid(RigidRegressor),
    /// Proportional to the velocity.
    Viscous,
    /// Coulomb friction, in the direction of the velocity.
    Coulomb,
    /// Constant.
    Offset,
}

impl Term {
    /// Name in messages.
    pub fn name(self) -> String {
        match self {
            Term::Rigid(regressor) => regressor.to_string(),
            Term::Viscous => "viscous friction".to_owned(),
            Term::Coulomb => "Coulomb friction".to_owned(),
            Term::Offset => "offset".to_owned(),
        }
    }
}

/// The terms of the model and the width of its Coulomb step.
#[derive(Clone, Debug)]
pub struct SimpleModel {
    /// The terms, in the order of their coefficients.
    pub terms: Vec<Term>,
    /// Velocity at which tanh has reached 76 % of Coulomb friction, rad/s or m/s.
    pub edge: f64,
}

impl SimpleModel {
    /// The model with the rigid part `rigid`, for the speeds of the samples `rows`.
    pub fn new(rigid: &RigidModel, samples: &Samples, rows: &[usize]) -> SimpleModel {
        let mut speeds: Vec<f64> = rows.iter().map(|&i| samples.velocity[i].abs()).collect();
        speeds.sort_by(f64::total_cmp);
        let fastest = speeds.get(speeds.len().saturating_sub(1) * 99 / 100).copied().unwrap_or(0.0);
        let mut terms: Vec<Term> = rigid.regressors().into_iter().map(Term::Rigid).collect();
        terms.extend([Term::Viscous, Term::Coulomb, Term::Offset]);
        SimpleModel { terms, edge: (EDGE * fastest).max(f64::MIN_POSITIVE) }
    }

    /// Values of the terms for one sample.
    pub fn values(&self, samples: &Samples, index: usize) -> Vec<f64> {
        let rigid = RigidParameters::regressor_values(&rigid_state(samples, index));
        let velocity = samples.velocity[index];
        let value = |term: &Term| match term {
            Term::Rigid(regressor) => rigid[regressor.index()],
            Term::Viscous => velocity,
            Term::Coulomb => (velocity / self.edge).tanh(),
            Term::Offset => 1.0,
        };
        self.terms.iter().map(value).collect()
    }

    /// Place of a term among the coefficients.
    pub fn place(&self, term: Term) -> Option<usize> {
        self.terms.iter().position(|&found| found == term)
    }
}

/// Normal equations of the model over some rows.
#[derive(Clone, Debug)]
pub struct Normal {
    /// Sum of the products of the terms' values.
    pub gram: DMatrix<f64>,
    /// Sum of the products of the terms' values with the effort.
    pub right: DVector<f64>,
    /// Sum of the squared effort.
    pub square: f64,
    /// Number of rows.
    pub count: usize,
}

impl Normal {
    /// Equations of `terms` terms over no row.
    pub fn zero(terms: usize) -> Normal {
        Normal { gram: DMatrix::zeros(terms, terms), right: DVector::zeros(terms), square: 0.0, count: 0 }
    }

    /// Adds a row.
    pub fn add(&mut self, values: &[f64], effort: f64) {
        for (i, a) in values.iter().enumerate() {
            self.right[i] += a * effort;
            for (j, b) in values.iter().enumerate() {
                self.gram[(i, j)] += a * b;
            }
        }
        self.square += effort * effort;
        self.count += 1;
    }

    /// The sum of all groups but one; None leaves out nothing.
    pub fn without(groups: &[Normal], left_out: Option<usize>) -> Normal {
        let mut sum = Normal::zero(groups.first().map_or(0, |group| group.right.len()));
        for (_, group) in groups.iter().enumerate().filter(|(g, _)| Some(*g) != left_out) {
            sum.gram += &group.gram;
            sum.right += &group.right;
            sum.square += group.square;
            sum.count += group.count;
        }
        sum
    }

    /// The coefficients with the least squares; what the rows do not determine is 0 along its eigenvector.
    pub fn solve(&self) -> DVector<f64> {
        let n = self.right.len();
        let scale = DVector::from_iterator(n, (0..n).map(|i| self.gram[(i, i)].sqrt()));
        let inverse = |i: usize| if scale[i] > 0.0 { 1.0 / scale[i] } else { 0.0 };
        let scaled = DMatrix::from_fn(n, n, |i, j| self.gram[(i, j)] * inverse(i) * inverse(j));
        let right = DVector::from_fn(n, |i, _| self.right[i] * inverse(i));
        let eigen = scaled.symmetric_eigen();
        let largest = eigen.eigenvalues.iter().fold(0.0, |most: f64, value| most.max(*value));
        let along = eigen.eigenvectors.tr_mul(&right);
        let kept = |i: usize| eigen.eigenvalues[i] > RANK * largest;
        let divided = DVector::from_fn(n, |i, _| if kept(i) { along[i] / eigen.eigenvalues[i] } else { 0.0 });
        let solution = &eigen.eigenvectors * divided;
        DVector::from_fn(n, |i, _| solution[i] * inverse(i))
    }

    /// Sum of the squared residuals with these coefficients.
    pub fn residual(&self, coefficients: &DVector<f64>) -> f64 {
        (self.square - 2.0 * self.right.dot(coefficients) + coefficients.dot(&(&self.gram * coefficients))).max(0.0)
    }
}

/// Groups of rows that are left out in turn: the runs where at least four of them have rows, else eight blocks of time.
///
/// `run` is the run as recorded for each sample. The result gives for each of `rows` its group, numbered from 0 without
/// gaps.
pub fn groups(run: &[u32], rows: &[usize]) -> Vec<usize> {
    const LEAST_RUNS: usize = 4;
    const BLOCKS: usize = 8;
    let mut number = std::collections::BTreeMap::new();
    for &i in rows {
        let next = number.len();
        number.entry(run[i]).or_insert(next);
    }
    match number.len() {
        0..LEAST_RUNS => (0..rows.len()).map(|at| at * BLOCKS / rows.len()).collect(),
        _ => rows.iter().map(|i| number[&run[*i]]).collect(),
    }
}

/// Mean and standard error of a statistic from its values with each group left out (jackknife).
pub fn jackknife(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let spread: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    (mean, ((n - 1.0) / n * spread).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_are_found_and_an_absent_term_is_zero() {
        let mut normal = Normal::zero(3);
        for i in 0..50 {
            let x = f64::from(i) * 0.1;
            normal.add(&[x, 1.0, 0.0], 2.0 * x - 3.0);
        }
        let found = normal.solve();
        assert!((found[0] - 2.0).abs() < 1e-9 && (found[1] + 3.0).abs() < 1e-9 && found[2] == 0.0, "{found}");
        assert!(normal.residual(&found) < 1e-9);
        assert!((normal.residual(&DVector::zeros(3)) - normal.square).abs() < 1e-9);
    }

    #[test]
    fn runs_are_the_groups_where_there_are_four_and_blocks_of_time_below() {
        let rows: Vec<usize> = (0..80).collect();
        let run = |runs: u32| (0..80).map(|i| i * runs / 80 + 5).collect::<Vec<u32>>();
        assert_eq!(groups(&run(4), &rows).last(), Some(&3));
        assert_eq!(groups(&run(3), &rows).last(), Some(&7));
        assert_eq!(groups(&run(3), &[]), Vec::<usize>::new());
    }

    #[test]
    fn the_jackknife_of_a_mean_is_its_standard_error() {
        let values = [1.0, 2.0, 4.0, 7.0];
        let left_out: Vec<f64> = values.iter().map(|x| (14.0 - x) / 3.0).collect();
        let (mean, error) = jackknife(&left_out);
        assert!((mean - 3.5).abs() < 1e-12 && (error - 1.75f64.sqrt()).abs() < 1e-12, "{mean} {error}");
    }
}
