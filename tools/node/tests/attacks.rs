//! Attacks on an owned joint over the bus, at rest and in motion, in simulated time. `docs/attacks.md` lists these and
//! all others.

mod master;

use bus::client::{Command, NmtState};
use friction_compensation::parameters::authentication::{Challenge, Key, Purpose};
use joint_firmware::joint::state_machine::State;
use master::{ID, Master};
use node::SampleImage;

const VERIFY: u8 = 1;
const TRIAL: u8 = 2;
const COMMIT: u8 = 3;
const ROLL_BACK: u8 = 4;
const DISCARD: u8 = 5;
const SHADOW: u8 = 6;

fn key() -> Key {
    Key::new(std::array::from_fn(|i| i as u8 + 1)).unwrap()
}

fn signed(version: u32) -> Vec<u8> {
    let image = SampleImage::constant(version, 0.25);
    let tag = key().sign(&image);
    [image, tag.to_vec()].concat()
}

fn open_session(master: &mut Master) {
    let [product, serial] = [2, 4].map(|sub_index| master.number(0x1018, sub_index) as u32);
    let random = master.upload(0x2215, 5).try_into().unwrap();
    let response = key().respond(Purpose::Session, &Challenge { product, serial, random }, &[]);
    master.download(0x2215, 7, &response).unwrap();
}

fn close_session(master: &mut Master) {
    master.download(0x2215, 8, &[0; 4]).unwrap();
}

/// Uploads and verifies; whether it was taken.
fn verifies(master: &mut Master, upload: &[u8]) -> bool {
    master.download(0x2210, 0, upload).unwrap();
    master.image(VERIFY).is_ok()
}

/// The floor, by object 2215h:3, which has to be what is refused and what is not.
fn floor(master: &mut Master) -> u32 {
    let floor = master.number(0x2215, 3) as u32;
    assert!(!verifies(master, &signed(floor - 1)), "an image of version {} is taken", floor - 1);
    assert!(verifies(master, &signed(floor)), "an image of version {floor} is not");
    master.image(DISCARD).unwrap();
    floor
}

fn in_use(master: &mut Master) -> i64 {
    master.number(0x2213, 1)
}

#[test]
fn the_version_floor_stays_on_every_path_of_an_image_but_a_commit_which_raises_it() {
    let mut master = Master::new();
    master.download(0x2215, 6, &key().to_bytes()).unwrap();
    master.download(0x2212, 7, &100u32.to_le_bytes()).unwrap();
    for version in [5, 7] {
        assert!(verifies(&mut master, &signed(version)));
        master.image(COMMIT).unwrap();
        assert_eq!((floor(&mut master), in_use(&mut master)), (version, version.into()));
    }
    // Verified, in shadow and on trial is not stored: a client's mistake shuts out no older image.
    assert!(verifies(&mut master, &signed(u32::MAX)));
    for command in [SHADOW, TRIAL] {
        master.image(command).unwrap();
        assert_eq!(master.number(0x2215, 3), 7);
        master.wait(200);
        assert_eq!((master.number(0x2212, 2), master.number(0x2215, 3)), (2, 7), "its time is over");
    }
    master.image(TRIAL).unwrap();
    master.image(DISCARD).unwrap();
    assert_eq!((floor(&mut master), in_use(&mut master)), (7, 7));
    // A refused command raises nothing either.
    let mut forged = signed(u32::MAX);
    forged[40] ^= 1;
    assert!(!verifies(&mut master, &forged) && !verifies(&mut master, &SampleImage::constant(u32::MAX, 0.25)));
    assert_eq!(floor(&mut master), 7);
    // The owner goes back to the image before, which is older than the floor; nobody else's old one comes in by that.
    assert!(master.image(ROLL_BACK).is_err());
    open_session(&mut master);
    master.image(ROLL_BACK).unwrap();
    assert_eq!((floor(&mut master), in_use(&mut master)), (7, 5));
    // Whoever has heard the image that the owner went back from sends it again: its tag is right.
    close_session(&mut master);
    let left = master.number(0x2304, 2);
    for _ in 0..3 {
        assert!(verifies(&mut master, &signed(7)) && master.image(COMMIT).is_err());
        master.image(TRIAL).unwrap();
        assert!(master.image(COMMIT).is_err());
        master.image(DISCARD).unwrap();
    }
    assert_eq!((in_use(&mut master), master.number(0x2304, 2)), (5, left));
    open_session(&mut master);
    // Defaults are those of the configuration, not of what guards the joint.
    master.download(0x1011, 1, b"load").unwrap();
    close_session(&mut master);
    assert_eq!(floor(&mut master), 7);
    master.command(Command::ResetNode);
    master.wait(5);
    assert_eq!((floor(&mut master), in_use(&mut master)), (7, 5));
    let mut master = Master::powered(master.node.storage());
    assert_eq!((floor(&mut master), in_use(&mut master)), (7, 5));
    assert_eq!(master.number(0x2215, 2), i64::from(key().id()));
}

/// A joint that is to be homed, with a controlword.
fn word(master: &mut Master, word: u16) {
    master.download(0x6040, 0, &word.to_le_bytes()).unwrap();
    master.wait(20);
}

/// Homing as the statusword shows it: bits 10, 12 and 13.
fn homed(master: &mut Master) -> i64 {
    master.wait(500);
    master.number(0x6041, 0) & 0x3400
}

const DONE: i64 = 0x1400;
const REFUSED: i64 = 0x2400;

#[test]
fn homing_moves_the_zero_of_an_owned_joint_in_its_owners_session_alone() {
    for method in [37u8, 34, 33] {
        let mut master = Master::new();
        master.download(0x2215, 6, &key().to_bytes()).unwrap();
        // The owner leaves a method behind, which the stranger cannot choose.
        open_session(&mut master);
        master.download(0x6098, 0, &[method]).unwrap();
        master.download(0x607C, 0, &250_000i32.to_le_bytes()).unwrap();
        close_session(&mut master);
        assert!(master.download(0x6098, 0, &[35]).is_err() && master.download(0x607C, 0, &[0; 4]).is_err());
        master.command(Command::Start);
        master.download(0x6060, 0, &[6]).unwrap();
        for step in [0x06, 0x07, 0x0F] {
            word(&mut master, step);
        }
        let before = |master: &mut Master| {
            let truth = master.node.joint().actuator().state().joint.position;
            (master.upload(0x2102, 2), (1e3 * truth).round())
        };
        let there = before(&mut master);
        for _ in 0..3 {
            word(&mut master, 0x1F);
            assert_eq!((homed(&mut master), before(&mut master)), (REFUSED, there.clone()), "method {method}");
            word(&mut master, 0x0F);
        }
        // A start that waits for the owner's session is none.
        word(&mut master, 0x1F);
        open_session(&mut master);
        assert_eq!((homed(&mut master), before(&mut master)), (REFUSED, there.clone()), "method {method}");
        word(&mut master, 0x0F);
        word(&mut master, 0x1F);
        master.wait(4_000);
        assert_eq!(homed(&mut master), DONE, "method {method}");
        assert_ne!(before(&mut master).0, there.0);
        close_session(&mut master);
        // Method 0 changes nothing: a master that homes in its start-up may do so.
        open_session(&mut master);
        master.download(0x6098, 0, &[0]).unwrap();
        close_session(&mut master);
        let there = before(&mut master);
        word(&mut master, 0x0F);
        word(&mut master, 0x1F);
        assert_eq!((homed(&mut master), before(&mut master).0), (DONE, there.0));
    }
}

/// An owned joint that goes to and fro on command.
struct Moving {
    master: Master,
    /// mrad/s.
    speed: i32,
}

/// Position at which it turns round, rad.
const TURNS: f64 = 0.5;

impl Moving {
    fn new() -> Self {
        let mut master = Master::new();
        master.download(0x2215, 6, &key().to_bytes()).unwrap();
        master.enabled();
        master.drive(15, 500, 600);
        Self { master, speed: 500 }
    }

    /// Sends a frame between two set-points, and fails where that changes anything of the motion.
    fn goes_on(&mut self, id: u16, data: &[u8]) {
        let Self { master, speed } = self;
        let position = master.node.joint().actuator().state().joint.position;
        if position * f64::from(speed.signum()) > TURNS {
            *speed = -*speed;
            master.drive(15, *speed, 600);
        }
        master.heard.clear();
        master.send(id, data);
        master.drive(15, *speed, 20);
        let velocity = master.node.joint().actuator().state().joint.velocity;
        let frame = format!("{id:03x}h {data:02x?}");
        assert_eq!((master.state(), master.node.state()), (State::OperationEnabled, NmtState::Operational), "{frame}");
        assert!((velocity - 1e-3 * f64::from(*speed)).abs() < 0.05, "{frame}: {velocity} rad/s");
    }
}

#[test]
fn lss_changes_neither_the_motion_nor_the_node_id_of_a_joint_that_moves() {
    let mut moving = Moving::new();
    for (request, answer) in [
        // Switch state global: configuration, node id 9, store, bit timing table 0 of another rate, activate, back.
        ([0x04, 1, 0], None),
        ([0x11, 9, 0], Some([0x11, 0xFF, 1])),
        ([0x17, 0, 0], Some([0x17, 0xFF, 1])),
        ([0x13, 0, 3], Some([0x13, 1, 0])),
        ([0x15, 1, 0], None),
        ([0x04, 0, 0], None),
    ] {
        let [command, a, b] = request;
        moving.goes_on(0x7E5, &[command, a, b, 0, 0, 0, 0, 0]);
        let answered =
            moving.master.heard.iter().find(|frame| frame.id() == 0x7E4).map(|frame| frame.data()[..3].to_vec());
        assert_eq!(answered, answer.map(|answer| answer.to_vec()), "{request:02x?}");
    }
    // It is the node that it was also behind a reset.
    let Moving { mut master, .. } = moving;
    master.command(Command::ResetNode);
    master.wait(1_500);
    assert_eq!((master.number(0x1018, 4), master.node.configuration().node_id), (12, 255));
}

#[test]
fn an_nmt_frame_of_another_length_for_another_node_or_of_no_command_does_nothing_to_a_joint_that_moves() {
    let mut moving = Moving::new();
    for command in 0..=u8::MAX {
        for length in (0..=8).filter(|length| *length != 2) {
            let data = [command, ID, 0, 0, 0, 0, 0, 0];
            if command % 64 == 2 || [0x01, 0x80, 0x81].contains(&command) {
                moving.goes_on(0, &data[..length]);
            }
        }
        moving.goes_on(0, &[command, ID + 1]);
        if ![0x01, 0x02, 0x80, 0x81, 0x82].contains(&command) {
            moving.goes_on(0, &[command, ID]);
            moving.goes_on(0, &[command, 0]);
        }
    }
    // One that is whole acts: whoever can send on the bus can stop the joint.
    moving.master.send(0, &[0x80, ID]);
    assert_eq!(moving.master.node.state(), NmtState::PreOperational);
}
