//! Branches, calls, tables, IT.

use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::cpu::operation::{Done, Execute, Operands, Rest};

/// Branch to `immediate`.
pub(in crate::cpu) fn branch<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.branch(o.immediate);
    cpu.jumped(rest)
}

/// Branch to `immediate` if a condition holds.
fn branch_if<B: Bus, const CONDITION: u8>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.holds(CONDITION) {
        return cpu.next(rest);
    }
    cpu.branch(o.immediate);
    cpu.jumped(rest)
}

/// The branch of a condition.
pub(in crate::cpu) fn branch_if_of<B: Bus>(condition: u32) -> Execute<B> {
    by_condition!(branch_if, condition)
}

/// CBZ; CBNZ with x = 1.
pub(in crate::cpu) fn branch_if_zero<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if (cpu.get(o.n) == 0) != (o.x == 0) {
        return cpu.next(rest);
    }
    cpu.branch(o.immediate);
    cpu.jumped(rest)
}

/// BL.
pub(in crate::cpu) fn call<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.settle_at(rest);
    cpu.r[14] = cpu.pc | 1;
    cpu.branch(o.immediate);
    cpu.jumped(rest)
}

/// BLX.
pub(in crate::cpu) fn call_register<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.settle_at(rest);
    let target = cpu.get(o.m);
    cpu.r[14] = cpu.pc | 1;
    if target & 1 == 0 {
        cpu.thumb = false;
        cpu.attention = 0;
    }
    cpu.branch(target & !1);
    cpu.jumped(rest)
}

/// BX.
pub(in crate::cpu) fn branch_register<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    cpu.branch_exchange(cpu.get(o.m))?;
    cpu.jumped(rest)
}

/// MOV to the program counter: no change of state.
pub(in crate::cpu) fn move_to_pc<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.branch(cpu.get(o.m) & !1);
    cpu.jumped(rest)
}

/// ADD to the program counter, which is `immediate`.
pub(in crate::cpu) fn add_to_pc<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.branch(o.immediate.wrapping_add(cpu.get(o.m)) & !1);
    cpu.jumped(rest)
}

/// TBB; TBH with x = 1. From `immediate`, a table at n or, with 15, behind the instruction.
pub(in crate::cpu) fn table<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    let start = if o.n == 15 { o.immediate } else { cpu.get(o.n) };
    let entry = match o.x {
        0 => cpu.load::<1>(start.wrapping_add(cpu.get(o.m)))?,
        _ => cpu.load::<2>(start.wrapping_add(cpu.get(o.m) << 1))?,
    };
    cpu.branch(o.immediate.wrapping_add(2 * entry));
    cpu.jumped(rest)
}

/// IT.
pub(in crate::cpu) fn it<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.settle_at(rest);
    cpu.it = o.x;
    cpu.jumped(rest)
}
