//! Ownership of the joint: each way in that is not the owner's, tried over SDO.

use super::*;
use crate::objects::ownership::{FORGET, LIFE, POWER_UP, SESSION};
use friction_compensation::parameters::authentication::{Challenge, Key, Purpose};

const ROLL_BACK: u8 = 4;
const REFUSED: u32 = 0x0800_0021;

fn key(first: u8) -> Key {
    Key::new(core::array::from_fn(|i| first.wrapping_add(i as u8))).unwrap()
}

fn guard() -> Guard {
    Guard { floor: 3, failures: 0, key: Some(key(1)), locked: false }
}

fn owned() -> Node {
    Node::guarded(None, false, LastReset::POWER_UP, &guard())
}

impl Node {
    fn challenge(&mut self) -> Challenge {
        let random = self.upload(0x2215, 5).unwrap().try_into().unwrap();
        Challenge { product: 2, serial: 4, random }
    }

    fn respond(&mut self, key: &Key, purpose: Purpose) -> Result<(), u32> {
        let challenge = self.challenge();
        self.download(0x2215, 7, &key.respond(purpose, &challenge, &[]))
    }

    fn passes(&mut self, milliseconds: u64) {
        // The node's microseconds wrap; the objects' milliseconds do not.
        self.now += u32::try_from(milliseconds * 1_000).unwrap();
        self.task();
    }

    fn wrong(&mut self) -> u64 {
        self.number(0x2215, 4)
    }

    fn owner(&mut self) -> u32 {
        self.number(0x2215, 2) as u32
    }

    fn close(&mut self) {
        self.download(0x2215, 8, &0u32.to_le_bytes()).unwrap();
    }

    /// Sends again what was heard.
    fn replay(&mut self, heard: &[Frame]) {
        for frame in heard {
            self.receive(frame.id(), frame.data());
        }
    }
}

/// A new key as its owner sends it.
fn rotation(owner: &Key, new: &Key, challenge: &Challenge) -> Vec<u8> {
    let masked = owner.mask(challenge, &new.to_bytes());
    [masked, owner.respond(Purpose::Rotate, challenge, &masked)].concat()
}

/// Objects that want the owner, each with a value that it takes otherwise.
fn protected() -> Vec<(u16, u8, Vec<u8>)> {
    let real = |value: f32| value.to_le_bytes().to_vec();
    vec![
        (0x2101, 4, real(0.5)),
        (0x2103, 1, real(1.0)),
        (0x2100, 1, vec![1]),
        (0x1010, 1, b"save".to_vec()),
        (0x1011, 1, b"load".to_vec()),
        (0x605A, 0, vec![0, 0]),
        (0x607D, 2, 400_000i32.to_le_bytes().to_vec()),
        (0x6098, 0, vec![37]),
        (0x607C, 0, 250_000i32.to_le_bytes().to_vec()),
        (0x6007, 0, vec![3, 0]),
        (0x2212, 1, vec![ROLL_BACK]),
        (0x2303, 4, crate::hardware::chip_options::COMMAND.to_le_bytes().to_vec()),
    ]
}

#[test]
fn an_owned_joint_refuses_whatever_changes_what_it_can_do_until_its_owner_opens_a_session() {
    for (index, sub_index, value) in protected() {
        let mut free = Node::new();
        free.download(index, sub_index, &value).unwrap_or_else(|abort| panic!("{index:04x}:{sub_index} {abort:08x}"));
        let mut node = owned();
        assert_eq!(node.download(index, sub_index, &value), Err(REFUSED), "{index:04x}:{sub_index}");
        node.respond(&key(1), Purpose::Session).unwrap();
        node.download(index, sub_index, &value).unwrap_or_else(|abort| panic!("{index:04x}:{sub_index} {abort:08x}"));
        node.download(0x2215, 8, &0u32.to_le_bytes()).unwrap();
        assert_eq!(node.download(index, sub_index, &value), Err(REFUSED), "{index:04x}:{sub_index} once closed");
    }
}

#[test]
fn every_setting_of_the_table_is_protected() {
    use crate::objects::field::Field;
    let mut tried = 0;
    for object in crate::objects::table::OBJECTS {
        if matches!(object.field, Field::Setting(_) | Field::AtOnce(_))
            && object.access != canopen_node::Access::ReadOnly
        {
            // With all bits set, no number is within what the owner set.
            let value = vec![0xff; object.data_type.bytes().unwrap().into()];
            let mut node = owned();
            let answer = node.download(object.index, object.sub_index, &value);
            assert_eq!(answer, Err(REFUSED), "{:04x}:{}", object.index, object.sub_index);
            tried += 1;
        }
    }
    assert!(tried > 50, "{tried}");
}

#[test]
fn compensation_may_be_lowered_below_what_the_owner_set_by_all_and_raised_by_none() {
    let mut node = owned();
    node.respond(&key(1), Purpose::Session).unwrap();
    node.download(0x2200, 3, &0.9f32.to_le_bytes()).unwrap();
    node.download(0x2215, 8, &0u32.to_le_bytes()).unwrap();
    let above = f32::from_bits(0.9f32.to_bits() + 1);
    for (value, expected) in [(0.9, Ok(())), (above, Err(REFUSED)), (0.0, Ok(())), (0.5, Ok(())), (0.9, Ok(()))] {
        assert_eq!(node.download(0x2200, 3, &f32::to_le_bytes(value)), expected, "{value}");
    }
    for value in [-0.1, f32::NAN, f32::INFINITY] {
        assert_eq!(node.download(0x2200, 3, &value.to_le_bytes()), Err(REFUSED), "{value}");
    }
}

#[test]
fn a_session_lasts_sixty_seconds_after_what_was_written_last() {
    let mut node = owned();
    node.respond(&key(1), Purpose::Session).unwrap();
    assert_eq!(node.number(0x2215, 8), SESSION);
    node.passes(SESSION - 1);
    node.download(0x2101, 4, &0.5f32.to_le_bytes()).unwrap();
    node.passes(SESSION - 1);
    assert_eq!(node.number(0x2215, 8), 1);
    node.passes(1);
    assert_eq!((node.download(0x2101, 4, &0.5f32.to_le_bytes()), node.number(0x2215, 8)), (Err(REFUSED), 0));
    assert_eq!(node.download(0x2215, 8, &1u32.to_le_bytes()), Err(0x0609_0030), "nobody lengthens it");
}

#[test]
fn a_session_ends_ten_minutes_after_it_was_opened_whatever_is_written_in_it() {
    let mut node = owned();
    node.respond(&key(1), Purpose::Session).unwrap();
    let write = |node: &mut Node| node.download(0x2101, 4, &0.5f32.to_le_bytes());
    for _ in 0..LIFE / SESSION - 1 {
        node.passes(SESSION - 1);
        write(&mut node).unwrap();
        assert_eq!(node.number(0x2215, 8), SESSION);
    }
    // What is left of the ten minutes, and no more.
    node.passes(10);
    write(&mut node).unwrap();
    assert_eq!(node.number(0x2215, 8), SESSION - 1);
    node.passes(SESSION - 2);
    write(&mut node).unwrap();
    assert_eq!((u64::from(node.now / 1_000), node.number(0x2215, 8)), (LIFE - 1, 1));
    node.passes(1);
    assert_eq!((write(&mut node), node.number(0x2215, 8)), (Err(REFUSED), 0));
    // The owner opens the next one, which lives as long.
    node.respond(&key(1), Purpose::Session).unwrap();
    node.passes(SESSION - 1);
    write(&mut node).unwrap();
    assert_eq!(node.number(0x2215, 8), SESSION);
}

#[test]
fn who_lowers_the_compensation_keeps_no_session_open() {
    let mut node = owned();
    node.respond(&key(1), Purpose::Session).unwrap();
    node.download(0x2200, 3, &0.9f32.to_le_bytes()).unwrap();
    node.passes(SESSION - 1);
    for gain in [0.9, 0.8, 0.7f32] {
        node.download(0x2200, 3, &gain.to_le_bytes()).unwrap();
    }
    assert_eq!(node.number(0x2215, 8), 1);
    // What takes the session keeps it open: more than before is the owner's alone.
    node.download(0x2200, 3, &0.9f32.to_le_bytes()).unwrap();
    assert_eq!(node.number(0x2215, 8), SESSION);
    node.passes(SESSION);
    node.download(0x2200, 3, &0.6f32.to_le_bytes()).unwrap();
    assert_eq!(node.number(0x2215, 8), 0);
    node.download(0x2200, 3, &0.9f32.to_le_bytes()).unwrap();
}

#[test]
fn a_response_opens_once_and_only_its_own_joint() {
    let mut node = owned();
    let challenge = node.challenge();
    assert_eq!(node.challenge(), challenge, "reading it again does not take it from whoever read it before");
    let response = key(1).respond(Purpose::Session, &challenge, &[]);
    for (name, other) in [
        ("another key's", key(2).respond(Purpose::Session, &challenge, &[])),
        ("another joint's", key(1).respond(Purpose::Session, &Challenge { serial: 5, ..challenge }, &[])),
        ("another challenge's", key(1).respond(Purpose::Session, &Challenge { random: [9; 16], ..challenge }, &[])),
        ("a rotation's", key(1).respond(Purpose::Rotate, &challenge, &[])),
        ("a tag", key(1).sign(&challenge.random)),
    ] {
        assert_eq!(node.download(0x2215, 7, &other), Err(REFUSED), "{name}");
    }
    assert_eq!((node.wrong(), node.number(0x2215, 8)), (5, 0));
    assert_eq!(node.objects.program().kept.iter().map(|kept| kept.failures).collect::<Vec<_>>(), [1, 2, 4]);
    // Wrong ones keep no right one out.
    node.download(0x2215, 7, &response).unwrap();
    node.download(0x2215, 8, &0u32.to_le_bytes()).unwrap();
    assert_eq!(node.download(0x2215, 7, &response), Err(REFUSED), "replayed");
    assert_ne!(node.challenge(), challenge);
    assert_eq!(node.download(0x2215, 7, &response), Err(REFUSED), "replayed against the next challenge");
}

#[test]
fn a_whole_session_that_was_recorded_and_is_sent_again_changes_nothing() {
    let mut node = owned();
    node.heard.clear();
    node.respond(&key(1), Purpose::Session).unwrap();
    node.set_real(0x2101, 4, 0.5).unwrap();
    node.download(0x2100, 1, &[1]).unwrap();
    node.download(0x605A, 0, &[6, 0]).unwrap();
    node.download(0x1010, 1, b"save").unwrap();
    // The key changes and comes back, so that the one that signed all of it is in force.
    for (owner, new) in [(key(1), key(2)), (key(2), key(1))] {
        let challenge = node.challenge();
        node.download(0x2215, 6, &rotation(&owner, &new, &challenge)).unwrap();
    }
    node.close();
    let heard = core::mem::take(&mut node.heard);
    // Meanwhile the owner has other settings.
    node.respond(&key(1), Purpose::Session).unwrap();
    node.set_real(0x2101, 4, 0.75).unwrap();
    node.download(0x2100, 1, &[1]).unwrap();
    node.download(0x605A, 0, &[2, 0]).unwrap();
    node.download(0x1010, 1, b"save").unwrap();
    node.close();
    let kept = node.objects.program().kept.last().cloned().unwrap();
    let (record, drawn) = (node.objects.program().record.clone(), node.objects.program().drawn);
    let mut restarted = Node::guarded(record.clone(), false, LastReset::REQUESTED, &kept);
    // Random numbers do not begin anew with the program.
    restarted.objects.program().drawn = drawn;
    for mut node in [node, restarted] {
        let taken = node.objects.program().configured.len();
        for _ in 0..2 {
            node.replay(&heard);
            assert_eq!((node.real(0x2101, 4), node.number(0x605A, 0)), (0.75, 2));
            assert_eq!((node.owner(), node.number(0x2215, 8)), (key(1).id(), 0));
        }
        assert_eq!(node.objects.program().configured.len(), taken);
        assert_eq!(node.objects.program().record, record);
        assert!(node.wrong() >= 2, "{}", node.wrong());
        // The owner is not kept out by it.
        node.respond(&key(1), Purpose::Session).unwrap();
    }
}

#[test]
fn of_two_rotations_that_race_one_comes_through_whole_or_none() {
    let challenge = owned().challenge();
    // Frames of each of both, who have the same challenge.
    let sent = |new: &Key| {
        let mut node = owned();
        node.challenge();
        node.heard.clear();
        node.download(0x2215, 6, &rotation(&key(1), new, &challenge)).unwrap();
        node.heard
    };
    let (first, second) = (sent(&key(2)), sent(&key(3)));
    let outcome = |frames: &[Frame]| {
        let mut node = owned();
        node.challenge();
        node.replay(frames);
        let owner = node.owner();
        let kept = node.objects.program().kept.iter().filter_map(|guard| guard.key.as_ref().map(Key::id)).next_back();
        assert_eq!(kept.unwrap_or(key(1).id()), owner, "what is kept is what counts");
        // A rotation that did not come through can be sent again.
        if owner == key(1).id() {
            node.replay(&first);
            assert_eq!(node.owner(), key(2).id());
        }
        owner
    };
    // There is one SDO channel: a request amid another transfer ends both.
    for cut in 0..=first.len() {
        let frames = [&first[..cut], &second, &first[cut..]].concat();
        let winner = match cut {
            0 => key(3),
            cut if cut == first.len() => key(2),
            _ => key(1),
        };
        assert_eq!(outcome(&frames), winner.id(), "behind {cut} frames");
    }
    let alternating: Vec<Frame> = first.iter().zip(&second).flat_map(|(a, b)| [*a, *b]).collect();
    assert_eq!(outcome(&alternating), key(1).id());
}

#[test]
fn a_node_id_is_stored_for_the_owner_alone() {
    fn lss(node: &mut Node, request: [u8; 3]) -> Vec<u8> {
        let [command, a, b] = request;
        let sent = node.receive(0x7E5, &[command, a, b, 0, 0, 0, 0, 0]);
        sent.iter().find(|frame| frame.id() == 0x7E4).map_or(Vec::new(), |frame| frame.data().to_vec())
    }
    let mut node = owned();
    lss(&mut node, [0x04, 1, 0]);
    assert_eq!(lss(&mut node, [0x11, 9, 0])[..2], [0x11, 0], "until the next reset anybody may change it");
    assert_eq!(lss(&mut node, [0x17, 0, 0])[..3], [0x17, 0xFF, 2]);
    assert_eq!(node.objects.program().record, None);
    node.respond(&key(1), Purpose::Session).unwrap();
    assert_eq!(lss(&mut node, [0x17, 0, 0])[..2], [0x17, 0]);
    assert!(node.objects.program().record.is_some());
}

#[test]
fn of_two_owners_who_race_the_second_one_asks_again() {
    let mut node = owned();
    let (first, second) = (node.challenge(), node.challenge());
    node.download(0x2215, 7, &key(1).respond(Purpose::Session, &first, &[])).unwrap();
    assert_eq!(node.download(0x2215, 7, &key(1).respond(Purpose::Session, &second, &[])), Err(REFUSED));
    node.respond(&key(1), Purpose::Session).unwrap();
}

#[test]
fn without_random_numbers_there_is_no_challenge_and_no_session() {
    let mut node = owned();
    node.objects.program().draws = false;
    assert_eq!(node.upload(0x2215, 5), Err(0x0800_0022));
    let guessed = Challenge { product: 2, serial: 4, random: [0; 16] };
    assert_eq!(node.download(0x2215, 7, &key(1).respond(Purpose::Session, &guessed, &[])), Err(REFUSED));
}

#[test]
fn presence_is_the_minute_after_power_up_before_a_master_starts_the_node_and_cannot_be_made_over_the_bus() {
    let give = |node: &mut Node| node.download(0x2215, 6, &key(1).to_bytes());
    // Just within and just beyond.
    for (waits, expected) in [(POWER_UP - 1, Ok(())), (POWER_UP, Err(REFUSED))] {
        let mut node = Node::new();
        node.passes(waits);
        assert_eq!(node.number(0x2215, 9), u64::from(expected.is_ok()));
        assert_eq!(give(&mut node), expected, "{waits} ms");
    }
    // A master that runs the joint, also after it has stopped it or reset its communication.
    for command in [1, 2, 0x80, 0x82] {
        let mut node = Node::new();
        node.receive(0, &[1, NODE]);
        node.receive(0, &[command, NODE]);
        // A stopped node answers no SDO.
        node.receive(0, &[if command == 2 { 0x80 } else { command }, NODE]);
        node.task();
        assert_eq!(give(&mut node), Err(REFUSED), "NMT {command:02x}");
    }
    // A reset that was asked for, or the watchdog's.
    for causes in [LastReset::SOFTWARE, LastReset::WATCHDOG] {
        let mut node = Node::started(None, false, LastReset { causes, stop: None });
        assert_eq!((give(&mut node), node.number(0x2215, 9)), (Err(REFUSED), 0));
    }
}

#[test]
fn a_board_with_a_button_wants_it_pressed_whatever_the_time() {
    let mut node = Node::new();
    node.objects.program().button = Some(false);
    assert_eq!(node.download(0x2215, 6, &key(1).to_bytes()), Err(REFUSED));
    node.passes(POWER_UP);
    node.objects.program().button = Some(true);
    node.download(0x2215, 6, &key(1).to_bytes()).unwrap();
    assert_eq!(node.owner(), key(1).id());
}

#[test]
fn a_key_that_is_there_is_replaced_by_a_signed_one_alone() {
    let mut node = owned();
    let challenge = node.challenge();
    assert_eq!(node.download(0x2215, 6, &key(2).to_bytes()), Err(REFUSED), "in the minute of presence, too");
    let masked = key(1).mask(&challenge, &key(2).to_bytes());
    let response = key(1).respond(Purpose::Rotate, &challenge, &masked);
    for bit in [0, 100, 255] {
        let mut forged = masked;
        forged[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(node.download(0x2215, 6, &[forged, response].concat()), Err(REFUSED), "bit {bit}");
    }
    assert_eq!(
        node.download(0x2215, 6, &[masked, key(2).respond(Purpose::Rotate, &challenge, &masked)].concat()),
        Err(REFUSED)
    );
    assert_eq!((node.owner(), node.wrong()), (key(1).id(), 4));
    node.download(0x2215, 6, &[masked, response].concat()).unwrap();
    assert_eq!((node.owner(), node.number(0x2215, 3)), (key(2).id(), 3), "the floor stays");
    assert_eq!(node.download(0x2215, 6, &[masked, response].concat()), Err(REFUSED), "replayed");
    assert_eq!(node.respond(&key(1), Purpose::Session), Err(REFUSED), "the old key is nobody's");
    node.respond(&key(2), Purpose::Session).unwrap();
    let kept = node.objects.program().kept.clone();
    assert_eq!(kept.last().and_then(|kept| kept.key.as_ref()).map(Key::id), Some(key(2).id()), "kept");
}

#[test]
fn a_key_is_taken_back_by_its_owner_or_by_who_is_there() {
    let mut node = owned();
    node.passes(POWER_UP);
    assert_eq!(node.download(0x2215, 10, &FORGET.to_le_bytes()), Err(REFUSED));
    node.respond(&key(1), Purpose::Session).unwrap();
    assert_eq!(node.download(0x2215, 10, &FORGET.to_le_bytes()), Err(REFUSED), "a session is anybody's");
    node.respond(&key(1), Purpose::TakeBack).unwrap();
    assert_eq!((node.owner(), node.number(0x2215, 1), node.number(0x2215, 3)), (0, 0, 0));
    node.download(0x2101, 4, &0.5f32.to_le_bytes()).unwrap();

    let mut node = owned();
    assert_eq!(node.download(0x2215, 10, &(FORGET ^ 1).to_le_bytes()), Err(0x0609_0030));
    node.download(0x2215, 10, &FORGET.to_le_bytes()).unwrap();
    assert_eq!((node.owner(), node.objects.program().kept.len()), (0, 1));
}

#[test]
fn what_is_damaged_locks_until_the_owner_repairs_it() {
    // The key is left: a session of its owner's repairs it.
    let mut node = Node::guarded(None, false, LastReset::POWER_UP, &Guard { locked: true, ..guard() });
    assert_eq!(node.download(0x2101, 4, &0.5f32.to_le_bytes()), Err(REFUSED));
    assert_eq!(node.respond(&key(2), Purpose::Session), Err(REFUSED));
    node.respond(&key(1), Purpose::Session).unwrap();
    node.download(0x2101, 4, &0.5f32.to_le_bytes()).unwrap();
    let kept = node.objects.program().kept.last().cloned().unwrap();
    assert!(!kept.locked && kept.key.map(|key| key.id()) == Some(key(1).id()) && kept.floor == 3);
    // No key is left: somebody has to be there.
    let lost = Guard { floor: 0, failures: 0, key: None, locked: true };
    let mut node = Node::guarded(None, false, LastReset::POWER_UP, &lost);
    assert_eq!(node.download(0x2215, 6, &key(2).to_bytes()), Err(REFUSED), "not by giving it another one");
    assert_eq!(node.respond(&key(1), Purpose::Session), Err(REFUSED));
    assert_eq!(node.download(0x2101, 4, &0.5f32.to_le_bytes()), Err(REFUSED));
    node.download(0x2215, 10, &FORGET.to_le_bytes()).unwrap();
    node.download(0x2215, 6, &key(2).to_bytes()).unwrap();
    assert_eq!(node.owner(), key(2).id());
}

#[test]
fn a_change_of_the_owner_that_cannot_be_kept_is_none() {
    for fails in [None, Some(SlotError::Verify { slot: friction_compensation::parameters::slots::Slot::First })] {
        let mut node = owned();
        node.objects.program().fails = fails;
        assert_eq!(node.respond(&key(1), Purpose::TakeBack).is_err(), fails.is_some());
        assert_eq!(node.owner() != 0, fails.is_some());
    }
    // On one bank a moving joint is not held up.
    let mut node = Node::guarded(None, true, LastReset::POWER_UP, &guard());
    node.observed.telemetry.state = crate::joint::state_machine::State::OperationEnabled;
    node.task();
    assert_eq!(node.respond(&key(1), Purpose::TakeBack), Err(0x0800_0022));
    node.respond(&key(1), Purpose::Session).unwrap();
    assert_eq!(node.owner(), key(1).id());
}

#[test]
fn a_session_ends_with_the_program() {
    let mut node = owned();
    node.respond(&key(1), Purpose::Session).unwrap();
    let target = Target { product: 2, serial: 4 };
    let start = Start { single_bank: false, ..Start::new(None, false, &BOARD.joint, &BOARD.bridge) };
    node.objects.restart(LifeCycle::new(target, 3, 0), StoredImages::default(), &start);
    assert_eq!((node.number(0x2215, 8), node.owner()), (0, key(1).id()));
}
