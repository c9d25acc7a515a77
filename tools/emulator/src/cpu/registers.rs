//! The registers as a debugger sees them, the program status register, and what MRS and MSR reach (ARM DDI 0403, B1.4,
//! B5.2).

use super::operation::Trap;
use super::{Cpu, ExceptionTimes, Watch};
use crate::bus::Bus;
use std::collections::BTreeMap;

/// T of the program status register.
const THUMB: u32 = 1 << 24;

impl<B: Bus> Cpu<B> {
    /// r0 to r12, the stack pointer in use (13), the link register (14), the address of the next instruction (15).
    /// Others are 0.
    pub fn register(&self, number: usize) -> u32 {
        match number {
            15 => self.pc,
            _ => self.r.get(number).copied().unwrap_or(0),
        }
    }

    /// Sets what `register` gives; others than those are ignored.
    pub fn set_register(&mut self, number: usize, value: u32) {
        match number {
            13 => self.r[13] = value & !3,
            15 => {
                (self.pc, self.thumb) = (value & !1, true);
                self.code.enter(self.pc);
            }
            _ => {
                if let Some(register) = self.r.get_mut(number) {
                    *register = value;
                }
            }
        }
    }

    /// The bits of s0 to s31; others are 0.
    pub fn float_register(&self, number: usize) -> u32 {
        self.s.get(number).copied().unwrap_or(0)
    }

    /// Sets the bits of s0 to s31; others are ignored.
    pub fn set_float_register(&mut self, number: usize, bits: u32) {
        if let Some(register) = self.s.get_mut(number) {
            *register = bits;
        }
    }

    /// Status and modes of the floating-point unit.
    pub fn fpscr(&self) -> u32 {
        self.floating.bits()
    }

    /// Sets status and modes of the floating-point unit; bits that it does not have are ignored.
    pub fn set_fpscr(&mut self, bits: u32) {
        self.floating = super::float::Status::from_bits(bits);
    }

    /// The program status register: flags, IT state, Thumb, number of the exception.
    pub fn xpsr(&self) -> u32 {
        let flag = |set: bool, bit: u32| u32::from(set) << bit;
        let flags = flag(self.negative, 31) | flag(self.zero, 30) | flag(self.carry, 29) | flag(self.overflow, 28);
        let it = u32::from(self.it);
        flags
            | flag(self.saturated, 27)
            | (it & 3) << 25
            | if self.thumb { THUMB } else { 0 }
            | u32::from(self.greater) << 16
            | (it >> 2) << 10
            | u32::from(self.exception)
    }

    /// Sets flags, IT state and Thumb; the number of the exception stays.
    pub fn set_xpsr(&mut self, value: u32) {
        self.set_flags(value);
        self.greater = (value >> 16 & 0xf) as u8;
        self.it = (value >> 25 & 3 | (value >> 10 & 0x3f) << 2) as u8;
        self.thumb = value & THUMB != 0;
    }

    pub(super) fn set_flags(&mut self, value: u32) {
        let flag = |bit: u32| value >> bit & 1 != 0;
        (self.negative, self.zero, self.carry, self.overflow) = (flag(31), flag(30), flag(29), flag(28));
        self.saturated = flag(27);
    }

    /// Cycles since the run began.
    pub fn now(&self) -> u64 {
        self.now
    }

    /// Cycles of those that the core was asleep.
    pub fn slept(&self) -> u64 {
        self.slept
    }

    /// Instructions since the run began; one that an IT block skips counts.
    pub fn instructions(&self) -> u64 {
        self.instructions
    }

    /// Number of the exception whose handler runs, 0 in thread mode; interrupt n is 16 + n.
    pub fn exception(&self) -> u16 {
        self.exception
    }

    /// Times that the handlers have taken so far, by the number of their exception.
    pub fn exception_times(&self) -> &BTreeMap<u16, ExceptionTimes> {
        &self.times
    }

    /// Forgets what the handlers have taken; those that run now count from here when they return.
    pub fn clear_exception_times(&mut self) {
        self.times.clear();
    }

    /// Goes on behind the narrow instruction at which the run ended, which is what a debugger does with a breakpoint.
    pub fn skip(&mut self) {
        self.pc = self.pc.wrapping_add(2);
    }

    /// Installs what watches functions and stack, or takes it away. Without it nothing of that costs time.
    pub fn set_watch(&mut self, watch: Option<Watch>) {
        self.watch = watch.map(Box::new);
    }

    /// Watch of functions and stack.
    pub fn watch(&self) -> Option<&Watch> {
        self.watch.as_deref()
    }

    /// Watch of functions and stack, to change it or take what it has collected.
    pub fn watch_mut(&mut self) -> Option<&mut Watch> {
        self.watch.as_deref_mut()
    }

    /// Fault status: CFSR and HFSR.
    pub fn fault_status(&self) -> (u32, u32) {
        (self.system.faults, self.system.hard_fault)
    }

    pub(super) fn privileged(&self) -> bool {
        self.exception != 0 || !self.unprivileged
    }

    /// Thread mode may use either stack, handlers only the main one.
    pub(super) fn use_process_stack(&mut self, process: bool) {
        if self.process_stack != process {
            self.process_stack = process;
            std::mem::swap(&mut self.r[13], &mut self.other_stack);
        }
    }

    /// MRS.
    pub(super) fn special_register(&mut self, number: u32) -> Result<u32, Trap> {
        let privileged = self.privileged();
        // A stack pointer is where it is: in use or beside.
        let stack = |process: bool| if self.process_stack == process { self.r[13] } else { self.other_stack };
        let masks = &self.interrupts;
        Ok(match number {
            // Parts of the program status register; T and IT read as 0, the exception's number only if privileged.
            0..=3 | 5..=7 => {
                let flags = if number & 4 == 0 { self.xpsr() & 0xf80f_0000 } else { 0 };
                let exception = if number & 1 != 0 && privileged { u32::from(self.exception) } else { 0 };
                flags | exception
            }
            8 if privileged => stack(false),
            9 if privileged => stack(true),
            16 if privileged => u32::from(masks.primask),
            17 | 18 if privileged => u32::from(masks.basepri),
            19 if privileged => u32::from(masks.faultmask),
            20 => {
                let bit = |set: bool, bit: u32| u32::from(set) << bit;
                bit(self.floating_used, 2) | bit(self.process_stack, 1) | bit(self.unprivileged, 0)
            }
            8 | 9 | 16..=19 => 0,
            _ => return Err(self.unmodelled(format!("special register {number}"))),
        })
    }

    /// MSR. `fields`: bit 1 for the flags, bit 0 for the greater-or-equal flags.
    pub(super) fn set_special_register(&mut self, number: u32, fields: u32, value: u32) -> Result<(), Trap> {
        let privileged = self.privileged();
        match number {
            0..=3 => {
                if fields & 2 != 0 {
                    self.set_flags(value);
                }
                if fields & 1 != 0 {
                    self.greater = (value >> 16 & 0xf) as u8;
                }
            }
            // Read-only.
            5..=7 => {}
            8 | 9 if privileged => match self.process_stack == (number == 9) {
                true => self.r[13] = value & !3,
                false => self.other_stack = value & !3,
            },
            16 if privileged => self.interrupts.primask = value & 1 != 0,
            17 if privileged => self.interrupts.basepri = value as u8 & 0xf0,
            18 if privileged => {
                let (new, old) = (value as u8 & 0xf0, self.interrupts.basepri);
                if new != 0 && (new < old || old == 0) {
                    self.interrupts.basepri = new;
                }
            }
            19 if privileged => self.set_fault_mask(value & 1 != 0),
            20 if privileged => {
                self.unprivileged = value & 1 != 0;
                // In a handler the choice of stack is ignored.
                if self.exception == 0 {
                    self.use_process_stack(value & 2 != 0);
                }
                self.floating_used = value & 4 != 0;
                self.prepare_floating_point();
            }
            8 | 9 | 16..=20 => {}
            _ => return Err(self.unmodelled(format!("special register {number}"))),
        }
        self.interrupts.update();
        self.schedule();
        Ok(())
    }

    /// FAULTMASK can only be set below the priority of a hard fault (B1.4.3).
    pub(super) fn set_fault_mask(&mut self, set: bool) {
        self.interrupts.faultmask = set && (self.interrupts.current() > -1 || self.interrupts.faultmask);
    }
}
