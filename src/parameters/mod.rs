//! How a trained model travels: the byte layout of an image and the proof that it is safe to use.

pub mod certificate;
mod codec;
pub mod image;
