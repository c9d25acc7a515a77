//! Base parameters: the combinations of inertial parameters that torques show, by a column-pivoted QR decomposition of
//! the regressor over random states (M. Gautier, Numerical calculation of the base inertial parameters of robots,
//! 1991).

use crate::regressor::regressor;
use crate::tree::Tree;
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// A column counts as independent where more than this part of the largest is its own.
const TOLERANCE: f64 = 1e-8;

/// Columns of a regressor that span it, and how the others depend on them.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseParameters {
    /// Columns that span, ascending.
    pub independent: Vec<usize>,
    /// The other columns, ascending.
    pub dependent: Vec<usize>,
    /// `dependent = independent * combination`: one row per independent column, one column per dependent one.
    pub combination: DMatrix<f64>,
}

impl BaseParameters {
    /// Base parameters of a matrix with one column per parameter.
    pub fn of(matrix: &DMatrix<f64>) -> Self {
        let (rows, n) = matrix.shape();
        let mut rest = matrix.clone();
        let mut scale: Vec<f64> = (0..n).map(|i| rest.column(i).norm()).collect();
        let largest = scale.iter().copied().fold(0.0, f64::max);
        scale.iter_mut().for_each(|s| *s = if *s > TOLERANCE * largest { *s } else { 0.0 });
        for (i, s) in scale.iter().enumerate() {
            let factor = if *s > 0.0 { 1.0 / s } else { 0.0 };
            rest.column_mut(i).scale_mut(factor);
        }
        let scaled = rest.clone();
        let mut independent = Vec::new();
        // Gram-Schmidt with pivoting, twice for each pivot: as accurate as reflections for so few columns.
        let mut basis: Vec<DVector<f64>> = Vec::new();
        while basis.len() < rows.min(n) {
            let free = (0..n).filter(|i| !independent.contains(i));
            let Some((pivot, norm)) =
                free.map(|i| (i, rest.column(i).norm())).reduce(|best, next| if next.1 > best.1 { next } else { best })
            else {
                break;
            };
            if norm <= TOLERANCE {
                break;
            }
            let mut direction: DVector<f64> = rest.column(pivot).into_owned();
            for other in &basis {
                direction.axpy(-other.dot(&direction), other, 1.0);
            }
            direction /= direction.norm();
            for i in 0..n {
                let along = direction.dot(&rest.column(i));
                rest.column_mut(i).axpy(-along, &direction, 1.0);
            }
            independent.push(pivot);
            basis.push(direction);
        }
        independent.sort_unstable();
        let dependent: Vec<usize> = (0..n).filter(|i| !independent.contains(i)).collect();
        let spanning = scaled.select_columns(&independent);
        let mut combination = DMatrix::zeros(independent.len(), dependent.len());
        let gram = spanning.transpose() * &spanning;
        if let Some(factor) = gram.cholesky() {
            combination = factor.solve(&(spanning.transpose() * scaled.select_columns(&dependent)));
        }
        for (column, &d) in dependent.iter().enumerate() {
            for (row, &i) in independent.iter().enumerate() {
                let entry = combination[(row, column)] * scale[d] / scale[i];
                combination[(row, column)] = if entry.abs() < 1e-6 || scale[d] == 0.0 { 0.0 } else { entry };
            }
        }
        Self { independent, dependent, combination }
    }

    /// Base parameters of the tree's inertial parameters, from `samples` random states.
    pub fn of_tree(tree: &Tree, samples: usize, seed: u64) -> Self {
        let n = tree.len();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut matrix = DMatrix::zeros(samples * n, 10 * n);
        for sample in 0..samples {
            let mut draw = |limit: f64| -> Vec<f64> { (0..n).map(|_| random.random_range(-limit..limit)).collect() };
            let (q, v, a) = (draw(std::f64::consts::PI), draw(2.0), draw(10.0));
            matrix.rows_mut(sample * n, n).copy_from(&regressor(tree, &q, &v, &a));
        }
        Self::of(&matrix)
    }

    /// Number of base parameters.
    pub fn len(&self) -> usize {
        self.independent.len()
    }

    /// True where torques show nothing.
    pub fn is_empty(&self) -> bool {
        self.independent.is_empty()
    }

    /// Values of the base parameters: the independent ones with what depends on them.
    pub fn values(&self, parameters: &[f64]) -> Vec<f64> {
        let own = DVector::from_iterator(self.len(), self.independent.iter().map(|&i| parameters[i]));
        let other = DVector::from_iterator(self.dependent.len(), self.dependent.iter().map(|&i| parameters[i]));
        (own + &self.combination * other).iter().copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_that_is_a_sum_of_others_is_found_with_its_weights() {
        let mut matrix = DMatrix::from_fn(40, 4, |i, j| ((i + 1) as f64 * (j as f64 + 0.7)).sin());
        let sum = 2.0 * matrix.column(0) - 0.5 * matrix.column(2);
        matrix.set_column(3, &sum);
        let base = BaseParameters::of(&matrix);
        assert_eq!(base.len(), 3);
        let parameters = [0.3, -1.0, 2.0, 0.7];
        let torque = &matrix * DVector::from_row_slice(&parameters);
        let reduced = matrix.select_columns(&base.independent) * DVector::from_vec(base.values(&parameters));
        assert!((torque - reduced).norm() < 1e-9);
    }
}
