//! `jointctl fleet`: many joints over many days, a file for each command. Needs the feature `logs`.

#[cfg(feature = "logs")]
mod page;
#[cfg(feature = "logs")]
mod retrain;
#[cfg(feature = "logs")]
mod status;

use super::CommandError;
use super::force::Force;
use clap::{Args, Subcommand};
use identification::presets::Preset;
use std::path::PathBuf;

/// Commands for a fleet of joints.
#[derive(Debug, Subcommand)]
pub enum FleetCommand {
    /// Sum up every joint and day of a folder that is new or has changed
    Sums(Folder),
    /// Which joints have changed, since when and in which way; sums up what is new first
    Status(Status),
    /// Fit a new image for each joint whose friction has changed; kept where it is better on the last days
    Retrain(Retrain),
}

/// A fleet's folder.
#[cfg_attr(not(feature = "logs"), allow(dead_code, reason = "the arguments are the same without the feature"))]
#[derive(Debug, Args)]
pub struct Folder {
    /// Folder of joint=NAME/day=YYYY-MM-DD/*.parquet (docs/fleet.md); sums are written to _sums in it
    folder: PathBuf,
    /// Threads, 0 for one a core
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
}

/// Arguments of `fleet status`.
#[cfg_attr(not(feature = "logs"), allow(dead_code, reason = "the arguments are the same without the feature"))]
#[derive(Debug, Args)]
pub struct Status {
    /// Which fleet.
    #[command(flatten)]
    fleet: Folder,
    /// Page with a map of all joints and days to write
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Print joints, days and bad partitions as JSON
    #[arg(long)]
    json: bool,
}

/// Arguments of `fleet retrain`.
#[cfg_attr(not(feature = "logs"), allow(dead_code, reason = "the arguments are the same without the feature"))]
#[derive(Debug, Args)]
pub struct Retrain {
    /// Which fleet.
    #[command(flatten)]
    fleet: Folder,
    /// Folder for JOINT/friction.img of each image that is kept, and retrain.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Folder with JOINT/friction.img that the joints have [default: images of the first days]
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,
    /// Sign the images that are kept with this key
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
    /// Physical model, as of `fit`; repeatable [default: coulomb-viscous and full]
    #[arg(long, value_name = "NAME")]
    preset: Vec<Preset>,
    /// Try networks too, as `fit` does; takes longer
    #[arg(long)]
    network: bool,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Print the outcomes as JSON
    #[arg(long)]
    json: bool,
}

impl FleetCommand {
    /// Runs the command.
    #[cfg(feature = "logs")]
    pub fn run(&self) -> Result<(), CommandError> {
        match self {
            Self::Sums(folder) => folder.run(),
            Self::Status(status) => status.run(),
            Self::Retrain(retrain) => retrain.run(),
        }
    }

    /// Refuses the command.
    #[cfg(not(feature = "logs"))]
    pub fn run(&self) -> Result<(), CommandError> {
        let (Self::Sums(fleet) | Self::Status(Status { fleet, .. }) | Self::Retrain(Retrain { fleet, .. })) = self;
        Err(identification::dataset::DatasetError::WithoutLogs { file: fleet.folder.clone() }.into())
    }
}
