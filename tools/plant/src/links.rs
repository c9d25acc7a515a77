//! Rigid links between virtual joints.
//!
//! Every period of the bridges, all joints step together: with the mass matrix M, the bias h (Coriolis, centrifugal and
//! gravity torques), rotors R and the slope s of each friction,
//!
//! ```text
//! (M + R + dt diag(s)) dv = dt (motor - friction(v) - h + external)
//! ```
//!
//! which is the backward Euler step of [`crate::joint`], for all joints at once. Each joint then makes that step
//! itself, under the torque that the others exert on its link. M and h are computed anew every [`EVERY`] periods.
//! A joint that is held, as by a closed brake, stands at once, and the others move around it. Joints of a pair relieve
//! each other's friction before the step ([`crate::pair`]).

use crate::joint::{Answer, MAXIMUM_STEP};
use crate::pair::{Pair, PairError, check};
use crate::virtual_joint::VirtualJoint;
use joint_firmware::joint::state_machine::State;
use joint_firmware::joint::{Demand, Telemetry};
use nalgebra::{DMatrix, DVector};
use rigid_body::mass_matrix::mass_matrix;
use rigid_body::newton_euler::inverse_dynamics;
use rigid_body::{JointKind, Tree};

/// Periods of the bridges between two looks at where the links are.
pub const EVERY: u64 = 4;

/// Reason for which an arm cannot be made, or does not start.
#[derive(Clone, Debug, PartialEq)]
pub enum ArmError {
    /// Joints of the tree, and virtual joints.
    Count(usize, usize),
    /// Index of a joint that slides: actuators turn.
    Slides(usize),
    /// Index of a joint with a link of its own; links are the tree's.
    Loaded(usize),
    /// Index of a joint whose control period is not that of the first, or longer than [`MAXIMUM_STEP`].
    Period(usize),
    /// Number of the pair, and reason for which two joints cannot share a drive.
    Pair(usize, PairError),
    /// Index of a joint that did not reach "operation enabled", and the state that it stayed in.
    NotEnabled(usize, State),
}

impl std::fmt::Display for ArmError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Count(tree, joints) => write!(f, "the tree has {tree} joints, and {joints} virtual joints are given"),
            Self::Slides(i) => write!(f, "joint {i} slides; virtual joints turn"),
            Self::Loaded(i) => write!(f, "joint {i} has a link or payload of its own; an arm's links are the tree's"),
            Self::Period(i) => write!(
                f,
                "the control period of joint {i} is not that of the first joint, or longer than {MAXIMUM_STEP} s"
            ),
            Self::Pair(number, error) => write!(f, "pair {number}: {error}"),
            Self::NotEnabled(i, state) => write!(f, "joint {i} cannot be enabled: it stays in {state:?}"),
        }
    }
}

impl std::error::Error for ArmError {}

/// Links of an arm, from position zero of all joints on.
#[derive(Clone, Debug)]
pub struct Links {
    tree: Tree,
    mass: DMatrix<f64>,
    bias: DVector<f64>,
    steps: u64,
    pairs: Vec<Pair>,
}

impl Links {
    /// Links between these joints. Rotor inertias are those of the joints' motors, not the tree's; joints have neither
    /// link nor payload.
    ///
    /// # Errors
    /// [`ArmError`].
    pub fn new(mut tree: Tree, joints: &[&VirtualJoint]) -> Result<Self, ArmError> {
        let n = tree.len();
        if joints.len() != n || n == 0 {
            return Err(ArmError::Count(n, joints.len()));
        }
        for (i, (joint, own)) in tree.joints.iter_mut().zip(joints).enumerate() {
            joint.armature = 0.0;
            let load = own.actuator().parameters().joint.load;
            let period = own.period();
            if joint.kind != JointKind::Revolute {
                return Err(ArmError::Slides(i));
            }
            if load.total_inertia() != 0.0 || load.gravity_amplitude() != 0.0 {
                return Err(ArmError::Loaded(i));
            }
            if period != joints[0].period() || period > MAXIMUM_STEP {
                return Err(ArmError::Period(i));
            }
        }
        Ok(Self { tree, mass: DMatrix::zeros(n, n), bias: DVector::zeros(n), steps: 0, pairs: vec![] })
    }

    /// The same between joints that share drives in pairs.
    ///
    /// # Errors
    /// [`ArmError::Pair`].
    pub fn with_pairs(mut self, pairs: Vec<Pair>) -> Result<Self, ArmError> {
        check(&pairs, self.tree.len()).map_err(|(number, error)| ArmError::Pair(number, error))?;
        self.pairs = pairs;
        Ok(self)
    }

    /// Pairs of joints that share a drive, with the joint that leads now.
    #[must_use]
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// The tree.
    #[must_use]
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// One control step of every joint, then one period of physics with external torques (Nm at the joints); joints
    /// that are held stand. What is missing is zero, and not held.
    pub fn step(
        &mut self,
        joints: &mut [&mut VirtualJoint],
        demands: &[Demand],
        external: &[f64],
        held: &[bool],
    ) -> Vec<Telemetry> {
        for pair in &mut self.pairs {
            let speeds = pair.joints.map(|joint| joints[joint].actuator().state().joint.velocity.abs());
            for (joint, factor) in pair.joints.into_iter().zip(pair.look(speeds)) {
                joints[joint].actuator_mut().relieve(factor);
            }
        }
        let nothing = Demand::default();
        let demands = demands.iter().chain(std::iter::repeat(&nothing));
        let driven: Vec<_> = joints.iter_mut().zip(demands).map(|(joint, demand)| joint.drive(demand)).collect();
        let answers: Vec<Answer> = joints.iter().zip(&driven).map(|(joint, driven)| joint.answer(driven)).collect();
        let state = |joint: &&mut VirtualJoint| joint.actuator().state().joint;
        let positions: Vec<f64> = joints.iter().map(|joint| state(joint).position).collect();
        let velocities: Vec<f64> = joints.iter().map(|joint| state(joint).velocity).collect();
        let period = joints.first().map_or(MAXIMUM_STEP, |joint| joint.period());
        if self.steps.is_multiple_of(EVERY) {
            self.mass = mass_matrix(&self.tree, &positions);
            let still = vec![0.0; positions.len()];
            self.bias = DVector::from_vec(inverse_dynamics(&self.tree, &positions, &velocities, &still));
        }
        self.steps += 1;
        let changes = self.changes(&answers, &velocities, external, held, period);
        let joints = joints.iter_mut().zip(driven).zip(answers).zip(changes.iter());
        let step = |(((joint, driven), answer), change): (((&mut &mut VirtualJoint, _), Answer), &f64)| {
            // With this torque the joint's own step makes the same change.
            let from_links = change * (answer.inertia / period + answer.slope) - answer.torque;
            joint.follow(driven, from_links)
        };
        joints.map(step).collect()
    }

    /// Changes of the velocities over the next step.
    fn changes(
        &self,
        answers: &[Answer],
        velocities: &[f64],
        external: &[f64],
        held: &[bool],
        period: f64,
    ) -> DVector<f64> {
        let n = answers.len();
        let mut matrix = self.mass.clone();
        let mut right = -self.bias.clone();
        for (i, answer) in answers.iter().enumerate() {
            matrix[(i, i)] += answer.inertia + period * answer.slope;
            right[i] += answer.torque + external.get(i).copied().unwrap_or(0.0);
        }
        right *= period;
        // What a held joint does is known: it moves to the right, and its row says so.
        for i in (0..n).filter(|&i| held.get(i) == Some(&true)) {
            let change = -velocities[i];
            right -= change * matrix.column(i);
            matrix.row_mut(i).fill(0.0);
            matrix.column_mut(i).fill(0.0);
            (matrix[(i, i)], right[i]) = (1.0, change);
        }
        // Positive definite: links and rotors have mass, and the slope of friction is never negative.
        matrix.cholesky().map_or_else(|| DVector::zeros(n), |factor| factor.solve(&right))
    }
}
