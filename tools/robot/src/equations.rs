//! Efforts of all joints as linear functions of one vector: inertial parameters (ten per link), rotor inertias,
//! friction; host.
//!
//! The effort of motor m is [1/k C^-T (Y phi) + (C a) J / k + friction]_m, with the coupling C, gains k and rotor
//! inertias J of the robot: see the crate `rigid-body`. Rotor inertias that the robot's file states are taken off the
//! effort instead.

use super::friction_columns::Friction;
use super::recording::Recording;
use identification::samples::{Part, Samples};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use rigid_body::Robot;
use rigid_body::inertia::PARAMETERS;
use rigid_body::regressor::regressor;
use std::ops::Range;

/// Speed below which a joint stands still, part of its fastest, and the time that it has to do so, s.
const SLOW: f64 = 0.01;
const STANDS_FOR: f64 = 0.1;
/// Groups of samples that are left out in turn.
pub const GROUPS: usize = 4;

/// The places of the unknowns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Joints.
    pub joints: usize,
    /// Friction columns of each joint.
    pub friction: Friction,
    /// Joints share drives in pairs.
    pub shared: bool,
}

impl Layout {
    /// Number of inertial parameters.
    pub const fn inertial(self) -> usize {
        PARAMETERS * self.joints
    }

    /// Number of unknowns of the rigid bodies: inertial parameters and rotor inertias.
    pub const fn rigid(self) -> usize {
        self.inertial() + self.joints
    }

    /// Number of all unknowns.
    pub const fn unknowns(self) -> usize {
        self.rigid() + self.joints * self.width()
    }

    /// Number of friction columns of each joint.
    pub const fn width(self) -> usize {
        self.friction.width(self.shared)
    }
}

/// Rigid-body columns of all joints at one state, in units of effort: joints x unknowns of the rigid bodies.
pub fn rigid_columns(robot: &Robot, q: &[f64], v: &[f64], a: &[f64]) -> DMatrix<f64> {
    let n = q.len();
    let links = regressor(&robot.tree, q, v, a);
    let mut columns = DMatrix::zeros(n, PARAMETERS * n + n);
    let to_efforts = robot.gains().try_inverse().unwrap_or_else(|| DMatrix::identity(n, n));
    columns.columns_mut(0, PARAMETERS * n).copy_from(&(&to_efforts * links));
    let motors = &robot.coupling * DVector::from_row_slice(a);
    let rotors = &to_efforts * robot.coupling.transpose() * DMatrix::from_diagonal(&motors);
    columns.columns_mut(PARAMETERS * n, n).copy_from(&rotors);
    columns
}

/// All samples of all joints.
#[derive(Clone, Debug)]
pub struct Rows {
    /// Places of the unknowns.
    pub layout: Layout,
    /// Rigid-body columns of every sample.
    pub rigid: Vec<DMatrix<f64>>,
    /// Friction columns of every joint, sample by sample.
    pub friction: Vec<Vec<f64>>,
    /// Efforts of every joint less those of rotors that are known.
    pub effort: Vec<Vec<f64>>,
    /// Group of each sample for training and validation; None: not used.
    pub group: Vec<Option<usize>>,
    /// Continuous recording that each sample belongs to.
    pub run: Vec<u32>,
    /// True for each joint and sample at which it stands still: its effort is whatever it has to be.
    pub still: Vec<Vec<bool>>,
}

impl Rows {
    /// The rows of a recording. `load` has the theoretical effort of each joint, where it is known already.
    pub fn of(recording: &Recording, friction: Friction, load: Option<&[Vec<f64>]>) -> Self {
        let robot = &recording.robot;
        let layout = Layout { joints: robot.tree.len(), friction, shared: !robot.pairs.is_empty() };
        let rigid: Vec<DMatrix<f64>> = (0..recording.len())
            .into_par_iter()
            .map(|i| {
                let [q, v, a] = recording.state(i);
                rigid_columns(robot, &q, &v, &a)
            })
            .collect();
        Self::with(recording, layout, rigid, load)
    }

    /// The same samples with other friction columns.
    pub fn again(self, recording: &Recording, friction: Friction, load: Option<&[Vec<f64>]>) -> Self {
        // Rotors that are known are off the effort already, and their columns are gone.
        let layout = Layout { friction, ..self.layout };
        Self { layout, friction: friction_columns(recording, friction, load), ..self }
    }

    fn with(recording: &Recording, layout: Layout, mut rigid: Vec<DMatrix<f64>>, load: Option<&[Vec<f64>]>) -> Self {
        let mut effort: Vec<Vec<f64>> = recording.joints.iter().map(|joint| joint.samples.effort.clone()).collect();
        for (k, drive) in recording.robot.drives.iter().enumerate() {
            let column = layout.inertial() + k;
            let Some(inertia) = drive.rotor_inertia else { continue };
            for (i, columns) in rigid.iter().enumerate() {
                effort.iter_mut().enumerate().for_each(|(j, effort)| effort[i] -= inertia * columns[(j, column)]);
            }
        }
        // Known: its column must not be there a second time.
        for (k, _) in recording.robot.drives.iter().enumerate().filter(|(_, drive)| drive.rotor_inertia.is_some()) {
            rigid.iter_mut().for_each(|columns| columns.column_mut(layout.inertial() + k).fill(0.0));
        }
        let friction = friction_columns(recording, layout.friction, load);
        let run = recording.joints[0].samples.run.clone();
        let still: Vec<Vec<bool>> = recording.joints.iter().map(|joint| still(&joint.samples)).collect();
        Self { layout, rigid, friction, effort, group: groups(recording, &still), run, still }
    }

    /// Samples for training and validation in stretches without a gap.
    pub fn stretches(&self) -> Vec<Range<usize>> {
        let mut stretches: Vec<Range<usize>> = Vec::new();
        for i in (0..self.group.len()).filter(|&i| self.group[i].is_some()) {
            match stretches.last_mut() {
                Some(last) if last.end == i && self.run[i - 1] == self.run[i] => last.end += 1,
                _ => stretches.push(i..i + 1),
            }
        }
        stretches
    }

    /// Columns of joint `j` over these samples.
    pub fn columns(&self, j: usize, samples: &[usize], columns: &[usize]) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(samples.len(), columns.len());
        for (line, &i) in samples.iter().enumerate() {
            let row = self.row(j, i);
            columns.iter().enumerate().for_each(|(at, &column)| matrix[(line, at)] = row[column]);
        }
        matrix
    }

    /// The values of all unknowns' columns that joint `j` has at a sample.
    pub fn row(&self, j: usize, sample: usize) -> DVector<f64> {
        let joints = self.layout.joints;
        let (rigid, width) = (self.layout.rigid(), self.layout.width());
        let mut row = DVector::zeros(self.layout.unknowns());
        row.rows_mut(0, rigid).copy_from(&self.rigid[sample].row(j).transpose());
        let own = &self.friction[j][width * sample..width * (sample + 1)];
        row.rows_mut(rigid + width * j, width).copy_from_slice(own);
        debug_assert!(j < joints);
        row
    }

    /// Effort of the rigid bodies of every joint, sample by sample, without rotors that are known.
    pub fn rigid_efforts(&self, unknowns: &DVector<f64>) -> Vec<Vec<f64>> {
        let rigid = unknowns.rows(0, self.layout.rigid());
        let all: Vec<DVector<f64>> = self.rigid.par_iter().map(|columns| columns * rigid).collect();
        (0..self.layout.joints).map(|j| all.iter().map(|efforts| efforts[j]).collect()).collect()
    }

    /// Residual of the effort of joint `j` at a sample.
    pub fn residual(&self, unknowns: &DVector<f64>, j: usize, sample: usize) -> f64 {
        let (rigid, width) = (self.layout.rigid(), self.layout.width());
        let body: f64 = self.rigid[sample].row(j).iter().zip(unknowns.iter()).map(|(c, x)| c * x).sum();
        let own = &self.friction[j][width * sample..width * (sample + 1)];
        let friction: f64 = own.iter().zip(unknowns.iter().skip(rigid + width * j)).map(|(c, x)| c * x).sum();
        self.effort[j][sample] - body - friction
    }

    /// Normal equations of joint `j` over the samples of each group, with a weight for each sample.
    pub fn normal(&self, j: usize, weight: impl Fn(usize) -> f64 + Sync) -> Vec<Normal> {
        let n = self.layout.unknowns();
        let samples: Vec<usize> = (0..self.group.len()).collect();
        (0..GROUPS)
            .into_par_iter()
            .map(|group| {
                let used = samples.iter().copied().filter(|&i| self.group[i] == Some(group) && !self.still[j][i]);
                let used: Vec<usize> = used.collect();
                // Matrices: a product of blocks is faster than sums of rows.
                let active: Vec<usize> = self.active(j);
                let mut matrix = self.columns(j, &used, &active);
                let mut effort = DVector::zeros(used.len());
                for (line, &i) in used.iter().enumerate() {
                    let root = weight(i).max(0.0).sqrt();
                    matrix.row_mut(line).scale_mut(root);
                    effort[line] = root * self.effort[j][i];
                }
                let (part, right) = (matrix.tr_mul(&matrix), matrix.tr_mul(&effort));
                let mut normal = Normal::zero(n);
                for (a, &row) in active.iter().enumerate() {
                    normal.right[row] = right[a];
                    active.iter().enumerate().for_each(|(b, &column)| normal.matrix[(row, column)] = part[(a, b)]);
                }
                normal.square = effort.norm_squared();
                normal.count = used.len();
                normal
            })
            .collect()
    }

    /// Unknowns that the effort of joint `j` can depend on.
    pub fn active(&self, j: usize) -> Vec<usize> {
        let (rigid, width) = (self.layout.rigid(), self.layout.width());
        let mut active: Vec<usize> =
            (0..rigid).filter(|&k| self.rigid.iter().step_by(7).any(|columns| columns[(j, k)] != 0.0)).collect();
        active.extend(rigid + width * j..rigid + width * (j + 1));
        active
    }
}

/// Samples at which a joint stands still: slower than a part of its fastest speed, for longer than a reversal takes.
fn still(samples: &Samples) -> Vec<bool> {
    let fastest = samples.velocity.iter().fold(0.0, |fastest: f64, v| fastest.max(v.abs()));
    let least = (STANDS_FOR / samples.period()).ceil() as usize;
    let slow = |v: &f64| v.abs() < SLOW * fastest;
    let parts = samples.velocity.chunk_by(|one, next| slow(one) == slow(next));
    parts.flat_map(|part| std::iter::repeat_n(slow(&part[0]) && part.len() >= least, part.len())).collect()
}

/// Friction columns of every joint.
fn friction_columns(recording: &Recording, friction: Friction, load: Option<&[Vec<f64>]>) -> Vec<Vec<f64>> {
    let joints = recording.joints.iter().enumerate();
    let shared = !recording.robot.pairs.is_empty();
    joints.map(|(j, one)| friction.columns(&one.samples, load.map(|load| &load[j][..]), shared)).collect()
}

/// Groups of the samples for training and validation: runs, or parts of them where there are fewer than [`GROUPS`].
/// Samples at which all joints stand still are in none.
fn groups(recording: &Recording, still: &[Vec<bool>]) -> Vec<Option<usize>> {
    let moves = |i: usize| still.iter().any(|joint| !joint[i]);
    let used = |i: &usize| matches!(recording.part(*i), Part::Train | Part::Validation) && moves(*i);
    let samples: Vec<usize> = (0..recording.len()).filter(used).collect();
    let run = &recording.joints[0].samples.run;
    let mut runs: Vec<u32> = samples.iter().map(|&i| run[i]).collect();
    runs.dedup();
    let parts = GROUPS.div_ceil(runs.len().max(1));
    let mut groups = vec![None; recording.len()];
    let mut next = 0;
    for of_run in samples.chunk_by(|a, b| run[*a] == run[*b]) {
        for part in of_run.chunks(of_run.len().div_ceil(parts)) {
            part.iter().for_each(|&i| groups[i] = Some(next % GROUPS));
            next += 1;
        }
    }
    groups
}

/// Normal equations: sums over samples.
#[derive(Clone, Debug)]
pub struct Normal {
    /// Sum of w row^T row.
    pub matrix: DMatrix<f64>,
    /// Sum of w row^T effort.
    pub right: DVector<f64>,
    /// Sum of w effort^2.
    pub square: f64,
    /// Samples.
    pub count: usize,
}

impl Normal {
    /// No sample.
    pub fn zero(n: usize) -> Self {
        Self { matrix: DMatrix::zeros(n, n), right: DVector::zeros(n), square: 0.0, count: 0 }
    }

    /// Adds `factor` times the sums of another.
    pub fn add(&mut self, other: &Self, factor: f64) {
        self.matrix += factor * &other.matrix;
        self.right.axpy(factor, &other.right, 1.0);
        self.square += factor * other.square;
        self.count += other.count;
    }

    /// Sum of w (effort - row x)^2.
    pub fn residual(&self, x: &DVector<f64>) -> f64 {
        (self.square - 2.0 * self.right.dot(x) + x.dot(&(&self.matrix * x))).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples every 10 ms with these velocities, rad/s.
    fn samples(velocity: Vec<f64>) -> Samples {
        let time = (0..velocity.len()).map(|i| 0.01 * i as f64).collect();
        Samples { time, velocity, ..Samples::default() }
    }

    #[test]
    fn a_joint_stands_below_a_hundredth_of_its_fastest_speed_for_a_tenth_of_a_second() {
        let slow_for = |count: usize, speed: f64| {
            let mut velocity = vec![-2.0; 40];
            velocity[20..20 + count].fill(speed);
            still(&samples(velocity)).iter().filter(|still| **still).count()
        };
        assert_eq!([slow_for(10, 0.0199), slow_for(10, -0.0199)], [10, 10]);
        assert_eq!([slow_for(9, 0.0199), slow_for(10, 0.02)], [0, 0]);
        // A reversal stands for no time, a joint that never moves for all of it.
        assert!(!still(&samples((0..100).map(|i| f64::from(i - 50)).collect())).contains(&true));
        assert!(!still(&samples(vec![0.0; 20])).contains(&true), "nothing is slower than a joint that never moves");
    }
}
