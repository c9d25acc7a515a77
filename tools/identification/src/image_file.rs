//! Files of images: the image that a file is, what a joint checks before it uses one, and the bytes of an image; host.

use crate::image_text;
use friction_compensation::friction::FrictionModel;
use friction_compensation::parameters::authentication::split;
use friction_compensation::parameters::certificate::{Certificate, certify};
use friction_compensation::parameters::image::{Image, MAX_LENGTH};
use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

/// Reason for which a file is no image that can be used.
#[derive(Debug, thiserror::Error)]
pub enum ImageFileError {
    /// A file that cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// An image that cannot be used.
    #[error("{}: {reason}", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// Reason.
        reason: String,
    },
}

impl ImageFileError {
    /// An image that cannot be used, and why.
    pub fn image(path: &Path, reason: impl Display) -> Self {
        Self::Image { path: path.to_owned(), reason: reason.to_string() }
    }
}

/// True for the name of an image as TOML: it ends in `.toml`.
pub fn is_text(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

/// Reads an image, with or without a tag behind it: TOML where the name ends in `.toml`, else binary.
///
/// # Errors
/// [`ImageFileError`].
pub fn read(path: &Path) -> Result<Image, ImageFileError> {
    let bytes = std::fs::read(path).map_err(|source| ImageFileError::Read { path: path.to_owned(), source })?;
    decode(&bytes, path, is_text(path))
}

/// The image that a file's bytes are, TOML or binary; the path is told where they are none.
///
/// # Errors
/// [`ImageFileError::Image`].
pub fn decode(bytes: &[u8], path: &Path, text: bool) -> Result<Image, ImageFileError> {
    if text {
        let text = str::from_utf8(bytes).map_err(|error| ImageFileError::image(path, error))?;
        return image_text::from_text(text).map_err(|error| ImageFileError::image(path, error));
    }
    Image::decode(split(bytes).0).map_err(|error| ImageFileError::image(path, error))
}

/// Checks of a joint before it uses an image, after decoding.
///
/// # Errors
/// [`ImageFileError::Image`].
pub fn verify(image: &Image, path: &Path) -> Result<Certificate, ImageFileError> {
    let certificate = certify(&image.friction, &image.limits).map_err(|error| ImageFileError::image(path, error))?;
    let model = FrictionModel::new(&image.friction, 1);
    image.verify_golden(&model).map_err(|error| ImageFileError::image(path, error))?;
    Ok(certificate)
}

/// The image in its binary form; the path is told where it has none.
///
/// # Errors
/// [`ImageFileError::Image`].
pub fn bytes(image: &Image, path: &Path) -> Result<Vec<u8>, ImageFileError> {
    let mut buffer = [0; MAX_LENGTH];
    let length = image.encode(&mut buffer).map_err(|error| ImageFileError::image(path, error))?;
    Ok(buffer[..length].to_vec())
}
