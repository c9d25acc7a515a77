//! `jointctl enable`, `disable`, `move`: the joint under this program's command, and off again.

use super::CommandError;
use super::remote::{Where, catch_interrupts, running};
use super::terminal::Terminal;
use crate::remote::RemoteJoint;
use crate::remote::motion::{Motion, Observation, left};
use clap::{Args, ValueEnum};
use identification::progress::Progress;
use joint_firmware::joint::{Command, Mode};

/// Arguments that `enable` and `move` share.
#[derive(Debug, Args)]
struct Held {
    /// Which joint.
    #[command(flatten)]
    on: Where,
    /// Set-points a second
    #[arg(long, value_name = "HZ", default_value_t = 100.0)]
    rate: f64,
    /// Acknowledge a fault whose cause is gone first
    #[arg(long)]
    reset: bool,
}

impl Held {
    /// Returns `true` if the duration was over, and what is left of the joint's motion.
    fn run(&self, command: Command, duration: f64) -> Result<(bool, String), CommandError> {
        let joint = self.on.joint()?;
        catch_interrupts()?;
        let motion = Motion { command, duration, rate: self.rate, acknowledge: self.reset };
        motion.check(&joint)?;
        let progress = Terminal::new();
        progress.stage("enable");
        let mut is_enabled = false;
        let mut tell = |observation: &Observation| {
            if !std::mem::replace(&mut is_enabled, true) {
                progress.stage("enabled");
            }
            progress.detail(&observation.to_string());
        };
        let outcome = motion.run(&joint, &running, &mut tell)?;
        progress.finish();
        if let Some(last) = outcome.last {
            println!("{last}");
        }
        Ok((outcome.complete, left(&joint, outcome.state)?))
    }
}

/// Arguments of `enable`.
#[derive(Debug, Args)]
pub struct Enable {
    /// The joint.
    #[command(flatten)]
    held: Held,
    /// Disable it after this time, s [default: at Ctrl-C]
    #[arg(long, value_name = "S", default_value_t = 86_400.0, hide_default_value = true)]
    duration: f64,
}

impl Enable {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let (complete, left) = self.held.run(Command::default(), self.duration)?;
        // An end by the user is the normal end.
        println!("node {}: {}{left}", self.held.on.node, if complete { "" } else { "ended early; " });
        Ok(())
    }
}

/// Arguments of `disable`.
#[derive(Debug, Args)]
pub struct Disable {
    /// Which joint.
    #[command(flatten)]
    on: Where,
}

impl Disable {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let joint: RemoteJoint = self.on.joint()?;
        let state = joint.disable()?;
        println!("node {}: {}", joint.id(), left(&joint, state)?);
        Ok(())
    }
}

/// What VALUE is.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    /// Nm
    Torque,
    /// rad/s
    Velocity,
    /// rad
    Position,
    /// rad, of the rest position of a spring with --stiffness and --damping
    Impedance,
}

/// Arguments of `move`.
#[derive(Debug, Args)]
pub struct Move {
    /// Mode of operation
    #[arg(value_enum)]
    mode: Kind,
    /// Set-point: Nm, rad/s or rad
    #[arg(allow_negative_numbers = true)]
    value: f32,
    /// How long, s; then, and at Ctrl-C, the joint brakes and is disabled
    #[arg(long, value_name = "S")]
    duration: f64,
    /// Stiffness of impedance mode, Nm/rad
    #[arg(long, value_name = "NM/RAD", required_if_eq("mode", "impedance"))]
    stiffness: Option<f32>,
    /// Damping of impedance mode, Nm s/rad
    #[arg(long, value_name = "NM S/RAD", required_if_eq("mode", "impedance"))]
    damping: Option<f32>,
    /// The joint.
    #[command(flatten)]
    held: Held,
}

impl Move {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let value = self.value;
        let command = match self.mode {
            Kind::Torque => Command { mode: Mode::Torque, torque: value, ..Command::default() },
            Kind::Velocity => Command { mode: Mode::Velocity, velocity: value, ..Command::default() },
            Kind::Position => Command { mode: Mode::Position, position: value, ..Command::default() },
            Kind::Impedance => Command { mode: Mode::Impedance, position: value, ..Command::default() },
        };
        let (stiffness, damping) = (self.stiffness.unwrap_or(0.0), self.damping.unwrap_or(0.0));
        if !matches!(self.mode, Kind::Impedance) && (self.stiffness.is_some() || self.damping.is_some()) {
            return Err(CommandError::Arguments("--stiffness and --damping belong to impedance mode".into()));
        }
        let (complete, left) = self.held.run(Command { stiffness, damping, ..command }, self.duration)?;
        let node = self.held.on.node;
        if !complete {
            return Err(CommandError::Interrupted(format!("node {node}: the motion was interrupted; {left}")));
        }
        println!("node {node}: {left}");
        Ok(())
    }
}
