//! A board with its program, on a bench supply.

use crate::bare_metal::build;
use emulator::board::{Drivetrain, Wired};
use emulator::chip::time::Instant;
use emulator::cpu::End;
use emulator::emulation::Emulation;
use emulator::program::Program;
use emulator::rtt::Messages;
use libtest_mimic::Failed;
use plant::ActuatorParameters;

/// Voltage of the supply, V.
pub const SUPPLY: f64 = 18.0;
/// What runs at most between two looks at the log, whose buffer is small, ps.
const PART: u64 = 20_000_000_000;

/// The actuator on the bench: the reference, aligned, without a payload, on the supply.
pub fn actuator() -> ActuatorParameters {
    let mut parameters = ActuatorParameters::reference().aligned().without_payload();
    parameters.bus.source_voltage = SUPPLY;
    parameters
}

/// A board's program as it is flashed, below a test's temporary folder.
///
/// # Errors
/// What the compiler says, or a file that is no program.
pub fn program(board: &str, temporary: &str) -> Result<Program, Failed> {
    let elf = std::fs::read(build(board, temporary)?)?;
    Ok(Program::parse(elf)?)
}

/// A board with its program.
pub struct Bench<W: Wired> {
    /// Core, chip and board.
    pub emulation: Emulation<W>,
    messages: Messages,
    bytes: Vec<u8>,
}

impl<W: Wired> Bench<W> {
    /// Powered up, with the bench's [`actuator`] and with nothing in flash but the program.
    ///
    /// # Errors
    /// What plant or emulation refuse.
    pub fn new(board: impl FnOnce(Drivetrain) -> W, program: &Program) -> Result<Self, Failed> {
        Self::with(board, &actuator(), program)
    }

    /// The same with another actuator.
    ///
    /// # Errors
    /// What plant or emulation refuse.
    pub fn with(
        board: impl FnOnce(Drivetrain) -> W,
        actuator: &ActuatorParameters,
        program: &Program,
    ) -> Result<Self, Failed> {
        let emulation = Emulation::new(board(Drivetrain::new(*actuator, 25.0, 1)?), program)?;
        let messages = Messages::of(program)?.ok_or("the program logs without defmt")?;
        Ok(Self { emulation, messages, bytes: Vec::new() })
    }

    /// Runs on; whatever ends the run before is an error.
    ///
    /// # Errors
    /// What ended it.
    pub fn run(&mut self, seconds: f64) -> Result<(), Failed> {
        self.run_with(seconds, |_| Ok(()))
    }

    /// The same; wherever the core's watch stops it, `reached` looks, and the run goes on.
    ///
    /// # Errors
    /// What ended it, or what `reached` says.
    pub fn run_with(
        &mut self,
        seconds: f64,
        mut reached: impl FnMut(&mut Emulation<W>) -> Result<(), Failed>,
    ) -> Result<(), Failed> {
        let end = Instant(self.emulation.now().0 + (seconds * 1e12) as u64);
        loop {
            let part = Instant(self.emulation.now().0 + PART);
            let ended = self.emulation.run_until(end.min(part));
            self.bytes.extend(self.emulation.log());
            match ended {
                None if self.emulation.now() >= end => return Ok(()),
                None => {}
                Some(End::Reached { .. }) => reached(&mut self.emulation)?,
                Some(end) => return Err(format!("after {:.6} s: {end}", self.emulation.now().seconds()).into()),
            }
        }
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

    /// The log says something.
    ///
    /// # Errors
    /// It does not.
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
}
