//! The trim of the boards' oscillator: a setting that acts as soon as it is taken, and outlasts a loss of power
//! once it is stored.

use emulator::board::{Drivetrain, Wired};
use emulator::bus::{Bus, Width};
use host_tests::emulated::Bench;
use host_tests::emulated::bench::program;
use host_tests::on_each_board;
use joint_firmware::motor::setting::Name;
use libtest_mimic::{Failed, Trial};

const NODE: u8 = 5;
/// RCC_ICSCR (RM0440, 7.4.2): HSITRIM in bits 24 to 30.
const ICSCR: u32 = 0x4002_1004;
const TRIM: (u16, u8) = (0x2105, 1);
const FACTORY: u32 = 64;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    on_each_board!("trims_its_oscillator", trims).into()
}

/// The trim in the oscillator's register.
fn trimmed<W: Wired>(bench: &mut Bench<W>) -> Result<u32, Failed> {
    let now = bench.emulation.cpu.now();
    let read = Bus::read(&mut bench.emulation.cpu.bus, now, ICSCR, Width::Word);
    Ok(read.map_err(|refusal| format!("{refusal:?}"))? >> 24 & 0x7f)
}

fn expect<T: PartialEq + std::fmt::Debug>(what: &str, found: T, expected: T) -> Result<(), Failed> {
    if found == expected { Ok(()) } else { Err(format!("{what}: {found:?} instead of {expected:?}").into()) }
}

fn trims<W: Wired>(board: fn(Drivetrain) -> W) -> Result<(), Failed> {
    let mut bench = Bench::new(board, &program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?)?;
    bench.run(0.3)?;
    bench.give_node_id(NODE)?;
    expect("of a new board", (trimmed(&mut bench)?, bench.number(NODE, TRIM.0, TRIM.1)?), (FACTORY, FACTORY))?;

    let stage = |bench: &mut Bench<W>, trim: u8| bench.download(NODE, TRIM.0, TRIM.1, &[trim]);
    let take = |bench: &mut Bench<W>| bench.download(NODE, 0x2100, 1, &[1]);
    // Beyond its range, from both sides: refused by its name, and nothing happens.
    for beyond in [53, 75] {
        stage(&mut bench, beyond)?;
        expect("taken", take(&mut bench).is_ok(), false)?;
        expect("2100h:3", Name::from_code(bench.number(NODE, 0x2100, 3)?).text(), "oscillator trim")?;
        expect("after a refusal", trimmed(&mut bench)?, FACTORY)?;
    }
    // Staged it does nothing, taken it acts, and the joint goes on.
    stage(&mut bench, 70)?;
    expect("staged", trimmed(&mut bench)?, FACTORY)?;
    take(&mut bench)?;
    expect("taken", trimmed(&mut bench)?, 70)?;
    bench.restart(NODE)?;
    expect("not stored, after a loss of power", trimmed(&mut bench)?, FACTORY)?;
    for trim in [54, 74] {
        stage(&mut bench, trim)?;
        take(&mut bench)?;
        bench.download(NODE, 0x1010, 1, b"save")?;
        bench.restart(NODE)?;
        expect("stored, after a loss of power", trimmed(&mut bench)?, u32::from(trim))?;
        expect("2105h:1", bench.number(NODE, TRIM.0, TRIM.1)?, u32::from(trim))?;
    }
    bench.download(NODE, 0x1011, 1, b"load")?;
    bench.restart(NODE)?;
    expect("restored", trimmed(&mut bench)?, FACTORY)
}
