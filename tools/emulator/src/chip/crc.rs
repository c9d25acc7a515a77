//! The CRC unit: RM0440, chapter 16.

use super::register::{Block, Register, register};
use crate::bus::{Refusal, Width};

const DR: u32 = 0x00;
const CR: u32 = 0x08;
const INIT: u32 = 0x10;
const POL: u32 = 0x14;

const REGISTERS: &[Register] = &[
    register(DR, "DR", u32::MAX, u32::MAX, 0),
    register(0x04, "IDR", 0, u32::MAX, 0),
    register(CR, "CR", 0, 0x0000_00f8, 0),
    register(INIT, "INIT", u32::MAX, u32::MAX, 0),
    register(POL, "POL", 0x04c1_1db7, u32::MAX, 0),
];

/// The unit.
#[derive(Clone, Debug)]
pub struct Crc {
    block: Block,
}

impl Crc {
    /// State after reset.
    pub fn new() -> Self {
        Self { block: Block::new("CRC", "16.4", REGISTERS) }
    }

    /// Back to reset.
    pub fn reset(&mut self) {
        self.block.reset();
    }

    /// Bits of the polynomial: CR.POLYSIZE.
    fn bits(&self) -> u32 {
        [32, 16, 8, 7][(self.block.get(CR) >> 3 & 3) as usize]
    }

    /// A load by the core.
    pub fn read(&self, offset: u32) -> Result<u32, Refusal> {
        let value = self.block.read(offset)?;
        let mask = u32::MAX >> (32 - self.bits());
        Ok(match offset {
            // Reversed over the bits of the result (CR.REV_OUT).
            DR if self.block.get(CR) >> 7 & 1 != 0 => (value & mask).reverse_bits() >> (32 - self.bits()),
            DR => value & mask,
            _ => value,
        })
    }

    /// A store by the core. DR takes bytes and half words as well (16.3.3).
    pub fn write(&mut self, offset: u32, width: Width, value: u32) -> Result<(), Refusal> {
        match offset {
            DR => self.take(width, value)?,
            _ if width != Width::Word => return Err(self.block.refuse(offset, "an access of less than a word")),
            CR => {
                self.block.write(CR, value)?;
                if value & 1 != 0 {
                    self.block.set(DR, self.block.get(INIT));
                }
            }
            _ => {
                self.block.write(offset, value)?;
                if offset == INIT {
                    self.block.set(DR, value);
                }
            }
        }
        Ok(())
    }

    fn take(&mut self, width: Width, value: u32) -> Result<(), Refusal> {
        // CR.REV_IN: bits change places within each byte, half word or word (16.3.3).
        let value = match (self.block.get(CR) >> 5 & 3, width) {
            (0, _) => value,
            (1, _) => value.reverse_bits().swap_bytes(),
            (2, Width::Half | Width::Word) => value.reverse_bits().rotate_left(16),
            (3, Width::Word) => value.reverse_bits(),
            _ => return Err(self.block.refuse(CR, "REV_IN wider than the data")),
        };
        let (bits, count) = (self.bits(), 8 * width.bytes());
        let polynomial = self.block.get(POL) << (32 - bits);
        // Aligned to the left: the same steps for every size.
        let mut sum = self.block.get(DR) << (32 - bits);
        for bit in (0..count).rev() {
            let out = sum >> 31 ^ value >> bit & 1;
            sum = sum << 1 ^ if out != 0 { polynomial } else { 0 };
        }
        self.block.set(DR, sum >> (32 - bits));
        Ok(())
    }
}

impl Default for Crc {
    fn default() -> Self {
        Self::new()
    }
}
