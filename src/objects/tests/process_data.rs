//! RPDOs to demands, observations to TPDOs, and what a transition does.

use super::*;
use crate::joint::configuration::CollisionReaction;
use crate::joint::fault::Fault;
use crate::joint::state_machine::{Controlword, State};
use crate::joint::{Command, Demand, Mode};

fn rpdo1(controlword: u16, torque: i16, position: i32) -> Vec<u8> {
    [&controlword.to_le_bytes()[..], &torque.to_le_bytes(), &position.to_le_bytes()].concat()
}

fn rpdo2(controlword: u16, mode: i8, velocity: i32) -> Vec<u8> {
    [&controlword.to_le_bytes()[..], &mode.to_le_bytes(), &velocity.to_le_bytes()].concat()
}

fn set_mode(node: &mut Node, mode: i8) {
    node.download(0x6060, 0, &mode.to_le_bytes()).unwrap();
    assert_eq!(node.number(0x6061, 0), u64::from(mode as u8));
}

#[test]
fn each_mode_takes_its_own_set_point() {
    let mut node = Node::operational();
    let rated = BOARD.joint.limits.torque;
    node.receive(0x205, &rpdo1(0x0F, 0, 0));
    node.receive(0x205, &rpdo1(0x0F, -250, 1_500_000));
    let Demand { controlword, command, .. } = node.image.demand();
    assert_eq!(controlword, Controlword(0x0F));
    assert_eq!((command.mode, command.position), (Mode::Torque, 0.0));
    assert!((command.torque + 0.25 * rated).abs() < 1e-6 * rated);
    set_mode(&mut node, 8);
    node.receive(0x205, &rpdo1(0x0F, -250, 1_500_001));
    let command = node.image.demand().command;
    assert_eq!(command.mode, Mode::Position);
    assert!((command.position - 1.5).abs() < 1e-6 && (command.torque + 0.25 * rated).abs() < 1e-6 * rated);
    node.receive(0x305, &rpdo2(0x0F, 9, 0));
    node.receive(0x305, &rpdo2(0x0F, 9, -2_500));
    let command = node.image.demand().command;
    assert_eq!((command.mode, command.velocity), (Mode::Velocity, -2.5));
}

#[test]
fn the_ends_of_every_number_are_kept() {
    let mut node = Node::operational();
    set_mode(&mut node, 8);
    for (position, rad) in [(i32::MAX, 2_147.483_6), (i32::MIN, -2_147.483_6)] {
        node.receive(0x205, &rpdo1(0, i16::MAX, position));
        let command = node.image.demand().command;
        assert!((command.position - rad).abs() < 3e-4, "{}", command.position);
        assert!((command.torque / BOARD.joint.limits.torque - 32.767).abs() < 1e-4);
    }
}

#[test]
fn the_impedance_frame_is_the_mini_cheetahs() {
    let mut node = Node::operational();
    // By SDO, as RPDO 3 carries no mode.
    set_mode(&mut node, -1);
    node.receive(0x405, &[0xFF, 0xFF, 0, 0x0F, 0xFF, 0, 0x0F, 0xFF]);
    let [position, velocity, stiffness, _, torque] = DEFAULT_RANGES;
    let expected =
        Command { mode: Mode::Impedance, position, velocity: -velocity, stiffness, torque, ..Command::NOTHING };
    assert_eq!(node.image.demand().command, expected);
    for command in [expected, Command { position: -1.25, velocity: 3.0, damping: 2.5, torque: -4.5, ..expected }] {
        node.receive(0x405, &impedance_frame(&command, DEFAULT_RANGES).to_le_bytes());
        let Command { position: p, velocity: v, stiffness: k, damping: d, torque: t, .. } = node.image.demand().command;
        let errors = [
            (p - command.position) / (position / 65_535.0),
            (v - command.velocity) / (velocity / 4_095.0),
            (k - command.stiffness) / (stiffness / 8_190.0),
            (d - command.damping) / (5.0 / 8_190.0),
            (t - command.torque) / (torque / 4_095.0),
        ];
        assert!(errors.iter().all(|error| error.abs() < 1.01), "{errors:?}");
    }
    assert_eq!(
        node.number(0x2011, 1),
        u64::from_le_bytes(
            impedance_frame(
                &Command { position: -1.25, velocity: 3.0, damping: 2.5, torque: -4.5, ..expected },
                DEFAULT_RANGES
            )
            .to_le_bytes()
        )
    );
}

#[test]
fn a_joint_that_was_not_told_where_to_go_holds_where_it_is() {
    let mut node = Node::operational();
    for mode in [8, -1, 9, 10, 0] {
        node.receive(0x305, &rpdo2(0x0F, mode, 700));
        assert_eq!(node.image.demand().command, HOLD, "mode {mode}");
        assert_eq!(node.number(0x6061, 0), u64::from(mode as u8));
    }
}

/// Command to stay where it is, and nothing else.
const HOLD: Command = Command { mode: Mode::Hold, ..Command::NOTHING };

#[test]
fn a_position_counts_once_it_is_another_one_by_sdo_or_with_the_release_of_halt() {
    let at = |node: &Node| match node.image.demand().command {
        Command { mode: Mode::Position, position, .. } => Some((1e6 * position).round() as i32),
        _ => None,
    };
    let entered = |position| {
        let mut node = Node::operational();
        set_mode(&mut node, 8);
        node.receive(0x205, &rpdo1(0x07, 0, 1));
        for _ in 0..3 {
            node.receive(0x205, &rpdo1(0x0F, 0, position));
            assert_eq!(at(&node), None);
        }
        node
    };
    for position in [0, 1, 500] {
        let mut node = entered(position);
        node.receive(0x205, &rpdo1(0x0F, 0, position + 1));
        assert_eq!(at(&node), Some(position + 1));
        // And back.
        node.receive(0x205, &rpdo1(0x0F, 0, position));
        assert_eq!(at(&node), Some(position));
        // No position is left once operation was disabled, or another mode was chosen meanwhile.
        node.receive(0x205, &rpdo1(0x07, 0, position + 2));
        node.receive(0x205, &rpdo1(0x0F, 0, position + 3));
        node.receive(0x205, &rpdo1(0x0F, 0, position + 3));
        assert_eq!(at(&node), None);
        node.receive(0x205, &rpdo1(0x0F, 0, position));
        set_mode(&mut node, 9);
        set_mode(&mut node, 8);
        node.receive(0x205, &rpdo1(0x0F, 0, position));
        assert_eq!(at(&node), None);

        let mut node = entered(position);
        node.download(0x607A, 0, &position.to_le_bytes()).unwrap();
        assert_eq!(at(&node), Some(position));

        let mut node = entered(position);
        node.receive(0x205, &rpdo1(0x10F, 0, position));
        assert_eq!(at(&node), None);
        node.receive(0x205, &rpdo1(0x0F, 0, position));
        assert_eq!(at(&node), Some(position));
    }
}

#[test]
fn halt_holds_in_every_mode_and_keeps_only_the_torque_that_bears_a_load() {
    let mut node = Node::operational();
    for mode in [8, 9, 10, -1, 0, -2] {
        set_mode(&mut node, mode);
        node.receive(0x205, &rpdo1(0x0F, 0, 0));
        node.receive(0x205, &rpdo1(0x0F, 100, mode.into()));
        node.receive(0x405, &[1, 2, 3, 4, 5, 6, 7, 8]);
        node.download(0x60FF, 0, &1_000i32.to_le_bytes()).unwrap();
        node.download(0x2107, 1, &7u64.to_le_bytes()).unwrap();
        let moving = node.image.demand().command;
        assert_eq!(node.shared.follows(), matches!(mode, 8 | 9 | 10 | -1), "mode {mode}");
        node.receive(0x205, &rpdo1(0x10F, 100, mode.into()));
        let Demand { controlword, command, .. } = node.image.demand();
        assert!(controlword.enables_operation() && controlword.halts() && !node.shared.follows());
        match mode {
            -2 => assert_eq!(command, Command { mode: Mode::OpenLoop, ..Command::NOTHING }),
            8 | 9 => assert_eq!(command, Command { torque: moving.torque, ..HOLD }),
            _ => assert_eq!(command, HOLD, "mode {mode}"),
        }
        assert!(mode == 0 || moving != command, "mode {mode}");
        node.receive(0x205, &rpdo1(0x0F, 100, mode.into()));
        assert_eq!(node.image.demand().command, moving, "mode {mode} goes on");
    }
}

#[test]
fn what_holds_is_added_in_every_mode_but_the_open_loop_once_it_came_and_through_a_halt() {
    let offset = |node: &mut Node| node.download(0x60B2, 0, &(-250i16).to_le_bytes()).unwrap();
    for mode in [8, 9, 10, -1, 0, -2] {
        let [mut node, mut without] = [(); 2].map(|()| Node::operational());
        set_mode(&mut node, mode);
        set_mode(&mut without, mode);
        offset(&mut node);
        for (n, controlword) in [0x0F, 0x0F, 0x10F, 0x0F].into_iter().enumerate() {
            for node in [&mut node, &mut without] {
                node.receive(0x205, &rpdo1(controlword, 100, n as i32));
                node.receive(0x405, &[1, 2, 3, 4, 5, 6, 7, 8]);
            }
            // A set-point from before operation was enabled is nothing to go by.
            let held = if n == 0 || mode == -2 { 0.0 } else { -0.25 * node.shared.rated_torque() };
            let (with, without) = (node.image.demand().command, without.image.demand().command);
            assert!((with.torque - without.torque - held).abs() < 1e-6, "mode {mode}, {n}: {with:?}");
            assert_eq!(with, Command { torque: with.torque, push: with.push, ..without }, "mode {mode}, {n}");
            if n == 0 {
                offset(&mut node);
            }
        }
        node.receive(0, &[0x80, NODE]);
        assert_eq!(node.image.demand().command, Command::default());
    }
}

#[test]
fn the_target_pushes_where_the_offset_says_what_holds() {
    let mut node = Node::operational();
    set_mode(&mut node, 10);
    node.receive(0x205, &rpdo1(0x0F, 0, 0));
    node.receive(0x205, &rpdo1(0x0F, 100, 0));
    let rated = node.shared.rated_torque();
    let asked = |node: &Node| [node.image.demand().command.torque, node.image.demand().command.push];
    assert_eq!(asked(&node), [0.1 * rated, 0.0]);
    for (offset, torque) in [(0i16, 0.1), (-300, -0.2)] {
        node.download(0x60B2, 0, &offset.to_le_bytes()).unwrap();
        for (found, expected) in asked(&node).into_iter().zip([torque * rated, 0.1 * rated]) {
            assert!((found - expected).abs() < 1e-6 * rated, "{found} Nm, expected {expected}");
        }
    }
}

#[test]
fn the_statusword_tells_whether_the_target_is_followed() {
    let mut node = Node::operational();
    set_mode(&mut node, 9);
    let follows = |node: &mut Node| node.number(0x6041, 0) >> 12 & 1;
    node.receive(0x305, &rpdo2(0x0F, 9, 0));
    node.observed.telemetry.state = State::OperationEnabled;
    assert_eq!(follows(&mut node), 0);
    node.receive(0x305, &rpdo2(0x0F, 9, 0));
    assert_eq!(follows(&mut node), 1);
    node.receive(0x305, &rpdo2(0x10F, 9, 0));
    assert_eq!(follows(&mut node), 0);
    node.receive(0x305, &rpdo2(0x0F, 9, 0));
    assert_eq!(follows(&mut node), 1);
    // The drive is elsewhere than the controlword asks for.
    node.observed.telemetry.state = State::SwitchedOn;
    assert_eq!(follows(&mut node), 0);
}

#[test]
fn every_transition_ends_every_set_point_and_keeps_the_mode() {
    for command in [0x02, 0x80, 0x81, 0x82] {
        let mut node = Node::operational();
        set_mode(&mut node, 8);
        node.receive(0x205, &rpdo1(0x0F, 100, 1_000_000));
        let before = node.image.demand();
        assert_ne!(before.command, Command::default());
        node.receive(0, &[command, NODE]);
        let after = node.image.demand();
        assert_eq!((after.controlword, after.command), (Controlword::QUICK_STOP, Command::default()));
        assert_ne!(after.sequence, before.sequence);
        // Set-points that come now change nothing, now and after the next start.
        node.receive(0x205, &rpdo1(0x0F, 100, 1_000_000));
        node.receive(0x80, &[]);
        assert_eq!(node.image.demand(), after);
        node.receive(0, &[1, NODE]);
        let Demand { controlword, command, .. } = node.image.demand();
        assert_eq!((controlword, command), (Controlword::QUICK_STOP, HOLD));
        node.receive(0x205, &rpdo1(0x0F, 0, 500_000));
        node.receive(0x205, &rpdo1(0x0F, 0, 500_001));
        assert_eq!(node.image.demand().command.mode, Mode::Position);
    }
}

#[test]
fn set_points_by_sdo_need_operational_and_a_mode_does_not() {
    let mut node = Node::new();
    for (index, value) in
        [(0x6040, &[0x0F, 0][..]), (0x6071, &[1, 0]), (0x607A, &[1, 0, 0, 0]), (0x60FF, &[1, 0, 0, 0])]
    {
        assert_eq!(node.download(index, 0, value), Err(0x0800_0022), "{index:04x}");
    }
    set_mode(&mut node, 9);
    for mode in [-3, 2, 4, 5, 7, 11] {
        assert_eq!(node.download(0x6060, 0, &[mode as u8]), Err(0x0609_0030), "{mode}");
    }
    set_mode(&mut node, 0);
    set_mode(&mut node, 9);
    node.receive(0, &[1, NODE]);
    let before = node.image.demand().sequence;
    node.download(0x6040, 0, &[0x06, 0]).unwrap();
    node.download(0x60FF, 0, &1_000i32.to_le_bytes()).unwrap();
    let Demand { controlword, command, sequence, .. } = node.image.demand();
    assert_eq!((controlword, command.velocity, sequence), (Controlword::SHUTDOWN, 1.0, before + 2));
    assert_eq!(node.number(0x60FF, 0), 1_000);
}

/// Number of times that the deadline was renewed meanwhile.
fn renewals(node: &mut Node, what: impl FnOnce(&mut Node)) -> u32 {
    let before = node.image.demand().sequence;
    what(node);
    node.image.demand().sequence - before
}

/// Maps these objects, each with its bits, into RPDO 4.
fn map_rpdo4(node: &mut Node, objects: &[u32]) {
    node.download(0x1403, 1, &0x8000_0505u32.to_le_bytes()).unwrap();
    node.download(0x1603, 0, &[0]).unwrap();
    for (entry, object) in (1..).zip(objects) {
        node.download(0x1603, entry, &object.to_le_bytes()).unwrap();
    }
    node.download(0x1603, 0, &[objects.len() as u8]).unwrap();
    node.download(0x1403, 1, &0x505u32.to_le_bytes()).unwrap();
}

#[test]
fn a_cyclic_mode_is_renewed_by_the_pdo_that_carries_its_set_point_and_by_no_other() {
    // Mode, and which of RPDOs 1 to 3 renew it.
    for (mode, renew) in [
        (8, [1, 0, 0]),
        (9, [0, 1, 0]),
        (10, [1, 0, 0]),
        (-1, [0, 0, 1]),
        (0, [1, 1, 1]),
        (1, [1, 1, 1]),
        (3, [1, 1, 1]),
        (6, [1, 1, 1]),
        (-2, [1, 1, 1]),
    ] {
        let mut node = Node::operational();
        set_mode(&mut node, mode);
        for controlword in [0x0F, 0x10F] {
            let pdos = [(0x205, rpdo1(controlword, 0, 1)), (0x305, rpdo2(controlword, mode, 0)), (0x405, vec![0; 8])];
            for ((id, data), expected) in pdos.into_iter().zip(renew) {
                for _ in 0..2 {
                    let found = renewals(&mut node, |node| drop(node.receive(id, &data)));
                    assert_eq!(found, expected, "mode {mode}, {id:03x}, controlword {controlword:#x}");
                }
            }
        }
    }
}

#[test]
fn whatever_the_mapping_the_set_point_of_the_mode_counts_alone() {
    const CONTROLWORD: u32 = 0x6040_0010;
    // What is added to a target, and another mode's target, is no set-point of the mode.
    for (mode, mapped, expected) in [
        (9, &[CONTROLWORD][..], 0),
        (9, &[CONTROLWORD, 0x6071_0010, 0x60B1_0020], 0),
        (9, &[CONTROLWORD, 0x60B2_0010, 0x607A_0020], 0),
        (9, &[0x60FF_0020], 1),
        (8, &[CONTROLWORD, 0x60FF_0020, 0x6071_0010], 0),
        (8, &[0x60B0_0020, 0x60B2_0010], 0),
        (8, &[CONTROLWORD, 0x607A_0020], 1),
        (10, &[CONTROLWORD, 0x60B2_0010, 0x6072_0010], 0),
        (10, &[0x6071_0010], 1),
        (-1, &[CONTROLWORD, 0x6071_0010, 0x607A_0020], 0),
        (-1, &[0x2011_0140], 1),
        (3, &[CONTROLWORD], 1),
    ] {
        let mut node = Node::new();
        map_rpdo4(&mut node, mapped);
        node.receive(0, &[1, NODE]);
        set_mode(&mut node, mode);
        node.download(0x6040, 0, &[0x0F, 0]).unwrap();
        for _ in 0..3 {
            let found = renewals(&mut node, |node| drop(node.receive(0x505, &[0x0F, 0, 0, 0, 0, 0, 0, 0])));
            assert_eq!(found, expected, "mode {mode}, {mapped:x?}");
        }
    }
}

#[test]
fn a_set_point_by_sdo_renews_its_mode_and_another_value_does_not() {
    let mut node = Node::operational();
    set_mode(&mut node, 9);
    node.download(0x6040, 0, &[0x0F, 0]).unwrap();
    for (index, value, expected) in [
        (0x60FF, &500i32.to_le_bytes()[..], 1),
        (0x60FF, &500i32.to_le_bytes(), 1),
        (0x6040, &[0x0F, 0], 0),
        (0x6071, &[0, 0], 0),
        (0x607A, &[0; 4], 0),
        (0x60B1, &[0; 4], 0),
        (0x6060, &[9], 0),
    ] {
        let found = renewals(&mut node, |node| node.download(index, 0, value).unwrap());
        assert_eq!(found, expected, "{index:04x}");
    }
    // Words with which there is no operation, and a fault reset that begins: the joint can be had out of its
    // fault.
    for (word, expected) in [(0x0F, 0), (0x8F, 1), (0x8F, 0), (0x07, 1), (0x06, 1), (0x02, 1), (0x00, 1), (0x80, 1)] {
        let found = renewals(&mut node, |node| node.download(0x6040, 0, &[word, 0]).unwrap());
        assert_eq!(found, expected, "controlword {word:#x}");
    }
}

#[test]
fn a_counter_that_is_mapped_and_repeated_does_not_renew_the_deadline() {
    let mut node = Node::new();
    set_mode(&mut node, 9);
    node.download(0x1401, 1, &0x8000_0305u32.to_le_bytes()).unwrap();
    node.download(0x1601, 0, &[0]).unwrap();
    for (entry, object) in (1..).zip([0x6040_0010u32, 0x2010_0108, 0x60FF_0020]) {
        node.download(0x1601, entry, &object.to_le_bytes()).unwrap();
    }
    node.download(0x1601, 0, &[3]).unwrap();
    node.download(0x1401, 1, &0x305u32.to_le_bytes()).unwrap();
    node.receive(0, &[1, NODE]);
    let mut sequences = [0u8, 0, 1, 1, 2].map(|counter| {
        node.receive(0x305, &rpdo2(0x0F, counter as i8, 0));
        node.image.demand().sequence
    });
    let first = sequences[0];
    assert_eq!(sequences, [first, first, first + 1, first + 1, first + 2]);
    // A PDO without the counter is not measured by it.
    sequences[4] += 1;
    set_mode(&mut node, 10);
    node.receive(0x205, &rpdo1(0x0F, 0, 0));
    assert_eq!(node.image.demand().sequence, sequences[4]);
}

#[test]
fn a_mode_that_does_not_exist_changes_nothing() {
    let mut node = Node::operational();
    node.receive(0x305, &rpdo2(0x0F, 9, 5));
    node.receive(0x305, &rpdo2(0x0F, 4, 6));
    assert_eq!(node.image.demand().command, Command { mode: Mode::Velocity, velocity: 0.006, ..Command::default() });
}

#[test]
fn a_neighbours_velocity_comes_out_of_its_second_tpdo() {
    let mut node = Node::operational();
    node.download(0x1403, 1, &0x286u32.to_le_bytes()).unwrap();
    let before = node.image.demand();
    node.receive(0x286, &[0x30, 0xF8, 0xFF, 0xFF, 1, 2, 3, 4]);
    let after = node.image.demand();
    assert_eq!(after.coupled.velocity, -2.0);
    assert_eq!(after.coupled.sequence, before.coupled.sequence + 1);
    // It asks nothing of this joint.
    assert_eq!(Demand { coupled: before.coupled, ..after }, before);
}

#[test]
fn telemetry_is_scaled_as_the_table_says_and_held_at_the_ends() {
    let mut node = Node::operational();
    let t = &mut node.observed.telemetry;
    t.state = State::OperationEnabled;
    t.motion.position = -1.234_567;
    t.motion.velocity = 2.5;
    t.mean_torque = 0.01;
    t.compensated.torque = -0.0125;
    t.bus_voltage = 23.456;
    node.observed.feedforward_torque = 0.02;
    node.observed.winding_temperature = 45.67;
    node.observed.latched.set(Fault::OverCurrent, true);
    node.observed.latched.set(Fault::BridgeDriver, true);
    let sent = node.receive(0x80, &[]);
    let pdo = |id: u16| sent.iter().find(|frame| frame.id() == id).unwrap().data().to_vec();
    let permille = (10.0 / BOARD.joint.limits.torque) as i16;
    assert_eq!(
        pdo(0x185),
        [&0x0237u16.to_le_bytes()[..], &permille.to_le_bytes(), &(-1_234_567i32).to_le_bytes()].concat()
    );
    // 10 mNm measured, 20 mNm fed forward, -12.5 mNm by compensation: 2.5 mNm are left.
    let velocity = [&2_500i32.to_le_bytes()[..], &(-13i16).to_le_bytes(), &3i16.to_le_bytes()].concat();
    assert_eq!(pdo(0x285)[..6], velocity[..6]);
    assert!((i16::from_le_bytes([pdo(0x285)[6], pdo(0x285)[7]]) - 3).abs() <= 1);
    assert_eq!(node.number(0x2021, 1), 2_346);
    assert_eq!(node.number(0x2021, 2), 457);
    assert_eq!(node.number(0x2021, 3) as u16 as i16, i16::MIN);
    assert_eq!(node.number(0x2021, 4), 0x8001);
    assert_eq!(node.number(0x603F, 0), 0x2310);
    assert_eq!(node.number(0x6076, 0), (BOARD.joint.limits.torque * 1e3) as u64);
    for (value, position, torque) in
        [(f32::NAN, 0, 0), (f32::INFINITY, i32::MAX, i16::MAX), (-1e30, i32::MIN, i16::MIN)]
    {
        node.observed.telemetry.motion.position = value;
        node.observed.telemetry.compensated.torque = value;
        assert_eq!(node.number(0x6064, 0) as i32, position);
        assert_eq!(node.number(0x2020, 1) as i16, torque);
    }
}

#[test]
fn a_reaction_to_a_collision_takes_the_place_of_the_set_points_until_it_is_acknowledged() {
    use CollisionReaction::{Hold, Off, QuickStop, Warning, Yield};
    let follows = Demand { controlword: Controlword(0x0F), ..Demand::default() };
    for (reaction, word, mode) in [
        (Off, 0x0F, Mode::Velocity),
        (Warning, 0x0F, Mode::Velocity),
        (QuickStop, 0x02, Mode::Velocity),
        (Hold, 0x10F, Mode::Hold),
        (Yield, 0x0F, Mode::Impedance),
    ] {
        let reacts = !matches!(reaction, Off | Warning);
        let mut node = Node::operational();
        node.receive(0x305, &rpdo2(0x0F, 9, 0));
        node.receive(0x305, &rpdo2(0x0F, 9, 500));
        node.image.collide(reaction);
        node.receive(0x305, &rpdo2(0x0F, 9, 600));
        let Demand { controlword, command, .. } = node.image.demand();
        assert_eq!((controlword, command.mode), (Controlword(word), mode), "{reaction:?}");
        assert_eq!((command.stiffness, command.damping), (0.0, 0.0));
        assert_eq!(node.shared.follows(), !reacts, "{reaction:?}");
        // Halt acknowledges it where it is no quick stop; to go on without it does.
        node.receive(0x305, &rpdo2(0x10F, 9, 600));
        node.receive(0x305, &rpdo2(0x0F, 9, 600));
        let word = if reaction == QuickStop { 0x02 } else { 0x0F };
        assert_eq!(node.image.demand().controlword, Controlword(word), "{reaction:?}");
        node.receive(0x305, &rpdo2(0x07, 9, 600));
        node.receive(0x305, &rpdo2(0x0F, 9, 600));
        node.receive(0x305, &rpdo2(0x0F, 9, 601));
        let Demand { controlword, command, .. } = node.image.demand();
        assert_eq!((controlword, command.mode), (follows.controlword, Mode::Velocity), "{reaction:?}");
        assert!(node.shared.follows());
    }
}

#[test]
fn a_joint_that_is_not_asked_to_operate_or_that_leaves_operational_reacts_to_nothing() {
    let mut node = Node::operational();
    node.receive(0x305, &rpdo2(0x07, 9, 0));
    node.image.collide(CollisionReaction::QuickStop);
    node.receive(0x305, &rpdo2(0x0F, 9, 0));
    assert_eq!(node.image.demand().controlword, Controlword(0x0F));
    node.image.collide(CollisionReaction::QuickStop);
    assert_eq!(node.image.demand().controlword, Controlword::QUICK_STOP);
    for command in [0x80, 0x01] {
        node.receive(0, &[command, NODE]);
    }
    node.receive(0x305, &rpdo2(0x0F, 9, 0));
    assert_eq!(node.image.demand().controlword, Controlword(0x0F));
}

#[test]
fn a_joint_whose_set_point_nobody_renews_holds_instead_of_giving_way() {
    for mode in [1, 9] {
        let mut node = Node::operational();
        set_mode(&mut node, mode);
        node.receive(0x305, &rpdo2(0x0F, mode, 0));
        if mode == 9 {
            // A target has come, and the joint is to halt.
            node.receive(0x305, &rpdo2(0x10F, mode, 100));
        }
        node.image.collide(CollisionReaction::Yield);
        assert_eq!(node.image.demand().command.mode, Mode::Hold, "mode {mode}");
    }
}

#[test]
fn a_collision_is_told_with_its_torque_where_something_is_done_about_it() {
    use crate::joint::external_torque::Report;
    let mut node = Node::operational();
    let mut collisions = 0;
    let mut emergency = |node: &mut Node, reaction| {
        collisions += 1;
        node.observed.external[0] = Report { collisions, collided: -12.5, reaction, ..Report::NOTHING };
        node.task().iter().find(|frame| frame.id() == 0x85).map(|frame| *frame.eight().unwrap())
    };
    assert_eq!(emergency(&mut node, CollisionReaction::Off), None);
    let told = [0x04, 0xFF, 0, 0, 0, 0x48, 0xC1, 0];
    assert_eq!(emergency(&mut node, CollisionReaction::Warning), Some(told));
    assert_eq!(node.task(), vec![], "once");
    assert_eq!(emergency(&mut node, CollisionReaction::Yield), Some(told));
    node.observed.external[0].torque = -0.25 * BOARD.joint.limits.torque;
    node.observed.external[0].uncertainty = 0.125 * BOARD.joint.limits.torque;
    let read = [4, 5, 6].map(|sub_index| node.number(0x2203, sub_index));
    assert_eq!(read, [u64::from(-250i16 as u16), 125, 3]);
}

#[test]
fn a_fault_is_reported_with_its_code_and_its_end() {
    let mut node = Node::operational();
    node.observed.latched.set(Fault::OverVoltage, true);
    let emergency =
        |node: &mut Node| node.task().iter().find(|frame| frame.id() == 0x85).map(|frame| *frame.eight().unwrap());
    assert_eq!(emergency(&mut node), Some([0x10, 0x32, 0x05, 4, 8, 0, 0, 0]));
    assert_eq!(emergency(&mut node), None);
    node.observed.latched = crate::joint::fault::Faults::NONE;
    assert_eq!(emergency(&mut node), Some([0; 8]));
    assert_eq!(node.number(0x1003, 1), 0x0804_3210);
}

#[test]
fn the_history_of_a_fault_is_one_domain() {
    use crate::joint::history::Snapshot;
    let mut node = Node::new();
    assert_eq!(node.upload(0x2300, 0), Ok(vec![]));
    let mut history = History::default();
    let mut faults = crate::joint::fault::Faults::NONE;
    faults.set(Fault::OverSpeed, true);
    history.note(Snapshot { position: 1.0, ..Snapshot::default() });
    history.note(Snapshot { state: State::Fault, position: 2.0, bus_voltage: 12.0, faults, ..Snapshot::default() });
    node.objects.program().history = Some(history);
    let bytes = node.upload(0x2300, 0).unwrap();
    assert_eq!(bytes.len(), 64 * STEP);
    let last = &bytes[63 * STEP..];
    assert_eq!((last[0], &last[4..8]), (7, &[0, 1, 0, 0][..]));
    assert_eq!((&last[8..12], &last[32..]), (&2f32.to_le_bytes()[..], &12f32.to_le_bytes()[..]));
    assert_eq!(bytes[62 * STEP + 8..][..4], 1f32.to_le_bytes());
}
