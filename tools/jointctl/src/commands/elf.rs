//! `jointctl sim --elf`: a board's program, as it is flashed, on an emulated board on a CAN bus.

use super::CommandError;
use clap::{Args, ValueEnum};
use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4, Wired};
use emulator::chip::time::Instant;
use emulator::emulation::Emulation;
use emulator::program::Program;
use emulator::rtt::Messages;
use node::{EmulatedNode, serve};
use plant::ActuatorParameters;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// Supply of an actuator that nobody described, V: within what both boards permit until they are commissioned.
const SUPPLY: f64 = 18.0;
/// Temperature of the surroundings, °C.
const AMBIENT: f64 = 25.0;

/// Arguments of `sim` that put a board's program on the bus.
#[derive(Debug, Args)]
pub struct OnBoard {
    /// Run this program of a board, as probe-rs would flash it, on an emulated board instead of a virtual joint; its log goes to the terminal. What it
    /// stores is forgotten when it ends
    #[arg(long, value_name = "ELF", requires_all = ["bus", "board"], conflicts_with_all = ["node", "serial", "storage", "image", "config"])]
    elf: Option<PathBuf>,
    /// The board that the program is for
    #[arg(long, value_name = "BOARD", value_enum, requires = "elf")]
    board: Option<Board>,
}

/// The boards.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Board {
    #[value(name = "b-g431b-esc1")]
    BG431BEsc1,
    #[value(name = "moteus-r4")]
    MoteusR4,
}

impl OnBoard {
    /// Whether a program is named.
    pub const fn is_named(&self) -> bool {
        self.elf.is_some()
    }

    /// Runs the program on the bus until `stop`, behind an actuator: as it was described, or the reference one at a low voltage. What the machine was too
    /// slow for, s.
    pub fn run(&self, name: &str, plant: Option<&ActuatorParameters>, stop: &AtomicBool) -> Result<f64, CommandError> {
        let (Some(path), Some(board)) = (&self.elf, self.board) else { return Ok(0.0) };
        let failed = |error: String| CommandError::Bus(format!("{}: {error}", path.display()));
        let elf = std::fs::read(path).map_err(|source| CommandError::Read { path: path.clone(), source })?;
        let program = Program::parse(elf).map_err(|error| failed(error.to_string()))?;
        let mut parameters = plant.copied().unwrap_or_else(|| ActuatorParameters::reference().aligned());
        if plant.is_none() {
            parameters.bus.source_voltage = SUPPLY;
        }
        let drivetrain = Drivetrain::new(parameters, AMBIENT, 1).map_err(|error| failed(error.to_string()))?;
        match board {
            Board::BG431BEsc1 => served(BG431BEsc1::new(drivetrain), &program, name, stop).map_err(failed),
            Board::MoteusR4 => served(MoteusR4::new(drivetrain), &program, name, stop).map_err(failed),
        }
    }
}

fn served<W: Wired>(board: W, program: &Program, bus: &str, stop: &AtomicBool) -> Result<f64, String> {
    let emulation = Emulation::new(board, program).map_err(|error| error.to_string())?;
    let transport = bus::open(bus).map_err(|error| error.to_string())?;
    let messages = Messages::of(program)?;
    let mut decoder = messages.as_ref().map(Messages::decoder);
    eprintln!("{} on {bus}, emulated", W::NAME);
    let mut node = EmulatedNode::new(emulation, |emulation: &mut Emulation<W>, until: Instant| {
        let ended = emulation.run_until(until);
        let log = emulation.log();
        if let Some(decoder) = &mut decoder {
            for message in decoder.decode(&log) {
                eprintln!("{:9.3} s  {}", emulation.now().seconds(), message.text);
            }
        }
        ended.map_or(Ok(()), |end| Err(format!("after {:.6} s: {end}", emulation.now().seconds())))
    });
    serve(&mut node, &*transport, stop).map_err(|error| error.to_string())
}
