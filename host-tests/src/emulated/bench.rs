//! A board with its program, on a bench supply.

use crate::bare_metal::build;
use emulator::board::{Drivetrain, Encoder, Wired};
use emulator::chip::time::Instant;
use emulator::cpu::{End, Watch};
use emulator::emulation::Emulation;
use emulator::program::Program;
use emulator::rtt::Messages;
use joint_firmware::joint::fault::Fault;
use libtest_mimic::Failed;
use plant::ActuatorParameters;
use std::sync::Arc;

/// Voltage of the supply, V.
pub const SUPPLY: f64 = 18.0;
/// Longest run between two looks at the log, whose buffer is small, ps.
const PART: u64 = 20_000_000_000;
/// A turn of the rotor and some more, rad.
const TURN: f64 = 1.1 * std::f64::consts::TAU;

/// The actuator on the bench: the reference, aligned, without a payload, on the supply.
pub fn actuator() -> ActuatorParameters {
    let mut parameters = ActuatorParameters::reference().aligned().without_payload();
    parameters.bus.source_voltage = SUPPLY;
    parameters
}

/// A board's program as it is flashed, below a test's temporary folder.
///
/// # Errors
/// Messages of the compiler, or a file that is no program.
pub fn program(board: &str, temporary: &str) -> Result<Program, Failed> {
    let elf = std::fs::read(build(board, temporary)?)?;
    Ok(Program::parse(elf)?)
}

/// A board with its program. A clone is a snapshot.
#[derive(Clone)]
pub struct Bench<W: Wired> {
    /// Core, chip and board.
    pub emulation: Emulation<W>,
    messages: Arc<Messages>,
    bytes: Vec<u8>,
}

impl<W: Wired> Bench<W> {
    /// Powered up, with the bench's [`actuator`] and with nothing in flash but the program.
    ///
    /// # Errors
    /// Refusals of plant or emulation.
    pub fn new(board: impl FnOnce(Drivetrain) -> W, program: &Program) -> Result<Self, Failed> {
        Self::with(board, &actuator(), program)
    }

    /// The same with another actuator; its encoder has the counts that are usual on the board.
    ///
    /// # Errors
    /// Refusals of plant or emulation.
    pub fn with(
        board: impl FnOnce(Drivetrain) -> W,
        actuator: &ActuatorParameters,
        program: &Program,
    ) -> Result<Self, Failed> {
        Self::of(board(Drivetrain::new(*actuator, 25.0, 1)?), program)
    }

    /// The same with an encoder of its own.
    ///
    /// # Errors
    /// A refusal of board, plant or emulation.
    pub fn with_encoder(
        board: impl FnOnce(Drivetrain) -> W,
        actuator: &ActuatorParameters,
        encoder: Encoder,
        program: &Program,
    ) -> Result<Self, Failed> {
        Self::of(board(Drivetrain::new(*actuator, 25.0, 1)?).with_encoder(encoder)?, program)
    }

    fn of(board: W, program: &Program) -> Result<Self, Failed> {
        let emulation = Emulation::new(board, program)?;
        let messages = Messages::of(program)?.ok_or("the program logs without defmt")?;
        let messages = Arc::new(messages);
        Ok(Self { emulation, messages, bytes: Vec::new() })
    }

    /// Has the run stop before every control interrupt, for what [`run_with`](Self::run_with) calls then.
    ///
    /// # Errors
    /// The program has none.
    pub fn stop_at_control_steps(&mut self, program: &Program) -> Result<(), Failed> {
        let handler = program.symbol("ADC1_2").ok_or("the program has no control interrupt")?;
        self.emulation.cpu.set_watch(Some(Watch::new().stop_at(handler.address)));
        Ok(())
    }

    /// Runs on; whatever ends the run before is an error.
    ///
    /// # Errors
    /// Reason for its end.
    pub fn run(&mut self, seconds: f64) -> Result<(), Failed> {
        self.run_with(seconds, |_| Ok(()))
    }

    /// The same; wherever the core's watch stops it, `reached` looks, and the run goes on.
    ///
    /// # Errors
    /// Reason for its end, or the error of `reached`.
    pub fn run_with(
        &mut self,
        seconds: f64,
        mut reached: impl FnMut(&mut Emulation<W>) -> Result<(), Failed>,
    ) -> Result<(), Failed> {
        self.run_until(Instant(self.emulation.now().0 + (seconds * 1e12) as u64), &mut reached)
    }

    /// The same up to an instant.
    ///
    /// # Errors
    /// Those above.
    pub fn run_until(
        &mut self,
        end: Instant,
        reached: &mut impl FnMut(&mut Emulation<W>) -> Result<(), Failed>,
    ) -> Result<(), Failed> {
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

    /// Turns the link by hand, slowly, until the rotor has turned once: an incremental encoder has met its index.
    /// `reached` as in [`run_with`](Self::run_with).
    ///
    /// # Errors
    /// Those of it; or the link is stuck.
    pub fn turn_by_hand(
        &mut self,
        mut reached: impl FnMut(&mut Emulation<W>) -> Result<(), Failed>,
    ) -> Result<(), Failed> {
        let from = self.board().drivetrain().actuator().state().rotor_angle;
        for _ in 0..2_000 {
            let drivetrain = self.board().drivetrain();
            let state = drivetrain.actuator().state();
            if state.rotor_angle - from > TURN {
                drivetrain.external_torque = 0.0;
                return self.run_with(0.001, reached);
            }
            drivetrain.external_torque = (200.0 * (0.25 - state.joint.velocity)).clamp(-10.0, 10.0);
            self.run_with(0.001, &mut reached)?;
        }
        Err("the link does not turn".into())
    }

    /// The log so far.
    pub fn log(&self) -> String {
        let messages = self.messages.decoder().decode(&self.bytes);
        messages.iter().map(|message| format!("{}\n", message.text)).collect()
    }

    /// State of the joint by the log, last of all.
    pub fn state(&self) -> String {
        let log = self.log();
        let line = log.lines().rfind(|line| line.starts_with("joint: ")).unwrap_or_default();
        line.trim_start_matches("joint: ").split(',').next().unwrap_or_default().to_owned()
    }

    /// Faults that the log tells of, all lines together: bit n - 1 for fault n.
    pub fn faults(&self) -> u32 {
        faults_in(&self.log())
    }

    /// The log tells of a fault.
    ///
    /// # Errors
    /// It does not; with the log.
    pub fn expect_fault(&self, fault: Fault) -> Result<(), Failed> {
        match self.faults() >> (fault as u32 - 1) & 1 {
            1 => Ok(()),
            _ => Err(format!("the log does not tell \"{fault}\":\n{}", self.log()).into()),
        }
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

/// Faults of all lines of a log: bit n - 1 for fault n.
pub fn faults_in(log: &str) -> u32 {
    let told = log.lines().filter_map(|line| line.split_once("faults 0x")?.1.split(',').next());
    told.filter_map(|bits| u32::from_str_radix(bits, 16).ok()).fold(0, |all, bits| all | bits)
}
