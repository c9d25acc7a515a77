//! A classic CAN data frame with an 11-bit identifier, which is all that the server speaks; any context.
//!
//! Extended and remote frames have no representation here: constructing one from `embedded_can` parts gives `None`, so
//! they end at the driver. With them end remotely requested TPDOs and node guarding, which CiA discourages and this
//! server does not offer.

use embedded_can::{Id, StandardId};

/// Identifier (COB-ID), 0 to 8 bytes of data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    id: u16,
    length: u8,
    data: [u8; 8],
}

impl Frame {
    /// None where the identifier needs more than 11 bits or there are more than 8 bytes.
    pub fn new(id: u16, data: &[u8]) -> Option<Self> {
        if id > StandardId::MAX.as_raw() {
            return None;
        }
        let mut bytes = [0; 8];
        let place = bytes.get_mut(..data.len())?;
        place.iter_mut().zip(data).for_each(|(byte, value)| *byte = *value);
        Some(Self { id, length: data.len() as u8, data: bytes })
    }

    /// Eight bytes. Bits of the identifier above the eleventh are cut off.
    pub(super) const fn full(id: u16, data: [u8; 8]) -> Self {
        Self::cut(id, data, 8)
    }

    /// The first `length` bytes of `data`, at most 8.
    pub(super) const fn cut(id: u16, data: [u8; 8], length: u8) -> Self {
        Self { id: id & 0x7FF, length: if length < 8 { length } else { 8 }, data }
    }

    /// 11-bit identifier.
    pub const fn id(&self) -> u16 {
        self.id
    }

    /// Data of the frame, 0 to 8 bytes.
    pub fn data(&self) -> &[u8] {
        self.data.get(..self.length.into()).unwrap_or(&self.data)
    }

    /// The data, if there are all eight bytes of it.
    pub fn eight(&self) -> Option<&[u8; 8]> {
        (self.length == 8).then_some(&self.data)
    }
}

impl embedded_can::Frame for Frame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        match id.into() {
            Id::Standard(id) => Self::new(id.as_raw(), data),
            Id::Extended(_) => None,
        }
    }

    /// Always none: remote frames are not used.
    fn new_remote(_id: impl Into<Id>, _dlc: usize) -> Option<Self> {
        None
    }

    fn is_extended(&self) -> bool {
        false
    }

    fn is_remote_frame(&self) -> bool {
        false
    }

    fn id(&self) -> Id {
        // The constructors keep the identifier within 11 bits.
        Id::Standard(StandardId::new(self.id).unwrap_or(StandardId::MAX))
    }

    fn dlc(&self) -> usize {
        self.length.into()
    }

    fn data(&self) -> &[u8] {
        self.data()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::{ExtendedId, Frame as _};

    #[test]
    fn a_frame_has_eleven_bits_of_identifier_and_eight_bytes_at_most() {
        assert_eq!(Frame::new(0x7FF, &[1, 2]).unwrap().data(), [1, 2]);
        assert_eq!(Frame::new(0x800, &[]), None);
        assert_eq!(Frame::new(0, &[0; 9]), None);
        assert_eq!(Frame::new(0, &[7; 8]).unwrap().eight(), Some(&[7; 8]));
        assert_eq!(Frame::new(0, &[7; 7]).unwrap().eight(), None);
    }

    #[test]
    fn extended_and_remote_frames_do_not_exist() {
        let id = StandardId::new(0x123).unwrap();
        assert_eq!(<Frame as embedded_can::Frame>::new(ExtendedId::new(0x123).unwrap(), &[]), None);
        assert_eq!(Frame::new_remote(id, 0), None);
        let frame = <Frame as embedded_can::Frame>::new(id, &[5]).unwrap();
        assert_eq!((embedded_can::Frame::id(&frame), frame.dlc()), (Id::Standard(id), 1));
    }
}
