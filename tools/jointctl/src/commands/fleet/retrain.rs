//! `jointctl fleet retrain`: a new image for each joint whose friction has changed, kept where it is better on days
//! that neither image has seen.

use super::{Retrain, registry};
use crate::commands::CommandError;
use crate::commands::image::read;
use crate::commands::remote::running;
use crate::key_file;
use ::fleet::finding::{Finding, Kind, PRESENT_DAYS, REFERENCE_DAYS, findings};
use ::fleet::registry::{Event, Record, sha256};
use ::fleet::stored::Entry;
use friction_compensation::parameters::authentication::Key;
use friction_compensation::parameters::image::Image;
use identification::dataset::{Prepared, prepare_text};
use identification::evaluate::{rigid_beside, rmse};
use identification::fit::{FitError, Options, fit, rigid_model};
use identification::image_file::{bytes, verify};
use identification::image_text;
use identification::joint_model::{firmware_states, fixed_point, regimes, rigid_efforts};
use identification::pre_sliding;
use identification::progress::Silent;
use identification::quantize::full_scale::from_q16;
use identification::samples::Part;
use rayon::prelude::*;
use report::output::{OutputFile, write_directory};
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Least fall of the error on the days that were left out for which a new image is kept.
const LEAST_GAIN: f64 = 0.02;

/// Outcome for a joint.
#[derive(Clone, Debug, Serialize)]
struct Outcome {
    joint: String,
    /// RMS error of the image before on the days that were left out, Nm.
    before_nm: Option<f64>,
    /// RMS error of the new image, Nm.
    after_nm: Option<f64>,
    /// Version of the image that is kept.
    version: Option<u32>,
    /// True where the new image is kept.
    kept: bool,
    reason: String,
    #[serde(skip)]
    image: Option<Image>,
    /// First and last day that it was learned from, and the digest of their files.
    #[serde(skip)]
    learned: (String, String),
}

impl Retrain {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        self.force.permits_in(&self.out, &["retrain.json"])?;
        let key = self.key.as_deref().map(key_file::read).transpose()?;
        let night = self.fleet.night()?;
        let findings = findings(&night.entries);
        let changed: Vec<&Finding> =
            findings.iter().filter(|joint| matches!(joint.kind, Kind::Drifted | Kind::FrictionFell)).collect();
        let one = |joint: &&Finding| match running() {
            true => self.one(joint, &night.entries),
            false => Err(CommandError::Interrupted("interrupted: nothing is written".into())),
        };
        let outcomes: Vec<Outcome> = changed.par_iter().map(one).collect::<Result<_, _>>()?;
        let json = serde_json::json!({ "joints": outcomes });
        let mut files = vec![OutputFile::new("retrain.json", json.to_string())];
        for outcome in &outcomes {
            files.extend(self.files(outcome, key.as_ref())?);
        }
        self.force.permits(files.iter().map(|file| self.out.join(&file.path)))?;
        // Before the files: a process that is killed in between makes the same images once more, which count once.
        self.register(&outcomes, key.as_ref())?;
        write_directory(&self.out, &files)?;
        let kept = outcomes.iter().filter(|outcome| outcome.kept).count();
        if self.json {
            println!("{json}");
        } else {
            print!("{}", table(&outcomes));
            println!(
                "{kept} new images of {} joints that have changed. Nothing is uploaded. Written: {}",
                outcomes.len(),
                self.out.display()
            );
        }
        match kept {
            0 => Err(CommandError::NoneKept { changed: outcomes.len() }),
            _ => Ok(()),
        }
    }

    /// Image, its text, and the signed image of a joint whose new image is kept.
    fn files(&self, outcome: &Outcome, key: Option<&Key>) -> Result<Vec<OutputFile>, CommandError> {
        let Some(image) = &outcome.image else { return Ok(Vec::new()) };
        let file = |name: &str| Path::new(&outcome.joint).join(name);
        let mut upload = bytes(image, &self.out)?;
        let mut files = vec![
            OutputFile::new(file("friction.img"), upload.clone()),
            OutputFile::new(file("friction.toml"), image_text::to_text(image)),
        ];
        if let Some(key) = key {
            let tag = key.sign(&upload);
            upload.extend_from_slice(&tag);
            files.push(OutputFile::new(file("friction.signed"), upload));
        }
        Ok(files)
    }

    /// One joint: the image before, a new one, and both on the last days.
    fn one(&self, joint: &Finding, entries: &[Entry]) -> Result<Outcome, CommandError> {
        let days: Vec<&Entry> = entries.iter().filter(|e| e.joint == joint.joint && e.defect.is_empty()).collect();
        let last = days.len().saturating_sub(PRESENT_DAYS);
        let since = |entry: &&&Entry| joint.since.as_ref().is_some_and(|since| entry.day >= *since);
        let learned: Vec<&Entry> = days[..last].iter().filter(since).copied().collect();
        let not = |reason: String| Outcome {
            joint: joint.joint.clone(),
            before_nm: None,
            after_nm: None,
            version: None,
            kept: false,
            reason,
            image: None,
            learned: Default::default(),
        };
        if learned.is_empty() {
            let since = joint.since.as_deref().unwrap_or("no single day");
            return Ok(not(format!(
                "changed since {since}: no day between the change and the last {PRESENT_DAYS} days"
            )));
        }
        let judged = &days[last..];
        let mut prepared = self.prepared(&joint.joint, &learned, judged)?;
        let before = match self.before(&joint.joint)? {
            Some(image) => image,
            None => {
                let reference = &days[..last.min(REFERENCE_DAYS)];
                match fit(&mut self.prepared(&joint.joint, reference, judged)?, &self.options(1), &Silent) {
                    Ok(fitted) => fitted.image,
                    Err(error) => return Ok(not(format!("no image of the reference days: {error}"))),
                }
            }
        };
        let after = match fit(&mut prepared, &self.options(before.version.saturating_add(1)), &Silent) {
            Ok(fitted) => fitted.image,
            Err(error) => return Ok(not(format!("no new image: {error}"))),
        };
        let (old, new) = (error_of(&before, &mut prepared)?, error_of(&after, &mut prepared)?);
        let kept = new < (1.0 - LEAST_GAIN) * old;
        let reason = match kept {
            true => format!("the error falls by {:.1} %", 100.0 * (1.0 - new / old)),
            false => format!(
                "not kept: the error on the last days is {:.1} % of what it was, {:.0} % are needed",
                100.0 * new / old,
                100.0 * (1.0 - LEAST_GAIN)
            ),
        };
        Ok(Outcome {
            joint: joint.joint.clone(),
            before_nm: Some(old),
            after_nm: Some(new),
            version: Some(if kept { after.version } else { before.version }),
            kept,
            reason,
            image: kept.then_some(after),
            learned: sources(&learned),
        })
    }

    /// Enters the images that are kept into the registry.
    fn register(&self, outcomes: &[Outcome], key: Option<&Key>) -> Result<(), CommandError> {
        let record = |(outcome, image): (&Outcome, &Image)| -> Result<Record, CommandError> {
            Ok(Record {
                time_ms: registry::now(),
                event: Event::Made,
                joint: outcome.joint.clone(),
                identity: None,
                version: image.version,
                image: sha256(&bytes(image, &self.out)?),
                days: outcome.learned.0.clone(),
                data: outcome.learned.1.clone(),
                key: key.map_or_else(String::new, |key| format!("{:08x}", key.id())),
            })
        };
        let kept = outcomes.iter().filter_map(|outcome| Some((outcome, outcome.image.as_ref()?)));
        let records = kept.map(record).collect::<Result<Vec<_>, _>>()?;
        match records.is_empty() {
            true => Ok(()),
            false => registry::append(&self.fleet.folder, &records),
        }
    }

    /// The image that a joint has.
    fn before(&self, joint: &str) -> Result<Option<Image>, CommandError> {
        let Some(path) = self.images.as_ref().map(|folder| folder.join(joint).join("friction.img")) else {
            return Ok(None);
        };
        if !path.exists() {
            return Ok(None);
        }
        let image = read(&path)?;
        verify(&image, &path)?;
        Ok(Some(image))
    }

    fn options(&self, version: u32) -> Options {
        let usual = Options::default();
        let presets = if self.preset.is_empty() { usual.presets.clone() } else { self.preset.clone() };
        let trainer = if self.network { usual.trainer } else { None };
        Options { presets, trainer, version, ..usual }
    }

    /// Days to learn from and days to be judged by as one data set.
    fn prepared(&self, joint: &str, learned: &[&Entry], judged: &[&Entry]) -> Result<Prepared, CommandError> {
        let files = |days: &[&Entry]| -> Vec<String> {
            let names = |entry: &Entry| -> Vec<String> {
                let file = |line: &str| format!("day={}/{}", entry.day, line.split('/').next().unwrap_or_default());
                entry.source.lines().map(file).collect()
            };
            days.iter().flat_map(|entry| names(entry)).collect()
        };
        // The text is digested into the image: where the fleet's folder lies is not to be in it.
        let root = self.fleet.folder.join(format!("joint={joint}")).to_string_lossy().into_owned();
        let (learned, judged) = (files(learned), files(judged));
        let all: Vec<&String> = learned.iter().chain(&judged).collect();
        let text = format!(
            "name = {joint:?}\n\n[source]\nroot = \"$JOINT\"\nfiles = {all:?}\n\n{}\n\
             [split]\ntest = [{{ name = \"last days\", files = {judged:?} }}]\n",
            include_str!("retrain.toml")
        );
        Ok(prepare_text(&text, &PathBuf::from(format!("{joint}.toml")), &|_| Some(root.clone()), |_| ())?)
    }
}

/// First and last of some days, and SHA-256 over the digests of all their files.
fn sources(days: &[&Entry]) -> (String, String) {
    let day = |entry: Option<&&Entry>| entry.map_or("-", |entry| entry.day.as_str()).to_owned();
    let lines: Vec<String> = days.iter().map(|entry| format!("{}\n{}", entry.day, entry.source)).collect();
    (format!("{} to {}", day(days.first()), day(days.last())), sha256(lines.join("\n").as_bytes()))
}

/// RMS error of an image on the test samples, Nm; the rigid part beside it is identified from the training samples.
fn error_of(image: &Image, prepared: &mut Prepared) -> Result<f64, CommandError> {
    let parameters = &image.friction;
    let model = rigid_model(&prepared.description.rigid);
    let samples = &mut prepared.samples;
    let stiffness = parameters.common.elements.map(|element| from_q16(element.stiffness));
    samples.bent = pre_sliding::bent(samples, &stiffness);
    let states = firmware_states(samples).map_err(FitError::from)?;
    let sets = regimes(&parameters.selector, &states, samples);
    let fixed = fixed_point(parameters, &states, &sets, samples);
    let friction: Vec<f64> = fixed.iter().map(|(physical, network)| physical + network).collect();
    let rigid = rigid_efforts(&rigid_beside(&friction, &model, samples), samples);
    Ok(rmse(samples.indices(Part::Test).into_iter().map(|i| samples.effort[i] - rigid[i] - friction[i])))
}

fn table(outcomes: &[Outcome]) -> String {
    let mut text = format!("{:<16}{:>12}{:>12}{:>9}  outcome\n", "joint", "before, Nm", "after, Nm", "version");
    let number = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.4}"));
    for outcome in outcomes {
        let version = outcome.version.map_or("-".into(), |version| version.to_string());
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:<16}{:>12}{:>12}{version:>9}  {}",
            outcome.joint,
            number(outcome.before_nm),
            number(outcome.after_nm),
            outcome.reason
        );
    }
    text
}
