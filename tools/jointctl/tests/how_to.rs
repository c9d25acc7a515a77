//! Pages of `docs/` that lead a user of another master to a moving joint: their lines and scripts as they stand.
//!
//! Without Python, or where the masters cannot be installed, these are reported as ignored by name; with `CI` set they
//! run, and fail.

use jointctl::remote::RemoteJoint;
use libtest_mimic::{Arguments, Failed, Trial};
use node::{Options, SlotImages, VirtualNode, serve};
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
use python::{CANOPEN, DCF_TOOLS, Packages};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

const PYTHON_CANOPEN: &str = include_str!("../../../docs/with-python-canopen.md");
const ROS2_CANOPEN: &str = include_str!("../../../docs/with-ros2-canopen.md");
/// The bus of the pages; here each run has a port of its own.
const GROUP: &str = "239.74.163.2";
const PORT: &str = "43113";
const NODE: u8 = 5;

fn main() {
    let arguments = Arguments::from_args();
    let must_run = std::env::var_os("CI").is_some();
    let find = |packages: Packages| match arguments.list {
        true => None,
        false => packages.python(env!("CARGO_TARGET_TMPDIR")),
    };
    let [canopen, dcf_tools] = [CANOPEN, DCF_TOOLS].map(find);
    let ignored = [&canopen, &dcf_tools].map(|python| !must_run && python.is_none());
    let trials = vec![
        Trial::test("the_page_on_python_canopen_leads_to_a_moving_joint", move || python_canopen(canopen.as_deref()))
            .with_ignored_flag(ignored[0]),
        Trial::test("the_page_on_ros2_canopen_leads_to_a_masters_configuration", move || {
            ros2_canopen(dcf_tools.as_deref())
        })
        .with_ignored_flag(ignored[1]),
    ];
    libtest_mimic::run(&arguments, trials).exit();
}

/// The code blocks of a page, by language.
fn blocks(page: &str, language: &str) -> Vec<String> {
    let mut blocks = Vec::new();
    let mut rest = page;
    while let Some((_, behind)) = rest.split_once("\n```") {
        let (block, after) = behind.split_once("\n```").unwrap_or((behind, ""));
        if let Some(text) = block.strip_prefix(language).and_then(|text| text.strip_prefix('\n')) {
            blocks.push(format!("{text}\n"));
        }
        rest = after;
    }
    blocks
}

/// Runs lines in a folder as a user would in a shell, with `jointctl` and the packages at hand; what they printed.
fn shell(lines: &str, folder: &Path, packages: &Packages, python: Option<&Path>) -> Result<String, Failed> {
    let python = packages.required(python)?;
    // The environment is there, made as the page says; pip then has nothing to do.
    for line in lines.lines().filter(|line| line.starts_with("pip install ")) {
        let asked = line.split_whitespace().skip(2).collect::<Vec<_>>();
        if asked != packages.install {
            return Err(format!("{line}: the tests install {:?}", packages.install).into());
        }
    }
    let made = |line: &&str| !["python3 -m venv ", ". ", "pip install "].iter().any(|made| line.starts_with(made));
    let lines = lines.lines().filter(made).collect::<Vec<_>>().join("\n");
    let beside = |program: &Path| program.parent().map(Path::to_owned).unwrap_or_default();
    let own = beside(Path::new(env!("CARGO_BIN_EXE_jointctl")));
    let before = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths([beside(python), own].into_iter().chain(std::env::split_paths(&before)))?;
    let output = Command::new("sh").args(["-euc", &lines]).current_dir(folder).env("PATH", path).output()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    match output.status.success() {
        true => Ok(text),
        false => Err(format!("{lines}\n{text}{}", String::from_utf8_lossy(&output.stderr)).into()),
    }
}

/// A virtual joint on the bus while `work` is done.
fn beside_a_joint(port: u16, work: impl FnOnce() -> Result<(), Failed>) -> Result<(), Failed> {
    let bus = bus::open(&format!("udp:{GROUP}:{port}"))?;
    let parameters = ActuatorParameters::reference().aligned().without_payload();
    let mut setup = Setup::of(&parameters);
    // A client on a busy machine sends nothing for longer than the 0.1 s after which the joint would brake.
    setup.configuration.limits.command_deadline = 0.5;
    let options = Options { node_id: NODE, serial: 12, seed: 1 };
    let mut joint = VirtualNode::new(parameters, &setup, &options, SlotImages::empty()?)?;
    joint.advance(4_000);
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| serve(&mut joint, &*bus, &stop));
        let outcome = work();
        stop.store(true, Ordering::Relaxed);
        outcome
    })
}

fn python_canopen(python: Option<&Path>) -> Result<(), Failed> {
    let port = bus::free_port().ok_or("no port is free")?;
    let own = |text: &str| text.replace(PORT, &port.to_string());
    let folder = tempfile::tempdir()?;
    let (lines, scripts, printed) =
        (blocks(PYTHON_CANOPEN, "sh"), blocks(PYTHON_CANOPEN, "python"), blocks(PYTHON_CANOPEN, "text"));
    let ([install, sim, eds, run], [script], [printed]) = (&lines[..], &scripts[..], &printed[..]) else {
        return Err(format!("{} lines, {} scripts, {} outputs", lines.len(), scripts.len(), printed.len()).into());
    };
    let expected = format!("cargo run --release -p jointctl -- sim --bus udp:{GROUP}:{PORT} --node {NODE}\n");
    if *sim != expected {
        // The test of docs/on-the-bus.md runs it; a joint with more patience takes its place here.
        return Err(format!("{sim}: not what is run in its place").into());
    }
    std::fs::write(folder.path().join("move.py"), own(script))?;
    beside_a_joint(port, || {
        for block in [install, eds] {
            shell(&own(block), folder.path(), &CANOPEN, python)?;
        }
        let output = shell(run, folder.path(), &CANOPEN, python)?;
        if is_about(&output, printed) { Ok(()) } else { Err(format!("printed:\n{output}").into()) }
    })
}

/// Returns `true` if a text is another one but for its numbers, which are within 0.05 of the other's.
fn is_about(text: &str, other: &str) -> bool {
    let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let (text, other) = (words(text), words(other));
    let near = |(a, b): (&String, &String)| match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => (a - b).abs() < 0.051,
        _ => a == b,
    };
    text.len() == other.len() && text.iter().zip(&other).all(near)
}

fn ros2_canopen(python: Option<&Path>) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    let lines = blocks(ROS2_CANOPEN, "sh").concat();
    let output = shell(&lines, folder.path(), &DCF_TOOLS, python)?;
    let last = output.lines().rev().take(3).collect::<Vec<_>>();
    if last != ["master.dcf", "joint_7.bin", "joint_5.bin"] {
        return Err(output.into());
    }
    let joints = folder.path().join("joints");
    let read = |name: &str| std::fs::read_to_string(joints.join(name));
    // Facts of the file by the table of the page.
    let bus_yml = read("bus.yml")?;
    let told = scales_of_the_table(ROS2_CANOPEN);
    for (key, value) in &told {
        let line = bus_yml.lines().find(|line| line.trim_start().starts_with(&format!("{key}:")));
        let holds = line.is_some_and(|line| line.contains(value));
        if !holds {
            return Err(format!("{key} is not {value} in\n{bus_yml}").into());
        }
    }
    if told.len() != 4 {
        return Err(format!("{told:?}").into());
    }
    if joints.join("master.bin").exists() || std::fs::metadata(joints.join("joint_5.bin"))?.len() == 0 {
        return Err("dcfgen's files are not those of the page".into());
    }
    takes(&std::fs::read(joints.join("joint_5.bin"))?)?;
    // The launch file is Python; nothing here can run it.
    let [launch] = &blocks(ROS2_CANOPEN, "python")[..] else { return Err("one launch file".into()) };
    let file: PathBuf = folder.path().join("joints.launch.py");
    std::fs::write(&file, launch)?;
    shell("python3 -m py_compile joints.launch.py", folder.path(), &DCF_TOOLS, python).map(drop)
}

/// A concise DCF (CiA 302-3, object 1F22h): a count, and index, sub-index, length and value of each entry,
/// little-endian.
fn entries(mut bytes: &[u8]) -> Option<Vec<(u16, u8, Vec<u8>)>> {
    let (count, rest) = bytes.split_first_chunk()?;
    bytes = rest;
    let mut entries = Vec::new();
    for _ in 0..u32::from_le_bytes(*count) {
        let ([low, high, sub_index, a, b, c, d], rest) = bytes.split_first_chunk()?;
        let length = usize::try_from(u32::from_le_bytes([*a, *b, *c, *d])).ok()?;
        let (value, rest) = rest.split_at_checked(length)?;
        entries.push((u16::from_le_bytes([*low, *high]), *sub_index, value.to_vec()));
        bytes = rest;
    }
    bytes.is_empty().then_some(entries)
}

/// A joint takes what a master would write to it at its start, in that order, and then has it.
fn takes(concise_dcf: &[u8]) -> Result<(), Failed> {
    let entries = entries(concise_dcf).ok_or("joint_5.bin is no concise DCF")?;
    let port = bus::free_port().ok_or("no port is free")?;
    beside_a_joint(port, || {
        let joint = RemoteJoint::open(&format!("udp:{GROUP}:{port}"), NODE)?;
        for (index, sub_index, value) in &entries {
            let taken = joint.node().download(*index, *sub_index, value);
            taken.map_err(|error| format!("{index:04X}h:{sub_index} {value:02x?}: {error}"))?;
        }
        // The last value that is written to each.
        let last: BTreeMap<_, _> =
            entries.iter().map(|(index, sub_index, value)| ((*index, *sub_index), value)).collect();
        for ((index, sub_index), value) in &last {
            let mut found = joint.node().upload(*index, *sub_index)?;
            // Bit 30 of a TPDO's COB-ID, "no remote frames", reads as the joint has it.
            if let ((0x1800..=0x19FF, 1), [.., high]) = ((*index, *sub_index), &mut found[..]) {
                *high &= !0x40;
            }
            if found != **value {
                return Err(format!("{index:04X}h:{sub_index} is {found:02x?} instead of {value:02x?}").into());
            }
        }
        // Each kind of object that the page's table speaks of is among them.
        for index in [0x1016, 0x1017, 0x1400, 0x1401, 0x1402, 0x1600, 0x1601, 0x1800, 0x1801, 0x1A00, 0x1A01] {
            if !last.keys().any(|(other, _)| *other == index) {
                return Err(format!("{index:04X}h is not configured: {:x?}", last.keys()).into());
            }
        }
        Ok(())
    })
}

/// Scales that the page's table states: name in `bus.yml`, value.
fn scales_of_the_table(page: &str) -> Vec<(String, String)> {
    let rows = page.lines().filter(|line| line.starts_with("| `scale_"));
    let cells = rows.flat_map(|row| {
        let cells: Vec<_> = row.split('|').map(str::trim).collect();
        let names = cells[1].split(", ").map(|name| name.trim_matches('`').to_owned());
        let values = cells[2].split(", ").map(str::to_owned);
        names.zip(values).collect::<Vec<_>>()
    });
    cells.collect()
}
