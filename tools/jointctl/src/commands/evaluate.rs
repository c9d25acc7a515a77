//! `jointctl evaluate`: an image judged on a recorded joint, beside every preset, refitted to the same recording.

use super::CommandError;
use super::fit::print_warnings;
use super::force::Force;
use super::image::read;
use super::terminal::Terminal;
use clap::Args;
use identification::dataset::prepare;
use identification::evaluate::{Prediction, error_tables, fixed_point_difference, rigid_beside};
use identification::fit::{FitError, image_on_other_motion, rigid_model, units};
use identification::identify::{self, identify};
use identification::image_file::verify;
use identification::joint_model::{FloatFriction, firmware_states, fixed_point, regimes, replay, rigid_efforts};
use identification::page::{Role, console};
use identification::pre_sliding;
use identification::presets::Preset;
use identification::progress::Progress;
use identification::quantize::full_scale::from_q16;
use identification::sample_table::write_sample_table;
use std::path::PathBuf;

/// A note below the tables.
const REFITTED: &str = "Rows \"refitted\" were identified anew from this recording's training samples, and so was the rigid part beside the image: \
                        they show what could be reached here. The image itself is as it was. \"image, joint's observer\" sees the recording through \
                        the joint's observer, \"image, compensation\" with regimes and fades as in the joint.";

/// Arguments of `evaluate`.
#[derive(Debug, Args)]
pub struct Evaluate {
    /// Image, binary or TOML
    image: PathBuf,
    /// Description of the data set
    dataset: PathBuf,
    /// Table of the prepared samples with their part and every model's prediction, for other programs
    /// (docs/baselines.md); FILE.gz is compressed
    #[arg(long, value_name = "FILE")]
    export: Option<PathBuf>,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Print the tables as JSON
    #[arg(long)]
    json: bool,
}

impl Evaluate {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        self.force.permits(&self.export)?;
        let progress = Terminal::new();
        progress.stage("load and clean");
        let image = read(&self.image)?;
        verify(&image, &self.image)?;
        let mut prepared = prepare(&self.dataset)?;
        print_warnings(&prepared.warnings);
        let unit = prepared.description.columns.effort.unit.symbol();
        if unit != image.effort.symbol() {
            let text = format!("the image speaks of {}, the data set of {unit}", image.effort.symbol());
            return Err(CommandError::Arguments(text));
        }
        let described = rigid_model(&prepared.description.rigid);
        let mut rigid_model = described;
        let choices = identify::Options {
            units: units(&prepared),
            folds: Some(prepared.folds.clone()),
            lags: prepared.description.choice.lags,
            ..identify::Options::default()
        };
        let mut predictions = Vec::new();
        progress.stage("identify");
        for preset in Preset::ALL {
            progress.detail(preset.name());
            let samples = &mut prepared.samples;
            let identified = identify(samples, &described, preset, &choices)
                .map_err(|source| FitError::Identify { preset, source })?;
            rigid_model = identified.rigid_model;
            let rigid = rigid_efforts(&identified.rigid, samples);
            predictions.push(Prediction::new(format!("{preset}, refitted"), Role::Preset, &rigid, |i| {
                identified.friction(samples, i)
            }));
        }
        progress.stage("judge");
        let stiffness = image.friction.common.elements.map(|element| from_q16(element.stiffness));
        prepared.samples.bent = pre_sliding::bent(&prepared.samples, &stiffness);
        let samples = &prepared.samples;
        let states = firmware_states(samples).map_err(FitError::from)?;
        let sets = regimes(&image.friction.selector, &states, samples);
        let fixed = fixed_point(&image.friction, &states, &sets, samples);
        let float = FloatFriction::of_image(&image.friction).map_err(FitError::from)?;
        let friction: Vec<f64> = fixed.iter().map(|(physical, network)| physical + network).collect();
        let beside = rigid_beside(&friction, &rigid_model, samples);
        let rigid = rigid_efforts(&beside, samples);
        predictions.insert(0, Prediction::new("nothing", Role::Nothing, &rigid, |_| 0.0));
        predictions.push(Prediction::new("image's model, f64", Role::PhysicalAndNetwork, &rigid, |i| {
            let (physical, network) = float.parts(sets[i], samples, i);
            physical + network
        }));
        predictions.push(Prediction::new("image, fixed point", Role::FixedPoint, &rigid, |i| friction[i]));
        if let Some((name, other)) = prepared.on_other_motion() {
            predictions.push(image_on_other_motion(name, &other, &beside, &image.friction)?);
        }
        let torque = replay(&image.friction, &states, samples);
        predictions.push(Prediction::new("image, compensation", Role::OtherMotion, &rigid, |i| torque[i]));
        let tables = error_tables(samples, &prepared.test_sets, &predictions).map_err(FitError::from)?;
        let difference = fixed_point_difference(&float, &fixed, &sets, samples);
        if let Some(path) = &self.export {
            write_sample_table(&prepared, &predictions, path)?;
        }
        progress.finish();
        if self.json {
            println!("{}", serde_json::json!({ "errors": tables, "fixed_point": difference }));
            return Ok(());
        }
        for table in &tables {
            println!("{}", console::error_table(table, unit));
        }
        println!("{REFITTED}");
        println!(
            "Fixed point against the same model in f64: RMS {:.2e} {unit}, largest {:.2e} {unit}.",
            difference.rms, difference.max
        );
        Ok(())
    }
}
