//! An image's way into a joint and back.

use crate::served::{NODE, Served, image};
use friction_compensation::parameters::life_cycle::State;
use identification::progress::{Progress, Silent};
use joint_firmware::joint::state_machine::State as Drive;
use joint_firmware::joint::{Command, Mode};
use jointctl::remote::Stream;
use jointctl::remote::image::Use;
use std::sync::Mutex;

/// Remembers the stages.
#[derive(Default)]
struct Stages(Mutex<Vec<String>>);

impl Progress for Stages {
    fn stage(&self, name: &str) {
        self.0.lock().unwrap().push(name.to_owned());
    }

    fn detail(&self, _: &str) {}
}

impl Stages {
    fn take(&self) -> Vec<String> {
        std::mem::take(&mut *self.0.lock().unwrap())
    }
}

pub fn an_image_is_verified_shadowed_tried_committed_and_rolled_back() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let (first, second) = (image(1, 0.25, 0), image(2, 0.5, 12));
    let stages = Stages::default();
    let status = joint.upload_image(&first, Use::Commit, &stages).unwrap();
    let upload = format!("upload {} bytes", first.len());
    assert_eq!(stages.take(), [upload.as_str(), "verify", "store", "read back"]);
    assert_eq!((status.state, status.active.unwrap().version, status.previous), (State::Active, 1, None));
    assert_eq!(joint.active_image().unwrap(), first);

    // In motion, from shadow to trial without sending it again.
    let stream = Stream::begin(&joint, Mode::Velocity, 100.0, false).unwrap();
    stream.set(Command { mode: Mode::Velocity, velocity: 0.2, ..Command::default() });
    assert_eq!(joint.upload_image(&second, Use::Verify, &Silent).unwrap().state, State::Verified);
    let status = joint.use_image(&second, Use::Shadow(60.0), &stages).unwrap();
    assert_eq!(stages.take(), ["shadow"]);
    assert!(status.state == State::Shadow && status.left > 50.0, "{status:?}");
    let status = joint.use_image(&second, Use::Trial(60.0), &Silent).unwrap();
    assert!(status.state == State::Trial && status.active.unwrap().version == 1, "{status:?}");
    let message = joint.use_image(&second, Use::Commit, &Silent).unwrap_err().to_string();
    assert!(message.contains("with the motor off only") && message.contains("operation enabled"), "{message}");
    let message = joint.upload_image(&image(3, 0.1, 0), Use::Verify, &Silent).unwrap_err().to_string();
    assert!(
        message.contains("an upload is not possible while an image is on trial") && message.contains("Version 1 stays"),
        "{message}"
    );
    assert_eq!(joint.state().unwrap(), Drive::OperationEnabled);
    stream.end().unwrap();

    let status = joint.use_image(&second, Use::Commit, &Silent).unwrap();
    assert_eq!((status.active.unwrap().version, status.previous.unwrap().version), (2, 1));
    let status = joint.roll_back_image().unwrap();
    assert_eq!((status.active.unwrap().version, joint.active_image().unwrap()), (1, first));
    assert_eq!(joint.upload_image(&second, Use::Verify, &Silent).unwrap().state, State::Verified);
    assert_eq!(joint.discard_image().unwrap().state, State::Active);
}

pub fn a_roll_back_without_an_image_before_and_a_trial_of_no_time_are_refused() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let message = joint.roll_back_image().unwrap_err().to_string();
    assert!(message.contains("0905h") && message.contains("without an image"), "{message}");
    for seconds in [0.0, -1.0, 4e3, f64::NAN] {
        let message = joint.upload_image(&image(1, 0.1, 0), Use::Trial(seconds), &Silent).unwrap_err().to_string();
        assert!(message.contains("trial-time (2212h:7)"), "{message}");
    }
    assert_eq!(joint.image_state().unwrap(), State::Empty);
}
