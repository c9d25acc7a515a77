//! Benefit of a network on motions that were left out: whether it helps, and with which inputs; host.
//!
//! For every fold a network is trained without it, on what the physical model, fitted without it too, leaves; and
//! judged on it. Of several seeds the one counts that stops at the lowest error, as for the network that is used. They
//! are trained as long as that one, on fewer samples.

use super::FitError;
use super::problem::{MINIMUM_SAMPLES, Problem};
use super::trainer::Trainer;
use super::uncovered::with_uncovered;
use crate::choice::{Comparison, compare, rank};
use crate::evaluate::rmse;
use crate::joint_model::network_inputs;
use crate::network::{INPUT_NAMES, InputBox};
use crate::train::TrainError;
use rayon::prelude::*;

/// Most samples that a fold trains with, and that it is judged by.
const FOLD_SAMPLES: usize = 4_000;
/// Most samples that stop a fold's training.
const CHECKS: usize = 2_000;
/// Networks of a fold that are trained from different first weights.
const SEEDS: usize = 3;
/// Of every so many neighbouring samples of a fold's training ...
const STOP_BLOCKS: usize = 50;
/// ... every so manieth block stops it, where the samples for validation are left out with the fold.
const STOP_EVERY: usize = 5;

/// A set of inputs and the errors on the folds with it.
pub(super) struct Tried {
    /// Inputs that the network has.
    pub inputs: [bool; 5],
    /// Error on each fold.
    pub errors: Vec<f64>,
}

/// Verdict over the network.
pub(super) struct Verdict {
    /// Inputs with which the network is best, whether it is taken or not.
    pub inputs: [bool; 5],
    /// Error on each fold with the network of these inputs.
    pub errors: Vec<f64>,
    /// Reason for which it is not taken; None: it is.
    pub refusal: Option<String>,
    /// Every set of inputs that was tried.
    pub notes: Vec<String>,
}

/// Tries the sets of inputs and compares the best of them with the physical model. `reference` are the errors of the
/// simplest model. Nothing where there are fewer than two folds.
pub(super) fn judge(
    problem: &Problem,
    trainer: Trainer,
    train: &[usize],
    validation: &[usize],
    reference: &[f64],
) -> Result<Option<Verdict>, FitError> {
    let Problem { physical, options, progress, folds, .. } = *problem;
    if folds.len() < 2 || physical.folds.len() != folds.len() {
        return Ok(None);
    }
    let without = physical.fold_errors();
    let sets = match options.inputs {
        Some(inputs) => vec![inputs],
        None => input_sets(problem.inputs),
    };
    let mut tried = Vec::new();
    for inputs in sets {
        progress.detail(&format!("left-out motions, network of {}", names(inputs)));
        let errors = errors(problem, trainer, train, validation, inputs)?;
        tried.push(Tried { inputs, errors });
    }
    let notes = tried
        .iter()
        .map(|tried| {
            let change = compare(&without, &tried.errors);
            let (mean, spread) = (change.percent(), 100.0 * change.standard_error);
            let worst = 100.0 * change.worst.exp_m1();
            format!("network of {}: {mean:+.1} ± {spread:.1} %, worst motion {worst:+.1} %", names(tried.inputs))
        })
        .collect();
    let all: Vec<Vec<f64>> = tried.iter().map(|tried| tried.errors.clone()).collect();
    let size: Vec<usize> = tried.iter().map(|tried| tried.inputs.iter().filter(|on| **on).count()).collect();
    let refused = |i: usize| refusal(&compare(&without, &all[i]), &compare(reference, &all[i]), options.least_gain);
    // Of those that pay, the simplest that no other beats; where none pays, the one that comes closest.
    let able: Vec<usize> = (0..tried.len()).filter(|&i| refused(i).is_none()).collect();
    let errors: Vec<Vec<f64>> = able.iter().map(|&i| all[i].clone()).collect();
    let sizes: Vec<usize> = able.iter().map(|&i| size[i]).collect();
    let mean = |i: usize| compare(&without, &all[i]).mean;
    let closest = (0..tried.len()).min_by(|&a, &b| mean(a).total_cmp(&mean(b)));
    let Some(best) = rank(&errors, &sizes).first().map(|&place| able[place]).or(closest) else { return Ok(None) };
    let refusal = refused(best);
    let Tried { inputs, errors } = tried.swap_remove(best);
    Ok(Some(Verdict { inputs, errors, refusal, notes }))
}

/// Reason for which a network is not taken, from its change against the physical model and against the simplest model.
fn refusal(change: &Comparison, simplest: &Comparison, least_gain: f64) -> Option<String> {
    if !simplest.harmless() {
        let worst = 100.0 * simplest.worst.exp_m1();
        return Some(format!(
            "one of the motions that were left out becomes {worst:.1} % worse than with the simplest model"
        ));
    }
    let (percent, spread) = (change.percent(), 100.0 * change.standard_error);
    let enough = change.mean <= (1.0 - least_gain).ln() && change.wins(0.0);
    (!enough).then(|| {
        let least = 100.0 * least_gain;
        format!("on motions that were left out it changes the error by {percent:+.1} ± {spread:.1} %; {least:.1} % less beyond the spread is needed")
    })
}

/// Velocity alone, and with every choice of the other inputs; those of most inputs last.
fn input_sets(supported: [bool; 5]) -> Vec<[bool; 5]> {
    let others: Vec<usize> = (0..5).filter(|&i| i != VELOCITY && supported[i]).collect();
    let mut sets: Vec<[bool; 5]> = (0..1usize << others.len())
        .map(|choice| {
            let mut set = [false; 5];
            set[VELOCITY] = supported[VELOCITY];
            others.iter().enumerate().for_each(|(place, &input)| set[input] = choice >> place & 1 == 1);
            set
        })
        .collect();
    sets.sort_by_key(|set| set.iter().filter(|on| **on).count());
    sets
}

/// Index of the velocity among the inputs.
const VELOCITY: usize = 1;

/// The inputs by name.
pub(super) fn names(inputs: [bool; 5]) -> String {
    let on: Vec<&str> = INPUT_NAMES.into_iter().zip(inputs).filter(|(_, on)| *on).map(|(name, _)| name).collect();
    on.join(", ")
}

/// The error on every fold with a network that was trained without it.
fn errors(
    problem: &Problem,
    trainer: Trainer,
    train: &[usize],
    validation: &[usize],
    inputs: [bool; 5],
) -> Result<Vec<f64>, FitError> {
    let one = |fold: usize| fold_error(problem, trainer, train, validation, inputs, fold);
    (0..problem.folds.len()).into_par_iter().map(one).collect()
}

fn fold_error(
    problem: &Problem,
    trainer: Trainer,
    train: &[usize],
    validation: &[usize],
    inputs: [bool; 5],
    fold: usize,
) -> Result<f64, FitError> {
    let Problem { samples, physical, folds, .. } = *problem;
    let model = &physical.folds[fold];
    let residual = |i: usize| {
        let state = crate::joint_model::rigid_state(samples, i);
        samples.effort[i]
            - model.rigid.effort(&state)
            - model.friction.friction(&crate::joint_model::float_state(samples, i))
    };
    let (seen, left_out): (Vec<usize>, Vec<usize>) = train.iter().partition(|&&i| !folds.leaves_out(fold, i));
    let (mut checks, more): (Vec<usize>, Vec<usize>) = validation.iter().partition(|&&i| !folds.leaves_out(fold, i));
    let judged = thinned(&left_out.into_iter().chain(more).collect::<Vec<_>>(), FOLD_SAMPLES);
    let mut seen = seen;
    if checks.len() < MINIMUM_SAMPLES {
        let stops = |place: usize| place / STOP_BLOCKS % STOP_EVERY == STOP_EVERY - 1;
        let all = seen;
        checks = all.iter().enumerate().filter(|(place, _)| stops(*place)).map(|(_, &i)| i).collect();
        seen = all.iter().enumerate().filter(|(place, _)| !stops(*place)).map(|(_, &i)| i).collect();
    }
    let (seen, checks) = (thinned(&seen, FOLD_SAMPLES), thinned(&checks, CHECKS));
    if seen.is_empty() || checks.is_empty() || judged.is_empty() {
        return Ok(model.rmse);
    }
    let inputs_of = |indices: &[usize]| indices.iter().map(|&i| network_inputs(samples, i)).collect::<Vec<_>>();
    let seen_inputs = inputs_of(&seen);
    let input_box = InputBox::around(&seen_inputs, inputs).map_err(TrainError::from)?;
    let targets = |indices: &[usize]| indices.iter().map(|&i| residual(i)).collect::<Vec<_>>();
    let set = |inputs, indices: &[usize], seed| with_uncovered(inputs, targets(indices), &input_box, seed);
    let seed = problem.options.seed;
    let (seen, checks) = (set(seen_inputs, &seen, seed), set(inputs_of(&checks), &checks, seed.wrapping_add(1)));
    let network = problem.task(seen, checks, input_box, SEEDS).run(trainer, true)?.network;
    let before = rmse(judged.iter().map(|&i| residual(i)));
    let after = rmse(judged.iter().map(|&i| residual(i) - network.evaluate(&network_inputs(samples, i))));
    // Error as a ratio: the draw of the samples that are judged is not that of the physical model's error.
    Ok(model.rmse * after / before.max(f64::MIN_POSITIVE))
}

/// Indices, at most `limit` of them, evenly.
fn thinned(indices: &[usize], limit: usize) -> Vec<usize> {
    indices.iter().copied().step_by(indices.len().div_ceil(limit).max(1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(mean: f64, standard_error: f64, worst: f64) -> Comparison {
        Comparison { mean, standard_error, worst }
    }

    #[test]
    fn a_network_must_gain_the_least_gain_beyond_the_spread_and_harm_no_motion() {
        let harmless = change(-0.5, 0.1, 0.0);
        assert!(refusal(&change(-0.021, 0.02, 0.3), &harmless, 0.02).is_none());
        assert!(refusal(&change(-0.021, 0.022, 0.3), &harmless, 0.02).unwrap().contains("2.0 % less"));
        assert!(refusal(&change(-0.020, 0.01, 0.3), &harmless, 0.02).is_some());
        let harmful = refusal(&change(-0.5, 0.1, 0.0), &change(-0.4, 0.1, 0.0202), 0.02).unwrap();
        assert!(harmful.contains("2.0 % worse than with the simplest model"), "{harmful}");
        assert!(refusal(&change(-0.5, 0.1, 0.0), &change(-0.4, 0.1, 0.0195), 0.02).is_none());
    }

    #[test]
    fn every_choice_of_the_inputs_beside_velocity_is_tried_simplest_first() {
        let sets = input_sets([true, true, true, false, false]);
        assert_eq!(sets.len(), 4);
        assert_eq!(sets[0], [false, true, false, false, false]);
        assert_eq!(sets[3], [true, true, true, false, false]);
    }
}
