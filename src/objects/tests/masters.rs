//! `docs/masters.md`: the objects that other masters touch, and ours beside them.

use super::documentation::{access, held_to, pdo};
use crate::canopen::Access;
use crate::objects::table::{Object, communication, described};
use std::fmt::Write;

const HEAD: &str = "# What other masters touch

The objects that three clients read and write at a drive of CiA 402, and what this joint has there. Read in the sources of ros2_canopen
(`canopen_402_driver` of commit 6ada1969) and python-canopen (2.4.1: `profiles/p402.py`, `pdo/base.py`, `node/remote.py`), and in
what Lely's dcfgen (dcf-tools) makes of a `bus.yml` of ours. The joint's column is made from its object table: a test fails where this
file says anything else, and `UPDATE_DOCS=1 cargo test -p joint-firmware --lib objects` writes it anew. Access as in
[objects.md](objects.md): ro, rw, wo; R may be mapped into RPDOs, T into TPDOs.

python-canopen and dcfgen are run in the tests. ros2_canopen is not: what it sends is replayed. Of its modes the joint has 1 and 3 (profile
position and velocity), 6 (homing) and 8, 9 and 10 (cyclic synchronous position, velocity, torque), and no velocity (2), profile torque (4) or
interpolation (7): 6502h says so, and both masters ask it. The B-G431B-ESC1's program has no room for 1, 3 and 6 and their objects: 6062h, 6065h to
6068h, 606Dh, 606Fh, 6072h, 6075h, 6078h, 6079h, 607Ch to 609Ah, 60B0h, 60B1h and 60F4h. ros2_canopen homes in its start-up where 6502h has mode 6, by the method that it
reads from 6098h: 0, as it is at first, is none, and nothing moves. None of the three sends the torque offset (60B2h): in torque mode the joint then compensates no more than is certain
([energy-guard.md](energy-guard.md)). Where the target torque bears no gravity, write 60B2h = 0 once operation is enabled.

| object | name | master | what for | joint |
|---|---|---|---|---|
";

/// An object that a master touches.
struct Touched {
    object: (u16, u8),
    name: &'static str,
    master: &'static str,
    what_for: &'static str,
    /// Whether it is written.
    written: bool,
    /// Why the joint has none; empty where it has it.
    missing: &'static str,
}

const fn touched(
    object: (u16, u8),
    name: &'static str,
    master: &'static str,
    what_for: &'static str,
    written: bool,
    missing: &'static str,
) -> Touched {
    Touched { object, name, master, what_for, written, missing }
}

const ALL: &str = "all";
const ROS2: &str = "ros2_canopen";
const PYTHON: &str = "python-canopen";
const BOTH: &str = "ros2_canopen, python-canopen";

const TOUCHED: [Touched; 28] = [
    touched((0x1010, 1), "store parameters", PYTHON, "`store()`", true, ""),
    touched((0x1011, 1), "restore parameters", PYTHON, "`restore()`", true, ""),
    touched((0x1017, 0), "producer heartbeat time", "dcfgen", "`heartbeat_producer`", true, ""),
    touched((0x1400, 1), "COB-ID of an RPDO", ALL, "off while it is mapped, and on", true, ""),
    touched((0x1400, 2), "type of an RPDO", ALL, "", true, ""),
    touched((0x1600, 0), "mapping of an RPDO", ALL, "none, entries, how many", true, ""),
    touched((0x1800, 1), "COB-ID of a TPDO", ALL, "off while it is mapped, and on", true, ""),
    touched((0x1800, 2), "type of a TPDO", ALL, "", true, ""),
    touched((0x1800, 3), "inhibit time", PYTHON, "types 254 and 255", true, ""),
    touched((0x1800, 5), "event timer", PYTHON, "types 254 and 255", true, ""),
    touched((0x1800, 6), "SYNC start value", PYTHON, "types 254 and 255; it does without", false, "0 by definition"),
    touched((0x1A00, 0), "mapping of a TPDO", ALL, "none, entries, how many", true, ""),
    touched((0x6040, 0), "controlword", BOTH, "every transition", true, ""),
    touched((0x6041, 0), "statusword", BOTH, "every transition", false, ""),
    touched((0x6042, 0), "vl target velocity", ROS2, "mode 2", true, "velocity is mode 3 or 9"),
    touched((0x6060, 0), "modes of operation", BOTH, "", true, ""),
    touched((0x6061, 0), "modes of operation display", BOTH, "", false, ""),
    touched((0x6064, 0), "position actual value", ROS2, "state of the joint", false, ""),
    touched((0x606C, 0), "velocity actual value", ROS2, "state of the joint", false, ""),
    touched((0x6071, 0), "target torque", BOTH, "modes 4 and 10", true, ""),
    touched((0x6077, 0), "torque actual value", ROS2, "state of the joint; it does without", false, ""),
    touched((0x607A, 0), "target position", BOTH, "modes 1 and 8", true, ""),
    touched((0x6098, 0), "homing method", BOTH, "mode 6", true, ""),
    touched((0x6099, 1), "homing speed to a switch", PYTHON, "mode 6", true, ""),
    touched((0x6099, 2), "homing speed to the zero", PYTHON, "mode 6", true, ""),
    touched((0x609A, 0), "homing acceleration", PYTHON, "mode 6", true, ""),
    touched((0x60C1, 1), "interpolation data record", ROS2, "mode 7", true, "the master interpolates"),
    touched((0x60FF, 0), "target velocity", BOTH, "modes 3 and 9", true, ""),
];

fn ours((index, sub_index): (u16, u8)) -> Option<&'static Object> {
    let all = described().chain(communication()).map(|(object, _)| object);
    all.into_iter().find(|object| (object.index, object.sub_index) == (index, sub_index))
}

#[test]
fn every_object_that_a_master_touches_is_there_and_takes_what_it_writes_or_the_page_says_why_not() {
    let mut text = HEAD.to_owned();
    for Touched { object, name, master, what_for, written, missing } in TOUCHED {
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
        writeln!(text, "| {index:04X}h:{sub_index} | {name} | {master} | {what_for} | {joint} |").unwrap();
    }
    held_to("docs/masters.md", &text);
}
