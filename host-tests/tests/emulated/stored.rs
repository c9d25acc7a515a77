//! Storage of the flashed programs: a configuration that is damaged keeps the joint off, and stores are counted over a
//! reset of the chip.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4};
use host_tests::emulated::Bench;
use host_tests::emulated::bench::program;
use host_tests::emulated::observed::Observed;
use joint_firmware::objects::STORES;
use joint_firmware::parameters::slots::{DOUBLE_WORD, OVERHEAD, PAGE};
use libtest_mimic::{Failed, Trial};

const NODE: u8 = 5;
const DAMAGED: u8 = 1;
const LEFT: u8 = 2;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    vec![
        Trial::test("moteus_r4_counts_stores_over_resets_and_stays_off_without_its_configuration", || {
            stores(MoteusR4::new, true, 4)
        }),
        Trial::test("b_g431b_esc1_counts_stores_over_resets_and_stays_off_without_its_configuration", || {
            stores(BG431BEsc1::new, false, 2)
        }),
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

/// LSS: the node id that the joint has is stored.
fn store_node_id<W: Observed>(bench: &mut Bench<W>) -> Result<(), Failed> {
    for request in [
        [4, 1, 0, 0, 0, 0, 0, 0],
        [0x11, NODE, 0, 0, 0, 0, 0, 0],
        [0x17, 0, 0, 0, 0, 0, 0, 0],
        [4, 0, 0, 0, 0, 0, 0, 0],
    ] {
        bench.exchange(0x7E5, &request, 0.1)?;
    }
    Ok(())
}

/// `ready`: the joint is in switch on disabled without its encoder's index. `page`: the first of the record's.
fn stores<W: Observed>(board: fn(Drivetrain) -> W, ready: bool, page: usize) -> Result<(), Failed> {
    let mut bench = named(board)?;
    let full = u32::from(STORES);
    store_node_id(&mut bench)?;
    let left = |bench: &mut Bench<W>| bench.number(NODE, 0x2304, LEFT);
    is("left behind the node id", left(&mut bench)?, full - 1)?;
    let store = |bench: &mut Bench<W>, heartbeat: u16| -> Result<(), Failed> {
        bench.download(NODE, 0x1017, 0, &heartbeat.to_le_bytes())?;
        bench.download(NODE, 0x1010, 1, b"save")?;
        bench.written().map(drop)
    };
    store(&mut bench, 500)?;
    store(&mut bench, 500)?;
    is("left behind a store, and one of the same", left(&mut bench)?, full - 2)?;
    // NMT: reset node, which resets the chip.
    bench.exchange(0, &[0x81, NODE], 0.0)?;
    bench.booted(NODE)?;
    is("left behind a reset of the node", left(&mut bench)?, full - 2)?;
    is("resets", bench.emulation.resets().len(), 1)?;
    bench.restart(NODE)?;
    is("left behind a loss of power", left(&mut bench)?, full)?;

    // The newest of three records lies in the first of two pages.
    store(&mut bench, 600)?;
    let program = program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    let start = program.symbol("__parameters_start").ok_or("the program names no parameters")?.address;
    // A double word behind the slot's four, in the midst of the record.
    let damaged = start + (page * PAGE + OVERHEAD + 20 * DOUBLE_WORD) as u32;
    if !bench.emulation.cpu.bus.program(damaged, &[0; DOUBLE_WORD]) {
        return Err("the record is not damaged".into());
    }
    for start in 1..=2 {
        bench.restart(NODE)?;
        bench.run(0.2)?;
        is("damaged", bench.number(NODE, 0x2304, DAMAGED)?, 2)?;
        is("error register", bench.number(NODE, 0x1001, 0)?, 0x81)?;
        is("what was stored before", bench.number(NODE, 0x1017, 0)?, 500)?;
        bench.exchange(0, &[1, NODE], 0.002)?;
        for word in [0x80u16, 6, 7, 15] {
            bench.download(NODE, 0x6040, 0, &word.to_le_bytes())?;
            bench.run(0.005)?;
        }
        let expected = if ready { 0x40 } else { 0 };
        is(&format!("state at start {start}"), bench.number(NODE, 0x6041, 0)? & 0x4F, expected)?;
        bench.exchange(0, &[0x80, NODE], 0.002)?;
    }
    bench.download(NODE, 0x1010, 3, b"save")?;
    bench.written()?;
    for _ in 0..2 {
        is("damaged behind a store", bench.number(NODE, 0x2304, DAMAGED)?, 0)?;
        bench.exchange(0, &[1, NODE], 0.002)?;
        bench.download(NODE, 0x6040, 0, &[6, 0])?;
        bench.run(0.005)?;
        if ready {
            is("ready to switch on", bench.number(NODE, 0x6041, 0)? & 0x6F, 0x21)?;
        }
        bench.download(NODE, 0x6040, 0, &[0, 0])?;
        bench.restart(NODE)?;
        bench.run(0.2)?;
    }
    Ok(())
}
