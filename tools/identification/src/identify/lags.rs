//! Number of lagged accelerations in the rigid part: as many as pay on motions that were left out, beside Coulomb and
//! viscous friction; host.
//!
//! All is linear once the slope of the Coulomb friction is known, so every fold is solved from sums over its rows.
//! Accelerations of one motion explain each other, and what they explain there they do not explain elsewhere: without
//! motions to leave out there are none.

use super::linear::{add_to_normal_sums, bounded_step, dependences, normal_equations, normal_sums, sum_over_rows};
use super::observations::Row;
use crate::choice::{Decision, Folds, compare, rank};
use crate::levenberg_marquardt::NormalEquations;
use crate::rigid::{LAGS, RigidModel, RigidRegressor};
use nalgebra::DVector;

/// Least fall of the error, as a fraction. Below it lie filters and sampling, which differ between acceleration and
/// effort on a rigid joint, too.
const LEAST_GAIN: f64 = 0.02;
/// Columns of Coulomb and viscous friction with an offset, before those of the rigid part.
const FRICTION: usize = 3;
/// All columns.
const COLUMNS: usize = FRICTION + RigidRegressor::ALL.len();

/// Number of [`LAGS`] that the rigid part gets, and what to say about it. `left_out` tells for each row which folds
/// leave it out, one bit each.
pub fn choose(
    rows: &[Row],
    left_out: &[u8],
    folds: &Folds,
    rigid: &RigidModel,
    coulomb_slope: f64,
    decision: Decision,
) -> (usize, Option<String>) {
    let offered = rigid.inertia && (decision == Decision::Keep || decision == Decision::Choose && folds.motions);
    if !offered || folds.len() < 2 {
        return (0, None);
    }
    let sums: Vec<Sums> = (0..folds.len()).map(|fold| Sums::of(rows, left_out, fold, coulomb_slope)).collect();
    let numbers: Vec<usize> = (0..=LAGS.len()).step_by(2).collect();
    let errors: Vec<Vec<f64>> = numbers
        .iter()
        .map(|&lags| {
            let columns = columns(&RigidModel { lags, ..*rigid });
            sums.iter().map(|sums| sums.error(&columns)).collect()
        })
        .collect();
    let best = best(&errors, &numbers, decision);
    let change = compare(&errors[0], &errors[best]);
    let note = format!(
        "{} lagged accelerations in the rigid part, up to {:.0} ms to either side: error on left-out motions {:+.1} +- {:.1} %",
        numbers[best],
        numbers[best].checked_sub(1).map_or(0.0, |last| 1e3 * LAGS[last].abs()),
        change.percent(),
        100.0 * change.standard_error
    );
    (numbers[best], (best > 0).then_some(note))
}

/// The place of the number that is taken, from the errors of every number in every fold.
fn best(errors: &[Vec<f64>], numbers: &[usize], decision: Decision) -> usize {
    let mean = |i: usize| compare(&errors[0], &errors[i]).mean;
    match decision {
        Decision::Never => 0,
        Decision::Keep => (1..numbers.len()).min_by(|a, b| mean(*a).total_cmp(&mean(*b))).unwrap_or(0),
        Decision::Choose => Some(rank(errors, numbers)[0]).filter(|i| mean(*i) <= (1.0 - LEAST_GAIN).ln()).unwrap_or(0),
    }
}

/// The columns of a rigid part beside Coulomb and viscous friction, in order.
fn columns(rigid: &RigidModel) -> Vec<usize> {
    (0..FRICTION).chain(rigid.regressors().into_iter().map(|regressor| FRICTION + regressor.index())).collect()
}

/// Normal equations over the rows that a fold fits to, and over those that it judges.
struct Sums {
    fitted: NormalEquations,
    judged: NormalEquations,
}

impl Sums {
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

    /// Root mean square of what the columns, fitted to the rest, leave of the rows that are judged.
    fn error(&self, columns: &[usize]) -> f64 {
        let dependent = dependences(&self.fitted.hessian, columns);
        let free: Vec<usize> =
            columns.iter().copied().filter(|i| dependent.iter().all(|dependence| dependence.column != *i)).collect();
        let bounds = vec![(f64::NEG_INFINITY, f64::INFINITY); free.len()];
        let (solved, _) = bounded_step(&self.fitted, &free, bounds);
        let mut x = DVector::zeros(COLUMNS);
        free.into_iter().zip(solved.iter()).for_each(|(column, value)| x[column] = *value);
        let square = self.judged.cost + 2.0 * self.judged.gradient.dot(&x) + x.dot(&(&self.judged.hessian * &x));
        square.max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::super::observations::{rows, used};
    use super::super::synthetic::{RIGID, drive, motion};
    use super::*;
    use crate::choice::grouping;
    use crate::friction_model::{FrictionModel, Term, Terms};
    use crate::rigid::RigidParameters;
    use crate::samples::Samples;

    /// A joint whose link lags 60 ms behind its motor, or one without, and folds over its motion.
    fn joint(elastic: bool) -> (Samples, Folds) {
        let friction = FrictionModel { viscous: 0.9, terms: Terms::of(&[Term::Viscous]), ..FrictionModel::default() };
        let rigid = RigidParameters { inertia: 0.5, ..RigidParameters::default() };
        let link = 1.5;
        let mut samples = motion(4_000);
        drive(&mut samples, &rigid, &friction, 0.02, 1);
        if elastic {
            let lagging: Vec<f64> =
                (0..samples.len()).map(|i| samples.acceleration[samples.shifted(i, -0.06)]).collect();
            samples.effort.iter_mut().zip(lagging).for_each(|(effort, a)| *effort += link * a);
        } else {
            samples.effort.iter_mut().zip(&samples.acceleration).for_each(|(effort, a)| *effort += link * a);
        }
        let folds = Folds { motions: true, ..grouping::of_time(&samples) };
        (samples, folds)
    }

    fn chosen(elastic: bool, motions: bool, decision: Decision) -> usize {
        let (samples, folds) = joint(elastic);
        let left_out: Vec<u8> = used(&samples).into_iter().map(|i| folds.left_out[i]).collect();
        choose(&rows(&samples), &left_out, &Folds { motions, ..folds }, &RIGID, 40.0, decision).0
    }

    #[test]
    fn an_elastic_joint_gets_lagged_accelerations_and_a_rigid_one_none() {
        assert!(chosen(true, true, Decision::Choose) >= 4);
        assert_eq!(chosen(false, true, Decision::Choose), 0);
    }

    #[test]
    fn without_motions_to_leave_out_there_are_none_unless_they_are_asked_for() {
        assert_eq!(chosen(true, false, Decision::Choose), 0);
        assert!(chosen(true, false, Decision::Keep) >= 4 && chosen(false, false, Decision::Keep) >= 2);
        assert_eq!(chosen(true, true, Decision::Never), 0);
    }

    #[test]
    fn less_than_two_percent_are_not_taken_unless_they_are_asked_for() {
        let errors = |gain: f64| [vec![1.0; 4], vec![1.0 - gain; 4]];
        assert_eq!(best(&errors(0.0201), &[0, 2], Decision::Choose), 1);
        assert_eq!(best(&errors(0.0199), &[0, 2], Decision::Choose), 0);
        assert_eq!(best(&errors(0.0199), &[0, 2], Decision::Keep), 1);
    }

    #[test]
    fn a_joint_without_inertia_gets_none() {
        let (samples, folds) = joint(true);
        let left_out: Vec<u8> = used(&samples).into_iter().map(|i| folds.left_out[i]).collect();
        let rigid = RigidModel { inertia: false, ..RIGID };
        assert_eq!(choose(&rows(&samples), &left_out, &folds, &rigid, 40.0, Decision::Keep), (0, None));
    }
}
