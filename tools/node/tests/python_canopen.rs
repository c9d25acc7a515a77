//! python-canopen drives the virtual joint, in real time, with the example that is shipped.
//!
//! Without Python, or where python-canopen cannot be installed, this is reported as ignored by name; with `CI` set it runs, and fails.

use libtest_mimic::{Arguments, Failed, Trial};
use node::{Options, SampleImage, SlotImages, VirtualNode, serve};
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

const GROUP: &str = "239.74.163.2";
const NODE: u8 = 5;

fn main() {
    let arguments = Arguments::from_args();
    let must_run = std::env::var_os("CI").is_some();
    let python = if arguments.list { None } else { python() };
    let ignored = !must_run && python.is_none();
    let trial =
        Trial::test("python_canopen_enables_turns_and_feeds_an_image_to_the_joint", move || drive(python.as_deref()));
    libtest_mimic::run(&arguments, vec![trial.with_ignored_flag(ignored)]).exit();
}

/// A Python with python-canopen, made once in the build directory.
fn python() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-canopen");
    let python = folder.join("bin/python3");
    let works = || {
        let imports = Command::new(&python).args(["-c", "import canopen, can, msgpack"]).output();
        imports.is_ok_and(|output| output.status.success())
    };
    if !works() {
        let made = Command::new("python3").args(["-m", "venv"]).arg(&folder).output().ok()?;
        if !made.status.success() {
            return None;
        }
        let packages = ["canopen==2.4.1", "python-can==4.6.1", "msgpack==1.2.4"];
        Command::new(&python)
            .args(["-m", "pip", "install", "--quiet", "--timeout", "10"])
            .args(packages)
            .output()
            .ok()?;
    }
    works().then_some(python)
}

fn drive(python: Option<&Path>) -> Result<(), Failed> {
    let python = python.ok_or("there is no python3 with venv, or python-canopen could not be installed")?;
    let port = std::net::UdpSocket::bind("0.0.0.0:0")?.local_addr()?.port();
    let bus = bus::open(&format!("udp:{GROUP}:{port}"))?;
    let parameters = ActuatorParameters::reference().aligned().without_payload();
    let options = Options { node_id: NODE, serial: 12, seed: 1 };
    let mut joint = VirtualNode::new(parameters, &Setup::of(&parameters), &options, SlotImages::empty()?)?;
    let folder = tempfile::tempdir()?;
    let image = folder.path().join("friction.img");
    std::fs::write(&image, SampleImage::constant(9, 0.25))?;

    let stop = AtomicBool::new(false);
    let output = std::thread::scope(|scope| {
        scope.spawn(|| serve(&mut joint, &*bus, &stop));
        let output = Command::new(python)
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/drive.py"))
            .args([GROUP, &port.to_string(), &NODE.to_string()])
            .arg(&image)
            .output();
        stop.store(true, Ordering::Relaxed);
        output
    })?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let problem = || Failed::from(format!("{text}{}", String::from_utf8_lossy(&output.stderr)));
    let lines: Vec<&str> = text.lines().collect();
    let [name, moving, silent, version, same] = lines[..] else { return Err(problem()) };
    let velocity = |line: &str| line.split_whitespace().nth(3).and_then(|word| word.parse::<i32>().ok());
    let well = name.starts_with("name virtual joint")
        && velocity(moving).is_some_and(|velocity| (450..=550).contains(&velocity))
        && silent.contains("0x8100")
        && version == "image version 9 state 7"
        && same == "read back True";
    if well { Ok(()) } else { Err(problem()) }
}
