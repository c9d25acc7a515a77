//! Pairs of instructions that compilers put one behind the other, executed as one step of a stretch: a jump less whose
//! target the host has to guess, which takes longer than most of what the instructions do.
//!
//! Both remain steps of their own, and count as such: a stretch that ends between them executes the first alone. Moves
//! in IT blocks are one step with what decides them in the same way. Which of all these there are was chosen by how
//! often the boards' programs come across them.

use super::branch::branch_if_zero;
use super::data_processing::{ADD, CONSTANT, MOV, NEVER, OUTSIDE_IT, REGISTER, SUB, TEST, operate, set_upper_half};
use super::floating_point::{
    VADD, VMUL, compare, ready_first, take_flags, three_at_once, three_exactly, vcmp, vldr_at_once, vldr_elsewhere,
    vmov, vmov_at_once, vmrs_flags, vstr_at_once, vstr_elsewhere,
};
use super::load_store::{
    LDR, OFFSET, STR, access_at_once, access_elsewhere, store_several_at_once, store_several_elsewhere,
};
use super::system::nothing;
use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::cpu::operation::{Done, Execute, Operands, Part, Rest};

/// Function that executes two instructions one behind the other; none where they are no pair. `second` are the operands
/// of the second.
pub(in crate::cpu) fn pair_of<B: Bus>(parts: (Part, Part), second: Operands) -> Option<Execute<B>> {
    Some(match parts {
        (Part::CompareConstant, Part::Branch) => by_condition!(compare_constant_and_branch, second.x),
        (Part::CompareRegister, Part::Branch) => by_condition!(compare_register_and_branch, second.x),
        (Part::SubtractConstant, Part::Branch) => by_condition!(subtract_constant_and_branch, second.x),
        (Part::CompareFloats, Part::TakeFlags) => compare_and_take_flags,
        (Part::Constant, Part::UpperHalf) => both_halves,
        (Part::AddConstant, Part::LoadFloat) => add_and_load_float,
        (Part::Push, Part::AddConstant) => push_and_add,
        (Part::Float, Part::LoadFloat) => move_and_load_float,
        (Part::LoadFloat, Part::AddFloats) => load_and_add_floats,
        (Part::LoadFloat, Part::MultiplyFloats) => load_and_multiply_floats,
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

/// Function that executes a move of an IT block if a condition holds, beginning with the step before it; none where the
/// instruction is no move.
pub(in crate::cpu) fn conditional_of<B: Bus>(condition: u8, part: Part) -> Option<Execute<B>> {
    Some(match part {
        Part::Constant | Part::NarrowConstant => by_condition!(move_if<MOVE_CONSTANT>, condition),
        Part::Register => by_condition!(move_if<MOVE_REGISTER>, condition),
        Part::Float => by_condition!(move_if<MOVE_FLOAT>, condition),
        _ => return None,
    })
}

/// Function that sets the flags before such a move and executes it as well; none where `parts` are none of both. Of
/// VCMP, VMRS lies between.
pub(in crate::cpu) fn compared_of<B: Bus>(parts: (Part, Part), condition: u8) -> Option<Execute<B>> {
    macro_rules! what {
        ($flags:ident) => {
            match parts.1 {
                Part::Constant | Part::NarrowConstant => {
                    by_condition!(compare_and_move_if<$flags, MOVE_CONSTANT>, condition)
                }
                Part::Register => by_condition!(compare_and_move_if<$flags, MOVE_REGISTER>, condition),
                Part::Float => by_condition!(compare_and_move_if<$flags, MOVE_FLOAT>, condition),
                _ => return None,
            }
        };
    }
    Some(match parts.0 {
        Part::CompareConstant => what!(COMPARE_CONSTANT),
        Part::CompareRegister => what!(COMPARE_REGISTER),
        Part::TakeFlags => what!(TAKE_FLAGS),
        Part::CompareFloats => what!(COMPARE_FLOATS),
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

/// Two, each of them at once if that suffices, otherwise by a function that goes on by itself.
macro_rules! both {
    ($(#[$doc:meta])* $name:ident, $first:expr, $first_otherwise:expr, $second:expr, $second_otherwise:expr) => {
        $(#[$doc])*
        fn $name<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
            if !$first(cpu, o) {
                return $first_otherwise(cpu, o, rest);
            }
            let Some((second, behind)) = rest.split_first() else { return Ok(()) };
            if !$second(cpu, second.operands) {
                return $second_otherwise(cpu, second.operands, behind);
            }
            cpu.next(behind)
        }
    };
}

/// The same of two of a kind.
macro_rules! twice {
    ($(#[$doc:meta])* $name:ident, $at_once:expr, $otherwise:expr) => {
        both!($(#[$doc])* $name, $at_once, $otherwise, $at_once, $otherwise);
    };
}

/// ADD of a constant: always at once.
fn add_constant<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> bool {
    operate::<B, ADD, CONSTANT, NEVER>(cpu, o);
    true
}

both! {
    /// ADD of a constant, and VLDR.
    add_and_load_float, add_constant, nothing, vldr_at_once, vldr_elsewhere
}
both! {
    /// PUSH, and ADD of a constant.
    push_and_add, store_several_at_once, store_several_elsewhere, add_constant, nothing
}
both! {
    /// VMOV, and VLDR.
    move_and_load_float, vmov_at_once, |cpu, o, rest| ready_first(cpu, o, rest, vmov), vldr_at_once, vldr_elsewhere
}
both! {
    /// VLDR, and VADD.
    load_and_add_floats, vldr_at_once, vldr_elsewhere, three_at_once::<B, VADD>, three_exactly::<B, VADD>
}
both! {
    /// VLDR, and VMUL.
    load_and_multiply_floats, vldr_at_once, vldr_elsewhere, three_at_once::<B, VMUL>, three_exactly::<B, VMUL>
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

/// Operand that is moved if a condition holds: a constant, a register, a floating-point register.
const MOVE_CONSTANT: u8 = 0;
const MOVE_REGISTER: u8 = 1;
const MOVE_FLOAT: u8 = 2;

/// Instruction that sets the flags before: CMP with a constant, CMP of registers, VMRS, VCMP and VMRS.
const COMPARE_CONSTANT: u8 = 0;
const COMPARE_REGISTER: u8 = 1;
const TAKE_FLAGS: u8 = 2;
const COMPARE_FLOATS: u8 = 3;

/// MOV or VMOV in an IT block: the step before it.
fn move_if<B: Bus, const WHAT: u8, const CONDITION: u8>(cpu: &mut Cpu<B>, _: Operands, rest: Rest<B>) -> Done {
    let Some((second, behind)) = rest.split_first() else { return Ok(()) };
    if cpu.holds(CONDITION) {
        match WHAT {
            MOVE_CONSTANT => operate::<B, MOV, CONSTANT, NEVER>(cpu, second.operands),
            MOVE_REGISTER => operate::<B, MOV, REGISTER, NEVER>(cpu, second.operands),
            _ if vmov_at_once(cpu, second.operands) => {}
            _ => return ready_first(cpu, second.operands, behind, vmov),
        }
    }
    cpu.next(behind)
}

/// Execution of what sets the flags, and of such a move behind it.
fn compare_and_move_if<B: Bus, const FLAGS: u8, const WHAT: u8, const CONDITION: u8>(
    cpu: &mut Cpu<B>,
    o: Operands,
    rest: Rest<B>,
) -> Done {
    let mut rest = rest;
    match FLAGS {
        COMPARE_CONSTANT => operate::<B, SUB, CONSTANT, TEST>(cpu, o),
        COMPARE_REGISTER => operate::<B, SUB, REGISTER, TEST>(cpu, o),
        TAKE_FLAGS if cpu.floating_ready => take_flags(cpu),
        TAKE_FLAGS => return ready_first(cpu, o, rest, vmrs_flags),
        _ if cpu.floating_ready => {
            compare(cpu, o);
            let Some((_, behind)) = rest.split_first() else { return Ok(()) };
            take_flags(cpu);
            rest = behind;
        }
        _ => return ready_first(cpu, o, rest, vcmp),
    }
    let Some((_, rest)) = rest.split_first() else { return Ok(()) };
    move_if::<B, WHAT, CONDITION>(cpu, o, rest)
}
