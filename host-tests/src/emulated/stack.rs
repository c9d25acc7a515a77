//! How deep the stack of a program on an emulated board has got: it is painted before the program starts, and what is not painted any more was
//! used.

use emulator::board::Wired;
use emulator::bus::{Bus as _, Width};
use emulator::emulation::Emulation;
use emulator::program::Program;
use libtest_mimic::Failed;
use std::ops::Range;

const PAINT: u32 = 0xa5a5_5a5a;

/// A stack that was painted.
#[derive(Clone, Debug)]
pub struct PaintedStack(Range<u32>);

impl PaintedStack {
    /// Paints the stack of a board that has not been started.
    ///
    /// # Errors
    /// The program does not say where its stack is.
    pub fn new<W: Wired>(emulation: &mut Emulation<W>, program: &Program) -> Result<Self, Failed> {
        let symbol = |name: &str| program.symbol(name).map(|symbol| symbol.address).ok_or(format!("no {name}"));
        let stack = symbol("_stack_end")?..symbol("_stack_start")?;
        for address in stack.clone().step_by(4) {
            emulation.cpu.bus.write(0, address, Width::Word, PAINT).map_err(|error| format!("{error:?}"))?;
        }
        Ok(Self(stack))
    }

    /// Bytes that were ever written to, and bytes that there are.
    ///
    /// # Errors
    /// The stack cannot be read.
    pub fn used<W: Wired>(&self, emulation: &mut Emulation<W>) -> Result<(u32, u32), Failed> {
        let Range { start, end } = self.0;
        for address in self.0.clone().step_by(4) {
            let now = emulation.cpu.now();
            let word = emulation.cpu.bus.read(now, address, Width::Word).map_err(|error| format!("{error:?}"))?;
            if word != PAINT {
                return Ok((end - address, end - start));
            }
        }
        Ok((0, end - start))
    }
}
