//! What happens by itself, in the order of time, and what peripherals tell each other.

use super::adc::{Due, Trigger};
use super::memory::SRAM;
use super::rcc::Cause;
use super::time::Instant;
use super::variant::{self, Input, OUTPUTS};
use super::wiring::{Gate, Pwm, TimerName, Wiring};
use super::{Chip, syscfg::Alarm};
use crate::bus::Signals;

impl<W: Wiring> Chip<W> {
    /// Does what is due up to a cycle.
    pub(super) fn run_events(&mut self, now: u64) {
        while self.next <= now {
            self.step(self.next);
            self.refresh();
        }
    }

    /// Does what is due at a cycle: timers first, as they start conversions.
    fn step(&mut self, cycle: u64) {
        for index in 0..self.timers.len() {
            if self.timers[index].next() <= cycle {
                self.timers[index].advance(cycle);
                self.tell(index, cycle);
            }
        }
        for index in 0..self.converters.len() {
            if self.converters[index].next() <= cycle {
                self.convert(index, cycle);
            }
        }
        for index in 0..self.spis.len() {
            if let Some((mut frame, began)) = self.spis[index].ended(cycle, self.clock.frequency()) {
                frame.began = self.clock.instant(began);
                let answer = self.wiring.spi(self.clock.instant(cycle), &frame);
                self.spis[index].answer(answer, cycle);
            }
        }
        if self.next_slow <= cycle {
            self.step_slow(cycle);
        }
    }

    /// What counts time, not cycles.
    fn step_slow(&mut self, cycle: u64) {
        let at = self.clock.instant(cycle);
        if self.flash.fails(at) {
            self.power_down(cycle);
        } else {
            self.flash.advance(at);
            self.step_line(at);
            if self.iwdg.next() <= at {
                self.reset(cycle, Cause::IndependentWatchdog);
            }
        }
        self.refresh_slow();
    }

    /// What ended on the bus, and what the controller does next.
    fn step_line(&mut self, at: Instant) {
        let clock = self.fdcan_clock();
        while let Some(event) = self.wiring.can().and_then(|line| line.take(at)) {
            self.fdcan.happened(event, at, clock);
            self.tell_line(at);
        }
        self.tell_line(at);
    }

    /// The controller's clock, Hz. 0 where RCC gives it none: then no bit ever ends.
    pub(super) fn fdcan_clock(&self) -> u64 {
        self.rcc.fdcan_clock().unwrap_or(0)
    }

    /// Tells the bus how the controller takes part.
    pub(super) fn tell_line(&mut self, at: Instant) {
        let part = self.fdcan.part(at, self.fdcan_clock());
        if let (Some(part), Some(line)) = (part, self.wiring.can()) {
            line.take_part(at, part);
        }
    }

    fn convert(&mut self, index: usize, cycle: u64) {
        let group = self.converters[index].description().group;
        let Some(divider) = self.common[group].divider() else { return };
        while let Some(due) = self.converters[index].advance(cycle, divider) {
            if let Due::Sample(input) = due {
                let volts = self.volts(input, cycle);
                self.converters[index].hold(volts, self.wiring.reference());
            }
        }
    }

    fn volts(&mut self, input: Input, cycle: u64) -> f64 {
        let at = self.clock.instant(cycle);
        match input {
            Input::Pin(pin) => self.wiring.volts(at, pin),
            Input::Amplifier(number) => {
                // Off, it gives nothing.
                let Some(amplification) = self.amplifiers.amplification(number) else { return 0.0 };
                let bias = amplification.bias.map_or(0.0, |pin| self.wiring.volts(at, pin));
                let volts = self.wiring.volts(at, amplification.input);
                let output = amplification.gain * volts - (amplification.gain - 1.0) * bias;
                output.clamp(0.0, self.wiring.reference())
            }
        }
    }

    /// Passes on what a timer has to tell others.
    pub(super) fn tell(&mut self, index: usize, cycle: u64) {
        let events = self.timers[index].take_events();
        if events.outputs {
            let pwm = self.connected(self.timers[index].pwm());
            self.wiring.pwm(self.clock.instant(cycle), &pwm);
        }
        let (first, second) = match self.timers[index].name() {
            TimerName::Tim1 => (Some(Trigger::Tim1), Some(Trigger::Tim1Second)),
            TimerName::Tim2 => (Some(Trigger::Tim2), None),
            _ => (None, None),
        };
        for trigger in [first.filter(|_| events.trigger), second.filter(|_| events.trigger2)].into_iter().flatten() {
            for converter in &mut self.converters {
                if let Some(divider) = self.common[converter.description().group].divider() {
                    converter.trigger(trigger, cycle, divider);
                }
            }
        }
    }

    /// Releases what no pin carries.
    fn connected(&self, mut pwm: Pwm) -> Pwm {
        let timer = pwm.timer;
        let is_connected = |channel: u8, complementary: bool| {
            OUTPUTS.iter().any(|output| {
                (output.timer, output.channel, output.complementary) == (timer, channel, complementary)
                    && self.gpio.mode(output.pin) == super::gpio::Mode::Alternate(output.function)
            })
        };
        for (leg, channel) in pwm.legs.iter_mut().zip(1..) {
            if !is_connected(channel, false) {
                leg.high = Gate::Released;
            }
            if !is_connected(channel, true) {
                leg.low = Gate::Released;
            }
        }
        pwm
    }

    /// Tells the board of all timers' outputs anew: a pin was connected or disconnected.
    pub(super) fn tell_outputs(&mut self, cycle: u64) {
        for index in 0..self.timers.len() {
            self.timers[index].advance(cycle);
            self.timers[index].outputs_changed();
            self.tell(index, cycle);
        }
    }

    /// What counts time has changed, or the clock.
    pub(super) fn refresh_slow(&mut self) {
        self.next_slow = match self.powered {
            true => {
                let line = self.wiring.can().map_or(Instant::NEVER, |line| line.next());
                let controller = self.fdcan.next();
                self.clock.cycle(self.flash.next().min(self.iwdg.next()).min(line).min(controller))
            }
            false => u64::MAX,
        };
        self.refresh();
    }

    /// Something has changed: the earliest event, and the levels of the interrupts.
    pub(super) fn refresh(&mut self) {
        let timers = self.timers.iter().map(|timer| timer.next());
        let converters = self.converters.iter().map(|converter| converter.next());
        let spis = self.spis.iter().map(|spi| spi.next());
        self.next = timers.chain(converters).chain(spis).min().unwrap_or(u64::MAX).min(self.next_slow);

        let mut lines = [0u32; 4];
        let mut set = |line: u8, level: bool| lines[usize::from(line / 32)] |= u32::from(level) << (line % 32);
        for timer in &self.timers {
            for (line, level) in timer.description().lines.into_iter().zip(timer.interrupts()) {
                set(line, level);
            }
        }
        for converter in &self.converters {
            set(converter.description().line, converter.interrupts());
        }
        for spi in &self.spis {
            set(spi.description().line, spi.interrupts());
        }
        for (line, level) in variant::FDCAN_LINES.into_iter().zip(self.fdcan.interrupts()) {
            set(line, level);
        }
        set(variant::FLASH_LINE, self.flash.interrupts());
        self.lines = lines;
    }

    /// A double error was read: the interrupt, and TIM1's break where SYSCFG connects it (10.2.10).
    /// It is an event of this cycle, so that a core that does not ask after loads from flash hears of it at once.
    pub(super) fn double_error(&mut self, cycle: u64) {
        self.alarm(cycle, Alarm::Ecc);
        self.next = self.next.min(cycle);
    }

    pub(super) fn tell_signals(&mut self) -> Signals {
        let offset =
            |offsets: std::ops::Range<u32>| offsets.start + super::access::FLASH..offsets.end + super::access::FLASH;
        let stall = self.flash.stall().map(|(offsets, until)| (offset(offsets), self.clock.cycle(until)));
        Signals {
            lines: self.lines,
            nmi: self.flash.nmi(),
            reset: std::mem::take(&mut self.reset),
            rewritten: self.flash.take_rewritten().map(offset),
            stall,
        }
    }

    /// Memories that code may lie in.
    pub(super) fn code_ranges(&self) -> Vec<std::ops::Range<u32>> {
        let Self { variant, .. } = self;
        vec![
            super::access::FLASH..super::access::FLASH + variant.flash,
            super::memory::CCM..super::memory::CCM + variant.ccm,
            SRAM..SRAM + variant.sram + variant.ccm,
        ]
    }
}
