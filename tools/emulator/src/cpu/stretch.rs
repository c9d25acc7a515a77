//! Stretches: instructions that are decoded one behind the other, as a list of calls with nothing to look up or to
//! count in between.
//!
//! Time that an instruction takes without wait states is known beforehand, so a stretch is counted where it is left: at
//! its end, by a branch, or by an instruction that needs the core as it is, which settles the count first
//! (`Cpu::settle_at`) and leaves the stretch. What takes longer than was known beforehand (wait states, refilled
//! pipelines) is added to the time as it happens.
//!
//! An instruction goes on with what is behind it (`Cpu::next`). One that may jump, trap or settle says before where it
//! is (`Cpu::at`); one that may have settled goes on only if it has not (`Cpu::go_on`).
//!
//! IT blocks are parts of stretches, up to an instruction of theirs that may branch: before each of their instructions
//! there is a step that passes it over if its condition does not hold. IT itself only counts.

use super::Cpu;
use super::execute::by_condition;
use super::execute::pairs::{compared_of, conditional_of, pair_of};
use super::execute::system::nothing;
use super::operation::{Done, Execute, Flow, Leave, Operands, Operation, Part, Rest, Step, Trap, behind};
use super::translation::{Left, TRANSLATED, Translation};
use crate::bus::Bus;

/// Instructions of a stretch, at most.
const LONGEST: usize = 32;
/// Half-words that those take, at most.
pub(super) const SPAN: usize = 2 * LONGEST;
/// Number of steps that are kept, 6 MB; behind them all stretches are formed anew.
const KEPT: usize = 1 << 18;

/// Counts if a stretch is left behind a step.
#[derive(Clone, Copy, Default)]
struct Mark {
    /// Cycles since the stretch began.
    cycles: u16,
    bytes: u8,
    instructions: u8,
    /// Flag as in `Timing`.
    single: bool,
    /// State as in `Cpu`.
    it: u8,
}

/// Place of a stretch.
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
    /// Number of times that it has begun, or, from `TRANSLATED` on, the function that begins there.
    runs: u32,
}

/// All stretches.
#[derive(Clone)]
pub(super) struct Stretches<B: Bus> {
    steps: Vec<Step<B>>,
    /// Marks of the steps.
    marks: Vec<Mark>,
    /// Stretch that begins at each place of the code; `NONE` where nothing does.
    begins: Vec<Stretch>,
}

/// Runs of a stretch before it is asked again for its translation.
const LATER: u32 = 64;

const NONE: Stretch = Stretch { first: 0, end: 0, before_last: 0, bytes: 0, overlaps: 0, runs: 0 };

impl<B: Bus> Stretches<B> {
    /// None yet, of so many places.
    pub fn new(places: usize) -> Self {
        Self { steps: Vec::new(), marks: Vec::new(), begins: vec![NONE; places] }
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
            if self.begins.get(before).is_some_and(|stretch| before + usize::from(stretch.bytes / 2) == place) {
                self.forget(before..before + 1);
            }
        }
    }

    /// The stretch of a place runs some more times before it is asked again for its translation.
    fn later(&mut self, place: usize, after: u32) {
        if let Some(stretch) = self.begins.get_mut(place) {
            stretch.runs = after.saturating_sub(LATER);
        }
    }

    /// A function begins at a place.
    fn translated(&mut self, place: usize, number: u32) {
        if let Some(stretch) = self.begins.get_mut(place) {
            stretch.runs = TRANSLATED | number;
        }
    }

    /// Returns `true` if a function begins at a place.
    pub fn is_translated(&self, place: usize) -> bool {
        self.begins.get(place).is_some_and(|stretch| stretch.runs >= TRANSLATED)
    }

    /// Forms the stretch that begins at a place; false where nothing is decoded.
    pub fn form(&mut self, place: usize, kept: impl Fn(usize) -> Option<Operation<B>>) -> bool {
        let Some(begin) = kept(place) else { return false };
        if self.steps.len() >= KEPT {
            *self = Self::new(self.begins.len());
        }
        let first = self.steps.len();
        let (mut next, mut before_last, mut mark) = (place, 0, Mark::default());
        // Roles in a pair of the last instruction, and of the one before.
        let mut lately = [Part::None; 2];
        while let Some(operation) = kept(next)
            && usize::from(mark.instructions) < LONGEST
            && (mark.it == 0 || operation.timing.flow == Flow::On)
        {
            let Operation { execute, operands, timing, .. } = operation;
            let block = mark.it;
            before_last = mark.cycles;
            if block != 0 {
                let passed = Operands { immediate: u32::from(timing.cycles), m: timing.single.into(), ..operands };
                let (flags, between) = match lately {
                    [Part::TakeFlags, Part::CompareFloats] => (Part::CompareFloats, 1),
                    // Not the core's flags.
                    [Part::CompareFloats, _] => (Part::None, 0),
                    [last, _] => (last, 0),
                };
                if let Some(compared) = compared_of((flags, timing.part), block >> 4)
                    && let Some(first) = self.steps.iter_mut().nth_back(between)
                {
                    first.execute = compared;
                }
                let execute = conditional_of(block >> 4, timing.part);
                self.push(execute.unwrap_or(by_condition!(unless, block >> 4)), passed, mark);
            } else if let Some(pair) = pair_of((lately[0], timing.part), operands)
                && let Some(first) = self.steps.last_mut()
            {
                first.execute = pair;
            }
            mark = Mark {
                cycles: mark.cycles + u16::from(timing.cycles - if mark.single { timing.overlaps } else { 0 }),
                bytes: mark.bytes + timing.length,
                instructions: mark.instructions + 1,
                single: timing.single,
                it: if timing.flow == Flow::Block { operands.x } else { behind(block) },
            };
            // IT is no step: what comes behind it is behind what came before it.
            lately = match timing.flow {
                Flow::Block => lately,
                _ if block == 0 => [timing.part, lately[0]],
                _ => [Part::None; 2],
            };
            match timing.flow {
                Flow::Block => {}
                _ if block != 0 => self.push(execute, operands.in_block(), mark),
                _ => self.push(execute, operands, mark),
            }
            if timing.flow == Flow::Elsewhere {
                break;
            }
            next += usize::from(timing.length / 2);
        }
        if self.steps.len() == first || self.marks.last().is_some_and(|pushed| pushed.instructions != mark.instructions)
        {
            // IT at the end.
            self.push(nothing, Operands::default(), mark);
        }
        let Some(begins) = self.begins.get_mut(place) else { return false };
        *begins = Stretch {
            first: first as u32,
            end: self.steps.len() as u32,
            before_last,
            bytes: mark.bytes,
            overlaps: begin.timing.overlaps,
            runs: 0,
        };
        true
    }

    fn push(&mut self, execute: Execute<B>, operands: Operands, mark: Mark) {
        self.steps.push(Step { execute, operands });
        self.marks.push(mark);
    }

    /// The end of a stretch for whom so many cycles are left: the instruction that reaches them completes.
    #[cold]
    fn end_within(&self, stretch: Stretch, left: u64) -> u32 {
        let marks = self.marks.get(stretch.first as usize..stretch.end as usize).unwrap_or_default();
        let before = marks.iter().take_while(|mark| u64::from(mark.cycles) < left).count();
        (stretch.first + before as u32 + 1).min(stretch.end)
    }
}

/// Reason for which no stretch follows.
enum Stopped {
    /// Stop: something is due, or the core is in an IT block.
    Due,
    /// No stretch begins there yet.
    Unformed,
    /// The stretch of a place has begun often enough to be translated.
    Often(usize),
}

/// Position of the core in a stretch.
#[derive(Clone, Copy, Default)]
pub(super) struct Within {
    /// The step behind the last; 0 where the core is in no stretch, or has left it.
    end: u32,
    /// Steps behind the one that runs: said by those that may jump, trap or settle.
    behind: u32,
    /// The step behind which the last stretch was left.
    left: u32,
}

impl<B: Bus> Cpu<B> {
    /// Runs one stretch after the other, as far as nothing is due and all is decoded; then decodes what is not.
    pub(super) fn run_stretches(&mut self) {
        if self.code.translations.is_unsettled() {
            self.code.translations.settle();
        }
        // Not part of the core while they run, which changes the core.
        let steps = std::mem::take(&mut self.code.stretches.steps);
        let functions = std::mem::take(&mut self.code.translations.functions);
        let stopped = self.run_formed(&steps, &functions);
        self.code.stretches.steps = steps;
        self.code.translations.functions = functions;
        match stopped {
            Stopped::Due => {}
            Stopped::Unformed => {
                if !self.code.form(self.pc) {
                    self.elsewhere(self.pc);
                }
            }
            Stopped::Often(place) if self.code.translations.rests() => {
                self.code.stretches.later(place, self.code.translations.after());
            }
            Stopped::Often(place) => {
                let number = self.translate(self.pc);
                self.code.stretches.translated(place, number);
            }
        }
    }

    /// Runs stretches, and what is translated of them, until there is something else to do.
    #[inline(always)]
    fn run_formed(&mut self, steps: &[Step<B>], functions: &[Translation]) -> Stopped {
        let (mut begin, mut stretch, mut place) = (self.pc, NONE, 0);
        // The next instruction has to be called.
        let mut call = false;
        loop {
            // A loop whose body is one stretch needs no search; jumps change no code.
            if self.pc != begin || stretch.end == 0 {
                begin = self.pc;
                let Some(found) = self.code.place(begin) else { return Stopped::Unformed };
                place = found;
            }
            let after = self.code.translations.after();
            let Some(found) = self.code.stretches.begins.get_mut(place).filter(|found| found.end != 0) else {
                return Stopped::Unformed;
            };
            let function = match found.runs {
                runs if runs >= TRANSLATED => functions.get((runs - TRANSLATED) as usize),
                runs if runs >= after => return Stopped::Often(place),
                runs => {
                    found.runs = (runs + 1).min(TRANSLATED - 1);
                    None
                }
            };
            if function.is_some_and(|function| !function.holds()) {
                found.runs = 0;
            }
            stretch = *found;
            self.now = self.now.wrapping_sub(u64::from(stretch.overlaps & u8::from(self.single)));
            if let Some(function) = function
                && !std::mem::take(&mut call)
                && self.now < self.attention
            {
                let before = self.instructions;
                match function.run(self) {
                    Left::Jumped => {}
                    Left::Branched => self.branch(self.pc),
                    Left::Call => call = true,
                }
                if self.instructions != before {
                    if !self.code.holds(self.pc) {
                        self.code.enter(self.pc);
                    }
                    if self.now >= self.attention || self.it != 0 {
                        return Stopped::Due;
                    }
                    continue;
                }
                call = false;
            }
            let end = match self.now.wrapping_add(u64::from(stretch.before_last)) < self.attention {
                true => stretch.end,
                false => self.code.stretches.end_within(stretch, self.attention.saturating_sub(self.now)),
            };
            self.within.end = end;
            let Some(steps) = steps.get(stretch.first as usize..end as usize) else { return Stopped::Unformed };
            match self.next(steps) {
                Ok(()) => {
                    self.settle_at(&[]);
                    stretch = NONE;
                }
                Err(Leave::Jumped) => {
                    self.count();
                }
                Err(Leave::Trapped(trap)) => {
                    self.trapped_within(trap, begin);
                    stretch = NONE;
                }
            }
            if self.now >= self.attention || self.it != 0 || self.code.translations.is_unsettled() {
                return Stopped::Due;
            }
        }
    }

    /// Goes on with what is behind an instruction. Every instruction that completes ends with this, unless it jumps or
    /// settles.
    #[inline(always)]
    pub(super) fn next(&mut self, rest: Rest<B>) -> Done {
        match rest.split_first() {
            Some((step, rest)) => (step.execute)(self, step.operands, rest),
            None => Ok(()),
        }
    }

    /// The same of an instruction that may have settled: then nothing follows at once.
    #[inline(always)]
    pub(super) fn go_on(&mut self, rest: Rest<B>) -> Done {
        if self.within.end == 0 { Ok(()) } else { self.next(rest) }
    }

    /// An instruction says where it is: before it may jump, trap or settle.
    #[inline(always)]
    pub(super) fn at(&mut self, rest: Rest<B>) {
        self.within.behind = rest.len() as u32;
    }

    /// The end of an instruction that has gone elsewhere.
    #[inline(always)]
    pub(super) fn jumped(&mut self, rest: Rest<B>) -> Done {
        self.at(rest);
        Err(Leave::Jumped)
    }

    /// The end of an instruction that does not complete.
    #[cold]
    pub(super) fn trap(&mut self, rest: Rest<B>, trap: Trap) -> Done {
        self.at(rest);
        Err(Leave::Trapped(trap))
    }

    /// Leaves the stretch behind an instruction.
    #[inline(always)]
    pub(super) fn settle_at(&mut self, rest: Rest<B>) {
        self.at(rest);
        self.settle();
    }

    /// Counts what has run of a stretch, and leaves it: for everything that looks at time, counts, IT state or an
    /// instruction's own address, or changes what has to be attended to. Where the core is in no stretch,
    /// everything is counted already.
    #[inline]
    pub(super) fn settle(&mut self) {
        if let Some(mark) = self.count() {
            self.pc = self.pc.wrapping_add(u32::from(mark.bytes));
            self.it = mark.it;
        }
    }

    /// Counts that a branch out of a stretch leaves to be settled.
    #[inline(always)]
    fn count(&mut self) -> Option<Mark> {
        if self.within.end == 0 {
            return None;
        }
        self.within.left = self.within.end.wrapping_sub(self.within.behind).wrapping_sub(1);
        self.within.end = 0;
        let mark = *self.code.stretches.marks.get(self.within.left as usize)?;
        self.now = self.now.wrapping_add(u64::from(mark.cycles));
        self.instructions = self.instructions.wrapping_add(u64::from(mark.instructions));
        self.single = mark.single;
        Some(mark)
    }

    /// An instruction of the stretch from `begin` on did not complete: it is left where it began.
    #[cold]
    fn trapped_within(&mut self, trap: Trap, begin: u32) {
        self.settle();
        let left = self.within.left as usize;
        let before = match self.code.stretches.marks.get(left.saturating_sub(1)..=left) {
            Some([before, mark]) if mark.instructions > 1 => *before,
            _ => Mark::default(),
        };
        if before.it != 0 {
            self.it = before.it;
        }
        self.trapped(trap, begin.wrapping_add(u32::from(before.bytes)));
    }
}

/// Before an instruction of an IT block: passes it over if its condition does not hold (A7.3.2). It takes `immediate`
/// cycles otherwise, and m says whether it loads or stores one register.
fn unless<B: Bus, const CONDITION: u8>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if cpu.holds(CONDITION) {
        return cpu.next(rest);
    }
    let Some((_, behind)) = rest.split_first() else { return Ok(()) };
    cpu.now = cpu.now.wrapping_sub(u64::from(o.immediate) - 1);
    if o.m != 0 {
        // The next instruction does not overlap, other than the stretch takes it.
        cpu.settle_at(behind);
        cpu.single = false;
        return Ok(());
    }
    cpu.next(behind)
}
