//! The bytes of parameter images, with a checksum of our own.

use friction_compensation::parameters::image::{Image, MAX_LENGTH};

/// CRC-32 (ISO-HDLC), bit by bit.
pub fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ *byte as u32, |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

/// The bytes with their checksum made right.
pub fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let content = bytes.len() - 4;
    let checksum = crc32(&bytes[..content]);
    bytes[content..].copy_from_slice(&checksum.to_le_bytes());
    bytes
}

/// The bytes of a valid image.
pub fn encoded(image: &Image) -> Vec<u8> {
    let mut buffer = [0xa5; MAX_LENGTH];
    let length = image.encode(&mut buffer).expect("a valid image");
    buffer[..length].to_vec()
}
