//! Branches, calls, tables, IT.

use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::cpu::operation::{Operands, Trap};

/// To `immediate`.
pub(in crate::cpu) fn branch<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> Result<(), Trap> {
    cpu.branch(o.immediate);
    Ok(())
}

/// To `immediate` if condition x holds.
pub(in crate::cpu) fn branch_if<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> Result<(), Trap> {
    if cpu.holds(o.x) {
        cpu.branch(o.immediate);
    }
    Ok(())
}

/// CBZ; CBNZ with x = 1.
pub(in crate::cpu) fn branch_if_zero<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> Result<(), Trap> {
    if (cpu.get(o.n) == 0) == (o.x == 0) {
        cpu.branch(o.immediate);
    }
    Ok(())
}

/// BL.
pub(in crate::cpu) fn call<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> Result<(), Trap> {
    cpu.r[14] = cpu.pc | 1;
    cpu.branch(o.immediate);
    Ok(())
}

/// BLX.
pub(in crate::cpu) fn call_register<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> Result<(), Trap> {
    let target = cpu.get(o.m);
    cpu.r[14] = cpu.pc | 1;
    if target & 1 == 0 {
        cpu.thumb = false;
        cpu.attention = 0;
    }
    cpu.branch(target & !1);
    Ok(())
}

/// BX.
pub(in crate::cpu) fn branch_register<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> Result<(), Trap> {
    cpu.branch_exchange(cpu.get(o.m))
}

/// MOV to the program counter: no change of state.
pub(in crate::cpu) fn move_to_pc<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> Result<(), Trap> {
    cpu.branch(cpu.get(o.m) & !1);
    Ok(())
}

/// ADD to the program counter, which is `immediate`.
pub(in crate::cpu) fn add_to_pc<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> Result<(), Trap> {
    cpu.branch(o.immediate.wrapping_add(cpu.get(o.m)) & !1);
    Ok(())
}

/// TBB; TBH with x = 1. From `immediate`, a table at n or, with 15, behind the instruction.
pub(in crate::cpu) fn table<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> Result<(), Trap> {
    let start = if o.n == 15 { o.immediate } else { cpu.get(o.n) };
    let entry = match o.x {
        0 => cpu.load::<1>(start.wrapping_add(cpu.get(o.m)))?,
        _ => cpu.load::<2>(start.wrapping_add(cpu.get(o.m) << 1))?,
    };
    cpu.branch(o.immediate.wrapping_add(2 * entry));
    Ok(())
}

/// IT.
pub(in crate::cpu) fn it<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> Result<(), Trap> {
    cpu.it = o.x;
    Ok(())
}
