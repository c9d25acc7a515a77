//! Modes of the flashed programs, as 6502h names them.

use emulator::board::Drivetrain;
use host_tests::emulated::Bench;
use host_tests::emulated::bench::program;
use host_tests::emulated::observed::Observed;
use host_tests::on_each_board;
use libtest_mimic::{Failed, Trial};

const NODE: u8 = 5;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    on_each_board!("has_the_modes_that_6502h_names", modes).into()
}

fn named<W: Observed>(board: fn(Drivetrain) -> W) -> Result<Bench<W>, Failed> {
    let mut bench = Bench::new(board, &program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?)?;
    bench.run(0.2)?;
    bench.give_node_id(NODE)?;
    bench.run(0.1)?;
    Ok(bench)
}

fn is<T: PartialEq + std::fmt::Debug>(what: &str, found: T, expected: T) -> Result<(), Failed> {
    if found == expected { Ok(()) } else { Err(format!("{what}: {found:x?}, not {expected:x?}").into()) }
}

fn modes<W: Observed>(board: fn(Drivetrain) -> W) -> Result<(), Failed> {
    let (mut bench, supported) = (named(board)?, W::MODES);
    is("6502h", bench.number(NODE, 0x6502, 0)?, supported)?;
    for mode in -4i8..=12 {
        let there = match mode {
            0 => true,
            1.. => supported >> (mode - 1) & 1 == 1,
            _ => supported >> (15 - i32::from(mode)) & 1 == 1,
        };
        is(&format!("mode {mode} is taken"), bench.download(NODE, 0x6060, 0, &mode.to_le_bytes()).is_ok(), there)?;
        bench.run(0.002)?;
        is(&format!("mode {mode} is shown"), bench.number(NODE, 0x6061, 0)? == u32::from(mode as u8), there)?;
    }
    Ok(())
}
