//! Training problem of a network: what it is to learn, from which samples.

use super::Options;
use super::trainer::Task;
use crate::choice::Folds;
use crate::classify::Thresholds;
use crate::identify::Identified;
use crate::joint_model::network_inputs;
use crate::network::InputBox;
use crate::progress::Progress;
use crate::samples::Samples;
use crate::train::TrainingSet;
use friction_compensation::friction::state::JointState;

/// Least number of training samples, and of validation samples, with which a network is trained.
pub(super) const MINIMUM_SAMPLES: usize = 300;

/// Training problem of a network: the part of the effort that the physical model leaves.
pub(super) struct Problem<'a> {
    pub samples: &'a Samples,
    /// The firmware's view of every sample.
    pub states: &'a [JointState],
    pub physical: &'a Identified,
    pub thresholds: &'a Thresholds,
    /// Inputs of the network that the recording supports.
    pub inputs: [bool; 5],
    /// Motions that are left out in turn.
    pub folds: &'a Folds,
    /// Errors of the simplest physical model on the folds.
    pub reference: &'a [f64],
    pub options: &'a Options,
    pub progress: &'a dyn Progress,
}

impl Problem<'_> {
    /// Residual of the effort after rigid part and physical friction.
    pub fn residual(&self, i: usize) -> f64 {
        let Self { samples, physical, .. } = self;
        samples.effort[i] - physical.rigid_effort(samples, i) - physical.friction(samples, i)
    }

    /// Inputs and targets of the samples `indices`.
    pub fn targets(&self, indices: &[usize]) -> (Vec<[f64; 5]>, Vec<f64>) {
        let inputs = indices.iter().map(|&i| network_inputs(self.samples, i)).collect();
        (inputs, indices.iter().map(|&i| self.residual(i)).collect())
    }

    /// A network to be trained from these samples.
    pub fn task(&self, train: TrainingSet, validation: TrainingSet, input_box: InputBox, restarts: usize) -> Task<'_> {
        Task { train, validation, input_box, options: self.options, restarts, progress: self.progress }
    }
}
