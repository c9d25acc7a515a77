//! python-canopen drives the virtual joint, in real time: with the example that is shipped, and through everything that
//! it can do.
//!
//! Without Python, or where python-canopen cannot be installed, these are reported as ignored by name; with `CI` set
//! they run, and fail.

mod client;

use client::Joint;
use libtest_mimic::{Arguments, Failed, Trial};
use node::SampleImage;
use python::CANOPEN;
use std::path::Path;
use std::process::Command;

const GROUP: &str = "239.74.163.2";

fn main() {
    let mut arguments = Arguments::from_args();
    // They wait for joints in real time: all at once.
    arguments.test_threads.get_or_insert(4);
    let must_run = std::env::var_os("CI").is_some();
    let python = if arguments.list { None } else { CANOPEN.python(env!("CARGO_TARGET_TMPDIR")) };
    let ignored = !must_run && python.is_none();
    let (one, two, three, four) = (python.clone(), python.clone(), python.clone(), python);
    let trials = vec![
        Trial::test("python_canopen_enables_turns_and_feeds_an_image_to_the_joint", move || drive(one.as_deref())),
        Trial::test("python_canopen_can_do_everything_with_the_joint", move || conformance(two.as_deref())),
        Trial::test("python_canopens_profile_402_enables_and_moves_the_joint_with_the_default_pdos", move || {
            let text = run(four.as_deref(), "tests/profile402.py", &[], &[])?;
            if text.lines().last() == Some("done") { Ok(()) } else { Err(text.into()) }
        }),
        Trial::test("python_canopen_transfers_every_length_in_every_way", move || {
            client::every_length(|first, step| run(three.as_deref(), "tests/lengths.py", &[], &[first, step]))
        }),
    ];
    let trials = trials.into_iter().map(|trial| trial.with_ignored_flag(ignored)).collect();
    libtest_mimic::run(&arguments, trials).exit();
}

/// A script on a bus of its own with a joint; what it printed.
fn run(python: Option<&Path>, script: &str, images: &[Vec<u8>], more: &[&str]) -> Result<String, Failed> {
    let python = CANOPEN.required(python)?;
    let port = bus::free_port().ok_or("no port is free")?;
    let mut joint = Joint::new(&format!("udp:{GROUP}:{port}"))?;
    let mut command = Command::new(python);
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(script));
    command.args([GROUP, &port.to_string(), &client::NODE.to_string()]);
    let folder = tempfile::tempdir()?;
    joint.run(command, folder.path(), images, more)
}

fn drive(python: Option<&Path>) -> Result<(), Failed> {
    let text = run(python, "examples/drive.py", &[SampleImage::constant(9, 0.25)], &[])?;
    let lines: Vec<&str> = text.lines().collect();
    let [name, moving, silent, version, same] = lines[..] else { return Err(text.into()) };
    let velocity = |line: &str| line.split_whitespace().nth(3).and_then(|word| word.parse::<i32>().ok());
    let well = name.starts_with("name virtual joint")
        && velocity(moving).is_some_and(|velocity| (450..=550).contains(&velocity))
        && silent.contains("0x8100")
        && version == "image version 9 state 7"
        && same == "read back True";
    if well { Ok(()) } else { Err(text.into()) }
}

fn conformance(python: Option<&Path>) -> Result<(), Failed> {
    let images = [SampleImage::constant(1, 0.25), SampleImage::constant(2, 0.5)];
    let text = run(python, "tests/conformance.py", &images, &[])?;
    if text.lines().last() == Some("done") { Ok(()) } else { Err(text.into()) }
}
