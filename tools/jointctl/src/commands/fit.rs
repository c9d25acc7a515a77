//! `jointctl fit`: from a described data set to an image, its TOML twin and a report.

use super::CommandError;
use super::force::Force;
use super::terminal::Terminal;
use clap::{Args, ValueEnum};
use friction_compensation::friction::regime::Measure;
use identification::choice::{Decision, TermRule};
use identification::dataset::{Prepared, Warning, prepare};
use identification::fit::{Fitted, Options, Trainer, fit};
use identification::image_file::bytes;
use identification::image_text;
use identification::page::{NetworkOutcome, console, numbers, render, verdict};
use identification::presets::Preset;
use identification::progress::Progress;
use identification::sample_table::write_sample_table;
use report::output::{OutputFile, write_directory};
use std::path::{Path, PathBuf};

/// Arguments of `fit`.
#[derive(Debug, Args)]
pub struct Fit {
    /// Description of the data set (docs/your-own-joint.md)
    dataset: PathBuf,
    /// Folder for image, report and figures; other files in it are left alone [default: the description's name]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Table of the prepared samples with their part and every model's prediction, for other programs
    /// (docs/baselines.md); FILE.gz is compressed
    #[arg(long, value_name = "FILE")]
    export: Option<PathBuf>,
    /// Choices of the fit.
    #[command(flatten)]
    choices: Choices,
    /// Print the content of report.json instead of tables
    #[arg(long)]
    json: bool,
}

/// How a network is trained.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum TrainerChoice {
    /// Levenberg-Marquardt, up to 1000 epochs (legged-robot paper)
    #[default]
    Lm,
    /// Stochastic gradient descent with batch normalisation, 500 epochs (mobile-robot paper)
    Sgd,
    /// No network
    None,
}

/// Who decides about a part of the model.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum DecisionChoice {
    /// The error on motions that were left out decides
    #[default]
    Choose,
    /// It is kept, unless the certificate refuses it
    Keep,
    /// It is left out
    Never,
}

impl From<DecisionChoice> for Decision {
    fn from(choice: DecisionChoice) -> Self {
        match choice {
            DecisionChoice::Choose => Self::Choose,
            DecisionChoice::Keep => Self::Keep,
            DecisionChoice::Never => Self::Never,
        }
    }
}

/// What tells motion regimes apart, each of which gets a network of its own.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum RegimeChoice {
    /// Accelerating against uniform motion
    Acceleration,
    /// High against low speed
    Speed,
}

/// Inputs of the network.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum InputChoice {
    /// Position
    Position,
    /// Velocity
    Velocity,
    /// Theoretical torque
    Load,
    /// Measured torque: only where it is measured apart from the effort
    MeasuredTorque,
    /// Temperature
    Temperature,
}

/// Choices that `fit` and `demo` share.
#[derive(Debug, Args)]
pub struct Choices {
    /// Physical model: coulomb-viscous, linear, stribeck, nscf, hysteresis, hysteresis-harmonics, full; repeatable,
    /// the simplest that no other beats on motions that were left out is used [default: coulomb-viscous and full]
    #[arg(long, value_name = "NAME")]
    preset: Vec<Preset>,
    /// Fit every physical model and rank them
    #[arg(long, conflicts_with = "preset")]
    all: bool,
    /// How the network is trained
    #[arg(long, value_enum, default_value_t)]
    trainer: TrainerChoice,
    /// Networks trained from different first weights; the best on validation data is used
    #[arg(long, value_name = "N", default_value_t = 8)]
    restarts: usize,
    /// Epochs without a lower validation error after which training stops
    #[arg(long, value_name = "N", default_value_t = 20)]
    patience: usize,
    /// Penalty on the sum of squared weights, in units of the normalised mean squared error
    #[arg(long, value_name = "X", default_value_t = 1e-4)]
    decay: f64,
    /// Seed of everything random: the same seed, data and choices give the same image
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Most training samples that the network sees
    #[arg(long, value_name = "N", default_value_t = 12_000)]
    samples: usize,
    /// How far their selection makes rare states count: 0 not at all, 1 as much as frequent ones
    #[arg(long, value_name = "0..1", default_value_t = 0.5)]
    equalise: f64,
    /// Train on mirrored samples too: for a joint without preferred direction
    #[arg(long)]
    mirror: bool,
    /// Inputs of the network [default: velocity, and what pays of position, load where there is gravity, temperature
    /// where it varies by 10 K]
    #[arg(long, value_enum, value_delimiter = ',')]
    inputs: Vec<InputChoice>,
    /// Regimes with a network each; up to two
    #[arg(long, value_enum, value_delimiter = ',')]
    regimes: Vec<RegimeChoice>,
    /// Who decides about the network: the error on motions that were left out, or you
    #[arg(long, value_enum, default_value_t)]
    network: DecisionChoice,
    /// Who decides about lagged accelerations beside the rigid body, for an elastic joint: the error on motions that
    /// were left out, or you
    #[arg(long = "lagged-accelerations", value_enum, default_value_t)]
    lags: DecisionChoice,
    /// Terms of the full model that are forced (+) or forbidden (-), as in +Stribeck,-Hysteresis
    #[arg(long = "term", value_name = "±NAME", value_delimiter = ',', allow_hyphen_values = true)]
    terms: Vec<TermRule>,
    /// Least fall of the error on left-out motions for which a network is kept, %
    #[arg(long, value_name = "%", default_value_t = 2.0)]
    least_gain: f64,
    /// How far beyond the trained box the network fades out, in half widths of the box
    #[arg(long, value_name = "X", default_value_t = 0.5)]
    margin: f64,
    /// Torque limit of the joint that the image is for, object 2103h:1, in the effort's unit: it takes no image whose
    /// friction can reach more [default: three times the largest effort of the recording]
    #[arg(long, value_name = "X")]
    torque_limit: Option<f64>,
    /// Version of the image; must rise for a joint that has one
    #[arg(long, value_name = "N", default_value_t = 1)]
    image_version: u32,
    /// Creation time of the image, seconds since 1970 [default: SOURCE_DATE_EPOCH, or not stated]
    #[arg(long, value_name = "S")]
    created: Option<u64>,
}

impl Choices {
    /// The options of the pipeline.
    pub fn options(&self) -> Result<Options, CommandError> {
        let fraction = |name: &str, value: f64, high: f64| match (0.0..=high).contains(&value) {
            true => Ok(value),
            false => Err(CommandError::Arguments(format!("--{name} is {value}, must be 0 to {high}"))),
        };
        if self.regimes.len() > 2 {
            return Err(CommandError::Arguments(format!("--regimes names {} criteria, at most 2", self.regimes.len())));
        }
        if let Some(limit) = self.torque_limit.filter(|limit| !(0.01..=2000.0).contains(limit)) {
            return Err(CommandError::Arguments(format!("--torque-limit is {limit}, must be 0.01 to 2000")));
        }
        let mut options = Options {
            trainer: match self.trainer {
                TrainerChoice::Lm => Some(Trainer::LevenbergMarquardt),
                TrainerChoice::Sgd => Some(Trainer::StochasticGradient),
                TrainerChoice::None => None,
            },
            restarts: self.restarts.max(1),
            patience: self.patience,
            decay: self.decay,
            seed: self.seed,
            samples: self.samples,
            equalise: fraction("equalise", self.equalise, 1.0)?,
            network: self.network.into(),
            lags: self.lags.into(),
            terms: self.terms.clone(),
            least_gain: fraction("least-gain", self.least_gain, 100.0)? / 100.0,
            margin: fraction("margin", self.margin, 100.0)?,
            torque_limit: self.torque_limit,
            version: self.image_version,
            created: self.created.or_else(source_date_epoch).unwrap_or(0),
            ..Options::default()
        };
        options.augment.mirror = self.mirror;
        options.regimes = self
            .regimes
            .iter()
            .map(|choice| match choice {
                RegimeChoice::Acceleration => Measure::Acceleration,
                RegimeChoice::Speed => Measure::Speed,
            })
            .collect();
        if self.all {
            options.presets = Preset::ALL.to_vec();
        } else if !self.preset.is_empty() {
            options.presets = self.preset.clone();
        }
        if !self.inputs.is_empty() {
            let mut inputs = [false; 5];
            self.inputs.iter().for_each(|&input| inputs[input as usize] = true);
            options.inputs = Some(inputs);
        }
        Ok(options)
    }
}

/// The agreed variable for reproducible builds.
fn source_date_epoch() -> Option<u64> {
    std::env::var("SOURCE_DATE_EPOCH").ok()?.parse().ok()
}

impl Fit {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let options = self.choices.options()?;
        let stem = self.dataset.file_stem().unwrap_or_default();
        let out = self.out.clone().unwrap_or_else(|| PathBuf::from(stem));
        self.force.permits_in(&out, &FILES)?;
        self.force.permits(&self.export)?;
        let progress = Terminal::new();
        progress.stage("load and clean");
        let mut prepared = prepare(&self.dataset)?;
        let fitted = fit(&mut prepared, &options, &progress)?;
        progress.stage("write");
        write(&fitted, &out)?;
        if let Some(path) = &self.export {
            write_sample_table(&prepared, &fitted.predictions, path)?;
        }
        progress.finish();
        if self.json {
            print_warnings(&fitted.report.warnings);
            print!("{}", numbers(&fitted.report)?);
            return Ok(());
        }
        print_summary(&prepared, &fitted, &out);
        Ok(())
    }
}

/// Files of a fit, but for its figures.
pub const FILES: [&str; 4] = ["friction.img", "friction.toml", "report.html", "report.json"];

/// Image, TOML twin and report of a fit; `out` is where they belong, for errors.
pub fn files(fitted: &Fitted, out: &Path) -> Result<Vec<OutputFile>, CommandError> {
    let mut files = render(&fitted.report)?;
    files.push(OutputFile::new("friction.img", bytes(&fitted.image, out)?));
    files.push(OutputFile::new("friction.toml", image_text::to_text(&fitted.image)));
    Ok(files)
}

/// Writes them into `out`, all or nothing.
pub fn write(fitted: &Fitted, out: &Path) -> Result<(), CommandError> {
    write_directory(out, &files(fitted, out)?)?;
    Ok(())
}

/// Suspected defects of the data on standard error.
pub fn print_warnings(warnings: &[Warning]) {
    warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
}

/// Tables and verdict on standard output.
pub fn print_summary(prepared: &Prepared, fitted: &Fitted, out: &Path) {
    let report = &fitted.report;
    print_warnings(&report.warnings);
    if let Some(stage) = report.stages.iter().find(|stage| stage.stage == "lag") {
        println!("Lag: {}.", stage.note);
    }
    for table in &report.errors {
        println!("{}", console::error_table(table, &report.units.effort));
    }
    println!("{}", console::choice(&report.choice));
    if let NetworkOutcome::Rejected { reason } = &report.network {
        println!("Network left out: {reason}.");
    }
    if let Some(uncertainty) = &report.uncertainty {
        println!("{}.", uncertainty.sentence());
    }
    println!("{}", verdict(report).sentence);
    println!("{} samples. Written: {}", prepared.samples.len(), out.join("report.html").display());
}
