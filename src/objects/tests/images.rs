//! The image life cycle over SDO: every step, every refusal with its code, its abort and its EMCY.

use super::*;
use crate::joint::state_machine::State;
use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::{Domain, Range};
use friction_compensation::friction::physical::{Coefficients, PhysicalParameters, Terms};
use friction_compensation::friction::regime::Selector;
use friction_compensation::friction::state::{JointState, SIGNALS};
use friction_compensation::friction::{FrictionModel, FrictionParameters, ParameterSet};
use friction_compensation::parameters::Summary;
use friction_compensation::parameters::authentication::{Challenge, Key, Purpose};
use friction_compensation::parameters::certificate::{self, Limits};
use friction_compensation::parameters::image::{GoldenVector, Image, MAX_LENGTH};
use friction_compensation::parameters::life_cycle::{Action, Mode};
use friction_compensation::parameters::slots::Slot;

const VERIFY: u8 = 1;
const TRIAL: u8 = 2;
const COMMIT: u8 = 3;
const SHADOW: u8 = 6;
const ROLL_BACK: u8 = 4;
const DISCARD: u8 = 5;

/// A constant friction of a 64th of a newton metre, less than what the joint may do.
fn friction() -> FrictionParameters {
    let coefficients = Coefficients::from_array(core::array::from_fn(|i| if i == 0 { 1 << 10 } else { 0 }));
    let set = ParameterSet { physical: PhysicalParameters { terms: Terms::ALL, coefficients }, network: None };
    let range = Range { low: -(1 << 16), high: 1 << 16 };
    FrictionParameters {
        domain: Domain { ranges: [range; SIGNALS], margin: 0, reference_temperature: 0 },
        selector: Selector::default(),
        common: CommonTerms::NONE,
        sets: [set, ParameterSet::default(), ParameterSet::default(), ParameterSet::default()],
    }
}

fn image(version: u32) -> Vec<u8> {
    let friction = friction();
    let expected = FrictionModel::new(&friction, 20_000).evaluate(0, &JointState::from_signals([7; SIGNALS]));
    let image = Image {
        version,
        target: Target::default(),
        created: 1_700_000_000,
        effort: Effort::NewtonMetre,
        data_hash: [0; 16],
        friction,
        limits: Limits { output: u32::MAX, torque_gain: u32::MAX - 1, velocity_slope: u32::MAX },
        golden: [GoldenVector { set: 0, signals: [7; SIGNALS], expected }].into_iter().collect(),
    };
    let mut buffer = [0; MAX_LENGTH];
    let length = image.encode(&mut buffer).unwrap();
    buffer[..length].to_vec()
}

fn stored(bytes: &[u8]) -> StoredImages {
    StoredImages { active: Some((Image::summary(bytes).unwrap(), Slot::First)), previous: None }
}

fn command(node: &mut Node, command: u8) -> Result<(), u32> {
    node.download(0x2212, 1, &[command])
}

fn verified(bytes: &[u8]) -> Node {
    let mut node = Node::operational();
    node.download(0x2210, 0, bytes).unwrap();
    command(&mut node, VERIFY).unwrap();
    assert_eq!((node.number(0x2212, 2), node.number(0x2212, 3)), (2, 0));
    node.download(0x2212, 7, &5_000u32.to_le_bytes()).unwrap();
    node
}

#[test]
fn a_summary_says_what_the_image_says() {
    let bytes = image(3);
    let checksum = u32::from_le_bytes(*bytes.last_chunk().unwrap());
    let length = bytes.len() as u32;
    let expected = Summary { version: 3, created: 1_700_000_000, network: false, checksum, length };
    assert_eq!(Image::summary(&bytes), Ok(expected));
    assert!(Image::summary(&bytes[..100]).is_err());
}

#[test]
fn an_upload_is_counted_and_its_checksum_told() {
    let mut node = Node::new();
    assert_eq!((node.number(0x2212, 2), node.number(0x2212, 4)), (0, 0));
    node.download(0x2210, 0, b"123456789").unwrap();
    assert_eq!((node.number(0x2212, 2), node.number(0x2212, 4)), (1, 9));
    // The check value of CRC-32.
    assert_eq!(node.number(0x2212, 5), 0xCBF4_3926);
}

#[test]
fn what_is_staged_can_be_read_back_until_it_is_forgotten() {
    let mut node = Node::new();
    assert_eq!(node.upload(0x2210, 0), Ok(vec![]));
    node.download(0x2210, 0, b"123456789").unwrap();
    assert_eq!(node.upload(0x2210, 0), Ok(b"123456789".to_vec()));
    command(&mut node, 5).unwrap();
    assert_eq!(node.upload(0x2210, 0), Ok(vec![]));
}

/// Limits of torque just below what is proved of the image, and at it, Nm.
fn around_the_bound() -> (f32, f32) {
    let bound = certificate::prove(&friction()).unwrap().output;
    assert!((1 << 10..(1 << 10) + 8).contains(&bound), "{bound}");
    ((bound - 1) as f32 / 65_536.0, bound as f32 / 65_536.0)
}

/// Configures the limit of the joint's torque, Nm.
fn limit(node: &mut Node, torque: f32) {
    node.set_real(0x2103, 1, torque).unwrap();
    node.download(0x2100, 1, &[1]).unwrap();
}

#[test]
fn an_image_is_judged_by_the_limit_of_torque_that_is_in_use() {
    let (below, bound) = around_the_bound();
    let mut node = Node::operational();
    node.download(0x2210, 0, &image(1)).unwrap();
    limit(&mut node, below);
    command(&mut node, VERIFY).unwrap_err();
    assert_eq!((node.number(0x2212, 2), node.number(0x2212, 3)), (1, 0x0603));
    // What is only staged in the dictionary limits nothing yet.
    node.set_real(0x2103, 1, bound).unwrap();
    command(&mut node, VERIFY).unwrap_err();
    limit(&mut node, bound);
    command(&mut node, VERIFY).unwrap();
    assert_eq!((node.number(0x2212, 2), node.number(0x2212, 3)), (2, 0));
}

#[test]
fn a_verified_image_neither_runs_nor_is_stored_once_the_limit_of_torque_is_lower() {
    let (below, bound) = around_the_bound();
    for number in [TRIAL, COMMIT, SHADOW] {
        let mut node = verified(&image(1));
        limit(&mut node, below);
        command(&mut node, number).unwrap_err();
        assert_eq!((node.number(0x2212, 2), node.number(0x2212, 3)), (2, 0x0603));
        assert_eq!(node.objects.take_action(), Action::Nothing);
        limit(&mut node, bound);
        command(&mut node, number).unwrap();
    }
}

#[test]
fn a_trial_ends_with_its_time_and_can_begin_again() {
    let bytes = image(1);
    let mut node = verified(&bytes);
    command(&mut node, TRIAL).unwrap();
    assert_eq!(node.objects.take_action(), Action::Run { mode: Mode::Trial, length: bytes.len() });
    assert_eq!(node.objects.staging()[..bytes.len()], bytes);
    node.objects.finished(Ok(()), StoredImages::default());
    assert_eq!((node.number(0x2212, 2), node.number(0x2212, 6)), (4, 5_000));
    node.now += 5_000_000;
    node.task();
    assert_eq!(node.objects.take_action(), Action::Revert);
    node.objects.finished(Ok(()), StoredImages::default());
    assert_eq!((node.number(0x2212, 2), node.number(0x2212, 6), node.number(0x2212, 8)), (2, 0, 1));
    command(&mut node, TRIAL).unwrap();
    assert_eq!(node.number(0x2212, 8), 0);
}

#[test]
fn a_trial_ends_with_a_lost_heartbeat() {
    let mut node = verified(&image(1));
    node.download(0x1016, 1, &(9 << 16 | 100u32).to_le_bytes()).unwrap();
    node.receive(0x709, &[5]);
    command(&mut node, TRIAL).unwrap();
    node.objects.take_action();
    node.objects.finished(Ok(()), StoredImages::default());
    node.now += 90_000;
    node.task();
    assert_eq!(node.objects.take_action(), Action::Nothing);
    node.now += 20_000;
    node.task();
    node.task();
    assert_eq!(node.objects.take_action(), Action::Revert);
    node.objects.finished(Ok(()), StoredImages::default());
    assert_eq!(node.number(0x2212, 8), 2);
}

#[test]
fn a_commit_goes_through_flash_to_active_and_back() {
    let bytes = image(4);
    let mut node = verified(&bytes);
    command(&mut node, COMMIT).unwrap();
    assert_eq!(node.number(0x2212, 2), 5);
    // While it is being written nothing else is taken.
    assert_eq!(command(&mut node, DISCARD), Err(0x0800_0022));
    assert_eq!(node.download(0x2210, 0, &bytes), Err(0x0800_0022));
    assert_eq!(node.objects.take_action(), Action::Store { length: bytes.len() });
    node.objects.finished(Ok(()), stored(&bytes));
    // Without a key there is no floor, kept or not.
    assert!(node.objects.program().kept.is_empty());
    assert_eq!((node.number(0x2212, 2), node.objects.take_action()), (6, Action::Activate));
    node.objects.program().image = bytes.clone();
    node.objects.finished(Ok(()), stored(&bytes));
    assert_eq!(node.number(0x2212, 2), 7);
    assert_eq!(node.upload(0x2211, 0), Ok(bytes.clone()));
    assert_eq!([1, 3, 4, 5].map(|sub| node.number(0x2213, sub)), [4, 1, 1, 1_700_000_000]);
    assert_eq!((node.number(0x2214, 1), node.number(0x2215, 3)), (0, 0));
    command(&mut node, ROLL_BACK).unwrap();
    assert_eq!(node.objects.take_action(), Action::RollBack);
    node.objects.finished(Err(SlotError::NoPrevious), stored(&bytes));
    assert_eq!((node.number(0x2212, 3), node.number(0x2213, 1)), (0x0905, 4));
}

#[test]
fn commits_and_roll_backs_are_counted_with_the_other_stores_and_stop_with_the_last() {
    let bytes = image(4);
    let mut node = verified(&bytes);
    // What is committed is never the one in use.
    let other = image(3);
    let both = StoredImages { previous: stored(&bytes).active, ..stored(&other) };
    let mut left = STORES;
    let mut again = |node: &mut Node, number: u8| {
        if number == COMMIT {
            node.download(0x2210, 0, &bytes).unwrap();
            command(node, VERIFY).unwrap();
        }
        command(node, number)?;
        left -= 1;
        assert_eq!((node.number(0x2304, 2), node.objects.program().stores_left), (left.into(), Some(left)));
        assert!(matches!(node.objects.take_action(), Action::Store { .. } | Action::RollBack));
        for _ in 0..2 {
            node.objects.finished(Ok(()), both);
            node.objects.take_action();
        }
        Ok::<(), u32>(())
    };
    // A refused commit writes nothing, and costs nothing.
    command(&mut node, DISCARD).unwrap();
    assert!(command(&mut node, COMMIT).is_err());
    assert_eq!(node.number(0x2304, 2), u64::from(STORES));
    for _ in 0..STORES / 2 {
        again(&mut node, COMMIT).unwrap();
        again(&mut node, ROLL_BACK).unwrap();
    }
    for number in [COMMIT, ROLL_BACK] {
        assert_eq!(again(&mut node, number), Err(0x0800_0022));
        assert_eq!(node.objects.take_action(), Action::Nothing);
    }
    // Only tried, it is not written.
    command(&mut node, TRIAL).unwrap();
}

/// A joint with a key that had so many stores left, of which the image in use took one.
fn owned_with(bytes: &[u8], stores_left: u8) -> (Node, Key) {
    let key = Key::new(core::array::from_fn(|i| i as u8)).unwrap();
    let guard = Guard { floor: 0, failures: 0, key: Some(key.clone()), locked: false };
    let start = Start { single_bank: false, stores_left, ..Start::new(None, false, &BOARD.joint, &BOARD.bridge) };
    let mut node = Node::starting(Memory::default(), &start, &guard);
    stage(&mut node, &key, bytes);
    command(&mut node, COMMIT).unwrap();
    assert!(matches!(node.objects.take_action(), Action::Store { .. }));
    for _ in 0..2 {
        node.objects.finished(Ok(()), stored(bytes));
        node.objects.take_action();
    }
    (node, key)
}

/// Uploads with the key's tag, and verifies.
fn stage(node: &mut Node, key: &Key, bytes: &[u8]) {
    node.download(0x2210, 0, &[bytes, &key.sign(bytes)].concat()).unwrap();
    command(node, VERIFY).unwrap();
}

#[test]
fn an_image_that_is_not_newer_is_its_owners_to_store_and_costs_a_stranger_and_the_flash_nothing() {
    let old = image(5);
    let (mut node, key) = owned_with(&image(7), STORES);
    // The owner has gone back to the image before.
    node.objects.finished(Ok(()), stored(&old));
    let left = node.number(0x2304, 2);
    for _ in 0..2 * STORES {
        stage(&mut node, &key, &image(7));
        assert_eq!(command(&mut node, COMMIT), Err(0x0800_0021));
        assert_eq!((node.number(0x2212, 2), node.objects.take_action()), (2, Action::Nothing));
    }
    // Only tried, it is as it was.
    node.download(0x2212, 7, &5_000u32.to_le_bytes()).unwrap();
    command(&mut node, TRIAL).unwrap();
    node.objects.take_action();
    node.objects.finished(Ok(()), stored(&old));
    assert_eq!((command(&mut node, COMMIT), node.number(0x2212, 2)), (Err(0x0800_0021), 4));
    command(&mut node, DISCARD).unwrap();
    node.objects.take_action();
    node.objects.finished(Ok(()), stored(&old));
    assert_eq!((node.number(0x2304, 2), node.number(0x2215, 3)), (left, 7));
    // In the owner's session it is stored.
    let random = node.upload(0x2215, 5).unwrap().try_into().unwrap();
    let response = key.respond(Purpose::Session, &Challenge { product: 2, serial: 4, random }, &[]);
    node.download(0x2215, 7, &response).unwrap();
    stage(&mut node, &key, &image(7));
    command(&mut node, COMMIT).unwrap();
    assert!(matches!(node.objects.take_action(), Action::Store { .. }));
    assert_eq!(node.number(0x2304, 2), left - 1);
    for _ in 0..2 {
        node.objects.finished(Ok(()), stored(&image(7)));
        node.objects.take_action();
    }
    // The next version is everybody's who has it with its tag.
    node.download(0x2215, 8, &[0; 4]).unwrap();
    stage(&mut node, &key, &image(8));
    command(&mut node, COMMIT).unwrap();
    assert!(matches!(node.objects.take_action(), Action::Store { .. }));
}

#[test]
fn a_commit_of_the_image_in_use_is_done_at_once_writes_nothing_and_costs_no_store() {
    let bytes = image(7);
    for left in [1, 0] {
        let (mut node, key) = owned_with(&bytes, left + 1);
        let kept = node.objects.program().kept.len();
        for _ in 0..3 {
            stage(&mut node, &key, &bytes);
            command(&mut node, COMMIT).unwrap();
            assert_eq!((node.objects.take_action(), node.number(0x2212, 2)), (Action::Revert, 7));
            node.objects.finished(Ok(()), stored(&bytes));
        }
        assert_eq!((node.number(0x2304, 2), node.objects.program().kept.len()), (left.into(), kept));
        // Another one of the next version is stored, or there is no store left.
        stage(&mut node, &key, &image(8));
        assert_eq!(command(&mut node, COMMIT).is_ok(), left > 0);
    }
    // Without a key it is the same.
    let mut node = verified(&bytes);
    node.objects.finished(Ok(()), stored(&bytes));
    command(&mut node, COMMIT).unwrap();
    assert_eq!((node.objects.take_action(), node.number(0x2212, 2)), (Action::Revert, 7));
    assert_eq!(node.number(0x2304, 2), u64::from(STORES));
}

#[test]
fn without_a_key_an_image_of_the_highest_version_shuts_no_other_out() {
    let last = image(u32::MAX);
    let mut node = verified(&last);
    command(&mut node, COMMIT).unwrap();
    node.objects.take_action();
    for _ in 0..2 {
        node.objects.finished(Ok(()), stored(&last));
        node.objects.take_action();
    }
    assert_eq!((node.number(0x2213, 1), node.number(0x2215, 3)), (u64::from(u32::MAX), 0));
    node.download(0x2210, 0, &image(1)).unwrap();
    command(&mut node, VERIFY).unwrap();
    command(&mut node, COMMIT).unwrap();
    assert!(matches!(node.objects.take_action(), Action::Store { .. }));
}

#[test]
fn a_refusal_is_an_abort_a_number_and_an_emcy() {
    let emcy = |sent: &[Frame]| sent.iter().find(|frame| frame.id() == 0x85).map(|frame| frame.data()[..5].to_vec());
    let write = |node: &mut Node, value: u8| node.receive(0x605, &[0x2F, 0x12, 0x22, 1, value, 0, 0, 0]);
    let mut node = Node::new();
    let sent = write(&mut node, COMMIT);
    assert_eq!(sent[0].data()[4..], 0x0800_0022u32.to_le_bytes());
    assert_eq!(emcy(&sent), Some(vec![0x20, 0x63, 0, 0x02, 0x08]));
    assert_eq!(node.number(0x2212, 3), 0x0802);
    let sent = write(&mut node, 9);
    assert_eq!(sent[0].data()[4..], 0x0609_0030u32.to_le_bytes());
    assert_eq!(node.number(0x2212, 3), 0x0801);
    let mut damaged = image(1);
    damaged[60] ^= 1;
    node.download(0x2210, 0, &damaged).unwrap();
    let sent = write(&mut node, VERIFY);
    assert_eq!(sent[0].data()[4..], 0x0800_0020u32.to_le_bytes());
    assert_eq!(node.number(0x2212, 3), 0x0205);
    assert_eq!(node.download(0x2210, 0, &[0; 2049]), Err(0x0607_0012));
}

#[test]
fn one_bank_of_flash_takes_a_commit_only_with_the_motor_off() {
    let mut node = Node::with(None, true);
    node.download(0x2210, 0, &image(1)).unwrap();
    command(&mut node, VERIFY).unwrap();
    node.observed.telemetry.state = State::OperationEnabled;
    assert_eq!(command(&mut node, COMMIT), Err(0x0800_0022));
    assert_eq!((node.number(0x2212, 3), node.objects.take_action()), (0x0804, Action::Nothing));
    node.observed.telemetry.state = State::SwitchOnDisabled;
    command(&mut node, COMMIT).unwrap();
}

#[test]
fn a_key_is_given_once_and_from_then_on_tags_count() {
    let mut node = Node::new();
    assert_eq!(node.download(0x2215, 6, &[9; 31]), Err(0x0607_0013));
    assert_eq!(node.download(0x2215, 6, &[9; 32]), Err(0x0609_0030));
    let bytes: [u8; 32] = core::array::from_fn(|i| i as u8);
    node.download(0x2215, 6, &bytes).unwrap();
    let key = Key::new(bytes).unwrap();
    assert_eq!((node.number(0x2215, 1), node.number(0x2215, 2)), (1, key.id().into()));
    let kept = node.objects.program().kept.pop().and_then(|guard| guard.key);
    assert_eq!(kept.map(|key| key.to_bytes()), Some(bytes));
    assert_eq!(node.download(0x2215, 6, &[1; 32]), Err(0x0800_0021));
    let image = image(1);
    let tagged = |tag: &[u8; 32]| [&image[..], tag].concat();
    node.download(0x2210, 0, &image).unwrap();
    assert_eq!(command(&mut node, VERIFY), Err(0x0800_0021));
    assert_eq!((node.number(0x2212, 3), node.number(0x2215, 4)), (0x0301, 0));
    node.download(0x2210, 0, &tagged(&[0; 32])).unwrap();
    for failures in 1..=9u16 {
        assert_eq!(command(&mut node, VERIFY), Err(0x0800_0021));
        assert_eq!(node.number(0x2215, 4), u64::from(failures));
    }
    // Few of many reach the flash.
    let kept = node.objects.program().kept.iter().map(|guard| (guard.floor, guard.failures));
    assert!(kept.eq([1, 2, 4, 8].map(|failures| (0, failures))));
    node.download(0x2210, 0, &tagged(&key.sign(&image))).unwrap();
    command(&mut node, VERIFY).unwrap();
    assert_eq!((node.number(0x2212, 2), node.number(0x2215, 4)), (2, 9));
    assert_eq!(node.number(0x1003, 1) as u16, emergency::AUTHENTICATION);
}

#[test]
fn an_upload_that_breaks_off_is_not_verified() {
    let mut node = Node::new();
    let [a, b, c, d] = 500u32.to_le_bytes();
    node.receive(0x605, &[0x21, 0x10, 0x22, 0, a, b, c, d]);
    node.receive(0x605, &[0x00, 1, 2, 3, 4, 5, 6, 7]);
    node.receive(0x605, &[0x80, 0x10, 0x22, 0, 0, 0, 0, 0]);
    assert_eq!((command(&mut node, VERIFY), node.number(0x2212, 3)), (Err(0x0800_0020), 0x0102));
}

#[test]
fn the_floor_is_kept_before_an_image_with_a_tag_is_stored_or_it_is_not_stored() {
    let mut node = Node::new();
    let bytes: [u8; 32] = core::array::from_fn(|i| i as u8);
    node.download(0x2215, 6, &bytes).unwrap();
    let image = image(7);
    let tagged = [&image[..], &Key::new(bytes).unwrap().sign(&image)].concat();
    node.download(0x2210, 0, &tagged).unwrap();
    command(&mut node, VERIFY).unwrap();
    node.objects.program().fails = Some(SlotError::Verify { slot: Slot::First });
    assert_eq!(command(&mut node, COMMIT), Err(0x0606_0000));
    assert_eq!((node.objects.take_action(), node.number(0x2212, 2)), (Action::Nothing, 2));
    assert_eq!((node.number(0x2215, 3), node.objects.program().kept.iter().map(|kept| kept.floor).max()), (0, Some(0)));
    node.objects.program().fails = None;
    command(&mut node, COMMIT).unwrap();
    assert_eq!(node.objects.take_action(), Action::Store { length: image.len() });
    assert_eq!(node.objects.program().kept.last().map(|kept| kept.floor), Some(7));
}

#[test]
fn what_is_stored_and_damaged_is_announced_and_stays_in_the_error_register() {
    let mut node = Node::new();
    node.objects.program().damaged = 2;
    node.objects.restart(
        LifeCycle::new(Target { product: 2, serial: 4 }, 0, 0),
        StoredImages::default(),
        &Start { single_bank: false, ..Start::new(None, false, &BOARD.joint, &BOARD.bridge) },
    );
    node.receive(0, &[0x82, NODE]);
    let sent = node.task();
    let told = sent.iter().find(|frame| frame.id() == 0x85).map(|frame| frame.data().to_vec());
    assert_eq!(told, Some(vec![0x10, 0x63, 0x81, 2, 0, 0, 0, 0]));
    assert_eq!(node.number(0x1001, 0), 0x81);
    // The end of a fault ends nothing of it.
    node.observed.latched.set(crate::joint::fault::Fault::OverVoltage, true);
    node.task();
    node.observed.latched = crate::joint::fault::Faults::NONE;
    node.task();
    assert_eq!(node.number(0x1001, 0), 0x81);
}
