//! A joint that belongs to somebody, through the library and the program: what only its owner may do, and how he says
//! that he is.

use crate::served::{NODE, Served, image, program};
use bus::client::{Abort, ClientError, Command as Nmt, Target};
use canopen_node::Group;
use friction_compensation::parameters::authentication::Key;
use identification::progress::Silent;
use joint_firmware::objects::field::{Field, OwnerField, SetPoint};
use joint_firmware::objects::settings::Setting;
use jointctl::remote::entry::Entry;
use jointctl::remote::image::Use;
use jointctl::remote::value::Value;
use jointctl::remote::{RemoteError, RemoteJoint, configuration};
use std::process::Output;

fn key(first: u8) -> Key {
    Key::new(std::array::from_fn(|i| first + i as u8)).unwrap()
}

fn owned() -> (Served, RemoteJoint) {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    joint.give_key(&key(1)).unwrap();
    (served, joint)
}

/// A torque limit, taken as `jointctl set` takes it.
fn limit(joint: &RemoteJoint, torque: f64) -> Result<(), RemoteError> {
    configuration::set(joint, &[(Entry::of(Field::Setting(Setting::TorqueLimit)), Value::Real(torque))])
}

fn session(joint: &RemoteJoint) -> u64 {
    joint.raw(Field::Owner(OwnerField::Session)).unwrap()
}

pub fn what_the_owner_may_do_takes_a_session_that_ends_with_his_work() {
    let (served, stranger) = owned();
    let before = stranger.number(Field::Setting(Setting::TorqueLimit)).unwrap();
    let number = format!("only the owner of key {:08x} may do that", key(1).id());
    for result in [
        limit(&stranger, before - 1.0),
        limit(&served.joint().owned_by(key(2)), before - 1.0),
        configuration::store(&stranger, Group::All),
        configuration::restore(&stranger, Group::All),
        stranger.roll_back_image().map(drop),
    ] {
        let message = result.unwrap_err().to_string();
        assert!(message.contains(&number) && message.starts_with("node 5"), "{message}");
    }
    assert_eq!(stranger.number(Field::Setting(Setting::TorqueLimit)).unwrap(), before);
    assert_eq!(session(&stranger), 0);

    let owner = served.joint().owned_by(key(1));
    limit(&owner, before - 1.0).unwrap();
    configuration::store(&owner, Group::All).unwrap();
    assert!(session(&stranger) > 0);
    drop(owner);
    assert_eq!(session(&stranger), 0, "the session outlives its owner's work");
    assert_eq!(stranger.number(Field::Setting(Setting::TorqueLimit)).unwrap(), before - 1.0);
    // Uploads that need no owner are refused for other reasons, and say so.
    let message = stranger.upload_image(&image(1, 0.25, 0), Use::Verify, &Silent).unwrap_err().to_string();
    assert!(message.contains("0301h"), "{message}");
    let mode = Entry::of(Field::SetPoint(SetPoint::Mode));
    stranger.write(mode, &Value::Integer(8)).unwrap();
}

pub fn a_key_is_replaced_and_taken_back_by_who_has_it() {
    let (served, stranger) = owned();
    for refused in
        [stranger.rotate_key(&key(2), &key(3)), stranger.forget_key(Some(&key(2))), stranger.give_key(&key(2))]
    {
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(&format!("it has key {:08x}", key(1).id())), "{message}");
    }
    stranger.rotate_key(&key(1), &key(2)).unwrap();
    assert_eq!(stranger.raw(Field::Owner(OwnerField::KeyNumber)).unwrap(), u64::from(key(2).id()));
    stranger.forget_key(Some(&key(2))).unwrap();
    limit(&served.joint(), 60.0).unwrap();
    // A master that has run the joint: nobody is there any more.
    stranger.network().command(Nmt::Start, Target::Node(NODE)).unwrap();
    let mut tries = 0;
    while stranger.raw(Field::Owner(OwnerField::Presence)).unwrap() != 0 {
        tries += 1;
        assert!(tries < 1_000, "the joint does not start");
    }
    let message = stranger.give_key(&key(1)).unwrap_err().to_string();
    assert!(message.contains("nobody is at it") && message.contains("within a minute"), "{message}");
    let forced = stranger.node().download(0x2215, 6, &key(1).to_bytes()).unwrap_err();
    assert!(matches!(forced, ClientError::Aborted { abort: Abort::LOCAL_CONTROL, .. }), "{forced}");
}

pub fn the_program_takes_the_key_as_an_option_or_from_the_environment() {
    let port = bus::free_port().unwrap();
    let _served = Served::on(&format!("slcan:listen://127.0.0.1:{port}"), &[NODE]);
    let bus = format!("slcan:tcp://127.0.0.1:{port}");
    let folder = tempfile::tempdir().unwrap();
    let run = |line: &str, environment: Option<&str>| -> Output {
        let mut command = program();
        command.current_dir(&folder).args(line.split_whitespace());
        if !line.starts_with("key new") {
            command.args(["--bus", &bus, "--node", "5"]);
        }
        if let Some(file) = environment {
            command.env("JOINTCTL_KEY", file);
        }
        command.output().unwrap()
    };
    let told = |output: &Output| [&output.stdout[..], &output.stderr].map(String::from_utf8_lossy).concat();
    let done = |line: &str, environment| {
        let output = run(line, environment);
        assert!(output.status.success(), "{line}: {}", told(&output));
    };
    let fails = |line: &str, environment, expected: &str| {
        let output = run(line, environment);
        assert_eq!(output.status.code(), Some(1), "{line}: {}", told(&output));
        assert!(told(&output).contains(expected), "{line}: {}", told(&output));
    };
    done("key new a.key", None);
    done("key new b.key", None);
    done("key give a.key", None);
    fails("set torque-limit 60", None, "--key FILE, or JOINTCTL_KEY, opens a session");
    fails("set torque-limit 60 --key b.key", None, "the file has key");
    done("set torque-limit 60 --key a.key", None);
    done("set torque-limit 61", Some("a.key"));
    done("store", Some("a.key"));
    done("key rotate b.key --key a.key", None);
    fails("store", Some("a.key"), "only the owner of key");
    done("store --key b.key", None);
    done("key forget --key b.key", None);
    done("set torque-limit 60", None);
}
