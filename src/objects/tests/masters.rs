//! `docs/masters.md`: the objects that other masters touch, and ours beside them.

use super::documentation::{access, held_to, pdo};
use super::evidence::{Evidence, links};
use super::{IDENTITY, Node};
use crate::objects::table::{Object, communication, described, wants_room};
use canopen_node::Access;
use std::fmt::Write;

const HEAD: &str = "# What other masters touch

The objects that three clients read and write at a drive of CiA 402, and what this joint has there. Read in the sources of ros2_canopen
(`canopen_402_driver` of commit 6ada1969) and python-canopen (2.4.1: `profiles/p402.py`, `pdo/base.py`, `node/remote.py`), and in
what Lely's dcfgen (dcf-tools) makes of a `bus.yml` of ours. The joint's column is made from its object table: a test fails where this
file says anything else, and `UPDATE_DOCS=1 cargo test -p joint-firmware --lib objects` writes it anew. Access as in
[objects.md](objects.md): ro, rw, wo; R may be mapped into RPDOs, T into TPDOs.

From nothing to a moving joint: [with-python-canopen.md](with-python-canopen.md), [with-ros2-canopen.md](with-ros2-canopen.md).

python-canopen and dcfgen are run in the tests, and the joint is configured by what dcfgen makes; node-canopen loads the EDS and drives modes 1, 3, 6 and 8 to 10. ros2_canopen is not run: what it sends is replayed. Its
master, Lely's, could not be had through a package registry: PyPI has the tools alone (dcf-tools), crates.io, npm and Debian 12 nothing of it (PyPI's `lely` is something else). Of its modes the joint has 1 and 3 (profile
position and velocity), 6 (homing) and 8, 9 and 10 (cyclic synchronous position, velocity, torque), and no velocity (2), profile torque (4) or
interpolation (7): 6502h says so, and both masters ask it. ros2_canopen homes in its start-up where 6502h has mode 6, by the method that it
reads from 6098h: 0, as it is at first, is none, and nothing moves. That is done on a joint with a key, too; homing by another method takes its owner's session. In modes 8, 9 and 10 the PDO that carries 607Ah, 60FFh or 6071h has to come within the command deadline: by default RPDO 1, 2 and 1, of ros2_canopen's mapping 1, 2 and 2. None of the three sends the torque offset (60B2h): in torque mode the joint then compensates no more than is certain
([energy-guard.md](energy-guard.md)). Where the target torque bears no gravity, write 60B2h = 0 once operation is enabled.

**Identity.** 1018h has vendor 0, because this project has no vendor ID of CiA: no master can insist on a vendor. Product and revision are those of the board. `jointctl eds --bus BUS --node N` and `bus-yml --bus BUS` write
those of the joint; without a bus they are 0, which masters take for any, because the same file is for every board, and the file says so. The serial number (1018h:4) is no part of an EDS; `bus-yml --bus` writes it.

**Without room.** The B-G431B-ESC1's program goes without WITHOUT_ROOM: without the modes 1, 3 and 6, which 6502h says, and their limits and offsets of a command, the SYNC counter, date and time of the
configuration (by which a master that has configured the joint before finds that it need not again), the load and the external torque, and the log of faults. Bits 10, 11 and 13 of its statusword stay 0.
Of its owner's objects 2215h:5 (challenge), 2215h:7 (response) and the 64 bytes of 2215h:6 (another key) are refused, and 2215h:8 (session time left) stays 0: its button takes the place of sessions ([boards.md](boards.md)).

**LSS errors of the manufacturer's** (255): 1 while the motor is on or turns, 2 where a node id is stored for the owner alone.

| object | name | master | what for | joint | shown by |
|---|---|---|---|---|---|
";

/// An object that a master touches.
struct Touched {
    object: (u16, u8),
    name: &'static str,
    master: &'static str,
    what_for: &'static str,
    /// `true` if it is written.
    written: bool,
    /// Reason for which the joint has none; empty where it has it.
    missing: &'static str,
    /// Evidence for it.
    tests: &'static [Evidence],
}

const fn touched(
    object: (u16, u8),
    name: &'static str,
    master: &'static str,
    what_for: &'static str,
    written: bool,
    missing: &'static str,
    tests: &'static [Evidence],
) -> Touched {
    Touched { object, name, master, what_for, written, missing, tests }
}

const ALL: &str = "all";
const ROS2: &str = "ros2_canopen";
const PYTHON: &str = "python-canopen";

const CONFORMANCE: Evidence = ("tools/node/tests/python_canopen.rs", "python_canopen_can_do_everything_with_the_joint");
const PROFILE: Evidence = (
    "tools/node/tests/python_canopen.rs",
    "python_canopens_profile_402_enables_and_moves_the_joint_with_the_default_pdos",
);
const DCFGEN: Evidence =
    ("tools/jointctl/tests/how_to.rs", "the_page_on_ros2_canopen_leads_to_a_masters_configuration");
const SEQUENCE: Evidence = (
    "tools/node/tests/other_masters.rs",
    "the_sequence_of_ros2_canopens_402_driver_moves_nothing_before_the_first_target",
);
const HOMING: Evidence =
    ("tools/node/tests/profile_modes.rs", "homing_to_an_index_goes_to_the_next_one_below_or_above");
const HEARTBEAT: Evidence =
    ("tools/plant/tests/joint/heartbeat.rs", "a_heartbeat_counts_as_lost_after_the_time_of_1016h_and_not_before");
const BEHAVIOUR: Evidence =
    ("tools/plant/tests/joint/heartbeat.rs", "a_lost_heartbeat_stops_nothing_where_1029h_says_so");
const IDENTIFIED: Evidence = ("src/objects/tests/masters.rs", "a_masters_first_questions_are_answered");
const ABSENT: Evidence = ("src/objects/tests/masters.rs", "what_the_page_says_is_none_is_no_object");
const NO_MODE: Evidence = ("src/objects/tests/process_data.rs", "a_mode_that_does_not_exist_changes_nothing");
const BOTH: &str = "ros2_canopen, python-canopen";
const DCF: &str = "dcfgen";
/// dcfgen writes what Lely's master compares with the answer when the joint boots.
const BOOT: &str = "dcfgen, ros2_canopen";

const TOUCHED: [Touched; 41] = [
    touched((0x1000, 0), "device type", BOOT, "compared at boot-up", false, "", &[IDENTIFIED]),
    touched((0x100C, 0), "guard time", DCF, "`guard_time`", true, "heartbeats take its place", &[ABSENT]),
    touched((0x100D, 0), "life time factor", DCF, "`life_time_factor`", true, "heartbeats take its place", &[ABSENT]),
    touched((0x1010, 1), "store parameters", PYTHON, "`store()`", true, "", &[CONFORMANCE]),
    touched(
        (0x1011, 1),
        "restore parameters",
        "python-canopen, dcfgen",
        "`restore()`, `restore_configuration`",
        true,
        "",
        &[CONFORMANCE],
    ),
    touched((0x1012, 0), "COB-ID TIME", DCF, "`time_cob_id`", true, "no clock is set by the bus", &[ABSENT]),
    touched((0x1016, 1), "consumer heartbeat time", DCF, "`heartbeat_consumer`", true, "", &[DCFGEN, HEARTBEAT]),
    touched((0x1017, 0), "producer heartbeat time", DCF, "`heartbeat_producer`", true, "", &[DCFGEN, CONFORMANCE]),
    touched((0x1018, 1), "vendor", BOOT, "compared at boot-up where bus.yml has one", false, "", &[IDENTIFIED]),
    touched((0x1018, 2), "product", BOOT, "likewise", false, "", &[IDENTIFIED]),
    touched((0x1018, 3), "revision", BOOT, "likewise", false, "", &[IDENTIFIED]),
    touched((0x1018, 4), "serial number", BOOT, "likewise", false, "", &[IDENTIFIED]),
    touched((0x1021, 0), "store EDS", PYTHON, "`upload_eds`", false, "`jointctl eds` writes it", &[ABSENT]),
    touched((0x1029, 1), "communication error", DCF, "`error_behavior`", true, "", &[BEHAVIOUR]),
    touched((0x1400, 1), "COB-ID of an RPDO", ALL, "off while it is mapped, and on", true, "", &[DCFGEN, CONFORMANCE]),
    touched((0x1400, 2), "type of an RPDO", ALL, "", true, "", &[DCFGEN, CONFORMANCE]),
    touched((0x1600, 0), "mapping of an RPDO", ALL, "none, entries, how many", true, "", &[DCFGEN, CONFORMANCE]),
    touched((0x1800, 1), "COB-ID of a TPDO", ALL, "off while it is mapped, and on", true, "", &[DCFGEN, CONFORMANCE]),
    touched((0x1800, 2), "type of a TPDO", ALL, "", true, "", &[DCFGEN, CONFORMANCE]),
    touched((0x1800, 3), "inhibit time", PYTHON, "types 254 and 255", true, "", &[CONFORMANCE]),
    touched((0x1800, 5), "event timer", PYTHON, "types 254 and 255", true, "", &[CONFORMANCE]),
    touched((0x1800, 6), "SYNC start value", PYTHON, "types 1 to 240", true, "", &[CONFORMANCE]),
    touched((0x1A00, 0), "mapping of a TPDO", ALL, "none, entries, how many", true, "", &[DCFGEN, CONFORMANCE]),
    touched(
        (0x1F56, 1),
        "program software identification",
        DCF,
        "`software_version`",
        false,
        "images are no programs",
        &[ABSENT],
    ),
    touched((0x6040, 0), "controlword", BOTH, "every transition", true, "", &[SEQUENCE, PROFILE]),
    touched((0x6041, 0), "statusword", BOTH, "every transition", false, "", &[SEQUENCE, PROFILE]),
    touched((0x6042, 0), "vl target velocity", ROS2, "mode 2", true, "velocity is mode 3 or 9", &[NO_MODE]),
    touched((0x6060, 0), "modes of operation", BOTH, "", true, "", &[SEQUENCE, PROFILE]),
    touched((0x6061, 0), "modes of operation display", BOTH, "", false, "", &[SEQUENCE, PROFILE]),
    touched((0x6064, 0), "position actual value", ROS2, "state of the joint", false, "", &[DCFGEN, PROFILE]),
    touched((0x606C, 0), "velocity actual value", ROS2, "state of the joint", false, "", &[DCFGEN, PROFILE]),
    touched((0x6071, 0), "target torque", BOTH, "modes 4 and 10", true, "", &[DCFGEN, PROFILE]),
    touched(
        (0x6077, 0),
        "torque actual value",
        ROS2,
        "state of the joint; it does without",
        false,
        "",
        &[DCFGEN, CONFORMANCE],
    ),
    touched((0x607A, 0), "target position", BOTH, "modes 1 and 8", true, "", &[SEQUENCE, PROFILE]),
    touched((0x6098, 0), "homing method", BOTH, "mode 6", true, "", &[PROFILE]),
    touched((0x6099, 1), "homing speed to a switch", PYTHON, "mode 6", true, "", &[HOMING]),
    touched((0x6099, 2), "homing speed to the zero", PYTHON, "mode 6", true, "", &[HOMING]),
    touched((0x609A, 0), "homing acceleration", PYTHON, "mode 6", true, "", &[HOMING]),
    touched((0x60C1, 1), "interpolation data record", ROS2, "mode 7", true, "the master interpolates", &[NO_MODE]),
    touched((0x60FF, 0), "target velocity", BOTH, "modes 3 and 9", true, "", &[DCFGEN, PROFILE]),
    touched((0x6502, 0), "supported drive modes", BOTH, "before a mode is chosen", false, "", &[PROFILE, IDENTIFIED]),
];

fn ours((index, sub_index): (u16, u8)) -> Option<&'static Object> {
    let all = described().chain(communication()).map(|(object, _)| object);
    all.into_iter().find(|object| (object.index, object.sub_index) == (index, sub_index))
}

/// Objects that a program without room does not have: `a to b` where the joint has nothing else between them.
fn without_room() -> String {
    let mut all: Vec<&Object> = described().chain(communication()).map(|(object, _)| object).collect();
    all.sort_by_key(|object| (object.index, object.sub_index));
    let (mut words, mut run) = (Vec::new(), Vec::new());
    let tell = |run: &mut Vec<u16>, words: &mut Vec<String>| {
        match run[..] {
            [first, _, .., last] => words.push(format!("{first:04X}h to {last:04X}h")),
            _ => words.extend(run.iter().map(|index| format!("{index:04X}h"))),
        }
        run.clear();
    };
    for record in all.chunk_by(|a, b| a.index == b.index) {
        let wanting: Vec<&Object> = record.iter().copied().filter(|object| wants_room(object)).collect();
        if wanting.len() == record.len() {
            run.push(record[0].index);
            continue;
        }
        tell(&mut run, &mut words);
        words.extend(wanting.iter().map(|object| format!("{:04X}h:{}", object.index, object.sub_index)));
    }
    tell(&mut run, &mut words);
    words.join(", ")
}

#[test]
fn every_object_that_a_master_touches_is_there_and_takes_what_it_writes_or_the_page_says_why_not() {
    let without_room = without_room();
    let boards = include_str!("../../../docs/boards.md");
    assert!(boards.contains(&without_room), "docs/boards.md has another list than: {without_room}");
    let mut text = HEAD.replace("WITHOUT_ROOM", &without_room);
    for Touched { object, name, master, what_for, written, missing, tests } in TOUCHED {
        assert!(!tests.is_empty(), "{name} is not tested");
        let joint = match ours(object) {
            Some(ours) => {
                assert!(missing.is_empty(), "{name}: {missing}");
                assert!(!written || ours.access != Access::ReadOnly, "{name} is written");
                assert!(written || ours.access != Access::WriteOnly, "{name} is read");
                format!("{} {} {}", ours.data_type.name(), access(ours), pdo(ours)).trim_end().to_owned()
            }
            None => {
                assert!(!missing.is_empty(), "{name} is missing");
                format!("none: {missing}")
            }
        };
        let (index, sub_index) = object;
        writeln!(text, "| {index:04X}h:{sub_index} | {name} | {master} | {what_for} | {joint} | {} |", links(tests))
            .unwrap();
    }
    held_to("docs/masters.md", &text);
}

#[test]
fn what_the_page_says_is_none_is_no_object() {
    const NO_OBJECT: u32 = 0x0602_0000;
    let mut node = Node::operational();
    let none: Vec<&Touched> = TOUCHED.iter().filter(|touched| !touched.missing.is_empty()).collect();
    assert!(none.len() > 4, "{}", none.len());
    for Touched { object: (index, sub_index), name, .. } in none {
        assert_eq!(node.upload(*index, *sub_index), Err(NO_OBJECT), "{name}");
    }
}

#[test]
fn a_masters_first_questions_are_answered() {
    let mut node = Node::operational();
    assert_eq!(node.number(0x1000, 0), u64::from(IDENTITY.device_type));
    let identity = [IDENTITY.vendor, IDENTITY.product, IDENTITY.revision, IDENTITY.serial];
    assert_eq!([1, 2, 3, 4].map(|sub_index| node.number(0x1018, sub_index)), identity.map(u64::from));
    // Modes 1, 3, 6 and 8 to 10, and two of the manufacturer's.
    assert_eq!(node.number(0x6502, 0), 0b11 << 16 | 0b11_1010_0101);
}
