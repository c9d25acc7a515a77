//! Whether a network has learned friction or a trajectory: its error on loads that it was not trained with.
//!
//! Recorded trajectories repeat themselves: a network that has learned them by heart does well on any block of time cut from
//! them. On loads that it has not seen it does not.

use super::FitError;
use super::problem::{MINIMUM_SAMPLES, Problem};
use super::trainer::Trainer;
use crate::evaluate::rmse;
use crate::joint_model::network_inputs;
use crate::network::InputBox;
use crate::train::{TrainError, TrainingSet};

/// Share of the samples with the highest |theoretical torque| that is held back.
const HELD_BACK: f64 = 0.1;

/// Error with a network over error without, on loads above all that the network was trained with; 0 where too few samples
/// are left to tell. One network for all regimes is asked, whatever the selector: the question is about the inputs.
pub(super) fn error_ratio(
    problem: &Problem,
    trainer: Trainer,
    train: &[usize],
    validation: &[usize],
) -> Result<f64, FitError> {
    let samples = problem.samples;
    let mut loads: Vec<f64> = train.iter().map(|&i| samples.load[i].abs()).collect();
    loads.sort_by(f64::total_cmp);
    let limit = loads[((loads.len() - 1) as f64 * (1.0 - HELD_BACK)) as usize];
    let by_load = |indices: &[usize]| -> (Vec<usize>, Vec<usize>) {
        indices.iter().partition(|&&i| samples.load[i].abs() <= limit)
    };
    let (low, high) = by_load(train);
    let (low_checks, high_checks) = by_load(validation);
    if low.len().min(low_checks.len()) < MINIMUM_SAMPLES || high.is_empty() {
        return Ok(0.0);
    }
    let set = |indices: &[usize]| {
        let (inputs, targets) = problem.targets(indices);
        TrainingSet::unweighted(inputs, targets)
    };
    let (train, validation) = (set(&low), set(&low_checks));
    let input_box = InputBox::around(&train.inputs, problem.inputs).map_err(TrainError::from)?;
    // Half the restarts: the question is whether such a network extrapolates, not which is best.
    let restarts = problem.options.restarts.div_ceil(2);
    let network = problem.task(train, validation, input_box, restarts).run(trainer)?.network;
    let judged: Vec<usize> = high.into_iter().chain(high_checks).collect();
    let without = rmse(judged.iter().map(|&i| problem.residual(i)));
    let with = rmse(judged.iter().map(|&i| problem.residual(i) - network.evaluate(&network_inputs(samples, i))));
    Ok(with / without)
}
