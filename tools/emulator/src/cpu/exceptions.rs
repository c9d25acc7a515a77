//! Exceptions: entry with its stack frame, tail-chaining, late arrival, return, and lazy stacking of the floating-point
//! registers.
//!
//! ARM DDI 0403, B1.5.6 to B1.5.8 and B1.5.11; cycles in `timing`. A request that arrives while the frame is written is
//! taken instead, if it is more urgent. What arrives while a frame is read waits until it is read and then preempts:
//! the hardware saves those cycles by giving the return up.

use super::interrupts::{EXTERNAL, HARD_FAULT};
use super::operation::Trap;
use super::{Cpu, timing};
use crate::bus::Bus;

/// Bytes of a frame without floating-point registers, and of those.
const BASIC_FRAME: u32 = 0x20;
const FLOATING_FRAME: u32 = 0x48;

/// Times that the handler of an exception has taken. Everything from the first cycle of entry to the last of return
/// counts; what preempted it counts for it only in `cycles` and `instructions`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExceptionTimes {
    /// Number of times that it has returned.
    pub count: u64,
    /// Instructions in all, those of what preempted it included.
    pub instructions: u64,
    /// Cycles in all, those of what preempted it included.
    pub cycles: u64,
    /// Cycles in all of itself alone.
    pub own_cycles: u64,
    /// Fewest cycles of itself alone.
    pub least: u64,
    /// Most cycles of itself alone.
    pub most: u64,
    /// Most instructions of itself alone.
    pub most_instructions: u64,
}

/// A handler that has begun.
#[derive(Clone)]
pub(super) struct Activation {
    number: u16,
    cycles: u64,
    instructions: u64,
    /// Cycles of what preempted it.
    nested_cycles: u64,
    nested_instructions: u64,
}

impl<B: Bus> Cpu<B> {
    /// Takes an exception: what runs goes on at `back` once the handler has returned.
    pub(super) fn enter(&mut self, number: u16, back: u32) {
        let begin = self.now;
        let main = !self.process_stack;
        let floating = self.floating_used;
        if let Err(trap) = self.push_frame(back, floating) {
            self.stacking_failed(trap, false);
        }
        let return_value = match (self.exception != 0, main) {
            (true, _) => 0xffff_fff1,
            (false, true) => 0xffff_fff9,
            (false, false) => 0xffff_fffd,
        };
        self.r[14] = if floating { return_value & !0x10 } else { return_value };
        self.now += timing::ENTRY;
        // An exception that has arrived meanwhile, or that stacking has caused, may be more urgent.
        if self.now >= self.due() {
            self.catch_up();
        }
        let number = self.interrupts.takeable().unwrap_or(number);
        self.begin_handler(number, begin);
    }

    /// The handler of `number` begins, the frame lying on the stack.
    fn begin_handler(&mut self, number: u16, begin: u64) {
        self.use_process_stack(false);
        self.exception = number;
        self.interrupts.activate(number);
        self.floating_used = false;
        self.prepare_floating_point();
        (self.it, self.event, self.exclusive, self.sleep) = (0, true, false, None);
        self.single = false;
        let (cycles, instructions) = (begin, self.instructions);
        self.activations.push(Activation { number, cycles, instructions, nested_cycles: 0, nested_instructions: 0 });
        let vector = self.system.vectors.wrapping_add(4 * u32::from(number));
        match self.load::<4>(vector) {
            Ok(handler) => {
                (self.pc, self.thumb) = (handler & !1, handler & 1 != 0);
                self.code.enter(self.pc);
                self.now += self.code.wait_states();
            }
            Err(trap) => self.vector_failed(trap, number),
        }
        self.schedule();
    }

    /// PushStack.
    fn push_frame(&mut self, back: u32, floating: bool) -> Result<(), Trap> {
        let aligned = floating || self.system.aligns_stack();
        let size = BASIC_FRAME + if floating { FLOATING_FRAME } else { 0 };
        let padded = aligned && self.r[13] & 4 != 0;
        let frame = self.r[13].wrapping_sub(size) & if aligned { !7 } else { !3 };
        let status = self.xpsr() & !(1 << 9) | u32::from(padded) << 9;
        let words = [self.r[0], self.r[1], self.r[2], self.r[3], self.r[12], self.r[14], back, status];
        self.r[13] = frame;
        self.store_words(frame, &words)?;
        if floating {
            let place = frame.wrapping_add(BASIC_FRAME);
            if self.system.lazy() {
                let ready = self.interrupts.current();
                let handler = self.exception != 0;
                self.system.defer_floating_point(place, ready, handler, !self.privileged());
            } else {
                self.store_floating_point(place)?;
                self.now += timing::FLOATING_POINT_FRAME;
            }
        }
        Ok(())
    }

    fn store_floating_point(&mut self, place: u32) -> Result<(), Trap> {
        let registers: [u32; 16] = std::array::from_fn(|i| self.s[i]);
        self.store_words(place, &registers)?;
        self.store_aligned::<4>(place.wrapping_add(0x40), self.floating.bits())
    }

    /// Preparation of a floating-point instruction before it can run (ExecuteFPCheck): the unit switched on, registers
    /// of what was interrupted stored, and the context marked as used.
    #[cold]
    pub(super) fn check_floating_point(&mut self) -> Result<(), Trap> {
        self.settle();
        if !self.system.floating_point_allowed(self.privileged()) {
            return Err(Trap::NoCoprocessor);
        }
        if let Some(place) = self.system.take_deferred() {
            self.store_floating_point(place)?;
            self.now += timing::FLOATING_POINT_FRAME;
        }
        if self.system.marks_use() && !self.floating_used {
            self.floating.set_modes(self.system.default_modes);
            self.floating_used = true;
        }
        self.prepare_floating_point();
        Ok(())
    }

    /// Keeps the one bit that says whether the check above would change nothing.
    pub(super) fn prepare_floating_point(&mut self) {
        self.floating_ready = self.system.floating_point_allowed(self.privileged())
            && !self.system.is_deferred()
            && (self.floating_used || !self.system.marks_use());
    }

    /// A return by one of the addresses that mean that (ExceptionReturn).
    #[inline(never)]
    pub(super) fn exception_return(&mut self, value: u32) -> Result<(), Trap> {
        self.settle();
        let nested = self.interrupts.active_count();
        let consistent = value >> 5 & 0x7f_ffff == 0x7f_ffff
            && self.interrupts.is_active(self.exception)
            && match value & 0xf {
                1 => nested > 1,
                9 | 0xd => nested == 1 || self.system.allows_early_return(),
                _ => false,
            };
        let ending = self.exception;
        self.interrupts.deactivate(ending);
        if !consistent {
            return self.return_failed(value, ending);
        }
        if let Some(next) = self.interrupts.takeable() {
            // Straight on to the next handler; the frame stays where it is.
            self.leave(ending);
            let begin = self.now;
            self.r[14] = value;
            self.now += timing::TAIL_CHAIN;
            self.begin_handler(next, begin);
            return Ok(());
        }
        let process = value & 0xf == 0xd;
        self.exception = 0;
        self.use_process_stack(process);
        let popped = self.pop_frame(value);
        match popped {
            Ok(status) if (status & 0x1ff != 0) == (value & 0xf == 1) => {
                self.exception = (status & 0x1ff) as u16;
            }
            Ok(_) => return self.return_failed(value, ending),
            Err(trap) => {
                self.stacking_failed(trap, true);
                return self.return_failed(value, ending);
            }
        }
        self.floating_used = value & 0x10 == 0;
        self.prepare_floating_point();
        (self.event, self.exclusive, self.single) = (true, false, false);
        self.now += timing::RETURN;
        self.leave(ending);
        if self.exception == 0 && self.system.sleeps_on_exit() {
            self.sleep = Some(super::Sleep::Interrupt);
        }
        self.schedule();
        Ok(())
    }

    /// PopStack; the program status word that lay there.
    fn pop_frame(&mut self, value: u32) -> Result<u32, Trap> {
        let floating = value & 0x10 == 0;
        let frame = self.r[13];
        let mut words = [0; 8];
        self.load_words(frame, &mut words)?;
        let mut size = BASIC_FRAME;
        if floating {
            size += FLOATING_FRAME;
            // Registers that were never stored are still there.
            if self.system.take_deferred().is_none() {
                let place = frame.wrapping_add(BASIC_FRAME);
                let mut registers = [0; 16];
                self.load_words(place, &mut registers)?;
                self.s[..16].copy_from_slice(&registers);
                let status = self.load_aligned::<4>(place.wrapping_add(0x40))?;
                self.floating = super::float::Status::from_bits(status);
                self.now += timing::FLOATING_POINT_FRAME;
            }
        }
        let [r0, r1, r2, r3, r12, link, back, status] = words;
        (self.r[0], self.r[1], self.r[2], self.r[3], self.r[12], self.r[14]) = (r0, r1, r2, r3, r12, link);
        self.pc = back & !1;
        self.code.enter(self.pc);
        self.now += self.code.wait_states();
        let aligned = floating || self.system.aligns_stack();
        self.r[13] = frame.wrapping_add(size) | if aligned { status >> 9 & 1 } else { 0 } << 2;
        self.set_xpsr(status);
        Ok(status)
    }

    /// Books what a handler has taken.
    pub(super) fn leave(&mut self, number: u16) {
        let Some(done) = self.activations.pop_if(|activation| activation.number == number) else { return };
        let cycles = self.now - done.cycles;
        let instructions = self.instructions - done.instructions;
        if let Some(below) = self.activations.last_mut() {
            below.nested_cycles += cycles;
            below.nested_instructions += instructions;
        }
        if let Some(watch) = &mut self.watch {
            watch.returned(number, self.now, self.instructions, cycles, instructions);
        }
        let own = cycles.saturating_sub(done.nested_cycles);
        let own_instructions = instructions.saturating_sub(done.nested_instructions);
        let times = self.times.entry(number).or_default();
        times.least = if times.count == 0 { own } else { times.least.min(own) };
        times.count += 1;
        times.instructions += instructions;
        times.cycles += cycles;
        times.own_cycles += own;
        times.most = times.most.max(own);
        times.most_instructions = times.most_instructions.max(own_instructions);
    }

    /// A return that does not hold together: a usage fault takes the place of what would have gone on.
    fn return_failed(&mut self, value: u32, ending: u16) -> Result<(), Trap> {
        self.leave(ending);
        self.r[14] = value;
        self.record(Trap::Return);
        match self.interrupts.takeable() {
            Some(next) if (HARD_FAULT..EXTERNAL).contains(&next) => {
                let begin = self.now;
                self.now += timing::TAIL_CHAIN;
                self.begin_handler(next, begin);
                Ok(())
            }
            _ => Err(Trap::Escalated),
        }
    }
}
