//! `jointctl record`: what a joint does, as a data set for `jointctl fit`.

use super::CommandError;
use super::force::Force;
use super::remote::{Where, catch_interrupts, running};
use super::terminal::Terminal;
use crate::remote::record::{Pace, Recorder, Recording, SIGNALS, description};
use clap::Args;
use identification::dataset::DatasetError;
use identification::dataset::load::is_log;
use identification::progress::Progress;
use report::output::{OutputFile, write_directory};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Time without any sample after which nobody sends SYNC, or the joint is gone.
const SILENCE: Duration = Duration::from_secs(3);
/// Time between two looks at whether it is over.
const LOOK: Duration = Duration::from_millis(100);
/// Name of the description, beside the table.
const DESCRIPTION: &str = "dataset.toml";

/// Arguments of `record`.
#[derive(Debug, Args)]
pub struct Record {
    /// Which joint.
    #[command(flatten)]
    on: Where,
    /// Table to write: CSV, or by its ending .mcap or .parquet (feature `logs`); dataset.toml is written beside it.
    /// Neither may exist, unless --force is given
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// How long, s [default: until Ctrl-C]
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
    /// Samples a second
    #[arg(long, value_name = "HZ", default_value_t = 250.0)]
    rate: f64,
    /// Send no SYNC, follow that of another client
    #[arg(long, conflicts_with = "rate")]
    follow: bool,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
}

impl Record {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let duration = match self.duration {
            Some(seconds) if !(seconds > 0.0 && seconds <= 86_400.0) => {
                return Err(CommandError::Arguments(format!("--duration is {seconds} s, must lie in 0 to 86400 s")));
            }
            seconds => seconds.map(Duration::from_secs_f64),
        };
        let name = self.out.file_name().and_then(|name| name.to_str());
        let Some(name) = name.filter(|name| ![DESCRIPTION, "-"].contains(name)) else {
            let text = format!("--out is {}: it has to name a file other than {DESCRIPTION}", self.out.display());
            return Err(CommandError::Arguments(text));
        };
        let folder = self.out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        self.force.permits_in(folder, &[name, DESCRIPTION])?;
        if is_log(&self.out) && cfg!(not(feature = "logs")) {
            return Err(DatasetError::WithoutLogs { file: self.out.clone() }.into());
        }
        let joint = self.on.joint()?;
        catch_interrupts()?;
        let pace = if self.follow { Pace::Follow } else { Pace::Send(self.rate) };
        let mut recorder = Recorder::begin(&joint, &SIGNALS, pace)?;
        let progress = Terminal::new();
        progress.stage("record");
        let began = Instant::now();
        let (mut last, mut count) = (began, 0u64);
        while running() && duration.is_none_or(|duration| began.elapsed() < duration) {
            if recorder.next(LOOK)?.is_some() {
                (last, count) = (Instant::now(), count + 1);
                if count.is_multiple_of(50) {
                    progress.detail(&format!("{count} samples"));
                }
            } else if last.elapsed() > SILENCE {
                let text = format!(
                    "node {}: no samples for {} s{}",
                    joint.id(),
                    SILENCE.as_secs(),
                    match pace {
                        Pace::Follow => ": does anybody send SYNC?",
                        Pace::Send(_) | Pace::Sent => "",
                    }
                );
                return Err(CommandError::Bus(text));
            }
        }
        let recording = recorder.end()?;
        progress.finish();
        let table = OutputFile::new(name, table(&recording, &self.out, joint.id())?);
        let description = OutputFile::new(DESCRIPTION, description(joint.id(), name));
        write_directory(folder, &[table, description])?;
        println!(
            "{} samples in {:.1} s; {} of {} SYNCs without a whole sample, {} periods without a SYNC",
            recording.samples.len(),
            recording.duration(),
            recording.unanswered(),
            recording.syncs,
            recording.late
        );
        println!("Written: {}, {}", self.out.display(), folder.join(DESCRIPTION).display());
        Ok(())
    }
}

/// The recording in the format that the ending of the file's name says.
#[cfg(feature = "logs")]
fn table(recording: &Recording, path: &Path, node: u8) -> Result<Vec<u8>, DatasetError> {
    let Some(format) = logs::Format::of(path) else { return Ok(recording.table().into()) };
    let since = recording.samples.first().map_or(Duration::ZERO, |first| first.at.elapsed());
    let began = std::time::SystemTime::now().checked_sub(since);
    let began = began.and_then(|began| began.duration_since(std::time::UNIX_EPOCH).ok()).unwrap_or_default();
    let table = logs::Table::of_numbers(recording.columns());
    let start = u64::try_from(began.as_nanos()).unwrap_or_default();
    Ok(logs::encode(&table, format, &format!("/joint{node}"), start)?)
}

/// The recording as CSV.
#[cfg(not(feature = "logs"))]
fn table(recording: &Recording, _: &Path, _: u8) -> Result<Vec<u8>, DatasetError> {
    Ok(recording.table().into())
}
