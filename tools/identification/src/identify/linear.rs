//! The linear algebra under the identification: sums over rows, columns that depend on each other, bounded solutions;
//! host.
//!
//! Sums run over chunks of fixed size, in parallel, and are added in the order of the rows: the result does not depend
//! on the number of threads.

use crate::levenberg_marquardt::{Damping, LeastSquares, NormalEquations, Options, minimise};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Least own part of a term that the data determine: its standard error is then ten times that of a term that stands
/// alone.
pub const OWN_PART: f64 = 0.01;

/// Rows that one thread sums up at a time.
const CHUNK: usize = 1024;
/// A column of which less than this fraction of its square is left when the columns before it are projected out cannot
/// be told from them: its standard error would be ten thousand times that of a column that stands alone.
const INDEPENDENCE: f64 = 1e-8;
/// A column is named as a partner in a dependence when it explains at least this fraction of the dependent one.
const PARTNER: f64 = 0.05;

/// `width` sums over all rows of what `add` adds to them.
pub fn sum_over_rows<R: Sync>(rows: &[R], width: usize, add: impl Fn(&mut [f64], &R) + Sync) -> Vec<f64> {
    let chunks: Vec<Vec<f64>> = rows
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut sums = vec![0.0; width];
            chunk.iter().for_each(|row| add(&mut sums, row));
            sums
        })
        .collect();
    let mut total = vec![0.0; width];
    for chunk in chunks {
        total.iter_mut().zip(chunk).for_each(|(sum, part)| *sum += part);
    }
    total
}

/// Number of sums that the normal equations of `n` columns take.
pub const fn normal_sums(n: usize) -> usize {
    1 + n + n * (n + 1) / 2
}

/// Adds one row of the Jacobian and its residual to the sums: square, gradient, lower triangle row by row.
#[inline]
pub fn add_to_normal_sums(sums: &mut [f64], jacobian: &[f64], residual: f64) {
    let n = jacobian.len();
    let (square, rest) = sums.split_at_mut(1);
    let (gradient, mut triangle) = rest.split_at_mut(n);
    square[0] += residual * residual;
    for (i, &by) in jacobian.iter().enumerate() {
        let (line, below) = triangle.split_at_mut(i + 1);
        triangle = below;
        // Half of the columns belong to the other direction of motion.
        if by != 0.0 {
            gradient[i] += by * residual;
            // Not zipped: the shortest side of a handful of columns took longer to find than the sum.
            for (j, sum) in line.iter_mut().enumerate() {
                *sum += by * jacobian[j];
            }
        }
    }
}

/// The normal equations of `n` columns from their sums over `count` rows.
pub fn normal_equations(sums: &[f64], n: usize, count: usize) -> NormalEquations {
    let mean = 1.0 / count.max(1) as f64;
    let mut hessian = DMatrix::zeros(n, n);
    let mut at = 1 + n;
    for i in 0..n {
        for j in 0..=i {
            hessian[(i, j)] = sums[at] * mean;
            hessian[(j, i)] = sums[at] * mean;
            at += 1;
        }
    }
    NormalEquations {
        cost: sums[0] * mean,
        gradient: DVector::from_iterator(n, sums[1..=n].iter().map(|s| s * mean)),
        hessian,
    }
}

/// A column that the columns before it explain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dependence {
    /// The column.
    pub column: usize,
    /// Columns that explain it; none: the column is zero everywhere.
    pub explained_by: Vec<usize>,
}

/// The columns that depend on earlier ones among `considered`, from J^T J.
pub fn dependences(hessian: &DMatrix<f64>, considered: &[usize]) -> Vec<Dependence> {
    let mut kept: Vec<usize> = Vec::new();
    let mut found = Vec::new();
    for &column in considered {
        let square = hessian[(column, column)];
        let scale = |i: usize| hessian[(i, i)].sqrt();
        let cosines = DVector::from_iterator(
            kept.len(),
            kept.iter().map(|&i| hessian[(i, column)] / (scale(i) * square.sqrt().max(f64::MIN_POSITIVE))),
        );
        let correlation = DMatrix::from_fn(kept.len(), kept.len(), |a, b| {
            hessian[(kept[a], kept[b])] / (scale(kept[a]) * scale(kept[b]))
        });
        // Cholesky cannot fail: every kept column was independent of those before it.
        let weights = correlation.cholesky().map(|factor| factor.solve(&cosines)).unwrap_or_else(|| cosines.clone());
        if square > 0.0 && 1.0 - weights.dot(&cosines) > INDEPENDENCE {
            kept.push(column);
        } else {
            let partners = kept.iter().zip(&weights).filter(|(_, w)| square > 0.0 && w.abs() > PARTNER);
            found.push(Dependence { column, explained_by: partners.map(|(&i, _)| i).collect() });
        }
    }
    found
}

/// Inverse of J^T J over the columns `free`; nothing when they depend on each other.
pub fn inverse(hessian: &DMatrix<f64>, free: &[usize]) -> Option<DMatrix<f64>> {
    let scale: Vec<f64> = free.iter().map(|&i| hessian[(i, i)].sqrt()).collect();
    let n = free.len();
    let correlation = DMatrix::from_fn(n, n, |a, b| hessian[(free[a], free[b])] / (scale[a] * scale[b]));
    let inverse = correlation.cholesky()?.inverse();
    Some(DMatrix::from_fn(n, n, |a, b| inverse[(a, b)] / (scale[a] * scale[b])))
}

/// The quadratic that the normal equations at a point stand for, as a function of the step of some columns.
struct Quadratic {
    cost: f64,
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
}

impl LeastSquares for Quadratic {
    fn cost(&self, step: &DVector<f64>) -> f64 {
        self.cost + 2.0 * self.gradient.dot(step) + step.dot(&(&self.hessian * step))
    }

    fn normal_equations(&self, step: &DVector<f64>) -> NormalEquations {
        let gradient = &self.gradient + &self.hessian * step;
        NormalEquations { cost: self.cost(step), gradient, hessian: self.hessian.clone() }
    }
}

/// The step of the columns `free` that minimises the quadratic within the bounds of the step, and the cost there.
pub fn bounded_step(at: &NormalEquations, free: &[usize], bounds: Vec<(f64, f64)>) -> (DVector<f64>, f64) {
    let n = free.len();
    let quadratic = Quadratic {
        cost: at.cost,
        gradient: DVector::from_iterator(n, free.iter().map(|&i| at.gradient[i])),
        hessian: DMatrix::from_fn(n, n, |a, b| at.hessian[(free[a], free[b])]),
    };
    let options = Options {
        max_iterations: 50,
        gradient_tolerance: 0.0,
        cost_tolerance: 1e-12,
        mu_initial: 1e-12,
        mu_max: 1e4,
        damping: Damping::Diagonal,
        bounds,
    };
    let found = minimise(&quadratic, &DVector::zeros(n), &options, |_, _, _| ControlFlow::Continue(()));
    (found.x, found.at.cost)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn equations(rows: &[[f64; 3]], residual: &[f64]) -> NormalEquations {
        let joined: Vec<([f64; 3], f64)> = rows.iter().copied().zip(residual.iter().copied()).collect();
        let sums = sum_over_rows(&joined, normal_sums(3), |sums, (row, r)| add_to_normal_sums(sums, row, *r));
        normal_equations(&sums, 3, rows.len())
    }

    fn rows() -> Vec<[f64; 3]> {
        (0..5000).map(|i| f64::from(i) * 0.1).map(|x| [1.0, x.sin(), (1.7 * x).cos()]).collect()
    }

    #[test]
    fn a_column_that_is_a_sum_of_others_is_named_with_them() {
        let rows: Vec<[f64; 3]> = rows().iter().map(|r| [r[0], r[1], 2.0 * r[0] - 3.0 * r[1]]).collect();
        let at = equations(&rows, &vec![0.0; rows.len()]);
        assert_eq!(dependences(&at.hessian, &[0, 1, 2]), [Dependence { column: 2, explained_by: vec![0, 1] }]);
    }

    #[test]
    fn a_column_of_zeros_is_named_alone_and_independent_columns_are_not_named() {
        let mut rows = rows();
        assert!(dependences(&equations(&rows, &vec![0.0; rows.len()]).hessian, &[0, 1, 2]).is_empty());
        rows.iter_mut().for_each(|row| row[1] = 0.0);
        let at = equations(&rows, &vec![0.0; rows.len()]);
        assert_eq!(dependences(&at.hessian, &[0, 1, 2]), [Dependence { column: 1, explained_by: vec![] }]);
    }

    #[test]
    fn a_bounded_step_is_the_least_squares_solution_or_the_best_point_of_the_bound() {
        let rows = rows();
        // Residual at 0 of a model whose true coefficients are 2, -1, 0.5.
        let residual: Vec<f64> = rows.iter().map(|r| -(2.0 * r[0] - r[1] + 0.5 * r[2])).collect();
        let at = equations(&rows, &residual);
        let free = (f64::NEG_INFINITY, f64::INFINITY);
        let (x, cost) = bounded_step(&at, &[0, 1, 2], vec![free; 3]);
        assert!(
            (x[0] - 2.0).abs() < 1e-9 && (x[1] + 1.0).abs() < 1e-9 && (x[2] - 0.5).abs() < 1e-9 && cost.abs() < 1e-12
        );
        let (x, _) = bounded_step(&at, &[0, 1, 2], vec![free, (0.0, 9.0), free]);
        let (others, _) = bounded_step(&at, &[0, 2], vec![free; 2]);
        assert!(x[1] == 0.0 && (x[0] - others[0]).abs() < 1e-9 && (x[2] - others[1]).abs() < 1e-9, "{x}");
    }

    #[test]
    fn sums_do_not_depend_on_the_number_of_threads() {
        let rows = rows();
        let sums = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| sum_over_rows(&rows, normal_sums(3), |sums, row| add_to_normal_sums(sums, row, row[1])))
        };
        assert_eq!(sums(1), sums(3));
    }
}
