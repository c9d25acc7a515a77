//! Friction image of each joint: what the rigid bodies leave goes through the pipeline of one joint; host.
//!
//! The effort of the rigid bodies is the given rigid part of that pipeline, and its theoretical torque. It gets a
//! factor where that pays: it takes up what the gain of a drive is wrong by. An inertia of the joint's own is free.

use super::recording::{Recording, RobotFitError};
use identification::fit::{Fitted, Options, fit};
use identification::progress::Progress;

/// The joints' images. `rigid` is the effort of the rigid bodies for every joint and sample.
///
/// # Errors
/// The first joint that is not identified.
pub fn images(
    recording: &mut Recording,
    rigid: Vec<Vec<f64>>,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Vec<Fitted>, RobotFitError> {
    let mut images = Vec::new();
    for (j, rigid) in rigid.into_iter().enumerate() {
        let joint = recording.robot.tree.joints[j].name.clone();
        progress.stage(&joint);
        let parts: Vec<_> = (0..recording.len()).map(|i| recording.part(i)).collect();
        let prepared = &mut recording.joints[j];
        prepared.samples.part = parts;
        prepared.samples.extra.insert("rigid".to_owned(), rigid);
        prepared.description.rigid.given = true;
        prepared.description.rigid.gravity = identification::dataset::Gravity::None;
        let path = recording.path.clone();
        let fitted = fit(prepared, options, progress).map_err(|source| RobotFitError::Fit { path, joint, source })?;
        images.push(fitted);
    }
    Ok(images)
}
