//! Modes of the flashed programs, as 6502h names them.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4};
use host_tests::emulated::Bench;
use host_tests::emulated::bench::program;
use host_tests::emulated::observed::Observed;
use joint_firmware::objects::Operation;
use libtest_mimic::{Failed, Trial};

const NODE: u8 = 5;
/// Modes of a program without the profile modes: CSP, CSV, CST, impedance, open loop.
const WITHOUT_PROFILES: u32 = 0x0003_0380;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    vec![
        Trial::test("moteus_r4_has_the_modes_that_6502h_names", || modes(MoteusR4::new, Operation::SUPPORTED)),
        Trial::test("b_g431b_esc1_has_the_modes_that_6502h_names", || modes(BG431BEsc1::new, WITHOUT_PROFILES)),
    ]
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

fn modes<W: Observed>(board: fn(Drivetrain) -> W, supported: u32) -> Result<(), Failed> {
    let mut bench = named(board)?;
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
