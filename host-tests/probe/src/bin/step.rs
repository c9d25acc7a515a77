//! Whole control steps on a Cortex-M4F: replays recorded runs and prints for each the hash of what the steps led to.
//!
//! Built as the boards' programs are. Each control step is one call of [`counted_step`] from [`run`], so that whoever
//! traces the program can tell its instructions from everything else.
#![no_std]
#![no_main]

#[path = "../../../../src/board/copy.rs"]
mod copy;
#[path = "../core.rs"]
mod core_support;
#[path = "../replay.rs"]
mod replay;

use core_support::{exit, print};
use joint_firmware::joint::{Active, Bridge, Demand, Joint, Measurements, Slow};
use replay::{SCENARIOS, SEED, START, STEPS, WORDS, demand, hash, measured, prepare, starting};

/// The image behind its length (two bytes, little-endian), then the steps of the start and of
/// all runs, little-endian words.
static RUNS: &[u8] = include_bytes!(env!("PROBE_RUNS"));

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    exit()
}

/// Control step that is counted.
#[unsafe(no_mangle)]
#[inline(never)]
fn counted_step(joint: &mut Joint, active: &Active, demand: &Demand, slow: &Slow, measured: &Measurements) -> Bridge {
    joint.control_step(active, demand, slow, measured)
}

#[unsafe(no_mangle)]
extern "C" fn run() -> ! {
    let Some((length, rest)) = RUNS.split_first_chunk::<2>() else { exit() };
    let Some((image, mut rest)) = rest.split_at_checked(u16::from_le_bytes(*length) as usize) else { exit() };
    let mut started = Joint::new();
    let Some(active) = prepare(&SCENARIOS[0], core::hint::black_box(image)) else { exit() };
    for n in 0..START {
        let Some((measured, slow)) = next(&mut rest) else { exit() };
        counted_step(&mut started, &active, &starting(n), &slow, &measured);
    }
    for scenario in &SCENARIOS {
        let Some(active) = prepare(scenario, core::hint::black_box(image)) else { exit() };
        let mut joint = started.clone();
        let mut sum = SEED;
        for n in 0..STEPS {
            let Some((measured, slow)) = next(&mut rest) else { exit() };
            let bridge = counted_step(&mut joint, &active, &demand(scenario, n), &slow, &measured);
            sum = hash(sum, &joint, &bridge);
        }
        print(sum);
    }
    exit()
}

/// The next recorded step.
fn next(rest: &mut &[u8]) -> Option<(Measurements, Slow)> {
    let mut words = [0; WORDS];
    for word in &mut words {
        let (bytes, after) = rest.split_first_chunk::<4>()?;
        *word = u32::from_le_bytes(*bytes);
        *rest = after;
    }
    Some(measured(&words))
}
