//! Number of lagged accelerations in the rigid part: as many as pay on motions that were left out, beside Coulomb and
//! viscous friction; host.
//!
//! Accelerations of one motion explain each other, and what they explain there they do not explain elsewhere: without
//! motions to leave out there are none.

use super::fold_sums::{FoldSums, errors};
use crate::choice::{Decision, Folds, compare, rank};
use crate::rigid::{LAGS, RigidModel};

/// Least fall of the error, as a fraction. Below it lie filters and sampling, which differ between acceleration and
/// effort on a rigid joint, too.
const LEAST_GAIN: f64 = 0.02;
/// Number of [`LAGS`] that the rigid part gets, and what to say about it.
pub fn choose(sums: &[FoldSums], folds: &Folds, rigid: &RigidModel, decision: Decision) -> (usize, Option<String>) {
    let offered = rigid.has_inertia() && (decision == Decision::Keep || decision == Decision::Choose && folds.motions);
    if !offered || sums.len() < 2 {
        return (0, None);
    }
    let numbers: Vec<usize> = (0..=LAGS.len()).step_by(2).collect();
    let errors: Vec<Vec<f64>> = numbers.iter().map(|&lags| errors(sums, &RigidModel { lags, ..*rigid })).collect();
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

#[cfg(test)]
mod tests {
    use super::super::fold_sums;
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
        let sums = fold_sums::of(&rows(&samples), &left_out, &folds, 40.0);
        choose(&sums, &Folds { motions, ..folds }, &RIGID, decision).0
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
        let sums = fold_sums::of(&rows(&samples), &left_out, &folds, 40.0);
        assert_eq!(choose(&sums, &folds, &rigid, Decision::Keep), (0, None));
    }
}
