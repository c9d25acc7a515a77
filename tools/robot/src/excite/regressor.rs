//! Regressor of a motion of all joints, and its singular values; host.
//!
//! W has a row for each joint and sample, in units of that joint's effort, and a column for each base parameter, rotor
//! inertia and friction coefficient (viscous, Coulomb, offset of each joint). Columns are in units of their RMS over
//! reference motions, which is the same for all motions: a timid motion is worse, not only a one-sided one. With that,
//! standard errors of all unknowns grow with 1 / sigma_min.

use crate::equations::rigid_columns;
use crate::friction_columns::SLOPE;
use crate::least_squares::base;
use nalgebra::{DMatrix, DVector};
use plant::excitation::Reference;
use rigid_body::Robot;

/// Weights of the cost: of cond(W^T W), and of 1 / sigma_min. The first alone is blind to the motion's size.
const WEIGHTS: (f64, f64) = (1.0, 100.0);
/// Part of the largest joint's effort that every joint's counts as at least.
const LEAST_EFFORT: f64 = 1e-6;

/// The motion of every joint, sample by sample.
pub type Motion = Vec<Vec<Reference>>;

/// Regressor that tells motions apart.
#[derive(Clone, Debug)]
pub struct Regressor<'a> {
    robot: &'a Robot,
    /// Inertial parameters and rotor inertias that are base parameters.
    independent: Vec<usize>,
    /// Inverse of each joint's effort.
    rows: Vec<f64>,
    /// Inverse of each column's RMS.
    columns: Vec<f64>,
}

/// Singular values of a motion's regressor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Condition number: largest over least; infinite where the motion leaves an unknown open.
    pub condition: f64,
    /// Least singular value over the root of the number of rows.
    pub least: f64,
}

impl Score {
    /// lambda_1 cond(W^T W) + lambda_2 / sigma_min.
    pub fn cost(&self) -> f64 {
        WEIGHTS.0 * self.condition * self.condition + WEIGHTS.1 / self.least
    }
}

impl<'a> Regressor<'a> {
    /// Regressor in units of these reference motions.
    pub fn new(robot: &'a Robot, reference: &[Motion]) -> Self {
        let n = robot.tree.len();
        let independent = base(robot, 1).independent;
        let mut unknowns = robot.tree.parameters();
        unknowns.extend(robot.drives.iter().map(|drive| drive.rotor_inertia.unwrap_or_default()));
        let unknowns = DVector::from_vec(unknowns);
        let (mut squares, mut count) = (vec![0.0; n], 0.0);
        for motion in reference {
            for i in 0..motion[0].len() {
                let efforts = columns_at(robot, motion, i) * &unknowns;
                squares.iter_mut().zip(efforts.iter()).for_each(|(square, effort)| *square += effort * effort);
                count += 1.0;
            }
        }
        let efforts: Vec<f64> = squares.iter().map(|square: &f64| (square / f64::max(count, 1.0)).sqrt()).collect();
        let least = (LEAST_EFFORT * efforts.iter().copied().fold(0.0, f64::max)).max(f64::MIN_POSITIVE);
        let rows = efforts.iter().map(|effort| 1.0 / effort.max(least)).collect();
        let width = independent.len() + 3 * n;
        let mut own = Self { robot, independent, rows, columns: vec![1.0; width] };
        let (mut squares, mut count) = (DVector::zeros(width), 0.0);
        for motion in reference {
            let matrix = own.matrix(motion);
            squares += DVector::from_iterator(width, matrix.column_iter().map(|column| column.norm_squared()));
            count += matrix.nrows() as f64;
        }
        let inverse = |square: &f64| if *square > 0.0 { (count / square).sqrt() } else { 0.0 };
        own.columns = squares.iter().map(inverse).collect();
        own
    }

    /// W of a motion.
    pub fn matrix(&self, motion: &Motion) -> DMatrix<f64> {
        let (n, samples, width) = (motion.len(), motion[0].len(), self.independent.len());
        let mut matrix = DMatrix::zeros(n * samples, width + 3 * n);
        for i in 0..samples {
            let rigid = columns_at(self.robot, motion, i);
            for (j, row) in self.rows.iter().enumerate() {
                let line = n * i + j;
                for (at, &column) in self.independent.iter().enumerate() {
                    matrix[(line, at)] = row * self.columns[at] * rigid[(j, column)];
                }
                let v = motion[j][i].velocity;
                for (k, value) in [v, (SLOPE * v).tanh(), 1.0].into_iter().enumerate() {
                    let at = width + 3 * j + k;
                    matrix[(line, at)] = row * self.columns[at] * value;
                }
            }
        }
        matrix
    }

    /// Singular values of a motion's regressor.
    pub fn score(&self, motion: &Motion) -> Score {
        let matrix = self.matrix(motion);
        let values = matrix.tr_mul(&matrix).symmetric_eigenvalues();
        let (least, most) = (values.min(), values.max());
        // A root of the rounding of the squares is left of zero.
        if least <= 1e-14 * most {
            return Score { condition: f64::INFINITY, least: 0.0 };
        }
        Score { condition: (most / least).sqrt(), least: (least / matrix.nrows() as f64).sqrt() }
    }
}

/// Rigid-body columns of all joints at a sample.
fn columns_at(robot: &Robot, motion: &Motion, i: usize) -> DMatrix<f64> {
    let of = |value: fn(&Reference) -> f64| -> Vec<f64> { motion.iter().map(|joint| value(&joint[i])).collect() };
    rigid_columns(robot, &of(|m| m.position), &of(|m| m.velocity), &of(|m| m.acceleration))
}
