//! What the commands on a joint over a bus share: which joint, and when to stop.

use super::CommandError;
use crate::key_file;
use crate::remote::RemoteJoint;
use clap::Args;
use joint_firmware::parameters::authentication::Key;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

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
}

impl Where {
    /// Finds the joint.
    pub fn joint(&self) -> Result<RemoteJoint, CommandError> {
        let key = self.key()?;
        let joint = RemoteJoint::open(&self.bus, self.node)?;
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

/// From now on Ctrl-C and termination do not kill the program: [`running`] tells of them, and the joint is disabled first.
pub fn catch_interrupts() -> Result<(), CommandError> {
    let caught = ctrlc::set_handler(|| STOP.store(true, Ordering::Relaxed));
    caught.map_err(|error| CommandError::Arguments(format!("Ctrl-C cannot be caught: {error}")))
}

/// Whether nobody has asked to stop.
pub fn running() -> bool {
    !STOP.load(Ordering::Relaxed)
}
