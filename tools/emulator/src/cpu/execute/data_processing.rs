//! Arithmetic, logic, shifts, moves, bit fields, extensions, reversals.

use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::cpu::arithmetic::{
    ARITHMETIC, CARRY_CLEARED, CARRY_KEPT, EXTEND, LEFT, RIGHT, ROTATE, add, add_with_carry, shift, sign_extend,
    subtract,
};
use crate::cpu::operation::{Done, Execute, Operands, Rest};

/// Operations, as wide encodings number them.
pub(in crate::cpu) const AND: u8 = 0;
pub(in crate::cpu) const BIC: u8 = 1;
pub(in crate::cpu) const ORR: u8 = 2;
pub(in crate::cpu) const ORN: u8 = 3;
pub(in crate::cpu) const EOR: u8 = 4;
pub(in crate::cpu) const ADD: u8 = 8;
pub(in crate::cpu) const ADC: u8 = 10;
pub(in crate::cpu) const SBC: u8 = 11;
pub(in crate::cpu) const SUB: u8 = 13;
pub(in crate::cpu) const RSB: u8 = 14;
/// Numbers that the encodings leave free: the second operand alone, and its complement; a multiplication, which narrow
/// code numbers here.
pub(in crate::cpu) const MOV: u8 = 5;
pub(in crate::cpu) const MVN: u8 = 6;
pub(in crate::cpu) const MUL: u8 = 7;

/// Condition on which flags are set.
pub(in crate::cpu) const NEVER: u8 = 0;
pub(in crate::cpu) const ALWAYS: u8 = 1;
pub(in crate::cpu) const OUTSIDE_IT: u8 = 2;
/// Flags alone, no result.
pub(in crate::cpu) const TEST: u8 = 3;

/// Source of the second operand: `immediate` with `x` for the carry; register m; register m shifted by `immediate`,
/// with kind `x`.
pub(in crate::cpu) const CONSTANT: u8 = 0;
pub(in crate::cpu) const REGISTER: u8 = 1;
pub(in crate::cpu) const SHIFTED: u8 = 2;

/// d = n operation second operand.
pub(in crate::cpu) fn data<B: Bus, const OPERATION: u8, const SECOND: u8, const FLAGS: u8>(
    cpu: &mut Cpu<B>,
    o: Operands,
    rest: Rest<B>,
) -> Done {
    operate::<B, OPERATION, SECOND, FLAGS>(cpu, o);
    cpu.next(rest)
}

/// The operation alone.
#[inline(always)]
pub(super) fn operate<B: Bus, const OPERATION: u8, const SECOND: u8, const FLAGS: u8>(cpu: &mut Cpu<B>, o: Operands) {
    let (second, carry) = match SECOND {
        CONSTANT => match u32::from(o.x) {
            CARRY_KEPT => (o.immediate, cpu.carry),
            action => (o.immediate, action != CARRY_CLEARED),
        },
        REGISTER => (cpu.get(o.m), cpu.carry),
        _ => shift(o.x, cpu.get(o.m), o.immediate, cpu.carry),
    };
    let first = cpu.get(o.n);
    let logical = |result: u32| (result, carry, cpu.overflow);
    let (result, carry, overflow) = match OPERATION {
        AND => logical(first & second),
        BIC => logical(first & !second),
        ORR => logical(first | second),
        ORN => logical(first | !second),
        EOR => logical(first ^ second),
        MOV => logical(second),
        MVN => logical(!second),
        MUL => logical(first.wrapping_mul(second)),
        ADD => add(first, second),
        ADC => add_with_carry(first, second, cpu.carry),
        SBC => add_with_carry(first, !second, cpu.carry),
        SUB => subtract(first, second),
        _ => subtract(second, first),
    };
    if FLAGS == ALWAYS || FLAGS == TEST || FLAGS == OUTSIDE_IT && !o.is_in_block() {
        cpu.set_negative_zero(result);
        (cpu.carry, cpu.overflow) = (carry, overflow);
    }
    if FLAGS != TEST {
        cpu.set_any(o.d, result);
    }
}

/// Shifts n by the lowest byte of m.
pub(in crate::cpu) fn shift_register<B: Bus, const KIND: u8, const FLAGS: u8>(
    cpu: &mut Cpu<B>,
    o: Operands,
    rest: Rest<B>,
) -> Done {
    let (result, carry) = shift(KIND, cpu.get(o.n), cpu.get(o.m) & 0xff, cpu.carry);
    if FLAGS == ALWAYS || FLAGS == OUTSIDE_IT && !o.is_in_block() {
        cpu.set_negative_zero(result);
        cpu.carry = carry;
    }
    cpu.set(o.d, result);
    cpu.next(rest)
}

/// Shifts m by a constant: `SHIFTED` MOV with the kind known.
pub(in crate::cpu) fn shift_immediate<B: Bus, const KIND: u8, const FLAGS: u8>(
    cpu: &mut Cpu<B>,
    o: Operands,
    rest: Rest<B>,
) -> Done {
    let (result, carry) = shift(KIND, cpu.get(o.m), o.immediate, cpu.carry);
    if FLAGS == ALWAYS || FLAGS == OUTSIDE_IT && !o.is_in_block() {
        cpu.set_negative_zero(result);
        cpu.carry = carry;
    }
    cpu.set(o.d, result);
    cpu.next(rest)
}

/// ADDW, SUBW, ADR, ADD to the stack pointer: no flags.
pub(in crate::cpu) fn add_immediate<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let sum = cpu.get(o.n).wrapping_add(o.immediate);
    cpu.set_any(o.d, sum);
    cpu.next(rest)
}

/// MOVW, and what the program counter adds to.
pub(in crate::cpu) fn constant<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.set_any(o.d, o.immediate);
    cpu.next(rest)
}

pub(in crate::cpu) fn movt<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    set_upper_half(cpu, o);
    cpu.next(rest)
}

/// MOVT alone.
#[inline(always)]
pub(super) fn set_upper_half<B: Bus>(cpu: &mut Cpu<B>, o: Operands) {
    let value = cpu.get(o.d) & 0xffff | o.immediate << 16;
    cpu.set(o.d, value);
}

/// Lowest `width` bits.
fn mask(width: u8) -> u32 {
    u32::MAX >> (32 - u32::from(width.clamp(1, 32)))
}

/// BFI; BFC has 15 as n. The lowest bit is m, the width x.
pub(in crate::cpu) fn bfi<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let field = mask(o.x) << (o.m & 31);
    let inserted = if o.n == 15 { 0 } else { cpu.get(o.n) << (o.m & 31) };
    let value = cpu.get(o.d) & !field | inserted & field;
    cpu.set(o.d, value);
    cpu.next(rest)
}

pub(in crate::cpu) fn ubfx<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let value = cpu.get(o.n) >> (o.m & 31) & mask(o.x);
    cpu.set(o.d, value);
    cpu.next(rest)
}

pub(in crate::cpu) fn sbfx<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let value = sign_extend(cpu.get(o.n) >> (o.m & 31), u32::from(o.x.clamp(1, 32)));
    cpu.set(o.d, value);
    cpu.next(rest)
}

/// Part that is extended: the numbers of the wide encodings.
pub(in crate::cpu) const HALF_SIGNED: u8 = 0;
pub(in crate::cpu) const HALF_UNSIGNED: u8 = 1;
pub(in crate::cpu) const BYTES_SIGNED: u8 = 2;
pub(in crate::cpu) const BYTES_UNSIGNED: u8 = 3;
pub(in crate::cpu) const BYTE_SIGNED: u8 = 4;

/// SXTH and its like, with rotation by `immediate`; n is added where it is not 15.
pub(in crate::cpu) fn extend<B: Bus, const KIND: u8>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let value = cpu.get(o.m).rotate_right(o.immediate);
    let base = if o.n == 15 { 0 } else { cpu.get(o.n) };
    let halves =
        |low: u32, high: u32| (base & 0xffff).wrapping_add(low) & 0xffff | (base >> 16).wrapping_add(high) << 16;
    let result = match KIND {
        HALF_SIGNED => base.wrapping_add(sign_extend(value, 16)),
        HALF_UNSIGNED => base.wrapping_add(value & 0xffff),
        BYTES_SIGNED => halves(sign_extend(value, 8), sign_extend(value >> 16, 8)),
        BYTES_UNSIGNED => halves(value & 0xff, value >> 16 & 0xff),
        BYTE_SIGNED => base.wrapping_add(sign_extend(value, 8)),
        _ => base.wrapping_add(value & 0xff),
    };
    cpu.set(o.d, result);
    cpu.next(rest)
}

/// REV, REV16, RBIT, REVSH: as wide encodings number them.
pub(in crate::cpu) fn reverse<B: Bus, const KIND: u8>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let value = cpu.get(o.m);
    let result = match KIND {
        0 => value.swap_bytes(),
        1 => value.swap_bytes().rotate_right(16),
        2 => value.reverse_bits(),
        _ => sign_extend(u32::from((value as u16).swap_bytes()), 16),
    };
    cpu.set(o.d, result);
    cpu.next(rest)
}

pub(in crate::cpu) fn clz<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let zeros = cpu.get(o.m).leading_zeros();
    cpu.set(o.d, zeros);
    cpu.next(rest)
}

/// PKHBT, PKHTB (x = 1); the kind of the shift follows.
pub(in crate::cpu) fn pkh<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let kind = if o.x == 0 { LEFT } else { ARITHMETIC };
    let (shifted, _) = shift(kind, cpu.get(o.m), o.immediate, false);
    let first = cpu.get(o.n);
    let result = if o.x == 0 { shifted & 0xffff_0000 | first & 0xffff } else { first & 0xffff_0000 | shifted & 0xffff };
    cpu.set(o.d, result);
    cpu.next(rest)
}

/// The shift of a kind that only decoding knows.
macro_rules! by_kind {
    ($function:ident, $flags:ident, $kind:expr) => {
        match $kind {
            LEFT => $function::<B, LEFT, $flags>,
            RIGHT => $function::<B, RIGHT, $flags>,
            ARITHMETIC => $function::<B, ARITHMETIC, $flags>,
            ROTATE => $function::<B, ROTATE, $flags>,
            _ => $function::<B, EXTEND, $flags>,
        }
    };
}

pub(in crate::cpu) fn shift_register_of<B: Bus>(kind: u8, flags: u8) -> Execute<B> {
    match flags {
        NEVER => by_kind!(shift_register, NEVER, kind),
        ALWAYS => by_kind!(shift_register, ALWAYS, kind),
        _ => by_kind!(shift_register, OUTSIDE_IT, kind),
    }
}

pub(in crate::cpu) fn shift_immediate_of<B: Bus>(kind: u8, flags: u8) -> Execute<B> {
    match flags {
        NEVER => by_kind!(shift_immediate, NEVER, kind),
        ALWAYS => by_kind!(shift_immediate, ALWAYS, kind),
        _ => by_kind!(shift_immediate, OUTSIDE_IT, kind),
    }
}

/// The function of an operation, with the second operand and the flags that only decoding knows.
pub(in crate::cpu) fn data_of<B: Bus>(operation: u8, second: u8, flags: u8) -> Execute<B> {
    macro_rules! flags {
        ($operation:ident, $second:ident) => {
            match flags {
                NEVER => data::<B, $operation, $second, NEVER>,
                ALWAYS => data::<B, $operation, $second, ALWAYS>,
                TEST => data::<B, $operation, $second, TEST>,
                _ => data::<B, $operation, $second, OUTSIDE_IT>,
            }
        };
    }
    macro_rules! second {
        ($operation:ident) => {
            match second {
                CONSTANT => flags!($operation, CONSTANT),
                REGISTER => flags!($operation, REGISTER),
                _ => flags!($operation, SHIFTED),
            }
        };
    }
    match operation {
        AND => second!(AND),
        BIC => second!(BIC),
        ORR => second!(ORR),
        ORN => second!(ORN),
        EOR => second!(EOR),
        MOV => second!(MOV),
        MVN => second!(MVN),
        MUL => second!(MUL),
        ADD => second!(ADD),
        ADC => second!(ADC),
        SBC => second!(SBC),
        SUB => second!(SUB),
        _ => second!(RSB),
    }
}
