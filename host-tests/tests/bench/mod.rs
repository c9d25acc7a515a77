//! A board with its program, as it is flashed, on a bench supply; a client on its bus.

pub mod client;

use emulator::board::{Drivetrain, Wired};
use emulator::bus::{Bus, Width};
use emulator::emulation::Emulation;
use emulator::program::Program;
use emulator::rtt::Messages;
use host_tests::bare_metal::build;
use libtest_mimic::Failed;
use plant::ActuatorParameters;
use std::ops::Range;

/// What the stack is full of before the program starts.
const PAINT: u32 = 0xa5a5_5a5a;

/// A board with its program, on a bench supply.
pub struct Bench<W: Wired> {
    /// The board with its program.
    pub emulation: Emulation<W>,
    messages: Messages,
    bytes: Vec<u8>,
    stack: Range<u32>,
}

impl<W: Wired> Bench<W> {
    /// With the program that is called as its board.
    pub fn new(board: impl FnOnce(Drivetrain) -> W) -> Result<Self, Failed> {
        Self::of(W::NAME, board)
    }

    /// With one of the board's programs.
    pub fn of(program: &str, board: impl FnOnce(Drivetrain) -> W) -> Result<Self, Failed> {
        let mut parameters = ActuatorParameters::reference().aligned().without_payload();
        parameters.bus.source_voltage = 18.0;
        let program = Program::parse(std::fs::read(build(program, env!("CARGO_TARGET_TMPDIR"))?)?)
            .map_err(|error| format!("{error:?}"))?;
        let mut emulation = Emulation::new(board(Drivetrain::new(parameters, 25.0, 1)?), &program)?;
        let symbol = |name: &str| program.symbol(name).map(|symbol| symbol.address).ok_or(format!("no {name}"));
        let stack = symbol("_stack_end")?..symbol("_stack_start")?;
        for address in stack.clone().step_by(4) {
            emulation.cpu.bus.write(0, address, Width::Word, PAINT).map_err(|error| format!("{error:?}"))?;
        }
        let messages = Messages::of(&program)?.ok_or("the program logs without defmt")?;
        Ok(Self { emulation, messages, bytes: Vec::new(), stack })
    }

    /// Runs on; whatever ends the run before is an error.
    pub fn run(&mut self, seconds: f64) -> Result<(), Failed> {
        let parts = (seconds / 0.02).ceil();
        for _ in 0..parts as u32 {
            let end = self.emulation.run(seconds / parts);
            // The buffer of the log is small.
            self.bytes.extend(self.emulation.log());
            if let Some(end) = end {
                return Err(format!("after {:.6} s: {end}", self.emulation.now().seconds()).into());
            }
        }
        Ok(())
    }

    /// The log so far.
    pub fn log(&self) -> String {
        let messages = self.messages.decoder().decode(&self.bytes);
        messages.iter().map(|message| format!("{}\n", message.text)).collect()
    }

    /// What the log says of the joint, last of all.
    pub fn state(&self) -> String {
        let log = self.log();
        let line = log.lines().rfind(|line| line.starts_with("joint: ")).unwrap_or_default();
        line.trim_start_matches("joint: ").split(',').next().unwrap_or_default().to_owned()
    }

    pub fn expect(&self, what: &str) -> Result<(), Failed> {
        match self.log().contains(what) {
            true => Ok(()),
            false => Err(format!("the log does not say \"{what}\":\n{}", self.log()).into()),
        }
    }

    /// The board's own part of the plant and of the bus.
    pub fn board(&mut self) -> &mut W {
        self.emulation.cpu.bus.wiring_mut()
    }

    /// Bytes of the stack that the program has ever written to, and those that it has.
    pub fn stack(&mut self) -> Result<(u32, u32), Failed> {
        let Range { start, end } = self.stack;
        for address in self.stack.clone().step_by(4) {
            let now = self.emulation.cpu.now();
            let word = self.emulation.cpu.bus.read(now, address, Width::Word).map_err(|error| format!("{error:?}"))?;
            if word != PAINT {
                return Ok((end - address, end - start));
            }
        }
        Ok((0, end - start))
    }
}
