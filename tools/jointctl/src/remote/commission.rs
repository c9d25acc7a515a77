//! The objects of a joint on a bus, in real time, for its [commissioning](crate::commission); host.

use super::configured;
use super::error::RemoteError;
use super::joint::RemoteJoint;
use crate::commission::Stopped;
use crate::commission::joint::Objects;
use bus::client::{ClientError, Command, Target};
use std::time::{Duration, Instant};
use time::UtcDateTime;

/// Longest sleep before the user is asked whether to go on.
const PART: Duration = Duration::from_millis(10);
/// Longest time in which a joint has to boot.
const BOOT: Duration = Duration::from_secs(10);

/// A joint on a bus. Where this ends, the joint is left in PRE-OPERATIONAL, in which nothing moves.
pub struct RemoteObjects<'r> {
    joint: RemoteJoint,
    running: &'r dyn Fn() -> bool,
}

impl<'r> RemoteObjects<'r> {
    /// Bench of a joint; once `running` says no, the next wait ends.
    pub const fn new(joint: RemoteJoint, running: &'r dyn Fn() -> bool) -> Self {
        Self { joint, running }
    }
}

impl std::fmt::Debug for RemoteObjects<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RemoteObjects").field("joint", &self.joint).finish_non_exhaustive()
    }
}

fn stopped(error: ClientError) -> Stopped {
    match error {
        ClientError::Aborted { .. } => Stopped::Refused(error.to_string()),
        other => Stopped::Bus(other.to_string()),
    }
}

impl Objects for RemoteObjects<'_> {
    fn upload(&mut self, index: u16, sub_index: u8) -> Result<Vec<u8>, Stopped> {
        self.joint.node().upload(index, sub_index).map_err(stopped)
    }

    fn download(&mut self, index: u16, sub_index: u8, data: &[u8]) -> Result<(), Stopped> {
        self.joint.node().download(index, sub_index, data).map_err(stopped)
    }

    fn network(&mut self, command: Command) -> Result<(), Stopped> {
        let (network, node) = (self.joint.network(), self.joint.id());
        let sent = match command {
            Command::ResetNode | Command::ResetCommunication => network.reset_and_wait(command, node, BOOT),
            Command::Start | Command::Stop | Command::EnterPreOperational => {
                network.command(command, Target::Node(node))
            }
        };
        sent.map_err(stopped)
    }

    fn store(&mut self) -> Result<(), Stopped> {
        configured::store(&self.joint, UtcDateTime::now()).map_err(|error| match error {
            RemoteError::Client(error) => stopped(error),
            other => Stopped::Refused(other.to_string()),
        })
    }

    fn pass(&mut self, seconds: f64) -> Result<(), Stopped> {
        let end = Instant::now() + Duration::from_secs_f64(seconds);
        loop {
            if !(self.running)() {
                return Err(Stopped::Interrupted);
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(());
            }
            std::thread::sleep(left.min(PART));
        }
    }
}

impl Drop for RemoteObjects<'_> {
    fn drop(&mut self) {
        // The error that brought us here is what is reported.
        let _ = self.network(Command::EnterPreOperational);
    }
}
