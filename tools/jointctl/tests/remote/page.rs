//! docs/on-the-bus.md and docs/ownership.md, line by line as they stand.

use crate::punctual;
use crate::served::{DEADLINE, NODE, Running, Served, image, program};
use crate::shown::{ON_THE_BUS, OWNERSHIP, lines};
use std::io::{BufRead, BufReader};
use std::process::{Output, Stdio};

/// The bus of the page; here each run has a port of its own.
const BUS: &str = "udp:239.74.163.2:43113";
const PROGRAM: &str = "cargo run --release -p jointctl --";
/// Beginnings of lines that others run: python-canopen's are those of `python_canopen.rs`, boards' programs those of
/// `unboxing.rs`.
const ELSEWHERE: [&str; 6] = [
    "pip install canopen",
    "python3 tools/node/examples/drive.py",
    "BOARD=",
    "cargo --config .cargo/$BOARD.toml build",
    "jointctl sim --elf",
    "jointctl address",
];

fn assert_done(line: &str, output: &Output) {
    let told = [&output.stdout[..], &output.stderr].map(String::from_utf8_lossy).concat();
    assert!(output.status.success(), "{line}: {}\n{told}", output.status);
}

pub fn the_page_on_the_bus_runs_line_by_line() {
    let port = bus::free_port().unwrap();
    let bus = format!("udp:239.74.163.2:{port}");
    let folder = tempfile::tempdir().unwrap();
    // Files that `demo` would have written.
    std::fs::create_dir(folder.path().join("demo")).unwrap();
    std::fs::write(folder.path().join("demo/friction.img"), image(1, 0.25, 0)).unwrap();
    let command = |line: &str| {
        let mut command = program();
        command.current_dir(&folder).args(line.split_whitespace()).stdin(Stdio::null());
        command
    };
    let (mut served, mut run) = (None::<Running>, Vec::new());
    for line in lines(ON_THE_BUS) {
        let own = line.replace(BUS, &bus).replace("$B", &bus);
        if ELSEWHERE.iter().any(|beginning| line.starts_with(beginning)) {
            continue;
        }
        if let Some(arguments) = own.strip_prefix(PROGRAM) {
            // It runs until it is stopped, beside the lines that follow.
            assert!(line.contains(&format!("sim --bus {BUS} --node 5 --node 6")), "{line}");
            let mut sim = Running(command(arguments).stderr(Stdio::piped()).spawn().unwrap());
            let first = BufReader::new(sim.0.stderr.take().unwrap()).lines().next();
            assert!(first.unwrap().unwrap().contains("node 5"), "{line}");
            // A set-point that is later than 0.1 s is a fault, and a busy machine does not always keep that.
            let patient = format!("set command-deadline {DEADLINE} --bus {bus} --node {NODE}");
            assert_done(&patient, &command(&patient).output().unwrap());
            served = Some(sim);
        } else if let Some(given) = own.strip_prefix("B=") {
            assert_eq!(given, bus);
        } else {
            let arguments = own.strip_prefix("jointctl ").unwrap_or_else(|| panic!("{line}: nobody runs it"));
            assert!(served.is_some(), "{line}: before there are joints");
            // The curves are for a terminal.
            let page = if arguments.starts_with("monitor") { " --once" } else { "" };
            let output = punctual::command(|force| command(&format!("{arguments}{page}{force}")).output().unwrap());
            assert_done(&line, &output);
            run.push(arguments.split_whitespace().next().unwrap().to_owned());
        }
    }
    let expected = "scan info move upload discard upload retrain info set monitor";
    assert_eq!(run.join(" "), expected, "what the page shows");
}

pub fn the_page_on_ownership_runs_line_by_line() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("demo")).unwrap();
    std::fs::write(folder.path().join("demo/friction.img"), image(1, 0.25, 0)).unwrap();
    let run = |line: &str, bus: &str| {
        let own = line.replace("$B", bus);
        let arguments = own.strip_prefix(PROGRAM).or_else(|| own.strip_prefix("jointctl "));
        let arguments = arguments.unwrap_or_else(|| panic!("{line}: nobody runs it"));
        program().current_dir(&folder).args(arguments.split_whitespace()).stdin(Stdio::null()).output().unwrap()
    };
    let stranger = |bus: &str| run(&format!("jointctl set torque-limit 60 --bus $B --node {NODE}"), bus).status.code();
    // A joint belongs to somebody who is there in its first minute.
    let powered = || {
        let port = bus::free_port().unwrap();
        let served = Served::on(&format!("slcan:listen://127.0.0.1:{port}"), &[NODE]);
        (served, format!("slcan:tcp://127.0.0.1:{port}"))
    };
    let (mut served, mut bus) = powered();
    let lines = lines(OWNERSHIP);
    let gives = lines.iter().find(|line| line.contains(" key give ")).unwrap();
    let mut shown = Vec::new();
    for line in &lines {
        let is_lost = line.contains(" key forget ") && !line.contains("--key");
        if is_lost {
            // The joint of somebody who has lost the key.
            (served, bus) = powered();
            assert_done(gives, &run(gives, &bus));
        }
        assert_done(line, &run(line, &bus));
        let is_owned = ["give", "set", "rotate"].iter().any(|word| line.contains(&format!(" {word} ")));
        if is_owned || line.contains(" forget ") {
            assert_eq!(stranger(&bus), Some(i32::from(is_owned)), "{line}: whoever has no key");
        }
        let words = line.trim_start_matches(PROGRAM).trim_start_matches("jointctl ").split_whitespace();
        shown.push(words.take_while(|word| word.chars().all(char::is_alphabetic)).collect::<Vec<_>>().join(" "));
    }
    drop(served);
    let expected =
        ["key new", "sign", "image verify", "key give", "set", "key new", "key rotate", "key forget", "key forget"];
    assert_eq!(shown, expected, "what the page shows");
}
