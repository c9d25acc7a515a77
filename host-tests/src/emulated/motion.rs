//! A joint in motion: a board's program, enabled and given a set-point every few milliseconds, until a fault.

use super::Bench;
use super::kept::{Kept, configuration};
use super::master::{Heard, heard, send};
use super::observed::Observed;
use crate::control_steps::image_bytes;
use emulator::board::{Drivetrain, MoteusR4, Wired};
use emulator::chip::time::Instant;
use emulator::emulation::Emulation;
use emulator::program::Program;
use friction_compensation::compensation::Request;
use joint_firmware::joint::configuration::Configuration;
use libtest_mimic::Failed;
use plant::ActuatorParameters;
use std::f64::consts::TAU;

/// Its node id.
pub const NODE: u8 = 5;
/// Period of set-points, s.
pub const SET_POINT: f64 = 0.005;
/// Usual amplitude of the velocity at the link, rad/s; its sine has 1 Hz.
pub const AMPLITUDE: f64 = 2.0;
/// Time for which the joint moves where the control interrupt is measured, s.
pub const MOTION: f64 = 2.0;
/// Period of the joint's heartbeat, ms.
const HEARTBEAT: u16 = 10;
/// Cyclic synchronous velocity, of object 6060h.
const VELOCITY: u8 = 9;
/// Controlwords of CiA 402: shutdown, switch on, enable operation.
const ENABLING: [u16; 3] = [0x06, 0x07, 0x0F];
/// Time up to which the joint is enabled, s.
const ENABLED: f64 = 0.3;

/// An image whose physical model and network act in all that [`Moving`] does: every term, a network in each of
/// the sets that the board has room for, and a trained box that is not left.
pub fn acting_image<W: Observed>() -> Vec<u8> {
    image_bytes(W::CONFIGURATION.parameter_sets)
}

/// A joint that somebody moves. A clone is a snapshot.
#[derive(Clone)]
pub struct Moving<W: Wired = MoteusR4> {
    /// The board.
    pub bench: Bench<W>,
    /// Set-points so far.
    period: u32,
    /// Amplitude of the velocity at the link, rad/s.
    pub amplitude: f64,
    /// `true` if nobody sends set-points.
    pub silent: bool,
    /// Controlword instead of those that enable the joint.
    pub controlword: Option<u16>,
    /// Configuration that it is for.
    pub configuration: Configuration,
    /// Frames of the joint.
    heard: Vec<Heard>,
}

impl<W: Observed> Moving<W> {
    /// Runs from power-up until it moves.
    ///
    /// # Errors
    /// It is not enabled.
    pub fn start(
        board: impl FnOnce(Drivetrain) -> W,
        actuator: &ActuatorParameters,
        program: &Program,
        image: &[u8],
    ) -> Result<Self, Failed> {
        let configuration = configuration::<W>(actuator, NODE, Request::PhysicalAndNetwork);
        let mut bench = Bench::with(board, actuator, program)?;
        Kept { configuration: &configuration, image }.write(&mut bench.emulation, program)?;
        bench.booted(NODE)?;
        if W::INDEX {
            bench.turn_by_hand(|_| Ok(()))?;
        }
        let mut moving = Self {
            bench,
            period: 0,
            amplitude: AMPLITUDE,
            silent: false,
            controlword: None,
            configuration,
            heard: Vec::new(),
        };
        // Operational.
        send(&mut moving.bench.emulation, 0x000, &[0x01, NODE])?;
        // A heartbeat, so that it always has something to send.
        moving.bench.download(NODE, 0x1017, 0, &HEARTBEAT.to_le_bytes())?;
        moving.run(ENABLED)?;
        match moving.bench.board().drivetrain().is_switching() {
            true => Ok(moving),
            false => Err(format!("the bridge does not switch:\n{}", moving.bench.log()).into()),
        }
    }

    /// Moves on.
    ///
    /// # Errors
    /// The run ended.
    pub fn run(&mut self, seconds: f64) -> Result<(), Failed> {
        self.run_with(seconds, |_| Ok(()))
    }

    /// The same; `reached` as in [`Bench::run_with`].
    ///
    /// # Errors
    /// The run ended, or what `reached` says.
    pub fn run_with(
        &mut self,
        seconds: f64,
        mut reached: impl FnMut(&mut Emulation<W>) -> Result<(), Failed>,
    ) -> Result<(), Failed> {
        for _ in 0..(seconds / SET_POINT).round() as u32 {
            self.set_point(&mut reached)?;
        }
        Ok(())
    }

    /// A set-point, and the time up to the next.
    fn set_point(&mut self, reached: impl FnMut(&mut Emulation<W>) -> Result<(), Failed>) -> Result<(), Failed> {
        // The joint measures its currents' zeros first.
        let [shutdown, switch_on, enable] = ENABLING;
        let enabling = match self.period {
            0..24 => shutdown,
            24..28 => switch_on,
            _ => enable,
        };
        let controlword = self.controlword.unwrap_or(enabling);
        let time = f64::from(self.period) * SET_POINT;
        let velocity = self.amplitude * (TAU * time).sin();
        let mut frame = controlword.to_le_bytes().to_vec();
        frame.push(VELOCITY);
        frame.extend(((1e3 * velocity) as i32).to_le_bytes());
        self.period += 1;
        if !self.silent {
            send(&mut self.bench.emulation, 0x300 + u16::from(NODE), &frame)?;
        }
        self.bench.run_with(SET_POINT, reached)?;
        self.heard.extend(heard(&mut self.bench.emulation));
        Ok(())
    }

    /// Now.
    pub fn now(&self) -> Instant {
        self.bench.emulation.now()
    }

    /// Moves on until the bridge is off; for how long it has been on since `from`, s. None where it still is after so
    /// many seconds.
    ///
    /// # Errors
    /// The run ended.
    pub fn until_off(&mut self, from: Instant, seconds: f64) -> Result<Option<f64>, Failed> {
        let end = from.0 + (seconds * 1e12) as u64;
        loop {
            if let Some(off) = self.bench.board().drivetrain().off_since().filter(|off| *off >= from) {
                return Ok(Some((off.0 - from.0) as f64 * 1e-12));
            }
            if self.now().0 >= end {
                return Ok(None);
            }
            self.set_point(|_| Ok(()))?;
        }
    }

    /// The EMCYs so far.
    pub fn emergency_messages(&self) -> impl Iterator<Item = &[u8]> {
        let own = 0x80 + u16::from(NODE);
        self.heard.iter().filter(move |(id, _)| *id == own).map(|(_, data)| data.as_slice())
    }

    /// Codes of the EMCYs so far.
    pub fn emergencies(&self) -> Vec<u16> {
        self.emergency_messages().filter_map(|data| Some(u16::from_le_bytes(*data.first_chunk()?))).collect()
    }
}
