//! `docs/masters.md`: the objects that other masters touch, and ours beside them.

use super::documentation::{access, held_to, pdo};
use super::evidence::{Evidence, links};
use crate::objects::table::{Object, communication, described};
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
interpolation (7): 6502h says so, and both masters ask it. The B-G431B-ESC1's program has no room for 1, 3 and 6 and their objects: 6062h, 6065h to
6068h, 606Dh, 606Fh, 6072h, 6075h, 6078h, 6079h, 607Ch to 609Ah, 60B0h, 60B1h, 60C2h and 60F4h; nor for bits 10, 11 and 13 of the statusword, with 11 a target that is clipped; nor for the SYNC counter (1019h, 1800h:6) and date and time of the configuration
(1020h, by which a master that has configured the joint before finds that it need not again), nor for the load and the external torque (2202h, 2203h). ros2_canopen homes in its start-up where 6502h has mode 6, by the method that it
reads from 6098h: 0, as it is at first, is none, and nothing moves. That is done on a joint with a key, too; homing by another method takes its owner's session. In modes 8, 9 and 10 the PDO that carries 607Ah, 60FFh or 6071h has to come within the command deadline: by default RPDO 1, 2 and 1, of ros2_canopen's mapping 1, 2 and 2. None of the three sends the torque offset (60B2h): in torque mode the joint then compensates no more than is certain
([energy-guard.md](energy-guard.md)). Where the target torque bears no gravity, write 60B2h = 0 once operation is enabled.

**Identity.** 1018h has vendor 0, because this project has no vendor ID of CiA: no master can insist on a vendor. Product and revision are those of the board. `jointctl eds --bus BUS --node N` and `bus-yml --bus BUS` write
those of the joint; without a bus they are 0, which masters take for any, because the same file is for every board, and the file says so. The serial number (1018h:4) is no part of an EDS; `bus-yml --bus` writes it.

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
const NO_MODE: Evidence = ("src/objects/tests/process_data.rs", "a_mode_that_does_not_exist_changes_nothing");
const BOTH: &str = "ros2_canopen, python-canopen";

const TOUCHED: [Touched; 28] = [
    touched((0x1010, 1), "store parameters", PYTHON, "`store()`", true, "", &[CONFORMANCE]),
    touched((0x1011, 1), "restore parameters", PYTHON, "`restore()`", true, "", &[CONFORMANCE]),
    touched((0x1017, 0), "producer heartbeat time", "dcfgen", "`heartbeat_producer`", true, "", &[DCFGEN, CONFORMANCE]),
    touched((0x1400, 1), "COB-ID of an RPDO", ALL, "off while it is mapped, and on", true, "", &[DCFGEN, CONFORMANCE]),
    touched((0x1400, 2), "type of an RPDO", ALL, "", true, "", &[DCFGEN, CONFORMANCE]),
    touched((0x1600, 0), "mapping of an RPDO", ALL, "none, entries, how many", true, "", &[DCFGEN, CONFORMANCE]),
    touched((0x1800, 1), "COB-ID of a TPDO", ALL, "off while it is mapped, and on", true, "", &[DCFGEN, CONFORMANCE]),
    touched((0x1800, 2), "type of a TPDO", ALL, "", true, "", &[DCFGEN, CONFORMANCE]),
    touched((0x1800, 3), "inhibit time", PYTHON, "types 254 and 255", true, "", &[CONFORMANCE]),
    touched((0x1800, 5), "event timer", PYTHON, "types 254 and 255", true, "", &[CONFORMANCE]),
    touched((0x1800, 6), "SYNC start value", PYTHON, "types 254 and 255", true, "", &[CONFORMANCE]),
    touched((0x1A00, 0), "mapping of a TPDO", ALL, "none, entries, how many", true, "", &[DCFGEN, CONFORMANCE]),
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
];

fn ours((index, sub_index): (u16, u8)) -> Option<&'static Object> {
    let all = described().chain(communication()).map(|(object, _)| object);
    all.into_iter().find(|object| (object.index, object.sub_index) == (index, sub_index))
}

#[test]
fn every_object_that_a_master_touches_is_there_and_takes_what_it_writes_or_the_page_says_why_not() {
    let mut text = HEAD.to_owned();
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
