//! `jointctl excite`: a motion that identifies a joint, and a check of one that is given.

use super::CommandError;
use super::force::Force;
use super::joint::JointChoice;
use super::stream;
use clap::Args;
use excitation::check::{Findings, check};
use excitation::file::{SAMPLE_PERIOD, coefficients, read, table};
use excitation::{Bounds, Effort, optimise};
use report::output::write_file;
use std::path::PathBuf;

/// Part of the joint's limits that a motion uses where nothing else is asked for: the rest is left to the controller.
const SHARE: f64 = 0.9;

/// Arguments of `excite`.
#[derive(Debug, Args)]
pub struct Excite {
    /// The joint.
    #[command(flatten)]
    joint: JointChoice,
    /// Lowest position, rad [default: 90 % of the way from the middle to the joint's limit]
    #[arg(long, value_name = "RAD", allow_negative_numbers = true)]
    low: Option<f64>,
    /// Highest position, rad [default: likewise]
    #[arg(long, value_name = "RAD", allow_negative_numbers = true)]
    high: Option<f64>,
    /// Largest velocity, rad/s [default: 90 % of the joint's limit]
    #[arg(long, value_name = "RAD/S")]
    velocity: Option<f64>,
    /// Largest acceleration, rad/s² [default: that of the joint's ramps]
    #[arg(long, value_name = "RAD/S2")]
    acceleration: Option<f64>,
    /// Duration, s
    #[arg(long, value_name = "S", default_value_t = Effort::THOROUGH.duration)]
    duration: f64,
    /// Harmonics of the series
    #[arg(long, value_name = "N", default_value_t = Effort::THOROUGH.harmonics)]
    harmonics: usize,
    /// Seed of the search: the same seed gives the same series
    #[arg(long, value_name = "N", default_value_t = Effort::THOROUGH.seed)]
    seed: u64,
    /// Table to write; the coefficients are written beside it, with the ending .toml
    #[arg(long, value_name = "FILE", default_value = "excitation.csv")]
    out: PathBuf,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Check this table (or, with the ending .toml, these coefficients) instead: limits and condition number
    #[arg(long, value_name = "FILE", conflicts_with = "out")]
    check: Option<PathBuf>,
    /// Print JSON instead, in rad and s; of a motion that is refused, too
    #[arg(long)]
    json: bool,
}

impl Excite {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let bounds = self.bounds()?;
        if let Some(path) = &self.check {
            let samples = read(path)?;
            let findings = check(&samples.time, &samples.motion, &bounds);
            match self.json {
                true => println!("{:#}", described(&findings, &bounds)),
                false => print!("{}", summary(&findings, &bounds)),
            }
            return match findings.defects.is_empty() {
                true => Ok(()),
                false => Err(CommandError::Excitation { path: path.clone(), defects: findings.defects.join("; ") }),
            };
        }
        if stream::is_stream(&self.out) {
            return Err(CommandError::Arguments("--out names a table, and coefficients are written beside it".into()));
        }
        let twin = self.out.with_extension("toml");
        if twin == self.out {
            let text = format!("--out is {}: its ending .toml is that of the coefficients", self.out.display());
            return Err(CommandError::Arguments(text));
        }
        self.force.permits([&self.out, &twin])?;
        let effort = Effort { duration: self.duration, harmonics: self.harmonics, seed: self.seed, ..Effort::THOROUGH };
        let found = optimise(&bounds, &effort)?;
        let (time, motion): (Vec<_>, Vec<_>) = found.excitation.samples(SAMPLE_PERIOD).unzip();
        let findings = check(&time, &motion, &bounds);
        if !findings.defects.is_empty() {
            return Err(CommandError::Excitation { path: self.out.clone(), defects: findings.defects.join("; ") });
        }
        write_file(&twin, coefficients(&found)?.as_bytes())?;
        write_file(&self.out, table(&found.excitation).as_bytes())?;
        if self.json {
            let mut value = described(&findings, &bounds);
            value["random_condition_number"] = found.random.into();
            value["written"] = serde_json::json!([self.out, twin]);
            println!("{value:#}");
            return Ok(());
        }
        print!("{}", summary(&findings, &bounds));
        println!(
            "median of {} series drawn at random: {:.2}; found from the best {}: {:.2}",
            effort.draws, found.random, effort.restarts, found.condition_number
        );
        println!("Written: {}, {}", self.out.display(), twin.display());
        Ok(())
    }

    fn bounds(&self) -> Result<Bounds, CommandError> {
        let (_, setup) = self.joint.read()?;
        let (limits, gains) = (&setup.configuration.limits, &setup.configuration.gains);
        let (low, high) = (f64::from(limits.position.0), f64::from(limits.position.1));
        let (centre, half) = (0.5 * (low + high), 0.5 * SHARE * (high - low));
        let bounds = Bounds {
            position: (self.low.unwrap_or(centre - half), self.high.unwrap_or(centre + half)),
            velocity: self.velocity.unwrap_or(SHARE * f64::from(limits.velocity)),
            acceleration: self.acceleration.unwrap_or(f64::from(gains.acceleration)),
        };
        bounds.validate()?;
        Ok(bounds)
    }
}

/// JSON object of the same as [`summary`], and what the motion must not be run for.
fn described(findings: &Findings, bounds: &Bounds) -> serde_json::Value {
    serde_json::json!({
        "position": [findings.position.0, findings.position.1],
        "velocity": findings.velocity,
        "acceleration": findings.acceleration,
        "condition_number": findings.condition_number,
        "permitted": {
            "position": [bounds.position.0, bounds.position.1],
            "velocity": bounds.velocity,
            "acceleration": bounds.acceleration,
        },
        "defects": findings.defects,
    })
}

fn summary(findings: &Findings, bounds: &Bounds) -> String {
    format!(
        "position          {:.3} to {:.3} rad (permitted {:.3} to {:.3})\n\
         velocity          {:.3} rad/s (permitted {:.3})\n\
         acceleration      {:.3} rad/s² (permitted {:.3})\n\
         condition number  {:.2}\n",
        findings.position.0,
        findings.position.1,
        bounds.position.0,
        bounds.position.1,
        findings.velocity,
        bounds.velocity,
        findings.acceleration,
        bounds.acceleration,
        findings.condition_number
    )
}
