//! The whole way from a recording of a robot to its rigid bodies and the image of every joint; host.

use super::choose::{Bodies, bodies};
use super::convex::links;
use super::joints::images;
use super::recording::{Recording, RobotFitError};
use identification::evaluate::rmse;
use identification::fit::{Fitted, Options as JointOptions};
use identification::page::Role;
use identification::progress::Progress;
use rigid_body::inertia::{NAMES, PARAMETERS};
use rigid_body::{LinkInertia, Robot};
use serde::Serialize;

/// Choices of a fit.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Choices for each joint.
    pub joint: JointOptions,
    /// Limit to the first seconds of the samples for training and validation; None: all.
    pub seconds: Option<f64>,
}

/// Errors of one joint on the test samples.
#[derive(Clone, Debug, Serialize)]
pub struct JointErrors {
    /// The joint.
    pub joint: String,
    /// Unit of the effort.
    pub unit: &'static str,
    /// RMS of the effort.
    pub effort: f64,
    /// RMS error of weighted least squares with viscous and Coulomb friction and an offset.
    pub simplest: f64,
    /// RMS error of the convex fit with its own friction.
    pub bodies: f64,
    /// RMS error of the image in fixed point, on the rigid bodies of the convex fit.
    pub image: f64,
    /// Friction model of the image.
    pub model: String,
}

/// A robot as it was identified.
#[derive(Debug)]
pub struct FittedRobot {
    /// Inertial parameters of each link.
    pub links: Vec<LinkInertia>,
    /// Inertia of each rotor, kg m^2 on the motor's side.
    pub rotors: Vec<f64>,
    /// Rigid bodies and how they were chosen.
    pub bodies: Bodies,
    /// Image and report of each joint.
    pub joints: Vec<Fitted>,
    /// Errors on the test samples.
    pub errors: Vec<JointErrors>,
}

/// A base parameter as least squares found it.
#[derive(Clone, Debug, Serialize)]
pub struct BaseParameter {
    /// The parameter that stands for the combination, with its link.
    #[serde(rename = "parameter")]
    pub name: String,
    /// SI units.
    pub value: f64,
    /// Infinite, in JSON null, where the motion leaves it open.
    pub standard_error: f64,
}

impl FittedRobot {
    /// All base parameters.
    pub fn base_parameters(&self, robot: &Robot) -> Vec<BaseParameter> {
        let (base, layout) = (&self.bodies.base, self.bodies.rows.layout);
        let name = |column: usize| match column.checked_sub(layout.inertial()) {
            Some(rotor) => format!("rotor of {}", robot.tree.joints[rotor].name),
            None => format!("{} of {}", NAMES[column % PARAMETERS], robot.links[column / PARAMETERS]),
        };
        let rigid = base.solved.iter().zip(&base.standard_errors).filter(|(column, _)| **column < layout.rigid());
        let parameter = |(&column, &standard_error): (&usize, &f64)| BaseParameter {
            name: name(column),
            value: base.unknowns[column],
            standard_error,
        };
        rigid.map(parameter).collect()
    }

    /// Means over the joints of the errors in % of the effort's RMS: simplest model, rigid bodies, images.
    pub fn mean_percent(&self) -> [f64; 3] {
        let mean = |error: fn(&JointErrors) -> f64| {
            let parts = self.errors.iter().map(|joint| 100.0 * error(joint) / joint.effort);
            parts.sum::<f64>() / self.errors.len().max(1) as f64
        };
        [mean(|joint| joint.simplest), mean(|joint| joint.bodies), mean(|joint| joint.image)]
    }
}

/// Identifies all joints of a robot.
///
/// # Errors
/// [`RobotFitError`].
pub fn fit(
    recording: &mut Recording,
    options: &Options,
    progress: &dyn Progress,
) -> Result<FittedRobot, RobotFitError> {
    if let Some(seconds) = options.seconds {
        recording.keep_first(seconds);
    }
    progress.stage("rigid bodies");
    let bodies = bodies(recording)?;
    let layout = bodies.rows.layout;
    let mut rotors: Vec<f64> = (0..layout.joints).map(|k| bodies.unknowns[layout.inertial() + k]).collect();
    for (rotor, drive) in rotors.iter_mut().zip(&recording.robot.drives) {
        *rotor = drive.rotor_inertia.unwrap_or(*rotor);
    }
    // With rotors that are known: their effort was taken off.
    let mut rigid = bodies.rows.rigid_efforts(&bodies.unknowns);
    for (j, rigid) in rigid.iter_mut().enumerate() {
        let measured = &recording.joints[j].samples.effort;
        rigid.iter_mut().enumerate().for_each(|(i, rigid)| *rigid += measured[i] - bodies.rows.effort[j][i]);
    }
    let joints = images(recording, rigid, &options.joint, progress)?;
    let errors = errors(recording, &bodies, &joints);
    Ok(FittedRobot { links: links(&bodies.unknowns, layout), rotors, bodies, joints, errors })
}

fn errors(recording: &Recording, bodies: &Bodies, joints: &[Fitted]) -> Vec<JointErrors> {
    let joint = |(j, fitted): (usize, &Fitted)| {
        let prepared = &recording.joints[j];
        let samples = &prepared.samples;
        let mut test: Vec<usize> = prepared.test_sets.iter().flat_map(|set| set.indices.iter().copied()).collect();
        test.sort_unstable();
        test.dedup();
        let over = |left: &dyn Fn(usize) -> f64| rmse(test.iter().map(|&i| left(i)));
        let image = fitted.predictions.iter().find(|prediction| prediction.role == Role::FixedPoint);
        let kept = fitted.report.candidates.iter().filter(|candidate| candidate.kept);
        JointErrors {
            joint: recording.robot.tree.joints[j].name.clone(),
            unit: prepared.description.columns.effort.unit.symbol(),
            effort: over(&|i| samples.effort[i]),
            simplest: over(&|i| bodies.simplest.1.residual(&bodies.simplest.0.unknowns, j, i)),
            bodies: over(&|i| bodies.rows.residual(&bodies.unknowns, j, i)),
            image: image.map_or(f64::NAN, |image| image.rmse(samples, &test)),
            model: kept.map(|candidate| candidate.model.clone()).max_by_key(String::len).unwrap_or_default(),
        }
    };
    joints.iter().enumerate().map(joint).collect()
}
