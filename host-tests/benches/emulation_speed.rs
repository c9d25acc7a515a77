//! Prints how fast the emulated boards are on this machine, in multiples of real time on one core: `cargo bench -p
//! host-tests --bench emulation_speed`. Needs the board's target.
//!
//! A joint of each board, switched off and then in motion with all of compensation: their control steps differ by half.
//! Each run is repeated from the same snapshot, because the machine's speed is not the same at any time.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4};
use emulator::program::Program;
use host_tests::bare_metal::build;
use host_tests::emulated::Bench;
use host_tests::emulated::bench::actuator;
use host_tests::emulated::motion::{Moving, acting_image};
use host_tests::emulated::observed::Observed;
use libtest_mimic::Failed;
use std::error::Error;
use std::time::Instant;

/// Emulated time before the snapshot, s: what runs often is translated by then.
const WARM: f64 = 5.0;
/// Emulated time of a run, s.
const SECONDS: f64 = 1.0;
/// Runs, of which the slowest, the median and the fastest are printed.
const RUNS: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "| program | control steps/s | joint | instructions a control step | million instructions/s | times real time |"
    );
    println!("|---|---|---|---|---|---|");
    measure("b-g431b-esc1", BG431BEsc1::new)?;
    measure("moteus-r4", MoteusR4::new)
}

fn measure<W: Observed + Clone>(name: &str, board: fn(Drivetrain) -> W) -> Result<(), Box<dyn Error>> {
    let program = Program::parse(std::fs::read(build(name, env!("CARGO_TARGET_TMPDIR"))?)?)?;
    let failed = |failed: Failed| failed.message().unwrap_or("failed").to_owned();
    let rate = f64::from(W::CONFIGURATION.bridge.rate);

    let mut off = Bench::new(board, &program).map_err(failed)?;
    off.run(WARM).map_err(failed)?;
    let runs =
        repeated(&off, |bench| bench.run(SECONDS), |bench| bench.emulation.cpu.instructions()).map_err(failed)?;
    report(name, rate, "off", runs);

    let mut moving = Moving::start(board, &actuator(), &program, &acting_image::<W>()).map_err(failed)?;
    moving.run(WARM).map_err(failed)?;
    let runs = repeated(&moving, |moving| moving.run(SECONDS), |moving| moving.bench.emulation.cpu.instructions())
        .map_err(failed)?;
    report(name, rate, "in motion", runs);
    Ok(())
}

/// Duration of each run from a snapshot, s, the shortest first, and the instructions of one.
fn repeated<T: Clone>(
    snapshot: &T,
    run: impl Fn(&mut T) -> Result<(), Failed>,
    instructions: impl Fn(&T) -> u64,
) -> Result<(Vec<f64>, u64), Failed> {
    let mut durations = Vec::new();
    let mut executed = 0;
    for _ in 0..RUNS {
        let mut snapshot = snapshot.clone();
        let before = instructions(&snapshot);
        let begin = Instant::now();
        run(&mut snapshot)?;
        durations.push(begin.elapsed().as_secs_f64());
        executed = instructions(&snapshot) - before;
    }
    durations.sort_by(f64::total_cmp);
    Ok((durations, executed))
}

fn report(name: &str, rate: f64, joint: &str, (durations, instructions): (Vec<f64>, u64)) {
    let times = |duration: &f64| SECONDS / duration;
    let (Some(fastest), Some(slowest)) = (durations.first().map(times), durations.last().map(times)) else { return };
    let median = times(&durations[RUNS / 2]);
    let a_step = instructions as f64 / (SECONDS * rate);
    let speed = instructions as f64 / SECONDS * median * 1e-6;
    println!("| {name} | {rate:.0} | {joint} | {a_step:.0} | {speed:.0} | {slowest:.1} {median:.1} {fastest:.1} |");
}
