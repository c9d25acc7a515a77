//! Depth of the stack of a program on an emulated board: it is painted when the startup code, which clears it, has come
//! to `main`, and what is not painted any more was used.

use emulator::board::Wired;
use emulator::bus::{Bus as _, Width};
use emulator::cpu::{End, Watch};
use emulator::emulation::Emulation;
use emulator::program::Program;
use libtest_mimic::Failed;
use std::ops::Range;

const PAINT: u32 = 0xa5a5_5a5a;
/// Longest time of the startup code, s.
const START: f64 = 0.1;

/// A stack that was painted.
#[derive(Clone, Debug)]
pub struct PaintedStack(Range<u32>);

impl PaintedStack {
    /// Starts a board that has not been started, and paints the stack below what is in use then.
    ///
    /// # Errors
    /// The program does not say where its stack is, or does not come to `main`.
    pub fn new<W: Wired>(emulation: &mut Emulation<W>, program: &Program) -> Result<Self, Failed> {
        let symbol = |name: &str| program.symbol(name).map(|symbol| symbol.address).ok_or(format!("no {name}"));
        let stack = symbol("_stack_end")?..symbol("_stack_start")?;
        emulation.cpu.set_watch(Some(Watch::new().stop_at(symbol("main")?)));
        match emulation.run(START) {
            Some(End::Reached { .. }) => emulation.cpu.set_watch(None),
            other => return Err(format!("the program does not come to main: {other:?}").into()),
        }
        let (now, used) = (emulation.cpu.now(), emulation.cpu.register(13));
        for address in (stack.start..used).step_by(4) {
            emulation.cpu.bus.write(now, address, Width::Word, PAINT).map_err(|error| format!("{error:?}"))?;
        }
        Ok(Self(stack))
    }

    /// Bytes that were ever written to since the last start, and bytes that there are. A start after the first leaves
    /// zeros instead of paint.
    ///
    /// # Errors
    /// The stack cannot be read.
    pub fn used<W: Wired>(&self, emulation: &mut Emulation<W>) -> Result<(u32, u32), Failed> {
        let Range { start, end } = self.0;
        for address in self.0.clone().step_by(4) {
            let now = emulation.cpu.now();
            let word = emulation.cpu.bus.read(now, address, Width::Word).map_err(|error| format!("{error:?}"))?;
            if word != PAINT && word != 0 {
                return Ok((end - address, end - start));
            }
        }
        Ok((0, end - start))
    }
}
