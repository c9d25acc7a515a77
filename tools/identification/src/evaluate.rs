//! Models judged on test samples: their predictions of the effort, and the tables of their errors; host.

use crate::joint_model::{FloatFriction, rigid_state};
use crate::metrics::{MetricsError, RELATIVE_FLOOR, metrics_by_state, relative_floor};
use crate::page::{ErrorRow, ErrorTable, FixedPointDifference, Role};
use crate::rigid::{RigidModel, RigidParameters};
use crate::samples::{Part, Samples};
use crate::split::TestSet;
use crate::torque_error::{Lost, torque_error};
use nalgebra::{DMatrix, DVector};

/// A model's predicted effort for every sample.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// Name of the model.
    pub model: String,
    /// Its part in the comparison.
    pub role: Role,
    /// Predicted effort.
    pub effort: Vec<f64>,
}

impl Prediction {
    /// A prediction from a rigid part and a friction for each sample.
    pub fn new(model: impl Into<String>, role: Role, rigid: &[f64], friction: impl Fn(usize) -> f64) -> Self {
        let effort = rigid.iter().enumerate().map(|(i, rigid)| rigid + friction(i)).collect();
        Self { model: model.into(), role, effort }
    }

    /// Root mean square error over some samples.
    pub fn rmse(&self, samples: &Samples, indices: &[usize]) -> f64 {
        rmse(indices.iter().map(|&i| samples.effort[i] - self.effort[i]))
    }
}

/// Root mean square; 0 for nothing.
pub fn rmse(errors: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = errors.fold((0.0, 0usize), |(sum, count), e| (sum + e * e, count + 1));
    if count == 0 { 0.0 } else { (sum / count as f64).sqrt() }
}

/// The errors of all predictions on each test set.
pub fn error_tables(
    samples: &Samples,
    test_sets: &[TestSet],
    predictions: &[Prediction],
) -> Result<Vec<ErrorTable>, MetricsError> {
    let rigid = predictions.iter().find(|prediction| prediction.role == Role::Nothing);
    let table = |set: &TestSet| {
        let mut counts = vec![false; samples.len()];
        set.indices.iter().for_each(|&i| counts[i] = true);
        let pick = |column: &[f64]| set.indices.iter().map(|&i| column[i]).collect::<Vec<_>>();
        let measured = pick(&samples.effort);
        let states: Vec<_> = set.indices.iter().map(|&i| samples.state[i]).collect();
        let floor = relative_floor(&measured, RELATIVE_FLOOR);
        let row = |prediction: &Prediction| {
            let errors = metrics_by_state(&measured, &pick(&prediction.effort), &states, floor)?;
            let torque_error = rigid.and_then(|rigid| torque_error(&lost(samples, prediction, rigid, &counts)));
            Ok(ErrorRow { model: prediction.model.clone(), role: prediction.role, errors, torque_error })
        };
        let rows = predictions.iter().map(row).collect::<Result<_, MetricsError>>()?;
        Ok(ErrorTable { test_set: set.name.clone(), rows })
    };
    test_sets.iter().map(table).collect()
}

/// Residuals of the effort after a prediction, and after the rigid part alone, for every continuous recording.
fn lost(samples: &Samples, prediction: &Prediction, rigid: &Prediction, counts: &[bool]) -> Vec<Lost> {
    let left = |i: usize, predicted: &Prediction| samples.effort[i] - predicted.effort[i];
    let mut recordings = Vec::new();
    let mut begin = 0;
    for stretch in samples.run.chunk_by(|a, b| a == b) {
        let rows = begin..begin + stretch.len();
        begin = rows.end;
        if !counts[rows.clone()].contains(&true) {
            continue;
        }
        let elapsed = samples.time[rows.end - 1] - samples.time[rows.start];
        recordings.push(Lost {
            period: elapsed / (rows.len() - 1).max(1) as f64,
            lost: rows.clone().map(|i| left(i, prediction)).collect(),
            friction: rows.clone().map(|i| left(i, rigid)).collect(),
            counts: counts[rows].to_vec(),
        });
    }
    recordings
}

/// The difference between the firmware's friction and the same model in f64 over the test samples.
pub fn fixed_point_difference(
    float: &FloatFriction,
    fixed: &[(f64, f64)],
    sets: &[usize],
    samples: &Samples,
) -> FixedPointDifference {
    let (mut max, mut full_scale) = (0.0f64, 0.0f64);
    let test = samples.indices(Part::Test);
    let differences: Vec<f64> = test
        .iter()
        .map(|&i| {
            let (physical, network) = float.parts(sets[i], samples, i);
            full_scale = full_scale.max((physical + network).abs());
            let difference = fixed[i].0 + fixed[i].1 - physical - network;
            max = max.max(difference.abs());
            difference
        })
        .collect();
    let percent = if full_scale > 0.0 { 100.0 * max / full_scale } else { 0.0 };
    FixedPointDifference { rms: rmse(differences.into_iter()), max, max_percent_of_full_scale: percent }
}

/// The rigid part that fits best beside a given friction, by linear least squares over the training samples.
pub fn rigid_beside(friction: &[f64], model: &RigidModel, samples: &Samples) -> RigidParameters {
    let regressors = model.regressors();
    let n = regressors.len();
    let (mut matrix, mut right) = (DMatrix::<f64>::zeros(n, n), DVector::<f64>::zeros(n));
    for i in samples.indices(Part::Train) {
        let all = RigidParameters::regressor_values(&rigid_state(samples, i));
        let row: Vec<f64> = regressors.iter().map(|regressor| all[regressor.index()]).collect();
        for a in 0..n {
            right[a] += row[a] * (samples.effort[i] - friction[i]);
            for b in 0..n {
                matrix[(a, b)] += row[a] * row[b];
            }
        }
    }
    let solution = matrix.svd(true, true).solve(&right, 1e-12).unwrap_or_else(|_| DVector::zeros(n));
    let mut rigid = RigidParameters::default();
    for (regressor, value) in regressors.into_iter().zip(solution.iter()) {
        *rigid.coefficient_mut(regressor) = *value;
    }
    rigid
}
