//! Observation of a run by test equipment: when functions are entered and left, what they took, how deep the stack
//! went.
//!
//! A run without a watch takes another loop and pays nothing for it.

use super::{Cpu, End};
use crate::bus::Bus;
use std::collections::BTreeSet;

/// A watched function, from its first instruction to the one that it returned to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Call {
    /// Address of the function.
    pub function: u32,
    /// Number of the exception in whose handler it ran, 0 in thread mode.
    pub exception: u16,
    /// Cycle at which it was entered.
    pub entered: u64,
    /// Cycles until it returned, without those of handlers that preempted it.
    pub cycles: u64,
    /// Instructions until it returned, without those of handlers that preempted it.
    pub instructions: u64,
}

/// A function that has not returned.
#[derive(Clone, Copy)]
struct Open {
    function: u32,
    exception: u16,
    back: u32,
    stack: u32,
    entered: u64,
    instructions: u64,
    preempted_cycles: u64,
    preempted_instructions: u64,
}

impl Open {
    fn closed(&self, now: u64, instructions: u64) -> Call {
        Call {
            function: self.function,
            exception: self.exception,
            entered: self.entered,
            cycles: now - self.entered - self.preempted_cycles,
            instructions: instructions - self.instructions - self.preempted_instructions,
        }
    }
}

/// Functions that are watched, addresses to stop at, and what has been seen.
#[derive(Clone, Default)]
pub struct Watch {
    functions: BTreeSet<u32>,
    stops: BTreeSet<u32>,
    /// All addresses of both, as one bit for each half-word modulo 64 Ki half-words: most instructions need no more.
    marks: Vec<u64>,
    open: Vec<Open>,
    calls: Vec<Call>,
    lowest_main: Option<u32>,
    lowest_process: Option<u32>,
    /// The stop that was reported last: the run goes on from there.
    reported: Option<u32>,
}

impl Watch {
    /// Watches nothing but the stack.
    pub fn new() -> Self {
        Self { marks: vec![0; 1024], ..Self::default() }
    }

    fn mark(&mut self, address: u32) {
        if let Some(word) = self.marks.get_mut((address >> 7 & 0x3ff) as usize) {
            *word |= 1 << (address >> 1 & 63);
        }
    }

    fn marked(&self, address: u32) -> bool {
        self.marks.get((address >> 7 & 0x3ff) as usize).is_some_and(|word| word >> (address >> 1 & 63) & 1 != 0)
    }

    /// Watches the function at `address`, its lowest bit ignored. It has returned when the program is back at the
    /// address that it was called from with the stack that it had.
    pub fn function(mut self, address: u32) -> Self {
        self.functions.insert(address & !1);
        self.mark(address & !1);
        self
    }

    /// Ends the run before the instruction at `address`, whenever it is reached.
    pub fn stop_at(mut self, address: u32) -> Self {
        self.stops.insert(address & !1);
        self.mark(address & !1);
        self
    }

    /// The calls that have returned since this was last asked, in the order of their returns.
    pub fn take_calls(&mut self) -> Vec<Call> {
        std::mem::take(&mut self.calls)
    }

    /// Lowest value of the main stack pointer after any instruction; None before the first.
    pub fn lowest_main_stack(&self) -> Option<u32> {
        self.lowest_main
    }

    /// Lowest value of the process stack pointer after any instruction that used it.
    pub fn lowest_process_stack(&self) -> Option<u32> {
        self.lowest_process
    }

    /// The handler of `exception` has returned at the cycle `now` after `count` instructions in all. It ends what was
    /// open in it, itself if it is watched, and has preempted what is open below it.
    pub(super) fn returned(&mut self, exception: u16, now: u64, count: u64, cycles: u64, instructions: u64) {
        while let Some(open) = self.open.pop_if(|open| open.exception == exception) {
            self.calls.push(open.closed(now, count));
        }
        for open in &mut self.open {
            open.preempted_cycles += cycles;
            open.preempted_instructions += instructions;
        }
    }
}

impl<B: Bus> Cpu<B> {
    /// Looks at the instruction that comes next; true where the run is to end before it.
    pub(super) fn watched(&mut self, pc: u32) -> bool {
        let Some(watch) = &mut self.watch else { return false };
        let (exception, stack) = (self.exception, self.r[13]);
        while let Some(open) =
            watch.open.pop_if(|open| open.back == pc && open.exception == exception && stack >= open.stack)
        {
            watch.calls.push(open.closed(self.now, self.instructions));
        }
        if !watch.marked(pc) {
            return false;
        }
        if watch.stops.contains(&pc) && watch.reported.replace(pc) != Some(pc) {
            self.end = Some(End::Reached { address: pc });
            self.attention = 0;
            return true;
        }
        watch.reported = None;
        if watch.functions.contains(&pc) {
            watch.open.push(Open {
                function: pc,
                exception: self.exception,
                back: self.r[14] & !1,
                stack: self.r[13],
                entered: self.now,
                instructions: self.instructions,
                preempted_cycles: 0,
                preempted_instructions: 0,
            });
        }
        false
    }

    /// Looks where the stack pointer is.
    pub(super) fn watch_stack(&mut self) {
        let Some(watch) = &mut self.watch else { return };
        let lowest = if self.process_stack { &mut watch.lowest_process } else { &mut watch.lowest_main };
        *lowest = Some(lowest.map_or(self.r[13], |lowest| lowest.min(self.r[13])));
    }
}
