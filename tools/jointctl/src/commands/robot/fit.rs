//! `jointctl robot fit`: all joints of a robot from one recording of all of them.

use crate::commands::CommandError;
use crate::commands::fit::{Choices, print_warnings};
use crate::commands::force::Force;
use crate::commands::terminal::Terminal;
use ::robot::{FittedRobot, Options, files, fit, record};
use clap::Args;
use identification::progress::Progress;
use std::path::PathBuf;

/// Arguments of `robot fit`.
#[derive(Debug, Args)]
pub struct RobotFit {
    /// Description of the recording, which names the robot (docs/robot.md)
    recording: PathBuf,
    /// Folder for images, URDF, parameters and reports; other files in it are left alone [default: the description's
    /// name]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Use only the first seconds of the samples for training and validation
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Choices of each joint's fit.
    #[command(flatten)]
    choices: Choices,
    /// Print errors and parameters as JSON
    #[arg(long)]
    json: bool,
}

impl RobotFit {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let out = self.out.clone().unwrap_or_else(|| PathBuf::from(self.recording.file_stem().unwrap_or_default()));
        self.force.permits_in(&out, &files::FILES)?;
        let progress = Terminal::new();
        progress.stage("load and clean");
        let mut recording = record(&self.recording, &|name| std::env::var(name).ok())?;
        let options = Options { joint: self.choices.options()?, seconds: self.seconds };
        let fitted = fit(&mut recording, &options, &progress)?;
        progress.finish();
        for (joint, prepared) in recording.robot.tree.joints.iter().zip(&recording.joints) {
            if !prepared.warnings.is_empty() {
                eprintln!("{}:", joint.name);
                print_warnings(&prepared.warnings);
            }
        }
        files::write(&out, &recording, &fitted)?;
        match self.json {
            true => println!("{}", files::summary(&recording, &fitted)),
            false => print(&fitted, &out),
        }
        Ok(())
    }
}

fn print(fitted: &FittedRobot, out: &std::path::Path) {
    for note in &fitted.bodies.notes {
        println!("{note}");
    }
    println!("{}", files::table(fitted));
    println!("written to {}", out.display());
}
