//! The measured torque's mean over a millisecond. A controller on a bus moves the torque in saw teeth of about that
//! length, and whoever samples them in step with the bus takes the place in a tooth for torque: with a stiffness of
//! 1,000 Nm/rad half a newton metre for each rad/s.

use super::active::Active;

/// The mean, from one control step to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct MeanTorque {
    sum: f32,
    steps: u32,
    mean: f32,
}

impl MeanTorque {
    #[inline(always)]
    pub(super) fn add(&mut self, active: &Active, torque: f32) {
        self.sum += torque;
        self.steps += 1;
        if self.steps >= active.adaptation.mean_steps {
            *self = Self { sum: 0.0, steps: 0, mean: self.sum * active.adaptation.mean_share };
        }
    }

    /// Over the last whole millisecond, Nm.
    #[inline(always)]
    pub(super) const fn mean(&self) -> f32 {
        self.mean
    }
}
