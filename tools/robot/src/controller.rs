//! Computed torque (003, eq. 9) for joints that close the loop themselves: the model's torque of the reference, and for
//! each joint stiffness and damping by the inertia that it has there; host.

use super::evaluate::{RobotEvaluateError, bodies_of};
use rigid_body::mass_matrix::mass_matrix;
use rigid_body::{LinkInertia, Robot};
use std::path::Path;

/// A controller.
#[derive(Clone, Debug)]
pub struct Controller {
    robot: Robot,
    rotors: Vec<f64>,
    bandwidth: f64,
}

/// Share of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// Torque of the reference motion, Nm.
    pub torque: f64,
    /// Nm/rad.
    pub stiffness: f64,
    /// Critical damping, Nm s/rad.
    pub damping: f64,
}

impl Controller {
    /// A controller of this bandwidth (rad/s) with the links of the robot and these rotor inertias (kg m² on the
    /// motors' side).
    pub fn new(robot: Robot, rotors: &[f64], bandwidth: f64) -> Self {
        Self { robot, rotors: rotors.to_vec(), bandwidth }
    }

    /// The same with the links that the robot's URDF has, and the rotors of its `robot.toml`, 0 where it has none.
    pub fn of_urdf(robot: Robot, bandwidth: f64) -> Self {
        let rotors: Vec<f64> = robot.drives.iter().map(|drive| drive.rotor_inertia.unwrap_or(0.0)).collect();
        Self::new(robot, &rotors, bandwidth)
    }

    /// The same with links and rotors of a folder that `robot fit` wrote; the robot is described in the file `of`.
    ///
    /// # Errors
    /// A folder of another robot, or none.
    pub fn of_fitted(mut robot: Robot, of: &Path, folder: &Path, bandwidth: f64) -> Result<Self, RobotEvaluateError> {
        let bodies = bodies_of(folder, &robot, of)?;
        for (joint, own) in robot.tree.joints.iter_mut().zip(&bodies) {
            joint.link = LinkInertia::from_parameters(&own.link);
        }
        let rotors: Vec<f64> = bodies.iter().map(|own| own.rotor_inertia).collect();
        Ok(Self::new(robot, &rotors, bandwidth))
    }

    /// The robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Shares of all joints at a reference: positions (rad), velocities (rad/s) and accelerations (rad/s²).
    pub fn at(&self, q: &[f64], v: &[f64], a: &[f64]) -> Vec<Share> {
        let torques = self.robot.inverse_dynamics(q, v, a, &self.rotors);
        let mass = mass_matrix(&self.robot.tree, q) + self.robot.rotor_matrix(&self.rotors);
        let share = |(i, torque): (usize, f64)| Share {
            torque,
            stiffness: mass[(i, i)] * self.bandwidth * self.bandwidth,
            damping: 2.0 * mass[(i, i)] * self.bandwidth,
        };
        torques.into_iter().enumerate().map(share).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pendulum_gets_its_weight_its_inertia_and_gains_by_both() {
        // 2 kg at 0.5 m, about y: 0.5 kg m² and a rotor of 0.1 kg m² behind a ratio of 2.
        let urdf = "<robot name='p'><link name='base'/><joint name='j' type='revolute'><parent link='base'/>\
                    <child link='l'/><axis xyz='0 1 0'/><limit lower='-3' upper='3' effort='1' velocity='9'/></joint>\
                    <link name='l'><inertial><origin xyz='0.5 0 0'/><mass value='2'/>\
                    <inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/></inertial></link></robot>";
        let toml = "urdf = 'p.urdf'\ngravity = [0.0, 0.0, -10.0]\n[joint.j]\nratio = 2.0\nrotor_inertia = 0.1\n";
        let robot = Robot::new(toml, "robot.toml", urdf, "p.urdf").unwrap();
        let controller = Controller::of_urdf(robot, 10.0);
        let near = |value: f64, wanted: f64| (value - wanted).abs() < 1e-9;
        // Level, a positive turn about y sinks: the motor holds upwards.
        let [still] = controller.at(&[0.0], &[0.0], &[0.0])[..] else { panic!("one joint") };
        assert!(near(still.torque, -10.0) && near(still.stiffness, 90.0) && near(still.damping, 18.0), "{still:?}");
        let [speeding] = controller.at(&[0.0], &[3.0], &[2.0])[..] else { panic!("one joint") };
        assert!(near(speeding.torque, -10.0 + 0.9 * 2.0), "{speeding:?}");
    }
}
