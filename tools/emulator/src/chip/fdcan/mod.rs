//! FDCAN1 with classic frames: RM0440, chapter 44.
//!
//! Modelled: initialisation and protected registers, bit timing, filters, both receive FIFOs, transmit FIFO and queue,
//! cancellation, timestamps, error counters and states, bus-off with its recovery, both interrupt lines. A frame takes
//! the bits that it has.
//!
//! Not modelled, and refused: frames of CAN FD, loopback, monitoring, restricted operation, no retransmission, transmit
//! pause, transmit events, priority messages, the RAM watchdog, the time-out counter, low power.
//!
//! Assumption: a request that comes while a frame is under way takes part in the next arbitration; cancelling does not
//! touch a frame that is being sent.

pub mod line;
mod message_ram;
mod registers;

use super::register::Block;
use super::time::{Instant, Moment};
use crate::bus::Refusal;
use line::{CanFrame, Event, Part};
use message_ram::{ELEMENTS, MessageRam};
use registers::*;
use std::collections::VecDeque;

/// A receive FIFO.
#[derive(Clone, Copy, Debug, Default)]
struct Fifo {
    get: u32,
    fill: u32,
    lost: bool,
}

impl Fifo {
    /// RXFxS (44.4.22).
    fn status(self) -> u32 {
        let put = (self.get + self.fill) % ELEMENTS;
        self.fill | self.get << 8 | put << 16 | u32::from(self.fill == ELEMENTS) << 24 | u32::from(self.lost) << 25
    }
}

/// The controller.
#[derive(Clone, Debug)]
pub struct Fdcan {
    block: Block,
    ram: MessageRam,
    fifos: [Fifo; 2],
    /// Requested buffers, in the order of their requests.
    requests: VecDeque<u32>,
    put: u32,
    transmit_errors: u32,
    receive_errors: u32,
    last_error: u32,
    bus_off: bool,
    /// Instant at which it takes part: after eleven recessive bits, and from bus-off after 129 times as many.
    joins: Instant,
    counting_since: Instant,
    /// Part that the line was told.
    part: Part,
}

impl Fdcan {
    /// State after power-up.
    pub fn new() -> Self {
        Self {
            block: Block::new("FDCAN1", "44.4", REGISTERS),
            ram: MessageRam::new(),
            fifos: [Fifo::default(); 2],
            requests: VecDeque::new(),
            put: 0,
            transmit_errors: 0,
            receive_errors: 0,
            last_error: NO_CHANGE,
            bus_off: false,
            joins: Instant::NEVER,
            counting_since: Instant(0),
            part: Part::None,
        }
    }

    /// Back to reset; the message RAM stays.
    pub fn reset(&mut self) {
        let ram = std::mem::take(&mut self.ram);
        *self = Self { ram, ..Self::new() };
    }

    /// Instant at which it begins to take part.
    pub fn next(&self) -> Instant {
        if self.part == Part::None && !self.is_initialised() { self.joins } else { Instant::NEVER }
    }

    /// Duration of a bit, ps: NBTP (44.4.7). `clock` is the kernel's, Hz.
    fn bit(&self, clock: u64) -> u64 {
        let timing = u64::from(self.block.get(NBTP));
        let quanta = 1 + (timing >> 8 & 0xff) + 1 + (timing & 0x7f) + 1;
        quanta * ((timing >> 16 & 0x1ff) + 1) * 1_000_000_000_000 / clock.max(1)
    }

    fn is_initialised(&self) -> bool {
        self.block.get(CCCR) & INIT != 0
    }

    /// Participation from now on; none where that is what the line was told before.
    pub fn part(&mut self, at: Instant, clock: u64) -> Option<Part> {
        if self.bus_off && at >= self.joins {
            // Recovered (44.3.2 "Bus-off recovery sequence").
            (self.bus_off, self.transmit_errors, self.receive_errors) = (false, 0, 0);
            self.flag(BO);
        }
        let bit = self.bit(clock);
        let part = if self.is_initialised() || at < self.joins {
            Part::None
        } else {
            match self.next_request() {
                Some(buffer) => Part::Sending { bit, frame: self.ram.transmit(buffer).0 },
                None => Part::Listening { bit },
            }
        };
        (part != self.part).then(|| {
            self.part = part;
            part
        })
    }

    /// The buffer that is sent next: the oldest request, or the lowest identifier (TXBC.TFQM).
    fn next_request(&self) -> Option<u32> {
        if self.block.get(TXBC) & TFQM == 0 {
            return self.requests.front().copied();
        }
        let frames = self.requests.iter().map(|&buffer| (self.ram.transmit(buffer).0, buffer));
        frames.min_by_key(|(frame, buffer)| (frame.id << if frame.extended { 0 } else { 18 }, *buffer)).map(|(_, b)| b)
    }

    fn flag(&mut self, flags: u32) {
        self.block.set(IR, self.block.get(IR) | flags);
    }

    /// Takes an event that ended on the line.
    pub fn happened(&mut self, event: Event, at: Instant, clock: u64) {
        if self.part == Part::None {
            return;
        }
        // The line waits for a new word of what is to be sent.
        self.part = Part::Listening { bit: self.bit(clock) };
        let before = self.state();
        match event {
            Event::Received(frame) => {
                self.receive_errors = self.receive_errors.saturating_sub(1).min(127);
                self.last_error = 0;
                self.receive(&frame, at, clock);
            }
            Event::Sent(frame) => {
                self.transmit_errors = self.transmit_errors.saturating_sub(1);
                self.last_error = 0;
                self.sent(&frame);
            }
            Event::NotAcknowledged => {
                // An error-passive controller alone on the bus does not count further (ISO 11898-1, exception 1).
                if self.transmit_errors < PASSIVE {
                    self.transmit_errors += 8;
                }
                self.error(ACKNOWLEDGE_ERROR);
            }
            Event::Disturbed { own: true } => {
                self.transmit_errors += 8;
                self.error(BIT_ERROR);
            }
            Event::Disturbed { own: false } => {
                self.receive_errors = (self.receive_errors + 1).min(PASSIVE);
                self.error(FORM_ERROR);
            }
        }
        if self.transmit_errors > 255 {
            // The hardware sets INIT (44.3.2).
            (self.bus_off, self.joins) = (true, Instant::NEVER);
            self.block.set(CCCR, self.block.get(CCCR) | INIT);
        }
        let changed = before ^ self.state();
        let flags = [(PSR_EP, EP), (PSR_EW, EW), (PSR_BO, BO)].into_iter();
        let flags = flags.filter(|(state, _)| changed & state != 0).fold(0, |flags, (_, flag)| flags | flag);
        self.flag(flags);
    }

    fn error(&mut self, code: u32) {
        self.last_error = code;
        self.flag(PEA);
    }

    fn sent(&mut self, frame: &CanFrame) {
        // None where it was cancelled on its way.
        let Some(&buffer) = self.requests.iter().find(|buffer| self.ram.transmit(**buffer).0 == *frame) else { return };
        self.requests.retain(|request| *request != buffer);
        self.block.set(TXBTO, self.block.get(TXBTO) | 1 << buffer);
        if self.block.get(TXBTIE) >> buffer & 1 != 0 {
            self.flag(TC);
        }
        if self.requests.is_empty() {
            self.flag(TFE);
        }
    }

    fn receive(&mut self, frame: &CanFrame, at: Instant, clock: u64) {
        let global = self.block.get(RXGFC);
        let Some(accepted) = self.ram.accept(frame, global, self.block.get(XIDAM)) else { return };
        let number = accepted.fifo;
        let shift = 3 * number as u32;
        let mut fifo = self.fifos[number];
        if fifo.fill == ELEMENTS {
            // F0OM, F1OM: the oldest is overwritten, or the new one is lost (44.3.6).
            let overwrite = global >> if number == 0 { 9 } else { 8 } & 1 != 0;
            if !overwrite {
                self.fifos[number].lost = true;
                return self.flag(RF0L << shift);
            }
            fifo.get = (fifo.get + 1) % ELEMENTS;
            fifo.fill -= 1;
        }
        let timestamp = self.timestamp(at, clock);
        self.ram.put(accepted, fifo.get + fifo.fill, frame, timestamp);
        fifo.fill += 1;
        self.fifos[number] = fifo;
        self.flag(RF0N << shift | if fifo.fill == ELEMENTS { RF0F << shift } else { 0 });
    }

    /// TSCV: bits since it was started, divided by TCP + 1 (44.4.9).
    fn timestamp(&self, at: Instant, clock: u64) -> u32 {
        let control = self.block.get(TSCC);
        if control & 3 != 1 {
            return 0;
        }
        let period = self.bit(clock) * (u64::from(control >> 16 & 0xf) + 1);
        (at.0.saturating_sub(self.counting_since.0) / period.max(1)) as u32 & 0xffff
    }

    /// The states in PSR: warning, passive, bus-off.
    fn state(&self) -> u32 {
        let (transmit, receive) = (self.transmit_errors, self.receive_errors);
        let warning = if transmit >= WARNING || receive >= WARNING { PSR_EW } else { 0 };
        let passive = if transmit >= PASSIVE || receive >= PASSIVE { PSR_EP } else { 0 };
        warning | passive | if self.bus_off { PSR_BO } else { 0 }
    }

    /// Levels of interrupt lines 0 and 1: IE, the groups of ILS, ILE (44.4.18).
    #[inline]
    pub fn interrupts(&self) -> [bool; 2] {
        let active = self.block.get(IR) & self.block.get(IE);
        if active == 0 {
            return [false; 2];
        }
        let select = self.block.get(ILS);
        let second = GROUPS.iter().zip(0..).filter(|(_, group)| select >> group & 1 != 0);
        let second = second.fold(0, |flags, (group, _)| flags | group);
        let enabled = self.block.get(ILE);
        [active & !second != 0 && enabled & 1 != 0, active & second != 0 && enabled & 2 != 0]
    }

    /// A word of the message RAM.
    pub fn read_ram(&self, offset: u32) -> u32 {
        self.ram.get(offset as usize / 4)
    }

    /// Writes a word of the message RAM.
    pub fn write_ram(&mut self, offset: u32, value: u32) {
        self.ram.set(offset as usize / 4, value);
    }

    /// A load by the core.
    pub fn read(&mut self, offset: u32, at: Moment, clock: u64) -> Result<u32, Refusal> {
        let value = self.block.read(offset)?;
        Ok(match offset {
            CCCR => value | (value & CSR) >> 1,
            TSCV => self.timestamp(at.instant(), clock),
            ECR => {
                let passive = u32::from(self.receive_errors >= PASSIVE);
                self.transmit_errors.min(255) | self.receive_errors.min(127) << 8 | passive << 15
            }
            PSR => {
                // Reading sets the code to "no change" (44.4.13).
                let code = std::mem::replace(&mut self.last_error, NO_CHANGE);
                let activity = match self.part {
                    Part::None => 0,
                    Part::Listening { .. } => 1,
                    Part::Sending { .. } => 3,
                };
                PSR_FIXED | self.state() | activity << 3 | code
            }
            RXF0S => self.fifos[0].status(),
            RXF1S => self.fifos[1].status(),
            TXFQS => self.transmit_status(),
            TXBRP => self.requests.iter().fold(0, |bits, buffer| bits | 1 << buffer),
            _ => value,
        })
    }

    /// TXFQS (44.4.30): free buffers and the oldest request for a FIFO, and the buffer that is filled next.
    fn transmit_status(&self) -> u32 {
        let waiting = self.requests.len() as u32;
        let full = u32::from(waiting == ELEMENTS) << 21;
        if self.block.get(TXBC) & TFQM != 0 {
            let free = (0..ELEMENTS).find(|buffer| !self.requests.contains(buffer)).unwrap_or(0);
            return full | free << 16;
        }
        let get = self.requests.front().copied().unwrap_or(self.put);
        full | self.put << 16 | get << 8 | (ELEMENTS - waiting)
    }

    /// A store by the core.
    pub fn write(&mut self, offset: u32, value: u32, at: Moment, clock: u64) -> Result<(), Refusal> {
        let now = at.instant();
        match offset {
            CCCR => return self.control(value, now, clock),
            // Protected: written while CCE and INIT are set only (44.3.2).
            NBTP | DBTP | RWD | TSCC | TOCC | TDCR | RXGFC | XIDAM | TXBC
                if self.block.get(CCCR) & (CCE | INIT) != CCE | INIT => {}
            TSCC => {
                self.block.write(offset, value)?;
                self.counting_since = now;
            }
            TSCV => self.counting_since = now,
            IR => self.block.set(IR, self.block.get(IR) & !value),
            RXF0A | RXF1A => self.acknowledge(usize::from(offset == RXF1A), value),
            TXBAR => return self.request(value),
            TXBCR => self.cancel(value & 7),
            _ => {
                self.block.write(offset, value)?;
            }
        }
        Ok(())
    }

    /// CCCR: CCE goes with INIT; setting CCE forgets requests and FIFOs (44.4.6).
    fn control(&mut self, value: u32, at: Instant, clock: u64) -> Result<(), Refusal> {
        let before = self.block.write(CCCR, value)?;
        let initialised = value & INIT != 0;
        if !initialised || before & INIT == 0 {
            self.block.set(CCCR, self.block.get(CCCR) & !CCE);
        }
        if self.block.get(CCCR) & CCE != 0 && before & CCE == 0 {
            self.fifos = Default::default();
            self.requests.clear();
            self.put = 0;
            for register in [TXBTO, TXBCF] {
                self.block.set(register, 0);
            }
        }
        if initialised {
            self.joins = Instant::NEVER;
        } else if before & INIT != 0 {
            if self.ram.has_priorities(self.block.get(RXGFC)) {
                return Err(self.block.refuse(RXGFC, "a filter that marks priorities"));
            }
            let occurrences = if self.bus_off { 129 } else { 1 };
            self.joins = Instant(at.0 + occurrences * 11 * self.bit(clock));
        }
        Ok(())
    }

    /// All elements up to the one that is named are free again (44.4.23).
    fn acknowledge(&mut self, number: usize, index: u32) {
        let fifo = &mut self.fifos[number];
        let freed = (index + ELEMENTS - fifo.get) % ELEMENTS + 1;
        if freed <= fifo.fill {
            fifo.get = (fifo.get + freed) % ELEMENTS;
            fifo.fill -= freed;
            fifo.lost = false;
        }
    }

    /// TXBAR. In a FIFO, the buffer at the put index is the only one that may be requested (44.3.7).
    fn request(&mut self, buffers: u32) -> Result<(), Refusal> {
        let fifo = self.block.get(TXBC) & TFQM == 0;
        for buffer in (0..ELEMENTS).filter(|buffer| buffers >> buffer & 1 != 0) {
            if self.is_initialised() && self.block.get(CCCR) & CCE != 0 {
                // Ignored while the configuration may change.
                continue;
            }
            if self.ram.transmit(buffer).1 {
                return Err(self.block.refuse(TXBAR, "a frame that wants a transmit event"));
            }
            if self.requests.contains(&buffer) {
                continue;
            }
            if fifo && buffer != self.put {
                return Err(self.block.forbid(TXBAR, "a FIFO's frame is requested out of turn"));
            }
            self.requests.push_back(buffer);
            self.put = (self.put + 1) % ELEMENTS;
            for register in [TXBTO, TXBCF] {
                self.block.set(register, self.block.get(register) & !(1 << buffer));
            }
        }
        Ok(())
    }

    fn cancel(&mut self, buffers: u32) {
        let cancelled = self.requests.iter().fold(0, |bits, buffer| bits | 1 << buffer) & buffers;
        self.requests.retain(|buffer| cancelled >> buffer & 1 == 0);
        self.block.set(TXBCF, self.block.get(TXBCF) | cancelled);
        if cancelled & self.block.get(TXBCIE) != 0 {
            self.flag(TCF);
        }
    }
}

impl Default for Fdcan {
    fn default() -> Self {
        Self::new()
    }
}
