//! Bad input: each kind ends in one line that names what and where, and leaves the joint as it was.

use crate::served::{NODE, Served, image};
use bus::client::{ClientError, Network};
use bus::{BusError, Frame, Transport};
use friction_compensation::parameters::authentication::Key;
use friction_compensation::parameters::life_cycle::State;
use identification::progress::Silent;
use joint_firmware::joint::Mode;
use joint_firmware::joint::state_machine::State as Drive;
use jointctl::remote::image::Use;
use jointctl::remote::{RemoteError, RemoteJoint, Stream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// A joint that has version 3 in use, and what it must still have afterwards.
struct InService {
    served: Served,
    joint: RemoteJoint,
    stored: Vec<u8>,
}

impl InService {
    fn new() -> Self {
        let served = Served::joints(&[NODE]);
        let joint = served.joint();
        let stored = image(3, 0.25, 0);
        joint.upload_image(&stored, Use::Commit, &Silent).unwrap();
        Self { served, joint, stored }
    }

    fn unchanged(&self) {
        let joint = self.served.joint();
        let status = joint.image_status().unwrap();
        assert_eq!((status.active.unwrap().version, status.previous), (3, None));
        assert_eq!(joint.active_image().unwrap(), self.stored);
        assert_eq!(joint.state().unwrap(), Drive::SwitchOnDisabled);
    }

    fn refused(&self, upload: &[u8], expected: &[&str]) {
        for usage in [Use::Verify, Use::Shadow(1.0), Use::Trial(1.0), Use::Commit] {
            let message = self.joint.upload_image(upload, usage, &Silent).unwrap_err().to_string();
            assert!(!message.contains('\n') && message.starts_with("node 5"), "{message}");
            for expected in expected {
                assert!(message.contains(expected), "{expected} in {message}");
            }
        }
        self.unchanged();
    }
}

pub fn a_wrong_node_id_is_told_from_a_bus_where_nobody_is() {
    let served = Served::joints(&[NODE]);
    for id in [0, 128, 255] {
        let message = RemoteJoint::open(served.bus(), id).unwrap_err().to_string();
        assert_eq!(message, format!("{id} is no node id: they are 1 to 127"));
    }
    // A neighbour is heard.
    let network = Network::new(bus::open(served.bus()).unwrap());
    RemoteJoint::on(&network, NODE).unwrap();
    let message = RemoteJoint::on(&network, NODE + 1).unwrap_err().to_string();
    assert!(
        message.contains("of node 6: no answer within 1000 ms") && message.contains("(5): is the node id right?"),
        "{message}"
    );
}

pub fn no_answer_says_for_how_long_and_what_to_look_at() {
    let began = Instant::now();
    let message = RemoteJoint::open("virtual:nobody-is-here", NODE).unwrap_err().to_string();
    assert!(message.contains("1000h:0 of node 5: no answer within 1000 ms. Nothing at all was heard"), "{message}");
    assert!(began.elapsed() >= Duration::from_secs(1));
}

pub fn a_node_that_is_no_joint_is_left_alone() {
    use bus::client::Object;
    // Answers every SDO read with the device type of an I/O module, CiA 401.
    let (host, other) = (bus::open("virtual:not-a-joint").unwrap(), bus::open("virtual:not-a-joint").unwrap());
    let answering = std::thread::spawn(move || {
        let request = other.receive(Duration::from_secs(5)).unwrap().unwrap();
        let object = Object { node: NODE, index: 0x1000, sub_index: 0 };
        assert_eq!(request.data().get(..4), Some(&[0x40, 0x00, 0x10, object.sub_index][..]));
        other.send(&Frame::new(0x580 + u16::from(NODE), &[0x43, 0x00, 0x10, 0, 0x91, 1, 0, 0]).unwrap()).unwrap();
    });
    let message = RemoteJoint::on(&Network::new(host), NODE).unwrap_err().to_string();
    assert_eq!(message, "node 5 is no joint: its device type (1000h) is 00000191h, a joint's is 00020192h");
    answering.join().unwrap();
}

pub fn a_damaged_image_is_refused_and_the_one_in_use_stays() {
    let joint = InService::new();
    let mut damaged = image(4, 0.5, 0);
    damaged[60] ^= 4;
    joint.refused(&damaged, &["does not accept the image", "checksum", "refusal 0205h", "Version 3 stays in use"]);
    joint.refused(b"this is a letter, not an image of parameters; it has more bytes than a header", &["0203h"]);
    joint.refused(&image(4, 0.5, 0)[..100], &["02", "stays in use"]);
    joint.refused(&[0; 3_000], &["has 3000 bytes, must be 1 to 2048"]);
    joint.refused(&[], &["has 0 bytes"]);
}

pub fn an_image_for_another_joint_or_of_the_past_is_refused_with_both_numbers() {
    let joint = InService::new();
    joint.refused(&image(4, 0.5, 99), &["image for serial number 99, this joint has 12", "0502h"]);
    // Of the past is what the key of an owner has let in; a joint of nobody's takes any version, or one image of
    // the highest would be its last.
    let joint = InService::new();
    joint.joint.upload_image(&image(u32::MAX, 0.5, 0), Use::Commit, &Silent).unwrap();
    let status = joint.joint.upload_image(&image(3, 0.5, 0), Use::Commit, &Silent).unwrap();
    assert_eq!(status.active.unwrap().version, 3);
    let key = Key::new(std::array::from_fn(|i| i as u8)).unwrap();
    joint.joint.give_key(&key).unwrap();
    let signed = |version, torque| {
        let plain = image(version, torque, 0);
        [&plain[..], &key.sign(&plain)[..]].concat()
    };
    let commit = |upload: &[u8], joint: &RemoteJoint| {
        joint.upload_image(upload, Use::Commit, &Silent).map(|status| status.active.unwrap().version)
    };
    assert_eq!(commit(&signed(4, 0.5), &joint.joint).unwrap(), 4);
    let message = joint.joint.upload_image(&signed(3, 0.5), Use::Verify, &Silent).unwrap_err().to_string();
    assert!(message.contains("image version 3, must be at least 4") && message.contains("0401h"), "{message}");
    // The one in use again is nothing new; another one of its version, or what was rolled back from, is the
    // owner's.
    assert_eq!(commit(&signed(4, 0.5), &joint.joint).unwrap(), 4);
    let message = commit(&signed(4, 0.25), &joint.joint).unwrap_err().to_string();
    assert!(message.contains("only the owner of key") && message.contains("not newer than version 4"), "{message}");
    assert!(message.contains("--key FILE, or JOINTCTL_KEY"), "{message}");
    let owner = joint.joint.clone().owned_by(key.clone());
    assert_eq!(commit(&signed(4, 0.25), &owner).unwrap(), 4);
}

pub fn a_wrong_key_is_refused_and_counted_and_keeps_no_right_one_out() {
    let joint = InService::new();
    let key = Key::new(std::array::from_fn(|i| i as u8)).unwrap();
    let other = Key::new(std::array::from_fn(|i| 31 - i as u8)).unwrap();
    joint.joint.give_key(&key).unwrap();
    let message = joint.joint.give_key(&other).unwrap_err().to_string();
    assert!(message.contains(&format!("it has key {:08x} already", key.id())), "{message}");

    let plain = image(4, 0.5, 0);
    joint.refused(&plain, &["the joint has a key, but no tag", "0301h"]);
    let signed = |key: &Key| [&plain[..], &key.sign(&plain)[..]].concat();
    let mut messages = Vec::new();
    for _ in 0..6 {
        messages.push(joint.joint.upload_image(&signed(&other), Use::Commit, &Silent).unwrap_err().to_string());
    }
    assert!(messages[0].contains("the tag is not that of this image and key (1 wrong ones so far)"), "{}", messages[0]);
    assert!(messages[5].contains("(6 wrong ones so far)"), "{}", messages[5]);
    joint.unchanged();
    let status = joint.joint.upload_image(&signed(&key), Use::Commit, &Silent).unwrap();
    assert_eq!(status.active.unwrap().version, 4);
}

pub fn a_signed_image_of_the_right_key_is_taken() {
    let joint = InService::new();
    let key = Key::new(std::array::from_fn(|i| i as u8)).unwrap();
    joint.joint.give_key(&key).unwrap();
    let plain = image(4, 0.5, 0);
    let signed = [&plain[..], &key.sign(&plain)[..]].concat();
    let status = joint.joint.upload_image(&signed, Use::Commit, &Silent).unwrap();
    assert_eq!(status.active.unwrap().version, 4);
    // The same again is the same version: taken.
    assert_eq!(joint.joint.upload_image(&signed, Use::Verify, &Silent).unwrap().state, State::Verified);
}

/// An adapter that is pulled out after some frames.
#[derive(Debug)]
struct Unplugged {
    bus: Arc<dyn Transport>,
    left: AtomicU32,
}

impl Unplugged {
    fn gone(&self) -> BusError {
        BusError::Gone {
            bus: self.bus.name().into(),
            problem: "the adapter was pulled out".into(),
            advice: "Plug it in",
        }
    }
}

impl Transport for Unplugged {
    fn name(&self) -> &str {
        self.bus.name()
    }

    fn send(&self, frame: &Frame) -> Result<(), BusError> {
        let left = self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1));
        left.map_err(|_| self.gone())?;
        self.bus.send(frame)
    }

    fn receive(&self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        if self.left.load(Ordering::Relaxed) == 0 { Err(self.gone()) } else { self.bus.receive(timeout) }
    }
}

/// Frames after which the bus is unplugged, at most: more than an upload and commit have.
const FRAMES: u32 = 100;
/// Joints that share these numbers, because each waits for its joint to give the lost client up.
const JOINTS: usize = 5;

/// Commits over a bus that ends after so many frames; the version that is in use then, whole.
fn unplugged_after(joint: &InService, next: &[u8], frames: u32) -> u32 {
    let transport = Unplugged { bus: bus::open(joint.served.bus()).unwrap(), left: AtomicU32::new(frames) };
    let outcome = RemoteJoint::on(&Network::new(Arc::new(transport)), NODE)
        .and_then(|client| client.upload_image(next, Use::Commit, &Silent));
    if let Err(error) = outcome {
        let message = error.to_string();
        assert!(message.contains("is gone: the adapter was pulled out"), "{frames} frames: {message}");
    }
    let watcher = joint.served.joint();
    let version = watcher.image_status().unwrap().active.unwrap().version;
    let whole = watcher.active_image().unwrap();
    assert!((version == 3 && whole == joint.stored) || (version == 4 && whole == next), "{frames} frames: {version}");
    version
}

pub fn a_bus_that_is_unplugged_at_any_frame_of_an_upload_leaves_the_old_image_or_the_new_one() {
    let next = &image(4, 0.5, 0);
    let versions = std::thread::scope(|scope| {
        let workers = (1..=JOINTS as u32).map(|first| {
            scope.spawn(move || {
                let joint = InService::new();
                let all = (first..=FRAMES).step_by(JOINTS).map(|frames| unplugged_after(&joint, next, frames));
                all.collect::<Vec<_>>()
            })
        });
        let workers = workers.collect::<Vec<_>>();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect::<Vec<_>>()
    });
    let (old, new) =
        (versions.iter().filter(|version| **version == 3).count(), versions.iter().filter(|v| **v == 4).count());
    println!(
        "unplugged after 1 to {FRAMES} frames: {old} times the old image, {new} times the new one, 0 times another"
    );
    assert!(old > 20 && new > 20 && old + new == FRAMES as usize, "{old} {new}");
}

pub fn two_clients_at_once_are_told_of_each_other_and_the_image_stays() {
    let joint = InService::new();
    let other = joint.served.joint();
    let stop = std::sync::atomic::AtomicBool::new(false);
    let error = std::thread::scope(|scope| {
        scope.spawn(|| {
            while !stop.load(Ordering::Relaxed) {
                // It loses too, and tries again.
                let _ = other.node().upload(0x1008, 0);
            }
        });
        let errors = (0..200).find_map(|_| {
            joint
                .joint
                .upload_image(&image(2, 0.5, 0), Use::Verify, &Silent)
                .err()
                .filter(|error| matches!(error, RemoteError::Client(ClientError::OtherClient { .. })))
        });
        stop.store(true, Ordering::Relaxed);
        errors
    });
    let message = error.expect("200 uploads met another client").to_string();
    assert!(message.contains("of node 5: another client is talking to this node's SDO server"), "{message}");
    joint.unchanged();
}

pub fn two_masters_of_one_joint_end_in_a_joint_that_is_disabled() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let stream = Stream::begin(&joint, Mode::Torque, 100.0, false).unwrap();
    // One that does not listen before it sends.
    let other = bus::open(served.bus()).unwrap();
    let set_point = bus::Frame::new(0x200 + u16::from(NODE), &[0x0F, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    let began = Instant::now();
    let told = loop {
        other.send(&set_point).unwrap();
        match stream.check() {
            Ok(()) => assert!(began.elapsed() < Duration::from_secs(60), "the other one is not heard"),
            Err(error) => break error,
        }
    };
    assert!(matches!(told, RemoteError::OtherMaster { node: NODE, .. }), "{told}");
    drop(stream);
    assert_eq!(joint.state().unwrap(), Drive::SwitchOnDisabled);
}

pub fn a_second_command_is_refused_and_the_first_goes_on() {
    let served = Served::joints(&[NODE]);
    let (joint, other) = (served.joint(), served.joint());
    let begin = |joint| Stream::begin(joint, Mode::Torque, 100.0, false);
    // On a busy machine the first one's set-points may come too late to be heard, and both may ask the joint at once.
    for _ in 0..20 {
        let stream = begin(&joint).unwrap();
        match begin(&other) {
            Err(error @ RemoteError::Commanded { node: NODE, identifier: 0x205 }) => {
                assert!(error.to_string().contains("nothing was commanded"), "{error}");
                stream.check().unwrap();
                assert_eq!(stream.end().unwrap(), Drive::SwitchOnDisabled);
                return;
            }
            Err(RemoteError::Client(ClientError::OtherClient { .. })) | Ok(_) => {}
            Err(error) => panic!("{error}"),
        }
        drop(stream);
        joint.disable().unwrap();
    }
    panic!("a second client was never refused");
}

pub fn a_string_that_is_no_bus_is_answered_with_those_that_are() {
    let message = RemoteJoint::open("can0", NODE).unwrap_err().to_string();
    assert!(message.starts_with("bus 'can0': a kind and a colon are missing. Buses are socketcan:can0, "), "{message}");
}
