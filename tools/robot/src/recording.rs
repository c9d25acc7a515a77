//! `recording.toml`: a data set of one joint's keys, with the columns of every joint, as samples of all joints at the
//! same times; host.
//!
//! ```toml
//! name = "arm, first series"
//! robot = "robot.toml"                     # beside this file
//!
//! [source]
//! files = ["slow.csv", "fast.csv"]
//!
//! [columns]
//! time = { column = "t_s" }
//!
//! [joints.shoulder]                        # every joint of the robot
//! position = { column = "q1_rad" }
//! effort = { column = "i1_A", unit = "A" }
//! ```
//!
//! All other keys are those of `docs/dataset.md` and hold for all joints; `[rigid]` is what the robot's links are. A
//! delay of the effort is not identified, but can be given (`filter.effort_lag`).

use super::bounds::Bounds;
use identification::choice::Folds;
use identification::dataset::description::{PositionColumn, PositionUnit};
use identification::dataset::load::Environment;
use identification::dataset::{DatasetError, Prepared, prepare_text};
use identification::samples::{Part, Partner};
use rigid_body::{JointKind, Robot, RobotError};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

/// Speed below which a joint stood still, RMS in rad/s or m/s.
const STILL: f64 = 1e-3;
/// Part of the travel by which positions may lie beyond its ends: limits of a URDF are rounded, and joints overshoot.
const BEYOND: f64 = 0.05;
/// Findings about a joint that only hold for one that moves alone.
const OF_ONE_JOINT: [&str; 3] = ["excitation", "drift", "inertia"];
/// Degrees in rad.
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Reason for which a robot was not identified.
#[derive(Debug, thiserror::Error)]
pub enum RobotFitError {
    /// A file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The recording's description.
    #[error("{}: {reason}", path.display())]
    Description {
        /// The file.
        path: PathBuf,
        /// Defect and what to do.
        reason: String,
    },
    /// The robot's files.
    #[error(transparent)]
    Robot(Box<RobotError>),
    /// The samples of one joint.
    #[error("{}: joint {joint}: {source}", path.display())]
    Dataset {
        /// The recording's description.
        path: PathBuf,
        /// The joint.
        joint: String,
        /// Cause.
        source: Box<DatasetError>,
    },
    /// A joint that did not move.
    #[error(
        "{}: joint {joint} stood still ({speed:.1e} RMS, at least {STILL:e} is needed): record a motion of it, or list it under `locked` in the \
         robot's file if it was at position 0", path.display()
    )]
    Still {
        /// The recording's description.
        path: PathBuf,
        /// The joint.
        joint: String,
        /// Its speed, rad/s or m/s.
        speed: f64,
    },
    /// A motion that the joint cannot have made.
    #[error(
        "{}: joint {joint}: {quantity} {found}, the limit of URDF or robot's file is {limit}; {remedy}", path.display()
    )]
    BeyondLimits {
        /// The recording's description.
        path: PathBuf,
        /// The joint.
        joint: String,
        /// Position or speed, with a verb.
        quantity: &'static str,
        /// Its values, with unit.
        found: Box<str>,
        /// The limit, with unit.
        limit: Box<str>,
        /// The remedy.
        remedy: Box<str>,
    },
    /// The samples of two joints are not the same rows.
    #[error(
        "{}: after cleaning joint {joint} has {found} samples, the first joint {expected}; rows that are missing for one joint only have to be \
         missing for all: give `clean.dropout` conditions that hold for all", path.display()
    )]
    Rows {
        /// The recording's description.
        path: PathBuf,
        /// The joint.
        joint: String,
        /// Its samples.
        found: usize,
        /// Number that the first joint has.
        expected: usize,
    },
    /// Too few samples, or a motion that determines nothing.
    #[error("{}: {reason}", path.display())]
    Undetermined {
        /// The recording's description.
        path: PathBuf,
        /// Defect and what to do.
        reason: String,
    },
    /// The friction of one joint.
    #[error("{}: joint {joint}: {source}", path.display())]
    Fit {
        /// The recording's description.
        path: PathBuf,
        /// The joint.
        joint: String,
        /// Cause.
        source: identification::fit::FitError,
    },
}

impl From<RobotError> for RobotFitError {
    fn from(error: RobotError) -> Self {
        Self::Robot(Box::new(error))
    }
}

/// All joints of a robot at the same times.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The robot.
    pub robot: Robot,
    /// The text of its URDF.
    pub urdf: String,
    /// Ellipsoids around its links.
    pub bounds: Bounds,
    /// Every joint as a data set of its own, in the robot's order.
    pub joints: Vec<Prepared>,
    /// Name in the description.
    pub name: String,
    /// File of the description.
    pub path: PathBuf,
}

impl Recording {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.joints.first().map_or(0, |joint| joint.samples.len())
    }

    /// True without a sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The use of a sample: unused where it is for one joint.
    pub fn part(&self, sample: usize) -> Part {
        let mut parts = self.joints.iter().map(|joint| joint.samples.part[sample]);
        let first = self.joints[0].samples.part[sample];
        if parts.any(|part| part == Part::Unused) { Part::Unused } else { first }
    }

    /// Positions, velocities and accelerations of all joints at a sample.
    pub fn state(&self, sample: usize) -> [Vec<f64>; 3] {
        let of = |column: fn(&identification::samples::Samples) -> &Vec<f64>| -> Vec<f64> {
            self.joints.iter().map(|joint| column(&joint.samples)[sample]).collect()
        };
        [of(|s| &s.position), of(|s| &s.velocity), of(|s| &s.acceleration)]
    }

    /// Gives the samples of a joint that shares its drive the velocity of the other.
    fn join_pairs(&mut self) {
        for pair in self.robot.pairs.clone() {
            let velocity = pair.joints.map(|joint| self.joints[joint].samples.velocity.clone());
            for (joint, other) in pair.joints.into_iter().zip(velocity.into_iter().rev()) {
                let samples = &mut self.joints[joint].samples;
                samples.partner = Some(Partner::new(other, pair.band, samples));
            }
        }
    }

    /// Leaves the first `seconds` of samples for training and validation, in the order of the runs; those of tests
    /// stay.
    pub fn keep_first(&mut self, seconds: f64) {
        for joint in &mut self.joints {
            let samples = &mut joint.samples;
            let mut left = (seconds / samples.period()).round() as usize;
            for part in samples.part.iter_mut().filter(|part| matches!(part, Part::Train | Part::Validation)) {
                if left == 0 {
                    *part = Part::Unused;
                }
                left = left.saturating_sub(1);
            }
            let found = identification::choice::grouping::find(samples, &joint.recordings, &[], &[]);
            joint.folds = found.unwrap_or_else(|_| Folds::default());
        }
    }
}

/// Reads robot and recording that the TOML file at `path` describes; `environment` gives the variables in paths.
///
/// # Errors
/// [`RobotFitError`], with file, joint and what to do.
pub fn record(path: &Path, environment: Environment) -> Result<Recording, RobotFitError> {
    let wrong = |reason: String| RobotFitError::Description { path: path.to_owned(), reason };
    let text = read(path)?;
    let mut common: toml::Table = toml::from_str(&text).map_err(|e| wrong(e.to_string().trim_end().to_owned()))?;
    let Some(toml::Value::String(robot)) = common.remove("robot") else {
        return Err(wrong(
            "the key `robot` is missing: it names the file of the robot, as in robot = \"robot.toml\"".into(),
        ));
    };
    let Some(toml::Value::Table(mut joints)) = common.remove("joints") else {
        return Err(wrong("there is no [joints.NAME] with the columns of a joint".into()));
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let robot_file = folder.join(expanded(&robot, environment).map_err(wrong)?);
    let RobotFiles { robot, urdf, urdf_file } = read_files(&robot_file, environment)?;
    let bounds = Bounds::of(&robot, &urdf_file);
    let name = common.get("name").and_then(toml::Value::as_str).unwrap_or("robot").to_owned();
    let mut prepared = Vec::new();
    for joint in &robot.tree.joints {
        let Some(toml::Value::Table(columns)) = joints.remove(&joint.name) else {
            return Err(wrong(format!(
                "joint {0} of {1} has no [joints.{0}]: name its columns, or list it under `locked` there",
                joint.name,
                robot_file.display()
            )));
        };
        let text = of_one_joint(&common, &columns, &joint.name).map_err(wrong)?;
        let (path, joint) = (path.to_owned(), joint.name.clone());
        let mut one = prepare_text(&text, &path, environment, |_| ()).map_err(|source| match source {
            DatasetError::Constant { signal: "position", .. } => {
                RobotFitError::Still { path: path.clone(), joint, speed: 0.0 }
            }
            source => RobotFitError::Dataset { path: path.clone(), joint, source: Box::new(source) },
        })?;
        one.warnings.retain(|warning| !OF_ONE_JOINT.contains(&warning.check));
        prepared.push(one);
    }
    if let Some(name) = joints.keys().next() {
        return Err(wrong(format!(
            "[joints.{name}] is no moving joint of {}; remove it, or correct its name",
            robot_file.display()
        )));
    }
    let mut recording = Recording { robot, urdf, bounds, joints: prepared, name, path: path.to_owned() };
    check(&recording, path)?;
    recording.join_pairs();
    Ok(recording)
}

/// Reads the robot that the TOML file at `path` describes; `environment` gives the variables in the path of its URDF.
///
/// # Errors
/// [`RobotFitError`], with file, joint and what to do.
pub fn read_robot(path: &Path, environment: Environment) -> Result<Robot, RobotFitError> {
    Ok(read_files(path, environment)?.robot)
}

/// A robot with its URDF's text and place.
struct RobotFiles {
    robot: Robot,
    urdf: String,
    urdf_file: PathBuf,
}

fn read_files(path: &Path, environment: Environment) -> Result<RobotFiles, RobotFitError> {
    let text = read(path)?;
    let described = rigid_body::robot::describe(&text, &path.to_string_lossy())?;
    let wrong = |reason| RobotFitError::Description { path: path.to_owned(), reason };
    let urdf_file = expanded(&described.urdf, environment).map_err(wrong)?;
    let urdf_file = path.parent().unwrap_or(Path::new("")).join(urdf_file);
    let urdf = read(&urdf_file)?;
    let robot = Robot::new(&text, &path.to_string_lossy(), &urdf, &urdf_file.to_string_lossy())?;
    Ok(RobotFiles { robot, urdf, urdf_file })
}

fn check(recording: &Recording, path: &Path) -> Result<(), RobotFitError> {
    let path = || path.to_owned();
    let first = &recording.joints[0].samples;
    for (j, prepared) in recording.joints.iter().enumerate() {
        let (joint, samples) = (recording.robot.tree.joints[j].name.clone(), &prepared.samples);
        if samples.time != first.time || samples.run != first.run {
            return Err(RobotFitError::Rows { path: path(), joint, found: samples.len(), expected: first.len() });
        }
        let squares: f64 = samples.velocity.iter().map(|v| v * v).sum();
        let speed = (squares / samples.len().max(1) as f64).sqrt();
        if speed < STILL {
            return Err(RobotFitError::Still { path: path(), joint, speed });
        }
        let (kind, unit) = (recording.robot.tree.joints[j].kind, prepared.description.columns.position.unit);
        if (kind == JointKind::Prismatic) != (unit == PositionUnit::Metre) {
            let right = if kind == JointKind::Prismatic { "m" } else { "rad" };
            let reason = format!(
                "joint {joint} is {kind:?} in the URDF, and its position is in {}; write unit = \"{right}\" in [joints.{joint}] position",
                unit.symbol()
            );
            return Err(RobotFitError::Description { path: path(), reason });
        }
        let beyond = beyond_limits(&recording.robot, j, prepared, speed);
        if let Some((quantity, found, limit)) = beyond {
            let remedy = remedy(&recording.robot.tree.joints[j], &prepared.description.columns.position);
            let [found, limit, remedy] = [found, limit, remedy].map(String::into_boxed_str);
            return Err(RobotFitError::BeyondLimits { path: path(), joint, quantity, found, limit, remedy });
        }
    }
    Ok(())
}

/// Positions or an RMS speed that joint `j` cannot have: quantity, value and limit. Whole turns of a rotation make no
/// difference.
fn beyond_limits(robot: &Robot, j: usize, prepared: &Prepared, speed: f64) -> Option<(&'static str, String, String)> {
    let (limits, joint) = (&robot.limits[j], &robot.tree.joints[j]);
    let unit = prepared.description.columns.position.unit.symbol();
    if let Some((least, most)) = limits.position {
        let positions = &prepared.samples.position;
        let low = positions.iter().copied().fold(f64::INFINITY, f64::min);
        let high = positions.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let turns = match joint.kind {
            JointKind::Revolute => (0.5 * (low + high - least - most) / TAU).round() * TAU,
            JointKind::Prismatic => 0.0,
        };
        let room = BEYOND * (most - least);
        if low - turns < least - room || high - turns > most + room {
            let found = format!("{low:.4} to {high:.4} {unit}");
            return Some(("positions are", found, format!("{least:.4} to {most:.4} {unit}")));
        }
    }
    let most = limits.velocity.filter(|most| speed > *most)?;
    Some(("the RMS speed is", format!("{speed:.4} {unit}/s"), format!("{most:.4} {unit}/s")))
}

/// The remedy where a motion is beyond its limits.
fn remedy(joint: &rigid_body::Joint, column: &PositionColumn) -> String {
    let name = &joint.name;
    let (unit, factor) = match joint.kind {
        JointKind::Revolute => ("degrees", DEGREE),
        JointKind::Prismatic => ("mm", 1e-3),
    };
    format!(
        "if column {:?} is in {unit}, write `scale = {}` beside it in [joints.{name}] position; if its zero is another one, correct \
         the column; if the joint can do this, give its limits in [joint.{name}] of the robot's file",
        column.column,
        factor * column.scale
    )
}

fn read(path: &Path) -> Result<String, RobotFitError> {
    std::fs::read_to_string(path).map_err(|source| RobotFitError::Read { path: path.to_owned(), source })
}

/// A path whose beginning `$NAME`, `${NAME}` or `${NAME:-default}` is replaced by that variable.
fn expanded(text: &str, environment: Environment) -> Result<String, String> {
    let Some(after) = text.strip_prefix("${") else { return Ok(text.to_owned()) };
    let Some((inside, rest)) = after.split_once('}') else { return Err(format!("{text}: there is no }}")) };
    let (name, default) = inside.split_once(":-").map_or((inside, None), |(name, default)| (name, Some(default)));
    let value = environment(name).filter(|value| !value.is_empty()).or(default.map(str::to_owned));
    value.map(|value| value + rest).ok_or_else(|| format!("{text}: the variable {name} is not set; set it"))
}

/// The description of one joint's data set.
fn of_one_joint(common: &toml::Table, columns: &toml::Table, joint: &str) -> Result<String, String> {
    let mut one = common.clone();
    let table = |one: &mut toml::Table, key: &str| match one.entry(key).or_insert(toml::Table::new().into()) {
        toml::Value::Table(table) => Ok(std::mem::take(table)),
        _ => Err(format!("[{key}] is no table")),
    };
    let mut all = table(&mut one, "columns")?;
    all.extend(columns.clone());
    one.insert("columns".into(), all.into());
    let mut filter = table(&mut one, "filter")?;
    filter.entry("lag_limit").or_insert(0.0.into());
    one.insert("filter".into(), filter.into());
    let name = common.get("name").and_then(toml::Value::as_str).unwrap_or("robot");
    one.insert("name".into(), format!("{name}, {joint}").into());
    toml::to_string(&one).map_err(|error| error.to_string())
}
