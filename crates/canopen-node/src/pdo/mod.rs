//! Process data: what an RPDO or a TPDO carries. CiA 301 sections 7.2.2 and 7.5.2.35 to 7.5.2.38.

pub(super) mod mapping;
pub(super) mod receive;
pub(super) mod transmit;

/// A mapping entry: index in bits 16 to 31, sub-index in bits 8 to 15, length in bits in bits 0 to 7.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct MappedObject(pub u32);

impl MappedObject {
    /// Length in bits.
    pub const fn new(index: u16, sub_index: u8, bits: u8) -> Self {
        Self((index as u32) << 16 | (sub_index as u32) << 8 | bits as u32)
    }

    /// Index.
    pub const fn index(self) -> u16 {
        (self.0 >> 16) as u16
    }

    /// Sub-index.
    pub const fn sub_index(self) -> u8 {
        (self.0 >> 8) as u8
    }

    /// Length in bits.
    pub const fn bits(self) -> u32 {
        self.0 & 0xFF
    }

    /// The bits that a value of this length has.
    const fn mask(self) -> u64 {
        match 1u64.checked_shl(self.bits()) {
            Some(above) => above.wrapping_sub(1),
            None => u64::MAX,
        }
    }

    /// Bits of the data type that a dummy entry (index 0001h to 001Bh) skips in an RPDO; none for other objects. CiA
    /// 301 section 7.4.7.3.
    const fn dummy(self) -> Option<u32> {
        if self.sub_index() != 0 {
            return None;
        }
        Some(match self.index() {
            0x02 | 0x05 => 8,
            0x03 | 0x06 => 16,
            0x04 | 0x07 => 32,
            0x15 | 0x1B => 64,
            _ => return None,
        })
    }
}

/// Process data in the receive interrupt: set-points in, actual values out. Everything here has to be quick and must
/// not wait.
pub trait ProcessImage {
    /// An object of an RPDO has arrived: its value in the low bits, not sign-extended. The entry was found mappable
    /// when the PDO was set up; ignore it where it is not.
    fn receive(&mut self, object: MappedObject, value: u64);

    /// All objects of RPDO `pdo`, 0 to 3, have been given: they count from now on, together.
    fn received(&mut self, pdo: u8);

    /// The actual value of an object of a TPDO; bits above its length are ignored.
    fn transmit(&mut self, object: MappedObject) -> u64;

    /// SYNC arrived, in OPERATIONAL; its TPDOs are sampled after this, then the RPDOs that waited for it count.
    fn sync(&mut self) {}

    /// The NMT state changed: every set-point is invalid, and the joint acts as if it had never had one.
    fn state_changed(&mut self, state: super::NmtState);
}
