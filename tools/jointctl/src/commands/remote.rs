//! Options that the commands on a joint over a bus share: which joint, how long it may take, and when to stop.

use super::CommandError;
use crate::key_file;
use crate::remote::{RemoteError, RemoteJoint};
use bus::client::Network;
use clap::Args;
use friction_compensation::parameters::authentication::Key;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How long nodes may take.
#[derive(Clone, Copy, Debug, Args)]
pub struct Patience {
    /// How long a node may take for each answer, ms: longer behind gateways and on busy machines
    #[arg(long, value_name = "MS", default_value_t = 1_000, env = "JOINTCTL_TIMEOUT",
        value_parser = clap::value_parser!(u64).range(10..=600_000))]
    timeout: u64,
}

impl Patience {
    /// Duration for each answer.
    pub fn duration(self) -> Duration {
        Duration::from_millis(self.timeout)
    }

    /// Opens a bus.
    pub fn network(self, bus: &str) -> Result<Network, CommandError> {
        let transport = bus::open(bus).map_err(RemoteError::from)?;
        Ok(Network::new(transport).with_patience(self.duration()))
    }
}

/// Which joint.
#[derive(Debug, Args)]
pub struct Where {
    /// The bus: socketcan:can0, slcan:/dev/ttyACM0, slcan:tcp://host:port, udp:239.74.163.2:43113
    #[arg(long, value_name = "BUS", env = "JOINTCTL_BUS")]
    pub bus: String,
    /// Node id of the joint, 1 to 127
    #[arg(long, value_name = "N", env = "JOINTCTL_NODE")]
    pub node: u8,
    /// The joint's key, where it has one: opens a session for what only its owner may do
    #[arg(long, value_name = "FILE", env = "JOINTCTL_KEY")]
    pub key: Option<PathBuf>,
    /// How long it may take.
    #[command(flatten)]
    pub patience: Patience,
}

impl Where {
    /// Finds the joint.
    pub fn joint(&self) -> Result<RemoteJoint, CommandError> {
        let key = self.key()?;
        let joint = RemoteJoint::open_within(&self.bus, self.node, self.patience.duration())?;
        Ok(match key {
            Some(key) => joint.owned_by(key),
            None => joint,
        })
    }

    /// The key in the file.
    pub fn key(&self) -> Result<Option<Key>, CommandError> {
        Ok(self.key.as_deref().map(key_file::read).transpose()?)
    }
}

static STOP: AtomicBool = AtomicBool::new(false);

/// Catches Ctrl-C and termination from now on, so that they do not kill the program: [`running`] tells of them, and the
/// joint is disabled first.
pub fn catch_interrupts() -> Result<(), CommandError> {
    let caught = ctrlc::set_handler(|| STOP.store(true, Ordering::Relaxed));
    caught.map_err(|error| CommandError::Arguments(format!("Ctrl-C cannot be caught: {error}")))
}

/// Returns `true` while nobody has asked to stop.
pub fn running() -> bool {
    !STOP.load(Ordering::Relaxed)
}
