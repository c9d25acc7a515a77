//! `jointctl fleet`: many joints over many days, a file for each command. Needs the feature `logs`.

#[cfg(feature = "logs")]
mod page;
#[cfg(feature = "logs")]
mod registry;
#[cfg(feature = "logs")]
mod retrain;
#[cfg(feature = "logs")]
mod status;

use super::CommandError;
use super::force::Force;
use super::remote::{Patience, Where};
use clap::{Args, Subcommand};
use identification::presets::Preset;
use std::path::PathBuf;

/// Commands for a fleet of joints.
#[derive(Debug, Subcommand)]
pub enum FleetCommand {
    /// Sum up every joint and day of a folder that is new or has changed
    Sums(Sums),
    /// Which joints have changed, since when and in which way; sums up what is new first
    Status(Status),
    /// Fit a new image for each joint whose friction has changed; kept where it is better on the last days
    Retrain(Retrain),
    /// Enter into the registry which image a joint on a bus runs, as it says itself
    Register(Register),
    /// The registry: which image was made and which joint runs it, since when, from which days, by whose key
    Images(Images),
}

/// A fleet's folder.
#[cfg_attr(not(feature = "logs"), allow(dead_code, reason = "the arguments are the same without the feature"))]
#[derive(Debug, Args)]
pub struct Folder {
    /// Folder of joint=NAME/day=YYYY-MM-DD/*.parquet (docs/fleet.md); sums are written to _sums in it
    folder: PathBuf,
    /// Joint to work on; repeatable [default: all]
    #[arg(long, value_name = "NAME")]
    joint: Vec<String>,
    /// Take the sums that are stored as they are: no partition is read
    #[arg(long)]
    stored: bool,
    /// Threads, 0 for one a core
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
}

/// Arguments of `fleet sums`.
#[cfg_attr(not(feature = "logs"), allow(dead_code, reason = "the arguments are the same without the feature"))]
#[derive(Debug, Args)]
pub struct Sums {
    /// Which fleet.
    #[command(flatten)]
    fleet: Folder,
    /// Print counts as JSON
    #[arg(long)]
    json: bool,
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
    /// Compare the registry with what the joints on this bus say, as of `scan`
    #[arg(long, value_name = "BUS")]
    bus: Option<String>,
    /// Time that each joint may take.
    #[command(flatten)]
    patience: Patience,
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

/// Arguments of `fleet register`.
#[cfg_attr(not(feature = "logs"), allow(dead_code, reason = "the arguments are the same without the feature"))]
#[derive(Debug, Args)]
pub struct Register {
    /// Folder of joint=NAME/day=YYYY-MM-DD/*.parquet; the registry is _registry in it
    folder: PathBuf,
    /// Name of the joint in the folder
    #[arg(long, value_name = "NAME")]
    joint: String,
    /// The joint on its bus.
    #[command(flatten)]
    on: Where,
}

/// Arguments of `fleet images`.
#[cfg_attr(not(feature = "logs"), allow(dead_code, reason = "the arguments are the same without the feature"))]
#[derive(Debug, Args)]
pub struct Images {
    /// Folder of joint=NAME/day=YYYY-MM-DD/*.parquet; the registry is _registry in it
    folder: PathBuf,
    /// Print the records as JSON
    #[arg(long)]
    json: bool,
}

impl FleetCommand {
    /// Runs the command.
    #[cfg(feature = "logs")]
    pub fn run(&self) -> Result<(), CommandError> {
        match self {
            Self::Sums(sums) => sums.run(),
            Self::Status(status) => status.run(),
            Self::Retrain(retrain) => retrain.run(),
            Self::Register(register) => register.run(),
            Self::Images(images) => images.run(),
        }
    }

    /// Refuses the command.
    #[cfg(not(feature = "logs"))]
    pub fn run(&self) -> Result<(), CommandError> {
        let folder = match self {
            Self::Sums(Sums { fleet, .. })
            | Self::Status(Status { fleet, .. })
            | Self::Retrain(Retrain { fleet, .. }) => &fleet.folder,
            Self::Register(Register { folder, .. }) | Self::Images(Images { folder, .. }) => folder,
        };
        Err(identification::dataset::DatasetError::WithoutLogs { file: folder.clone() }.into())
    }
}
