//! A timer's outputs: RM0440, 28.3.11 to 28.3.18 "PWM edge-aligned and centre-aligned", "Complementary outputs and
//! dead-time insertion", "Using the break function", "Output control bits" (table of 28.6.11).

use super::super::variant::TimerOutput;
use super::super::wiring::{Gate, Leg, Pwm};
use super::registers::*;
use super::{Refusal, Timer, TimerKind};

/// Registers that choose what the outputs do, the compare values apart; of the first only the clock of the dead time.
const CHOOSE_OUTPUTS: [u32; 6] = [CR1, CR2, CCMR1, CCMR2, CCER, BDTR];

/// Outputs as they were found: they are the same in most periods.
#[derive(Clone, Debug, Default)]
pub struct Outputs {
    /// `true` for each channel's output, and its complementary one, that a pin carries.
    pub carried: [[bool; 2]; 3],
    /// Contents of the registers when the rest was found; none where it was not yet.
    chosen: Option<[u32; CHOOSE_OUTPUTS.len()]>,
    legs: [Leg; 3],
    dead_time: u64,
}

impl Timer {
    /// Returns `true` if a channel from 1 to 3 is enabled as an output.
    pub(super) fn has_outputs(&self) -> bool {
        self.description.kind != TimerKind::TwoChannels && self.encoder.is_none() && self.block.get(CCER) & 0x555 != 0
    }

    fn mode(&self, channel: usize) -> u32 {
        let register = if channel < 2 { CCMR1 } else { CCMR2 };
        self.block.get_or_zero(register) >> (8 * (channel & 1)) & 0xff
    }

    /// Level of a channel's reference, OCxREF: in PWM mode 1 active below the compare value counting up, and up to it
    /// counting down; in mode 2 the other way round (28.6.7, OC1M).
    pub(super) fn reference(&self, channel: usize) -> bool {
        let (count, compare) = (self.counter.count, self.compare[channel]);
        let below = if self.counter.up { count < compare } else { count <= compare };
        match self.mode(channel) >> 4 & 7 {
            6 => below,
            7 => !below,
            _ => false,
        }
    }

    /// Connects those of its outputs that a pin carries; the others are released.
    pub fn connect<'a>(&mut self, carried: impl Iterator<Item = &'a TimerOutput>) {
        self.outputs = Outputs::default();
        for output in carried {
            if let Some(leg) = self.outputs.carried.get_mut(usize::from(output.channel).wrapping_sub(1)) {
                leg[usize::from(output.complementary)] = true;
            }
        }
    }

    /// Action of the outputs from now on.
    pub fn pwm(&mut self) -> Pwm {
        let mut chosen = CHOOSE_OUTPUTS.map(|register| self.block.get_or_zero(register));
        chosen[0] &= CKD;
        if self.outputs.chosen != Some(chosen) {
            self.outputs.legs = [0, 1, 2].map(|channel| self.leg(channel));
            (self.outputs.dead_time, self.outputs.chosen) = (self.dead_time(), Some(chosen));
        }
        let mut legs = self.outputs.legs;
        for (leg, compare) in legs.iter_mut().zip(self.compare) {
            leg.compare = compare;
        }
        Pwm {
            timer: self.description.name,
            running: self.counter.running,
            count: self.counter.count,
            up: self.counter.up,
            top: self.counter.top,
            tick: self.counter.tick,
            dead_time: self.outputs.dead_time,
            legs,
        }
    }

    /// A channel's pins, by the registers; its compare value changes every period, and is filled in by `pwm`.
    fn leg(&self, channel: usize) -> Leg {
        let [high, low] =
            [false, true].map(|complementary| match self.outputs.carried[channel][usize::from(complementary)] {
                true => self.gate(channel, complementary),
                false => Gate::Released,
            });
        Leg { compare: 0, active_below: self.mode(channel) >> 4 & 7 == 6, high, low }
    }

    /// A channel's pin, or its complementary one.
    fn gate(&self, channel: usize, complementary: bool) -> Gate {
        let enables = self.block.get(CCER) >> (4 * channel);
        let (own, other, inverted) = match complementary {
            false => (enables & 1, enables >> 2 & 1, enables >> 1 & 1),
            true => (enables >> 2 & 1, enables & 1, enables >> 3 & 1),
        };
        let (own, other, inverted) = (own != 0, other != 0, inverted != 0);
        if self.mode(channel) & 3 != 0 {
            return Gate::Released;
        }
        if self.description.kind != TimerKind::Advanced {
            return match own && !complementary {
                true => Gate::Switching { inverted },
                false => Gate::Released,
            };
        }
        let control = self.block.get(BDTR);
        if control & MOE == 0 {
            // Off-state of idle mode: the idle level, or the pin is released.
            let idle = self.block.get(CR2) >> (8 + 2 * channel + usize::from(complementary)) & 1 != 0;
            return if control & OSSI != 0 && (own || other) { Gate::Held(idle != inverted) } else { Gate::Released };
        }
        match (own, complementary) {
            (true, false) => Gate::Switching { inverted },
            (true, true) if other => Gate::Complement { inverted },
            // Alone, the complementary output follows the reference itself.
            (true, true) => Gate::Switching { inverted },
            (false, _) if other && control & OSSR != 0 => Gate::Held(inverted),
            (false, _) => Gate::Released,
        }
    }

    /// Dead time in cycles: BDTR.DTG in periods of the clock that CR1.CKD divides (28.6.20).
    fn dead_time(&self) -> u64 {
        if self.description.kind != TimerKind::Advanced {
            return 0;
        }
        let code = u64::from(self.block.get(BDTR) & 0xff);
        let periods = match code >> 5 {
            0..=3 => code,
            4 | 5 => (64 + (code & 0x3f)) * 2,
            6 => (32 + (code & 0x1f)) * 8,
            _ => (32 + (code & 0x1f)) * 16,
        };
        periods << ((self.block.get(CR1) & CKD) >> 8)
    }

    /// BDTR. While a break is active the outputs cannot be switched on (28.3.17).
    ///
    /// The BKIN input is on after reset; no pin carries it here, so it reads low, which the polarity after reset takes
    /// for a break.
    pub(super) fn write_break(&mut self, value: u32) -> Result<(), Refusal> {
        self.block.write(BDTR, value)?;
        self.judge_break();
        Ok(())
    }

    pub(super) fn judge_break(&mut self) {
        let control = self.block.get(BDTR);
        // AF1.BKINP turns the level round where the input is enabled.
        let level = self.block.get(AF1) & (BKINE | 1 << 9) == BKINE | 1 << 9;
        if control & BKE != 0 && level == (control & BKP != 0) {
            self.block.set(SR, self.block.get(SR) | BIF);
            self.switch_off();
        }
    }
}
