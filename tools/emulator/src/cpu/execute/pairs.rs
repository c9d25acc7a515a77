//! Pairs of instructions that compilers put one behind the other, executed as one step of a stretch: a jump less whose target the host has to
//! guess, which takes longer than most of what the instructions do.
//!
//! Both remain steps of their own, and count as such: a stretch that ends between them executes the first alone. Which pairs there are was
//! chosen by how often the boards' programs come across them.

use super::branch::branch_if_zero;
use super::data_processing::{ADD, CONSTANT, MOV, NEVER, OUTSIDE_IT, REGISTER, SUB, TEST, operate, set_upper_half};
use super::floating_point::{
    VMUL, compare, ready_first, take_flags, three_at_once, three_exactly, vldr_at_once, vldr_elsewhere, vmov,
    vmov_at_once, vstr_at_once, vstr_elsewhere,
};
use super::load_store::{LDR, OFFSET, STR, access_at_once, access_elsewhere};
use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::cpu::operation::{Done, Execute, Operands, Part, Rest};

/// What executes two instructions one behind the other; none where they are no pair. `second` are the operands of the second.
pub(in crate::cpu) fn pair_of<B: Bus>(parts: (Part, Part), second: Operands) -> Option<Execute<B>> {
    Some(match parts {
        (Part::CompareConstant, Part::Branch) => by_condition!(compare_constant_and_branch, second.x),
        (Part::CompareRegister, Part::Branch) => by_condition!(compare_register_and_branch, second.x),
        (Part::SubtractConstant, Part::Branch) => by_condition!(subtract_constant_and_branch, second.x),
        (Part::CompareFloats, Part::TakeFlags) => compare_and_take_flags,
        (Part::Constant, Part::UpperHalf) => both_halves,
        (Part::AddConstant, Part::LoadFloat) => add_and_load_float,
        (Part::Load, Part::Load) => load_twice,
        (Part::Store, Part::Store) => store_twice,
        (Part::LoadFloat, Part::LoadFloat) => load_floats,
        (Part::StoreFloat, Part::StoreFloat) => store_floats,
        (Part::Float, Part::Float) => move_floats,
        (Part::MultiplyFloats, Part::MultiplyFloats) => multiply_floats,
        (Part::Nothing, Part::BranchIfZero) => nothing_and_branch,
        _ => return None,
    })
}

/// What executes an instruction of an IT block if a condition holds; none where it takes more than that.
pub(in crate::cpu) fn conditional_of<B: Bus>(condition: u8, part: Part) -> Option<Execute<B>> {
    Some(match part {
        Part::Constant | Part::NarrowConstant => by_condition!(constant_if, condition),
        Part::Register => by_condition!(register_if, condition),
        Part::Float => by_condition!(float_if, condition),
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

/// SUBS of a constant, and a branch.
fn subtract_constant_and_branch<B: Bus, const CONDITION: u8>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    operate::<B, SUB, CONSTANT, OUTSIDE_IT>(cpu, o);
    branch_if::<B, CONDITION>(cpu, rest)
}

/// The second of those; what follows begins with it.
#[inline(always)]
fn branch_if<B: Bus, const CONDITION: u8>(cpu: &mut Cpu<B>, rest: Rest<B>) -> Done {
    let Some((branch, behind)) = rest.split_first() else { return Ok(()) };
    if !cpu.holds(CONDITION) {
        return cpu.next(behind);
    }
    cpu.branch(branch.operands.immediate);
    cpu.jumped(behind)
}

/// A barrier, and CBZ.
fn nothing_and_branch<B: Bus>(cpu: &mut Cpu<B>, _: Operands, rest: Rest<B>) -> Done {
    let Some((branch, behind)) = rest.split_first() else { return Ok(()) };
    branch_if_zero(cpu, branch.operands, behind)
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

/// MOVW, and MOVT.
fn both_halves<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    operate::<B, MOV, CONSTANT, NEVER>(cpu, o);
    let Some((second, behind)) = rest.split_first() else { return Ok(()) };
    set_upper_half(cpu, second.operands);
    cpu.next(behind)
}

/// ADD of a constant, and VLDR.
fn add_and_load_float<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    operate::<B, ADD, CONSTANT, NEVER>(cpu, o);
    let Some((second, behind)) = rest.split_first() else { return Ok(()) };
    match vldr_at_once(cpu, second.operands) {
        true => cpu.next(behind),
        false => vldr_elsewhere(cpu, second.operands, behind),
    }
}

/// Two of a kind: `at_once` if that suffices, `otherwise` if not.
macro_rules! twice {
    ($(#[$doc:meta])* $name:ident, $at_once:expr, $otherwise:expr) => {
        $(#[$doc])*
        fn $name<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
            if !$at_once(cpu, o) {
                return $otherwise(cpu, o, rest);
            }
            let Some((second, behind)) = rest.split_first() else { return Ok(()) };
            if !$at_once(cpu, second.operands) {
                return $otherwise(cpu, second.operands, behind);
            }
            cpu.next(behind)
        }
    };
}

twice! {
    /// LDR, twice.
    load_twice, access_at_once::<B, LDR, OFFSET>, access_elsewhere::<B, LDR, OFFSET>
}
twice! {
    /// STR, twice.
    store_twice, access_at_once::<B, STR, OFFSET>, access_elsewhere::<B, STR, OFFSET>
}
twice! {
    /// VLDR, twice.
    load_floats, vldr_at_once, vldr_elsewhere
}
twice! {
    /// VSTR, twice.
    store_floats, vstr_at_once, vstr_elsewhere
}
twice! {
    /// VMUL, twice.
    multiply_floats, three_at_once::<B, VMUL>, three_exactly::<B, VMUL>
}
twice! {
    /// VMOV, twice.
    move_floats, vmov_at_once, |cpu, o, rest| ready_first(cpu, o, rest, vmov)
}

/// MOV of a constant, in an IT block.
fn constant_if<B: Bus, const CONDITION: u8>(cpu: &mut Cpu<B>, _: Operands, rest: Rest<B>) -> Done {
    let Some((second, behind)) = rest.split_first() else { return Ok(()) };
    if cpu.holds(CONDITION) {
        operate::<B, MOV, CONSTANT, NEVER>(cpu, second.operands);
    }
    cpu.next(behind)
}

/// MOV of a register, in an IT block.
fn register_if<B: Bus, const CONDITION: u8>(cpu: &mut Cpu<B>, _: Operands, rest: Rest<B>) -> Done {
    let Some((second, behind)) = rest.split_first() else { return Ok(()) };
    if cpu.holds(CONDITION) {
        operate::<B, MOV, REGISTER, NEVER>(cpu, second.operands);
    }
    cpu.next(behind)
}

/// VMOV, in an IT block.
fn float_if<B: Bus, const CONDITION: u8>(cpu: &mut Cpu<B>, _: Operands, rest: Rest<B>) -> Done {
    let Some((second, behind)) = rest.split_first() else { return Ok(()) };
    if cpu.holds(CONDITION) && !vmov_at_once(cpu, second.operands) {
        return ready_first(cpu, second.operands, behind, vmov);
    }
    cpu.next(behind)
}
