//! SYSCFG and DBGMCU: RM0440, chapters 10 and 47. Of SYSCFG, what breaks TIM1; DBGMCU keeps what is written, as no
//! debugger is connected.

use super::register::{Block, Register, register};
use crate::bus::Refusal;

const CFGR2: u32 = 0x1c;

/// EXTICR1 to 4 select pins for EXTI, which is not modelled; MEMRMP maps other memories to address 0; the SRAM's write
/// protection is not modelled either.
const REGISTERS: &[Register] = &[
    register(0x00, "MEMRMP", 0, 0x0000_0107, 0x0000_0107),
    register(0x04, "CFGR1", 0x7c00_0001, 0xfcff_0300, 0),
    // PVDL: the voltage detector is not modelled.
    register(CFGR2, "CFGR2", 0, 0x0000_000f, 0x0000_0004),
];

/// DBGMCU (47.16). The freezes act while a debugger holds the core.
const DEBUG: &[Register] = &[
    register(0x04, "CR", 0, 0x0000_0007, 0),
    register(0x08, "APB1FZR1", 0, u32::MAX, 0),
    register(0x0c, "APB1FZR2", 0, u32::MAX, 0),
    register(0x10, "APB2FZR", 0, u32::MAX, 0),
];

/// Alarm that the chip itself tells the break input of TIM1 where SYSCFG_CFGR2 connects it (10.2.10).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alarm {
    /// The core has locked up: a fault within a fault.
    Lockup = 0,
    /// Parity of the SRAM.
    Parity = 1,
    /// Two wrong bits in a double word of flash.
    Ecc = 3,
}

/// SYSCFG and DBGMCU.
#[derive(Clone, Debug)]
pub struct Syscfg {
    block: Block,
    debug: Block,
    identity: u32,
}

impl Syscfg {
    /// State after reset; `identity` is DBGMCU_IDCODE.
    pub fn new(identity: u32) -> Self {
        let debug = Block::new("DBGMCU", "47.16", DEBUG);
        Self { block: Block::new("SYSCFG", "10.2", REGISTERS), debug, identity }
    }

    /// Back to reset. DBGMCU is reset with the power alone (47.16.2).
    pub fn reset(&mut self) {
        self.block.reset();
    }

    /// Back to power-up.
    pub fn power_up(&mut self) {
        *self = Self::new(self.identity);
    }

    /// Returns `true` if an alarm breaks TIM1. CFGR2's bits stay set until a reset: see `write`.
    pub fn breaks(&self, alarm: Alarm) -> bool {
        self.block.get(CFGR2) >> alarm as u32 & 1 != 0
    }

    /// A load by the core.
    pub fn read(&self, offset: u32) -> Result<u32, Refusal> {
        self.block.read(offset)
    }

    /// A store by the core. The locks of CFGR2 can be set, and cleared by a reset alone (10.2.10).
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), Refusal> {
        let before = self.block.write(offset, value)?;
        if offset == CFGR2 {
            self.block.set(CFGR2, self.block.get(CFGR2) | before);
        }
        Ok(())
    }

    /// A load from DBGMCU.
    pub fn read_debug(&self, offset: u32) -> Result<u32, Refusal> {
        if offset == 0 { Ok(self.identity) } else { self.debug.read(offset) }
    }

    /// A store to DBGMCU.
    pub fn write_debug(&mut self, offset: u32, value: u32) -> Result<(), Refusal> {
        self.debug.write(offset, value).map(|_| ())
    }
}
