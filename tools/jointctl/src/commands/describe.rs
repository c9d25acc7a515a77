//! `jointctl eds`, `jointctl dbc`: the joint's objects and frames for other people's tools.

use super::CommandError;
use super::force::Force;
use super::remote::Patience;
use super::stream;
use crate::describe::{dbc, eds};
use crate::remote::RemoteJoint;
use bus::client::ClientError;
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Name of a file that has none.
const EDS: &str = "joint.eds";

/// Arguments of `eds`.
#[derive(Debug, Args)]
pub struct Eds {
    /// File to write; "-" is standard output
    #[arg(default_value = EDS)]
    file: PathBuf,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// The bus of a joint whose identity (1018h) the file is to have: a master then takes no other [default: any
    /// joint]
    #[arg(long, value_name = "BUS", requires = "node")]
    bus: Option<String>,
    /// Node id of that joint, 1 to 127
    #[arg(long, value_name = "N", requires = "bus")]
    node: Option<u8>,
    /// How long it may take.
    #[command(flatten)]
    patience: Patience,
}

impl Eds {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        stream::permits(self.force, &self.file)?;
        let file = if stream::is_stream(&self.file) { Path::new(EDS) } else { &self.file };
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        // A clock before 1970 dates the file 1970.
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let identity = match (&self.bus, self.node) {
            (Some(bus), Some(node)) => identity(&RemoteJoint::open_within(bus, node, self.patience.duration())?)?,
            _ => eds::Identity::default(),
        };
        let text = eds::text(&name, now, identity);
        stream::write(&self.file, text.as_bytes(), &format!("written: {}", self.file.display()))
    }
}

/// Vendor, product and revision of a joint, as its object 1018h says.
pub(super) fn identity(joint: &RemoteJoint) -> Result<eds::Identity, CommandError> {
    let number = |sub_index| joint.node().number(0x1018, sub_index).map(u32::from_le_bytes);
    let modes = || joint.node().number(0x6502, 0).map(u32::from_le_bytes);
    let read =
        || Ok(eds::Identity { vendor: number(1)?, product: number(2)?, revision: number(3)?, modes: Some(modes()?) });
    read().map_err(|error: ClientError| crate::remote::RemoteError::from(error).into())
}

/// Arguments of `dbc`.
#[derive(Debug, Args)]
pub struct Dbc {
    /// File to write; "-" is standard output
    #[arg(default_value = "joint.dbc")]
    file: PathBuf,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Node id of a joint, 1 to 127; repeatable
    #[arg(long, value_name = "N", default_values_t = [1])]
    node: Vec<u8>,
    /// Rated torque of the joints (6076h), Nm: torques are then in Nm [default: parts of it]
    #[arg(long, value_name = "NM")]
    rated_torque: Option<f64>,
}

impl Dbc {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        stream::permits(self.force, &self.file)?;
        let mut nodes = self.node.clone();
        nodes.sort_unstable();
        nodes.dedup();
        if let Some(wrong) = nodes.iter().find(|node| !matches!(node, 1..=127)) {
            return Err(crate::remote::RemoteError::from(ClientError::NodeId(*wrong)).into());
        }
        if let Some(torque) = self.rated_torque.filter(|torque| !(*torque > 0.0 && *torque < 1e6)) {
            return Err(CommandError::Arguments(format!("--rated-torque is {torque} Nm, must lie in 0 to 1000000 Nm")));
        }
        let text = dbc::text(&nodes, self.rated_torque);
        stream::write(&self.file, text.as_bytes(), &format!("written: {}", self.file.display()))
    }
}
