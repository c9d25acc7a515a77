//! A joint measures its motor.

use crate::served::{NODE, Served};
use bus::client::{ClientError, Command, Target};
use jointctl::remote::calibration::calibrate;
use jointctl::remote::configuration::set;
use jointctl::remote::info::show_entry;
use jointctl::remote::{Entry, RemoteError, RemoteJoint};
use plant::ActuatorParameters;

/// What a calibration finds, made wrong.
fn forget(joint: &RemoteJoint) {
    let wrong = [("resistance", "1.0"), ("pole-pairs", "3"), ("electrical-zero", "0.1")];
    let pairs = wrong.map(|(name, text)| {
        let entry = Entry::one(name).unwrap();
        (entry, entry.parse(text).unwrap())
    });
    set(joint, &pairs).unwrap();
}

pub fn a_joint_finds_the_motor_that_it_has() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    forget(&joint);
    let mut stages = Vec::new();
    let found = calibrate(&joint, 8.0, &|| true, &mut |stage| stages.push(stage.to_owned())).unwrap();
    let parameters = ActuatorParameters::reference().aligned();
    assert_eq!(found.pole_pairs as usize, parameters.windings.pole_pairs);
    let resistance = parameters.joint.motor.resistance / 1.5 + parameters.inverter.on_resistance;
    assert!((found.resistance / resistance - 1.0).abs() < 0.1, "{} of {resistance} Ohm", found.resistance);
    assert!(stages.first().is_some_and(|stage| stage == "current offsets"), "{stages:?}");
    assert!(stages.contains(&"alignment".into()) && stages.last().is_some_and(|stage| stage == "done"), "{stages:?}");
}

pub fn a_calibration_ends_with_its_client_and_with_the_network_and_changes_nothing_then() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    forget(&joint);
    let message = calibrate(&joint, 1000.0, &|| true, &mut |_| {}).unwrap_err().to_string();
    assert!(message.contains("calibration current") && message.contains("1000"), "{message}");
    let message = calibrate(&joint, 8.0, &|| false, &mut |_| {}).unwrap_err().to_string();
    assert!(message.contains("interrupted") && message.contains("nothing was changed"), "{message}");

    let other = served.joint();
    let mut asked = 0;
    let stopped = calibrate(&joint, 8.0, &|| true, &mut |_| {
        asked += 1;
        if asked == 2 {
            other.network().command(Command::Stop, Target::Node(NODE)).unwrap();
        }
    });
    // A stopped node answers no client.
    assert!(matches!(stopped, Err(RemoteError::Client(_) | RemoteError::Silent(_))), "{stopped:?}");
    other.network().command(Command::EnterPreOperational, Target::Node(NODE)).unwrap();
    // What was still on its way to the client that gave up is another client's to this one: it asks again.
    let told = |shown: &Result<_, _>| matches!(shown, Err(RemoteError::Client(ClientError::OtherClient { .. })));
    let show = |name: &str| {
        let ask = || show_entry(&other, Entry::one(name).unwrap());
        (0..20).map(|_| ask()).find(|shown| !told(shown)).unwrap_or_else(ask).unwrap()
    };
    // The joint may still be on its way out of the calibration.
    let failure = (0..100).map(|_| show("calibration-failure")).find(|failure| failure != "0");
    assert_eq!((show("pole-pairs").as_str(), failure.as_deref()), ("3", Some("1")));
}
