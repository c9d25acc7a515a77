//! RCC, reset and clock control: RM0440, chapter 7.
//!
//! The clock tree is computed, not assumed: a program that switches to a clock that is not ready, or sets the PLL
//! beyond its limits, stops the run. Peripherals' time counts the core's cycles, so the APB prescalers stay at 1
//! (`CFGR`, 7.4.3).
//!
//! Start-up times are the datasheet's typical ones (DS12288, "internal clock source characteristics", "PLL
//! characteristics"). There is no crystal: neither board's firmware uses one.

use super::register::{Block, Register, register};
use super::time::{Instant, Moment};
use super::variant::ClockGate;
use crate::bus::Refusal;

/// Frequency of the internal high-speed oscillator, Hz.
pub const HSI: u64 = 16_000_000;
/// Frequency of the internal low-speed oscillator, Hz.
pub const LSI: u64 = 32_000;

const HSI_START_NS: u64 = 800;
const HSI48_START_NS: u64 = 2_500;
const LSI_START_NS: u64 = 80_000;
const PLL_LOCK_NS: u64 = 15_000;

const CR: u32 = 0x00;
const ICSCR: u32 = 0x04;
const CFGR: u32 = 0x08;
const PLLCFGR: u32 = 0x0c;
const CCIPR: u32 = 0x88;
const BDCR: u32 = 0x90;
const CSR: u32 = 0x94;
const CRRCR: u32 = 0x98;

const HSION: u32 = 1 << 8;
const HSIRDY: u32 = 1 << 10;
const PLLON: u32 = 1 << 24;
const PLLRDY: u32 = 1 << 25;
const BDRST: u32 = 1 << 16;
const RMVF: u32 = 1 << 23;
/// HSI's calibration by the factory, without HSITRIM: each chip has its own.
const CALIBRATION: u32 = 0x2c;
/// Enables of the PLL's outputs, which may change while it runs.
const OUTPUTS: u32 = 1 << 16 | 1 << 20 | 1 << 24;

const REGISTERS: &[Register] = &[
    // HSEON and CSSON: no crystal is fitted.
    register(CR, "CR", 0x0000_0500, 0x0104_0300, 0x0009_0000),
    register(ICSCR, "ICSCR", 0x4000_0000, 0x7f00_0000, 0),
    // PPRE1, PPRE2: see above. MCOSEL: no clock leaves the chip.
    register(CFGR, "CFGR", 0x0000_0001, 0x7f00_3ff3, 0x0f00_3f00),
    register(PLLCFGR, "PLLCFGR", 0x0000_1000, 0xff73_7ff3, 0),
    register(0x18, "CIER", 0, 0x0000_067b, 0x0000_067b),
    register(0x28, "AHB1RSTR", 0, 0x0000_111f, 0),
    register(0x2c, "AHB2RSTR", 0, 0x050f_607f, 0),
    register(0x30, "AHB3RSTR", 0, 0x0000_0101, 0),
    register(0x38, "APB1RSTR1", 0, 0xd2fe_c13f, 0),
    register(0x3c, "APB1RSTR2", 0, 0x0000_0103, 0),
    register(0x40, "APB2RSTR", 0, 0x0437_f801, 0),
    register(0x48, "AHB1ENR", 0x0000_0100, 0x0000_111f, 0),
    register(0x4c, "AHB2ENR", 0, 0x050f_607f, 0),
    register(0x50, "AHB3ENR", 0, 0x0000_0101, 0),
    register(0x58, "APB1ENR1", 0x0000_0400, 0xd2fe_cd3f, 0),
    register(0x5c, "APB1ENR2", 0, 0x0000_0103, 0),
    register(0x60, "APB2ENR", 0, 0x0437_f801, 0),
    register(0x68, "AHB1SMENR", 0x0000_130f, 0x0000_131f, 0),
    register(0x6c, "AHB2SMENR", 0x050f_667f, 0x050f_667f, 0),
    register(0x70, "AHB3SMENR", 0x0000_0101, 0x0000_0101, 0),
    register(0x78, "APB1SMENR1", 0xd2fe_cd3f, 0xd2fe_cd3f, 0),
    register(0x7c, "APB1SMENR2", 0x0000_0103, 0x0000_0103, 0),
    register(0x80, "APB2SMENR", 0x0437_f801, 0x0437_f801, 0),
    register(CCIPR, "CCIPR", 0, 0xffff_ffff, 0),
    // LSEON: no crystal is fitted.
    register(BDCR, "BDCR", 0, 0x0301_833d, 0x0000_0021),
    register(CSR, "CSR", 0x0c00_0000, 0x0080_0001, 0),
    register(CRRCR, "CRRCR", 0, 0x0000_0001, 0),
    register(0x9c, "CCIPR2", 0, 0x0030_0003, 0),
];

/// Cause of the chip's reset: flags of RCC_CSR (7.4.28).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The power came, or came back.
    Power,
    /// Pin NRST.
    Pin,
    /// The program, by the core's SYSRESETREQ.
    Software,
    /// The independent watchdog.
    IndependentWatchdog,
    /// The option bytes were loaded.
    OptionBytes,
}

impl Cause {
    /// The flags. A reset from inside pulls NRST low, so the pin's flag is set as well (7.1.2).
    const fn flags(self) -> u32 {
        const PIN: u32 = 1 << 26;
        match self {
            Self::Power => 1 << 27 | PIN,
            Self::Pin => PIN,
            Self::Software => 1 << 28 | PIN,
            Self::IndependentWatchdog => 1 << 29 | PIN,
            Self::OptionBytes => 1 << 25 | PIN,
        }
    }
}

/// Effect of a write to RCC outside RCC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// No effect.
    None,
    /// The core runs at another frequency, Hz.
    Frequency(u64),
    /// Peripherals are reset: bits that became set in the reset register whose enable register lies at this offset.
    Reset {
        /// Offset of the enable register.
        register: u32,
        /// Bits that became set.
        bits: u32,
    },
}

/// RCC.
#[derive(Clone, Debug)]
pub struct Rcc {
    block: Block,
    hsi: Instant,
    hsi48: Instant,
    lsi: Instant,
    pll: Instant,
}

impl Rcc {
    /// State after power-up.
    pub fn new() -> Self {
        let block = Block::new("RCC", "7.4", REGISTERS);
        Self { block, hsi: Instant(0), hsi48: Instant::NEVER, lsi: Instant::NEVER, pll: Instant::NEVER }
    }

    /// Resets. The flags of causes stay until the program clears them, the backup domain until the power goes (7.1.3).
    pub fn reset(&mut self, at: Instant, cause: Cause) {
        let (flags, backup) = match cause {
            Cause::Power => (0, 0),
            _ => (self.block.get(CSR) & 0xfe00_0000, self.block.get(BDCR)),
        };
        self.block.reset();
        self.block.set(CSR, flags | cause.flags());
        self.block.set(BDCR, backup);
        (self.hsi, self.hsi48, self.lsi, self.pll) = (at, Instant::NEVER, Instant::NEVER, Instant::NEVER);
    }

    /// Returns `true` if a peripheral's clock is enabled.
    #[inline]
    pub fn is_enabled(&self, gate: ClockGate) -> bool {
        self.block.get(gate.register) >> gate.bit & 1 != 0
    }

    /// The watchdog starts the oscillator itself (7.2.10).
    pub fn start_lsi(&mut self, at: Instant) {
        if self.lsi == Instant::NEVER {
            self.lsi = at.after_ns(LSI_START_NS);
        }
    }

    /// Returns `true` if the 48 MHz clock of the random number generator runs: HSI48, as CCIPR.CLK48SEL says (7.4.26).
    pub fn has_hsi48(&self, at: Instant) -> bool {
        self.block.get(CCIPR) >> 26 & 3 == 0 && at >= self.hsi48
    }

    /// Clock that FDCAN is given, Hz: CCIPR.FDCANSEL (7.4.26).
    pub fn fdcan_clock(&self) -> Result<u64, Refusal> {
        match self.block.get(CCIPR) >> 24 & 3 {
            1 if self.block.get(PLLCFGR) >> 20 & 1 != 0 => {
                Ok(self.vco()? / (2 * (u64::from(self.block.get(PLLCFGR) >> 21 & 3) + 1)))
            }
            2 => self.system_clock(),
            _ => Err(self.block.refuse(CCIPR, "FDCANSEL other than a running PLLQ or PCLK1")),
        }
    }

    /// A load by the core.
    pub fn read(&self, offset: u32, at: Moment) -> Result<u32, Refusal> {
        let value = self.block.read(offset)?;
        let ready = |since: Instant, bit: u32| if at.instant() >= since { bit } else { 0 };
        Ok(match offset {
            // HSICAL is the sum of HSITRIM and the factory's calibration (7.4.2). The oscillator is exact whatever they
            // are.
            ICSCR => value | (((value >> 24) + CALIBRATION) & 0xff) << 16,
            CR => value & !(HSIRDY | PLLRDY) | ready(self.hsi, HSIRDY) | ready(self.pll, PLLRDY),
            // The switch is done at once: only ready clocks are accepted.
            CFGR => value & !0xc | (value & 3) << 2,
            CSR => value & !2 | ready(self.lsi, 2),
            CRRCR => value & !2 | ready(self.hsi48, 2),
            _ => value,
        })
    }

    /// A store by the core. `backup` says whether the backup domain may be written (PWR_CR1.DBP).
    pub fn write(&mut self, offset: u32, value: u32, at: Moment, backup: bool) -> Result<Effect, Refusal> {
        let now = at.instant();
        match offset {
            CR => {
                let before = self.block.write(CR, value)?;
                let after = self.block.get(CR);
                // The clock that the system runs on cannot be stopped (7.4.1).
                let (on_hsi, on_pll) = (self.block.get(CFGR) & 3 == 1, self.block.get(CFGR) & 3 == 3);
                let held = if on_hsi || on_pll { HSION } else { 0 } | if on_pll { PLLON } else { 0 };
                let after = after | before & held;
                self.block.set(CR, after);
                if after & HSION == 0 {
                    self.hsi = Instant::NEVER;
                } else if before & HSION == 0 {
                    self.hsi = now.after_ns(HSI_START_NS);
                }
                if after & PLLON == 0 {
                    self.pll = Instant::NEVER;
                } else if before & PLLON == 0 {
                    self.vco()?;
                    self.pll = now.after_ns(PLL_LOCK_NS);
                }
            }
            CFGR => {
                if value & 3 != self.block.get(CFGR) & 3 {
                    let ready = match value & 3 {
                        1 => self.hsi,
                        3 if self.block.get(PLLCFGR) >> 24 & 1 != 0 => self.pll,
                        _ => Instant::NEVER,
                    };
                    if now < ready {
                        return Err(self.block.forbid(CFGR, "the system clock is switched to one that is not ready"));
                    }
                }
                self.block.write(CFGR, value)?;
                return Ok(Effect::Frequency(self.system_clock()?));
            }
            PLLCFGR => {
                let changed = (self.block.get(PLLCFGR) ^ value) & !OUTPUTS;
                if changed != 0 && self.pll != Instant::NEVER {
                    return Err(self.block.forbid(PLLCFGR, "the PLL is changed while it runs"));
                }
                self.block.write(PLLCFGR, value)?;
            }
            0x28..=0x40 => {
                let before = self.block.write(offset, value)?;
                let bits = self.block.get(offset) & !before;
                return Ok(Effect::Reset { register: offset + 0x20, bits });
            }
            BDCR => {
                if backup {
                    self.block.write(BDCR, value)?;
                    if value & BDRST != 0 {
                        self.block.set(BDCR, BDRST);
                    }
                }
            }
            CSR => {
                self.block.write(CSR, value)?;
                let kept = self.block.get(CSR);
                self.block.set(CSR, if value & RMVF != 0 { kept & !(0xfe00_0000 | RMVF) } else { kept });
                match value & 1 {
                    0 => self.lsi = Instant::NEVER,
                    _ => self.start_lsi(now),
                }
            }
            CRRCR => {
                let before = self.block.write(CRRCR, value)?;
                if value & 1 == 0 {
                    self.hsi48 = Instant::NEVER;
                } else if before & 1 == 0 {
                    self.hsi48 = now.after_ns(HSI48_START_NS);
                }
            }
            _ => {
                self.block.write(offset, value)?;
            }
        }
        Ok(Effect::None)
    }

    /// The PLL's inner frequency, Hz. Its limits: DS12288, "PLL characteristics", range 1.
    fn vco(&self) -> Result<u64, Refusal> {
        let configuration = self.block.get(PLLCFGR);
        if configuration & 3 != 2 {
            return Err(self.block.refuse(PLLCFGR, "a source of the PLL other than HSI"));
        }
        let input = HSI / (u64::from(configuration >> 4 & 0xf) + 1);
        let vco = input * u64::from(configuration >> 8 & 0x7f);
        if !(2_660_000..=16_000_000).contains(&input) || !(96_000_000..=344_000_000).contains(&vco) {
            return Err(self.block.forbid(PLLCFGR, "the PLL's frequencies are beyond its limits"));
        }
        Ok(vco)
    }

    /// Frequency of the core, HCLK, Hz (7.2, figure of the clock tree).
    fn system_clock(&self) -> Result<u64, Refusal> {
        let configuration = self.block.get(CFGR);
        let source = match configuration & 3 {
            3 => self.vco()? / (2 * (u64::from(self.block.get(PLLCFGR) >> 25 & 3) + 1)),
            _ => HSI,
        };
        const SHIFTS: [u32; 8] = [1, 2, 3, 4, 6, 7, 8, 9];
        let prescaler = configuration >> 4 & 0xf;
        Ok(if prescaler & 8 != 0 { source >> SHIFTS[(prescaler & 7) as usize] } else { source })
    }
}

impl Default for Rcc {
    fn default() -> Self {
        Self::new()
    }
}
