//! Frames of this crate's own making.

use crate::Frame;

/// Identifiers are constants or made of them, and no data is longer than 8 bytes.
pub(super) fn frame(id: u16, data: &[u8]) -> Frame {
    let data = data.get(..8).unwrap_or(data);
    Frame::new(id & 0x7FF, data).unwrap_or_else(|| unreachable!("11 bits and 8 bytes are a frame"))
}
