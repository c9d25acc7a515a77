//! The control interrupt of both boards' linked programs: it can reach no panic, and all of it lies in CCM SRAM.
//!
//! The proof walks the machine code from the interrupt's entry: every branch and call of every function that can be reached,
//! through the linker's veneers. A jump that only the running program knows is refused. Needs the target; where it is
//! missing the tests are reported as ignored, by name; with `CI` set they run and fail.

mod thumb;

use libtest_mimic::{Arguments, Failed, Trial};
use std::path::{Path, PathBuf};
use std::process::Command;

const TARGET: &str = "thumbv7em-none-eabihf";
/// The handler in the vector table.
const HANDLER: &str = "ADC1_2";
/// CCM SRAM of the larger chip; the smaller one's begins at the same address, and the linker keeps to its end.
const CCM: std::ops::Range<u32> = 0x1000_0000..0x1000_8000;

fn main() {
    let arguments = Arguments::from_args();
    let ignored = std::env::var_os("CI").is_none() && !target_installed();
    let mut trials =
        vec![Trial::test("a_function_that_can_panic_is_found_out", finds_panics).with_ignored_flag(ignored)];
    for board in ["b-g431b-esc1", "moteus-r4"] {
        let name = format!("the_control_interrupt_of_{board}_reaches_no_panic_and_stays_in_ccm");
        trials.push(Trial::test(name, move || check(board)).with_ignored_flag(ignored));
    }
    libtest_mimic::run(&arguments, trials).exit();
}

fn target_installed() -> bool {
    let output = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
    output.is_ok_and(|output| {
        let folder = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        Path::new(&folder).read_dir().is_ok_and(|mut files| files.next().is_some())
    })
}

/// Builds the board's program as it is flashed; its path.
fn build(board: &str) -> Result<PathBuf, Failed> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("boards").join(board);
    let output = Command::new(env!("CARGO"))
        .args(["build", "--release", "-p", "joint-firmware", "--target", TARGET])
        .args(["--no-default-features", "--features", board])
        .current_dir(root)
        .env("CARGO_TARGET_DIR", &target)
        .output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
    }
    Ok(target.join(TARGET).join("release/joint-firmware"))
}

/// What is wrong with everything that runs from `entry` on.
fn faults(path: &Path, entry: &str) -> Result<Vec<String>, Failed> {
    let program = thumb::Program::parse(&std::fs::read(path)?)?;
    let reached = program.reachable(program.address(entry).ok_or(format!("{entry} is not linked"))?);
    let bytes: u32 = reached.functions.iter().map(|(_, size, _)| size).sum();
    println!("{}: {entry} reaches {} functions, {bytes} B", path.display(), reached.functions.len());
    let mut faults = reached.unclear;
    for (address, _, name) in reached.functions {
        if name.contains("panic") || name.contains("unwrap_failed") || name.contains("expect_failed") {
            faults.push(format!("reaches {name}"));
        }
        if !CCM.contains(&address) {
            faults.push(format!("{name} lies at {address:#010x}, outside CCM SRAM"));
        }
    }
    Ok(faults)
}

fn check(board: &str) -> Result<(), Failed> {
    match &faults(&build(board)?, HANDLER)?[..] {
        [] => Ok(()),
        faults => Err(faults.join("\n").into()),
    }
}

/// The walk is worth something only if it finds what is there: the program's start can panic, and lies in flash.
fn finds_panics() -> Result<(), Failed> {
    let faults = faults(&build("b-g431b-esc1")?, "main")?;
    let found = |what: &str| faults.iter().any(|fault| fault.contains(what));
    match found("panic") && found("outside CCM SRAM") {
        true => Ok(()),
        false => Err(faults.join("\n").into()),
    }
}
