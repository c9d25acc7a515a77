//! A board with a witness between it and the chip: a number for everything that they tell each other, and one for a
//! whole run. Two runs with the same number were the same run: every sample and every compare value at its picosecond.
//!
//! Host only.

use super::{Drivetrain, Encoder, Inputs, Wired};
use crate::chip::fdcan::line::{CanLine, Line};
use crate::chip::time::Instant;
use crate::chip::variant::Variant;
use crate::chip::wiring::{Pin, Pwm, Quadrature, SpiFrame, TimerName, Wiring};
use crate::chip::{Chip, Deviation};
use crate::cpu::Cpu;
use crate::emulation::Emulation;
use crate::parts::drv8353::Drv8353;
use plant::ParameterError;
use std::hash::{Hash, Hasher};

/// A board, and the number of what passed between it and the chip.
#[derive(Clone, Debug)]
pub struct Witnessed<W> {
    board: W,
    passed: Words,
}

/// Mixes words, faster than the standard library's hasher: a period has some fifty.
#[derive(Clone, Copy, Debug, Default)]
struct Words(u64);

impl Hasher for Words {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word.iter_mut().zip(chunk).for_each(|(to, from)| *to = *from);
            self.write_u64(u64::from_le_bytes(word));
        }
    }

    // Same as `write` without going through bytes: what is hashed are mostly small numbers and enumerations.
    fn write_u8(&mut self, word: u8) {
        self.write_u64(u64::from(word));
    }

    fn write_u32(&mut self, word: u32) {
        self.write_u64(u64::from(word));
    }

    fn write_usize(&mut self, word: usize) {
        self.write_u64(word as u64);
    }

    fn write_u64(&mut self, word: u64) {
        // An odd factor (2^64 divided by the golden ratio) and a rotation: no word is lost by those behind it.
        self.0 = (self.0.rotate_left(23) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
}

impl<W> Witnessed<W> {
    /// Board with a witness from now on.
    pub fn new(board: W) -> Self {
        Self { board, passed: Words::default() }
    }

    /// The board.
    pub const fn board(&self) -> &W {
        &self.board
    }

    /// The board, to change.
    pub const fn board_mut(&mut self) -> &mut W {
        &mut self.board
    }
}

impl<W: Wired> Emulation<Witnessed<W>> {
    /// The number of the run so far: what passed between chip and board, cycles, instructions, registers and memory.
    pub fn fingerprint(&self) -> u64 {
        let (cpu, mut all) = (&self.cpu, self.cpu.bus.wiring().passed);
        (cpu.now(), cpu.instructions(), cpu.slept(), cpu.xpsr(), cpu.fpscr()).hash(&mut all);
        (0..16).for_each(|number| cpu.register(number).hash(&mut all));
        (0..32).for_each(|number| cpu.float_register(number).hash(&mut all));
        cpu.bus.sram().hash(&mut all);
        all.finish()
    }
}

impl<W: Wired> Wired for Witnessed<W> {
    const VARIANT: &'static Variant = W::VARIANT;
    const NAME: &'static str = W::NAME;
    const BUTTON: bool = W::BUTTON;
    const DEVIATIONS: &'static [Deviation] = W::DEVIATIONS;

    fn core(chip: Chip<Self>) -> Cpu<Chip<Self>> {
        Cpu::new(chip)
    }

    fn with_encoder(self, encoder: Encoder) -> Result<Self, ParameterError> {
        Ok(Self { board: self.board.with_encoder(encoder)?, ..self })
    }

    fn drivetrain(&mut self) -> &mut Drivetrain {
        self.board.drivetrain()
    }

    fn inputs(&mut self) -> &mut Inputs {
        self.board.inputs()
    }

    fn line(&mut self) -> &mut Line {
        self.board.line()
    }

    fn led(&self) -> bool {
        self.board.led()
    }

    fn gate_driver(&mut self) -> Option<&mut Drv8353> {
        self.board.gate_driver()
    }
}

impl<W: Wiring> Wiring for Witnessed<W> {
    fn volts(&mut self, at: Instant, pin: Pin) -> f64 {
        let volts = self.board.volts(at, pin);
        (at, pin, volts.to_bits()).hash(&mut self.passed);
        volts
    }

    fn source_resistance(&mut self, at: Instant, pin: Pin) -> f64 {
        self.board.source_resistance(at, pin)
    }

    fn reference(&self) -> f64 {
        self.board.reference()
    }

    fn level(&mut self, at: Instant, pin: Pin) -> Option<bool> {
        let level = self.board.level(at, pin);
        (at, pin, level).hash(&mut self.passed);
        level
    }

    fn driven(&mut self, at: Instant, pin: Pin, level: Option<bool>) {
        (at, pin, level).hash(&mut self.passed);
        self.board.driven(at, pin, level);
    }

    fn quadrature(&mut self, at: Instant, timer: TimerName) -> Quadrature {
        let quadrature = self.board.quadrature(at, timer);
        (at, timer, quadrature).hash(&mut self.passed);
        quadrature
    }

    fn pwm(&mut self, at: Instant, pwm: &Pwm) {
        (at, pwm).hash(&mut self.passed);
        self.board.pwm(at, pwm);
    }

    fn spi(&mut self, at: Instant, frame: &SpiFrame) -> u16 {
        let answer = self.board.spi(at, frame);
        (at, frame, answer).hash(&mut self.passed);
        answer
    }

    fn can(&mut self) -> Option<&mut dyn CanLine> {
        self.board.can()
    }
}
