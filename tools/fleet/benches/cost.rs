//! Cost of a fleet's night against its size: 10, 100 and 1,000 joints over 30 days, ten seconds of motion in rows
//! of 4 ms a day, made by the plant. `cargo bench -p fleet --bench cost` prints time, rows a second, the peak of the
//! memory and bytes on disk; it takes minutes and 3 GB. `FLEET_JOINTS=100` stops at 100.

#[path = "../tests/fleet_of_joints/mod.rs"]
mod fleet_of_joints;

use fleet::finding::{Kind, findings};
use fleet::night::{Scope, night};
use std::fs;
use std::path::Path;
use std::time::Instant;

const DAYS: usize = 30;
/// Rows of a day.
const ROWS: usize = 2_500;

fn main() {
    // Cargo passes `--bench`; tests, which pass nothing, have no minutes for it.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let most = std::env::var("FLEET_JOINTS").ok().and_then(|text| text.parse().ok()).unwrap_or(1_000);
    println!("joints   days       rows  made, s  sums, s  rows/s  peak, MB  again, s  findings, s  data, MB  sums, MB");
    for joints in [10, 100, 1_000].into_iter().filter(|joints| *joints <= most) {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
        let timed = Instant::now();
        fleet_of_joints::write_days(folder.path(), &(0..joints).collect::<Vec<_>>(), DAYS);
        let made = timed.elapsed().as_secs_f64();
        // The peak that the system counts begins anew (proc(5), clear_refs).
        let _ = fs::write("/proc/self/clear_refs", "5");
        let timed = Instant::now();
        let first = night(folder.path(), &Scope::default(), 0, &|| true).unwrap();
        let summed = timed.elapsed().as_secs_f64();
        let peak = peak();
        let timed = Instant::now();
        let again = night(folder.path(), &Scope::default(), 0, &|| true).unwrap();
        let known = timed.elapsed().as_secs_f64();
        let timed = Instant::now();
        let found = findings(&again.entries);
        let judged = timed.elapsed().as_secs_f64();
        let rows = first.entries.len() * ROWS;
        let (sums, all) = (bytes(&folder.path().join("_sums")), bytes(folder.path()));
        println!(
            "{joints:>6}{:>7}{rows:>11}{made:>9.1}{summed:>9.2}{:>7.1}M{peak:>10}{known:>10.2}{judged:>13.3}{:>10.0}{:>10.1}",
            first.entries.len(),
            1e-6 * rows as f64 / summed,
            1e-6 * (all - sums) as f64,
            1e-6 * sums as f64
        );
        let named: Vec<String> = found
            .iter()
            .filter(|joint| joint.kind != Kind::Healthy)
            .map(|joint| format!("{} {}", joint.joint, joint.kind.words()))
            .collect();
        println!("        {} findings: {}", named.len(), named.join(", "));
    }
}

/// Peak of this process' memory, MB.
fn peak() -> String {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<f64>().ok());
    kilobytes.map_or("-".into(), |kilobytes| format!("{:.0}", kilobytes / 1_024.0))
}

fn bytes(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.map(|path| if path.is_dir() { bytes(&path) } else { path.metadata().unwrap().len() }).sum()
}
