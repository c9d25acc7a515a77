//! Requirements that an upload must meet before a joint runs it; task or host, some tens of milliseconds on the board.
//!
//! In this order: length and checksum, tag, the fields, version, target, unit, certificate, golden vectors. With a key,
//! nothing behind the length is interpreted before the tag is right; a damaged upload is told from a forged one by its
//! checksum and costs no failure.

use super::Refusal;
use crate::friction::ParameterSet;
use crate::parameters::authentication::{Key, split};
use crate::parameters::certificate::{self, Certificate, Limits};
use crate::parameters::image::{Effort, Image, Pieces, Target};

/// |d(network) / d(measured torque)| that a joint permits whatever the image permits itself, Q16.16: a newton metre for
/// each that is measured.
const TORQUE_GAIN: u32 = 1 << 16;

/// An upload that everything holds of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Verified {
    /// Bytes of the image; a tag follows where there was one.
    pub length: usize,
    /// Version of the image.
    pub version: u32,
    /// The image's own checksum.
    pub checksum: u32,
    /// Bounds that were proved.
    pub certificate: Certificate,
}

/// Checks the tag; false where there must be none. Needs an image whose checksum is right.
#[inline(never)]
pub(super) fn authentic(upload: &[u8], key: Option<&Key>) -> Result<bool, Refusal> {
    let (image, tag) = split(upload);
    Image::content(image)?;
    match (key, tag) {
        (None, _) => Ok(true),
        (Some(_), None) => Err(Refusal::TagMissing),
        (Some(key), Some(tag)) => Ok(key.verify(image, tag)),
    }
}

/// Checks the rest of an authentic upload, one parameter set at a time; `torque`: limit of the joint, Q16.16 Nm.
#[inline(never)]
pub(super) fn verify(upload: &[u8], target: Target, torque: u32, floor: u32) -> Result<Verified, Refusal> {
    let (bytes, _) = split(upload);
    let image = Pieces::of(bytes)?;
    let header = &image.header;
    if header.version < floor {
        return Err(Refusal::Version { version: header.version, floor });
    }
    if header.target.product != 0 && header.target.product != target.product {
        return Err(Refusal::Product { image: header.target.product, joint: target.product });
    }
    if header.target.serial != 0 && header.target.serial != target.serial {
        return Err(Refusal::Serial { image: header.target.serial, joint: target.serial });
    }
    if header.effort != Effort::NewtonMetre {
        return Err(Refusal::Effort { image: header.effort, joint: Effort::NewtonMetre });
    }
    let limits = Limits {
        output: header.limits.output.min(torque),
        torque_gain: header.limits.torque_gain.min(TORQUE_GAIN),
        velocity_slope: header.limits.velocity_slope,
    };
    let certificate = certified(&image, &limits).map_err(Refusal::Certificate)?;
    image.verify_golden().map_err(Refusal::Golden)?;
    let checksum = bytes.last_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
    Ok(Verified { length: bytes.len(), version: header.version, checksum, certificate })
}

/// A function of its own, so that its stack and that of the golden vectors are not taken side by side.
#[inline(never)]
fn certified(image: &Pieces, limits: &Limits) -> Result<Certificate, certificate::Refusal> {
    let mut proved = None;
    let mut set = ParameterSet::default();
    for index in 0..image.sets() {
        image.set(index, &mut set);
        let header = &image.header;
        certificate::prove_set(&header.domain, &header.common, &set, index, image.sets(), &mut proved)?;
    }
    let proved = proved.unwrap_or_default();
    proved.hold(limits)?;
    Ok(proved)
}
