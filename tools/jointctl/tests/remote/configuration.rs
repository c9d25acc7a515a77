//! Settings, stored and restored, node ids, and the page.

use crate::served::{NODE, Served};
use bus::Frame;
use bus::client::lss::request;
use bus::client::{Command, Network, cob_id};
use canopen_node::{Group, NO_NODE_ID};
use joint_firmware::joint::Mode;
use jointctl::remote::configuration::{restore, set, store};
use jointctl::remote::configured::{self, Configured};
use jointctl::remote::telemetry::USUAL;
use jointctl::remote::{Entry, RemoteError, RemoteJoint, Stream, Telemetry, address, info};
use std::time::Duration;
use time::UtcDateTime;

fn change(joint: &RemoteJoint, pairs: &[(&str, &str)]) -> Result<(), RemoteError> {
    let pairs = pairs.iter().map(|(name, text)| {
        let entry = Entry::one(name)?;
        Ok((entry, entry.parse(text)?))
    });
    set(joint, &pairs.collect::<Result<Vec<_>, RemoteError>>()?)
}

fn shown(joint: &RemoteJoint, name: &str) -> String {
    info::show_entry(joint, Entry::one(name).unwrap()).unwrap()
}

pub fn settings_are_taken_together_or_not_at_all() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let before = shown(&joint, "lowest-position");
    change(&joint, &[("lowest-position", "-1.5"), ("highest-position", "2.5"), ("compensation-gain", "0.5")])
        .unwrap_err();
    assert_eq!(shown(&joint, "lowest-position"), before, "a name that does not exist stops it all");
    change(&joint, &[("lowest-position", "-1.5"), ("highest-position", "2.5"), ("gain", "0.5")]).unwrap();
    assert_eq!((shown(&joint, "highest-position"), shown(&joint, "gain")), ("2.5 rad".into(), "0.5".into()));
    assert_eq!(shown(&joint, "configuration.changed"), "no");

    // Each within its range, together impossible: the joint says which and why.
    let message = change(&joint, &[("stiffness", "10"), ("lowest-position", "3")]).unwrap_err().to_string();
    assert!(message.contains("position") && message.contains("nothing was changed"), "{message}");
    assert_eq!(
        (shown(&joint, "lowest-position"), shown(&joint, "configuration.changed")),
        ("-1.5 rad".into(), "no".into())
    );
    let message = change(&joint, &[("torque-limit", "5000")]).unwrap_err().to_string();
    assert_eq!(message, "torque-limit (2103h:1): 5000 Nm is outside 0.01 to 2000 Nm");
    let message = change(&joint, &[("statusword", "1")]).unwrap_err().to_string();
    assert_eq!(message, "statusword (6041h:0): is read-only");

    let stream = Stream::begin(&joint, Mode::Torque, 100.0, false).unwrap();
    let message = change(&joint, &[("stiffness", "10")]).unwrap_err().to_string();
    assert!(message.contains("motor off only"), "{message}");
    // The compensation's settings act in motion, too.
    change(&joint, &[("gain", "0.25")]).unwrap();
    stream.end().unwrap();

    joint.node().download(0x2104, 3, &10f32.to_le_bytes()).unwrap();
    let message = change(&joint, &[("damping", "1")]).unwrap_err().to_string();
    assert!(message.contains("staged") && message.contains("configuration.command 2"), "{message}");
}

pub fn what_is_stored_outlasts_a_reset_and_what_is_restored_does_not() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let period = || shown(&joint, "producer-heartbeat-time");
    let reset = || joint.network().reset_and_wait(Command::ResetCommunication, NODE, Duration::from_secs(2)).unwrap();
    change(&joint, &[("producer-heartbeat-time", "0.25")]).unwrap();
    reset();
    assert_eq!(period(), "0.000 s");
    change(&joint, &[("producer-heartbeat-time", "0.25")]).unwrap();
    store(&joint, Group::Communication).unwrap();
    reset();
    assert_eq!(period(), "0.250 s");
    restore(&joint, Group::All).unwrap();
    reset();
    assert_eq!(period(), "0.000 s");
    // A joint with a heartbeat tells its state, and is believed rather than assumed to have acted.
    change(&joint, &[("producer-heartbeat-time", "0.05")]).unwrap();
    joint.disable().unwrap();
    let stream = Stream::begin(&joint, Mode::Torque, 100.0, false).unwrap();
    assert!(store(&joint, Group::All).unwrap_err().to_string().contains("storing is possible with the motor off only"));
    stream.end().unwrap();
}

pub fn what_is_in_use_is_told_to_be_what_was_stored_until_a_value_changes() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let told = || configured::read(&joint).unwrap();
    let left = || shown(&joint, "stores-left");
    let reset = || joint.network().reset_and_wait(Command::ResetNode, NODE, Duration::from_secs(60)).unwrap();
    let gain = |text: &str| change(&joint, &[("gain", text)]).unwrap();
    assert_eq!(told(), Configured::Differs);
    store(&joint, Group::Application).unwrap();
    assert_eq!(told(), Configured::Differs, "a part has no date");

    let before = UtcDateTime::now() - Duration::from_millis(1);
    store(&joint, Group::All).unwrap();
    let Configured::Since(date) = told() else { panic!("{}", told()) };
    assert!((before..=UtcDateTime::now()).contains(&date), "{date}");
    reset();
    assert_eq!(told(), Configured::Since(date));
    assert!(info::page(&joint).unwrap().contains("configuration   as stored 20"));
    // Nothing is new: nothing is written.
    let stores = left();
    store(&joint, Group::All).unwrap();
    assert_eq!((told(), left()), (Configured::Since(date), stores));

    // A client's own PDOs are put back, whatever else changes meanwhile.
    let watched = |change: bool| {
        let telemetry = Telemetry::begin(&joint, &USUAL[..3]).unwrap();
        assert_eq!(told(), Configured::Since(date));
        if change {
            gain("0.5");
        }
        telemetry.end().unwrap();
    };
    watched(false);
    Stream::begin(&joint, Mode::Velocity, 100.0, false).unwrap().end().unwrap();
    assert_eq!(told(), Configured::Since(date));
    watched(true);
    assert_eq!(told(), Configured::Differs);
    reset();
    assert_eq!(told(), Configured::Since(date));
    // What the joint refuses to store is not told to be stored.
    let refused = (0..100).find_map(|number| {
        gain(if number % 2 == 0 { "0.5" } else { "0.25" });
        store(&joint, Group::All).err()
    });
    assert!(refused.is_some() && left() == "0", "{refused:?}");
    assert_eq!(told(), Configured::Differs);
}

pub fn a_joint_whose_configuration_is_damaged_says_what_to_do_and_is_enabled_once_that_is_done() {
    let folder = tempfile::tempdir().unwrap();
    // A slot that was settled, with a header that fits nothing.
    let mut bytes = vec![0xFF; 4096];
    bytes[..8].copy_from_slice(&[9; 8]);
    bytes[8..24].copy_from_slice(b"\x5a\xc3confir\x5a\xc3confir");
    bytes[24..32].fill(0);
    std::fs::write(folder.path().join("configuration.bin"), bytes).unwrap();
    let served = Served::stored(folder.path());
    let joint = served.joint();
    let page = info::page(&joint).unwrap();
    assert!(page.contains("storage         damaged: the configuration, so it is not enabled"), "{page}");
    let message = Stream::begin(&joint, Mode::Torque, 100.0, false).unwrap_err().to_string();
    for expected in
        ["node 5 is not enabled", "damaged or refused", "jointctl info", "jointctl store", "jointctl restore"]
    {
        assert!(message.contains(expected), "{expected} in {message}");
    }
    store(&joint, Group::All).unwrap();
    assert!(info::page(&joint).unwrap().contains("storage         whole; 31 stores left"));
    Stream::begin(&joint, Mode::Torque, 100.0, false).unwrap().end().unwrap();
}

pub fn new_joints_get_the_node_ids_that_are_free() {
    let served = Served::joints(&[NODE, NO_NODE_ID, NO_NODE_ID]);
    // The joint that has an id is up before the others are asked: its boot-up message would be told as well.
    served.joint();
    let network = Network::new(bus::open(served.bus()).unwrap());
    let mut told = Vec::new();
    let mut tell = |done: &address::Addressed| told.push((done.node, done.address.serial));
    let count = address::assign(&network, NODE - 1, true, Duration::from_millis(150), &mut tell).unwrap();
    told.sort_unstable_by_key(|(_, serial)| *serial);
    assert_eq!((count, told.iter().map(|(_, serial)| *serial).collect::<Vec<_>>()), (2, vec![13, 14]));
    let mut ids = told.iter().map(|(node, _)| *node).collect::<Vec<_>>();
    ids.sort_unstable();
    assert_eq!(ids, [NODE - 1, NODE + 1]);
    for (node, serial) in told {
        let joint = RemoteJoint::on(&network, node).unwrap();
        assert_eq!(
            shown(&joint, "serial-number"),
            if serial > 9 { format!("{serial} ({serial:X}h)") } else { serial.to_string() }
        );
    }
    let again = |tell: &mut dyn FnMut(&address::Addressed)| {
        address::assign(&network, 1, true, Duration::from_millis(20), tell).unwrap()
    };
    assert_eq!(again(&mut |_| {}), 0);
    assert!(address::assign(&network, 0, true, Duration::from_millis(10), &mut |_| {}).is_err());
}

pub fn a_joint_that_was_left_with_an_id_that_it_does_not_use_yet_is_found_again() {
    let served = Served::joints(&[NO_NODE_ID]);
    let network = Network::new(bus::open(served.bus()).unwrap()).with_patience(Duration::from_secs(60));
    // State that a killed client leaves: found, given 9, and not released.
    let address = loop {
        if let Ok(Some(address)) = network.fastscan(Duration::from_millis(50)) {
            break address;
        }
    };
    let answers = network.subscribe(|frame| frame.id() == cob_id::LSS_SLAVE);
    network.send(&Frame::new(cob_id::LSS_MASTER, &request::configure_node_id(9)).unwrap()).unwrap();
    assert_eq!(answers.next(Duration::from_secs(60)).unwrap().unwrap().frame.data()[..2], [0x11, 0]);
    let mut told = Vec::new();
    // The machine may be busy: it has five seconds for the boot-up message, and is not asked for another joint
    // meanwhile.
    let mut tell = |done: &address::Addressed| told.push(*done);
    assert_eq!(address::assign(&network, 1, true, Duration::from_secs(1), &mut tell).unwrap(), 1);
    assert_eq!(told, [address::Addressed { node: 9, address }]);
    RemoteJoint::on(&network, 9).unwrap();
}

pub fn the_page_says_what_an_engineer_looks_for_first() {
    let served = Served::joints(&[NODE]);
    let page = info::page(&served.joint()).unwrap();
    for expected in [
        "node            5: virtual joint",
        "serial number 12",
        "state           disabled (switch on disabled)",
        "faults          none",
        "fault log       0 faults, 1 power-ups",
        "configuration   changed since it was stored, or never stored with a date",
        " V\n",
        "winding ",
        "image           none",
        "no key",
        "acting nothing: ",
        "command deadline 5 s",
        "gear ratio ",
    ] {
        assert!(page.contains(expected), "{expected} in\n{page}");
    }
    assert!(page.lines().count() < 30 && page.lines().all(|line| line.len() < 130), "{page}");
}
