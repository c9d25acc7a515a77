//! `jointctl eds`, `jointctl dbc`: the joint's objects and frames for other people's tools.

use super::CommandError;
use crate::describe::{dbc, eds};
use crate::output::write_file;
use bus::client::ClientError;
use clap::Args;
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

/// Arguments of `eds`.
#[derive(Debug, Args)]
pub struct Eds {
    /// File to write
    #[arg(default_value = "joint.eds")]
    file: PathBuf,
}

impl Eds {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let name = self.file.file_name().unwrap_or_default().to_string_lossy();
        // A clock before 1970 dates the file 1970.
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        write_file(&self.file, eds::text(&name, now).as_bytes())?;
        println!("written: {}", self.file.display());
        Ok(())
    }
}

/// Arguments of `dbc`.
#[derive(Debug, Args)]
pub struct Dbc {
    /// File to write
    #[arg(default_value = "joint.dbc")]
    file: PathBuf,
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
        let mut nodes = self.node.clone();
        nodes.sort_unstable();
        nodes.dedup();
        if let Some(wrong) = nodes.iter().find(|node| !matches!(node, 1..=127)) {
            return Err(crate::remote::RemoteError::from(ClientError::NodeId(*wrong)).into());
        }
        if let Some(torque) = self.rated_torque.filter(|torque| !(*torque > 0.0 && *torque < 1e6)) {
            return Err(CommandError::Arguments(format!("--rated-torque is {torque} Nm, must lie in 0 to 1000000 Nm")));
        }
        write_file(&self.file, dbc::text(&nodes, self.rated_torque).as_bytes())?;
        println!("written: {}", self.file.display());
        Ok(())
    }
}
