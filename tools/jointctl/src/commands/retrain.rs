//! `jointctl retrain`: the whole round on a joint over a bus: excite, record, fit, compare, commit.

use super::CommandError;
use super::fit::{FILES, write};
use super::force::Force;
use super::remote::{Where, catch_interrupts, running};
use super::terminal::Terminal;
use crate::remote::load_check::LoadDifference;
use crate::remote::record::Pace;
use crate::remote::retrain::{DESCRIPTION, RetrainError, Round, Shown, TABLE};
use clap::Args;
use identification::fit::Options;
use identification::page::verdict;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Arguments of `retrain`.
#[derive(Debug, Args)]
pub struct Retrain {
    /// Which joint.
    #[command(flatten)]
    on: Where,
    /// Folder for recording, image and report; other files in it are left alone [default: retrain-N]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Duration of each of the two motions that are recorded, s
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    duration: f64,
    /// Duration of the motion that the image before and the new one are judged by, s
    #[arg(long, value_name = "S", default_value_t = 6.0)]
    validation: f64,
    /// Set-points and samples a second
    #[arg(long, value_name = "HZ", default_value_t = 250.0)]
    rate: f64,
    /// Networks trained from different first weights; 0 trains none
    #[arg(long, value_name = "N", default_value_t = 4)]
    restarts: usize,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Acknowledge a fault whose cause is gone first
    #[arg(long)]
    reset: bool,
    /// Print the figures as a JSON object, in Nm and rad
    #[arg(long)]
    json: bool,
}

impl Retrain {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let key = self.on.key()?;
        let joint = self.on.joint()?;
        let out = self.out.clone().unwrap_or_else(|| PathBuf::from(format!("retrain-{}", joint.id())));
        self.force.permits_in(&out, &[&FILES[..], &[TABLE, DESCRIPTION]].concat())?;
        let options = Options {
            trainer: Options::default().trainer.filter(|_| self.restarts > 0),
            restarts: self.restarts.max(1),
            seed: self.seed,
            reference: false,
            // A clock before 1970 is no clock.
            created: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs()),
            ..Options::default()
        };
        let round = Round {
            excitation: self.duration,
            validation: self.validation,
            rate: self.rate,
            pace: Pace::Send(self.rate),
            options,
            key,
            acknowledge: self.reset,
            out: out.clone(),
        };
        catch_interrupts()?;
        let progress = Terminal::new();
        let written = |fitted: &_| write(fitted, &out).map_err(|error| RetrainError::Report(error.to_string()));
        let outcome = round.run(&joint, &running, &written, &progress);
        progress.finish();
        let report = out.join("report.json");
        if let (true, Err(RetrainError::NotBetter { before, after, load, .. })) = (self.json, &outcome) {
            let version = joint.image_status()?.active.map(|image| image.version);
            println!("{:#}", figures(joint.id(), version, (before, after), load, &report, false));
        }
        let outcome = outcome?;
        let version = outcome.status.active.map_or(0, |image| image.version);
        outcome.load.iter().for_each(|difference| eprintln!("warning: {difference}"));
        if self.json {
            let shown = (&outcome.before, &outcome.after);
            println!("{:#}", figures(joint.id(), Some(version), shown, &outcome.load, &report, true));
            return Ok(());
        }
        println!("{} samples recorded, {} SYNCs without one", outcome.samples.0, outcome.samples.1);
        println!("{}", verdict(&outcome.fitted.report).sentence);
        if let Some(uncertainty) = &outcome.fitted.report.uncertainty {
            println!("{}.", uncertainty.sentence());
        }
        println!("\n{:<34}{:>10}{:>10}", "on the joint, RMS", "before", "now");
        let (before, after) = (outcome.before, outcome.after);
        for (name, before, after) in [
            ("unexplained torque, Nm", before.residual, after.residual),
            ("distance from the reference, mrad", 1e3 * before.tracking, 1e3 * after.tracking),
        ] {
            println!("{name:<34}{before:>10.4}{after:>10.4}");
        }
        println!("In shadow the new image was {:.4} Nm (RMS) from what acted.\n", before.shadow);
        println!("node {}: version {version} is stored and in use where compensation is requested", joint.id());
        println!("Written: {}", out.join("report.html").display());
        Ok(())
    }
}

/// JSON object of a round: what the image before and the new one leave, and which version the joint has, if any.
fn figures(
    node: u8,
    version: Option<u32>,
    (before, after): (&Shown, &Shown),
    load: &[LoadDifference],
    report: &Path,
    kept: bool,
) -> serde_json::Value {
    let judged = |on: &Shown| serde_json::json!({ "residual": on.residual, "tracking": on.tracking });
    serde_json::json!({
        "node": node,
        "kept": kept,
        "version": version,
        "before": judged(before),
        "after": judged(after),
        "shadow": before.shadow,
        "load": load,
        "report": report,
    })
}
