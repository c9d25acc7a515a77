//! Rows of every fold, thinned out; host.

use super::observations::{Row, decimated};
use crate::choice::Folds;

/// Most rows that a fold is fitted to.
const FITTED_ROWS: usize = 4_000;
/// Most rows that a fold is judged by.
const JUDGED_ROWS: usize = 2_500;

/// The rows that one fold fits to, and those that it leaves out.
#[derive(Clone, Debug)]
pub struct FoldRows {
    /// Number of the grouping that the fold is of.
    pub grouping: usize,
    /// Rows that it fits to.
    pub fitted: Vec<Row>,
    /// Rows that it leaves out.
    pub judged: Vec<Row>,
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
