//! Images of the friction model and compensation, as a page shows them; host.

use crate::message::Usage;
use identification::progress::Silent;
use joint_firmware::objects::field::{Actual, Field};
use joint_firmware::objects::settings::Setting;
use jointctl::remote::image::{ImageStatus, StoredImage, Use};
use jointctl::remote::info::{life, show};
use jointctl::remote::{RemoteError, RemoteJoint};
use serde_json::{Value, json};

fn usage(usage: Usage) -> Use {
    match usage {
        Usage::Verify => Use::Verify,
        Usage::Shadow(seconds) => Use::Shadow(seconds),
        Usage::Trial(seconds) => Use::Trial(seconds),
        Usage::Commit => Use::Commit,
    }
}

fn stored(image: Option<StoredImage>) -> Value {
    image.map_or(Value::Null, |StoredImage { version, checksum, network, slot, created }| {
        json!({
            "version": version,
            "checksum": format!("{checksum:08X}h"),
            "model": if network { "physical and network" } else { "physical" },
            "slot": slot,
            "created": created,
        })
    })
}

fn told(joint: &RemoteJoint, status: &ImageStatus) -> Result<Value, RemoteError> {
    Ok(json!({
        "life": life(status.state, status.left),
        "active": stored(status.active),
        "previous": stored(status.previous),
        "requested": joint.raw(Field::AtOnce(Setting::Request))?,
        "acting": show(joint, Field::Actual(Actual::ActingModel))?,
        "shadow": show(joint, Field::Actual(Actual::ShadowRms))?,
    }))
}

/// State of the images.
///
/// # Errors
/// The bus, or no answer.
pub fn images(joint: &RemoteJoint) -> Result<Value, RemoteError> {
    told(joint, &joint.image_status()?)
}

/// Brings an image into the joint, as far as is asked for.
///
/// # Errors
/// The joint's refusal with its reason.
pub fn upload(joint: &RemoteJoint, image: &[u8], wanted: Usage) -> Result<Value, RemoteError> {
    told(joint, &joint.upload_image(image, usage(wanted), &Silent)?)
}

/// Takes the image that was uploaded a step further.
///
/// # Errors
/// The joint's refusal with its reason.
pub fn go_on(joint: &RemoteJoint, image: &[u8], wanted: Usage) -> Result<Value, RemoteError> {
    told(joint, &joint.use_image(image, usage(wanted), &Silent)?)
}

/// The image before.
///
/// # Errors
/// The joint's refusal with its reason.
pub fn roll_back(joint: &RemoteJoint) -> Result<Value, RemoteError> {
    told(joint, &joint.roll_back_image()?)
}

/// Ends a trial or shadow and forgets what is staged.
///
/// # Errors
/// The joint's refusal with its reason.
pub fn discard(joint: &RemoteJoint) -> Result<Value, RemoteError> {
    told(joint, &joint.discard_image()?)
}
