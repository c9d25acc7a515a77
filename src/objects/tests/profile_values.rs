//! Values of the profile's objects and bits of the statusword, each from both sides of its limit; network management
//! that is refused.

use super::*;
use crate::joint::state_machine::{Controlword, State};

const REACHED: u64 = 1 << 10;
const LIMITED: u64 = 1 << 11;
const FOLLOWED: u64 = 1 << 12;
const ENABLE: u16 = 0x0F;
const NEW: u16 = 1 << 4;
const HALT: u16 = 1 << 8;

impl Node {
    fn enabled(mode: i8) -> Self {
        let mut node = Self::operational();
        node.observed.telemetry.state = State::OperationEnabled;
        node.download(0x6060, 0, &mode.to_le_bytes()).unwrap();
        node.word(ENABLE);
        node
    }

    fn word(&mut self, word: u16) {
        self.download(0x6040, 0, &word.to_le_bytes()).unwrap();
    }

    fn set(&mut self, index: u16, value: i32) {
        self.download(index, 0, &value.to_le_bytes()).unwrap();
    }

    fn status(&mut self, bits: u64) -> u64 {
        self.task();
        self.number(0x6041, 0) & bits
    }
}

#[test]
fn the_modes_that_6502h_names_are_those_that_can_be_chosen() {
    let mut node = Node::operational();
    let supported = node.number(0x6502, 0);
    for mode in i8::MIN..=i8::MAX {
        let named = match mode {
            0 => true,
            1..=16 => supported >> (mode - 1) & 1 == 1,
            -16..=-1 => supported >> (15 - i32::from(mode)) & 1 == 1,
            _ => false,
        };
        let expected = if named { Ok(()) } else { Err(0x0609_0030) };
        assert_eq!(node.download(0x6060, 0, &mode.to_le_bytes()), expected, "mode {mode}");
        assert_eq!(node.number(0x6061, 0) as i8 == mode, named, "mode {mode}");
    }
}

#[test]
fn a_position_is_reached_within_6067h_and_after_6068h_and_not_before() {
    const TARGET: i32 = 300_000;
    let position = |off: i32| 1e-6 * (TARGET + off) as f32;
    for (window, time) in [(10_000u32, 20u16), (500, 0), (500, 1)] {
        let mut node = Node::enabled(1);
        node.download(0x6067, 0, &window.to_le_bytes()).unwrap();
        node.download(0x6068, 0, &time.to_le_bytes()).unwrap();
        node.set(0x607A, TARGET);
        node.word(ENABLE | NEW);
        node.word(ENABLE);
        let inside = window as i32 - 1;
        let mut at = |milliseconds: u32, actual: i32, demand: i32| {
            node.now = milliseconds * 1_000;
            node.observed.telemetry.motion.position = position(actual);
            node.observed.telemetry.position_demand = position(demand);
            node.status(REACHED) != 0
        };
        let case = format!("{window} µrad, {time} ms");
        for (begun, outside) in [(100, inside + 2), (1_000, -inside - 2)] {
            assert!(!at(begun, outside, 0) && !at(begun + 500, outside, 0), "{case}: the joint is outside");
            assert!(!at(begun + 501, 0, outside) && !at(begun + 600, 0, outside), "{case}: it is not to be there yet");
        }
        let time = u32::from(time);
        for (begun, edge) in [(2_000, inside), (3_000, -inside)] {
            assert_eq!(at(begun, edge, edge), time == 0, "{case}");
            if time > 1 {
                // Left and entered again, the time counts anew.
                assert!(!at(begun + time - 1, edge, edge) && !at(begun + time - 1, inside + 2, edge), "{case}");
                assert!(!at(begun + time, edge, edge) && !at(begun + 2 * time - 1, edge, edge), "{case}");
                assert!(at(begun + 2 * time, edge, edge), "{case}");
            } else {
                assert!(at(begun + time, edge, edge), "{case}");
            }
            assert!(!at(begun + 500, 2 * inside + 2, 0));
        }
    }
}

#[test]
fn rated_current_current_and_supply_have_the_scale_that_the_table_says() {
    let mut node = Node::operational();
    let limit = BOARD.joint.motor.current_limit;
    assert_eq!(node.number(0x6075, 0), (1e3 * limit) as u64);
    for (part, expected) in [(0.5, 500), (-0.25, -250), (0.0005, 1), (-1.0, -1_000), (1.5, 1_500), (100.0, 32_767)] {
        node.observed.telemetry.current.q = part * limit;
        node.task();
        assert_eq!(node.number(0x6078, 0) as i16, expected, "{part}");
    }
    // Another limit is what both refer to, once it is in use.
    node.set_real(0x2101, 5, 0.5 * limit).unwrap();
    assert_eq!(node.number(0x6075, 0), (1e3 * limit) as u64);
    node.download(0x2100, 1, &[1]).unwrap();
    node.observed.telemetry.current.q = 0.25 * limit;
    node.task();
    assert_eq!((node.number(0x6075, 0), node.number(0x6078, 0)), ((0.5e3 * limit) as u64, 500));
    for (supply, expected) in [(24.0, 24_000), (0.001, 1), (0.0, 0), (-1.0, 0), (f32::NAN, 0)] {
        node.observed.telemetry.bus_voltage = supply;
        node.task();
        assert_eq!(node.number(0x6079, 0), expected, "{supply} V");
    }
}

#[test]
fn a_position_limit_of_the_profile_is_the_joint_s_own_taken_at_once_with_the_motor_off() {
    let mut node = Node::operational();
    let [low, high] = [BOARD.joint.limits.position.0, BOARD.joint.limits.position.1];
    let read = |node: &mut Node| [1, 2].map(|sub_index| node.number(0x607D, sub_index) as i32);
    let write = |node: &mut Node, sub_index, value: i32| node.download(0x607D, sub_index, &value.to_le_bytes());
    assert_eq!(read(&mut node), [low, high].map(|limit| (1e6 * limit) as i32));
    write(&mut node, 2, 400_000).unwrap();
    write(&mut node, 1, -1_250_000).unwrap();
    let taken = *node.objects.program().configured.last().unwrap();
    assert_eq!(taken.limits.position, (-1.25, 0.4));
    assert_eq!((read(&mut node), node.real(0x2103, 3), node.real(0x2103, 4)), ([-1_250_000, 400_000], -1.25, 0.4));
    assert_eq!(node.number(0x2100, 7), 0, "nothing is staged");
    // Other staged settings stay staged.
    node.set_real(0x2103, 4, 0.7).unwrap();
    write(&mut node, 1, -1_000_000).unwrap();
    assert_eq!((node.real(0x2103, 4), node.number(0x607D, 2)), (0.7, 400_000));
    node.download(0x2100, 1, &[2]).unwrap();

    // Beyond the other limit, and beyond what any joint may have.
    write(&mut node, 1, 398_900).unwrap();
    write(&mut node, 1, -1_000_000).unwrap();
    for (sub_index, value) in [(1, 399_100), (2, -999_100), (1, -1_000_000_100), (2, 1_000_000_100), (2, i32::MIN)] {
        assert_eq!(write(&mut node, sub_index, value), Err(0x0609_0030), "{sub_index}: {value}");
        assert_eq!(read(&mut node), [-1_000_000, 400_000]);
    }
    let refused = crate::motor::setting::Name::from_code(node.number(0x2100, 3) as u32).text();
    assert!(refused.contains("position"), "{refused}");
    for state in [State::ReadyToSwitchOn, State::SwitchedOn, State::OperationEnabled] {
        node.observed.telemetry.state = state;
        assert_eq!(write(&mut node, 2, 300_000), Err(0x0800_0022), "{state:?}");
    }
    node.observed.telemetry.state = State::SwitchOnDisabled;
    let count = node.objects.program().configured.len();
    write(&mut node, 2, 400_000).unwrap();
    assert_eq!(node.objects.program().configured.len(), count, "as it is");
    node.objects.program().busy = true;
    assert_eq!(write(&mut node, 2, 300_000), Err(0x0800_0022));
    node.objects.program().busy = false;
    node.download(0x1010, 3, b"save").unwrap();
    let mut node = Node::with(node.objects.program().record.clone(), false);
    assert_eq!(read(&mut node), [-1_000_000, 400_000]);
}

#[test]
fn in_velocity_mode_bit_12_says_that_the_target_is_followed_and_bit_11_that_it_is_clipped() {
    let mut node = Node::enabled(9);
    let limit = (1e3 * BOARD.joint.limits.velocity) as i32;
    assert_eq!(node.status(LIMITED | FOLLOWED), 0, "no target has come");
    // Target, offset, and whether the joint's limit clips them.
    for (target, offset, clipped) in [
        (0, 0, false),
        (limit - 1, 0, false),
        (limit + 1, 0, true),
        (1 - limit, 0, false),
        (-1 - limit, 0, true),
        (limit - 1, 2, true),
        (limit + 1, -2, false),
        (0, -1 - limit, true),
    ] {
        node.set(0x60FF, target);
        node.set(0x60B1, offset);
        let expected = FOLLOWED | if clipped { LIMITED } else { 0 };
        assert_eq!(node.status(LIMITED | FOLLOWED), expected, "{target} and {offset} mrad/s");
    }
    node.set(0x60B1, 0);
    node.word(ENABLE | HALT);
    assert_eq!(node.status(FOLLOWED), 0, "halt");
    node.word(ENABLE);
    assert_eq!(node.status(FOLLOWED), FOLLOWED);
    node.observed.telemetry.held = true;
    assert_eq!(node.status(FOLLOWED), 0, "it holds");
    node.observed.telemetry.held = false;
    node.observed.telemetry.state = State::SwitchedOn;
    assert_eq!(node.status(LIMITED | FOLLOWED), 0, "it is not enabled");
}

#[test]
fn set_points_of_the_cyclic_modes_are_interpolated_over_60c2h_and_not_without() {
    // Object, target in SI by raw, and mode.
    for (mode, index, scale) in [(8, 0x607A, 1e-6), (9, 0x60FF, 1e-3)] {
        let asked = |node: &mut Node, milliseconds: u32| {
            node.image.at(milliseconds * 1_000);
            node.image.follow(node.bus.state());
            let command = node.image.demand().command;
            // Raw values are whole, as far as single precision goes.
            ((if mode == 8 { command.position } else { command.velocity }) / scale).round()
        };
        let set = |node: &mut Node, milliseconds: u32, value: i32| {
            node.now = milliseconds * 1_000;
            node.set(index, value);
        };
        for (value, exponent) in [(10, -3i8), (100, -4), (1, -2)] {
            let mut node = Node::enabled(mode);
            node.download(0x60C2, 1, &[value]).unwrap();
            node.download(0x60C2, 2, &exponent.to_le_bytes()).unwrap();
            set(&mut node, 1_000, 1_000);
            assert_eq!(asked(&mut node, 1_000), 1_000.0, "the first counts at once");
            let sequence = node.image.demand().sequence;
            set(&mut node, 1_010, 2_000);
            for (time, expected) in [(1_010, 1_000.0), (1_011, 1_100.0), (1_015, 1_500.0), (1_019, 1_900.0)] {
                let found = asked(&mut node, time);
                assert!((found - expected).abs() < 0.5, "mode {mode}, {time} ms: {found}, not {expected}");
            }
            // One that comes early begins where the joint was to be; the same one again changes nothing.
            set(&mut node, 1_015, 500);
            set(&mut node, 1_018, 500);
            for (time, expected) in [(1_015, 1_500.0), (1_020, 1_000.0), (1_025, 500.0), (2_000, 500.0)] {
                let found = asked(&mut node, time);
                assert!((found - expected).abs() < 0.5, "mode {mode}, {time} ms: {found}, not {expected}");
            }
            assert_eq!(node.image.demand().sequence, sequence + 3, "set-points that came, not those between");
            // 2^32 µs after it came, time is at the same number again.
            for time in [1_018_000u32, 1_020_000, 1_024_000] {
                node.image.at(time);
                node.image.follow(node.bus.state());
                let command = node.image.demand().command;
                let found = (if mode == 8 { command.position } else { command.velocity }) / scale;
                assert_eq!(found.round(), 500.0, "mode {mode}, an hour later");
            }
            // Behind a halt there is no way from what was before it.
            node.word(ENABLE | HALT);
            set(&mut node, 2_100, 3_000);
            node.word(ENABLE);
            assert_eq!(asked(&mut node, 2_100), 3_000.0, "mode {mode}");
        }
        let mut node = Node::enabled(mode);
        set(&mut node, 1_000, 1_000);
        set(&mut node, 1_010, 2_000);
        assert_eq!(asked(&mut node, 1_010), 2_000.0, "no period is set");
    }
    let mut node = Node::operational();
    for (exponent, taken) in [(-7i8, false), (-6, true), (0, true), (1, false)] {
        let expected = if taken { Ok(()) } else { Err(0x0609_0030) };
        assert_eq!(node.download(0x60C2, 2, &exponent.to_le_bytes()), expected, "{exponent}");
    }
}

#[test]
fn the_node_id_of_a_joint_that_is_enabled_or_turns_is_neither_changed_nor_stored() {
    let fast = 1.01 * 0.25 * core::f32::consts::TAU / 0.03 / BOARD.joint.gear.ratio;
    for (state, velocity, refused) in [
        (State::OperationEnabled, 0.0, true),
        (State::QuickStopActive, 0.0, true),
        (State::SwitchedOn, 0.0, true),
        (State::ReadyToSwitchOn, 0.0, true),
        (State::SwitchOnDisabled, fast, true),
        (State::SwitchOnDisabled, -fast, true),
        (State::SwitchOnDisabled, 0.9 * fast, false),
        (State::Fault, 0.0, false),
    ] {
        let mut node = Node::operational();
        node.observed.telemetry.state = state;
        node.observed.telemetry.motion.velocity = velocity;
        node.receive(0x7E5, &[4, 1, 0, 0, 0, 0, 0, 0]);
        let answer = if refused { [0xFF, 1] } else { [0, 0] };
        for request in [[0x11, 7, 0, 0, 0, 0, 0, 0], [0x17, 0, 0, 0, 0, 0, 0, 0]] {
            let answers = node.receive(0x7E5, &request);
            assert_eq!(answers[0].data()[..3], [&request[..1], &answer].concat(), "{state:?}, {velocity} rad/s");
        }
        assert_eq!(node.objects.program().stores, u32::from(!refused), "{state:?}, {velocity} rad/s");
        // And once the joint communicates anew.
        node.receive(0, &[0x82, 0]);
        node.task();
        assert_eq!(node.bus.node_id(), if refused { NODE } else { 7 });
    }
}

#[test]
fn an_nmt_command_of_another_length_changes_neither_the_state_nor_what_is_asked_of_the_joint() {
    let mut node = Node::enabled(9);
    node.set(0x60FF, 500);
    let asked = node.image.demand();
    assert_eq!(asked.controlword, Controlword(ENABLE));
    for command in [1, 2, 0x80, 0x81, 0x82] {
        let whole = [command, NODE, 0, 0, 0, 0, 0, 0];
        for length in [0, 1, 3, 4, 5, 6, 7, 8] {
            node.receive(0, &whole[..length]);
            node.task();
            assert_eq!((node.bus.state(), node.image.demand()), (NmtState::Operational, asked), "{length} bytes");
        }
    }
    node.receive(0, &[2, NODE]);
    assert_eq!((node.bus.state(), node.image.demand().controlword), (NmtState::Stopped, Controlword::QUICK_STOP));
}
