//! `jointctl robot evaluate`: a fitted robot judged on another recording.

use crate::commands::CommandError;
use crate::commands::fit::print_warnings;
use crate::commands::force::Force;
use crate::commands::terminal::Terminal;
use ::robot::evaluate::{Evaluation, Judged, evaluate, external_table, mean_percent, table};
use ::robot::record;
use clap::Args;
use identification::progress::Progress;
use report::output::write_file;
use std::path::PathBuf;

/// Arguments of `robot evaluate`.
#[derive(Debug, Args)]
pub struct RobotEvaluate {
    /// Folder that `robot fit` wrote: robot.json and the images
    fitted: PathBuf,
    /// Description of the recording, which names the robot (docs/robot.md)
    recording: PathBuf,
    /// Judge the recording's test sets only, as for the one that the robot was fitted to
    #[arg(long)]
    test: bool,
    /// File for the external torques of all joints as CSV: what links, rotors and friction take beyond what the motors
    /// give, and the model's errors
    #[arg(long, value_name = "FILE")]
    external: Option<PathBuf>,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Print the errors as JSON
    #[arg(long)]
    json: bool,
}

impl RobotEvaluate {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        self.force.permits(&self.external)?;
        let progress = Terminal::new();
        progress.stage("load and clean");
        let mut recording = record(&self.recording, &|name| std::env::var(name).ok())?;
        for (joint, prepared) in recording.robot.tree.joints.iter().zip(&recording.joints) {
            if !prepared.warnings.is_empty() {
                eprintln!("{}:", joint.name);
                print_warnings(&prepared.warnings);
            }
        }
        progress.stage("judge");
        let judged = if self.test { Judged::Test } else { Judged::All };
        let Evaluation { errors, external } = evaluate(&self.fitted, &mut recording, judged)?;
        progress.finish();
        if let Some(file) = &self.external {
            write_file(file, external_table(&recording, &external).as_bytes())?;
        }
        match self.json {
            true => {
                let mean = mean_percent(&errors);
                println!("{}", serde_json::json!({ "errors": errors, "mean_relative_percent": mean }));
            }
            false => println!("{}", table(&errors)),
        }
        if let (Some(file), false) = (&self.external, self.json) {
            println!("Written: {}", file.display());
        }
        Ok(())
    }
}
