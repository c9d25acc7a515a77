//! Translation: code that runs often, as functions of the host.
//!
//! A *region* is what is reached from one address by branches whose targets are known (`region`). It becomes a function
//! that keeps registers and flags in the host's own (`emit` and what it uses), compiled by Cranelift (`host`). The
//! function does what is common itself. An access that memory does not answer at once, a floating-point result that the
//! host's arithmetic may not give, an instruction that is not translated: it calls for those, one at a time, with the
//! core as if all before had been executed one by one, and goes on if nothing else has to be done. It is left before a
//! block that may last until something is due; then stretches go on.
//!
//! Translation changes no result: `tests/translation.rs` and `tests/stretches.rs` compare it with single steps, and the
//! tests of the boards whole runs with and without it.

mod arithmetic;
mod emit;
mod float;
#[expect(unsafe_code, reason = "calls what was compiled")]
mod host;
mod leaving;
mod memory;
mod region;
mod registers;

use super::Cpu;
use super::operation::{Action, Operands, Operation, Timing};
use crate::bus::Bus;
use host::{Compiler, Function};
use region::Region;
use std::collections::HashSet;
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

/// Numbers of functions begin here; no stretch begins so often.
pub(super) const TRANSLATED: u32 = 1 << 31;

/// Number of times that a stretch begins before what begins with it is translated.
const OFTEN: u32 = 4096;

/// Bytes of a line, by which it is seen that nothing translated has changed.
const LINE: u32 = 64;

/// An instruction to translate.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Instruction {
    action: Action,
    operands: Operands,
    timing: Timing,
    word: Word,
    /// Cycles that a branch to where it leads takes more.
    waits: u8,
}

/// A word that an instruction loads from an address that decoding knows.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Word {
    /// Unknown word: there is none, or nothing is known of it.
    Unknown,
    /// Word that lies there in memory that answers at once.
    Memory(usize),
    /// Word that changes only when the core is told; a load of it takes so many cycles more.
    Constant { address: u32, value: u32, waits: u8 },
}

/// Source that a region is translated from.
trait Source {
    /// The instruction at an address; none where nothing is decoded.
    fn instruction(&self, address: u32) -> Option<Instruction>;
    /// Returns `true` if a function begins at an address.
    fn is_translated(&self, address: u32) -> bool;
    /// Bytes of memory that answers at once.
    fn memory(&self) -> u32;
    /// Addresses at which a store may change code.
    fn changeable(&self) -> Range<u32>;
}

/// Reason for which a translated function was left.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Left {
    /// Jump to an address that is not part of it.
    Jumped = 0,
    /// Branch whose target was not known: what the branch takes is not counted yet.
    Branched = 1,
    /// Stop before an instruction that stretches have to go on with.
    Call = 2,
}

/// Offsets of the parts of a core in it, in bytes: one kind of core from the other.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Fields {
    registers: i32,
    floats: i32,
    /// N, Z, C, V.
    flags: [i32; 4],
    status: i32,
    pc: i32,
    it: i32,
    single: i32,
    exclusive: i32,
    floating_ready: i32,
    now: i32,
    instructions: i32,
    attention: i32,
    /// Offset of `call_one`.
    call: usize,
}

impl Fields {
    fn of<B: Bus>() -> Self {
        macro_rules! at {
            ($field:ident) => {
                std::mem::offset_of!(Cpu<B>, $field) as i32
            };
        }
        Self {
            registers: at!(r),
            floats: at!(s),
            flags: [at!(negative), at!(zero), at!(carry), at!(overflow)],
            status: at!(floating),
            pc: at!(pc),
            it: at!(it),
            single: at!(single),
            exclusive: at!(exclusive),
            floating_ready: at!(floating_ready),
            now: at!(now),
            instructions: at!(instructions),
            attention: at!(attention),
            call: host::call_one::<B> as *const () as usize,
        }
    }
}

/// Translations of a core's code. Clones share it.
#[derive(Clone)]
pub(super) struct Translations {
    pub functions: Vec<Translation>,
    /// Lines of memory that they were made of.
    lines: HashSet<u32>,
    /// Ranges that have changed since; everything where that is said.
    changed: Vec<Range<u32>>,
    changed_all: bool,
    /// Number of times that a stretch begins before what begins with it is translated.
    after: u32,
    /// Rest behind a translation, as a multiple of what it took; none where no clock has to be kept up with.
    rest: Option<u32>,
    /// End of the last rest.
    rests: Option<Instant>,
}

/// A function, and the addresses that it was made of.
#[derive(Clone)]
pub(super) struct Translation {
    /// None where there is nothing to translate.
    function: Option<Function>,
    covers: Arc<[Range<u32>]>,
    /// `true` while what it was made of has not changed.
    holds: bool,
}

impl Translation {
    /// Returns `true` if what it was made of is still there.
    #[inline(always)]
    pub fn holds(&self) -> bool {
        self.holds
    }

    fn forget(&mut self) {
        (self.function, self.covers, self.holds) = (None, Arc::new([]), false);
    }

    /// Runs the function from its beginning on; nothing happens where there is none.
    #[inline(always)]
    pub fn run<B: Bus>(&self, cpu: &mut Cpu<B>) -> Left {
        match &self.function {
            Some(function) => function.run(cpu),
            None => Left::Call,
        }
    }
}

impl Default for Translations {
    fn default() -> Self {
        Self {
            functions: Vec::new(),
            lines: HashSet::new(),
            changed: Vec::new(),
            changed_all: false,
            after: OFTEN,
            rest: None,
            rests: None,
        }
    }
}

impl Translations {
    /// Number of times that a stretch begins before what begins with it is translated.
    pub fn after(&self) -> u32 {
        self.after
    }

    /// The rest behind the last translation, in which what is often come across waits, is not over. Never where
    /// everything is translated at once.
    pub fn rests(&self) -> bool {
        self.after > 0 && self.rests.is_some_and(|until| Instant::now() < until)
    }

    /// Marks all as not holding any more. It is forgotten by `settle`: functions may be in use.
    pub fn forget_all(&mut self) {
        self.changed_all = true;
    }

    /// The same of what was made of some addresses.
    pub fn forget(&mut self, range: Range<u32>) {
        if (range.start / LINE..=range.end / LINE).any(|line| self.lines.contains(&line)) {
            self.changed.push(range);
        }
    }

    /// Returns `true` if something does not hold any more.
    pub fn is_unsettled(&self) -> bool {
        self.changed_all || !self.changed.is_empty()
    }

    /// Forgets what does not hold any more.
    pub fn settle(&mut self) {
        // They keep their numbers.
        if std::mem::take(&mut self.changed_all) {
            self.functions.iter_mut().for_each(Translation::forget);
        }
        for range in self.changed.drain(..) {
            for translation in &mut self.functions {
                if translation.covers.iter().any(|covered| covered.start < range.end && range.start < covered.end) {
                    translation.forget();
                }
            }
        }
    }
}

/// Source that a core's code is translated from.
struct Core<'a, B: Bus> {
    cpu: &'a Cpu<B>,
    memory: u32,
}

impl<B: Bus> Source for Core<'_, B> {
    fn instruction(&self, address: u32) -> Option<Instruction> {
        let Cpu { code, bus, .. } = self.cpu;
        let Operation { operands, timing, action, .. } = code.anywhere(address)?;
        let waits = match action {
            Action::Branch | Action::BranchIf | Action::BranchIfZero | Action::Call => {
                code.wait_states_at(operands.immediate)? as u8
            }
            _ => 0,
        };
        let word = match memory::absolute(action, operands) {
            None => Word::Unknown,
            Some(address) => match (bus.place(address), bus.constant(address)) {
                (Some(place), _) => Word::Memory(place),
                (None, Some(value)) => Word::Constant { address, value, waits: bus.wait_states(address) as u8 },
                (None, None) => Word::Unknown,
            },
        };
        Some(Instruction { action, operands, timing, word, waits })
    }

    fn is_translated(&self, address: u32) -> bool {
        self.cpu.code.is_translated(address)
    }

    fn memory(&self) -> u32 {
        self.memory
    }

    fn changeable(&self) -> Range<u32> {
        self.cpu.code.changeable()
    }
}

impl<B: Bus> Cpu<B> {
    /// Sets the number of times that code is come across before it is translated, 4096 if nothing else is said; none
    /// for never. What is translated already stays so. No result depends on it.
    pub fn set_translation(&mut self, after: Option<u32>) {
        self.code.translations.after = after.unwrap_or(TRANSLATED);
    }

    /// A rest behind each translation, so many times as long as it took, for who keeps up with a clock: code that is
    /// come across equally often is translated one function behind the other otherwise, seconds at a stretch. No
    /// result depends on it.
    pub fn set_rest_between_translations(&mut self, times: u32) {
        self.code.translations.rest = Some(times);
    }

    /// Translates what begins at an address; the number of it.
    #[cold]
    pub(super) fn translate(&mut self, address: u32) -> u32 {
        let begun = Instant::now();
        let memory = self.bus.memory().len() as u32;
        let source = Core { cpu: self, memory };
        let region = Region::explore(&source, address);
        let covers: Arc<[_]> = region.covers().collect();
        let function = Compiler::of_host().and_then(|compiler| compiler.compile(&Fields::of::<B>(), region));
        let Translations { functions, lines, rest, rests, .. } = &mut self.code.translations;
        *rests = rest.map(|times| Instant::now() + begun.elapsed() * times);
        lines.extend(covers.iter().flat_map(|range| [range.start / LINE, range.end / LINE]));
        functions.push(Translation { function, covers, holds: true });
        functions.len() as u32 - 1
    }
}
