//! Every way through the life cycle, and every refusal by its number; host.

use super::super::authentication::TAG;
use super::super::certificate::{self, Limits};
use super::super::image::{Effort, GoldenMismatch, GoldenVector, Image, ImageError, MAX_LENGTH, Target};
use super::super::slots::{Slot, WriteError};
use super::*;
use crate::friction::common::CommonTerms;
use crate::friction::domain::{Domain, Range};
use crate::friction::physical::{Coefficients, PhysicalParameters, Terms};
use crate::friction::regime::Selector;
use crate::friction::state::{JointState, SIGNALS};
use crate::friction::{FrictionModel, FrictionParameters, ParameterSet};

const RATE: u32 = 20_000;
const GENEROUS: Limits = Limits { output: u32::MAX, torque_gain: u32::MAX - 1, velocity_slope: u32::MAX };
const TARGET: Target = Target { product: 7, serial: 1234 };

/// An image with a constant friction of half a newton metre.
fn image(version: u32) -> Image {
    let coefficients = Coefficients::from_array(core::array::from_fn(|i| if i == 0 { 1 << 15 } else { 0 }));
    let set = ParameterSet { physical: PhysicalParameters { terms: Terms::ALL, coefficients }, network: None };
    let range = Range { low: -(1 << 16), high: 1 << 16 };
    let friction = FrictionParameters {
        domain: Domain { ranges: [range; SIGNALS], margin: 0, reference_temperature: 0 },
        selector: Selector::default(),
        common: CommonTerms::NONE,
        sets: [set, ParameterSet::default(), ParameterSet::default(), ParameterSet::default()],
    };
    let signals = [100, 200, 300, 400, 500, 600];
    let expected = FrictionModel::new(&friction, RATE).evaluate(0, &JointState::from_signals(signals));
    let golden = [GoldenVector { set: 0, signals, expected }].into_iter().collect();
    let target = Target::default();
    let effort = Effort::NewtonMetre;
    Image { version, target, created: 0, effort, data_hash: [0; 16], friction, limits: GENEROUS, golden }
}

fn encoded(image: &Image) -> Vec<u8> {
    let mut buffer = [0; MAX_LENGTH];
    let length = image.encode(&mut buffer).expect("an image");
    buffer[..length].to_vec()
}

fn key() -> Key {
    Key::new(core::array::from_fn(|i| i as u8 + 1)).expect("a key")
}

fn signed(image: &Image) -> Vec<u8> {
    let bytes = encoded(image);
    let tag = key().sign(&bytes);
    [&bytes[..], &tag].concat()
}

/// A joint with its staging buffer.
struct Joint {
    life: LifeCycle,
    staging: [u8; STAGING],
    now: u64,
    armed: bool,
    single_bank: bool,
    key: Option<Key>,
    locked: bool,
    stored: Option<u32>,
    torque: u32,
}

/// The image's own checksum.
fn checksum(bytes: &[u8]) -> u32 {
    Image::summary(bytes).expect("an image").checksum
}

impl Joint {
    fn new() -> Self {
        let life = LifeCycle::new(TARGET, 0, 0);
        let staging = [0; STAGING];
        let torque = u32::MAX;
        Self { life, staging, now: 0, armed: false, single_bank: true, key: None, locked: false, stored: None, torque }
    }

    fn upload(&mut self, bytes: &[u8]) {
        self.life.begin(Some(bytes.len())).expect("an upload");
        for piece in bytes.chunks(7) {
            self.life.receive(&mut self.staging, piece).expect("a piece");
        }
    }

    fn command(&mut self, command: Command) -> Result<Action, Refusal> {
        let Self { now, armed, single_bank, locked, .. } = *self;
        let is_stored = self.life.is_verified(self.stored);
        let conditions =
            Conditions { now, armed, single_bank, key: self.key.as_ref(), locked, is_stored, torque: self.torque };
        let result = self.life.command(command, &self.staging, &conditions);
        assert_eq!(self.life.result(), result.err());
        result
    }

    fn verified(bytes: &[u8]) -> Self {
        let mut joint = Self::new();
        joint.upload(bytes);
        assert_eq!(joint.command(Command::Verify), Ok(Action::Nothing));
        joint.life.set_trial_time(5_000).expect("a time");
        joint
    }

    fn refused(bytes: &[u8]) -> Refusal {
        let mut joint = Self::new();
        joint.upload(bytes);
        joint.refuses_to_verify()
    }

    /// The refusal, after which nothing can be run or stored.
    fn refuses_to_verify(&mut self) -> Refusal {
        let refusal = self.command(Command::Verify).expect_err("refused");
        assert_eq!(self.life.state(), State::Staged);
        for command in [Command::Shadow, Command::Trial, Command::Commit] {
            let refused = Refusal::State { command: Some(command), state: State::Staged };
            assert_eq!(self.command(command), Err(refused));
        }
        refusal
    }
}

#[test]
fn an_image_goes_from_bytes_to_flash() {
    let bytes = encoded(&image(3));
    let mut joint = Joint::new();
    assert_eq!(joint.life.state(), State::Empty);
    joint.upload(&bytes);
    assert_eq!((joint.life.state(), joint.life.length()), (State::Staged, bytes.len()));
    assert_eq!(joint.command(Command::Verify), Ok(Action::Nothing));
    assert_eq!(joint.life.state(), State::Verified);
    let verified = joint.life.verified().expect("verified");
    assert_eq!((verified.version, verified.length), (3, bytes.len()));
    joint.life.set_trial_time(5_000).expect("a time");
    for (command, mode, state) in
        [(Command::Shadow, Mode::Shadow, State::Shadow), (Command::Trial, Mode::Trial, State::Trial)]
    {
        assert_eq!(joint.command(command), Ok(Action::Run { mode, length: bytes.len() }));
        assert_eq!(joint.life.finished(Ok(())), Action::Nothing);
        assert_eq!(joint.life.state(), state);
    }
    assert_eq!(joint.command(Command::Commit), Ok(Action::Store { length: bytes.len() }));
    assert_eq!(joint.life.state(), State::Storing);
    assert_eq!(joint.life.finished(Ok(())), Action::Activate);
    assert_eq!(joint.life.state(), State::Committed);
    assert_eq!(joint.life.finished(Ok(())), Action::Nothing);
    assert_eq!((joint.life.state(), joint.life.length()), (State::Active, 0));
    assert_eq!(joint.command(Command::Discard), Ok(Action::Nothing));
    assert_eq!(joint.life.state(), State::Active, "there is nothing to discard");
    joint.upload(&bytes);
    assert_eq!(joint.command(Command::Verify), Ok(Action::Nothing), "the same version may come again");
}

#[test]
fn a_trial_ends_by_itself_at_its_time_or_without_a_heartbeat() {
    for (command, state) in [(Command::Shadow, State::Shadow), (Command::Trial, State::Trial)] {
        let mut joint = Joint::verified(&encoded(&image(1)));
        joint.now = 1_000;
        joint.command(command).expect("runs");
        assert_eq!(joint.life.tick(9_999, true), Action::Nothing, "not before it runs");
        assert_eq!(joint.life.finished(Ok(())), Action::Nothing);
        assert_eq!((joint.life.tick(5_999, false), joint.life.trial_left(5_999)), (Action::Nothing, 1));
        assert_eq!((joint.life.state(), joint.life.ending()), (state, None));
        assert_eq!((joint.life.tick(6_000, false), joint.life.ending()), (Action::Revert, Some(Ending::Time)));
        assert_eq!((joint.life.state(), joint.life.trial_left(6_000)), (State::Verified, 0));
        assert_eq!(joint.command(command), Err(Refusal::Busy));
        assert_eq!(joint.life.finished(Ok(())), Action::Nothing);
        assert_eq!(joint.life.tick(7_000, false), Action::Nothing);
        joint.command(command).expect("again");
        joint.life.finished(Ok(()));
        assert_eq!((joint.life.tick(1_001, true), joint.life.ending()), (Action::Revert, Some(Ending::Heartbeat)));
    }
}

#[test]
fn a_discarded_trial_reverts_and_a_failed_one_too() {
    let mut joint = Joint::verified(&encoded(&image(1)));
    joint.command(Command::Trial).expect("runs");
    joint.life.finished(Ok(()));
    assert_eq!(joint.command(Command::Discard), Ok(Action::Revert));
    assert_eq!(joint.life.finished(Err(SlotError::NoPrevious)), Action::Revert, "asked for until it is done");
    assert_eq!(joint.life.finished(Ok(())), Action::Nothing);
    assert_eq!((joint.life.state(), joint.life.length()), (State::Empty, 0));

    let mut joint = Joint::verified(&encoded(&image(1)));
    joint.command(Command::Shadow).expect("runs");
    assert_eq!(joint.life.finished(Err(SlotError::NoPrevious)), Action::Revert);
    assert_eq!((joint.life.state(), joint.life.result()), (State::Verified, Some(Refusal::NotRun)));
    assert_eq!(joint.life.finished(Ok(())), Action::Nothing);
    assert_eq!(joint.life.state(), State::Verified);
}

#[test]
fn a_failed_store_leaves_the_image_where_it_was() {
    let mut joint = Joint::verified(&encoded(&image(8)));
    joint.command(Command::Trial).expect("runs");
    joint.life.finished(Ok(()));
    joint.command(Command::Commit).expect("stores");
    let error = SlotError::Write(WriteError { word: 3 });
    assert_eq!(joint.life.finished(Err(error)), Action::Nothing);
    assert_eq!(joint.life.state(), State::Trial);
    assert_eq!(joint.life.result(), Some(Refusal::Slots(error)));
    assert_eq!(joint.life.tick(5_000, false), Action::Revert, "and still ends");
}

#[test]
fn one_bank_is_written_with_the_motor_off_two_at_any_time() {
    for command in [Command::Commit, Command::RollBack] {
        let mut joint = Joint::verified(&encoded(&image(1)));
        joint.armed = true;
        assert_eq!(joint.command(command), Err(Refusal::Armed { command }));
        assert_eq!(joint.life.state(), State::Verified);
        joint.single_bank = false;
        assert!(joint.command(command).is_ok());
        let mut joint = Joint::verified(&encoded(&image(1)));
        assert!(joint.command(command).is_ok());
    }
}

#[test]
fn a_tag_is_checked_under_current_too() {
    let mut joint = Joint::new();
    joint.key = Some(key());
    joint.armed = true;
    joint.upload(&encoded(&image(1)));
    assert_eq!(joint.command(Command::Verify), Err(Refusal::TagMissing));
    joint.upload(&signed(&image(1)));
    assert_eq!(joint.command(Command::Verify), Ok(Action::Nothing));
    assert_eq!(joint.command(Command::Commit), Err(Refusal::Armed { command: Command::Commit }));
    assert_eq!(joint.life.floor(), 0, "nothing was to be stored");
}

#[test]
fn the_floor_rises_with_right_tags_alone() {
    let store = |joint: &mut Joint, upload: &[u8]| {
        joint.upload(upload);
        assert_eq!(joint.command(Command::Verify), Ok(Action::Nothing));
        joint.command(Command::Commit).expect("stores");
        let floor = joint.life.floor();
        joint.life.finished(Ok(()));
        joint.life.finished(Ok(()));
        assert_eq!((joint.life.state(), joint.life.floor()), (State::Active, floor), "kept before it is stored");
        floor
    };
    let mut joint = Joint::new();
    // Without a key no image shuts another one out.
    for version in [u32::MAX, 1, 0, u32::MAX] {
        assert_eq!(store(&mut joint, &encoded(&image(version))), 0);
        assert_eq!((joint.life.lowest(false), joint.life.lowest(true)), (0, 0));
    }
    // The owner of a key begins anew, also after a loss of power.
    joint.key = Some(key());
    for life in [joint.life.clone(), LifeCycle::new(TARGET, 0, 0)] {
        joint.life = life;
        assert_eq!(store(&mut joint, &signed(&image(5))), 5);
        joint.upload(&signed(&image(4)));
        assert_eq!(joint.refuses_to_verify(), Refusal::Version { version: 4, floor: 5 });
        assert_eq!(store(&mut joint, &signed(&image(5))), 5);
        assert_eq!(store(&mut joint, &signed(&image(6))), 6);
    }
}

#[test]
fn an_image_is_newer_than_the_floor_from_the_next_version_on() {
    let mut joint = Joint::new();
    joint.key = Some(key());
    assert!(joint.life.is_newer(), "nothing is verified, so nothing is old");
    joint.life = LifeCycle::new(TARGET, 5, 0);
    for (version, newer) in [(5, false), (6, true)] {
        joint.upload(&signed(&image(version)));
        joint.command(Command::Verify).expect("verified");
        assert_eq!(joint.life.is_newer(), newer, "version {version}");
    }
    joint.command(Command::Commit).expect("stores");
    assert!(!joint.life.is_newer(), "it is the newest itself");
    joint.life.restore_floor(5);
    assert!(joint.life.is_newer(), "it could not be kept");
}

#[test]
fn the_image_in_use_is_not_stored_again_and_raises_the_floor_all_the_same() {
    let bytes = encoded(&image(7));
    let mut joint = Joint::new();
    // It was stored before the key came.
    (joint.key, joint.stored) = (Some(key()), Some(checksum(&bytes)));
    joint.upload(&signed(&image(7)));
    joint.command(Command::Verify).expect("verified");
    assert_eq!(joint.command(Command::Commit), Ok(Action::Revert));
    assert_eq!((joint.life.state(), joint.life.length(), joint.life.floor()), (State::Active, 0, 7));
    assert_eq!(joint.life.finished(Ok(())), Action::Nothing);
    // From a trial of it the stored one comes back, too.
    joint.upload(&signed(&image(7)));
    joint.command(Command::Verify).expect("verified");
    joint.life.set_trial_time(5_000).expect("a time");
    joint.command(Command::Trial).expect("runs");
    joint.life.finished(Ok(()));
    assert_eq!(joint.command(Command::Commit), Ok(Action::Revert));
    assert_eq!((joint.life.finished(Ok(())), joint.life.state()), (Action::Nothing, State::Active));
    // Any other one is.
    joint.upload(&signed(&image(8)));
    joint.command(Command::Verify).expect("verified");
    assert_eq!(joint.command(Command::Commit), Ok(Action::Store { length: bytes.len() }));
}

#[test]
fn a_damaged_key_takes_nothing_and_leaves_what_there_is() {
    let mut joint = Joint::new();
    joint.locked = true;
    for upload in [encoded(&image(1)), signed(&image(1))] {
        joint.upload(&upload);
        for command in Command::ALL.into_iter().filter(|command| *command != Command::Discard) {
            assert_eq!(joint.command(command), Err(Refusal::KeyDamaged), "{command:?}");
        }
    }
    assert_eq!(joint.command(Command::Discard), Ok(Action::Nothing));
    // Damaged while an image is on trial: it ends by itself, and goes no further.
    let mut joint = Joint::verified(&encoded(&image(1)));
    joint.command(Command::Trial).expect("runs");
    joint.life.finished(Ok(()));
    joint.locked = true;
    assert_eq!(joint.command(Command::Commit), Err(Refusal::KeyDamaged));
    assert_eq!(joint.life.tick(5_000, false), Action::Revert);
}

#[test]
fn rolling_back_goes_past_the_floor_and_leaves_it() {
    let mut joint = Joint::new();
    joint.key = Some(key());
    joint.life = LifeCycle::new(TARGET, 9, 0);
    assert_eq!(joint.command(Command::RollBack), Ok(Action::RollBack));
    assert_eq!(joint.life.finished(Ok(())), Action::Activate);
    assert_eq!(joint.life.finished(Ok(())), Action::Nothing);
    assert_eq!((joint.life.state(), joint.life.floor()), (State::Active, 9));
    joint.upload(&signed(&image(8)));
    assert_eq!(joint.refuses_to_verify(), Refusal::Version { version: 8, floor: 9 });
    joint.command(Command::RollBack).expect("rolls back");
    assert_eq!(joint.life.finished(Err(SlotError::NoPrevious)), Action::Nothing);
    assert_eq!(joint.life.result(), Some(Refusal::Slots(SlotError::NoPrevious)));
    assert_eq!(joint.life.state(), State::Empty);
    let mut joint = Joint::verified(&encoded(&image(1)));
    joint.command(Command::Trial).expect("runs");
    joint.life.finished(Ok(()));
    let refused = Refusal::State { command: Some(Command::RollBack), state: State::Trial };
    assert_eq!(joint.command(Command::RollBack), Err(refused));
}

#[test]
fn nothing_else_is_begun_while_something_is_under_way() {
    let mut joint = Joint::verified(&encoded(&image(1)));
    joint.command(Command::Commit).expect("stores");
    for command in Command::ALL {
        assert_eq!(joint.command(command), Err(Refusal::Busy));
    }
    assert_eq!(joint.life.begin(None), Err(Refusal::Busy));
    assert_eq!(joint.life.receive(&mut joint.staging, b"x"), Err(Refusal::Busy));
    let mut joint = Joint::verified(&encoded(&image(1)));
    joint.command(Command::Shadow).expect("runs");
    joint.life.finished(Ok(()));
    let refused = Refusal::State { command: None, state: State::Shadow };
    assert_eq!(joint.life.begin(None), Err(refused));
    assert_eq!(joint.life.receive(&mut joint.staging, b"x"), Err(refused));
}

#[test]
fn what_changes_after_verification_is_neither_run_nor_stored() {
    let bytes = encoded(&image(1));
    for bit in 0..8 * bytes.len() {
        let mut joint = Joint::verified(&bytes);
        joint.staging[bit / 8] ^= 1 << (bit % 8);
        for command in [Command::Shadow, Command::Trial, Command::Commit] {
            assert_eq!(joint.command(command), Err(Refusal::Changed), "bit {bit}");
        }
    }
    // Another image, as good as the one that was verified.
    let mut joint = Joint::verified(&bytes);
    joint.staging[..bytes.len()].copy_from_slice(&encoded(&image(2)));
    assert_eq!(joint.command(Command::Commit), Err(Refusal::Changed));
    let mut joint = Joint::verified(&bytes);
    joint.life.receive(&mut joint.staging, b"").expect("a piece");
    assert_eq!(joint.life.state(), State::Staged);
}

#[test]
fn uploads_that_do_not_fit_are_refused() {
    let mut joint = Joint::new();
    assert_eq!(joint.life.begin(Some(STAGING + 1)), Err(Refusal::UploadTooLong { length: STAGING + 1, room: STAGING }));
    joint.life.begin(None).expect("an upload");
    joint.life.receive(&mut joint.staging, &[1; STAGING]).expect("fills the buffer");
    let refused = joint.life.receive(&mut joint.staging, &[1]);
    assert_eq!(refused, Err(Refusal::UploadTooLong { length: STAGING + 1, room: STAGING }));
    let bytes = encoded(&image(1));
    joint.life.begin(Some(bytes.len())).expect("an upload");
    joint.life.receive(&mut joint.staging, &bytes[1..]).expect("a piece");
    let refused = Refusal::UploadLength { length: bytes.len() - 1, announced: bytes.len() };
    assert_eq!(joint.refuses_to_verify(), refused);
}

#[test]
fn every_changed_bit_of_an_image_is_refused() {
    let bytes = encoded(&image(1));
    for bit in 0..8 * bytes.len() {
        let mut changed = bytes.clone();
        changed[bit / 8] ^= 1 << (bit % 8);
        assert!(matches!(Joint::refused(&changed), Refusal::Image(_)), "bit {bit}");
    }
}

#[test]
fn images_for_others_are_refused() {
    let with = |change: fn(&mut Image)| {
        let mut image = image(1);
        change(&mut image);
        encoded(&image)
    };
    let refused = |change| Joint::refused(&with(change));
    assert_eq!(refused(|image| image.target.product = 8), Refusal::Product { image: 8, joint: 7 });
    assert_eq!(refused(|image| image.target.serial = 1), Refusal::Serial { image: 1, joint: 1234 });
    let effort = Refusal::Effort { image: Effort::Ampere, joint: Effort::NewtonMetre };
    assert_eq!(refused(|image| image.effort = Effort::Ampere), effort);
    Joint::verified(&with(|image| image.target = TARGET));
}

#[test]
fn the_certificate_is_held_to_the_images_limits_and_the_joints() {
    let mut strict = image(1);
    strict.limits.output = 1 << 14;
    let Refusal::Certificate(certificate::Refusal::Output { bound, limit }) = Joint::refused(&encoded(&strict)) else {
        panic!("the certificate");
    };
    assert!(bound >= 1 << 15 && limit == 1 << 14);
    let mut joint = Joint::new();
    joint.upload(&encoded(&image(1)));
    joint.torque = bound - 1;
    let refused = Refusal::Certificate(certificate::Refusal::Output { bound, limit: bound - 1 });
    assert_eq!((joint.refuses_to_verify(), refused.code()), (refused, 0x0603));
    joint.torque = bound;
    assert_eq!(joint.command(Command::Verify), Ok(Action::Nothing));
    joint.life.set_trial_time(5_000).expect("a time");
    joint.torque = bound - 1;
    for command in [Command::Shadow, Command::Trial, Command::Commit] {
        assert_eq!(joint.command(command), Err(refused));
    }
}

#[test]
fn golden_vectors_that_come_out_differently_are_refused() {
    let mut wrong = image(1);
    wrong.golden[0].expected.network = crate::quantity::Torque::from_bits(1);
    assert!(matches!(Joint::refused(&encoded(&wrong)), Refusal::Golden(GoldenMismatch { index: 0, .. })));
}

#[test]
fn with_a_key_an_image_needs_its_tag() {
    let signed = signed(&image(5));
    let with_key = |bytes: &[u8]| {
        let mut joint = Joint::new();
        joint.key = Some(key());
        joint.upload(bytes);
        joint
    };
    let mut joint = with_key(&signed);
    assert_eq!(joint.command(Command::Verify), Ok(Action::Nothing));
    assert_eq!(joint.life.verified().map(|verified| verified.length), Some(signed.len() - TAG));
    joint.command(Command::Commit).expect("stores");
    assert_eq!(with_key(&encoded(&image(5))).refuses_to_verify(), Refusal::TagMissing);
    for bit in 8 * (signed.len() - TAG)..8 * signed.len() {
        let mut changed = signed.clone();
        changed[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(with_key(&changed).refuses_to_verify(), Refusal::TagWrong { failures: 1 }, "bit {bit}");
    }
    // Forged: the checksum is right, the tag is another image's.
    let forged = [encoded(&image(6)), signed[signed.len() - TAG..].to_vec()].concat();
    assert_eq!(with_key(&forged).refuses_to_verify(), Refusal::TagWrong { failures: 1 });
    // Damaged on the way: no failure.
    let mut damaged = signed.clone();
    damaged[200] ^= 1;
    let mut joint = with_key(&damaged);
    assert_eq!((joint.refuses_to_verify().code(), joint.life.failures()), (0x0205, 0));
    // A joint without a key does not ask.
    Joint::verified(&signed);
}

#[test]
fn an_image_verified_before_the_key_came_needs_its_tag_after() {
    let mut joint = Joint::verified(&encoded(&image(1)));
    joint.key = Some(key());
    for command in [Command::Shadow, Command::Trial, Command::Commit] {
        assert_eq!(joint.command(command), Err(Refusal::TagMissing));
    }
}

#[test]
fn wrong_tags_are_counted_and_a_right_one_is_always_taken() {
    let right = signed(&image(1));
    let mut wrong = right.clone();
    *wrong.last_mut().expect("a tag") ^= 1;
    let mut joint = Joint::new();
    joint.key = Some(key());
    for failures in 1..=100 {
        joint.upload(&wrong);
        assert_eq!(joint.refuses_to_verify(), Refusal::TagWrong { failures });
        joint.upload(&right);
        assert_eq!(joint.command(Command::Verify), Ok(Action::Nothing));
    }
    joint.life = LifeCycle::new(TARGET, 0, u16::MAX);
    joint.upload(&wrong);
    assert_eq!(joint.refuses_to_verify(), Refusal::TagWrong { failures: u16::MAX });
    joint.upload(&right);
    assert_eq!(joint.command(Command::Verify), Ok(Action::Nothing));
}

#[test]
fn every_forbidden_step_is_refused_by_command_and_state() {
    for command in [Command::Verify, Command::Shadow, Command::Trial, Command::Commit] {
        let refused = Refusal::State { command: Some(command), state: State::Empty };
        assert_eq!(Joint::new().command(command), Err(refused));
    }
    let mut joint = Joint::verified(&encoded(&image(1)));
    joint.life.trial_time = 0;
    assert_eq!(joint.command(Command::Trial), Err(Refusal::TrialTime { time: 0 }), "no time was set");
    for time in [0, MAX_TRIAL_MS + 1, u32::MAX] {
        assert_eq!(joint.life.set_trial_time(time), Err(Refusal::TrialTime { time }));
    }
    for value in 0..=255 {
        match Command::from_number(value) {
            Ok(command) => assert_eq!(command as u8, value),
            Err(refusal) => assert!(refusal == Refusal::UnknownCommand { value } && !(1..=6).contains(&value)),
        }
    }
    assert_eq!(joint.life.finished(Ok(())), Action::Nothing, "nothing was under way");
}

#[test]
fn every_refusal_has_a_number_and_a_text_of_its_own() {
    use crate::friction::Estimate;
    use certificate::Refusal as C;
    let word = WriteError { word: 1 };
    let (length, limit, needed, slot) = (3, 2, 4, Slot::First);
    let (bound, image_limit) = (9, 8);
    let all = [
        Refusal::UploadTooLong { length, room: STAGING },
        Refusal::UploadLength { length, announced: 5 },
        Refusal::Image(ImageError::Truncated { length, needed }),
        Refusal::Image(ImageError::TooLong { length, limit }),
        Refusal::Image(ImageError::NotAnImage { found: [0; 4] }),
        Refusal::Image(ImageError::UnsupportedFormat { found: 2 }),
        Refusal::Image(ImageError::Checksum { stored: 1, computed: 2 }),
        Refusal::Image(ImageError::Reserved { offset: 3 }),
        Refusal::Image(ImageError::Field { name: "terms", offset: 1, value: 2, low: 3, high: 4 }),
        Refusal::TagMissing,
        Refusal::TagWrong { failures: 2 },
        Refusal::KeyDamaged,
        Refusal::Version { version: 1, floor: 2 },
        Refusal::Product { image: 1, joint: 2 },
        Refusal::Serial { image: 1, joint: 2 },
        Refusal::Effort { image: Effort::Volt, joint: Effort::Newton },
        Refusal::Certificate(C::NetworkOverflow { set: 0, layer: 1, neuron: 2, bound: 3 }),
        Refusal::Certificate(C::PhysicalOverflow { set: 1 }),
        Refusal::Certificate(C::Output { bound, limit: image_limit }),
        Refusal::Certificate(C::TorqueGain { bound, limit: image_limit }),
        Refusal::Certificate(C::VelocitySlope { bound: 9, limit: image_limit }),
        Refusal::Golden(GoldenMismatch { index: 1, expected: Estimate::default(), computed: Estimate::default() }),
        Refusal::UnknownCommand { value: 9 },
        Refusal::State { command: Some(Command::Commit), state: State::Staged },
        Refusal::Busy,
        Refusal::Armed { command: Command::Commit },
        Refusal::TrialTime { time: 0 },
        Refusal::Changed,
        Refusal::NotRun,
        Refusal::Slots(word.into()),
        Refusal::Slots(SlotError::Verify { slot }),
        Refusal::Slots(SlotError::Length { length, limit }),
        Refusal::Slots(SlotError::Buffer { length, needed }),
        Refusal::Slots(SlotError::NoPrevious),
        Refusal::Slots(SlotError::Damaged { slot }),
    ];
    let codes: std::collections::BTreeSet<u16> = all.iter().map(|refusal| refusal.code()).collect();
    let texts: std::collections::BTreeSet<String> = all.iter().map(ToString::to_string).collect();
    assert_eq!((codes.len(), texts.len()), (all.len(), all.len()));
    assert!(!codes.contains(&0));
    let text = Refusal::Version { version: 1, floor: 2 }.to_string();
    assert_eq!(text, "image version 1, must be at least 2");
    let text = Refusal::Armed { command: Command::Commit }.to_string();
    assert_eq!(text, "a commit writes the only bank of flash: the motor must be off and nearly at rest");
}
