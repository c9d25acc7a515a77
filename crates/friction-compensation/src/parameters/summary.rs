//! Summary of an image for a directory of images, without decoding it; task or host.

use super::image::{Image, ImageError};

/// Fields of an image's header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Summary {
    /// Rises with every image of a joint.
    pub version: u32,
    /// Creation time, seconds since 1970-01-01 UTC, 0 = not stated.
    pub created: u64,
    /// `true` if any parameter set has a network.
    pub network: bool,
    /// The image's own CRC-32.
    pub checksum: u32,
    /// Bytes.
    pub length: u32,
}

impl Image {
    /// The summary of an image whose magic, format, length and checksum are right; the fields are not looked at.
    pub fn summary(bytes: &[u8]) -> Result<Summary, ImageError> {
        let content = Self::content(bytes)?;
        // The content is never shorter than the header.
        let number = |offset: usize| content.get(offset..).and_then(|rest| rest.first_chunk::<4>()).copied();
        let word = |offset| u32::from_le_bytes(number(offset).unwrap_or_default());
        let [low, high] = [word(20), word(24)].map(u64::from);
        let checksum = bytes.last_chunk::<4>().copied().unwrap_or_default();
        Ok(Summary {
            version: word(8),
            created: low | high << 32,
            network: word(28) >> 16 & 0xFF != 0,
            checksum: u32::from_le_bytes(checksum),
            length: bytes.len() as u32,
        })
    }
}
