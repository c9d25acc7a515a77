//! The recorded joint as every stage of the pipeline sees it: columns of equal length in SI units.

use crate::friction_model::Bent;
use std::collections::BTreeMap;

/// Use of a sample. Test samples are never seen by identification, training or selection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Identification and training.
    Train,
    /// Early stopping and model selection.
    Validation,
    /// Judging, once, at the end.
    Test,
    /// Excluded from all three.
    Unused,
}

/// The four motion states of the mobile-robot paper (section 3.1): two independent classifications of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MotionState {
    /// |acceleration| is above the threshold (else: uniform motion).
    pub accelerating: bool,
    /// |velocity| is above the threshold (else: low speed).
    pub fast: bool,
}

/// Position and velocity of each sample, on another way than those of the samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    /// Position, rad or m.
    pub position: Vec<f64>,
    /// Velocity, rad/s or m/s.
    pub velocity: Vec<f64>,
}

/// The joint that shares this joint's drive (003, section II-C).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Partner {
    /// Its velocity at each sample, rad/s or m/s.
    pub velocity: Vec<f64>,
    /// Speed by which one of both has to be the faster one to lead.
    pub band: f64,
    /// True where it leads: from `band` of speed above this joint's own on, until this joint is faster by as much. It
    /// leads at the beginning of each run, as a joint takes it at its start.
    pub leads: Vec<bool>,
}

impl Partner {
    /// A partner with this velocity, beside the samples of a joint.
    pub fn new(velocity: Vec<f64>, band: f64, samples: &Samples) -> Self {
        let mut leads = Vec::with_capacity(velocity.len());
        for (i, other) in velocity.iter().enumerate() {
            let ahead = samples.velocity[i].abs() - other.abs();
            let before = i == 0 || samples.run[i] != samples.run[i - 1] || leads[i - 1];
            leads.push(ahead < band && (ahead <= -band || before));
        }
        Self { velocity, band, leads }
    }
}

/// One joint's recording. All columns have the same length; rows of one `run` are contiguous and ordered in time.
///
/// Units are those of the joint: rad (or m), Nm (or N, A, V); the data set's description names them.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// Time since the start of the run, s.
    pub time: Vec<f64>,
    /// Position, rad or m.
    pub position: Vec<f64>,
    /// Velocity, rad/s or m/s.
    pub velocity: Vec<f64>,
    /// Acceleration, rad/s^2 or m/s^2.
    pub acceleration: Vec<f64>,
    /// Measured effort, positive where it accelerates the joint towards positive positions; Nm, N, A or V.
    pub effort: Vec<f64>,
    /// Temperature, degrees Celsius; the reference temperature where it was not recorded.
    pub temperature: Vec<f64>,
    /// Theoretical torque: the rigid-body part of the effort. Empty until the rigid body is identified.
    pub load: Vec<f64>,
    /// Deflection of each pre-sliding element of the identified model. Empty until there is one.
    pub bent: Vec<Bent>,
    /// Index of the run (continuous recording) that the sample belongs to.
    pub run: Vec<u32>,
    /// Motion state of each sample.
    pub state: Vec<MotionState>,
    /// Use of each sample.
    pub part: Vec<Part>,
    /// The joint that shares this joint's drive; None for a joint with a drive of its own.
    pub partner: Option<Partner>,
    /// Values that are constant over a run and enter the rigid-body model (mass, length), by column name.
    pub extra: BTreeMap<String, Vec<f64>>,
}

impl Samples {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// True where there is no sample.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }

    /// The first sampling period, s.
    pub fn period(&self) -> f64 {
        let mut pairs = self.time.windows(2).map(|pair| pair[1] - pair[0]);
        pairs.find(|period| *period > 0.0).unwrap_or(1.0)
    }

    /// Index of the sample that is later than sample `index` by `time`, s, at the first sampling period; held at the
    /// ends of its run.
    pub fn shifted(&self, index: usize, time: f64) -> usize {
        let by = (time.abs() / self.period()).round() as usize;
        let same_run = |i: &usize| self.run[*i] == self.run[index];
        let found = match time < 0.0 {
            true => (index.saturating_sub(by)..=index).find(same_run),
            false => (index..=index.saturating_add(by).min(self.len() - 1)).rev().find(same_run),
        };
        found.unwrap_or(index)
    }

    /// Indices of the samples of one part, in order.
    pub fn indices(&self, part: Part) -> Vec<usize> {
        (0..self.len()).filter(|&i| self.part[i] == part).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_partner_leads_from_the_band_on_until_the_joint_leads_by_the_band() {
        let velocity = vec![0.0, 1.24, -1.25, 1.0, 0.76, 0.75, 1.0, 1.25, 1.0];
        let samples = Samples { velocity, run: vec![0, 0, 0, 0, 0, 0, 0, 0, 1], ..Samples::default() };
        let others = vec![0.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 1.0, 1.0];
        let partner = Partner::new(others, 0.25, &samples);
        assert_eq!(partner.leads, [true, true, false, false, false, true, true, false, true]);
    }

    #[test]
    fn a_sample_that_is_later_or_earlier_is_the_nearest_of_the_same_run() {
        let time: Vec<f64> = [0.0, 0.01, 0.02, 0.03, 0.04].repeat(2);
        let samples = Samples { time, run: [[0; 5], [1; 5]].concat(), ..Samples::default() };
        let shifted = |time| samples.shifted(6, time);
        assert_eq!([0.0, 0.0049, 0.0051, -0.0049, -0.0051].map(shifted), [6, 6, 7, 6, 5]);
        // The ends of the run, and of the recording.
        assert_eq!([0.03, 0.04, 1e3, -0.01, -0.02, -1e3].map(shifted), [9, 9, 9, 5, 5, 5]);
        assert_eq!(samples.shifted(3, 0.02), 4);
    }
}
