//! A fleet's night against its size: 10, 100 and 1,000 joints over 30 days, ten seconds of motion in rows of 4 ms a
//! day, made by the plant.
//!
//! `cargo bench -p jointctl --features logs --bench fleet` prints what the commands take, and fails where a joint that
//! is broken or wrongly configured is not named, or where fewer than 95 % of the joints that drifted get a better
//! image. `FLEET_JOINTS=100` stops at 100.

#[path = "../../fleet/tests/fleet_of_joints/mod.rs"]
mod fleet_of_joints;

use fleet_of_joints::{JOINTS, joint};
use serde_json::Value;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const DAYS: usize = 30;
/// Rows of a day.
const ROWS: usize = 2_500;
/// Joints with a broken part, and with a wrong torque constant or sign, as far as the fleet has them.
const BROKEN: [usize; 5] = [29, 69, 109, 149, 189];
const WRONG: [usize; 3] = [35, 37, 77];
/// Joints whose friction changes, of every forty.
const DRIFTED: [usize; 4] = [5, 11, 17, 23];
/// Largest part of all joints that may be named so and are not.
const FALSE: f64 = 0.005;
/// Least part of the joints that drifted whose new image has to be better.
const LEAST: f64 = 0.95;

fn main() {
    // Cargo passes `--bench`; tests, which pass nothing, have no minutes for it.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let most = std::env::var("FLEET_JOINTS").ok().and_then(|text| text.parse().ok()).unwrap_or(1_000);
    for joints in [10, 100, 1_000].into_iter().filter(|joints| *joints <= most) {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
        of(joints, folder.path());
    }
}

/// A night of a fleet of this size.
fn of(joints: usize, folder: &Path) {
    let fleet = folder.join("fleet");
    let timed = Instant::now();
    fleet_of_joints::write_days(&fleet, &(0..joints).collect::<Vec<_>>(), DAYS);
    let rows = joints * DAYS * ROWS;
    let made = timed.elapsed().as_secs_f64();
    println!("{joints} joints, {DAYS} days, {rows} rows of {:.0} MB, made in {made:.0} s", 1e-6 * bytes(&fleet));
    let sums = run(folder, "sums", &["sums", "fleet", "--json"]);
    println!(
        "  {:.1} million rows/s, {:.1} MB of sums",
        1e-6 * rows as f64 / sums.seconds,
        1e-6 * bytes(&fleet.join("_sums"))
    );
    run(folder, "sums again", &["sums", "fleet", "--json"]);
    let found = run(folder, "status", &["status", "fleet", "--stored", "--page", "fleet.html", "--json"]).output;
    let kind = |number: usize| {
        let findings = found["joints"].as_array().unwrap();
        findings.iter().find(|finding| finding["joint"] == joint(number)).unwrap()["kind"].clone()
    };
    let named = |numbers: &[usize], words: &str| {
        numbers.iter().filter(|number| **number < joints).for_each(|number| {
            println!("  {}: {}", joint(*number), kind(*number));
            assert_eq!(kind(*number), words, "{}", joint(*number));
        });
    };
    named(&BROKEN, "broken");
    named(&WRONG, "wrong-configuration");
    let drifted: Vec<String> = (0..joints).filter(|number| DRIFTED.contains(&(number % JOINTS))).map(joint).collect();
    let changed = |finding: &&Value| finding["kind"] == "drifted" || finding["kind"] == "friction-fell";
    let findings = found["joints"].as_array().unwrap();
    let of_others =
        findings.iter().filter(changed).filter(|found| !drifted.iter().any(|name| found["joint"] == **name));
    println!("  drifted: {} joints, and {} of the others are said to have", drifted.len(), of_others.count());
    let damaged: Vec<String> = BROKEN.into_iter().chain(WRONG).map(joint).collect();
    let wrongly = findings.iter().filter(|found| found["kind"] == "broken" || found["kind"] == "wrong-configuration");
    let wrongly = wrongly.filter(|found| !damaged.iter().any(|name| found["joint"] == **name));
    let wrongly: Vec<&Value> = wrongly.map(|found| &found["joint"]).collect();
    println!("  said to be broken or wrongly configured, and not: {} joints {wrongly:?}", wrongly.len());
    assert!(wrongly.len() as f64 <= FALSE * joints as f64, "{wrongly:?}");
    let retrain = ["retrain", "fleet", "--out", "new", "--preset", "coulomb-viscous", "--stored", "--json"];
    let outcomes = run(folder, "retrain", &retrain).output;
    let outcomes = outcomes["joints"].as_array().unwrap();
    let better = |name: &&String| {
        let found = outcomes.iter().find(|outcome| outcome["joint"] == ***name);
        found.is_some_and(|found| found["after_nm"].as_f64() < found["before_nm"].as_f64() && found["kept"] == true)
    };
    let kept = drifted.iter().filter(better).count();
    println!("  better images: {kept} of {} joints that drifted", drifted.len());
    for name in drifted.iter().filter(|name| !better(name)) {
        let found = findings.iter().find(|finding| finding["joint"] == **name);
        println!("    not {name}: {}", found.unwrap_or(&Value::Null)["change"]);
    }
    // Small fleets: one that is missing is more than a twentieth of ten.
    assert!(kept as f64 >= (LEAST * drifted.len() as f64).floor(), "{outcomes:?}");
    for outcome in outcomes.iter().filter(|outcome| outcome["kept"] == true) {
        assert!(outcome["after_nm"].as_f64() < outcome["before_nm"].as_f64(), "{outcome}");
    }
}

/// Time of a command, and its JSON.
struct Took {
    seconds: f64,
    output: Value,
}

/// Runs `jointctl fleet` and prints time and peak of its memory.
fn run(folder: &Path, name: &str, arguments: &[&str]) -> Took {
    let timed = Instant::now();
    let mut command = Command::new(env!("CARGO_BIN_EXE_jointctl"));
    command.current_dir(folder).arg("fleet").args(arguments).stderr(Stdio::null());
    let place = folder.join("output.json");
    let mut child = command.stdout(File::create(&place).unwrap()).spawn().unwrap();
    let mut peak = 0.0;
    let status = loop {
        peak = f64::max(peak, memory(child.id()));
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let seconds = timed.elapsed().as_secs_f64();
    println!("  {name}: {seconds:.2} s, at most {peak:.0} MB");
    assert!(status.success(), "{arguments:?}");
    Took { seconds, output: serde_json::from_slice(&fs::read(place).unwrap()).unwrap() }
}

/// Peak of a process' memory so far (proc(5), VmHWM), MB; 0 where it is not known.
fn memory(process: u32) -> f64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<f64>().ok());
    kilobytes.unwrap_or(0.0) / 1_024.0
}

fn bytes(folder: &Path) -> f64 {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.map(|path| if path.is_dir() { bytes(&path) } else { path.metadata().unwrap().len() as f64 }).sum()
}
