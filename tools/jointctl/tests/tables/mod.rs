//! Every command that prints a table as JSON where that is asked for.

use std::process::Output;

/// Commands without a bus, each with what the ones before it wrote.
#[allow(dead_code, reason = "of two tests each runs one half")]
pub const WITHOUT_BUS: [&str; 12] = [
    "demo --samples 2000 --restarts 1 --patience 5 --json",
    "fit demo/dataset.toml --trainer none --json",
    "evaluate demo/friction.img demo/dataset.toml --json",
    "image inspect demo/friction.img --json",
    "image verify demo/friction.img --json",
    "sim --scenario slow-reversal --json",
    "excite --out motion.csv --json",
    "excite --check motion.csv --json",
    "robot excite robot.toml --out motion --acceleration 5 --draws 4 --rounds 1 --duration 8 --json",
    "robot fit recording.toml --out arm --preset coulomb-viscous --network never --json",
    "robot evaluate arm recording.toml --json",
    "get --list --json",
];

/// Command that finds joints which have no node id.
#[allow(dead_code, reason = "of two tests each runs one half")]
pub const ADDRESS: &str = "address --json --first 9 --wait 100";

/// Commands of a joint on a bus.
#[allow(dead_code, reason = "of two tests each runs one half")]
pub const OF_A_JOINT: [&str; 6] = [
    "get limits --json",
    "info --json",
    "monitor --once --json",
    "retrain --duration 5 --validation 4 --restarts 0 --json",
    "scan --json",
    "set gain 0.5 2100:1 2 --json",
];

/// Command that commissions a joint, with as little motion as there can be.
#[allow(dead_code, reason = "of two tests each runs one half")]
pub const COMMISSION: &str = "commission --current 8 --travel 0.4 --no-turn --yes --json";

/// An arm moved without compensation and with it, where its description and a motion are in the folder.
#[allow(dead_code, reason = "of two tests each runs one half")]
pub const ROBOT_MOVE: &str = "robot move robot.toml --motion motion --rate 100 --compare --out recorded --json";

/// Commands of a fleet, each with what the ones before it wrote.
#[allow(dead_code, reason = "of two tests each runs one half")]
pub const OF_A_FLEET: [&str; 4] = [
    "fleet sums fleet --json",
    "fleet status fleet --json",
    "fleet retrain fleet --out new --preset coulomb-viscous --key fleet.key --json",
    "fleet images fleet --json",
];

/// Panics where `line` failed, or printed anything but one JSON value that holds something.
#[allow(dead_code, reason = "of three tests one has tables of its own")]
pub fn assert_is_table(line: &str, output: &Output) {
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    let value = serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap_or_else(|error| {
        panic!("{line}: {error} in {}", String::from_utf8_lossy(&output.stdout));
    });
    assert!(value.as_object().is_none_or(|object| !object.is_empty()), "{line}: {value}");
    assert!(value.as_array().is_none_or(|array| !array.is_empty()), "{line}: {value}");
}
