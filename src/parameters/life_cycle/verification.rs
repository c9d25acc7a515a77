//! Everything that must hold of an upload before a joint runs it; task or host, some tens of milliseconds on the board.
//!
//! In this order: lock-out, length and checksum, tag, the fields, version, target, unit, certificate, golden vectors. With a key, nothing
//! behind the length is interpreted before the tag is right; a damaged upload is told from a forged one by its checksum and costs no
//! failure.

use super::Refusal;
use crate::friction::FrictionModel;
use crate::parameters::authentication::{Key, split};
use crate::parameters::certificate::{Certificate, Limits, certify};
use crate::parameters::image::{Effort, Image, ImageError, Target};

/// What this joint asks of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Requirements {
    /// What it is: an image states the same or 0, any.
    pub target: Target,
    /// What it commands.
    pub effort: Effort,
    /// What its own certificate must stay within, whatever the image permits itself.
    pub limits: Limits,
    /// Rate of the control loop, Hz.
    pub rate: u32,
}

/// An upload that everything holds of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Verified {
    /// Bytes of the image; a tag follows where there was one.
    pub length: usize,
    /// Version of the image.
    pub version: u32,
    /// What was proved.
    pub certificate: Certificate,
}

/// Checks the tag; false where there must be none. Needs an image whose checksum is right.
pub(super) fn authentic(upload: &[u8], key: Option<&Key>) -> Result<bool, Refusal> {
    let (image, tag) = split(upload);
    Image::content(image)?;
    match (key, tag) {
        (None, _) => Ok(true),
        (Some(_), None) => Err(Refusal::TagMissing),
        (Some(key), Some(tag)) => Ok(key.verify(image, tag)),
    }
}

/// Checks the rest of an authentic upload.
#[inline(never)]
pub(super) fn verify(upload: &[u8], requirements: &Requirements, floor: u32) -> Result<Verified, Refusal> {
    let (bytes, _) = split(upload);
    // By reference: an image taken out of the result is another 2 KiB of stack.
    let decoded = decoded(bytes);
    let image = match &decoded {
        Ok(image) => image,
        Err(error) => return Err((*error).into()),
    };
    let Requirements { target, effort, limits, rate } = *requirements;
    if image.version < floor {
        return Err(Refusal::Version { version: image.version, floor });
    }
    if image.target.product != 0 && image.target.product != target.product {
        return Err(Refusal::Product { image: image.target.product, joint: target.product });
    }
    if image.target.serial != 0 && image.target.serial != target.serial {
        return Err(Refusal::Serial { image: image.target.serial, joint: target.serial });
    }
    if image.effort != effort {
        return Err(Refusal::Effort { image: image.effort, joint: effort });
    }
    let limits = Limits {
        output: image.limits.output.min(limits.output),
        torque_gain: image.limits.torque_gain.min(limits.torque_gain),
        velocity_slope: image.limits.velocity_slope.min(limits.velocity_slope),
    };
    let certificate = certified(image, &limits)?;
    golden(image, rate)?;
    Ok(Verified { length: bytes.len(), version: image.version, certificate })
}

// Functions of their own, so that the KiB of stack that each takes are not taken side by side.

#[inline(never)]
fn decoded(bytes: &[u8]) -> Result<Image, ImageError> {
    Image::decode(bytes)
}

#[inline(never)]
fn certified(image: &Image, limits: &Limits) -> Result<Certificate, Refusal> {
    certify(&image.friction, limits).map_err(Refusal::Certificate)
}

#[inline(never)]
fn golden(image: &Image, rate: u32) -> Result<(), Refusal> {
    image.verify_golden(&FrictionModel::new(&image.friction, rate)).map_err(Refusal::Golden)
}
