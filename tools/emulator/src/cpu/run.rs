//! Loop from one instruction to the next, in which everything else waits.
//!
//! A run without a watch flows: as long as nothing is due, one stretch follows the other (see `stretch`).

use super::decode::Refused;
use super::operation::{Done, Leave, Operation, behind};
use super::{Cpu, End};
use crate::bus::Bus;

impl<B: Bus> Cpu<B> {
    /// Runs until the cycle `until` is reached or something else ends the run. The instruction that reaches it
    /// completes.
    pub fn run(&mut self, until: u64) -> End {
        self.until = until;
        // The caller may have changed what the core is connected to.
        self.read_signals();
        self.attention = 0;
        loop {
            if self.now >= self.attention
                && let Some(end) = self.attend()
            {
                return end;
            }
            match self.watch.is_some() || self.code.waits_for_lines() {
                true => self.instruct::<true>(),
                false => self.flow(),
            }
        }
    }

    /// Runs one instruction, and before it the entry of an exception that is due. Sleep is passed over. Says what ended
    /// the run, if anything did.
    pub fn step(&mut self) -> Option<End> {
        self.until = u64::MAX;
        self.read_signals();
        let before = self.instructions;
        // An instruction that was not decoded yet takes a turn by itself.
        while self.instructions == before {
            if let Some(end) = self.attend() {
                return Some(end);
            }
            match self.watch.is_some() {
                true => self.instruct::<true>(),
                false => self.instruct::<false>(),
            }
        }
        self.end.take()
    }

    /// Runs instructions, one at least, until something is due or one is not decoded yet.
    fn flow(&mut self) {
        loop {
            match self.it {
                0 => self.run_stretches(),
                _ => self.instruct::<false>(),
            }
            if self.now >= self.attention {
                return;
            }
        }
    }

    /// Runs one instruction, or decodes it.
    #[inline(always)]
    pub(super) fn instruct<const WATCHED: bool>(&mut self) {
        let pc = self.pc;
        let Some(operation) = self.code.at(pc) else { return self.elsewhere(pc) };
        if WATCHED && self.watched(pc) {
            return;
        }
        self.pc = pc.wrapping_add(u32::from(operation.timing.length));
        if self.code.waits_for_lines() {
            self.now += self.code.waits_for_lines_of(pc, operation.timing.length, self.fetched);
            self.fetched = self.pc;
        }
        self.instructions = self.instructions.wrapping_add(1);
        let cycles = operation.timing.cycles.wrapping_sub(operation.timing.overlaps & u8::from(self.single));
        self.now = self.now.wrapping_add(u64::from(cycles));
        self.single = operation.timing.single;
        let done = match self.it {
            0 => (operation.execute)(self, operation.operands, &[]),
            _ => self.in_block(operation, pc),
        };
        if let Err(Leave::Trapped(trap)) = done {
            self.trapped(trap, pc);
        }
        if WATCHED {
            self.watch_stack();
        }
    }

    /// An instruction of an IT block: runs if its condition holds (A7.3.2).
    fn in_block(&mut self, operation: Operation<B>, pc: u32) -> Done {
        let block = self.it;
        self.it = behind(block);
        if !self.holds(block >> 4) {
            self.now -= u64::from(operation.timing.cycles) - 1;
            self.single = false;
            return Ok(());
        }
        let (next, rest, handler) = (self.pc, self.it, self.exception);
        let done = (operation.execute)(self, operation.operands.in_block(), &[]);
        if let Err(Leave::Trapped(_)) = done {
            self.it = block;
        } else if rest != 0 && self.pc != next && self.exception == handler {
            // A branch elsewhere than at the block's end. A return from a handler brings the block of what it
            // interrupted with it.
            self.refuse(pc, operation.timing.length, Refused::Unpredictable)?;
        }
        done
    }

    /// Returns `true` if a condition holds (ConditionPassed).
    #[inline(always)]
    pub(super) fn holds(&self, condition: u8) -> bool {
        let plain = match condition >> 1 {
            0 => self.zero,
            1 => self.carry,
            2 => self.negative,
            3 => self.overflow,
            4 => self.carry && !self.zero,
            5 => self.negative == self.overflow,
            6 => !self.zero && self.negative == self.overflow,
            _ => return true,
        };
        plain ^ (condition & 1 != 0)
    }
}
