//! An arm on a bus, in real time: the lines of docs/robot.md as they stand, and what compensation brings.
//!
//! `cargo bench -p jointctl --bench arm` runs them on a bus of its own and fails where the position error along a
//! motion that the fit has not seen becomes less than [`LEAST`] times smaller.

use std::process::{Child, Command, Stdio};

const PAGE: &str = include_str!("../../../docs/robot.md");
const BUS: &str = "udp:239.74.163.2:43113";
/// Least factor by which the position error falls.
const LEAST: f64 = 5.0;

/// The arm, until this is dropped.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn main() {
    // Cargo passes `--bench`; tests, which pass nothing, have no minute for it.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let bus = format!("udp:239.74.163.2:{}", bus::free_port().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    std::os::unix::fs::symlink(format!("{root}/tools"), folder.path().join("tools")).unwrap();
    let (_, lines) = PAGE.split_once("## An arm on a bus").unwrap();
    let lines = lines.split("```").nth(1).unwrap().lines().filter_map(|line| line.strip_prefix("jointctl "));
    let mut arm = None;
    let mut last = String::new();
    for line in lines {
        let words = line.split('#').next().unwrap().trim().replace(BUS, &bus);
        println!("jointctl {words}");
        let mut command = Command::new(env!("CARGO_BIN_EXE_jointctl"));
        command.args(words.split(' ')).current_dir(folder.path()).env("JOINTCTL_BUS", &bus);
        if words.starts_with("sim ") {
            arm = Some(Running(command.stderr(Stdio::null()).spawn().unwrap()));
            continue;
        }
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        last = String::from_utf8(output.stdout).unwrap();
    }
    print!("{last}");
    assert!(arm.is_some(), "no line runs the arm");
    let told = last.lines().find_map(|line| line.strip_prefix("compensation: position error ")).unwrap();
    let factor: f64 = told.split(' ').next().unwrap().parse().unwrap();
    assert!(factor >= LEAST, "{factor} times smaller, at least {LEAST} are promised");
}
