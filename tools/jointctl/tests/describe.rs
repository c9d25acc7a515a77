//! Files of `jointctl eds`, `dbc` and `bus-yml`, loaded by python-canopen, cantools and dcf-tools and compared with a
//! virtual joint.
//!
//! Without Python, or where these cannot be installed, this is reported as ignored by name; with `CI` set it runs, and
//! fails.

use jointctl::remote::{Entry, RemoteJoint};
use libtest_mimic::{Arguments, Failed, Trial};
use node::{Options, SlotImages, VirtualNode, serve};
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
use python::{DCF_TOOLS, Packages};
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

const GROUP: &str = "239.74.163.2";
const NODE: u8 = 7;

fn main() {
    let arguments = Arguments::from_args();
    let must_run = std::env::var_os("CI").is_some();
    let python = if arguments.list { None } else { PACKAGES.python(env!("CARGO_TARGET_TMPDIR")) };
    let ignored = !must_run && python.is_none();
    let name = "python_canopen_loads_the_eds_and_cantools_the_dbc_and_both_agree_with_a_joint";
    let trial = Trial::test(name, move || compare(python.as_deref()));
    let lely = if arguments.list { None } else { DCF_TOOLS.python(env!("CARGO_TARGET_TMPDIR")) };
    let without = !must_run && lely.is_none();
    let strict = Trial::test(
        "lelys_dcfchk_finds_nothing_in_the_eds_and_dcfgen_makes_a_masters_configuration_of_bus_yml",
        move || configure(lely.as_deref()),
    );
    libtest_mimic::run(&arguments, vec![trial.with_ignored_flag(ignored), strict.with_ignored_flag(without)]).exit();
}

/// python-canopen with its bus, and cantools.
const PACKAGES: Packages = Packages {
    folder: "python-describe",
    install: &["canopen==2.4.1", "python-can==4.6.1", "msgpack==1.2.4", "cantools==41.0.0"],
    import: "canopen, can, msgpack, cantools",
};

fn configure(python: Option<&Path>) -> Result<(), Failed> {
    let python = DCF_TOOLS.required(python)?;
    let folder = tempfile::tempdir()?;
    let write = |more: &[&str]| {
        let arguments = [&["bus-yml", "--node", "7", "--node", "8"], more].concat();
        Command::new(env!("CARGO_BIN_EXE_jointctl")).current_dir(&folder).args(arguments).output()
    };
    let written = write(&[])?;
    if !written.status.success() {
        return Err(String::from_utf8_lossy(&written.stderr).into_owned().into());
    }
    let refused = write(&[])?;
    if refused.status.code() != Some(2) || !String::from_utf8_lossy(&refused.stderr).contains("bus.yml exists; --force")
    {
        return Err(format!("bus-yml replaces a file without being told to: {refused:?}").into());
    }
    for (more, code) in [
        (["--period", "0"], 2),
        (["--period", "1"], 0),
        (["--period", "50"], 0),
        (["--period", "51"], 2),
        (["--node", "0"], 2),
        (["--node", "127"], 0),
        (["--node", "128"], 2),
        (["--master", "8"], 2),
        (["--master", "9"], 0),
        // The last one is what dcfgen takes below.
        (["--period", "10"], 0),
    ] {
        let output = write(&[&more[..], &["--force"]].concat())?;
        if output.status.code() != Some(code) {
            return Err(format!("{more:?}: {output:?}, wanted {code}").into());
        }
    }
    for (program, arguments) in [("dcfchk", &["-n", "7", "joint.eds"][..]), ("dcfgen", &["-rS", "bus.yml"])] {
        // Beside its Python; a warning is on the error output, and too much.
        let output = Command::new(python.with_file_name(program)).current_dir(&folder).args(arguments).output()?;
        let said = String::from_utf8_lossy(&output.stderr);
        if !output.status.success() || !said.is_empty() {
            return Err(format!("{program}: {}\n{said}", output.status).into());
        }
    }
    for file in ["master.dcf", "joint_7.bin", "joint_8.bin"] {
        if std::fs::metadata(folder.path().join(file))?.len() == 0 {
            return Err(format!("dcfgen left {file} empty").into());
        }
    }
    Ok(())
}

/// Fails where a file has not the identity that the joint answers: a product and a revision, and no vendor.
fn identity(bus: &str, eds: &str) -> Result<(), String> {
    let joint = RemoteJoint::open(bus, NODE).map_err(|error| error.to_string())?;
    for (name, sub_index) in [("VendorNumber", 1), ("ProductNumber", 2), ("RevisionNumber", 3)] {
        let number = joint.node().number(0x1018, sub_index).map_err(|error| error.to_string())?;
        let number = u32::from_le_bytes(number);
        let section =
            eds.split_once(&format!("\n[1018sub{sub_index}]\n")).and_then(|(_, rest)| rest.split_once("\n\n"));
        let default = section
            .is_some_and(|(section, _)| section.lines().any(|line| line == format!("DefaultValue=0x{number:X}")));
        if !default || !eds.contains(&format!("\n{name}=0x{number:X}\n")) || (number == 0) != (sub_index == 1) {
            return Err(format!("1018h:{sub_index} of the joint is {number:X}h, and not {name} there"));
        }
    }
    Ok(())
}

fn compare(python: Option<&Path>) -> Result<(), Failed> {
    let python = PACKAGES.required(python)?;
    let folder = tempfile::tempdir()?;
    for arguments in [vec!["eds", "joint.eds"], vec!["dbc", "joint.dbc", "--node", "7", "--node", "8"]] {
        let written = Command::new(env!("CARGO_BIN_EXE_jointctl")).current_dir(&folder).args(&arguments).output()?;
        if !written.status.success() {
            return Err(String::from_utf8_lossy(&written.stderr).into_owned().into());
        }
    }
    let port = bus::free_port().ok_or("no port is free")?;
    let bus = bus::open(&format!("udp:{GROUP}:{port}"))?;
    let parameters = ActuatorParameters::reference().aligned().without_payload();
    let options = Options { node_id: NODE, serial: 12, seed: 1 };
    let mut joint = VirtualNode::new(parameters, &Setup::of(&parameters), &options, SlotImages::empty()?)?;

    let stop = AtomicBool::new(false);
    let output = std::thread::scope(|scope| {
        scope.spawn(|| serve(&mut joint, &*bus, &stop));
        let own = Command::new(env!("CARGO_BIN_EXE_jointctl"))
            .current_dir(&folder)
            .args(["eds", "own.eds", "--bus", &format!("udp:{GROUP}:{port}"), "--node", &NODE.to_string()])
            .status();
        let eds = own.and_then(|_| std::fs::read_to_string(folder.path().join("own.eds"))).unwrap_or_default();
        if let Err(error) = identity(&format!("udp:{GROUP}:{port}"), &eds) {
            stop.store(true, Ordering::Relaxed);
            return Err(std::io::Error::other(format!("the file for this joint alone: {error}\n{eds}")));
        }
        let output = Command::new(python)
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/describe.py"))
            .args([folder.path().join("joint.eds"), folder.path().join("joint.dbc")])
            .args([GROUP, &port.to_string(), &NODE.to_string(), &Entry::all().count().to_string()])
            .output();
        stop.store(true, Ordering::Relaxed);
        output
    })?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    if output.status.success() {
        print!("{text}");
        return Ok(());
    }
    Err(format!("{text}{}", String::from_utf8_lossy(&output.stderr)).into())
}
