//! Prints a number that stands for everything a board's program did while somebody shook the joint and asked it things
//! over the bus, and how fast the run was: what changes the emulator and not the number has changed no result.
//! `cargo run --release -p emulator --example fingerprint -- moteus-r4 PROGRAM SECONDS`.

use emulator::board::{Drivetrain, Wired, WithBoard, Witnessed, with_board};
use emulator::chip::fdcan::line::CanFrame;
use emulator::emulation::Emulation;
use emulator::program::Program;
use plant::ActuatorParameters;
use std::time::Instant;

/// LSS: all nodes to configuration, node id 5, back to waiting; then the device type, again and again.
const FRAMES: [(u32, [u8; 8]); 4] = [
    (0x7e5, [4, 1, 0, 0, 0, 0, 0, 0]),
    (0x7e5, [0x11, 5, 0, 0, 0, 0, 0, 0]),
    (0x7e5, [4, 0, 0, 0, 0, 0, 0, 0]),
    (0x605, [0x40, 0, 0x10, 0, 0, 0, 0, 0]),
];

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
    let mut emulation = Emulation::new(Witnessed::new(board), program)?;
    let (start, mut log) = (Instant::now(), Vec::new());
    for millisecond in 0..(seconds * 1e3) as u32 {
        let time = f64::from(millisecond) * 1e-3;
        emulation.cpu.bus.wiring_mut().drivetrain().external_torque = 6.0 * (20.0 * time).sin();
        if millisecond >= 100 && millisecond % 10 == 0 {
            let which = (millisecond as usize - 100) / 10;
            let (id, data) = FRAMES[which.min(FRAMES.len() - 1)];
            let (now, frame) = (emulation.now(), CanFrame::standard(id, &data).ok_or("no such frame")?);
            emulation.cpu.bus.wiring_mut().line().send(now, frame);
            emulation.cpu.bus.wiring_changed();
        }
        if let Some(end) = emulation.run(1e-3) {
            return Err(format!("{:.6} {end}", emulation.now().seconds()).into());
        }
        log.extend(emulation.log());
    }
    let (elapsed, cpu) = (start.elapsed().as_secs_f64(), &emulation.cpu);
    println!(
        "{:016x}: {} instructions, {} cycles, {} bytes of log; {:.2} times real time, {:.0} million instructions/s",
        emulation.fingerprint(),
        cpu.instructions(),
        cpu.now(),
        log.len(),
        seconds / elapsed,
        cpu.instructions() as f64 / elapsed * 1e-6
    );
    Ok(())
}
