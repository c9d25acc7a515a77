//! TIM1 (RM0440, chapter 28), TIM2 to TIM5 (29) and TIM15 (30).
//!
//! Modelled: counting up and centre-aligned, prescaler, preload, repetition counter, update held off by UDIS, output
//! compare in both PWM modes, TRGO and TRGO2 from an update or OC4REF, complementary outputs with dead time, break from
//! the chip's own alarms and the BKIN input, the encoder mode that counts every edge with capture of the index.
//!
//! Not modelled, and refused: counting down, one-pulse mode, DMA, slave modes, input capture but for the index, break
//! 2, locks.
//!
//! Assumptions where the manual's figures leave room:
//! - An event acts in the cycle in which the counter shows the value; its way to other peripherals is counted there.
//! - Reaching the top counts as counting up, reaching 0 as counting down: it decides which compare flags CMS sets.

mod counter;
mod encoder;
mod output;

use super::register::Block;
use super::syscfg::Alarm;
use super::variant::{TimerDescription, TimerKind};
use super::wiring::{Quadrature, TimerName};
use crate::bus::Refusal;
use counter::Counter;
use encoder::Encoder;
use output::Outputs;

mod registers;
use registers::*;

/// Events of a timer for other peripherals: rising edges of its trigger outputs (28.3.28 "ADC synchronization",
/// 29.3.19).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Events {
    /// Rising edge on TRGO.
    pub trigger: bool,
    /// Rising edge on TRGO2.
    pub trigger2: bool,
    /// The outputs do something new: see [`Timer::pwm`].
    pub outputs: bool,
}

impl Events {
    fn join(&mut self, other: Self) {
        self.trigger |= other.trigger;
        self.trigger2 |= other.trigger2;
        self.outputs |= other.outputs;
    }
}

/// A timer.
#[derive(Clone, Debug)]
pub struct Timer {
    description: &'static TimerDescription,
    block: Block,
    counter: Counter,
    encoder: Option<Encoder>,
    /// Compare values in force.
    compare: [u32; 4],
    /// Updates left out before the next.
    repetitions: u32,
    /// Level of OC4REF.
    reference4: bool,
    outputs: Outputs,
    events: Events,
}

impl Timer {
    /// State after reset.
    pub fn new(description: &'static TimerDescription) -> Self {
        let (table, chapter) = registers::of(description.kind);
        let block = Block::new(description.text, chapter, table);
        let counter = Counter::new(block.get(ARR));
        let compare = [0; 4];
        let (outputs, events) = (Outputs::default(), Events::default());
        Self { description, block, counter, encoder: None, compare, repetitions: 0, reference4: false, outputs, events }
    }

    /// Back to reset. The pins are not its own.
    pub fn reset(&mut self) {
        let (changes, carried) = (self.has_outputs(), self.outputs.carried);
        *self = Self::new(self.description);
        (self.events.outputs, self.outputs.carried) = (changes, carried);
    }

    /// Its description.
    pub const fn description(&self) -> &'static TimerDescription {
        self.description
    }

    /// Returns `true` if its encoder mode is on: then [`follow`](Self::follow) it before every access.
    #[inline]
    pub const fn follows_encoder(&self) -> bool {
        self.encoder.is_some()
    }

    /// Takes what the encoder has done.
    pub fn follow(&mut self, quadrature: Quadrature) {
        let Some(encoder) = &mut self.encoder else { return };
        let followed = encoder.follow(quadrature, self.counter.top);
        self.counter.count = followed.count;
        self.counter.up = followed.up;
        let mut flags = if followed.wrapped && self.block.get(CR1) & UDIS == 0 { UIF } else { 0 };
        if let Some(captured) = followed.captured.filter(|_| registers::captures_index(&self.block)) {
            self.block.set(CCR3, captured);
            // A capture before the one before was read (28.3.6).
            flags |= if self.block.get(SR) & CC3IF != 0 { CC3OF } else { CC3IF };
        }
        self.block.set(SR, self.block.get(SR) | flags);
    }

    /// Cycle at which something next happens that somebody else sees.
    pub fn next(&self) -> u64 {
        if self.encoder.is_some() {
            return u64::MAX;
        }
        let mut next = self.counter.turn();
        if !self.counter.running {
            return next;
        }
        // Bit of the channel's interrupt; the fourth reference may trigger as well.
        let seen = self.block.get(DIER) >> 1 & 0xf | u32::from(self.reference4_triggers()) << 3;
        for channel in (0..4).filter(|channel| seen >> channel & 1 != 0) {
            next = next.min(self.counter.reaches(self.compare[channel]));
        }
        next
    }

    /// The pins of its outputs changed.
    pub fn outputs_changed(&mut self) {
        self.events.outputs |= self.has_outputs();
    }

    /// Events since the last call, for others.
    pub fn take_events(&mut self) -> Events {
        std::mem::take(&mut self.events)
    }

    /// Moves on to a cycle. Turns in between are taken one by one, at their cycles.
    pub fn advance(&mut self, cycle: u64) {
        while self.encoder.is_none() {
            let turn = self.counter.turn();
            let to = cycle.min(turn);
            if let Some((first, last)) = self.counter.advance(to) {
                self.match_compares(first, last);
            }
            if turn > cycle {
                break;
            }
            self.turn(turn);
        }
        self.refresh_reference4();
    }

    /// Compare flags (28.3.7 "Output compare mode"): for the values that the counter reached.
    fn match_compares(&mut self, first: u32, last: u32) {
        let up = first <= last && self.counter.up;
        let (low, high) = (first.min(last), first.max(last));
        // Centre-aligned mode 1 flags while counting down, mode 2 while counting up, mode 3 both.
        if matches!((self.block.get(CR1) >> 5 & 3, up), (1, true) | (2, false)) {
            return;
        }
        let matches = |channel: &usize| (low..=high).contains(&self.compare[*channel]);
        let flags: u32 = (0..self.channels()).filter(matches).map(|channel| 2 << channel).sum();
        self.block.set(SR, self.block.get(SR) | flags);
    }

    fn channels(&self) -> usize {
        if self.description.kind == TimerKind::TwoChannels { 2 } else { 4 }
    }

    fn turn(&mut self, cycle: u64) {
        let overflow = self.counter.turn_over();
        self.counter.since = cycle;
        if !self.counter.centred {
            self.match_compares(0, 0);
        } else if overflow {
            // A compare value above the top matches at the overflow (28.6.5, CC1IF).
            let above = |channel: &usize| self.compare[*channel] > self.counter.top;
            let flags: u32 = (0..self.channels()).filter(above).map(|channel| 2 << channel).sum();
            self.block.set(SR, self.block.get(SR) | flags);
        }
        if self.block.get(CR1) & UDIS == 0 {
            if self.repetitions == 0 {
                self.update(true);
            } else {
                self.repetitions -= 1;
            }
        }
        self.events.outputs |= self.has_outputs();
        self.refresh_reference4();
    }

    /// An update event: preloaded values come into force (28.3.1, 28.3.3).
    fn update(&mut self, flag: bool) {
        self.repetitions = if self.has_repetitions() { self.block.get(RCR) } else { 0 };
        self.counter.tick = u64::from(self.block.get(PSC)) + 1;
        self.counter.top = self.block.get(ARR);
        for channel in 0..4 {
            self.compare[channel] = self.block.get_or_zero(CCR1 + 4 * channel as u32);
        }
        if flag {
            self.block.set(SR, self.block.get(SR) | UIF);
        }
        let trigger = self.block.get(CR2) >> 4 & 7 == MMS_UPDATE;
        self.events.join(Events { trigger, trigger2: self.trigger2_is(MMS_UPDATE), outputs: false });
    }

    fn has_repetitions(&self) -> bool {
        matches!(self.description.kind, TimerKind::Advanced | TimerKind::TwoChannels)
    }

    fn trigger2_is(&self, source: u32) -> bool {
        self.description.kind == TimerKind::Advanced && self.block.get(CR2) >> 20 & 0xf == source
    }

    fn reference4_triggers(&self) -> bool {
        self.block.get(CR2) >> 4 & 7 == MMS_REFERENCE4 || self.trigger2_is(MMS_REFERENCE4)
    }

    /// OC4REF, and the triggers at its rising edge.
    fn refresh_reference4(&mut self) {
        if self.description.kind == TimerKind::TwoChannels {
            return;
        }
        let level = self.counter.running && self.reference(3);
        if level && !self.reference4 {
            let trigger = self.block.get(CR2) >> 4 & 7 == MMS_REFERENCE4;
            self.events.join(Events { trigger, trigger2: self.trigger2_is(MMS_REFERENCE4), outputs: false });
        }
        self.reference4 = level;
    }

    /// Levels of the interrupts: update, capture and compare, break, trigger.
    #[inline]
    pub fn interrupts(&self) -> [bool; 4] {
        let enabled = self.block.get(DIER);
        if enabled == 0 {
            return [false; 4];
        }
        let active = self.block.get(SR) & 0xffff;
        let breaks = active & (BIF | SBIF) != 0 && enabled & BIE != 0;
        [active & enabled & UIF != 0, active & enabled & 0x1e != 0, breaks, false]
    }

    /// An alarm of the chip: the outputs go off, and stay off until the program switches them on again (28.3.17).
    pub fn alarm(&mut self, _alarm: Alarm) {
        if self.description.kind == TimerKind::Advanced && self.block.get(BDTR) & BKE != 0 {
            self.block.set(SR, self.block.get(SR) | SBIF);
            self.switch_off();
        }
    }

    fn switch_off(&mut self) {
        let before = self.block.get(BDTR);
        self.block.set(BDTR, before & !MOE);
        self.events.outputs |= before & MOE != 0;
    }

    /// Returns `true` if a register shows what the counter has done since it last turned.
    #[inline]
    pub const fn shows_count(&self, offset: u32) -> bool {
        matches!(offset, CNT | SR) || self.encoder.is_some()
    }

    /// Returns `true` if a load changes what others see: that of a captured index clears its flag.
    #[inline]
    pub fn changes_when_read(&self, offset: u32) -> bool {
        offset == CCR3 && registers::captures_index(&self.block)
    }

    /// A load by the core, after [`advance`](Self::advance) where the register [shows](Self::shows_count) it.
    pub fn read(&mut self, offset: u32) -> Result<u32, Refusal> {
        let value = self.block.read(offset)?;
        Ok(match offset {
            CNT => self.counter.count,
            CR1 if self.counter.centred || self.encoder.is_some() => {
                value & !DIR | if self.counter.up { 0 } else { DIR }
            }
            CCR3 if registers::captures_index(&self.block) => {
                self.block.set(SR, self.block.get(SR) & !CC3IF);
                value
            }
            _ => value,
        })
    }

    /// A store by the core of what is kept for the next update and changes nothing before it: most of what a program
    /// writes to a timer that runs. False where it is something else, and has to be a [`write`](Self::write).
    #[inline]
    pub fn prepare(&mut self, offset: u32, value: u32) -> bool {
        let prepares = match offset {
            _ if self.encoder.is_some() => false,
            CCR1..=CCR4 => self.is_preloaded(((offset - CCR1) / 4) as usize),
            // The direction only shows where the counter goes.
            CR1 => {
                let shown = if self.counter.centred { DIR } else { 0 };
                (value ^ self.block.get(CR1)) & !(UDIS | URS | ARPE | shown) == 0
            }
            _ => false,
        };
        prepares && self.block.write(offset, value).is_ok()
    }

    /// A store by the core, after [`advance`](Self::advance).
    pub fn write(&mut self, offset: u32, value: u32, cycle: u64) -> Result<(), Refusal> {
        let control = (self.counter.running, self.counter.centred);
        match offset {
            SR => self.block.set(SR, self.block.get(SR) & value),
            EGR => return self.generate(value, cycle),
            CNT => {
                self.block.write(CNT, value)?;
                self.counter.set(self.block.get(CNT));
                if let Some(encoder) = &mut self.encoder {
                    encoder.set(self.counter.count);
                }
            }
            BDTR => self.write_break(value)?,
            _ => {
                self.block.write(offset, value)?;
                self.written(offset, cycle)?;
            }
        }
        // Of CR1, what holds updates off changes no output: the firmware writes it twice a period.
        if matches!(offset, CCMR1 | CCMR2 | CCER | BDTR)
            || offset == CR1 && control != (self.counter.running, self.counter.centred)
        {
            self.events.outputs |= self.has_outputs();
        }
        self.refresh_reference4();
        Ok(())
    }

    /// Carries out what a register that was written does at once.
    fn written(&mut self, offset: u32, cycle: u64) -> Result<(), Refusal> {
        let value = self.block.get(offset);
        match offset {
            CR1 => {
                let centred = value & CMS != 0;
                if value & DIR != 0 && !centred {
                    return Err(self.block.refuse(CR1, "counting down"));
                }
                if centred != self.counter.centred && self.counter.running && value & CEN != 0 {
                    return Err(self.block.forbid(CR1, "the alignment is changed while the counter runs"));
                }
                if self.counter.centred && !centred {
                    self.counter.up = true;
                }
                self.counter.centred = centred;
                self.counter.run(cycle, value & CEN != 0 && self.encoder.is_none());
            }
            SMCR => self.select_encoder(cycle)?,
            ARR if self.block.get(CR1) & ARPE == 0 => {
                if self.counter.count > value && self.counter.running {
                    return Err(self.block.refuse(ARR, "a top below the count while the counter runs"));
                }
                self.counter.top = value;
            }
            CCMR1 | CCMR2 => registers::check_modes(&self.block, offset)?,
            CCR1..=CCR4 => {
                let channel = ((offset - CCR1) / 4) as usize;
                if !self.is_preloaded(channel) {
                    self.compare[channel] = value;
                    self.events.outputs |= self.has_outputs();
                }
            }
            AF1 if self.description.kind == TimerKind::Advanced => self.judge_break(),
            DIER if self.encoder.is_some() && value != 0 => {
                return Err(self.block.refuse(DIER, "interrupts in encoder mode"));
            }
            _ => {}
        }
        Ok(())
    }

    /// SMS: encoder mode 3, every edge of both inputs (29.3.21 "Encoder interface mode").
    fn select_encoder(&mut self, cycle: u64) -> Result<(), Refusal> {
        match self.block.get(SMCR) & SMS {
            0 => self.encoder = None,
            3 if self.description.kind != TimerKind::TwoChannels => {
                self.encoder = Some(Encoder::new(self.counter.count));
                self.counter.run(cycle, false);
            }
            _ => return Err(self.block.refuse(SMCR, "a slave mode other than encoder mode 3")),
        }
        Ok(())
    }

    fn is_preloaded(&self, channel: usize) -> bool {
        let register = if channel < 2 { CCMR1 } else { CCMR2 };
        self.block.get(register) >> (3 + 8 * (channel & 1)) & 1 != 0
    }

    /// EGR: UG starts over and loads the preloaded values; it flags an update unless URS says that only turns do
    /// (28.6.6).
    fn generate(&mut self, value: u32, cycle: u64) -> Result<(), Refusal> {
        self.block.write(EGR, value)?;
        if value & 1 != 0 {
            (self.counter.count, self.counter.up, self.counter.since) = (0, true, cycle);
            if let Some(encoder) = &mut self.encoder {
                encoder.set(0);
            }
            if self.block.get(CR1) & UDIS == 0 {
                self.update(self.block.get(CR1) & URS == 0);
            }
            self.events.outputs |= self.has_outputs();
        }
        if value & BG != 0 && self.description.kind == TimerKind::Advanced {
            self.block.set(SR, self.block.get(SR) | BIF);
            self.switch_off();
        }
        self.refresh_reference4();
        Ok(())
    }

    /// The timer's name.
    pub const fn name(&self) -> TimerName {
        self.description.name
    }
}
