//! SRAM1, SRAM2, CCM SRAM, and what the factory wrote: RM0440, 2.2 and 2.4, chapter 48 "Device electronic signature".
//!
//! SRAM1, SRAM2 and the second appearance of CCM SRAM lie side by side, so they are one piece of memory. Contents stay
//! over resets (the option that erases them is not set) and are junk after power-up, the same junk on every run. Parity
//! and the write protection of pages are not modelled.

use super::variant::Variant;
use crate::bus::{Refusal, Width};

/// Address of SRAM1.
pub const SRAM: u32 = 0x2000_0000;
/// Address of CCM SRAM.
pub const CCM: u32 = 0x1000_0000;
/// Unique device ID, 96 bits (48.1).
pub const UID: u32 = 0x1fff_7590;
/// KiB of flash, 16 bits (48.2).
pub const FLASH_SIZE: u32 = 0x1fff_75e0;

/// The chip's memories but for flash.
#[derive(Clone, Debug)]
pub struct Memory {
    bytes: Vec<u8>,
    size: usize,
    /// Offset of CCM SRAM in `bytes`.
    ccm: u32,
    uid: [u8; 12],
    flash_kib: u16,
}

/// Loads little-endian from a slice; none where it ends before.
#[inline(always)]
pub fn load(bytes: &[u8], offset: usize, width: Width) -> Option<u32> {
    Some(match width {
        Width::Word => u32::from_le_bytes(*bytes.get(offset..offset.wrapping_add(4))?.first_chunk()?),
        Width::Half => u32::from(u16::from_le_bytes(*bytes.get(offset..offset.wrapping_add(2))?.first_chunk()?)),
        Width::Byte => u32::from(*bytes.get(offset)?),
    })
}

/// Stores little-endian into a slice; none where it ends before.
#[inline(always)]
pub fn store(bytes: &mut [u8], offset: usize, width: Width, value: u32) -> Option<()> {
    match width {
        Width::Word => *bytes.get_mut(offset..offset.wrapping_add(4))?.first_chunk_mut()? = value.to_le_bytes(),
        Width::Half => {
            *bytes.get_mut(offset..offset.wrapping_add(2))?.first_chunk_mut()? = (value as u16).to_le_bytes()
        }
        Width::Byte => *bytes.get_mut(offset)? = value as u8,
    }
    Some(())
}

impl Memory {
    /// Memory after power-up.
    pub fn new(variant: &Variant) -> Self {
        let mut memory = Self {
            bytes: Vec::new(),
            size: (variant.sram + variant.ccm) as usize,
            ccm: variant.sram,
            uid: *b"joint-000001",
            flash_kib: (variant.flash >> 10) as u16,
        };
        memory.power_up();
        memory
    }

    /// Powers the memory down: nothing answers any more.
    pub fn power_down(&mut self) {
        self.bytes.clear();
    }

    /// Junk in every word.
    pub fn power_up(&mut self) {
        self.bytes.resize(self.size, 0);
        let mut junk = 0x9e37_79b9u32;
        for byte in &mut self.bytes {
            junk ^= junk << 13;
            junk ^= junk >> 17;
            junk ^= junk << 5;
            *byte = junk as u8;
        }
    }

    /// Another chip of the kind: its unique ID.
    pub fn set_uid(&mut self, uid: [u8; 12]) {
        self.uid = uid;
    }

    /// SRAM1, SRAM2 and CCM SRAM, in this order.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The same, to change.
    #[inline(always)]
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut self.bytes
    }

    /// Offset of a word in `bytes`; none where it does not lie there.
    pub fn place_of(&self, address: u32) -> Option<usize> {
        let place = self.place(address);
        self.block(address, 4).map(|_| place)
    }

    /// Offset that an address would have in `bytes`, and far behind their end where it is neither's: below CCM SRAM it
    /// wraps.
    #[inline(always)]
    fn place(&self, address: u32) -> usize {
        let offset = if address < SRAM { address.wrapping_sub(CCM).saturating_add(self.ccm) } else { address - SRAM };
        offset as usize
    }

    /// A load from SRAM; none where there is none.
    #[inline(always)]
    pub fn read(&self, address: u32, width: Width) -> Option<u32> {
        load(&self.bytes, self.place(address), width)
    }

    /// A store to SRAM; none where there is none.
    #[inline(always)]
    pub fn write(&mut self, address: u32, width: Width, value: u32) -> Option<()> {
        let place = self.place(address);
        store(&mut self.bytes, place, width, value)
    }

    /// Bytes of SRAM; none where they do not all lie there.
    #[inline(always)]
    pub fn block(&self, address: u32, bytes: u32) -> Option<&[u8]> {
        let place = self.place(address);
        self.bytes.get(place..place.checked_add(bytes as usize)?)
    }

    /// The same, to change.
    #[inline(always)]
    pub fn block_mut(&mut self, address: u32, bytes: u32) -> Option<&mut [u8]> {
        let place = self.place(address);
        self.bytes.get_mut(place..place.checked_add(bytes as usize)?)
    }

    /// A load from the signature at the end of system memory; what else lies there is ST's.
    pub fn read_signature(&self, address: u32, width: Width) -> Result<u32, Refusal> {
        let size = self.flash_kib.to_le_bytes();
        let found = match address {
            UID..=0x1fff_759b => load(&self.uid, (address - UID) as usize, width),
            FLASH_SIZE..=0x1fff_75e1 => load(&size, (address - FLASH_SIZE) as usize, width),
            _ => None,
        };
        found.ok_or_else(|| {
            Refusal::Unmodelled(format!("system memory at {address:#010x} (RM0440, 2.2 and 48) is not modelled"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::variant::{STM32G431CB, STM32G474CE};
    use super::*;

    #[test]
    fn ccm_sram_appears_behind_sram2_on_both_chips() {
        for variant in [STM32G431CB, STM32G474CE] {
            let mut memory = Memory::new(&variant);
            memory.write(CCM + 8, Width::Word, 0x1234_5678).unwrap();
            assert_eq!(memory.read(SRAM + variant.sram + 8, Width::Word), Some(0x1234_5678), "{}", variant.name);
            memory.write(SRAM + variant.sram + variant.ccm - 1, Width::Byte, 0xa5).unwrap();
            assert_eq!(memory.read(CCM + variant.ccm - 1, Width::Byte), Some(0xa5));
        }
    }

    #[test]
    fn behind_the_last_byte_nothing_answers() {
        for variant in [STM32G431CB, STM32G474CE] {
            let memory = Memory::new(&variant);
            for end in [SRAM + variant.sram + variant.ccm, CCM + variant.ccm] {
                assert!(memory.read(end - 1, Width::Byte).is_some());
                assert_eq!(memory.read(end, Width::Byte), None);
                assert_eq!(memory.read(end - 2, Width::Word), None, "nor to the half of a word");
            }
            assert_eq!(memory.read(SRAM - 4, Width::Word), None);
            assert_eq!(memory.read(CCM - 4, Width::Word), None);
        }
    }

    #[test]
    fn the_signature_says_how_much_flash_there_is() {
        let memory = Memory::new(&STM32G474CE);
        assert_eq!(memory.read_signature(FLASH_SIZE, Width::Half), Ok(512));
        assert_eq!(memory.read_signature(UID, Width::Byte), Ok(u32::from(b'j')));
        assert!(matches!(memory.read_signature(0x1fff_0000, Width::Word), Err(Refusal::Unmodelled(_))));
    }
}
