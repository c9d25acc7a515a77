//! Several nodes whose joints turn the links of one arm; frames and time passed in.
//!
//! A joint whose operation is not enabled is held where it is, as by a brake that its drive closes; an arm whose joints
//! are off does not fall.

use crate::serve::Served;
use crate::virtual_node::VirtualNode;
use bus::Frame;
use joint_firmware::joint::state_machine::State;
use plant::{ArmError, Links, Pair, VirtualJoint};
use rigid_body::Tree;
use std::time::Duration;

/// Nodes on one tree of links.
#[derive(Debug)]
pub struct VirtualArm {
    links: Links,
    nodes: Vec<VirtualNode>,
    held: Vec<bool>,
}

impl VirtualArm {
    /// An arm at position zero of all joints, in the order of the tree's.
    ///
    /// # Errors
    /// [`ArmError`].
    pub fn new(tree: Tree, nodes: Vec<VirtualNode>) -> Result<Self, ArmError> {
        let joints: Vec<&VirtualJoint> = nodes.iter().map(VirtualNode::joint).collect();
        let links = Links::new(tree, &joints)?;
        let held = vec![true; nodes.len()];
        Ok(Self { links, nodes, held })
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

    /// The nodes.
    #[must_use]
    pub fn nodes(&self) -> &[VirtualNode] {
        &self.nodes
    }

    /// Control steps of all joints.
    pub fn advance(&mut self, steps: u64) {
        for _ in 0..steps {
            let before: Vec<_> = self.nodes.iter().map(VirtualNode::before).collect();
            let demands: Vec<_> = before.iter().map(|before| before.demand).collect();
            let external: Vec<_> = self.nodes.iter().map(|node| node.external_torque).collect();
            let mut joints: Vec<_> = self.nodes.iter_mut().map(|node| &mut node.joint).collect();
            let told = self.links.step(&mut joints, &demands, &external, &self.held);
            for (((node, held), before), telemetry) in self.nodes.iter_mut().zip(&mut self.held).zip(&before).zip(&told)
            {
                *held = !matches!(telemetry.state, State::OperationEnabled | State::QuickStopActive);
                node.after(before, telemetry);
            }
        }
    }
}

impl Served for VirtualArm {
    fn now(&self) -> Duration {
        self.nodes.first().map_or(Duration::ZERO, Served::now)
    }

    fn live_until(&mut self, instant: Duration) -> Result<(), String> {
        if let Some(first) = self.nodes.first() {
            let steps = (instant.as_secs_f64() * f64::from(first.rate())) as u64;
            self.advance(steps.saturating_sub(first.steps()));
        }
        Ok(())
    }

    fn receive(&mut self, frame: &Frame) {
        self.nodes.iter_mut().for_each(|node| Served::receive(node, frame));
    }

    fn take_frame(&mut self) -> Option<Frame> {
        let (sender, frame) =
            self.nodes.iter_mut().enumerate().find_map(|(i, node)| Some((i, Served::take_frame(node)?)))?;
        // The bus carries it to the others of this arm, too.
        let others = self.nodes.iter_mut().enumerate().filter(|(i, _)| *i != sender);
        others.for_each(|(_, node)| Served::receive(node, &frame));
        Some(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::images::SlotImages;
    use crate::virtual_node::Options;
    use bus::client::{Command, Target};
    use plant::ActuatorParameters;
    use plant::load::LoadParameters;
    use plant::virtual_joint::Setup;
    use rigid_body::random_tree::{Shape, tree};

    const JOINTS: u8 = 3;
    const MILLISECOND: u64 = 20;

    fn arm() -> VirtualArm {
        let mut parameters = ActuatorParameters::reference().aligned();
        let mut setup = Setup::of(&parameters);
        setup.configuration.limits.command_deadline = 5.0;
        parameters.joint.load = LoadParameters { inertia: 0.0, mass: 0.0, length: 0.0 };
        let node = |node_id: u8| {
            let options = Options { node_id, serial: node_id.into(), seed: node_id.into() };
            VirtualNode::new(parameters, &setup, &options, SlotImages::empty().unwrap()).unwrap()
        };
        let shape = Shape { joints: JOINTS.into(), branches: false, prismatic: 0.0, armature: false };
        let mut arm = VirtualArm::new(tree(shape, 5), (1..=JOINTS).map(node).collect()).unwrap();
        arm.advance(200 * MILLISECOND);
        arm
    }

    fn send(arm: &mut VirtualArm, frame: &Frame) {
        Served::receive(arm, frame);
        arm.advance(5 * MILLISECOND);
        while Served::take_frame(arm).is_some() {}
    }

    /// An expedited SDO download (CiA 301, 7.2.4.3.3).
    fn write(arm: &mut VirtualArm, node: u8, index: u16, sub_index: u8, value: &[u8]) {
        let [low, high] = index.to_le_bytes();
        let mut data = [0x23 | (4 - value.len() as u8) << 2, low, high, sub_index, 0, 0, 0, 0];
        data[4..4 + value.len()].copy_from_slice(value);
        send(arm, &Frame::new(0x600 + u16::from(node), &data).unwrap());
    }

    /// Enables a joint in torque mode without torque.
    fn enable(arm: &mut VirtualArm, node: u8) {
        send(arm, &Command::Start.frame(Target::Node(node)));
        write(arm, node, 0x6060, 0, &[4]);
        for word in [6u16, 7, 15] {
            write(arm, node, 0x6040, 0, &word.to_le_bytes());
        }
    }

    /// Velocity that a joint has after a push of 30 ms, with a pair of the first two joints or without.
    fn pushed(pairs: Vec<Pair>) -> f64 {
        let mut arm = arm().with_pairs(pairs).unwrap();
        enable(&mut arm, 1);
        enable(&mut arm, 2);
        arm.nodes[0].push(25.0);
        arm.nodes[1].push(60.0);
        arm.advance(30 * MILLISECOND);
        let velocity = |node: usize| arm.nodes()[node].joint().actuator().state().joint.velocity;
        assert!(velocity(1) > velocity(0) + 0.1, "{} {}", velocity(0), velocity(1));
        let leader = arm.pairs().first().and_then(Pair::leader);
        assert_eq!(leader, arm.pairs().first().map(|_| 1));
        velocity(0)
    }

    #[test]
    fn a_joint_of_a_pair_moves_more_easily_while_the_other_is_faster() {
        let [alone, paired, whole] =
            [vec![], vec![Pair::new([0, 1], 0.05, 0.2)], vec![Pair::new([0, 1], 0.05, 1.0)]].map(pushed);
        assert!(paired > 1.1 * alone, "{paired} {alone}");
        assert_eq!(whole.to_bits(), alone.to_bits());
        let wrong = arm().with_pairs(vec![Pair::new([0, 3], 0.05, 0.5)]);
        assert!(matches!(wrong, Err(ArmError::Pair(0, _))));
    }

    fn positions(arm: &VirtualArm) -> Vec<f64> {
        arm.nodes().iter().map(|node| node.joint().actuator().state().joint.position).collect()
    }

    #[test]
    fn joints_that_are_off_are_held_and_one_that_is_on_moves_alone() {
        let mut arm = arm();
        arm.advance(300 * MILLISECOND);
        assert!(positions(&arm).iter().all(|position| position.abs() < 1e-12), "{:?}", positions(&arm));
        // A push that no brake lets through.
        arm.nodes.iter_mut().for_each(|node| node.push(20.0));
        enable(&mut arm, 2);
        arm.advance(100 * MILLISECOND);
        let [first, second, third] = positions(&arm)[..] else { panic!("three joints") };
        assert!(first.abs() < 1e-9 && third.abs() < 1e-9 && second.abs() > 1e-3, "{first} {second} {third}");
        // A voltage that is gone closes the brake.
        write(&mut arm, 2, 0x6040, 0, &[0, 0]);
        let stood = positions(&arm)[1];
        arm.advance(100 * MILLISECOND);
        assert!((positions(&arm)[1] - stood).abs() < 1e-9);
    }

    #[test]
    fn joints_of_an_arm_hear_each_other() {
        let mut arm = arm();
        // RPDO 4 of the third joint takes the second one's TPDO 2, its velocity (objects.md).
        write(&mut arm, 3, 0x1403, 1, &0x282u32.to_le_bytes());
        send(&mut arm, &Command::Start.frame(Target::All));
        enable(&mut arm, 2);
        arm.nodes[1].push(30.0);
        arm.advance(100 * MILLISECOND);
        let heard = |arm: &VirtualArm| arm.nodes[2].before().demand.coupled.velocity;
        assert_eq!(heard(&arm), 0.0);
        send(&mut arm, &Frame::new(0x80, &[]).unwrap());
        let velocity = arm.nodes()[1].joint().actuator().state().joint.velocity;
        let told = f64::from(heard(&arm));
        // It slows down on the way.
        assert!(told.abs() > 0.02 && (told - velocity).abs() < 0.02, "{velocity} and {told} rad/s");
    }
}
