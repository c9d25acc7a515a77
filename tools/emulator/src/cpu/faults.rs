//! Way from a trap to the fault handler: status registers, escalation to hard fault, lock-up (ARM DDI 0403, B1.5.13 to
//! B1.5.15).

use super::interrupts::{BUS_FAULT, HARD_FAULT, MEMORY_FAULT, USAGE_FAULT};
use super::operation::Trap;
use super::{Cpu, End, Lockup};
use crate::bus::Bus;

/// Bits of CFSR (B3.2.15).
const EXECUTE_NEVER: u32 = 1;
const FETCH: u32 = 1 << 8;
const DATA: u32 = 1 << 9;
const UNSTACKING: u32 = 1 << 11;
const STACKING: u32 = 1 << 12;
const ADDRESS_VALID: u32 = 1 << 15;
const UNDEFINED: u32 = 1 << 16;
const NOT_THUMB: u32 = 1 << 17;
const RETURN: u32 = 1 << 18;
const NO_COPROCESSOR: u32 = 1 << 19;
const UNALIGNED: u32 = 1 << 24;
const DIVISION_BY_ZERO: u32 = 1 << 25;
/// Bits of HFSR.
const VECTOR: u32 = 1 << 1;
const FORCED: u32 = 1 << 30;

impl<B: Bus> Cpu<B> {
    /// The instruction at `pc` did not complete.
    #[cold]
    pub(super) fn trapped(&mut self, trap: Trap, pc: u32) {
        self.attention = 0;
        if trap == Trap::End {
            if let Some(
                End::Unmodelled { address, .. } | End::Refused { address, .. } | End::Breakpoint { address, .. },
            ) = &mut self.end
            {
                *address = pc;
            }
            self.pc = pc;
            return;
        }
        // Return address of the handler: the instruction itself; a supervisor call has completed.
        let back = if trap == Trap::Escalated { self.pc } else { pc };
        let current = self.interrupts.current();
        self.record(trap);
        if current <= -1 {
            return self.lock_up(pc);
        }
        match self.interrupts.takeable() {
            Some(number) => self.enter(number, back),
            None => self.lock_up(pc),
        }
    }

    /// Notes a fault in the status registers and pends its exception, or a hard fault where that cannot be taken.
    pub(super) fn record(&mut self, trap: Trap) {
        let (bits, exception) = match trap {
            Trap::Undefined => (UNDEFINED, USAGE_FAULT),
            Trap::NotThumb => (NOT_THUMB, USAGE_FAULT),
            Trap::Return => (RETURN, USAGE_FAULT),
            Trap::NoCoprocessor => (NO_COPROCESSOR, USAGE_FAULT),
            Trap::Unaligned => (UNALIGNED, USAGE_FAULT),
            Trap::DivisionByZero => (DIVISION_BY_ZERO, USAGE_FAULT),
            Trap::Data => {
                self.system.bus_fault_address = self.trapped_address;
                (DATA | ADDRESS_VALID, BUS_FAULT)
            }
            Trap::Fetch => (FETCH, BUS_FAULT),
            Trap::ExecuteNever => (EXECUTE_NEVER, MEMORY_FAULT),
            Trap::Escalated => (0, HARD_FAULT),
            Trap::End => return,
        };
        self.raise(bits, exception);
    }

    fn raise(&mut self, bits: u32, exception: u16) {
        self.system.faults |= bits;
        let direct = exception != HARD_FAULT && self.system.handles(exception) && self.interrupts.would_take(exception);
        if direct {
            return self.interrupts.pend(exception);
        }
        self.system.hard_fault |= FORCED;
        self.interrupts.pend(HARD_FAULT);
    }

    /// Takes the fault that nothing answered where a frame is stored or loaded.
    pub(super) fn stacking_failed(&mut self, trap: Trap, loading: bool) {
        if trap == Trap::End {
            return;
        }
        let bits = if loading { UNSTACKING } else { STACKING };
        if self.interrupts.current() <= -1 {
            return self.lock_up(self.pc);
        }
        self.raise(bits, BUS_FAULT);
    }

    /// Takes the fault that nothing answered where the vector of exception `number` lies.
    pub(super) fn vector_failed(&mut self, trap: Trap, number: u16) {
        if trap == Trap::End {
            return;
        }
        self.system.hard_fault |= VECTOR;
        if number == HARD_FAULT || self.interrupts.current() <= -1 {
            return self.lock_up(self.pc);
        }
        self.interrupts.pend(HARD_FAULT);
    }

    fn lock_up(&mut self, address: u32) {
        self.attention = 0;
        self.end = Some(End::Lockup(Lockup {
            address,
            exception: self.exception,
            faults: self.system.faults,
            hard_fault: self.system.hard_fault,
            bus_fault_address: self.system.bus_fault_address,
        }));
    }
}
