//! A virtual arm: virtual joints, each with its actuator, friction and control step, on one tree of rigid links.

use crate::links::{ArmError, Links};
use crate::pair::Pair;
use crate::virtual_joint::VirtualJoint;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Demand, OFFSET_STEPS, Telemetry};
use rigid_body::Tree;

/// Virtual joints on one tree of links.
#[derive(Clone, Debug)]
pub struct Arm {
    links: Links,
    joints: Vec<VirtualJoint>,
    held: bool,
}

impl Arm {
    /// An arm at position zero of all joints. Rotor inertias are those of the joints' motors, not the tree's; joints
    /// have neither link nor payload.
    ///
    /// # Errors
    /// [`ArmError`].
    pub fn new(tree: Tree, joints: Vec<VirtualJoint>) -> Result<Self, ArmError> {
        let links = Links::new(tree, &joints.iter().collect::<Vec<_>>())?;
        Ok(Self { links, joints, held: false })
    }

    /// The same with joints that share drives in pairs.
    ///
    /// # Errors
    /// [`ArmError::Pair`].
    pub fn with_pairs(mut self, pairs: Vec<Pair>) -> Result<Self, ArmError> {
        self.links = self.links.with_pairs(pairs)?;
        Ok(self)
    }

    /// Pairs of joints that share a drive, with the joint that leads now.
    #[must_use]
    pub fn pairs(&self) -> &[Pair] {
        self.links.pairs()
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
        self.links.tree()
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
        let held = vec![self.held; self.joints.len()];
        let mut joints: Vec<_> = self.joints.iter_mut().collect();
        self.links.step(&mut joints, demands, external, &held)
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
