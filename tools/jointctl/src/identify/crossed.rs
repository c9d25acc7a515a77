//! A structure fitted without each fold in turn, and its error there; host.
//!
//! Every fold descends from the fit over all rows: the shapes start where all motions put them and move to where the rest of the motions
//! wants them.

use super::nonlinear::{Effort, Fit, Problem};
use super::observations::{Row, decimated};
use crate::choice::Folds;
use crate::friction_model::FrictionModel;
use crate::rigid::RigidParameters;
use rayon::prelude::*;

/// Most rows that a fold is fitted to.
const FITTED_ROWS: usize = 4_000;
/// Most rows that a fold is judged by.
const JUDGED_ROWS: usize = 2_500;
/// How far a fold descends.
const DESCENT: Effort = Effort { iterations: 10, tolerance: 1e-5 };

/// The rows that one fold fits to, and those that it leaves out.
#[derive(Clone, Debug)]
pub struct FoldRows {
    grouping: usize,
    fitted: Vec<Row>,
    judged: Vec<Row>,
}

/// A structure fitted without one fold.
#[derive(Clone, Debug)]
pub struct FoldFit {
    /// Number of the grouping that the fold is of.
    pub grouping: usize,
    /// Root mean square of effort - rigid - friction over the rows that were left out.
    pub rmse: f64,
    /// Rigid part.
    pub rigid: RigidParameters,
    /// Friction.
    pub friction: FrictionModel,
}

/// The rows of every fold, from all rows and the folds that leave each of them out.
pub fn fold_rows(rows: &[Row], left_out: &[u8], folds: &Folds) -> Vec<FoldRows> {
    let of_fold = |fold: usize| {
        let (judged, fitted): (Vec<_>, Vec<_>) =
            rows.iter().zip(left_out).partition(|(_, left_out)| **left_out >> fold & 1 == 1);
        let rows = |pairs: Vec<(&Row, &u8)>, limit| {
            decimated(&pairs.into_iter().map(|(row, _)| *row).collect::<Vec<Row>>(), limit)
        };
        FoldRows {
            grouping: folds.groupings[fold],
            fitted: rows(fitted, FITTED_ROWS),
            judged: rows(judged, JUDGED_ROWS),
        }
    };
    (0..folds.len()).map(of_fold).collect()
}

/// The fit's structure without each fold.
pub fn crossed(problem: &Problem, fit: &Fit) -> Vec<FoldFit> {
    let without = |fold: &FoldRows| {
        let found = fit.candidate.descend(problem, &fold.fitted, &fit.x, DESCENT);
        let rmse = found.rmse(&fold.judged).unwrap_or(f64::INFINITY);
        FoldFit { grouping: fold.grouping, rmse, rigid: found.rigid, friction: found.friction }
    };
    problem.folds.par_iter().map(without).collect()
}

/// The errors alone.
pub fn errors(folds: &[FoldFit]) -> Vec<f64> {
    folds.iter().map(|fold| fold.rmse).collect()
}

/// One number for all folds: the root mean square of their errors; nothing without folds.
pub fn overall(errors: &[f64]) -> Option<f64> {
    (!errors.is_empty()).then(|| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt())
}
