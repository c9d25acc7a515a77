//! Pairs of instructions that compilers put one behind the other, executed as one step of a stretch: a jump less that the host has to guess.
//!
//! Both remain steps of their own, and count as such: a stretch that ends between them executes the first alone.

use super::data_processing::{CONSTANT, REGISTER, SUB, TEST, operate};
use super::floating_point::{compare, ready_first, take_flags};
use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::cpu::operation::{Done, Execute, Operands, Part, Rest};

/// What executes two instructions one behind the other; none where they are no pair. `second` are the operands of the second.
pub(in crate::cpu) fn pair_of<B: Bus>(parts: (Part, Part), second: Operands) -> Option<Execute<B>> {
    Some(match parts {
        (Part::CompareConstant, Part::Branch) => by_condition!(compare_constant_and_branch, second.x),
        (Part::CompareRegister, Part::Branch) => by_condition!(compare_register_and_branch, second.x),
        (Part::CompareFloats, Part::TakeFlags) => compare_and_take_flags,
        _ => return None,
    })
}

/// CMP with a constant, and a branch.
fn compare_constant_and_branch<B: Bus, const CONDITION: u8>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    operate::<B, SUB, CONSTANT, TEST>(cpu, o);
    branch_if::<B, CONDITION>(cpu, rest)
}

/// CMP of registers, and a branch.
fn compare_register_and_branch<B: Bus, const CONDITION: u8>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    operate::<B, SUB, REGISTER, TEST>(cpu, o);
    branch_if::<B, CONDITION>(cpu, rest)
}

/// The second half: what follows begins with the branch.
#[inline(always)]
fn branch_if<B: Bus, const CONDITION: u8>(cpu: &mut Cpu<B>, rest: Rest<B>) -> Done {
    let Some((branch, behind)) = rest.split_first() else { return Ok(()) };
    if !cpu.holds(CONDITION) {
        return cpu.next(behind);
    }
    cpu.branch(branch.operands.immediate);
    cpu.jumped(behind)
}

/// VCMP, and VMRS of its flags.
fn compare_and_take_flags<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, compare_and_take_flags);
    }
    compare(cpu, o);
    let Some((_, behind)) = rest.split_first() else { return Ok(()) };
    take_flags(cpu);
    cpu.next(behind)
}
