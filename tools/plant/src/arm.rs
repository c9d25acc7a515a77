//! A virtual arm: virtual joints, each with its actuator, friction and control step, on one tree of rigid links.
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

use crate::joint::{Answer, MAXIMUM_STEP};
use crate::virtual_joint::VirtualJoint;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Demand, OFFSET_STEPS, Telemetry};
use nalgebra::{DMatrix, DVector};
use rigid_body::mass_matrix::mass_matrix;
use rigid_body::newton_euler::inverse_dynamics;
use rigid_body::{JointKind, Tree};

/// Periods of the bridges between two looks at where the links are.
pub const EVERY: u64 = 4;

/// Reason for which an arm cannot be made.
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
            Self::NotEnabled(i, state) => write!(f, "joint {i} cannot be enabled: it stays in {state:?}"),
        }
    }
}

impl std::error::Error for ArmError {}

/// Virtual joints on one tree of links.
#[derive(Clone, Debug)]
pub struct Arm {
    tree: Tree,
    joints: Vec<VirtualJoint>,
    mass: DMatrix<f64>,
    bias: DVector<f64>,
    steps: u64,
    held: bool,
}

impl Arm {
    /// An arm at position zero of all joints. Rotor inertias are those of the joints' motors, not the tree's; joints
    /// have neither link nor payload.
    ///
    /// # Errors
    /// [`ArmError`].
    pub fn new(mut tree: Tree, joints: Vec<VirtualJoint>) -> Result<Self, ArmError> {
        let n = tree.len();
        if joints.len() != n || n == 0 {
            return Err(ArmError::Count(n, joints.len()));
        }
        for (i, (joint, own)) in tree.joints.iter_mut().zip(&joints).enumerate() {
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
        Ok(Self { tree, joints, mass: DMatrix::zeros(n, n), bias: DVector::zeros(n), steps: 0, held: false })
    }

    /// The joints.
    #[must_use]
    pub fn joints(&self) -> &[VirtualJoint] {
        &self.joints
    }

    /// The joints, to be changed between two steps.
    pub fn joints_mut(&mut self) -> &mut [VirtualJoint] {
        &mut self.joints
    }

    /// The links.
    #[must_use]
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// True positions (rad) and velocities (rad/s).
    #[must_use]
    pub fn state(&self) -> [Vec<f64>; 2] {
        let states = || self.joints.iter().map(|joint| joint.actuator().state().joint);
        [states().map(|state| state.position).collect(), states().map(|state| state.velocity).collect()]
    }

    /// Duration of a control step, s.
    #[must_use]
    pub fn period(&self) -> f64 {
        self.joints[0].period()
    }

    /// Holds all links where they are, as closed brakes do, or lets them go.
    pub fn hold(&mut self, held: bool) {
        self.held = held;
    }

    /// One control step of every joint, then one period of physics with external torques (Nm at the joints). What is
    /// missing is zero.
    pub fn step(&mut self, demands: &[Demand], external: &[f64]) -> Vec<Telemetry> {
        let nothing = Demand::default();
        let demands = demands.iter().chain(std::iter::repeat(&nothing));
        let driven: Vec<_> = self.joints.iter_mut().zip(demands).map(|(joint, demand)| joint.drive(demand)).collect();
        let answers: Vec<Answer> =
            self.joints.iter().zip(&driven).map(|(joint, driven)| joint.answer(driven)).collect();
        let [positions, velocities] = self.state();
        let period = self.period();
        if self.steps.is_multiple_of(EVERY) {
            self.mass = mass_matrix(&self.tree, &positions);
            let still = vec![0.0; positions.len()];
            self.bias = DVector::from_vec(inverse_dynamics(&self.tree, &positions, &velocities, &still));
        }
        self.steps += 1;
        let changes = match self.held {
            true => DVector::from_iterator(velocities.len(), velocities.iter().map(|velocity| -velocity)),
            false => self.changes(&answers, external, period),
        };
        let joints = self.joints.iter_mut().zip(driven).zip(answers).zip(changes.iter());
        let step = |(((joint, driven), answer), change): (((&mut VirtualJoint, _), Answer), &f64)| {
            // With this torque the joint's own step makes the same change.
            let from_links = change * (answer.inertia / period + answer.slope) - answer.torque;
            joint.follow(driven, from_links)
        };
        joints.map(step).collect()
    }

    /// Changes of the velocities over the next step.
    fn changes(&self, answers: &[Answer], external: &[f64], period: f64) -> DVector<f64> {
        let n = answers.len();
        let mut matrix = self.mass.clone();
        let mut right = -self.bias.clone();
        for (i, answer) in answers.iter().enumerate() {
            matrix[(i, i)] += answer.inertia + period * answer.slope;
            right[i] += answer.torque + external.get(i).copied().unwrap_or(0.0);
        }
        // Positive definite: links and rotors have mass, and the slope of friction is never negative.
        matrix.cholesky().map_or_else(|| DVector::zeros(n), |factor| factor.solve(&(period * right)))
    }

    /// Starts all joints and enables operation, in torque mode without torque; the links are held until then, as by
    /// brakes that open with the joints.
    ///
    /// # Errors
    /// [`ArmError::NotEnabled`].
    pub fn enable(&mut self) -> Result<(), ArmError> {
        self.hold(true);
        let words = [Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::ENABLE_OPERATION];
        let before = std::iter::repeat_n(Controlword::DISABLE_VOLTAGE, OFFSET_STEPS as usize + 1);
        let mut states = Vec::new();
        for (sequence, controlword) in (1..).zip(before.chain(words)) {
            let demand = Demand { controlword, sequence, ..Demand::default() };
            let told = self.step(&vec![demand; self.joints.len()], &[]);
            states = told.iter().map(|telemetry| telemetry.state).collect();
        }
        self.hold(false);
        match states.iter().position(|state| *state != State::OperationEnabled) {
            Some(i) => Err(ArmError::NotEnabled(i, states[i])),
            None => Ok(()),
        }
    }
}
