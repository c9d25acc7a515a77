//! Files of an identified robot: for each joint image and report, for the controller URDF, MJCF and parameters; host.

use super::evaluate;
use super::fit::FittedRobot;
use super::page::page;
use super::recording::Recording;
use identification::image_file::{ImageFileError, bytes};
use identification::image_text;
use identification::page::{ReportError, render};
use report::figures::FigureError;
use report::output::{OutputError, OutputFile, write_directory};
use rigid_body::RobotError;
use rigid_body::inertia::NAMES;
use rigid_body::mjcf::{JointFriction, mjcf};
use rigid_body::urdf::{LinkValues, with_values};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// Files of a fit, but for those of its joints.
pub const FILES: [&str; 5] = ["robot.html", "robot.urdf", "mujoco.xml", "parameters.toml", "robot.json"];

/// Reason for which the files of a robot were not written.
#[derive(Debug, thiserror::Error)]
pub enum RobotWriteError {
    /// The report of a joint.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The image of a joint.
    #[error(transparent)]
    Image(#[from] ImageFileError),
    /// A figure of the robot's page.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// The URDF does not take the values.
    #[error(transparent)]
    Urdf(Box<RobotError>),
    /// Writing of results.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// Writes everything into `out`, all or nothing.
///
/// # Errors
/// [`RobotWriteError`]; the folder is then as it was.
pub fn write(out: &Path, recording: &Recording, fitted: &FittedRobot) -> Result<(), RobotWriteError> {
    let mut files = Vec::new();
    for (joint, one) in recording.robot.tree.joints.iter().zip(&fitted.joints) {
        for file in render(&one.report)? {
            files.push(OutputFile::new(Path::new(&joint.name).join(&file.path), file.contents));
        }
        let folder = Path::new(&joint.name);
        files.push(OutputFile::new(folder.join("friction.img"), bytes(&one.image, out)?));
        files.push(OutputFile::new(folder.join("friction.toml"), image_text::to_text(&one.image)));
    }
    files.push(OutputFile::new("robot.html", page(recording, fitted)?));
    files.push(OutputFile::new("robot.urdf", urdf(recording, fitted)?));
    files.push(OutputFile::new("mujoco.xml", model(recording, fitted)));
    files.push(OutputFile::new("parameters.toml", parameters(recording, fitted)));
    files.push(OutputFile::new("robot.json", summary(recording, fitted).to_string()));
    Ok(write_directory(out, &files)?)
}

/// Viscous and Coulomb friction of the simplest model, on the joints' side: all that URDF and MJCF have.
fn friction(recording: &Recording, fitted: &FittedRobot) -> Vec<JointFriction> {
    let (solution, rows) = &fitted.bodies.simplest;
    let gains = recording.robot.gains();
    let joint = |j: usize| {
        let at = rows.layout.rigid() + rows.layout.width() * j;
        let of_joint = |effort: f64| (effort * gains[(j, j)]).max(0.0);
        JointFriction { damping: of_joint(solution.unknowns[at]), frictionloss: of_joint(solution.unknowns[at + 1]) }
    };
    (0..recording.robot.tree.len()).map(joint).collect()
}

/// The URDF with the identified inertias, and friction as `damping` and `friction`.
///
/// # Errors
/// [`RobotWriteError::Urdf`].
pub fn urdf(recording: &Recording, fitted: &FittedRobot) -> Result<String, RobotWriteError> {
    let robot = &recording.robot;
    let values = friction(recording, fitted).into_iter().enumerate().map(|(j, friction)| LinkValues {
        joint: robot.tree.joints[j].name.clone(),
        link: robot.links[j].clone(),
        inertia: fitted.links[j],
        damping: friction.damping,
        friction: friction.frictionloss,
    });
    with_values(&recording.urdf, "robot.urdf", &values.collect::<Vec<_>>())
        .map_err(|error| RobotWriteError::Urdf(Box::new(error)))
}

/// The robot for MuJoCo: identified inertias, rotors as `armature`, friction as `damping` and `frictionloss`; with what
/// is lost by it.
pub fn model(recording: &Recording, fitted: &FittedRobot) -> String {
    let robot = &recording.robot;
    let rotors = robot.rotor_matrix(&fitted.rotors);
    let mut tree = robot.tree.clone();
    for (j, joint) in tree.joints.iter_mut().enumerate() {
        (joint.link, joint.armature) = (fitted.links[j], rotors[(j, j)]);
    }
    let coupled = (0..tree.len()).any(|row| (0..row).any(|column| rotors[(row, column)] != 0.0));
    let [simplest, _, image] = fitted.mean_percent();
    let mut remark = format!(
        "Identified by jointctl {}. Viscous and Coulomb friction alone leave {simplest:.2} % of the effort on test samples (mean \
         over the joints), the images {image:.2} %:",
        env!("CARGO_PKG_VERSION")
    );
    for joint in &fitted.errors {
        let part = |error: f64| 100.0 * error / joint.effort;
        let _ = write!(remark, "\n{}: {:.2} and {:.2} %", joint.joint, part(joint.simplest), part(joint.image));
    }
    if coupled {
        remark += "\nMotors that move several joints couple these by their rotors' inertia; MJCF has no term for that.";
    }
    mjcf(&tree, &robot.links, &friction(recording, fitted), &robot.limits, &remark)
}

/// Parameters of the controller as TOML.
pub fn parameters(recording: &Recording, fitted: &FittedRobot) -> String {
    let mut text =
        "# Units: kg, kg m, kg m^2 about the frame of the joint; rotor inertia on the motor's side.\n".to_owned();
    for (j, joint) in recording.robot.tree.joints.iter().enumerate() {
        let _ = writeln!(text, "\n[link.{:?}]\njoint = {:?}", recording.robot.links[j], joint.name);
        for (name, value) in NAMES.iter().zip(fitted.links[j].parameters()) {
            let _ = writeln!(text, "{name} = {value:e}");
        }
        let _ = writeln!(text, "rotor_inertia = {:e}", fitted.rotors[j]);
    }
    text
}

/// The errors on test samples as a table.
pub fn table(fitted: &FittedRobot) -> String {
    let mut text = format!(
        "{:<24}{:>10}{:>12}{:>12}{:>12}{:>9}  model of the image\n",
        "joint", "effort", "simplest", "bodies", "image", "%"
    );
    for joint in &fitted.errors {
        let _ = writeln!(
            text,
            "{:<24}{:>10.4}{:>12.4}{:>12.4}{:>12.4}{:>9.2}  {}",
            format!("{}, {}", joint.joint, joint.unit),
            joint.effort,
            joint.simplest,
            joint.bodies,
            joint.image,
            100.0 * joint.image / joint.effort,
            joint.model
        );
    }
    let [simplest, bodies, image] = fitted.mean_percent();
    let _ = write!(text, "mean relative error: simplest {simplest:.2} %, bodies {bodies:.2} %, images {image:.2} %");
    text
}

/// Errors, parameters with standard errors and how they were chosen.
pub fn summary(recording: &Recording, fitted: &FittedRobot) -> Value {
    let bodies = &fitted.bodies;
    let [simplest, rigid_bodies, images] = fitted.mean_percent();
    json!({
        "errors": fitted.errors,
        "mean_relative_percent": { "simplest": simplest, "bodies": rigid_bodies, "images": images },
        "base_parameters": fitted.base_parameters(&recording.robot),
        "bodies": evaluate::bodies(recording, fitted),
        "condition": bodies.base.condition,
        "choice": bodies.notes,
    })
}
