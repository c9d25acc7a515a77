//! Special registers, supervisor calls, breakpoints, hints and barriers.

use crate::bus::Bus;
use crate::cpu::interrupts::SUPERVISOR_CALL;
use crate::cpu::operation::{Done, Operands, Trap};
use crate::cpu::{Cpu, End, Sleep};

/// NOP, YIELD, preloads; barriers, because every access is complete before the next instruction.
pub(in crate::cpu) fn nothing<B: Bus>(cpu: &mut Cpu<B>, _: Operands, step: u32) -> Done {
    cpu.next(step)
}

pub(in crate::cpu) fn wait_for_interrupt<B: Bus>(cpu: &mut Cpu<B>, _: Operands, step: u32) -> Done {
    cpu.settle();
    cpu.sleep = Some(Sleep::Interrupt);
    cpu.attention = 0;
    cpu.next(step)
}

pub(in crate::cpu) fn wait_for_event<B: Bus>(cpu: &mut Cpu<B>, _: Operands, step: u32) -> Done {
    cpu.settle();
    if !std::mem::take(&mut cpu.event) {
        cpu.sleep = Some(Sleep::Event);
        cpu.attention = 0;
    }
    cpu.next(step)
}

pub(in crate::cpu) fn send_event<B: Bus>(cpu: &mut Cpu<B>, _: Operands, step: u32) -> Done {
    cpu.event = true;
    cpu.next(step)
}

/// CPSIE, CPSID: x has I in bit 1, F in bit 0, and in bit 4 whether they are set.
pub(in crate::cpu) fn change_state<B: Bus>(cpu: &mut Cpu<B>, o: Operands, step: u32) -> Done {
    cpu.settle();
    if cpu.privileged() {
        let set = o.x & 0x10 != 0;
        if o.x & 2 != 0 {
            cpu.interrupts.primask = set;
        }
        if o.x & 1 != 0 {
            cpu.set_fault_mask(set);
        }
        cpu.interrupts.update();
        cpu.schedule();
    }
    cpu.next(step)
}

/// MRS d from special register `immediate`.
pub(in crate::cpu) fn mrs<B: Bus>(cpu: &mut Cpu<B>, o: Operands, step: u32) -> Done {
    let value = cpu.special_register(o.immediate)?;
    cpu.set(o.d, value);
    cpu.next(step)
}

/// MSR to special register `immediate` from n, fields x.
pub(in crate::cpu) fn msr<B: Bus>(cpu: &mut Cpu<B>, o: Operands, step: u32) -> Done {
    cpu.settle();
    cpu.set_special_register(o.immediate, u32::from(o.x), cpu.get(o.n))?;
    cpu.next(step)
}

/// SVC. Where its priority does not allow it, it becomes a hard fault (B1.5.13).
pub(in crate::cpu) fn supervisor_call<B: Bus>(cpu: &mut Cpu<B>, _: Operands, step: u32) -> Done {
    cpu.settle();
    if !cpu.interrupts.would_take(SUPERVISOR_CALL) {
        return Err(Trap::Escalated.into());
    }
    cpu.interrupts.pend(SUPERVISOR_CALL);
    cpu.attention = 0;
    cpu.next(step)
}

/// BKPT ends the run; there is no debugger that it could halt for.
pub(in crate::cpu) fn breakpoint<B: Bus>(cpu: &mut Cpu<B>, o: Operands, _: u32) -> Done {
    // The address is filled in by `trapped`.
    cpu.end = Some(End::Breakpoint { address: 0, number: o.x });
    Err(Trap::End.into())
}

/// UDF.
pub(in crate::cpu) fn undefined<B: Bus>(_: &mut Cpu<B>, _: Operands, _: u32) -> Done {
    Err(Trap::Undefined.into())
}
