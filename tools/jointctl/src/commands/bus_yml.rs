//! `jointctl bus-yml`: the configuration of a ros2_canopen master for the joints on a bus.

use super::CommandError;
use super::describe::identity;
use super::force::Force;
use super::remote::Patience;
use crate::describe::bus_yml::{Joint, Master, PERIODS, text};
use crate::describe::eds::{self, Identity};
use crate::remote::present::{PATIENCE, present};
use crate::remote::{Entry, RemoteError, RemoteJoint};
use clap::Args;
use report::output::{OutputFile, write_directory};
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

/// Arguments of `bus-yml`.
#[derive(Debug, Args)]
pub struct BusYml {
    /// The bus to scan: an entry for every joint that answers, with its identity and serial number. The master then
    /// insists on them: a joint that is replaced needs the file anew
    #[arg(long, value_name = "BUS", required_unless_present = "node")]
    bus: Option<String>,
    /// Node id of a joint, 1 to 127; repeatable. With --bus only these [default: all]; without it, joints of any
    /// identity
    #[arg(long, value_name = "N")]
    node: Vec<u8>,
    /// Node id of the master, 1 to 127
    #[arg(long, value_name = "N", default_value_t = 1)]
    master: u8,
    /// Distance of two SYNCs, and period of the drivers, ms
    #[arg(long, value_name = "MS", default_value_t = 10)]
    period: u16,
    /// Folder to write bus.yml and the EDS to
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// How long joints may take.
    #[command(flatten)]
    patience: Patience,
}

impl BusYml {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let (low, high) = PERIODS;
        if !(low..=high).contains(&self.period) {
            let text = format!("--period is {} ms, must lie in {low} to {high} ms", self.period);
            return Err(CommandError::Arguments(text));
        }
        for (argument, node) in self.node.iter().map(|node| ("--node", *node)).chain([("--master", self.master)]) {
            if !matches!(node, 1..=127) {
                return Err(CommandError::Arguments(format!("{argument} is {node}, must lie in 1 to 127")));
            }
        }
        let mut joints = match &self.bus {
            Some(bus) => self.found(bus)?,
            None => self.node.iter().map(|node| joint(*node, Identity::default(), 0)).collect(),
        };
        joints.sort_unstable_by_key(|joint| joint.node);
        joints.dedup_by_key(|joint| joint.node);
        if joints.iter().any(|joint| joint.node == self.master) {
            let text = format!("node {} is a joint: --master gives the master another node id", self.master);
            return Err(CommandError::Arguments(text));
        }
        self.write(joints)
    }

    /// The joints on a bus.
    fn found(&self, bus: &str) -> Result<Vec<Joint>, CommandError> {
        let network = self.patience.network(bus)?;
        let nodes = match self.node.is_empty() {
            true => present(&network, PATIENCE).map_err(RemoteError::from)?.into_iter().collect(),
            false => self.node.clone(),
        };
        let mut joints = Vec::new();
        for node in nodes {
            match RemoteJoint::on(&network, node) {
                Ok(remote) => joints.push(self.asked(&remote)?),
                // Others may be on the bus; who is named has to be a joint.
                Err(error @ RemoteError::NoJoint { .. }) if self.node.is_empty() => eprintln!("left out: {error}"),
                Err(error) => return Err(error.into()),
            }
        }
        match joints.is_empty() {
            true => Err(CommandError::Bus(format!("{bus}: no joint answered"))),
            false => Ok(joints),
        }
    }

    /// A joint's identity, where it bears the period.
    fn asked(&self, remote: &RemoteJoint) -> Result<Joint, CommandError> {
        let deadline = Entry::one("command-deadline")?;
        // A REAL32: as f64 it would be less than the number that was meant.
        let seconds = remote.read(deadline)?.number().unwrap_or(0.0) as f32;
        let least = f32::from(2 * self.period) / 1000.0;
        if least > seconds {
            return Err(CommandError::Bus(format!(
                "node {}: {} is {seconds} s; with --period {} ms it must be {least} s or more, or the joint brakes where one set-point is late",
                remote.id(),
                deadline.described(),
                self.period
            )));
        }
        let serial = remote.node().number(0x1018, 4).map(u32::from_le_bytes);
        let serial = serial.map_err(RemoteError::from)?;
        Ok(joint(remote.id(), identity(remote)?, serial))
    }

    /// Writes bus.yml, and an EDS for each identity.
    fn write(&self, joints: Vec<Joint>) -> Result<(), CommandError> {
        // A clock before 1970 dates the files 1970.
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let bus_yml = text(Master { node: self.master, period: self.period }, &joints);
        let mut files = vec![OutputFile::new("bus.yml", bus_yml)];
        for Joint { eds, identity, .. } in joints {
            let file = OutputFile::new(&eds, eds::text(&eds, now, identity));
            if !files.contains(&file) {
                files.push(file);
            }
        }
        let paths = files.iter().map(|file| self.out.join(&file.path)).collect::<Vec<_>>();
        self.force.permits(&paths)?;
        write_directory(&self.out, &files)?;
        for path in paths {
            println!("written: {}", path.display());
        }
        Ok(())
    }
}

/// An entry of the file; joints of one identity share an EDS.
fn joint(node: u8, identity: Identity, serial: u32) -> Joint {
    let Identity { vendor, product, revision, .. } = identity;
    let eds = match identity == Identity::default() {
        true => "joint.eds".into(),
        false => format!("joint-{vendor:x}-{product:x}-{revision:x}.eds"),
    };
    Joint { node, identity, serial, eds }
}
