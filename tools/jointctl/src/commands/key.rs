//! `jointctl key` and `jointctl sign`: who may change what a joint adds to its torque.

use super::CommandError;
use super::force::Force;
use super::image::read;
use super::remote::Where;
use super::stream;
use crate::key_file;
use clap::{Args, Subcommand};
use identification::image_file::{bytes, verify};
use std::path::PathBuf;

/// What to do with a key.
#[derive(Debug, Subcommand)]
pub enum KeyCommand {
    /// Make a key and write it to a new file that only you can read
    New {
        /// File to write; an existing one is never overwritten
        file: PathBuf,
    },
    /// Give a key to a joint that has none. Somebody has to be at it: press its button meanwhile, or where it has none
    /// do it within a minute after its supply came, before a master starts it
    Give {
        /// The key
        file: PathBuf,
        /// Which joint.
        #[command(flatten)]
        on: Where,
    },
    /// Replace a joint's key by another one; --key is the one that it has
    Rotate {
        /// The new key
        file: PathBuf,
        /// Which joint.
        #[command(flatten)]
        on: Where,
    },
    /// Take a joint's key back: by --key, or without it where somebody is at the joint, as for `give`. A key that was
    /// damaged goes the same way. The joint belongs to nobody then
    Forget {
        /// Which joint.
        #[command(flatten)]
        on: Where,
    },
    /// Print a key's number, by which a joint names it; it says nothing of the key
    Number {
        /// The key
        file: PathBuf,
    },
}

impl KeyCommand {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        match self {
            Self::New { file } => {
                let key = key_file::create(file)?;
                println!("key {:08x} written: {}", key.id(), file.display());
                println!("Whoever has this file owns every joint that has the key.");
            }
            Self::Give { file, on } => {
                let key = key_file::read(file)?;
                on.joint()?.give_key(&key)?;
                println!("node {}: belongs to who has key {:08x}, from now on", on.node, key.id());
            }
            Self::Rotate { file, on } => {
                let new = key_file::read(file)?;
                let Some(old) = on.key()? else {
                    let problem = "the key that the joint has is missing: --key FILE, or JOINTCTL_KEY".to_owned();
                    return Err(CommandError::Arguments(problem));
                };
                on.joint()?.rotate_key(&old, &new)?;
                println!("node {}: key {:08x} in the place of {:08x}", on.node, new.id(), old.id());
            }
            Self::Forget { on } => {
                on.joint()?.forget_key(on.key()?.as_ref())?;
                println!("node {}: belongs to nobody", on.node);
            }
            Self::Number { file } => println!("{:08x}", key_file::read(file)?.id()),
        }
        Ok(())
    }
}

/// Arguments of `sign`.
#[derive(Debug, Args)]
pub struct Sign {
    /// Image, binary or TOML; it is verified as a joint does it first
    image: PathBuf,
    /// The joint's key
    #[arg(long, value_name = "FILE")]
    key: PathBuf,
    /// Version to sign it as; a joint with this key takes none that is older than the newest it had [default: the
    /// image's]
    #[arg(long, value_name = "N")]
    version: Option<u32>,
    /// Product to sign it for, 0 for any [default: the image's]
    #[arg(long, value_name = "N")]
    product: Option<u32>,
    /// Serial number of the only joint to sign it for, 0 for any [default: the image's]
    #[arg(long, value_name = "N")]
    serial: Option<u32>,
    /// File to write: the image with its tag behind it [default: the image's name with the ending .signed; "-",
    /// standard output, where the image comes from standard input]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
}

impl Sign {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let key = key_file::read(&self.key)?;
        let mut image = read(&self.image)?;
        image.version = self.version.unwrap_or(image.version);
        image.target.product = self.product.unwrap_or(image.target.product);
        image.target.serial = self.serial.unwrap_or(image.target.serial);
        verify(&image, &self.image)?;
        let mut upload = bytes(&image, &self.image)?;
        let tag = key.sign(&upload);
        upload.extend_from_slice(&tag);
        let out = match &self.out {
            Some(out) => out.clone(),
            None if stream::is_stream(&self.image) => self.image.clone(),
            None => self.image.with_extension("signed"),
        };
        stream::permits(self.force, &out)?;
        let target = match (image.target.product, image.target.serial) {
            (0, 0) => "any joint".to_owned(),
            (product, 0) => format!("every joint of product {product:#010x}"),
            (product, serial) => format!("joint {serial} of product {product:#010x}"),
        };
        let said =
            format!("version {} for {target}, signed with key {:08x}: {}", image.version, key.id(), out.display());
        stream::write(&out, &upload, &said)
    }
}
