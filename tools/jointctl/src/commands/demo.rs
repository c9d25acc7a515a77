//! `jointctl demo`: the whole pipeline on a virtual joint that nobody has to own.

use super::CommandError;
use super::fit::{Choices, print_summary, write};
use crate::dataset::prepare;
use crate::fit::fit;
use crate::output::{OutputFile, write_directory};
use crate::progress::{Progress, Terminal};
use clap::Args;
use plant::record::USUAL_SAMPLE_PERIOD;
use plant::{Excitation, JointParameters, Log, record};
use std::fmt::Write;
use std::path::PathBuf;

/// Describes the log as a user would describe his own.
const DESCRIPTION: &str = include_str!("demo.toml");

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub struct Demo {
    /// Folder for the log, its description, image, report and figures
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
    /// Draw the joint at random, from this seed, instead of the reference joint
    #[arg(long, value_name = "N")]
    joint: Option<u64>,
    /// Choices of the fit.
    #[command(flatten)]
    choices: Choices,
}

impl Demo {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let options = self.choices.options()?;
        let progress = Terminal::new();
        progress.stage("record the virtual joint");
        let joint = self.joint.map_or_else(JointParameters::reference, JointParameters::randomised);
        let excitation = Excitation::for_joint(&joint, options.seed)?;
        let recording = record(&joint, &excitation, options.seed, USUAL_SAMPLE_PERIOD)?;
        let files = [OutputFile::new("log.csv", csv(&recording.log)), OutputFile::new("dataset.toml", DESCRIPTION)];
        write_directory(&self.out, &files)?;
        progress.stage("load and clean");
        let mut prepared = prepare(&self.out.join("dataset.toml"))?;
        let fitted = fit(&mut prepared, &options, &progress)?;
        progress.stage("write");
        write(&fitted, &self.out)?;
        progress.finish();
        print_summary(&prepared, &fitted, &self.out);
        Ok(())
    }
}

/// The log as a table, with the digits that a drive would send.
fn csv(log: &Log) -> String {
    let mut text = String::from("run,t_s,position_rad,velocity_rad_s,torque_Nm,temperature_C\n");
    for i in 0..log.len() {
        let (run, time, temperature) = (log.run[i], log.time[i], log.temperature[i]);
        let (position, velocity, torque) = (log.position[i], log.velocity[i], log.measured_torque[i]);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{run},{time:.4},{position:.6},{velocity:.5},{torque:.4},{temperature:.1}");
    }
    text
}
