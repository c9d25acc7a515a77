//! Stretches: instructions that are decoded one behind the other, as a list of calls with nothing to look up or to count in between.
//!
//! What an instruction takes without wait states is known beforehand, so a stretch is counted where it is left: at its end, by a branch, or by
//! an instruction that needs the core as it is, which settles the count first (`Cpu::settle`) and leaves the stretch. What takes longer than
//! was known beforehand (wait states, refilled pipelines) is added to the time as it happens.
//!
//! IT blocks are parts of stretches, up to an instruction of theirs that may branch.

use super::Cpu;
use super::execute::system::nothing;
use super::operation::{ALONE, Done, Execute, Flow, Leave, Operands, Operation, Trap, behind};
use crate::bus::Bus;

/// Instructions of a stretch, at most.
const LONGEST: usize = 32;
/// Half-words that those take, at most.
pub(super) const SPAN: usize = 2 * LONGEST;
/// So many steps are kept, 6 MB; behind them all stretches are formed anew.
const KEPT: usize = 1 << 18;

/// An instruction of a stretch.
pub(super) struct Step<B: Bus> {
    execute: Execute<B>,
    operands: Operands,
}

// Not derived: that would ask the same of the bus.
impl<B: Bus> Clone for Step<B> {
    fn clone(&self) -> Self {
        Self { execute: self.execute, operands: self.operands }
    }
}

/// What counts if a stretch is left behind a step.
#[derive(Clone, Copy, Default)]
struct Mark {
    /// Since the stretch began.
    cycles: u16,
    bytes: u8,
    instructions: u8,
    /// Bytes of the instruction.
    length: u8,
    /// As in `Timing`.
    single: bool,
    /// As in `Cpu`.
    it: u8,
}

/// Where a stretch is kept.
#[derive(Clone, Copy)]
struct Stretch {
    /// Its steps: the first, and the one behind the last.
    first: u32,
    end: u32,
    /// Cycles before the last instruction.
    before_last: u16,
    /// Bytes of code.
    bytes: u8,
    /// Cycles that the first instruction saves behind a single load or store.
    overlaps: u8,
}

/// All stretches.
#[derive(Clone)]
pub(super) struct Stretches<B: Bus> {
    steps: Vec<Step<B>>,
    /// Of the steps.
    marks: Vec<Mark>,
    /// Instructions of IT blocks.
    conditional: Vec<Operation<B>>,
    stretches: Vec<Stretch>,
    /// Which of them begins at each place of the code; `NONE` where none does.
    begins: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl<B: Bus> Stretches<B> {
    /// None yet, of so many places.
    pub fn new(places: usize) -> Self {
        let begins = vec![NONE; places];
        Self { steps: Vec::new(), marks: Vec::new(), conditional: Vec::new(), stretches: Vec::new(), begins }
    }

    /// Forgets those that begin at some places.
    pub fn forget(&mut self, places: std::ops::Range<usize>) {
        let end = places.end.min(self.begins.len());
        if let Some(begins) = self.begins.get_mut(places.start..end) {
            begins.fill(NONE);
        }
    }

    /// An instruction was decoded: those that ended before it only because it was not are formed anew.
    pub fn decoded(&mut self, place: usize) {
        for before in place.saturating_sub(SPAN)..place {
            let stretch = self.begins.get(before).and_then(|begin| self.stretches.get(*begin as usize));
            if stretch.is_some_and(|stretch| before + usize::from(stretch.bytes / 2) == place) {
                self.forget(before..before + 1);
            }
        }
    }

    /// The number of the stretch that begins at a place; none where none was formed.
    #[inline(always)]
    pub fn begins_at(&self, place: usize) -> Option<u32> {
        self.begins.get(place).copied().filter(|number| *number != NONE)
    }

    /// Forms the stretch that begins at a place. None where nothing is decoded.
    #[cold]
    pub fn form(&mut self, place: usize, kept: impl Fn(usize) -> Option<Operation<B>>) -> Option<u32> {
        let begin = kept(place)?;
        if self.steps.len() >= KEPT {
            *self = Self::new(self.begins.len());
        }
        let first = self.steps.len();
        let (mut next, mut before_last, mut mark) = (place, 0, Mark::default());
        while let Some(operation) = kept(next)
            && self.steps.len() < first + LONGEST
            && (mark.it == 0 || operation.timing.flow == Flow::On)
        {
            let Operation { operands, timing, .. } = operation;
            let block = mark.it;
            before_last = mark.cycles;
            mark = Mark {
                cycles: mark.cycles + u16::from(timing.cycles - if mark.single { timing.overlaps } else { 0 }),
                bytes: mark.bytes + timing.length,
                instructions: mark.instructions + 1,
                length: timing.length,
                single: timing.single,
                it: if timing.flow == Flow::Block { operands.x } else { behind(block) },
            };
            self.marks.push(mark);
            self.steps.push(match (block, timing.flow) {
                (0, Flow::Block) => Step { execute: nothing, operands },
                (0, _) => Step { execute: operation.execute, operands },
                _ => {
                    self.conditional.push(operation);
                    let operands = Operands { immediate: self.conditional.len() as u32 - 1, x: block, ..operands };
                    Step { execute: conditional, operands }
                }
            });
            if timing.flow == Flow::Elsewhere {
                break;
            }
            next += usize::from(timing.length / 2);
        }
        let stretch = Stretch {
            first: first as u32,
            end: self.steps.len() as u32,
            before_last,
            bytes: mark.bytes,
            overlaps: begin.timing.overlaps,
        };
        let number = self.stretches.len() as u32;
        *self.begins.get_mut(place)? = number;
        self.stretches.push(stretch);
        Some(number)
    }

    /// The end of a stretch for whom so many cycles are left: the instruction that reaches them completes.
    #[cold]
    fn end_within(&self, stretch: Stretch, left: u64) -> u32 {
        let marks = self.marks.get(stretch.first as usize..stretch.end as usize).unwrap_or_default();
        let before = marks.iter().take_while(|mark| u64::from(mark.cycles) < left).count();
        (stretch.first + before as u32 + 1).min(stretch.end)
    }
}

/// Where the core is in a stretch.
#[derive(Clone, Copy, Default)]
pub(super) struct Within {
    /// The step that runs.
    step: u32,
    /// The step behind the last; 0 where the core is in no stretch, or has left it.
    end: u32,
}

impl<B: Bus> Cpu<B> {
    /// Runs the stretch that begins here, as far as nothing is due, or decodes what begins here.
    #[inline(always)]
    pub(super) fn run_stretch(&mut self) {
        let begin = self.pc;
        let Some(number) = self.code.stretch(begin) else { return self.elsewhere(begin) };
        let Some(stretch) = self.code.stretches.stretches.get(number as usize) else { return };
        self.now = self.now.wrapping_sub(u64::from(stretch.overlaps & u8::from(self.single)));
        let left = self.attention.saturating_sub(self.now);
        let first = stretch.first;
        self.within.end = match u64::from(stretch.before_last) < left {
            true => stretch.end,
            false => self.code.stretches.end_within(*stretch, left),
        };
        match self.take(first) {
            Ok(()) => self.settle(),
            Err(Leave::Jumped) => {
                self.count();
            }
            Err(Leave::Trapped(trap)) => self.trapped_within(trap, begin),
        }
    }

    /// What is behind a step: the next one, unless the stretch ends here or was left. Every instruction that completes ends with this.
    #[inline(always)]
    pub(super) fn next(&mut self, step: u32) -> Done {
        let next = step.wrapping_add(1);
        if next < self.within.end { self.take(next) } else { Ok(()) }
    }

    #[inline(always)]
    fn take(&mut self, step: u32) -> Done {
        let Some(&Step { execute, operands }) = self.code.stretches.steps.get(step as usize) else { return Ok(()) };
        self.within.step = step;
        execute(self, operands, step)
    }

    /// Counts what has run of a stretch, and leaves it: to be called by every instruction that looks at time, counts, IT state or its own
    /// address, or changes what has to be attended to. Where the core is in no stretch, everything is counted already.
    #[inline]
    pub(super) fn settle(&mut self) {
        if let Some(mark) = self.count() {
            self.pc = self.pc.wrapping_add(u32::from(mark.bytes));
            self.it = mark.it;
        }
    }

    /// What a branch out of a stretch leaves to be settled.
    #[inline(always)]
    fn count(&mut self) -> Option<Mark> {
        if self.within.end == 0 {
            return None;
        }
        self.within.end = 0;
        let mark = *self.code.stretches.marks.get(self.within.step as usize)?;
        self.now = self.now.wrapping_add(u64::from(mark.cycles));
        self.instructions = self.instructions.wrapping_add(u64::from(mark.instructions));
        self.single = mark.single;
        Some(mark)
    }

    /// An instruction of the stretch from `begin` on did not complete.
    #[cold]
    fn trapped_within(&mut self, trap: Trap, begin: u32) {
        self.settle();
        let mark = self.code.stretches.marks.get(self.within.step as usize);
        let before = mark.map_or(0, |mark| u32::from(mark.bytes - mark.length));
        self.trapped(trap, begin.wrapping_add(before));
    }
}

/// An instruction of an IT block, `x` being the block's state before it: runs if its condition holds (A7.3.2).
fn conditional<B: Bus>(cpu: &mut Cpu<B>, o: Operands, step: u32) -> Done {
    let Some(&Operation { execute, operands, timing }) = cpu.code.stretches.conditional.get(o.immediate as usize)
    else {
        return Ok(());
    };
    if cpu.holds(o.x >> 4) {
        cpu.in_it = true;
        let done = execute(cpu, operands, ALONE);
        cpu.in_it = false;
        if done.is_err() {
            cpu.settle();
            cpu.it = o.x;
            return done;
        }
        return cpu.next(step);
    }
    if timing.single {
        // The next instruction does not overlap, other than the stretch takes it.
        cpu.settle();
        cpu.single = false;
    }
    cpu.now = cpu.now.wrapping_sub(u64::from(timing.cycles) - 1);
    cpu.next(step)
}
