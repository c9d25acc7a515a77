//! Images of the friction model and compensation, as a page shows them; host.

use crate::message::{Usage, Wanted};
use friction_compensation::parameters::authentication::Key;
use identification::fit::Options;
use identification::page::verdict;
use identification::progress::Silent;
use joint_firmware::objects::field::{Actual, Field};
use joint_firmware::objects::settings::Setting;
use jointctl::remote::image::{ImageStatus, StoredImage, Use};
use jointctl::remote::info::{life, show};
use jointctl::remote::record::Pace;
use jointctl::remote::retrain::{Outcome, Round, Shown};
use jointctl::remote::{RemoteError, RemoteJoint, words};
use serde_json::{Value, json};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

/// Set-points a second while a round moves the joint, as `jointctl retrain` has them.
const RATE: f64 = 250.0;
/// Shortest and longest of a round's motions, s.
const DURATIONS: [f64; 2] = [2.0, 120.0];
/// Most networks from different first weights.
const RESTARTS: usize = 16;

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
        "acting": words::model(joint.raw(Field::Actual(Actual::ActingModel))?),
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

/// A round as a page wants it; the recording goes into `folder`.
///
/// # Errors
/// A choice outside its range, by name.
pub fn round(wanted: &Wanted, key: Option<Key>, folder: &Path) -> Result<Round, String> {
    let Wanted { excitation, validation, restarts, acknowledge } = *wanted;
    let [low, high] = DURATIONS;
    for (name, value) in [("recorded motions", excitation), ("judged motion", validation)] {
        if !(low..=high).contains(&value) {
            return Err(format!("{name}: {value} s is outside {low} to {high} s"));
        }
    }
    if restarts > RESTARTS {
        return Err(format!("networks: {restarts} is outside 0 to {RESTARTS}"));
    }
    let options = Options {
        trainer: Options::default().trainer.filter(|_| restarts > 0),
        restarts: restarts.max(1),
        reference: false,
        // A clock before 1970 is no clock.
        created: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs()),
        ..Options::default()
    };
    let (rate, pace, out) = (RATE, Pace::Sent, folder.to_owned());
    Ok(Round { excitation, validation, rate, pace, options, key, acknowledge, out })
}

/// A round's outcome: what is unexplained and how far the joint was from its reference, before and with the new image.
pub fn outcome(outcome: &Outcome) -> Value {
    let judged = |on: &Shown| json!({ "residual": on.residual, "tracking": on.tracking });
    json!({
        "version": outcome.status.active.map(|image| image.version),
        "before": judged(&outcome.before),
        "after": judged(&outcome.after),
        "shadow": outcome.before.shadow,
        "load": outcome.load.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "verdict": verdict(&outcome.fitted.report).sentence,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_of_a_round_end_where_they_say() {
        let wanted = |excitation, validation, restarts| Wanted { excitation, validation, restarts, acknowledge: false };
        let round = |wanted: Wanted| round(&wanted, None, Path::new("out"));
        assert!(round(wanted(2.0, 120.0, 16)).is_ok() && round(wanted(120.0, 2.0, 0)).is_ok());
        for (wanted, expected) in [
            (wanted(1.99, 6.0, 4), "recorded motions: 1.99 s is outside 2 to 120 s"),
            (wanted(120.1, 6.0, 4), "recorded motions: 120.1 s is outside 2 to 120 s"),
            (wanted(10.0, f64::NAN, 4), "judged motion: NaN s is outside 2 to 120 s"),
            (wanted(10.0, 6.0, 17), "networks: 17 is outside 0 to 16"),
        ] {
            assert_eq!(round(wanted).unwrap_err(), expected);
        }
        assert!(round(wanted(10.0, 6.0, 0)).unwrap().options.trainer.is_none());
    }
}
