//! Errors of rigid parts beside Coulomb and viscous friction on folds that are left out; host.
//!
//! All is linear once the slope of the Coulomb friction is known, so every fold is solved from sums over its rows.

use super::linear::{add_to_normal_sums, bounded_step, dependences, normal_equations, normal_sums, sum_over_rows};
use super::observations::Row;
use crate::choice::Folds;
use crate::levenberg_marquardt::NormalEquations;
use crate::rigid::{RigidModel, RigidRegressor};
use nalgebra::DVector;

/// Columns of Coulomb and viscous friction with an offset, before those of the rigid part.
const FRICTION: usize = 3;
/// All columns.
const COLUMNS: usize = FRICTION + RigidRegressor::ALL.len();

/// Normal equations over the rows that a fold fits to, and over those that it judges.
pub struct FoldSums {
    fitted: NormalEquations,
    judged: NormalEquations,
}

/// The sums of every fold. `left_out` tells for each row which folds leave it out, one bit each.
pub fn of(rows: &[Row], left_out: &[u8], folds: &Folds, coulomb_slope: f64) -> Vec<FoldSums> {
    (0..folds.len()).map(|fold| FoldSums::of(rows, left_out, fold, coulomb_slope)).collect()
}

/// Error of a rigid part in every fold.
pub fn errors(sums: &[FoldSums], rigid: &RigidModel) -> Vec<f64> {
    sums.iter().map(|sums| sums.error(rigid)).collect()
}

impl FoldSums {
    fn of(rows: &[Row], left_out: &[u8], fold: usize, coulomb_slope: f64) -> Self {
        let add = |sums: &mut [f64], row: &&Row| {
            let mut values = [0.0; COLUMNS];
            let velocity = row.joint.velocity;
            values[..FRICTION].copy_from_slice(&[velocity, (coulomb_slope * velocity).tanh(), 1.0]);
            values[FRICTION..].copy_from_slice(&row.regressors);
            add_to_normal_sums(sums, &values, -row.effort);
        };
        let (judged, fitted): (Vec<_>, Vec<_>) =
            rows.iter().zip(left_out).partition(|(_, left_out)| **left_out >> fold & 1 == 1);
        let equations = |pairs: Vec<(&Row, &u8)>| {
            let rows: Vec<&Row> = pairs.into_iter().map(|(row, _)| row).collect();
            normal_equations(&sum_over_rows(&rows, normal_sums(COLUMNS), add), COLUMNS, rows.len())
        };
        Self { fitted: equations(fitted), judged: equations(judged) }
    }

    /// Root mean square of what friction and a rigid part, fitted to the rest, leave of the rows that are judged.
    fn error(&self, rigid: &RigidModel) -> f64 {
        let mut x = DVector::zeros(COLUMNS);
        let fixed = rigid.fixed();
        RigidRegressor::ALL.into_iter().for_each(|r| x[FRICTION + r.index()] = fixed.coefficient(r));
        let regressors = rigid.regressors().into_iter().map(|regressor| FRICTION + regressor.index());
        let columns: Vec<usize> = (0..FRICTION).chain(regressors).collect();
        let dependent = dependences(&self.fitted.hessian, &columns);
        let free: Vec<usize> =
            columns.iter().copied().filter(|i| dependent.iter().all(|dependence| dependence.column != *i)).collect();
        let bounds = vec![(f64::NEG_INFINITY, f64::INFINITY); free.len()];
        let (solved, _) = bounded_step(&at(&self.fitted, &x), &free, bounds);
        free.into_iter().zip(solved.iter()).for_each(|(column, value)| x[column] += *value);
        at(&self.judged, &x).cost.max(0.0).sqrt()
    }
}

/// The normal equations at another point than zero.
fn at(equations: &NormalEquations, x: &DVector<f64>) -> NormalEquations {
    let NormalEquations { cost, gradient, hessian } = equations;
    NormalEquations {
        cost: cost + 2.0 * gradient.dot(x) + x.dot(&(hessian * x)),
        gradient: gradient + hessian * x,
        hessian: hessian.clone(),
    }
}
