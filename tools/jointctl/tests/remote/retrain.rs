//! A recording as a data set, and the whole round on a joint: excite, record, fit, compare, commit.

use crate::punctual;
use crate::served::{NODE, Served, image, program};
use friction_compensation::parameters::life_cycle::State as Life;
use identification::fit::Options;
use identification::presets::Preset;
use identification::progress::Silent;
use joint_firmware::joint::state_machine::State;
use joint_firmware::joint::{Command, Mode};
use joint_firmware::objects::field::{Actual, Field};
use joint_firmware::objects::settings::Setting;
use jointctl::remote::configuration::set;
use jointctl::remote::image::Use;
use jointctl::remote::record::{Pace, Recorder, SIGNALS, description};
use jointctl::remote::retrain::{Outcome, RetrainError, Round};
use jointctl::remote::{Entry, RemoteError, RemoteJoint, Stream, Value};
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// The smallest round that still learns.
fn round(out: &Path) -> Round {
    let options = Options { presets: vec![Preset::CoulombViscous], trainer: None, ..Options::default() };
    let (rate, pace) = (200.0, Pace::Send(200.0));
    Round { excitation: 4.0, validation: 2.5, rate, pace, options, key: None, acknowledge: false, out: out.to_owned() }
}

/// A round on a joint with a friction and an inertia that are not its own, and what it was before.
fn round_of_a_wrong_joint(served: &Served, folder: &Path) -> (Result<Outcome, RetrainError>, RemoteJoint, u64) {
    let joint = served.joint();
    let request = joint.raw(Field::AtOnce(Setting::Request)).unwrap();
    joint.upload_image(&image(6, 0.05, 0), Use::Commit, &Silent).unwrap();
    // An inertia that is twice that of the joint, as with a torque constant that is half the true one.
    let inertia = Value::Real(2.0 * served.inertia());
    set(&joint, &[(Entry::of(Field::AtOnce(Setting::LoadInertia)), inertia)]).unwrap();
    (round(folder).run(&joint, &|| true, &|_| Ok(()), &Silent), joint, request)
}

pub fn a_round_lowers_what_is_unexplained_and_commits_a_newer_version() {
    let holds = |_: usize| -> Result<(), String> {
        let served = Served::joints(&[NODE]);
        let folder = tempfile::tempdir().unwrap();
        let (outcome, joint, requested) = round_of_a_wrong_joint(&served, folder.path());
        let outcome = outcome.map_err(|error| error.to_string())?;
        let inertia = served.inertia();
        let [load] = outcome.load.as_slice() else { return Err(format!("{:?}", outcome.load)) };
        assert_eq!((load.quantity, load.configured as f32), ("inertia", 2.0 * inertia as f32));
        let (before, after) = (outcome.before, outcome.after);
        if (load.measured / inertia - 1.0).abs() >= 0.15 || after.residual >= 0.7 * before.residual {
            return Err(format!("{load:?} of {inertia}; {before:?}, {after:?}"));
        }
        assert!(before.shadow > 0.0, "{before:?}");
        assert_eq!((outcome.status.state, outcome.status.active.unwrap().version), (Life::Active, 7));
        assert_eq!(outcome.status.previous.unwrap().version, 6);
        let request = joint.raw(Field::AtOnce(Setting::Request)).unwrap();
        assert_eq!((joint.state().unwrap(), request), (State::SwitchOnDisabled, requested));
        assert!(folder.path().join("log.csv").exists() && folder.path().join("dataset.toml").exists());
        Ok(())
    };
    punctual::round(holds, Result::is_err).unwrap();
}

pub fn an_interrupted_round_leaves_the_joint_disabled_with_the_image_that_it_had() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let stored = image(6, 0.05, 0);
    joint.upload_image(&stored, Use::Commit, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let looks = AtomicU32::new(0);
    let running = || looks.fetch_add(1, Ordering::Relaxed) < 100;
    let error = round(folder.path()).run(&joint, &running, &|_| Ok(()), &Silent).unwrap_err();
    assert!(matches!(error, RetrainError::Interrupted { node: NODE }), "{error}");
    assert_eq!((joint.state().unwrap(), joint.image_state().unwrap()), (State::SwitchOnDisabled, Life::Active));
    assert_eq!(joint.active_image().unwrap(), stored);
}

pub fn a_round_that_could_change_nothing_is_refused_before_the_joint_moves() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let folder = tempfile::tempdir().unwrap();
    for (setting, name) in [(Setting::CompensationGain, "gain (2200h:3)"), (Setting::Clamp, "clamp (2200h:4)")] {
        let entry = Entry::of(Field::AtOnce(setting));
        let before = joint.read(entry).unwrap();
        set(&joint, &[(entry, Value::Real(0.0))]).unwrap();
        let refused = round(folder.path()).run(&joint, &|| true, &|_| Ok(()), &Silent).unwrap_err();
        assert_eq!(
            refused.to_string(),
            format!("node {NODE}: {name} is 0, so no image compensates anything: set it above 0, and store it")
        );
        assert_eq!(joint.state().unwrap(), State::SwitchOnDisabled);
        set(&joint, &[(entry, Value::Real(0.001))]).unwrap();
        assert_eq!(round(folder.path()).check(&joint).unwrap(), 1);
        set(&joint, &[(entry, before)]).unwrap();
    }
}

pub fn a_recording_of_a_motion_is_a_data_set() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let mut recorder = Recorder::begin(&joint, &SIGNALS, Pace::Send(200.0)).unwrap();
    let stream = Stream::begin(&joint, Mode::Velocity, 100.0, false).unwrap();
    stream.play(|elapsed| {
        let velocity = (6.0 * elapsed.as_secs_f32()).sin();
        Command { mode: Mode::Velocity, velocity, ..Command::default() }
    });
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(3) {
        recorder.next(Duration::from_secs(1)).unwrap();
    }
    stream.end().unwrap();
    let recording = recorder.end().unwrap();
    let velocity = recording.column(Actual::Velocity).into_iter().fold(0.0, f64::max);
    assert!(recording.samples.len() > 300 && velocity > 0.5, "{} {velocity}", recording.samples.len());

    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("log.csv"), recording.table()).unwrap();
    let described = folder.path().join("dataset.toml");
    std::fs::write(&described, description(NODE, "log.csv")).unwrap();
    let prepared = identification::dataset::prepare(&described).unwrap();
    assert!(prepared.samples.len() > 300, "{}", prepared.samples.len());
}

pub fn two_producers_of_sync_are_told_of() {
    let served = Served::joints(&[NODE]);
    let (joint, other) = (served.joint(), served.joint());
    let mut recorder = Recorder::begin(&joint, &SIGNALS, Pace::Send(100.0)).unwrap();
    other.network().sync().unwrap();
    let error =
        std::iter::repeat_with(|| recorder.next(Duration::from_secs(1)).map(drop)).take(200).find_map(Result::err);
    assert!(matches!(error, Some(RemoteError::OtherSync { node: NODE })), "{error:?}");
}

/// The second round learns what the first one has brought into the joint already.
pub fn a_round_after_which_the_joint_keeps_its_image_prints_its_figures_and_ends_with_3() {
    let served = Served::joints_on_slcan();
    let folder = tempfile::tempdir().unwrap();
    let run = || {
        let line = format!("retrain --duration 4 --validation 2.5 --restarts 0 --json --force --bus {}", served.bus());
        let mut command = program();
        command.current_dir(&folder).args(line.split(' ')).args(["--node", "5"]);
        let output = command.output().unwrap();
        let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
            panic!("{error}: {:?} {}", output.status, String::from_utf8_lossy(&output.stderr));
        });
        let kept = value["kept"].as_bool().unwrap();
        assert_eq!(output.status.code(), Some(if kept { 0 } else { 3 }), "{value}");
        assert!(value["before"]["residual"].is_number() && value["after"]["tracking"].is_number(), "{value}");
        (kept, value["version"].clone())
    };
    // What one of them brings is at least 2 % better: some rounds on, nothing is.
    let mut version = serde_json::Value::Null;
    for _ in 0..8 {
        let (kept, now) = run();
        if !kept {
            assert_eq!(now, version, "the version that the joint keeps");
            return;
        }
        version = now;
    }
    panic!("version {version} is still not good enough");
}
