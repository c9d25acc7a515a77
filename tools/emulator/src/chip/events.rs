//! Events that happen by themselves, in the order of time, and what peripherals tell each other.

use super::adc::{Due, Source, Trigger};
use super::gpio::Mode;
use super::memory::SRAM;
use super::rcc::Cause;
use super::time::Instant;
use super::timer::Events;
use super::variant::{self, Input, OUTPUTS};
use super::wiring::{TimerName, Wiring};
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

    /// Does what is due at a cycle, in the order of the agenda: timers first, as they start conversions.
    fn step(&mut self, cycle: u64) {
        // Of those that may have changed it is not known whether they are due.
        let changed = self.agenda.changed();
        let mut left = self.agenda.due(cycle) | changed;
        while let Some(place) = self.agenda.first_of(left) {
            if let Some(converter) = place.checked_sub(self.timers.len()) {
                match converter.checked_sub(self.converters.len()) {
                    None if self.converters[converter].next() <= cycle => self.convert(converter, cycle),
                    Some(spi) if self.spis[spi].next() <= cycle => self.end_frame(spi, cycle),
                    _ => {}
                }
            } else if changed >> place & 1 == 0 || self.timers[place].next() <= cycle {
                self.agenda.touch(place);
                self.timers[place].advance(cycle);
                self.tell(place, cycle);
            }
            // Timers that it has started may be due as well.
            left = (left | self.agenda.changed()) & !((2 << place) - 1);
        }
        if self.next_slow <= cycle {
            self.step_slow(cycle);
        }
    }

    /// A frame on SPI has ended: what the board makes of it.
    fn end_frame(&mut self, index: usize, cycle: u64) {
        self.agenda.touch(self.spi_place(index));
        if let Some((mut frame, began)) = self.spis[index].ended(cycle, self.clock.frequency()) {
            frame.began = self.clock.instant(began);
            let answer = self.wiring.spi(self.clock.instant(cycle), &frame);
            self.spis[index].answer(answer, cycle);
        }
    }

    /// Advances what counts time, not cycles.
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

    /// Advances the line: what ended on the bus, and what the controller does next.
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

    /// Does what is due in a converter.
    fn convert(&mut self, index: usize, cycle: u64) {
        self.agenda.touch(self.converter_place(index));
        let group = self.converters[index].description().group;
        let Some(divider) = self.common[group].divider() else { return };
        while let Some(due) = self.converters[index].advance(cycle, divider) {
            if let Due::Sample(input) = due {
                let volts = self.volts(input, cycle);
                let resistance = match input {
                    Input::Pin(pin) => self.wiring.source_resistance(self.clock.instant(cycle), pin),
                    Input::Amplifier(_) => 0.0,
                };
                let (reference, frequency) = (self.wiring.reference(), self.clock.frequency());
                self.converters[index].hold(Source { volts, resistance }, reference, frequency);
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
        if events == Events::default() {
            return;
        }
        if events.outputs {
            let pwm = self.timers[index].pwm();
            self.wiring.pwm(self.clock.instant(cycle), &pwm);
        }
        let (first, second) = match self.timers[index].name() {
            TimerName::Tim1 => (Some(Trigger::Tim1), Some(Trigger::Tim1Second)),
            TimerName::Tim2 => (Some(Trigger::Tim2), None),
            _ => (None, None),
        };
        for trigger in [first.filter(|_| events.trigger), second.filter(|_| events.trigger2)].into_iter().flatten() {
            for index in 0..self.converters.len() {
                self.agenda.touch(self.converter_place(index));
                let converter = &mut self.converters[index];
                if let Some(divider) = self.common[converter.description().group].divider() {
                    converter.trigger(trigger, cycle, divider);
                }
            }
        }
    }

    /// Tells the timers which of their outputs a pin carries: to be called when a pin's function may have changed.
    pub(super) fn connect(&mut self) {
        let gpio = &self.gpio;
        let carried = |output: &variant::TimerOutput| gpio.mode(output.pin) == Mode::Alternate(output.function);
        for timer in &mut self.timers {
            let name = timer.name();
            timer.connect(OUTPUTS.iter().filter(|output| output.timer == name && carried(output)));
        }
    }

    /// Tells the board of all timers' outputs anew: a pin was connected or disconnected.
    pub(super) fn tell_outputs(&mut self, cycle: u64) {
        self.connect();
        for index in 0..self.timers.len() {
            self.agenda.touch(index);
            self.timers[index].advance(cycle);
            self.timers[index].outputs_changed();
            self.tell(index, cycle);
        }
    }

    /// Refreshes what counts time after a change of it, or of the clock.
    pub(super) fn refresh_slow(&mut self) {
        self.next_slow = match self.powered {
            true => {
                let line = self.wiring.can().map_or(Instant::NEVER, |line| line.next());
                let controller = self.fdcan.next();
                self.clock.cycle(self.flash.next().min(self.iwdg.next()).min(line).min(controller))
            }
            false => u64::MAX,
        };
        self.slow_lines = u128::from(self.flash.interrupts()) << variant::FLASH_LINE;
        for (line, level) in variant::FDCAN_LINES.into_iter().zip(self.fdcan.interrupts()) {
            self.slow_lines |= u128::from(level) << line;
        }
        // The flash's state, its latency, a reset.
        self.news = true;
        self.refresh();
    }

    /// Place of a converter in the agenda: behind the timers.
    #[inline]
    pub(super) fn converter_place(&self, index: usize) -> usize {
        self.timers.len() + index
    }

    /// Place of an SPI in the agenda: behind the converters.
    #[inline]
    pub(super) fn spi_place(&self, index: usize) -> usize {
        self.timers.len() + self.converters.len() + index
    }

    /// The next cycle of the peripheral at a place of the agenda, and the levels of its lines.
    fn look_at(&self, place: usize) -> (u64, u128) {
        if let Some(timer) = self.timers.get(place) {
            let levels = timer.description().lines.into_iter().zip(timer.interrupts());
            let lines = levels.filter(|(_, level)| *level).fold(0, |lines, (line, _)| lines | 1 << line);
            return (timer.next(), lines);
        }
        let place = place - self.timers.len();
        if let Some(converter) = self.converters.get(place) {
            return (converter.next(), u128::from(converter.interrupts()) << converter.description().line);
        }
        match self.spis.get(place - self.converters.len()) {
            Some(spi) => (spi.next(), u128::from(spi.interrupts()) << spi.description().line),
            None => (u64::MAX, 0),
        }
    }

    /// Refreshes, after a change, the earliest event, and the levels of the interrupts.
    pub(super) fn refresh(&mut self) {
        if self.agenda.first_touched().is_some() {
            while let Some(place) = self.agenda.first_touched() {
                let (next, lines) = self.look_at(place);
                self.agenda.note(place, next, lines);
            }
            self.agenda.order();
        }
        self.next = self.agenda.next().min(self.next_slow);
        let lines = self.agenda.lines() | self.slow_lines;
        self.news |= lines != self.lines;
        self.lines = lines;
    }

    /// A double error was read: the interrupt, and TIM1's break where SYSCFG connects it (10.2.10).
    /// It is an event of this cycle, so that a core that does not ask after loads from flash hears of it at once.
    pub(super) fn double_error(&mut self, cycle: u64) {
        self.alarm(cycle, Alarm::Ecc);
        self.next = self.next.min(cycle);
        self.news = true;
    }

    pub(super) fn tell_signals(&mut self) -> Signals {
        let offset =
            |offsets: std::ops::Range<u32>| offsets.start + super::access::FLASH..offsets.end + super::access::FLASH;
        let stall = self.flash.stall().map(|(offsets, until)| (offset(offsets), self.clock.cycle(until)));
        self.news = false;
        let words = [0, 32, 64, 96].map(|bit| (self.lines >> bit) as u32);
        Signals {
            lines: words,
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
