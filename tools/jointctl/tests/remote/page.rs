//! docs/on-the-bus.md, line by line as it stands.

use crate::punctual;
use crate::served::{Served, image, program};
use crate::shown::{ON_THE_BUS, lines};
use std::io::{BufRead, BufReader};
use std::process::Stdio;

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
    let (mut served, mut run) = (None, Vec::new());
    for line in lines(ON_THE_BUS) {
        let own = line.replace(BUS, &bus).replace("$B", &bus);
        if ELSEWHERE.iter().any(|beginning| line.starts_with(beginning)) {
            continue;
        }
        if let Some(arguments) = own.strip_prefix(PROGRAM) {
            // It runs until it is stopped. Its joints take no set-point that is later than 0.1 s, which a busy machine
            // does not always keep: others take their place.
            assert!(line.contains(&format!("sim --bus {BUS} --node 5 --node 6")), "{line}");
            let mut sim = command(arguments).stderr(Stdio::piped()).spawn().unwrap();
            let first = BufReader::new(sim.stderr.take().unwrap()).lines().next();
            sim.kill().unwrap();
            sim.wait().unwrap();
            assert!(first.unwrap().unwrap().contains("node 5"), "{line}");
            served = Some(Served::on(&bus, &[5, 6]));
        } else if let Some(given) = own.strip_prefix("B=") {
            assert_eq!(given, bus);
        } else {
            let arguments = own.strip_prefix("jointctl ").unwrap_or_else(|| panic!("{line}: nobody runs it"));
            assert!(served.is_some(), "{line}: before there are joints");
            // The curves are for a terminal.
            let page = if arguments.starts_with("monitor") { " --once" } else { "" };
            let output = punctual::command(|force| command(&format!("{arguments}{page}{force}")).output().unwrap());
            let told = [&output.stdout[..], &output.stderr].map(String::from_utf8_lossy).concat();
            assert!(output.status.success(), "{line}: {}\n{told}", output.status);
            run.push(arguments.split_whitespace().next().unwrap().to_owned());
        }
    }
    let expected = "scan info move upload discard upload retrain info set monitor";
    assert_eq!(run.join(" "), expected, "what the page shows");
}
