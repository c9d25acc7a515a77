//! `jointctl store`, `restore`, `address`: what a joint keeps over a loss of power.

use super::CommandError;
use super::remote::{Patience, Where};
use crate::remote::{address, configuration};
use canopen_node::Group;
use clap::{Args, ValueEnum};
use std::time::Duration;

/// Which parameters.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Parameters {
    /// Both
    #[default]
    All,
    /// PDOs, heartbeat and what else lies at 1000h to 1FFFh
    Communication,
    /// Configuration, compensation, impedance ranges
    Application,
}

impl From<Parameters> for Group {
    fn from(parameters: Parameters) -> Self {
        match parameters {
            Parameters::All => Self::All,
            Parameters::Communication => Self::Communication,
            Parameters::Application => Self::Application,
        }
    }
}

/// Arguments of `store` and `restore`.
#[derive(Debug, Args)]
pub struct Keep {
    /// Which parameters
    #[arg(value_enum, default_value_t)]
    parameters: Parameters,
    /// Which joint.
    #[command(flatten)]
    on: Where,
}

impl Keep {
    /// Runs `store`.
    pub fn store(&self) -> Result<(), CommandError> {
        let joint = self.on.joint()?;
        configuration::store(&joint, self.parameters.into())?;
        println!("node {}: stored", joint.id());
        Ok(())
    }

    /// Runs `restore`.
    pub fn restore(&self) -> Result<(), CommandError> {
        let joint = self.on.joint()?;
        configuration::restore(&joint, self.parameters.into())?;
        println!("node {}: defaults after its next reset", joint.id());
        Ok(())
    }
}

/// Arguments of `address`.
#[derive(Debug, Args)]
pub struct Address {
    /// The bus, as of `scan`
    #[arg(long, value_name = "BUS", env = "JOINTCTL_BUS")]
    bus: String,
    /// The first node id to give; those that are taken are left out
    #[arg(long, value_name = "N", default_value_t = 1)]
    first: u8,
    /// The joints forget their node ids at the next loss of power
    #[arg(long)]
    forget: bool,
    /// How long a joint may take to answer each of a scan's 133 questions, ms
    #[arg(long, value_name = "MS", default_value_t = 20)]
    wait: u64,
    /// Print a JSON array, an object for each joint that got a node id
    #[arg(long)]
    json: bool,
    /// How long what has an id may take.
    #[command(flatten)]
    patience: Patience,
}

impl Address {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let network = self.patience.network(&self.bus)?;
        let wait = Duration::from_millis(self.wait.clamp(1, 10_000));
        let mut list = Vec::new();
        let mut tell = |done: &address::Addressed| match self.json {
            true => list.push(serde_json::json!({ "node": done.node, "serial": done.address.serial })),
            false => println!("node {}: {}", done.node, done.address),
        };
        let count = address::assign(&network, self.first, !self.forget, wait, &mut tell)?;
        if self.json {
            println!("{:#}", serde_json::Value::Array(list));
        } else if count == 0 {
            println!("{}: no joint without a node id", self.bus);
        }
        Ok(())
    }
}
