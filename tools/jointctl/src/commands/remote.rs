//! What the commands on a joint over a bus share: which joint, and when to stop.

use super::CommandError;
use crate::remote::RemoteJoint;
use clap::Args;
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
}

impl Where {
    /// Finds the joint.
    pub fn joint(&self) -> Result<RemoteJoint, CommandError> {
        Ok(RemoteJoint::open(&self.bus, self.node)?)
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
