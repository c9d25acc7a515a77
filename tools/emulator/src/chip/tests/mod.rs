//! The chip through its bus, as the core sees it, and through its wiring, as a board does.

mod adc;
mod crc;
mod fdcan;
mod flash;
mod gpio;
mod iwdg;
mod power_cut;
mod rcc;
mod spi;
mod timer;

use super::fdcan::line::{CanLine, Line};
use super::time::Instant;
use super::variant::Variant;
use super::wiring::{Pin, Pwm, Quadrature, SpiFrame, TimerName, Wiring};
use super::{Chip, variant};
use crate::bus::{Bus, Refusal, Signals, Width};
use std::collections::{BTreeMap, VecDeque};

const RCC: u32 = 0x4002_1000;
const PWR: u32 = 0x4000_7000;
const FLASH: u32 = 0x4002_2000;

/// A board of which a test sets the inputs and sees the outputs.
#[derive(Clone, Debug)]
struct Board {
    volts: BTreeMap<Pin, f64>,
    resistance: f64,
    levels: BTreeMap<Pin, bool>,
    quadrature: Quadrature,
    answers: VecDeque<u16>,
    sampled: Vec<(Instant, Pin)>,
    driven: Vec<(Instant, Pin, Option<bool>)>,
    pwm: Vec<(Instant, Pwm)>,
    frames: Vec<(Instant, SpiFrame)>,
    last: Instant,
    can: Line,
}

impl Board {
    fn new() -> Self {
        Self {
            volts: BTreeMap::new(),
            resistance: 0.0,
            levels: BTreeMap::new(),
            quadrature: Quadrature::default(),
            answers: VecDeque::new(),
            sampled: vec![],
            driven: vec![],
            pwm: vec![],
            frames: vec![],
            last: Instant(0),
            can: Line::new(1_000_000),
        }
    }

    /// The chip calls in the order of time.
    fn at(&mut self, at: Instant) {
        assert!(at >= self.last, "{at:?} after {:?}", self.last);
        self.last = at;
    }
}

impl Wiring for Board {
    fn volts(&mut self, at: Instant, pin: Pin) -> f64 {
        self.at(at);
        self.sampled.push((at, pin));
        self.volts.get(&pin).copied().unwrap_or(0.0)
    }

    fn source_resistance(&mut self, _: Instant, _: Pin) -> f64 {
        self.resistance
    }

    fn level(&mut self, at: Instant, pin: Pin) -> Option<bool> {
        self.at(at);
        self.levels.get(&pin).copied()
    }

    fn driven(&mut self, at: Instant, pin: Pin, level: Option<bool>) {
        self.at(at);
        self.driven.push((at, pin, level));
    }

    fn quadrature(&mut self, at: Instant, _: TimerName) -> Quadrature {
        self.at(at);
        Quadrature { index: self.quadrature.index.take(), ..self.quadrature }
    }

    fn pwm(&mut self, at: Instant, pwm: &Pwm) {
        self.at(at);
        self.pwm.push((at, *pwm));
    }

    fn spi(&mut self, at: Instant, frame: &SpiFrame) -> u16 {
        self.at(at);
        self.frames.push((at, *frame));
        self.answers.pop_front().unwrap_or(u16::MAX)
    }

    fn can(&mut self) -> Option<&mut dyn CanLine> {
        Some(&mut self.can)
    }
}

/// A chip on that board, and the core's time.
struct Bench {
    chip: Chip<Board>,
    now: u64,
    signals: Signals,
}

impl Bench {
    fn new(variant: &'static Variant) -> Self {
        Self { chip: Chip::new(variant, Board::new()), now: 0, signals: Signals::default() }
    }

    /// A STM32G431CB at 170 MHz.
    fn fast() -> Self {
        let mut bench = Self::new(&variant::STM32G431CB);
        bench.speed_up();
        bench
    }

    /// 170 MHz from HSI, as 6.1.5 says: boost, wait states, half the frequency first.
    fn speed_up(&mut self) {
        self.set(RCC + 0x58, 1 << 28);
        self.set(PWR + 0x80, 0);
        self.set(FLASH, 0x0004_0604);
        self.set(RCC + 0x0c, 1 << 24 | 85 << 8 | 3 << 4 | 2);
        self.set(RCC, 0x0100_0500);
        self.until(RCC, 1 << 25, 1 << 25);
        self.set(RCC + 0x08, 3);
        assert_eq!(self.chip.frequency(), 170_000_000);
    }

    fn board(&mut self) -> &mut Board {
        self.chip.wiring_mut()
    }

    fn try_read(&mut self, address: u32, width: Width) -> Result<u32, Refusal> {
        self.now += 2;
        let value = self.chip.read(self.now, address, width);
        self.look();
        value
    }

    fn try_write(&mut self, address: u32, width: Width, value: u32) -> Result<(), Refusal> {
        self.now += 2;
        let result = self.chip.write(self.now, address, width, value);
        self.look();
        result
    }

    /// Takes the signals of the chip to the core; one-time signals are kept until a test takes them.
    fn look(&mut self) {
        let Signals { reset, rewritten, .. } = self.signals.clone();
        let mut now = self.chip.signals();
        now.reset |= reset;
        now.rewritten = now.rewritten.or(rewritten);
        self.signals = now;
    }

    fn get(&mut self, address: u32) -> u32 {
        self.try_read(address, Width::Word).unwrap()
    }

    fn set(&mut self, address: u32, value: u32) {
        self.try_write(address, Width::Word, value).unwrap();
    }

    /// The words of a refusal to write.
    fn refused(&mut self, address: u32, value: u32) -> String {
        match self.try_write(address, Width::Word, value) {
            Err(Refusal::Unmodelled(text)) => text,
            other => panic!("{other:?}"),
        }
    }

    /// The words of a refusal to read.
    fn unread(&mut self, address: u32) -> String {
        match self.try_read(address, Width::Word) {
            Err(Refusal::Unmodelled(text)) => text,
            other => panic!("{other:?}"),
        }
    }

    /// Lets cycles pass, event by event as the core does.
    fn pass(&mut self, cycles: u64) {
        let end = self.now + cycles;
        while self.chip.next_event() <= end {
            self.now = self.now.max(self.chip.next_event());
            self.chip.advance(self.now);
            self.look();
        }
        self.now = end;
    }

    /// Lets microseconds pass.
    fn pass_us(&mut self, microseconds: u64) {
        self.pass(microseconds * self.chip.frequency() / 1_000_000);
    }

    /// Polls a register as a program does; returns the cycles that it took.
    fn until(&mut self, address: u32, mask: u32, value: u32) -> u64 {
        let begin = self.now;
        for _ in 0..10_000_000 {
            if self.get(address) & mask == value {
                return self.now - begin;
            }
        }
        panic!("{address:#010x} & {mask:#x} never is {value:#x}");
    }

    fn line(&self, line: u8) -> bool {
        self.signals.lines[usize::from(line / 32)] >> (line % 32) & 1 != 0
    }
}

#[test]
fn what_is_not_modelled_is_named_and_what_is_not_there_does_not_answer() {
    let mut bench = Bench::new(&variant::STM32G431CB);
    assert_eq!(bench.unread(0x4000_1000), "TIM6 at 0x40001000 (RM0440, 31) is not modelled");
    assert_eq!(bench.refused(0x4002_0808, 1), "DMAMUX at 0x40020808 (RM0440, 13) is not modelled");
    assert_eq!(bench.unread(0x2200_0000), "bit-band alias at 0x22000000 (RM0440, 2.2) is not modelled");
    for nothing in [0x0c00_0000, 0x2000_8000, 0x3000_0000, 0x4001_3c00 + 0x2000_0000, 0x6000_0000] {
        assert_eq!(bench.try_read(nothing, Width::Word), Err(Refusal::NoAnswer), "{nothing:#x}");
        assert_eq!(bench.try_write(nothing, Width::Word, 0), Err(Refusal::NoAnswer), "{nothing:#x}");
    }
    // TIM5 and the third converter exist on the larger chip alone.
    bench.set(RCC + 0x4c, 1 << 13 | 1 << 14);
    assert_eq!(bench.try_read(0x4000_0c00, Width::Word), Err(Refusal::NoAnswer));
    assert_eq!(bench.try_read(0x5000_0400, Width::Word), Err(Refusal::NoAnswer));
}

#[test]
fn the_same_accesses_give_the_same_run() {
    let run = || {
        let mut bench = Bench::fast();
        bench.set(RCC + 0x60, 1 << 11);
        bench.set(0x4001_2c00 + 0x2c, 999);
        bench.set(0x4001_2c00 + 0x0c, 1);
        bench.set(0x4001_2c00, 1);
        bench.pass_us(100);
        let count = bench.get(0x4001_2c00 + 0x24);
        (bench.now, count, bench.chip.sram().to_vec())
    };
    assert_eq!(run(), run());
}
