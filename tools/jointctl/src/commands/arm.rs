//! Arguments of `jointctl sim --robot`: an arm of virtual joints, each with its actuator, on the links of a URDF.

use super::CommandError;
use super::joint::read_plant;
use crate::joint_text;
use clap::Args;
use plant::ActuatorParameters;
use plant::load::LoadParameters;
use plant::pair::{self, Pair};
use plant::virtual_joint::Setup;
use rigid_body::newton_euler::inverse_dynamics;
use rigid_body::{JointKind, Robot, Tree};
use robot::read_robot;
use std::path::{Path, PathBuf};

/// Postures of which the heaviest counts, for each joint.
const POSTURES: u32 = 1_000;

/// Part of its dry friction that a joint of a pair keeps while the other one leads.
const RELIEF: f64 = 0.5;

/// Which arm.
#[derive(Debug, Args)]
pub struct ArmChoice {
    /// Run the joints of this robot, a node each, on the links of its URDF (docs/robot.md). A joint that is not enabled
    /// is held, as by a brake
    #[arg(long, value_name = "TOML", requires = "bus",
        conflicts_with_all = ["config", "plant", "joint", "image", "elf", "scenario", "excitation"])]
    robot: Option<PathBuf>,
    /// Folder with JOINT/plant.toml and JOINT/joint.toml for joints that differ from the reference joint
    #[arg(long, value_name = "DIR", requires = "robot")]
    actuators: Option<PathBuf>,
    /// Part of its dry friction that a joint of a `[[pair]]` keeps while the other moves faster, 0.01 to 1; 0.5 unless
    /// it is given
    #[arg(long, value_name = "PART", requires = "robot")]
    relief: Option<f64>,
}

/// A joint of an arm.
#[derive(Debug)]
pub struct ArmJoint {
    /// Its name in the URDF.
    pub name: String,
    /// Its actuator, without link and payload.
    pub plant: ActuatorParameters,
    /// Its board and configuration.
    pub setup: Setup,
}

/// An arm that can be run.
#[derive(Debug)]
pub struct Arm {
    /// Its links.
    pub tree: Tree,
    /// Its joints, in the order of the tree's.
    pub joints: Vec<ArmJoint>,
    /// Joints that share a drive.
    pub pairs: Vec<Pair>,
}

impl ArmChoice {
    /// The arm, where one is named; says on standard error which actuators are too weak for their links.
    pub fn read(&self) -> Result<Option<Arm>, CommandError> {
        let Some(path) = &self.robot else { return Ok(None) };
        let robot = read_robot(path, &|name| std::env::var(name).ok())?;
        each_turns_alone(&robot, path)?;
        if let Some(folder) = self.actuators.as_deref().filter(|folder| !folder.is_dir()) {
            return Err(CommandError::Arguments(format!("--actuators {}: there is no such folder", folder.display())));
        }
        let joint = |name: &String| self.joint(name);
        let joints: Vec<ArmJoint> =
            robot.tree.joints.iter().map(|of| joint(&of.name)).collect::<Result<_, CommandError>>()?;
        for (joint, weight) in joints.iter().zip(heaviest(&robot)) {
            let torque = f64::from(joint.setup.configuration.limits.torque);
            if weight > torque {
                eprintln!(
                    "{}: its links weigh up to {weight:.1} Nm, its actuator gives {torque:.1} Nm; --actuators names \
                     others",
                    joint.name
                );
            }
        }
        let pairs = self.pairs(&robot, path)?;
        Ok(Some(Arm { tree: robot.tree, joints, pairs }))
    }

    fn pairs(&self, robot: &Robot, path: &Path) -> Result<Vec<Pair>, CommandError> {
        if let (Some(relief), true) = (self.relief, robot.pairs.is_empty()) {
            let reason =
                format!("--relief {relief}: {} has no [[pair]], add it or leave the option out", path.display());
            return Err(CommandError::Arguments(reason));
        }
        let relief = self.relief.unwrap_or(RELIEF);
        let pairs: Vec<Pair> = robot.pairs.iter().map(|pair| Pair::new(pair.joints, pair.band, relief)).collect();
        match pair::check(&pairs, robot.tree.len()) {
            Ok(()) => Ok(pairs),
            Err((_, error)) => Err(CommandError::Arguments(format!("--relief {relief}: {error}"))),
        }
    }

    fn joint(&self, name: &str) -> Result<ArmJoint, CommandError> {
        let file = |file: &str| {
            let path = self.actuators.as_ref()?.join(name).join(file);
            path.exists().then_some(path)
        };
        let mut plant = match file("plant.toml") {
            Some(path) => read_plant(&path)?,
            None => ActuatorParameters::reference(),
        }
        .aligned();
        // Gains and limits are those of a joint with the link that its actuator is meant for.
        let mut setup = Setup::of(&plant);
        if let Some(path) = file("joint.toml") {
            setup.configuration = joint_text::read(&path, &setup.bridge)?;
        }
        plant.joint.load = LoadParameters { inertia: 0.0, mass: 0.0, length: 0.0 };
        Ok(ArmJoint { name: name.to_owned(), plant, setup })
    }
}

/// Refuses robots whose joints slide or share motors: a joint on the bus turns by a motor of its own.
pub fn each_turns_alone(robot: &Robot, path: &Path) -> Result<(), CommandError> {
    let refused = |reason: String| CommandError::Arguments(format!("{}: {reason}", path.display()));
    for (row, joint) in robot.tree.joints.iter().enumerate() {
        if joint.kind != JointKind::Revolute {
            return Err(refused(format!("joint {} slides; a joint on the bus turns", joint.name)));
        }
        if (0..robot.tree.len()).any(|column| column != row && robot.coupling[(row, column)] != 0.0) {
            return Err(refused(format!("joint {} shares its motor; a joint on the bus has its own", joint.name)));
        }
    }
    Ok(())
}

/// Largest torque that gravity takes of each joint, Nm, over postures within its travel, or within half a turn either
/// way where it has none.
fn heaviest(robot: &Robot) -> Vec<f64> {
    let still = vec![0.0; robot.tree.len()];
    let mut most = still.clone();
    for posture in 0..POSTURES {
        // Multiples of the roots of primes lie evenly in as many directions as there are joints.
        let part = |i: usize| (f64::from(posture) * PRIMES[i % PRIMES.len()].sqrt()).fract();
        let at = |(i, limits): (usize, &rigid_body::limits::Limits)| {
            let (low, high) = limits.position.unwrap_or((-std::f64::consts::PI, std::f64::consts::PI));
            low + part(i) * (high - low)
        };
        let q: Vec<f64> = robot.limits.iter().enumerate().map(at).collect();
        let torques = inverse_dynamics(&robot.tree, &q, &still, &still);
        most.iter_mut().zip(torques).for_each(|(most, torque)| *most = most.max(torque.abs()));
    }
    most
}

const PRIMES: [f64; 8] = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0];

#[cfg(test)]
mod tests {
    use super::*;

    /// A robot of two joints of a type, described further.
    fn robot(kind: &str, more: &str) -> Robot {
        let joint = |name: &str, parent: &str, child: &str| {
            format!(
                "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/><axis xyz='0 1 0'/>\
                 <limit lower='-1' upper='1' effort='1' velocity='1'/></joint><link name='{child}'><inertial>\
                 <origin xyz='0.5 0 0'/><mass value='2'/><inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/>\
                 </inertial></link>"
            )
        };
        let (first, second) = (joint("a", "base", "l"), joint("b", "l", "m"));
        let urdf = format!("<robot name='r'><link name='base'/>{first}{second}</robot>");
        let toml = format!("urdf = 'r.urdf'\n[joint.a]\n[joint.b]\n{more}");
        Robot::new(&toml, "robot.toml", &urdf, "r.urdf").unwrap()
    }

    #[test]
    fn joints_that_slide_or_share_a_motor_are_refused_by_name() {
        let told = |robot: &Robot| each_turns_alone(robot, Path::new("robot.toml")).map_err(|error| error.to_string());
        assert_eq!(told(&robot("revolute", "")), Ok(()));
        let sliding = told(&robot("prismatic", "")).unwrap_err();
        assert!(sliding.contains("robot.toml: joint a slides"), "{sliding}");
        let coupling = "[coupling]\njoints = ['a', 'b']\nmatrix = [[1.0, 1.0], [1.0, -1.0]]\n";
        let shared = told(&robot("revolute", coupling)).unwrap_err();
        assert!(shared.contains("joint a shares its motor"), "{shared}");
    }

    #[test]
    fn joints_of_a_pair_relieve_each_other_by_half_or_by_what_is_given_within_its_limits() {
        let pair = "[[pair]]\njoints = ['a', 'b']\nband = 0.1\n";
        let (paired, single) = (robot("revolute", pair), robot("revolute", ""));
        let read = |robot: &Robot, relief: Option<f64>| {
            let choice = ArmChoice { robot: None, actuators: None, relief };
            choice.pairs(robot, Path::new("robot.toml")).map_err(|error| error.to_string())
        };
        assert_eq!(read(&paired, None), Ok(vec![Pair::new([0, 1], 0.1, 0.5)]));
        assert_eq!(read(&single, None), Ok(vec![]));
        for relief in [0.01, 1.0] {
            assert_eq!(read(&paired, Some(relief)), Ok(vec![Pair::new([0, 1], 0.1, relief)]));
        }
        for relief in [0.0099, 1.001, f64::NAN] {
            let text = read(&paired, Some(relief)).unwrap_err();
            assert!(text.contains(&format!("--relief {relief}: pair.relief = ")), "{text}");
        }
        let text = read(&single, Some(0.5)).unwrap_err();
        assert!(text.contains("robot.toml has no [[pair]]"), "{text}");
    }

    #[test]
    fn the_heaviest_posture_is_found() {
        // Level, 2 kg at 0.5 m each: both links on the first joint, with the second one's frame at the first's.
        let [first, second] = heaviest(&robot("revolute", ""))[..] else { panic!("two joints") };
        assert!((second / (2.0 * 9.81 * 0.5) - 1.0).abs() < 0.02, "{second}");
        assert!((first / (2.0 * second) - 1.0).abs() < 0.02, "{first} {second}");
    }
}
