//! A board with its program: powered up, run for a time, its log read, reset where it asks for that.

use crate::board::Wired;
use crate::chip::Chip;
use crate::chip::rcc::Cause;
use crate::chip::time::Instant;
use crate::cpu::{Cpu, End, Origin};
use crate::program::Program;
use crate::rtt::Rtt;

/// Address of the vectors after power-up.
const VECTORS: u32 = 0x0800_0000;

/// Reason for which there is no emulation.
#[derive(Debug)]
pub enum EmulationError {
    /// The program does not fit into the chip's flash.
    DoesNotFit {
        /// Physical address of the segment.
        address: u32,
        /// Its length.
        length: usize,
    },
    /// The core cannot start: the vectors cannot be read.
    NoVectors,
}

impl std::fmt::Display for EmulationError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::DoesNotFit { address, length } => {
                write!(f, "{length} bytes at {address:#010x} lie outside of the chip's flash")
            }
            Self::NoVectors => write!(f, "there are no vectors at {VECTORS:#010x}"),
        }
    }
}

impl std::error::Error for EmulationError {}

/// A board that runs its program. A clone is a snapshot: it goes on as the original would, on its own.
#[derive(Clone)]
pub struct Emulation<W: Wired> {
    /// Core, chip and board.
    pub cpu: Cpu<Chip<W>>,
    rtt: Option<Rtt>,
    resets: Vec<(Instant, Origin)>,
}

impl<W: Wired> Emulation<W> {
    /// Powered up, with the program in flash.
    ///
    /// # Errors
    /// A program that does not fit.
    pub fn new(board: W, program: &Program) -> Result<Self, EmulationError> {
        let mut chip = Chip::new(W::VARIANT, board);
        for (address, bytes) in program.segments() {
            if !chip.program(address, bytes) {
                return Err(EmulationError::DoesNotFit { address, length: bytes.len() });
            }
        }
        for deviation in W::DEVIATIONS {
            chip.allow(*deviation);
        }
        let mut cpu = W::core(chip);
        cpu.reset(VECTORS).map_err(|_| EmulationError::NoVectors)?;
        Ok(Self { cpu, rtt: Rtt::of(program), resets: Vec::new() })
    }

    /// Now.
    pub fn now(&self) -> Instant {
        self.cpu.bus.instant(self.cpu.now())
    }

    /// Runs for so many seconds, through resets. What else ended the run, if anything did; a loss of power shows as a
    /// reset by the chip, and nothing runs before [`power_up`](Self::power_up).
    pub fn run(&mut self, seconds: f64) -> Option<End> {
        self.run_until(Instant(self.now().0 + (seconds * 1e12) as u64))
    }

    /// Runs up to an instant, through resets. What else ended the run, if anything did.
    pub fn run_until(&mut self, end: Instant) -> Option<End> {
        loop {
            let left = end.0.saturating_sub(self.now().0);
            if left == 0 {
                return None;
            }
            if !self.is_powered() {
                return Some(End::Reset(Origin::Chip));
            }
            // The core's frequency may change on the way: never too far at once.
            let cycles = (left.min(10_000_000_000) as f64 * 1e-12 * self.cpu.bus.frequency() as f64) as u64;
            let end = self.cpu.run(self.cpu.now() + cycles.max(1));
            match end {
                End::Time => {}
                End::Reset(origin) if self.is_powered() => self.reset(origin),
                end => return Some(end),
            }
        }
    }

    /// Resets of the chip since power-up: when, and by whom.
    pub fn resets(&self) -> &[(Instant, Origin)] {
        &self.resets
    }

    /// Returns `true` if the chip has power.
    pub fn is_powered(&self) -> bool {
        self.cpu.bus.is_powered()
    }

    /// The power goes, in the middle of whatever is done: what SRAM and registers hold is lost.
    pub fn power_down(&mut self) {
        let now = self.cpu.now();
        self.cpu.bus.power_down(now);
    }

    /// The power comes back, and the program starts. What was read of the log before is not read again.
    pub fn power_up(&mut self) {
        let now = self.cpu.now();
        self.cpu.bus.power_up(now);
        // The vectors are where they were.
        let _ = self.cpu.reset(VECTORS);
    }

    fn reset(&mut self, origin: Origin) {
        self.resets.push((self.now(), origin));
        if origin == Origin::Program {
            let now = self.cpu.now();
            self.cpu.bus.reset(now, Cause::Software);
        }
        // The vectors are where they were.
        let _ = self.cpu.reset(VECTORS);
    }

    /// Bytes that the program has logged since the last call.
    pub fn log(&mut self) -> Vec<u8> {
        let now = self.cpu.now();
        self.rtt.as_ref().and_then(|rtt| rtt.read(&mut self.cpu.bus, now).ok()).unwrap_or_default()
    }
}
