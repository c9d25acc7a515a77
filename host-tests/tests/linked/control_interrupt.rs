//! The control interrupt of the linked programs: it can reach no panic, and nothing of it lies in flash.
//!
//! The proof walks the machine code from the entries of the control interrupt and of the PWM timer's: every branch and
//! call of every function that can be reached, through the linker's veneers and through registers with a constant. A
//! jump that only the running program knows is refused. So
//! is a constant that is an address in the program's flash, from a literal pool or put together by instructions: data
//! there would make the interrupt wait while the flash erases. An address that is computed otherwise is not found out.
//! The open loop may lie in flash: nothing is written there while the bridge switches. So may, in the program of the
//! B-G431B-ESC1, what runs only while operation is enabled, or in braking, or at the start: there flash is written only
//! while the joint is held off.

use crate::thumb;
use host_tests::bare_metal;
use libtest_mimic::{Failed, Trial};
use std::path::{Path, PathBuf};

/// A program, its handlers of the highest priority, and which functions of the control step may lie in flash.
type Checked = (&'static str, [&'static str; 2], fn(&str) -> bool);

const PROGRAMS: [Checked; 2] = [
    ("b-g431b-esc1", ["ADC1_2", "TIM1_UP_TIM16"], |name| is_open_loop(name) || seldom_or_operating(name)),
    ("moteus-r4", ["ADC1_2", "TIM2"], is_open_loop),
];
/// Flash of the larger chip; the smaller one's begins at the same address.
const FLASH: std::ops::Range<u32> = 0x0800_0000..0x0808_0000;

pub fn trials() -> Vec<Trial> {
    let mut trials = vec![Trial::test("a_function_that_can_panic_is_found_out", finds_panics)];
    for (board, handlers, may_lie_in_flash) in PROGRAMS {
        let name = format!("the_control_interrupt_of_{board}_reaches_no_panic_and_nothing_in_flash");
        trials.push(Trial::test(name, move || check(board, handlers, may_lie_in_flash)));
    }
    trials
}

/// The board's program; its path.
fn build(board: &str) -> Result<PathBuf, Failed> {
    Ok(bare_metal::build(board, env!("CARGO_TARGET_TMPDIR"))?)
}

/// Defects of everything that runs from `entry` on.
fn faults(path: &Path, entry: &str, may_lie_in_flash: fn(&str) -> bool) -> Result<Vec<String>, Failed> {
    let program = thumb::Program::parse(&std::fs::read(path)?)?;
    let entry_address = program.address(entry).ok_or(format!("{entry} is not linked"))?;
    let reached = program.reachable(entry_address, |_| false);
    let bytes: u32 = reached.functions.iter().map(|(_, size, _)| size).sum();
    println!("{}: {entry} reaches {} functions, {bytes} B", path.display(), reached.functions.len());
    let mut faults = reached.unclear;
    for (_, _, name) in reached.functions {
        if name.contains("panic") || name.contains("unwrap_failed") || name.contains("expect_failed") {
            faults.push(format!("reaches {name}"));
        }
    }
    let steady = program.reachable(entry_address, may_lie_in_flash);
    for (address, _, name) in steady.functions {
        if FLASH.contains(&address) && !may_lie_in_flash(&name) {
            faults.push(format!("{name} lies in flash, at {address:#010x}"));
        }
    }
    let constants = steady.constants.into_iter().filter(|(word, name)| FLASH.contains(word) && !may_lie_in_flash(name));
    faults.extend(constants.map(|(word, name)| format!("{name} may read flash, at {word:#010x}")));
    Ok(faults)
}

/// Returns `true` if a function belongs to the open loop, by its mangled name.
fn is_open_loop(name: &str) -> bool {
    ["5motor9open_loop", "5joint5Joint15apply_open_loop", "5board7control14publish_window"]
        .iter()
        .any(|part| name.contains(part))
}

/// Returns `true` if a function runs only with the bridge on, in operation ([`Joint::control_step`] asks for the state
/// before) or in braking: the friction model and what adds it, the approach of a position, the torque's bounds, the
/// brake and what the supply bears of it; or only while the bridge is off, when a step that would wait for the flash
/// has waited for its vector already: the offsets. What decides on a state and what begins it runs in both.
///
/// [`Joint::control_step`]: joint_firmware::joint::Joint::control_step
fn seldom_or_operating(name: &str) -> bool {
    [
        "21friction_compensation8friction",
        "21friction_compensation12compensation",
        "19FrictionFeedforward5guard",
        "10motion_law9MotionLaw6follow",
        "10motion_law9MotionLaw5brake",
        "10motion_law9MotionLaw5enter",
        "9limit_law5bound",
        "5joint7offsets",
        "5joint5Joint6decide",
        "11motion_loop10MotionLoop5begin",
        "10motion_law9MotionLaw4ramp",
        "6number11square_root",
        "5joint12regeneration",
        "5motor15field_weakening",
        "19FrictionFeedforward5reset",
        // Veneer of what clears the current loop's memory in them.
        "LongThunk___aeabi_memclr",
    ]
    .iter()
    .any(|part| name.contains(part))
}

fn check(board: &str, handlers: [&str; 2], may_lie_in_flash: fn(&str) -> bool) -> Result<(), Failed> {
    let program = build(board)?;
    let mut found = Vec::new();
    for handler in handlers {
        found.extend(faults(&program, handler, may_lie_in_flash)?);
    }
    match &found[..] {
        [] => Ok(()),
        faults => Err(faults.join("\n").into()),
    }
}

/// The walk is worth something only if it finds what is there: the program's start can panic, and lies in flash.
fn finds_panics() -> Result<(), Failed> {
    let faults = faults(&build("b-g431b-esc1")?, "main", is_open_loop)?;
    let found = |what: &str| faults.iter().any(|fault| fault.contains(what));
    match found("panic") && found("lies in flash") && found("may read flash") {
        true => Ok(()),
        false => Err(faults.join("\n").into()),
    }
}
