//! A friction image on its way into a board's program, as it is flashed, on the emulated boards: the board is silent
//! until LSS gives it a node id, takes the image by block download, proves it, stores it, and starts with it again. How
//! deep the stack got on the way is held against what it has.

use bus::client::cob_id;
use emulator::board::{BG431BEsc1, Drivetrain, Wired};
use emulator::cpu::Origin;
use friction_compensation::friction::physical::PhysicalParameters;
use friction_compensation::friction::regime::MOST_SETS;
use friction_compensation::parameters::certificate::{Certificate, prove};
use friction_compensation::parameters::image::Image;
use friction_compensation::quantity::Torque;
use host_tests::emulated::Bench;
use host_tests::emulated::bench::program;
use host_tests::emulated::observed::Observed;
use host_tests::emulated::stack::PaintedStack;
use host_tests::image_bytes::encoded;
use host_tests::on_each_board;
use host_tests::parameters::{image, tame_within};
use libtest_mimic::{Failed, Trial};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

const NODE: u8 = 5;
/// The B-G431B-ESC1's program.
const ESC1: &str = "b-g431b-esc1";
/// Version of the image.
const VERSION: u32 = 7;
/// Golden vectors: with more, an image of four networks is longer than a slot.
const GOLDEN: usize = 6;
/// Limits of a joint's own configuration, Nm and Nm/Nm in Q16.16.
const OUTPUT: u32 = 2_621;
const TORQUE_GAIN: u32 = 1 << 16;
/// States and commands of 2212h.
const VERIFY: u8 = 1;
const COMMIT: u8 = 3;
const ACTIVE: u32 = 7;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    let mut trials = vec![
        Trial::test("b_g431b_esc1_refuses_an_image_that_computes_otherwise", refuses_an_image),
        Trial::test("b_g431b_esc1_refuses_an_image_with_regimes", refuses_regimes),
    ];
    trials.extend(on_each_board!("takes_an_image_and_starts_with_it", takes_an_image));
    trials
}

/// The first image of a seed that a joint would take, with a network in each of `most_sets` sets.
fn sample(most_sets: usize) -> Image {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    loop {
        let mut parameters = tame_within(&mut random, most_sets);
        for set in &mut parameters.sets {
            // The joint's own configuration permits 0.04 Nm.
            set.physical = PhysicalParameters::default();
            if let Some(network) = &mut set.network {
                network.scale >>= 10;
            }
        }
        let sets = parameters.sets.iter().filter(|set| set.network.is_some()).count();
        let fits = |proved: Certificate| proved.output <= OUTPUT && proved.torque_gain <= TORQUE_GAIN;
        if sets < most_sets || !prove(&parameters).is_ok_and(fits) {
            continue;
        }
        let mut image = image(&mut random, parameters, GOLDEN);
        image.version = VERSION;
        return image;
    }
}

/// Silent without a node id, then part of the bus.
fn take_part<W: Wired>(bench: &mut Bench<W>) -> Result<(), Failed> {
    bench.run(0.2)?;
    let silent = bench.exchange(cob_id::SDO_RECEIVE | u16::from(NODE), &[0x40, 0, 0x10, 0, 0, 0, 0, 0], 0.02)?;
    if !silent.is_empty() {
        return Err(format!("a node without a node id sends {silent:x?}").into());
    }
    bench.give_node_id(NODE)?;
    // Device type of a servo drive.
    expect("device type", bench.number(NODE, 0x1000, 0)?, 0x0002_0192)
}

fn takes_an_image<W: Observed>(board: fn(Drivetrain) -> W) -> Result<(), Failed> {
    let program = program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    let mut bench = Bench::new(board, &program)?;
    let stack = PaintedStack::new(&mut bench.emulation, &program)?;
    let bytes = encoded(&sample(W::CONFIGURATION.parameter_sets));
    take_part(&mut bench)?;
    expect("version before", bench.number(NODE, 0x2213, 1)?, 0)?;
    bench.download(NODE, 0x2210, 0, &bytes)?;
    bench.download(NODE, 0x2212, 1, &[VERIFY])?;
    expect("result of verification", bench.number(NODE, 0x2212, 3)?, 0)?;
    bench.download(NODE, 0x2212, 1, &[COMMIT])?;
    for _ in 0..100 {
        if bench.number(NODE, 0x2212, 2)? == ACTIVE {
            break;
        }
        bench.run(0.01)?;
    }
    expect("state", bench.number(NODE, 0x2212, 2)?, ACTIVE)?;
    expect("version", bench.number(NODE, 0x2213, 1)?, VERSION)?;
    // Other stored contents take the same way through the SDO server.
    bench.download(NODE, 0x1010, 1, b"save")?;

    let (used, region) = stack.used(&mut bench.emulation)?;
    // If it learned something before, it has it from flash now.
    let booted = bench.exchange(cob_id::NMT, &[0x81, NODE], 0.5)?;
    bench.has_booted(NODE, &booted)?;
    match bench.emulation.resets() {
        [(_, Origin::Program)] => {}
        resets => return Err(format!("{resets:?}\n{}", bench.log()).into()),
    }
    expect("version after the restart", bench.number(NODE, 0x2213, 1)?, VERSION)?;
    let read = bench.upload(NODE, 0x2211, 0)?;
    if read != bytes {
        return Err(format!("{} other bytes than the {} stored", read.len(), bytes.len()).into());
    }
    if bench.faults() != 0 {
        return Err(bench.log().into());
    }
    let used = used.max(stack.used(&mut bench.emulation)?.0);
    println!("{}: {used} of {region} B of stack used", W::NAME);
    match used + MARGIN <= region {
        true => Ok(()),
        false => Err(format!("{used} of {region} B of stack used").into()),
    }
}

/// Bytes of stack that nothing has touched: an exception's frame, twice.
const MARGIN: u32 = 2 * 104;

/// The golden vectors are evaluated on the device: one bit of one of them is enough.
fn refuses_an_image() -> Result<(), Failed> {
    let mut bench = Bench::new(BG431BEsc1::new, &program(ESC1, env!("CARGO_TARGET_TMPDIR"))?)?;
    let mut image = sample(BG431BEsc1::CONFIGURATION.parameter_sets);
    let vector = image.golden.last_mut().ok_or("no golden vector")?;
    vector.expected.physical = Torque::from_bits(vector.expected.physical.to_bits() ^ 1);
    take_part(&mut bench)?;
    bench.download(NODE, 0x2210, 0, &encoded(&image))?;
    match bench.download(NODE, 0x2212, 1, &[VERIFY]) {
        Err(refused) if refused.message().is_some_and(|text| text.contains("Aborted")) => {}
        other => return Err(format!("verified: {other:?}").into()),
    }
    expect("state", bench.number(NODE, 0x2212, 2)?, 1)?;
    expect("version", bench.number(NODE, 0x2213, 1)?, 0)
}

/// Checks that it has no regimes: an image that has is refused before its first byte where it is too long, and else by
/// what it is.
fn refuses_regimes() -> Result<(), Failed> {
    let mut bench = Bench::new(BG431BEsc1::new, &program(ESC1, env!("CARGO_TARGET_TMPDIR"))?)?;
    take_part(&mut bench)?;
    let aborted = |outcome: Result<(), Failed>| match outcome {
        Err(refused) if refused.message().is_some_and(|text| text.contains("Aborted")) => Ok(()),
        other => Err(Failed::from(format!("taken: {other:?}"))),
    };
    aborted(bench.download(NODE, 0x2210, 0, &encoded(&sample(MOST_SETS))))?;
    expect("state", bench.number(NODE, 0x2212, 2)?, 0)?;
    let mut friction = sample(2).friction;
    friction.sets.iter_mut().for_each(|set| set.network = None);
    let short = image(&mut ChaCha8Rng::seed_from_u64(12), friction, 1);
    bench.download(NODE, 0x2210, 0, &encoded(&short))?;
    aborted(bench.download(NODE, 0x2212, 1, &[VERIFY]))?;
    expect("result of its verification", bench.number(NODE, 0x2212, 3)?, 0x0208)?;
    expect("version", bench.number(NODE, 0x2213, 1)?, 0)
}

fn expect(what: &str, found: u32, expected: u32) -> Result<(), Failed> {
    match found == expected {
        true => Ok(()),
        false => Err(format!("{what}: {found:#x} instead of {expected:#x}").into()),
    }
}
