//! Choice of a factor on a rigid part that is computed elsewhere; host.
//!
//! A robot's links explain the effort of a joint up to what its drive's gain is wrong by, and the rotor's inertia. A
//! factor on their effort is identified where it shows on samples that are left out. Where it does not, it learns
//! friction, and the robot's links are no longer the model that a controller has.

use super::fold_sums::{FoldSums, errors};
use crate::choice::{compare, rank};
use crate::rigid::{Given, RigidModel};

/// The rigid part as it is described, or with the given part as it is where a factor does not win beyond one standard
/// error, and what to say about it.
pub fn choose(sums: &[FoldSums], described: &RigidModel) -> (RigidModel, Option<String>) {
    if described.given == Given::None || sums.len() < 2 {
        return (*described, None);
    }
    let tried = [RigidModel { given: Given::AsItIs, ..*described }, RigidModel { given: Given::Scaled, ..*described }];
    let errors = tried.map(|rigid| errors(sums, &rigid));
    let chosen = rank(&errors, &[0, 1])[0];
    let change = compare(&errors[0], &errors[1]);
    let note = format!(
        "the effort of the robot's links counts {}: with a factor the error on left-out samples changes by {:+.1} +- {:.1} %",
        ["as it is", "times a factor"][chosen],
        change.percent(),
        100.0 * change.standard_error
    );
    (tried[chosen], Some(note))
}

#[cfg(test)]
mod tests {
    use super::super::fold_sums;
    use super::super::observations::{rows, used};
    use super::super::synthetic::{drive, motion};
    use super::*;
    use crate::choice::grouping;
    use crate::friction_model::{FrictionModel, Term, Terms};
    use crate::rigid::RigidParameters;

    /// The choice for a joint with an inertia of its own whose effort has `factor` times what is given.
    fn chosen(factor: f64, inertia: f64, described: &RigidModel) -> RigidModel {
        let friction = FrictionModel { viscous: 0.9, terms: Terms::of(&[Term::Viscous]), ..FrictionModel::default() };
        let mut samples = motion(4_000);
        drive(&mut samples, &RigidParameters { inertia, ..RigidParameters::default() }, &friction, 0.02, 1);
        let given: Vec<f64> = samples.position.iter().map(|q| 3.0 * (1.3 * q).sin()).collect();
        samples.effort.iter_mut().zip(&given).for_each(|(effort, given)| *effort += factor * given);
        samples.extra.insert("rigid".into(), given);
        let folds = grouping::of_time(&samples);
        let left_out: Vec<u8> = used(&samples).into_iter().map(|i| folds.left_out[i]).collect();
        choose(&fold_sums::of(&rows(&samples), &left_out, &folds, 40.0), described).0
    }

    #[test]
    fn a_given_rigid_part_gets_a_factor_where_it_shows() {
        for inertia in [false, true] {
            let described = RigidModel { inertia, given: Given::Scaled, ..RigidModel::default() };
            let own = if inertia { 0.5 } else { 0.0 };
            assert_eq!(chosen(1.1, own, &described), described);
            assert_eq!(chosen(1.0, own, &described), RigidModel { given: Given::AsItIs, ..described });
        }
    }

    #[test]
    fn nothing_is_chosen_where_nothing_is_given() {
        let none = RigidModel { inertia: true, ..RigidModel::default() };
        assert_eq!(chosen(1.1, 0.5, &none), none);
    }
}
