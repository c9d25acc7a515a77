//! A structure fitted without each fold in turn, and its error there; host.
//!
//! Every fold descends from the fit over all rows: the shapes start where all motions put them and move to where the
//! rest of the motions wants them.

use super::fold_rows::FoldRows;
use super::nonlinear::{Effort, Fit, Problem};
use crate::friction_model::FrictionModel;
use crate::rigid::RigidParameters;
use rayon::prelude::*;

/// Length of a fold's descent.
const DESCENT: Effort = Effort { iterations: 10, tolerance: 1e-5 };

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
