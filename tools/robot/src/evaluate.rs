//! A fitted robot on another recording: links, rotors and images as they were written, nothing identified anew; host.
//!
//! `robot.json` has the links, rotors and rigid part of every joint, `JOINT/friction.img` its friction. Gains, coupling
//! and gravity are those of the recording's own robot: an arm that hangs from the ceiling is another `robot.toml`.

use super::equations::rigid_columns;
use super::fit::FittedRobot;
use super::recording::Recording;
use friction_compensation::parameters::image::Image;
use identification::evaluate::rmse;
use identification::image_file::{ImageFileError, read, verify};
use identification::joint_model::{StateError, firmware_states, fixed_point, regimes, rigid_efforts};
use identification::rigid::RigidParameters;
use identification::samples::Part;
use nalgebra::DVector;
use rayon::prelude::*;
use rigid_body::inertia::PARAMETERS;
use rigid_body::{JointKind, Robot};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::io;
use std::path::{Path, PathBuf};

/// Reason for which a fitted robot was not judged.
#[derive(Debug, thiserror::Error)]
pub enum RobotEvaluateError {
    /// A file that cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// Rigid parts that cannot be used.
    #[error("{}: {reason}", path.display())]
    Bodies {
        /// The file.
        path: PathBuf,
        /// Reason.
        reason: String,
    },
    /// The image of a joint.
    #[error(transparent)]
    Image(#[from] ImageFileError),
    /// A sample that does not fit the firmware's quantities.
    #[error(transparent)]
    State(#[from] StateError),
}

/// Rigid part of a joint as it was fitted.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct JointBodies {
    /// Inertial parameters of its link.
    pub link: [f64; PARAMETERS],
    /// Inertia of its rotor, kg m^2 on the motor's side.
    pub rotor_inertia: f64,
    /// Rigid part beside the image's friction: factor of the links' effort, inertia of the joint's own.
    pub rigid: RigidParameters,
    /// Rigid part whose effort is the theoretical torque of the image.
    pub theoretical: RigidParameters,
}

/// Rigid parts of all joints, by name.
pub type Bodies = BTreeMap<String, JointBodies>;

/// Rigid parts of a fitted robot.
pub fn bodies(recording: &Recording, fitted: &FittedRobot) -> Bodies {
    let joint = |(j, one): (usize, &identification::fit::Fitted)| {
        let own = JointBodies {
            link: fitted.links[j].parameters(),
            rotor_inertia: fitted.rotors[j],
            rigid: one.rigid,
            theoretical: one.theoretical,
        };
        (recording.robot.tree.joints[j].name.clone(), own)
    };
    fitted.joints.iter().enumerate().map(joint).collect()
}

/// Errors of one joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointErrors {
    /// The joint.
    pub joint: String,
    /// Unit of the effort.
    pub unit: &'static str,
    /// Samples.
    pub samples: usize,
    /// RMS of the effort.
    pub effort: f64,
    /// RMS error of the rigid part alone.
    pub bodies: f64,
    /// RMS error of rigid part and image.
    pub image: f64,
    /// RMS error of rigid part and image in % of the effort's RMS.
    pub relative_percent: f64,
}

/// A robot that was judged.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluation {
    /// Errors of each joint.
    pub errors: Vec<JointErrors>,
    /// External torque of each joint (Nm, or N where it slides) at each sample, in the direction of its position: what
    /// links, rotors and friction take beyond what the motors give. Errors of the model are in it, too.
    pub external: Vec<Vec<f64>>,
}

/// Samples that are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judged {
    /// All samples that the description uses.
    All,
    /// Samples of its test sets.
    Test,
}

/// Judges the files in `folder`, which `jointctl robot fit` wrote.
///
/// # Errors
/// Files that are missing, damaged, of another robot or in another unit.
pub fn evaluate(folder: &Path, recording: &mut Recording, judged: Judged) -> Result<Evaluation, RobotEvaluateError> {
    let (bodies, images) = fitted(folder, recording)?;
    let efforts = efforts(recording, &bodies);
    let parts: Vec<Part> = (0..recording.len()).map(|i| recording.part(i)).collect();
    let wanted = |part: Part| if judged == Judged::Test { part == Part::Test } else { part != Part::Unused };
    let used: Vec<usize> = (0..parts.len()).filter(|&i| wanted(parts[i])).collect();
    let (mut errors, mut lacking) = (Vec::new(), Vec::new());
    for (j, ((own, image), given)) in bodies.iter().zip(&images).zip(efforts).enumerate() {
        let joint = recording.robot.tree.joints[j].name.clone();
        let unit = recording.joints[j].description.columns.effort.unit.symbol();
        let samples = &mut recording.joints[j].samples;
        samples.extra.insert("rigid".to_owned(), given);
        samples.load = rigid_efforts(&own.theoretical, samples);
        let states = firmware_states(samples)?;
        let sets = regimes(&image.friction.selector, &states, samples);
        let friction = fixed_point(&image.friction, &states, &sets, samples);
        let rigid = rigid_efforts(&own.rigid, samples);
        let over = |left: &dyn Fn(usize) -> f64| rmse(used.iter().map(|&i| left(i)));
        let effort = over(&|i| samples.effort[i]);
        let left: Vec<f64> =
            (0..samples.len()).map(|i| samples.effort[i] - rigid[i] - friction[i].0 - friction[i].1).collect();
        let with_image = over(&|i| left[i]);
        lacking.push(left);
        errors.push(JointErrors {
            joint,
            unit,
            samples: used.len(),
            effort,
            bodies: over(&|i| samples.effort[i] - rigid[i]),
            image: with_image,
            relative_percent: 100.0 * with_image / effort,
        });
    }
    Ok(Evaluation { errors, external: external(&recording.robot, &lacking) })
}

/// Torques at the joints in place of efforts that the motors give beyond a model.
fn external(robot: &Robot, beyond: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let gains = robot.gains();
    let samples = beyond.first().map_or(0, Vec::len);
    let at = |i: usize| &gains * DVector::from_iterator(beyond.len(), beyond.iter().map(|joint| -joint[i]));
    let torques: Vec<DVector<f64>> = (0..samples).map(at).collect();
    (0..beyond.len()).map(|j| torques.iter().map(|of| of[j]).collect()).collect()
}

/// External torques as a table: a row for each sample of the recording, with its file's number and its time.
pub fn external_table(recording: &Recording, external: &[Vec<f64>]) -> String {
    let mut text = String::from("run,time_s");
    for joint in &recording.robot.tree.joints {
        let unit = if joint.kind == JointKind::Prismatic { "force_N" } else { "torque_Nm" };
        // Writing to a string does not fail.
        let _ = write!(text, ",{}.external_{unit}", joint.name);
    }
    text.push('\n');
    let of_first = recording.joints.first().map(|joint| &joint.samples);
    for (i, (run, time)) in of_first.into_iter().flat_map(|of| of.run.iter().zip(&of.time)).enumerate() {
        let _ = write!(text, "{run},{time:.6}");
        external.iter().for_each(|joint| {
            let _ = write!(text, ",{:.5}", joint[i]);
        });
        text.push('\n');
    }
    text
}

/// Rigid parts of a fitted robot in `folder`, in the order of the joints of `robot`, which `of` describes.
///
/// # Errors
/// A file that is missing, damaged or of another robot.
pub fn bodies_of(folder: &Path, robot: &Robot, of: &Path) -> Result<Vec<JointBodies>, RobotEvaluateError> {
    #[derive(Deserialize)]
    struct Summary {
        bodies: Bodies,
    }
    let path = folder.join("robot.json");
    let refused = |reason: String| RobotEvaluateError::Bodies { path: path.clone(), reason };
    let text =
        std::fs::read_to_string(&path).map_err(|source| RobotEvaluateError::Read { path: path.clone(), source })?;
    let Summary { bodies } = serde_json::from_str(&text)
        .map_err(|error| refused(format!("{error}; `jointctl robot fit` of this version writes it")))?;
    let of_joint = |name: &String| {
        let names = || bodies.keys().map(String::as_str).collect::<Vec<&str>>().join(", ");
        let missing = || {
            refused(format!(
                "joint {name} of {} is not in it, it has {}; fit a recording of this robot",
                of.display(),
                names()
            ))
        };
        bodies.get(name).copied().ok_or_else(missing)
    };
    robot.tree.joints.iter().map(|joint| of_joint(&joint.name)).collect()
}

/// Rigid parts and images of all joints, in the recording's order.
fn fitted(folder: &Path, recording: &Recording) -> Result<(Vec<JointBodies>, Vec<Image>), RobotEvaluateError> {
    let bodies = bodies_of(folder, &recording.robot, &recording.path)?;
    let mut images = Vec::new();
    for (joint, prepared) in recording.robot.tree.joints.iter().zip(&recording.joints) {
        let name = &joint.name;
        let file = folder.join(name).join("friction.img");
        let image = read(&file)?;
        verify(&image, &file)?;
        let unit = prepared.description.columns.effort.unit.symbol();
        if unit != image.effort.symbol() {
            let reason = format!(
                "the image is in {}, the effort of joint {name} in {} in {unit}; record it in the image's unit",
                image.effort.symbol(),
                recording.path.display()
            );
            return Err(ImageFileError::Image { path: file, reason }.into());
        }
        images.push(image);
    }
    Ok((bodies, images))
}

/// Effort of the links and rotors for every joint and sample.
fn efforts(recording: &Recording, bodies: &[JointBodies]) -> Vec<Vec<f64>> {
    let rotors = bodies.iter().map(|joint| joint.rotor_inertia);
    let unknowns: Vec<f64> = bodies.iter().flat_map(|joint| joint.link).chain(rotors).collect();
    let unknowns = DVector::from_vec(unknowns);
    let all: Vec<DVector<f64>> = (0..recording.len())
        .into_par_iter()
        .map(|i| {
            let [q, v, a] = recording.state(i);
            rigid_columns(&recording.robot, &q, &v, &a) * &unknowns
        })
        .collect();
    (0..bodies.len()).map(|j| all.iter().map(|efforts| efforts[j]).collect()).collect()
}

/// Mean over the joints of the errors in %.
pub fn mean_percent(errors: &[JointErrors]) -> f64 {
    errors.iter().map(|joint| joint.relative_percent).sum::<f64>() / errors.len().max(1) as f64
}

/// The errors as a table.
pub fn table(errors: &[JointErrors]) -> String {
    let mut text =
        format!("{:<24}{:>10}{:>12}{:>12}{:>12}{:>9}\n", "joint", "samples", "effort", "bodies", "image", "%");
    for joint in errors {
        let _ = writeln!(
            text,
            "{:<24}{:>10}{:>12.4}{:>12.4}{:>12.4}{:>9.2}",
            format!("{}, {}", joint.joint, joint.unit),
            joint.samples,
            joint.effort,
            joint.bodies,
            joint.image,
            joint.relative_percent
        );
    }
    let _ = write!(text, "mean relative error {:.2} %", mean_percent(errors));
    text
}
