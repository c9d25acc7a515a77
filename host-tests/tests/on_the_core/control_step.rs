//! Cost of a control step on the board's core, part by part, and that it gives the host's bits: recorded runs of the
//! whole joint, replayed on an emulated Cortex-M4F, of which every instruction is counted.
//!
//! The code is built as each board's program is and runs on the core of `tools/emulator`; the board's own part of the
//! interrupt (converters, timer, report) is not among it. Most instructions of every part are held to
//! `.ci/instructions`; `cargo bench -p host-tests --bench budget` prints the same in full, with cycles. The bits are
//! also those of `qemu-system-arm`.

use crate::Missing;
use host_tests::bare_metal::{BOARDS, Board};
use host_tests::control_steps::{image_bytes, input, record, replayed_here};
use host_tests::counted_steps::{PARTS, counted};
use host_tests::limits::{Most, hold};
use libtest_mimic::{Failed, Trial};
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

pub fn trials(missing: &Missing) -> Vec<Trial> {
    let trials = BOARDS.iter().flat_map(|board| {
        let costs =
            format!("a_control_step_of_{}_takes_the_instructions_that_it_may_and_gives_the_host_s_bits", board.name);
        let bits = format!("a_control_step_of_{}_gives_the_host_s_bits_on_qemu", board.name);
        [
            Trial::test(costs, move || costs_what_it_may(board)).with_ignored_flag(missing.target),
            Trial::test(bits, move || same_bits_on_qemu(board)).with_ignored_flag(missing.qemu),
        ]
    });
    trials.collect()
}

/// Input that the program is built around, and the hashes of the runs on this machine.
type Recorded = (Vec<u8>, Vec<u32>);

fn recorded(board: &Board) -> Result<&'static Recorded, Failed> {
    static WITH_REGIMES: OnceLock<Result<Recorded, String>> = OnceLock::new();
    static WITHOUT: OnceLock<Result<Recorded, String>> = OnceLock::new();
    let sets = board.parameter_sets;
    let place = if sets == 1 { &WITHOUT } else { &WITH_REGIMES };
    let record = || {
        let (image, steps) = (image_bytes(sets), record(sets).map_err(|error| error.to_string())?);
        let hashes = replayed_here(&image, &steps).ok_or("the image is refused")?;
        Ok((input(&image, &steps), hashes))
    };
    place.get_or_init(record).as_ref().map_err(Failed::from)
}

fn build(board: &Board) -> Result<PathBuf, Failed> {
    let (input, _) = recorded(board)?;
    Ok(board.probe("step", Some(("PROBE_RUNS", input)), board.room(), env!("CARGO_TARGET_TMPDIR"))?)
}

fn costs_what_it_may(board: &Board) -> Result<(), Failed> {
    let (hashes, runs) = counted(&build(board)?)?;
    let (_, expected) = recorded(board)?;
    if hashes != *expected {
        return Err(format!("core {hashes:08x?}, host {expected:08x?}").into());
    }
    let steps = || runs.iter().flatten();
    let most = |place: usize| steps().map(|step| step.parts[place].instructions).max().unwrap_or(0);
    let mut measured: Vec<Most> = PARTS.iter().enumerate().map(|(place, (name, _))| (*name, most(place))).collect();
    measured.push(("longest step", steps().map(|step| step.sum.instructions).max().unwrap_or(0)));
    measured.iter().for_each(|(name, most)| println!("{}: {most:>5} {name}", board.name));
    if measured.iter().any(|(_, most)| *most == 0) {
        return Err("a part of the step was never seen".into());
    }
    Ok(hold(board.name, &measured)?)
}

fn same_bits_on_qemu(board: &Board) -> Result<(), Failed> {
    let output = Command::new("qemu-system-arm")
        .args(["-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(build(board)?)
        .output()?;
    let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let hashes: Vec<u32> = text.lines().filter_map(|line| u32::from_str_radix(line.trim(), 16).ok()).collect();
    let (_, expected) = recorded(board)?;
    match hashes == *expected {
        true => Ok(()),
        false => Err(format!("qemu {hashes:08x?}, host {expected:08x?}; {text}").into()),
    }
}
