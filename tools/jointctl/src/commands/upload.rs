//! `jointctl upload`, `rollback`, `discard`: a parameter image's way into a joint, and back.

use super::CommandError;
use super::image::read;
use super::remote::Where;
use super::stream;
use super::terminal::Terminal;
use crate::remote::image::{ImageStatus, Use};
use crate::remote::info::life;
use clap::Args;
use identification::image_file::bytes;
use std::path::PathBuf;

/// Duration of a shadow where nobody says, s.
const SHADOW: f64 = 600.0;

/// Arguments of `upload`.
#[derive(Debug, Args)]
pub struct Upload {
    /// Image: binary, signed, or TOML; "-" is standard input, binary or signed
    image: PathBuf,
    /// Which joint.
    #[command(flatten)]
    on: Where,
    /// Compute it beside the one in use, without effect, for a time [s, default 600]
    #[arg(long, value_name = "SECONDS", num_args = 0..=1, require_equals = true, default_missing_value = "600")]
    shadow: Option<f64>,
    /// Use it for a time, then the stored one again
    #[arg(long, value_name = "SECONDS", conflicts_with = "shadow")]
    trial: Option<f64>,
    /// Store it and use it; the motor has to be off
    #[arg(long, conflicts_with_all = ["shadow", "trial"])]
    commit: bool,
}

impl Upload {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let upload = match self.image.extension() {
            Some(ending) if ending.eq_ignore_ascii_case("toml") => bytes(&read(&self.image)?, &self.image)?,
            // Bytes as they are: what is wrong with them is the joint's to say.
            _ => stream::read(&self.image)?,
        };
        let usage = match (self.shadow, self.trial, self.commit) {
            (Some(seconds), ..) => Use::Shadow(seconds),
            (_, Some(seconds), _) => Use::Trial(seconds),
            (.., true) => Use::Commit,
            _ => Use::Verify,
        };
        let joint = self.on.joint()?;
        let progress = Terminal::new();
        let status = joint.upload_image(&upload, usage, &progress);
        progress.finish();
        say(joint.id(), &status?);
        if usage == Use::Verify {
            println!("Not in use: --shadow[={SHADOW}], --trial SECONDS or --commit takes it further.");
        }
        Ok(())
    }
}

fn say(node: u8, status: &ImageStatus) {
    let version =
        status.active.map_or("no image is stored".into(), |image| format!("version {} is stored", image.version));
    println!("node {node}: {version}; {}", life(status.state, status.left));
}

/// Arguments of `rollback`.
#[derive(Debug, Args)]
pub struct RollBack {
    /// Which joint.
    #[command(flatten)]
    on: Where,
}

impl RollBack {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let joint = self.on.joint()?;
        say(joint.id(), &joint.roll_back_image()?);
        Ok(())
    }
}

/// Arguments of `discard`.
#[derive(Debug, Args)]
pub struct Discard {
    /// Which joint.
    #[command(flatten)]
    on: Where,
}

impl Discard {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let joint = self.on.joint()?;
        say(joint.id(), &joint.discard_image()?);
        Ok(())
    }
}
