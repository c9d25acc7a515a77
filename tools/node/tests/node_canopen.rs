//! node-canopen (npm: canopen) drives the virtual joint, in real time, through everything that it can do; over slcan by
//! TCP.
//!
//! Without Node.js, or where node-canopen cannot be installed (its checksum is a native module, which npm builds), this
//! is reported as ignored by name; with `CI` set it runs, and fails.

mod client;

use client::Joint;
use jointctl::describe::eds::{self, Identity};
use jointctl::remote::Entry;
use libtest_mimic::{Arguments, Failed, Trial};
use node::SampleImage;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

const PACKAGE: &str = "canopen@6.2.1";

fn main() {
    let mut arguments = Arguments::from_args();
    // They wait for joints in real time: all at once.
    arguments.test_threads.get_or_insert(3);
    let must_run = std::env::var_os("CI").is_some();
    let modules = if arguments.list { Err("only listed".into()) } else { modules() };
    let ignored = !must_run && modules.is_err();
    let (shared, second) = (modules.clone(), modules.clone());
    let trials = vec![
        Trial::test("node_canopen_can_do_everything_with_the_joint", move || conformance(&modules)),
        Trial::test("node_canopen_loads_the_eds_and_drives_the_joint_in_profile_velocity_by_it", move || {
            by_eds(&second)
        }),
        Trial::test("node_canopen_transfers_every_length_in_every_way", move || {
            client::every_length(|first, step| run(&shared, "tests/lengths.js", &[], &[first, step]))
        }),
    ];
    let trials = trials.into_iter().map(|trial| trial.with_ignored_flag(ignored)).collect();
    libtest_mimic::run(&arguments, trials).exit();
}

/// A folder with node-canopen, made once in the build directory; or why there is none.
fn modules() -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("node-canopen");
    let works = || {
        let loads = Command::new("node").args(["-e", "require('canopen')"]).current_dir(&folder).output();
        loads.is_ok_and(|output| output.status.success())
    };
    if folder.join("package.json").exists() && works() {
        return Ok(folder);
    }
    std::fs::create_dir_all(&folder).map_err(|error| error.to_string())?;
    std::fs::write(folder.join("package.json"), "{ \"private\": true }").map_err(|error| error.to_string())?;
    // npm may ask for consent to build the native module: `rebuild` is that consent.
    let mut said = String::new();
    for arguments in [&["install", "--no-audit", "--no-fund", PACKAGE][..], &["rebuild", "node-crc"]] {
        let mut npm = Command::new("npm");
        npm.args(arguments).current_dir(&folder);
        if let Some(prefix) = headers() {
            npm.env("npm_config_nodedir", prefix);
        }
        let output = npm.output();
        match output {
            Ok(output) => said.push_str(&String::from_utf8_lossy(&output.stderr)),
            Err(error) => return Err(format!("npm cannot be run: {error}")),
        }
        if works() {
            return Ok(folder);
        }
    }
    Err(format!("node-canopen could not be installed: {said}"))
}

/// Folder in which Node's own headers are installed beside it, so that none have to be downloaded.
fn headers() -> Option<PathBuf> {
    let node = Command::new("node").args(["-p", "process.execPath"]).output().ok()?;
    let prefix = Path::new(std::str::from_utf8(&node.stdout).ok()?.trim()).parent()?.parent()?.to_owned();
    prefix.join("include/node/node.h").exists().then_some(prefix)
}

/// A script on a bus of its own with a joint; what it printed.
fn run(modules: &Result<PathBuf, String>, script: &str, images: &[Vec<u8>], more: &[&str]) -> Result<String, Failed> {
    let modules = modules.as_ref()?;
    let port = bus::free_port().ok_or("no port is free")?;
    let mut joint = Joint::new(&format!("slcan:listen://127.0.0.1:{port}"))?;
    let mut command = Command::new("node");
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(script));
    command.arg(modules).args([port.to_string(), client::NODE.to_string()]);
    joint.run(command, tempfile::tempdir()?.path(), images, more)
}

fn conformance(modules: &Result<PathBuf, String>) -> Result<(), Failed> {
    let images = [SampleImage::constant(1, 0.25), SampleImage::constant(2, 0.5)];
    let text = run(modules, "tests/conformance.js", &images, &[])?;
    if text.lines().last() == Some("done") { Ok(()) } else { Err(text.into()) }
}

fn by_eds(modules: &Result<PathBuf, String>) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("joint.eds");
    std::fs::write(&path, eds::text("joint.eds", Duration::ZERO, Identity::default()))?;
    let path = path.to_str().ok_or("a path that is no text")?;
    let text = run(modules, "tests/eds.js", &[], &[path, &Entry::all().count().to_string()])?;
    if text.lines().last() == Some("done") { Ok(()) } else { Err(text.into()) }
}
