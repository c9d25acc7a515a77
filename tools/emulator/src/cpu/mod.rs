//! A Cortex-M4F: predecoded, deterministic, one instruction at a time.
//!
//! From ARM DDI 0403 (ARMv7-M Architecture Reference Manual) with the DSP extension and the single-precision
//! floating-point unit; what the core itself chooses is from its Technical Reference Manual (Arm 100166). An encoding
//! that is not implemented, or whose outcome the architecture leaves open, ends the run and says where.
//!
//! - `run`, `stretch`: from one instruction to the next
//! - `translation`: the same of what runs often, as functions of the host
//! - `registers`, `reset`: what a debugger sees; special registers; how it all begins
//! - `code`, `decode`, `operation`: half-words of code become calls, once
//! - `execute`, `arithmetic`, `float`: what the calls do
//! - `access`: loads and stores, the core's own registers among them
//! - `exceptions`, `interrupts`, `faults`: from a request to its handler and back
//! - `system`, `system_timer`, `cycle_counter`: the core's own devices
//! - `timing`: how long things take, and what is assumed
//! - `watch`: what test equipment wants to know of functions and stack
//!
//! Host only.

mod access;
mod arithmetic;
mod code;
mod cycle_counter;
mod decode;
mod end;
mod exceptions;
mod execute;
mod faults;
pub mod float;
mod interrupts;
mod operation;
mod registers;
mod reset;
mod run;
mod stretch;
mod system;
mod system_timer;
mod timing;
mod translation;
mod watch;

#[cfg(test)]
mod tests;

pub use decode::Refused;
pub use end::{End, Lockup, Origin};
pub use exceptions::ExceptionTimes;
pub use watch::{Call, Watch};

use crate::bus::Bus;
use code::Code;
use cycle_counter::CycleCounter;
use decode::Decode;
use exceptions::Activation;
use interrupts::Interrupts;
use operation::Trap;
use std::collections::BTreeMap;
use stretch::Within;
use system::System;
use system_timer::SystemTimer;

/// A core and what it is connected to. A clone goes on as the original would, on its own.
#[derive(Clone)]
pub struct Cpu<B: Bus> {
    /// Memories and devices.
    pub bus: B,
    /// r0 to r12, the stack pointer in use, the link register; the last is never read.
    r: [u32; 16],
    /// Address of the next instruction.
    pc: u32,
    /// The stack pointer that is not in use.
    other_stack: u32,
    /// s0 to s31.
    s: [u32; 32],
    /// FPSCR.
    floating: float::Status,
    negative: bool,
    zero: bool,
    carry: bool,
    overflow: bool,
    saturated: bool,
    /// The four greater-or-equal flags.
    greater: u8,
    /// ITSTATE.
    it: u8,
    /// Cleared by a branch to an even address: the next instruction faults.
    thumb: bool,
    /// Number of the exception whose handler runs, 0 in thread mode.
    exception: u16,
    /// CONTROL: thread mode is unprivileged; it uses the process stack; floating-point registers have been used.
    unprivileged: bool,
    process_stack: bool,
    floating_used: bool,
    /// `true` if a floating-point instruction may go ahead without further preparation.
    floating_ready: bool,
    /// The event register of WFE, and the exclusive monitor.
    event: bool,
    exclusive: bool,
    sleep: Option<Sleep>,
    /// Cycles since the run began; those of them asleep; instructions.
    now: u64,
    slept: u64,
    instructions: u64,
    /// `true` if the last instruction loaded or stored one register.
    single: bool,
    /// End of the last instruction that waited for its lines of code.
    fetched: u32,
    /// The cycle at which `attend` has to look, and the one at which the run is to end.
    attention: u64,
    until: u64,
    end: Option<End>,
    trapped_address: u32,
    code: Code<B>,
    within: Within,
    /// Makes operations. A pointer: whoever calls the decoder by name has all operations compiled, and programs that
    /// only run a core need not.
    decode: Decode<B>,
    /// Memory that does not answer before a cycle.
    stall: Option<(std::ops::Range<u32>, u64)>,
    interrupts: Interrupts,
    system: System,
    timer: SystemTimer,
    counter: CycleCounter,
    activations: Vec<Activation>,
    times: BTreeMap<u16, ExceptionTimes>,
    watch: Option<Box<Watch>>,
}

/// Event that the core waits for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sleep {
    Interrupt,
    Event,
}

impl<B: Bus> Cpu<B> {
    /// Work that is not the next instruction: time that makes things happen, sleep, exceptions, the run's end.
    #[cold]
    fn attend(&mut self) -> Option<End> {
        loop {
            if self.now >= self.due() {
                self.catch_up();
            }
            if self.sleep.is_none() {
                self.wait_for(self.pc);
            }
            if let Some(end) = self.end.take() {
                return Some(end);
            }
            if self.now >= self.until {
                return Some(End::Time);
            }
            let Some(sleep) = self.sleep else { break };
            if self.wakes(sleep) {
                self.sleep = None;
                continue;
            }
            let next = self.due().min(self.until);
            if next == u64::MAX {
                return Some(End::Asleep);
            }
            let passed = next.saturating_sub(self.now);
            self.slept += passed;
            self.now += passed;
        }
        if let Some(number) = self.interrupts.takeable() {
            self.enter(number, self.pc);
        }
        if !self.thumb && self.end.is_none() {
            self.trapped(Trap::NotThumb, self.pc);
        }
        self.schedule();
        None
    }

    fn wakes(&mut self, sleep: Sleep) -> bool {
        match sleep {
            Sleep::Interrupt => self.interrupts.would_wake(),
            Sleep::Event => std::mem::take(&mut self.event) || self.interrupts.takeable().is_some(),
        }
    }

    /// Cycle at which something next happens by itself.
    fn due(&self) -> u64 {
        self.bus.next_event().min(self.timer.next())
    }

    /// Does what time has made due.
    fn catch_up(&mut self) {
        if self.timer.expire(self.now) {
            self.interrupts.pend(interrupts::SYSTICK);
            self.pended();
        }
        self.bus.advance(self.now);
        self.read_news();
    }

    /// Takes over what the bus has to say, if it has anything.
    #[inline]
    fn read_news(&mut self) {
        match self.bus.has_news() {
            true => self.read_signals(),
            false => self.schedule(),
        }
    }

    /// Takes over what the bus has to say.
    fn read_signals(&mut self) {
        let signals = self.bus.signals();
        if let Some(range) = signals.rewritten {
            self.code.forget(range);
        }
        if signals.reset {
            self.end = Some(End::Reset(Origin::Chip));
        }
        if self.interrupts.set_lines(signals.lines, signals.nmi) {
            self.pended();
        }
        self.stall = signals.stall.filter(|(_, until)| *until > self.now);
        self.code.set_wait_states(&self.bus);
        self.schedule();
    }

    /// Waits for memory that does not answer yet: flash that is erased or written.
    #[inline]
    fn wait_for(&mut self, address: u32) {
        if let Some((range, until)) = &self.stall
            && range.contains(&address)
        {
            self.now = self.now.max(*until);
        }
    }

    /// Takes that something has become pending: an event for WFE where SCR.SEVONPEND says so (B1.5.18).
    fn pended(&mut self) {
        self.event |= self.system.event_on_pending();
    }

    /// Sets when `attend` has to look again.
    fn schedule(&mut self) {
        // While memory stalls, each instruction may be one that has to wait for it.
        let at_once = self.end.is_some()
            || self.stall.is_some()
            || !self.thumb
            || self.sleep.is_some()
            || self.interrupts.takeable().is_some();
        self.attention = if at_once { 0 } else { self.due().min(self.until) };
    }

    /// Goes on at `target`, which is even.
    #[inline(always)]
    fn branch(&mut self, target: u32) {
        self.pc = target;
        if !self.code.holds(target) {
            self.code.enter(target);
        }
        self.now = self.now.wrapping_add(timing::REFILL).wrapping_add(self.code.wait_states());
    }

    /// Goes on at `target`, whose lowest bit says Thumb (BXWritePC, LoadWritePC), or returns from an exception.
    #[inline(always)]
    fn branch_exchange(&mut self, target: u32) -> Result<(), Trap> {
        if target >= 0xf000_0000 && self.exception != 0 {
            return self.exception_return(target);
        }
        if target & 1 == 0 {
            self.thumb = false;
            self.attention = 0;
        }
        self.branch(target & !1);
        Ok(())
    }

    /// Ends the run at an instruction.
    #[cold]
    fn refuse(&mut self, address: u32, length: u8, why: Refused) -> Result<(), Trap> {
        let now = self.now;
        let mut half = |at: u32| self.bus.fetch(now, at).map_or(0, u32::from);
        let encoding = if length == 4 { half(address) << 16 | half(address.wrapping_add(2)) } else { half(address) };
        self.end = Some(End::Refused { address, encoding, why });
        Err(Trap::End)
    }
}
