//! A program of the probe on the emulator's core, without a chip: it hands over at breakpoints, and what it exchanges
//! lies in memory at its symbols.

use emulator::cpu::{Cpu, End, Watch};
use emulator::memory::Memory;
use emulator::program::Program;
use std::path::Path;

/// Instructions and cycles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Instructions.
    pub instructions: u64,
    /// Modelled cycles, without wait states.
    pub cycles: u64,
}

impl std::ops::AddAssign for Cost {
    fn add_assign(&mut self, other: Self) {
        self.instructions += other.instructions;
        self.cycles += other.cycles;
    }
}

/// The semihosting call that prints a text, SYS_WRITE0.
const WRITE: u32 = 0x04;
/// Cycles that a program will not take between two breakpoints: then it hangs.
const HANGS: u64 = 1_000_000_000;

/// The program on the core.
pub struct Core {
    /// The core.
    pub cpu: Cpu<Memory>,
    program: Program,
}

impl Core {
    /// The program in an ELF file, not begun yet.
    ///
    /// # Errors
    /// A file that is no program, or none for this memory.
    pub fn start(path: &Path) -> Result<Self, String> {
        let program = Program::parse(std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?);
        let program = program.map_err(|error| error.to_string())?;
        let mut memory = Memory::usual();
        if !program.segments().all(|(address, bytes)| memory.set(address, bytes)) {
            return Err("the program does not fit into the memory".to_owned());
        }
        let mut cpu = memory.core();
        cpu.reset(0).map_err(|refusal| format!("{refusal:?}"))?;
        Ok(Self { cpu, program })
    }

    /// Goes on to the next breakpoint; its number and r0. The program goes on behind it.
    ///
    /// # Errors
    /// The run ended otherwise.
    pub fn run(&mut self) -> Result<(u8, u32), String> {
        match self.cpu.run(self.cpu.now() + HANGS) {
            End::Breakpoint { number, .. } => {
                self.cpu.skip();
                Ok((number, self.cpu.register(0)))
            }
            end => Err(end.to_string()),
        }
    }

    /// Goes on to a breakpoint of which number and r0 are known.
    ///
    /// # Errors
    /// The run ended otherwise, or at another one.
    pub fn run_to(&mut self, expected: (u8, u32)) -> Result<(), String> {
        match self.run()? {
            reached if reached == expected => Ok(()),
            reached => Err(format!("breakpoint {reached:?} instead of {expected:?}")),
        }
    }

    /// Address of a symbol.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn address(&self, symbol: &str) -> Result<u32, String> {
        Ok(self.program.symbol(symbol).ok_or_else(|| format!("no symbol {symbol}"))?.address)
    }

    /// Writes bytes to a symbol.
    ///
    /// # Errors
    /// No such symbol, or not so many bytes of memory.
    pub fn write(&mut self, symbol: &str, bytes: &[u8]) -> Result<(), String> {
        let address = self.address(symbol)?;
        match self.cpu.bus.set(address, bytes) {
            true => Ok(()),
            false => Err(format!("{symbol} does not lie in memory")),
        }
    }

    /// Writes words to a symbol.
    ///
    /// # Errors
    /// Those of [`write`](Self::write).
    pub fn write_words(&mut self, symbol: &str, words: impl IntoIterator<Item = i32>) -> Result<(), String> {
        let bytes: Vec<u8> = words.into_iter().flat_map(i32::to_le_bytes).collect();
        self.write(symbol, &bytes)
    }

    /// Reads words from a symbol.
    ///
    /// # Errors
    /// No such symbol, or not so many words of memory.
    pub fn read_words(&self, symbol: &str, count: usize) -> Result<Vec<i32>, String> {
        let bytes = self.cpu.bus.bytes(self.address(symbol)?, 4 * count);
        let bytes = bytes.ok_or_else(|| format!("{symbol} has no {count} words"))?;
        Ok(bytes.as_chunks().0.iter().map(|bytes| i32::from_le_bytes(*bytes)).collect())
    }

    /// Goes on to the next breakpoint; with what each call of `function` took, one behind the other.
    ///
    /// # Errors
    /// Those of [`run`](Self::run).
    pub fn calls(&mut self, function: &str) -> Result<Vec<Cost>, String> {
        self.cpu.set_watch(Some(Watch::new().function(self.address(function)?)));
        self.run()?;
        let calls = self.cpu.watch_mut().map(Watch::take_calls).unwrap_or_default();
        Ok(calls.iter().map(|call| Cost { instructions: call.instructions, cycles: call.cycles }).collect())
    }

    /// Word that the program prints by semihosting at a breakpoint that a trace has met, after which it goes on; none
    /// where it ends.
    ///
    /// # Errors
    /// Output that is no word.
    pub fn printed(&mut self) -> Result<Option<u32>, String> {
        if self.cpu.register(0) != WRITE {
            return Ok(None);
        }
        let digits = self.cpu.bus.bytes(self.cpu.register(1), 8).unwrap_or_default();
        let word = std::str::from_utf8(digits).ok().and_then(|digits| u32::from_str_radix(digits, 16).ok());
        let word = word.ok_or_else(|| format!("printed {digits:?}"))?;
        self.cpu.skip();
        Ok(Some(word))
    }

    /// Goes on to the end of the next call of `function`, and tells of each of its instructions: where it lies, and the
    /// cycles that it took. None where a breakpoint comes before.
    ///
    /// # Errors
    /// The run ended otherwise.
    pub fn trace(&mut self, function: &str, mut each: impl FnMut(u32, u64)) -> Result<Option<()>, String> {
        let begin = self.address(function)?;
        self.cpu.set_watch(Some(Watch::new().stop_at(begin)));
        match self.cpu.run(self.cpu.now() + HANGS) {
            End::Reached { .. } => {}
            End::Breakpoint { .. } => return Ok(None),
            end => return Err(end.to_string()),
        }
        self.cpu.set_watch(None);
        let (back, stack) = (self.cpu.register(14) & !1, self.cpu.register(13));
        loop {
            let (at, before) = (self.cpu.register(15), self.cpu.now());
            if at == back && self.cpu.register(13) >= stack {
                return Ok(Some(()));
            }
            if let Some(end) = self.cpu.step() {
                return Err(end.to_string());
            }
            each(at, self.cpu.now() - before);
        }
    }
}
