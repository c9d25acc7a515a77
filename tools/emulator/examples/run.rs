//! Runs a board's program: `cargo run --release -p emulator --example run -- b-g431b-esc1 PROGRAM SECONDS`.

use emulator::board::{Drivetrain, Wired, WithBoard, with_board};
use emulator::emulation::Emulation;
use emulator::program::Program;
use plant::ActuatorParameters;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [board, path, seconds] = &arguments[..] else { return Err("BOARD PROGRAM SECONDS".into()) };
    let program = Program::parse(std::fs::read(path)?)?;
    let run = Run { program, seconds: seconds.parse()? };
    with_board(board, run).unwrap_or_else(|| Err(format!("no board {board}").into()))
}

/// A run of a program.
struct Run {
    program: Program,
    seconds: f64,
}

impl WithBoard for Run {
    type Outcome = Result<(), Box<dyn std::error::Error>>;

    fn run<W: Wired>(self, new: fn(Drivetrain) -> W) -> Self::Outcome {
        let drivetrain = Drivetrain::new(ActuatorParameters::reference().aligned(), 25.0, 1)?;
        run(new(drivetrain), &self.program, self.seconds)
    }
}

fn run<W: Wired>(board: W, program: &Program, seconds: f64) -> Result<(), Box<dyn std::error::Error>> {
    let mut emulation = Emulation::new(board, program)?;
    let log = emulator::rtt::Messages::of(program)?;
    let mut decoder = log.as_ref().map(|log| log.decoder());
    let start = Instant::now();
    let mut passed = 0.0;
    while passed < seconds {
        let end = emulation.run(0.01);
        passed += 0.01;
        let bytes = emulation.log();
        if let Some(decoder) = &mut decoder {
            for message in decoder.decode(&bytes) {
                println!("{:.6} {message:?}", emulation.now().seconds());
            }
        }
        if let Some(end) = end {
            println!("{:.6} {end}", emulation.now().seconds());
            break;
        }
    }
    let (elapsed, cpu) = (start.elapsed().as_secs_f64(), &emulation.cpu);
    println!(
        "{passed:.2} s in {elapsed:.2} s: {:.1} times real time, {:.0} million instructions/s; resets {:?}",
        passed / elapsed,
        cpu.instructions() as f64 / elapsed * 1e-6,
        emulation.resets()
    );
    for (number, times) in cpu.exception_times() {
        println!("exception {number}: {times:?}");
    }
    Ok(())
}
