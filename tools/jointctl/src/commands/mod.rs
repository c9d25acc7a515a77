//! The commands of `jointctl`, one file each: arguments in, files and a few lines of text out; host.

pub mod demo;
pub mod evaluate;
pub mod fit;
pub mod image;

use clap::{Parser, Subcommand};
use std::path::PathBuf;

/// Identify, train, certify and judge the friction model of a robot joint.
#[derive(Debug, Parser)]
#[command(name = "jointctl", version, max_term_width = 110)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// The whole pipeline on a virtual joint: needs no file, writes ./demo
    Demo(demo::Demo),
    /// Identify, train, certify and judge the friction of a recorded joint
    Fit(fit::Fit),
    /// Judge an image on a recorded joint
    Evaluate(evaluate::Evaluate),
    /// Inspect, verify or convert a parameter image
    #[command(subcommand)]
    Image(image::ImageCommand),
}

/// Anything that ends a command.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// The data set.
    #[error(transparent)]
    Dataset(#[from] crate::dataset::DatasetError),
    /// The fit.
    #[error(transparent)]
    Fit(#[from] crate::fit::FitError),
    /// Writing of results.
    #[error(transparent)]
    Output(#[from] crate::output::OutputError),
    /// The report.
    #[error(transparent)]
    Report(#[from] crate::report::ReportError),
    /// The virtual joint.
    #[error("virtual joint: {0}")]
    Plant(#[from] plant::ParameterError),
    /// A file that cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// An image that cannot be used.
    #[error("{}: {reason}", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// Arguments that contradict each other.
    #[error("{0}")]
    Arguments(String),
}

/// Runs a command.
pub fn run(arguments: Arguments) -> Result<(), CommandError> {
    match arguments.command {
        Command::Demo(demo) => demo.run(),
        Command::Fit(fit) => fit.run(),
        Command::Evaluate(evaluate) => evaluate.run(),
        Command::Image(image) => image.run(),
    }
}
