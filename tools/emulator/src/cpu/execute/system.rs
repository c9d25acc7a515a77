//! Special registers, supervisor calls, breakpoints, hints and barriers.

use crate::bus::Bus;
use crate::cpu::interrupts::SUPERVISOR_CALL;
use crate::cpu::operation::{Done, Operands, Rest, Trap};
use crate::cpu::{Cpu, End, Sleep};

/// NOP, YIELD, preloads; barriers, because every access is complete before the next instruction.
pub(in crate::cpu) fn nothing<B: Bus>(cpu: &mut Cpu<B>, _: Operands, rest: Rest<B>) -> Done {
    cpu.next(rest)
}

pub(in crate::cpu) fn wait_for_interrupt<B: Bus>(cpu: &mut Cpu<B>, _: Operands, rest: Rest<B>) -> Done {
    cpu.settle_at(rest);
    cpu.sleep = Some(Sleep::Interrupt);
    cpu.attention = 0;
    Ok(())
}

pub(in crate::cpu) fn wait_for_event<B: Bus>(cpu: &mut Cpu<B>, _: Operands, rest: Rest<B>) -> Done {
    cpu.settle_at(rest);
    if !std::mem::take(&mut cpu.event) {
        cpu.sleep = Some(Sleep::Event);
        cpu.attention = 0;
    }
    Ok(())
}

pub(in crate::cpu) fn send_event<B: Bus>(cpu: &mut Cpu<B>, _: Operands, rest: Rest<B>) -> Done {
    cpu.event = true;
    cpu.next(rest)
}

/// CPSIE, CPSID: x has I in bit 1, F in bit 0, and in bit 4 whether they are set.
pub(in crate::cpu) fn change_state<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.settle_at(rest);
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
    Ok(())
}

/// MRS d from special register `immediate`.
pub(in crate::cpu) fn mrs<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    let value = cpu.special_register(o.immediate)?;
    cpu.set(o.d, value);
    cpu.next(rest)
}

/// MSR to special register `immediate` from n, fields x.
pub(in crate::cpu) fn msr<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.settle_at(rest);
    cpu.set_special_register(o.immediate, u32::from(o.x), cpu.get(o.n))?;
    Ok(())
}

/// SVC. Where its priority does not allow it, it becomes a hard fault (B1.5.13).
pub(in crate::cpu) fn supervisor_call<B: Bus>(cpu: &mut Cpu<B>, _: Operands, rest: Rest<B>) -> Done {
    cpu.settle_at(rest);
    if !cpu.interrupts.would_take(SUPERVISOR_CALL) {
        return cpu.trap(rest, Trap::Escalated);
    }
    cpu.interrupts.pend(SUPERVISOR_CALL);
    cpu.attention = 0;
    Ok(())
}

/// BKPT ends the run; there is no debugger that it could halt for.
pub(in crate::cpu) fn breakpoint<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    // The address is filled in by `trapped`.
    cpu.end = Some(End::Breakpoint { address: 0, number: o.x });
    cpu.trap(rest, Trap::End)
}

/// UDF.
pub(in crate::cpu) fn undefined<B: Bus>(cpu: &mut Cpu<B>, _: Operands, rest: Rest<B>) -> Done {
    cpu.trap(rest, Trap::Undefined)
}
