//! The emulated boards are deterministic: a program's run is the same to the picosecond and the bit whenever it is
//! repeated, however its time is cut into pieces, whether or not somebody watches, by whichever clone it is gone on
//! with, and whatever of it is translated.

use emulator::board::{Drivetrain, Wired, Witnessed};
use emulator::chip::fdcan::line::CanFrame;
use emulator::cpu::{End, Watch};
use emulator::emulation::Emulation;
use emulator::program::Program;
use host_tests::emulated::bench::program;
use host_tests::on_each_board;
use libtest_mimic::{Failed, Trial};
use plant::ActuatorParameters;

/// Cycles of the core, 170 MHz but for the first moments, between two things that somebody does.
const STEP: u64 = 170_000;
/// Number of steps: control has begun, and the bus has answered.
const STEPS: u64 = 300;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    on_each_board!("does_the_same_every_time", same_every_time).into()
}

/// Options of a run.
#[derive(Clone, Copy)]
struct How {
    /// Calls for a step.
    pieces: u64,
    watched: bool,
    /// `true` if at each step a clone goes on instead.
    cloned: bool,
    /// Number of times that code is come across before it is translated.
    translated: Option<u32>,
    /// Seed of the sensors' noise.
    seed: u64,
}

/// Number of a run in which somebody shakes the joint and asks for a node, and the log.
fn run<W: Wired + Clone>(board: fn(Drivetrain) -> W, program: &Program, how: How) -> Result<(u64, Vec<u8>), Failed> {
    let drivetrain = Drivetrain::new(ActuatorParameters::reference().aligned(), 25.0, how.seed)?;
    let mut emulation = Emulation::new(Witnessed::new(board(drivetrain)), program)?;
    emulation.cpu.set_translation(how.translated);
    if how.watched {
        emulation.cpu.set_watch(Some(Watch::new()));
    }
    let mut log = Vec::new();
    for step in 0..STEPS {
        let wiring = emulation.cpu.bus.wiring_mut();
        wiring.drivetrain().external_torque = 6.0 * (0.02 * step as f64).sin();
        if step == 200 {
            let frame = CanFrame::standard(0x7e5, &[4, 1, 0, 0, 0, 0, 0, 0]).ok_or("no such frame")?;
            let now = emulation.now();
            emulation.cpu.bus.wiring_mut().line().send(now, frame);
            emulation.cpu.bus.wiring_changed();
        }
        if how.cloned {
            emulation = emulation.clone();
        }
        for piece in 1..=how.pieces {
            match emulation.cpu.run(STEP * step + STEP * piece / how.pieces) {
                End::Time => {}
                end => return Err(format!("after {:.6} s: {end}", emulation.now().seconds()).into()),
            }
        }
        log.extend(emulation.log());
    }
    Ok((emulation.fingerprint(), log))
}

fn same_every_time<W: Wired + Clone>(board: fn(Drivetrain) -> W) -> Result<(), Failed> {
    let program = program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    let once = How { pieces: 1, watched: false, cloned: false, translated: Some(500), seed: 1 };
    let first = run(board, &program, once)?;
    for (what, how) in [
        ("again", once),
        ("in many pieces", How { pieces: 97, ..once }),
        ("watched", How { watched: true, ..once }),
        ("by clones", How { cloned: true, ..once }),
        ("translated at once", How { translated: Some(8), ..once }),
        ("never translated", How { translated: None, ..once }),
    ] {
        if run(board, &program, how)? != first {
            return Err(format!("{what}, the run is another one").into());
        }
    }
    // The comparison does tell runs apart: one bit of noise is enough.
    match run(board, &program, How { seed: 2, ..once })? == first {
        true => Err("other noise makes no difference".into()),
        false => Ok(()),
    }
}
