//! Losses of power while a program writes its flash: at any operation, as often as one likes, from one snapshot.

use super::Bench;
use super::master::{Heard, heard, send};
use emulator::board::Wired;
use emulator::chip::flash::Torn;
use emulator::chip::time::Instant;
use libtest_mimic::Failed;

/// Time between two looks at the flash, s: less than its shortest operation takes.
const LOOK: f64 = 20e-6;
/// Time without an operation after which a program has written what it was to, s: longer than its longest operation.
const QUIET: f64 = 0.026;
/// Longest time from power-up to the boot-up message, s.
const START: f64 = 0.5;

/// A program that is about to write its flash.
#[derive(Clone)]
pub struct Writing<W: Wired> {
    bench: Bench<W>,
    operations: u64,
}

impl<W: Wired + Clone> Writing<W> {
    /// Writes that a request that has not been sent yet makes the program do.
    ///
    /// # Errors
    /// The run ended.
    pub fn of(bench: &Bench<W>, request: &Heard) -> Result<Self, Failed> {
        let mut bench = bench.clone();
        send(&mut bench.emulation, request.0, &request.1)?;
        let mut whole = bench.clone();
        let operations = whole.written()?;
        Ok(Self { bench, operations })
    }

    /// Double words and pages that are written.
    pub const fn operations(&self) -> u64 {
        self.operations
    }

    /// The program before each of its operations, which are counted from 1.
    ///
    /// # Errors
    /// The run ended, or what `look` says.
    pub fn each(self, mut look: impl FnMut(u64, &Bench<W>) -> Result<(), Failed>) -> Result<(), Failed> {
        let Self { mut bench, operations } = self;
        let begun = bench.operations();
        for operation in 1..=operations {
            look(operation, &bench)?;
            while bench.operations() < begun + operation {
                bench.run(LOOK)?;
            }
        }
        Ok(())
    }
}

impl<W: Wired> Bench<W> {
    /// Operations of the flash since power-up.
    pub fn operations(&self) -> u64 {
        self.emulation.cpu.bus.flash().operations()
    }

    /// Runs until nothing is written any more; how many operations there were.
    ///
    /// # Errors
    /// The run ended.
    pub fn written(&mut self) -> Result<u64, Failed> {
        let begun = self.operations();
        let mut before = begun;
        loop {
            self.run(QUIET)?;
            let now = self.operations();
            if now == before {
                return Ok(now - begun);
            }
            before = now;
        }
    }

    /// Runs until the power goes in the middle of the `operation`th operation from now on, counted from 1, and leaves
    /// words that are torn in this way. False where there are not so many within some seconds.
    ///
    /// # Errors
    /// Something else ended the run.
    pub fn cut(&mut self, operation: u64, torn: Torn, seconds: f64) -> Result<bool, Failed> {
        self.emulation.cpu.bus.power_cut_at(operation, torn);
        let end = Instant(self.emulation.now().0 + (seconds * 1e12) as u64);
        match self.emulation.run_until(end) {
            _ if !self.emulation.is_powered() => Ok(true),
            None => {
                // Not later either.
                self.emulation.cpu.bus.power_cut_at(u64::MAX, torn);
                Ok(false)
            }
            Some(end) => Err(format!("after {:.6} s: {end}", self.emulation.now().seconds()).into()),
        }
    }

    /// The power comes back, after a loss or for once; runs up to the node's boot-up message.
    ///
    /// # Errors
    /// It does not come.
    pub fn restart(&mut self, node: u8) -> Result<(), Failed> {
        if self.emulation.is_powered() {
            self.emulation.power_down();
        }
        self.power_up();
        self.booted(node)
    }

    /// The power comes back; what was on the bus before counts for nothing.
    pub fn power_up(&mut self) {
        heard(&mut self.emulation);
        self.emulation.power_up();
    }

    /// Runs up to the node's boot-up message, unless it has come.
    ///
    /// # Errors
    /// It does not come.
    pub fn booted(&mut self, node: u8) -> Result<(), Failed> {
        let end = Instant(self.emulation.now().0 + (START * 1e12) as u64);
        let boot_up = (0x700 + u16::from(node), vec![0]);
        while self.emulation.now() < end {
            if heard(&mut self.emulation).contains(&boot_up) {
                return Ok(());
            }
            self.run(0.001)?;
        }
        Err(format!("no boot-up message within {START} s:\n{}", self.log()).into())
    }
}
