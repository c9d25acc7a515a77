//! Behaviour of the library on the board's core, in the programs of the probe: bits, instructions, and what is linked;
//! and of the boards' programs the routines that move memory. A file a promise.
//!
//! Needs the target `thumbv7em-none-eabihf`, and some tests `qemu-system-arm`. Where they are missing the tests are
//! reported as ignored, by name; with `CI` set they run and fail.

mod control_step;
mod copies;
mod friction;
mod library;

use host_tests::bare_metal::target_installed;
use libtest_mimic::Arguments;
use std::process::Command;

/// Tools that are not on this machine and not demanded of it either: the tests that need them are ignored.
struct Missing {
    target: bool,
    /// `true` if this is missing, or the target.
    qemu: bool,
}

fn main() {
    let arguments = Arguments::from_args();
    let required = std::env::var_os("CI").is_some();
    let target = required || target_installed();
    let qemu = target && (required || Command::new("qemu-system-arm").arg("--version").output().is_ok());
    let missing = Missing { target: !target, qemu: !qemu };
    let rooms = [
        library::trials(&missing),
        control_step::trials(&missing),
        friction::trials(&missing),
        copies::trials(&missing),
    ];
    libtest_mimic::run(&arguments, rooms.into_iter().flatten().collect()).exit();
}
