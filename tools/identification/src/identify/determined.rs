//! Terms that the data tell from all others; host.
//!
//! The measure is the part of a column's square that the other linear columns do not explain: the inverse of its
//! variance inflation factor. Where it is small, noise decides how the sum of several terms is divided among them, and
//! on another motion the parts no longer cancel.

use super::freedom::Freedom;
use super::linear::{OWN_PART, add_to_normal_sums, dependences, inverse, normal_equations, normal_sums, sum_over_rows};
use super::nonlinear::Fit;
use super::observations::Row;
use crate::friction_parameter::{FrictionParameter as P, Role};
use crate::rigid::RigidRegressor;
use nalgebra::DMatrix;

/// True where the column that a freedom adds to the fit has at least [`OWN_PART`] of its own, and for freedoms without
/// one.
pub fn stands_for_itself(fit: &Fit, freedom: Freedom) -> bool {
    let layout = &fit.candidate.layout;
    let Some(column) = size(freedom).and_then(|parameter| layout.column_of(parameter)) else { return true };
    let linear = |i: &usize| matches!(layout.columns[*i].role, Role::Coefficient | Role::Factor);
    let others: Vec<usize> = (0..layout.len()).filter(|i| linear(i) && *i != column).collect();
    own_part(&fit.at.hessian, column, &others) >= OWN_PART
}

/// The part of a column's square that the others do not explain, from J^T J; 0 where they explain it to the last digit.
fn own_part(hessian: &DMatrix<f64>, column: usize, others: &[usize]) -> f64 {
    let dependent = dependences(hessian, others);
    let mut free: Vec<usize> = others.iter().copied().filter(|i| dependent.iter().all(|d| d.column != *i)).collect();
    free.push(column);
    let last = free.len() - 1;
    inverse(hessian, &free).map_or(0.0, |inverse| 1.0 / (inverse[(last, last)] * hessian[(column, column)]))
}

/// The part of a constant over the rows that the rigid part does not explain: over a small range of positions gravity
/// is nearly constant.
pub fn own_part_of_offset(rows: &[Row], regressors: &[RigidRegressor]) -> f64 {
    let n = regressors.len() + 1;
    let sums = sum_over_rows(rows, normal_sums(n), |sums, row| {
        let mut columns: Vec<f64> = regressors.iter().map(|&regressor| row.regressors[regressor.index()]).collect();
        columns.push(1.0);
        add_to_normal_sums(sums, &columns, 0.0);
    });
    let hessian = normal_equations(&sums, n, rows.len()).hessian;
    own_part(&hessian, n - 1, &(0..n - 1).collect::<Vec<_>>())
}

/// The parameter whose column a freedom adds; nothing for several at once.
fn size(freedom: Freedom) -> Option<P> {
    match freedom {
        Freedom::AsymmetricCoulomb => Some(P::CoulombNegative),
        Freedom::AsymmetricBreakaway => Some(P::BreakawayNegative),
        Freedom::Term(term) => term.facts().size,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction_model::JointState;

    /// The own part of an offset beside gravity's sine and cosine over positions of `range` rad.
    fn own(range: f64) -> f64 {
        let row = |i: i32| {
            let position = range * (f64::from(i) / 999.0 - 0.5);
            let mut regressors = [0.0; RigidRegressor::ALL.len()];
            regressors[RigidRegressor::GravitySine.index()] = position.sin();
            regressors[RigidRegressor::GravityCosine.index()] = position.cos();
            Row { joint: JointState::default(), regressors, effort: 0.0 }
        };
        let rows: Vec<Row> = (0..1000).map(row).collect();
        own_part_of_offset(&rows, &[RigidRegressor::GravitySine, RigidRegressor::GravityCosine])
    }

    #[test]
    fn an_offset_is_told_from_gravity_beyond_ninety_degrees() {
        assert!(own(1.0) < 2e-3 && own(6.0) > 0.9);
        let (below, above) = (own(1.55), own(1.65));
        assert!(below < OWN_PART && OWN_PART < above, "{below} {above}");
    }

    #[test]
    fn without_gravity_an_offset_stands_alone() {
        let row = Row { joint: JointState::default(), regressors: [0.0; RigidRegressor::ALL.len()], effort: 0.0 };
        assert!((own_part_of_offset(&[row; 10], &[]) - 1.0).abs() < 1e-12);
    }
}
