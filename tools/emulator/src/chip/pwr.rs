//! PWR, power control: RM0440, chapter 6. The regulator's range decides how fast the core may run and how many wait
//! states the flash takes.

use super::register::{Block, Register, register};
use crate::bus::Refusal;

const CR1: u32 = 0x00;
const CR5: u32 = 0x80;

/// CR1: low-power modes and low-power run are not modelled. CR3: standby and pull configuration neither. PDCRx, PUCRx
/// act in standby only, so they are left out.
const REGISTERS: &[Register] = &[
    register(CR1, "CR1", 0x0000_0200, 0x0000_4707, 0x0000_4007),
    register(0x04, "CR2", 0, 0x0000_00ff, 0x0000_00ff),
    register(0x08, "CR3", 0x0000_8000, 0x0000_e51f, 0x0000_051f),
    register(0x0c, "CR4", 0, 0x0000_031f, 0x0000_031f),
    register(0x10, "SR1", 0, 0, 0),
    register(0x14, "SR2", 0, 0, 0),
    register(0x18, "SCR", 0, 0, 0),
    register(CR5, "CR5", 0x0000_0100, 0x0000_0100, 0),
];

/// Range of the main regulator: CR1.VOS and CR5.R1MODE (6.1.5 "Dynamic voltage scaling management").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Range up to 170 MHz.
    Boost,
    /// Range up to 150 MHz: after reset.
    Normal,
    /// Range up to 26 MHz.
    Low,
}

impl Range {
    /// Highest frequency of the core for 0, 1, 2... wait states, MHz (3.3.3 and 5.3.3, "Read access latency").
    pub const fn frequencies(self) -> &'static [u64] {
        match self {
            Self::Boost => &[34, 68, 102, 136, 170],
            Self::Normal => &[30, 60, 90, 120, 150],
            Self::Low => &[12, 24, 26],
        }
    }
}

/// PWR.
#[derive(Clone, Debug)]
pub struct Pwr {
    block: Block,
}

impl Pwr {
    /// State after reset.
    pub fn new() -> Self {
        Self { block: Block::new("PWR", "6.4", REGISTERS) }
    }

    /// Back to reset.
    pub fn reset(&mut self) {
        self.block.reset();
    }

    /// Returns `true` if the backup domain may be written: CR1.DBP.
    pub fn backup_is_writable(&self) -> bool {
        self.block.get(CR1) >> 8 & 1 != 0
    }

    /// Range of the regulator.
    pub fn range(&self) -> Range {
        match (self.block.get(CR1) >> 9 & 3, self.block.get(CR5) >> 8 & 1) {
            (2, _) => Range::Low,
            (_, 0) => Range::Boost,
            _ => Range::Normal,
        }
    }

    /// A load by the core.
    pub fn read(&self, offset: u32) -> Result<u32, Refusal> {
        self.block.read(offset)
    }

    /// A store by the core.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), Refusal> {
        self.block.write(offset, value).map(|_| ())
    }
}

impl Default for Pwr {
    fn default() -> Self {
        Self::new()
    }
}
