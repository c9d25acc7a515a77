//! IWDG, the independent watchdog: RM0440, chapter 42. It runs on its own oscillator and bites.
//!
//! The window is not modelled: the firmware has none. The oscillator runs at exactly 32 kHz.

use super::rcc::LSI;
use super::register::{Block, Register, register};
use super::time::{Instant, Moment};
use crate::bus::Refusal;

const KR: u32 = 0x00;
const PR: u32 = 0x04;
const RLR: u32 = 0x08;
const SR: u32 = 0x0c;

const REGISTERS: &[Register] = &[
    register(KR, "KR", 0, 0, 0),
    register(PR, "PR", 0, 0x0000_0007, 0),
    register(RLR, "RLR", 0x0000_0fff, 0x0000_0fff, 0),
    register(SR, "SR", 0, 0, 0),
];

/// A new prescaler or reload value takes up to five periods of the oscillator to arrive (42.4.4).
const UPDATE_PERIODS: u64 = 5;

/// Effect of a store that the rest of the chip is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// No effect.
    None,
    /// The low-speed oscillator is started (42.3.1).
    StartOscillator,
}

/// The watchdog.
#[derive(Clone, Debug)]
pub struct Iwdg {
    block: Block,
    unlocked: bool,
    /// Instant at which it bites; none while it does not run.
    bites: Option<Instant>,
    updating: [Instant; 2],
}

impl Iwdg {
    /// State after reset: stopped, as the option byte IWDG_SW says.
    pub fn new() -> Self {
        let block = Block::new("IWDG", "42.4", REGISTERS);
        Self { block, unlocked: false, bites: None, updating: [Instant(0); 2] }
    }

    /// Back to reset.
    pub fn reset(&mut self) {
        *self = Self::new();
    }

    /// Returns `true` if it runs.
    pub const fn is_running(&self) -> bool {
        self.bites.is_some()
    }

    /// Instant at which it resets the chip.
    #[inline]
    pub fn next(&self) -> Instant {
        self.bites.unwrap_or(Instant::NEVER)
    }

    /// A load by the core.
    pub fn read(&self, offset: u32, at: Moment) -> Result<u32, Refusal> {
        let value = self.block.read(offset)?;
        let [prescaler, reload] = self.updating.map(|until| u32::from(at.instant() < until));
        Ok(if offset == SR { prescaler | reload << 1 } else { value })
    }

    /// A store by the core.
    pub fn write(&mut self, offset: u32, value: u32, at: Moment) -> Result<Effect, Refusal> {
        let now = at.instant();
        match offset {
            KR => match value & 0xffff {
                0x5555 => self.unlocked = true,
                key => {
                    // Any other key protects the registers again (42.3.3).
                    self.unlocked = false;
                    if key == 0xcccc || key == 0xaaaa && self.bites.is_some() {
                        self.bites = Some(now.after(self.period(), LSI));
                    }
                    if key == 0xcccc {
                        return Ok(Effect::StartOscillator);
                    }
                }
            },
            PR | RLR => {
                let update = usize::from(offset == RLR);
                if now < self.updating[update] {
                    return Err(self.block.forbid(offset, "it is written while the value before is still on its way"));
                }
                if self.unlocked {
                    self.block.write(offset, value)?;
                    self.updating[update] = now.after(UPDATE_PERIODS, LSI);
                }
            }
            _ => {
                self.block.write(offset, value)?;
            }
        }
        Ok(Effect::None)
    }

    /// Periods of the oscillator from a reload to the reset (42.3.2).
    fn period(&self) -> u64 {
        let prescaler = 4 << self.block.get(PR).min(6);
        (u64::from(self.block.get(RLR)) + 1) * prescaler
    }
}

impl Default for Iwdg {
    fn default() -> Self {
        Self::new()
    }
}
