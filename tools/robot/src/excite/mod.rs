//! Excitation of all joints of a robot at once: one Fourier series a joint, whose samples tell links, rotors and
//! friction apart as well as the limits permit; host.
//!
//! 002 (section III-B): minimise lambda_1 cond(W^T W) + lambda_2 / sigma_min over the coefficients of all joints, W the
//! regressor of base parameters, rotor inertias and friction, within travel, velocity, acceleration and work space.
//! Work space is a floor here: the least height of all moving links' frames. Links are no shapes: a robot that can
//! hit itself is checked by who runs the motion.
//!
//! - [`regressor`]: W of a motion and its singular values
//! - [`search`]: the series
//! - [`check`]: the motion beside every limit on a fine grid
//! - [`files`]: table of every joint, coefficients, summary

pub mod check;
pub mod files;
pub mod regressor;
pub mod search;

use excitation::{Bounds, ExciteError, within};
use rigid_body::{JointKind, Robot};
use std::path::{Path, PathBuf};

/// Part of travel and velocity that a motion uses: the rest is left to the controllers.
const SHARE: f64 = 0.9;

/// Bounds that a motion may not exceed.
#[derive(Clone, Debug)]
pub struct Task<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// Bounds of every joint, rad or m.
    pub bounds: Vec<Bounds>,
    /// Least height of the moving links' frames, m.
    pub floor: Option<f64>,
}

/// Length and effort of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Duration of the motion, s; 4 to 600.
    pub duration: f64,
    /// Harmonics of each joint, 1 to 20.
    pub harmonics: usize,
    /// Motions drawn at random, 1 to 10,000.
    pub draws: usize,
    /// The best of them that are improved, 1 to `draws`.
    pub restarts: usize,
    /// Rounds of changes over all coefficients, 0 to 1000.
    pub rounds: usize,
    /// Seed of the draws: the same seed gives the same motion.
    pub seed: u64,
}

impl Effort {
    /// Effort of `jointctl robot excite`.
    pub const THOROUGH: Self = Self { duration: 20.0, harmonics: 5, draws: 64, restarts: 4, rounds: 30, seed: 1 };

    fn validate(&self) -> Result<(), ExciteError> {
        within("duration", " s", self.duration, (4.0, 600.0))?;
        within("harmonics", "", self.harmonics as f64, (1.0, 20.0))?;
        within("draws", "", self.draws as f64, (1.0, 1e4))?;
        within("restarts", "", self.restarts as f64, (1.0, self.draws as f64))?;
        within("rounds", "", self.rounds as f64, (0.0, 1e3))
    }
}

/// Reason for which there is no excitation of a robot.
#[derive(Debug, thiserror::Error)]
pub enum RobotExciteError {
    /// A joint without a limit.
    #[error("{}: joint {joint} has no limit of its {limit}: {remedy}", path.display())]
    NoLimit {
        /// The robot's file.
        path: PathBuf,
        /// The joint.
        joint: String,
        /// Position, velocity or acceleration.
        limit: &'static str,
        /// The remedy.
        remedy: String,
    },
    /// A limit that leaves no room.
    #[error("{}: joint {joint}: {source}", path.display())]
    Bounds {
        /// The robot's file.
        path: PathBuf,
        /// The joint.
        joint: String,
        /// The limit and its range.
        source: ExciteError,
    },
    /// A choice outside its range.
    #[error(transparent)]
    Choice(#[from] ExciteError),
    /// No motion above the floor.
    #[error(
        "none of {tried} random motions has room above the floor of {floor} m; in the highest pose frame {frame} is at \
         {highest:.3} m: lower the floor, or narrow `position` of the joints that carry it"
    )]
    NoRoom {
        /// Motions that were tried.
        tried: usize,
        /// The floor, m.
        floor: f64,
        /// Lowest frame of the pose in which it is highest, m.
        highest: f64,
        /// Link of that frame.
        frame: String,
    },
    /// A motion whose samples leave parameters open.
    #[error("every motion leaves parameters undetermined; more harmonics or a longer duration are needed")]
    Undetermined,
    /// A motion that exceeds its limits: a defect of the search.
    #[error("the motion that was found exceeds its limits: {0}")]
    Exceeds(String),
}

impl<'a> Task<'a> {
    /// Bounds of a robot that the file at `path` describes: 90 % of travel and velocity. `acceleration` holds for
    /// joints without one of their own.
    ///
    /// # Errors
    /// The first joint without a limit, or without room to move.
    pub fn of(robot: &'a Robot, path: &Path, acceleration: Option<f64>) -> Result<Self, RobotExciteError> {
        let mut bounds = Vec::new();
        for (joint, limits) in robot.tree.joints.iter().zip(&robot.limits) {
            let missing = |limit: &'static str, remedy: String| RobotExciteError::NoLimit {
                path: path.to_owned(),
                joint: joint.name.clone(),
                limit,
                remedy,
            };
            let own = |key: &str| format!("write {key} in [joint.{}], or <limit> in the URDF", joint.name);
            let (low, high) = limits.position.ok_or_else(|| missing("position", own("position = [low, high]")))?;
            let velocity = limits.velocity.ok_or_else(|| missing("velocity", own("velocity")))?;
            let acceleration = limits.acceleration.or(acceleration).ok_or_else(|| {
                missing("acceleration", format!("write acceleration in [joint.{}], or give --acceleration", joint.name))
            })?;
            let (centre, half) = (0.5 * (low + high), 0.5 * SHARE * (high - low));
            let own = Bounds { position: (centre - half, centre + half), velocity: SHARE * velocity, acceleration };
            let wrong = |source| RobotExciteError::Bounds { path: path.to_owned(), joint: joint.name.clone(), source };
            own.validate().map_err(wrong)?;
            bounds.push(own);
        }
        Ok(Self { robot, bounds, floor: robot.floor })
    }

    /// Unit of a joint's position.
    pub fn unit(&self, joint: usize) -> &'static str {
        match self.robot.tree.joints[joint].kind {
            JointKind::Revolute => "rad",
            JointKind::Prismatic => "m",
        }
    }
}
