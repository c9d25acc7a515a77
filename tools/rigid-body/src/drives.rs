//! `robot.toml`: everything of a robot that URDF does not say, drives above all.
//!
//! ```toml
//! urdf = "arm.urdf"                   # beside this file
//! gravity = [0.0, 0.0, -9.81]         # m/s^2 in the frame of the base: how the robot is mounted; this is the default
//! locked = ["gripper_joint"]          # joints that did not move, at position 0
//! floor = 0.05                        # least height of moving links' frames above the base's origin, m
//!
//! [joint.shoulder]
//! gain = 0.12                         # torque of the motor per unit of effort, Nm/A; 1 where the effort is a torque
//! ratio = 100.0                       # turns of the motor per turn of the joint (1); negative: opposite direction
//! rotor_inertia = 2e-5                # kg m^2 on the motor's side; absent: identified
//! position = [-1.5, 1.5]              # travel, rad or m; absent: the URDF's <limit>
//! velocity = 2.0                      # rad/s or m/s; absent: the URDF's <limit>
//! acceleration = 10.0                 # rad/s^2 or m/s^2; URDF has none
//!
//! [coupling]                          # belts and differentials; absent: each motor drives its joint alone
//! joints = ["wrist_1", "wrist_2"]
//! matrix = [[50.0, 50.0], [50.0, -50.0]]   # motor velocities = matrix * joint velocities, in place of the ratios
//!
//! [[pair]]                            # joints that share a drive: friction of one is less while the other is faster
//! joints = ["shoulder", "elbow"]
//! band = 0.05                         # speed by which one has to be the faster one to lead, rad/s or m/s (0.05)
//! ```

use serde::Deserialize;
use std::collections::BTreeMap;

/// The content of `robot.toml`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct RobotDescription {
    /// File of the URDF.
    pub urdf: String,
    /// Gravity in the frame of the base, m/s^2.
    #[serde(default = "gravity")]
    pub gravity: [f64; 3],
    /// Joints that are held at position 0.
    #[serde(default)]
    pub locked: Vec<String>,
    /// Least height of moving links' frames above the base's origin, against gravity, m; None: no floor.
    pub floor: Option<f64>,
    /// Drives by the name of their joint.
    pub joint: BTreeMap<String, Drive>,
    /// Motors that move several joints.
    pub coupling: Option<Coupling>,
    /// Joints that share a drive.
    #[serde(default)]
    pub pair: Vec<PairDescription>,
}

/// Drive of one joint.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    /// Torque of the motor per unit of effort, Nm/A (Nm/Nm, Nm/V).
    #[serde(default = "one")]
    pub gain: f64,
    /// Turns of the motor per turn of the joint (per metre of a prismatic one, rad/m).
    #[serde(default = "one")]
    pub ratio: f64,
    /// Inertia of the rotor on the motor's side, kg m^2; None: identified.
    pub rotor_inertia: Option<f64>,
    /// Lowest and highest position, rad or m; None: that of the URDF.
    pub position: Option<[f64; 2]>,
    /// Largest velocity, rad/s or m/s; None: that of the URDF.
    pub velocity: Option<f64>,
    /// Largest acceleration, rad/s^2 or m/s^2.
    pub acceleration: Option<f64>,
}

impl Default for Drive {
    /// A motor without gear, whose effort is its torque.
    fn default() -> Self {
        Self { gain: 1.0, ratio: 1.0, rotor_inertia: None, position: None, velocity: None, acceleration: None }
    }
}

/// Two joints that share a drive.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct PairDescription {
    /// Their names.
    pub joints: [String; 2],
    /// Speed by which one of them has to be the faster one to lead, rad/s or m/s.
    #[serde(default = "band")]
    pub band: f64,
}

/// Motors that move several joints.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Coupling {
    /// Joints, each with the motor of its name.
    pub joints: Vec<String>,
    /// Motor velocities = matrix * joint velocities.
    pub matrix: Vec<Vec<f64>>,
}

fn gravity() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

fn band() -> f64 {
    0.05
}

fn one() -> f64 {
    1.0
}
