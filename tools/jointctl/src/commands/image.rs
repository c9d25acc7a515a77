//! `jointctl image`: look into a parameter image, verify it as a joint would, convert it to TOML and back.

use super::CommandError;
use super::force::Force;
use super::stream;
use crate::key_file;
use clap::{Args, Subcommand};
use friction_compensation::friction::FrictionModel;
use friction_compensation::parameters::authentication::{Key, split};
use friction_compensation::parameters::certificate::Certificate;
use friction_compensation::parameters::image::Image;
use identification::image_file::{self, bytes, is_text, verify};
use identification::image_text;
use identification::quantize::golden_vectors;
use std::path::{Path, PathBuf};

/// What to do with an image.
#[derive(Debug, Subcommand)]
pub enum ImageCommand {
    /// Print an image as TOML
    Inspect {
        /// Image, binary or TOML; "-" is standard input
        image: PathBuf,
        /// Print JSON instead, with the same keys
        #[arg(long)]
        json: bool,
    },
    /// Check an image as a joint does before it uses one: checksum, fields, certificate, golden vectors; with a key,
    /// the tag
    Verify {
        /// Image, binary, signed or TOML; "-" is standard input
        image: PathBuf,
        /// The key that its tag must be of
        #[arg(long, value_name = "FILE")]
        key: Option<PathBuf>,
        /// Print JSON: what was verified, each bound with its limit
        #[arg(long)]
        json: bool,
    },
    /// Convert between the binary form and TOML (by the names' endings: .toml is TOML, and so is standard output)
    Convert(Convert),
}

/// Arguments of `image convert`.
#[derive(Debug, Args)]
pub struct Convert {
    /// Image, binary or TOML; "-" is standard input
    from: PathBuf,
    /// File to write; "-" is standard output, as TOML
    to: PathBuf,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Compute the golden vectors anew, after an edit of the parameters
    #[arg(long)]
    recompute_golden: bool,
}

impl ImageCommand {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        match self {
            Self::Inspect { image, json } => {
                let text = image_text::to_text(&read(image)?);
                match toml::from_str::<toml::Value>(&text) {
                    Ok(value) if *json => println!("{:#}", serde_json::json!(value)),
                    _ => print!("{text}"),
                }
            }
            Self::Verify { image: path, key, json } => {
                let key = key.as_deref().map(key_file::read).transpose()?;
                let upload = stream::read(path)?;
                if let Some(key) = &key {
                    verify_tag(&upload, path, key)?;
                }
                let number = key.map(|key| key.id());
                let image = decode(&upload, path)?;
                let certificate = verify(&image, path)?;
                if *json {
                    println!("{:#}", verified(&image, &certificate, number));
                    return Ok(());
                }
                print!("{}", summary(&image, &certificate));
                if let Some(number) = number {
                    println!("tag: that of key {number:08x}");
                }
            }
            Self::Convert(convert) => convert.run()?,
        }
        Ok(())
    }
}

impl Convert {
    fn run(&self) -> Result<(), CommandError> {
        let mut image = read(&self.from)?;
        if self.recompute_golden {
            let vectors = golden_vectors(&image.friction, image.golden.len());
            image.golden = heapless::Vec::from_slice(&vectors).unwrap_or_default();
        }
        let refused = |error: &dyn std::fmt::Display| CommandError::Image {
            path: self.from.clone(),
            reason: format!("{error}; after an edit, --recompute-golden computes them anew"),
        };
        image.verify_golden(&FrictionModel::new(&image.friction, 1)).map_err(|error| refused(&error))?;
        let contents = match is_text(&self.to) || stream::is_stream(&self.to) {
            true => image_text::to_text(&image).into_bytes(),
            false => bytes(&image, &self.from)?,
        };
        stream::permits(self.force, &self.to)?;
        stream::write(&self.to, &contents, "")
    }
}

/// Checks that the tag behind an image is of this key.
fn verify_tag(upload: &[u8], path: &Path, key: &Key) -> Result<(), CommandError> {
    let refused = |reason: String| Err(CommandError::Image { path: path.to_owned(), reason });
    match split(upload) {
        (_, None) => refused("there is no tag behind it; `jointctl sign` puts one there".to_owned()),
        (image, Some(tag)) if !key.verify(image, tag) => {
            refused(format!("its tag is not of key {:08x}, or the image has been changed", key.id()))
        }
        _ => Ok(()),
    }
}

/// Reads an image, with or without a tag behind it: TOML where the name ends in `.toml`, else binary; from standard
/// input either.
pub fn read(path: &Path) -> Result<Image, CommandError> {
    decode(&stream::read(path)?, path)
}

/// The image that a file's bytes are; see [`read`].
pub fn decode(bytes: &[u8], path: &Path) -> Result<Image, CommandError> {
    // A binary image has zeros, a text none.
    let text = is_text(path) || stream::is_stream(path) && !bytes.contains(&0);
    Ok(image_file::decode(bytes, path, text)?)
}

fn q16(bits: u32) -> f64 {
    f64::from(bits) / 65536.0
}

fn slope(q8: i64) -> f64 {
    q8 as f64 / 256.0
}

/// Number of networks.
fn networks(image: &Image) -> usize {
    image.friction.sets.iter().filter(|set| set.network.is_some()).count()
}

/// JSON object of what was verified; a tag is that of the key with this number.
fn verified(image: &Image, certificate: &Certificate, key: Option<u32>) -> serde_json::Value {
    let velocity_slope = [certificate.velocity_slope_low, certificate.velocity_slope_high].map(slope);
    serde_json::json!({
        "version": image.version,
        "parameter_sets": image.friction.selector.sets(),
        "networks": networks(image),
        "unit": image.effort.symbol(),
        "friction": { "bound": q16(certificate.output), "limit": q16(image.limits.output) },
        "torque_gain": { "bound": q16(certificate.torque_gain), "limit": q16(image.limits.torque_gain) },
        "velocity_slope": { "bounds": velocity_slope, "limit": slope(image.limits.velocity_slope.into()) },
        "golden_vectors": image.golden.len(),
        "key": key.map(|number| format!("{number:08x}")),
    })
}

fn summary(image: &Image, certificate: &Certificate) -> String {
    let (unit, networks) = (image.effort.symbol(), networks(image));
    format!(
        "version {}, {} parameter set(s), {networks} network(s), effort in {unit}\n\
         |friction|                         <= {:.4} {unit} (limit {:.4})\n\
         |d(network) / d(measured torque)|  <= {:.4} (limit {:.4})\n\
         d(friction) / d(velocity)          in [{:.3}, {:.3}] (limit {:.3})\n\
         golden vectors                     {} of {} exact\n",
        image.version,
        image.friction.selector.sets(),
        q16(certificate.output),
        q16(image.limits.output),
        q16(certificate.torque_gain),
        q16(image.limits.torque_gain),
        slope(certificate.velocity_slope_low),
        slope(certificate.velocity_slope_high),
        slope(i64::from(image.limits.velocity_slope)),
        image.golden.len(),
        image.golden.len(),
    )
}
