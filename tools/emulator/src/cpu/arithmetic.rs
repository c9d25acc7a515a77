//! Integer arithmetic of the architecture as pure functions: addition with carry, shifts, saturation, the expanded
//! constant.
//!
//! From the pseudo-code of ARM DDI 0403 (ARMv7-M Architecture Reference Manual): A2.2.1, A5.3.2, A7.4.2, D6.5.

/// Sum, carry out and signed overflow (AddWithCarry).
#[inline(always)]
pub(super) fn add_with_carry(a: u32, b: u32, carry: bool) -> (u32, bool, bool) {
    let (partial, first) = a.overflowing_add(b);
    let (sum, second) = partial.overflowing_add(u32::from(carry));
    (sum, first | second, ((a ^ sum) & (b ^ sum)) >> 31 != 0)
}

/// The same without carry in, in the host's own terms.
#[inline(always)]
pub(super) fn add(a: u32, b: u32) -> (u32, bool, bool) {
    let (sum, carry) = a.overflowing_add(b);
    (sum, carry, (a as i32).overflowing_add(b as i32).1)
}

/// `a` - `b`: the sum of `a`, the complement of `b` and 1. The carry is what was not borrowed.
#[inline(always)]
pub(super) fn subtract(a: u32, b: u32) -> (u32, bool, bool) {
    let (difference, borrow) = a.overflowing_sub(b);
    (difference, !borrow, (a as i32).overflowing_sub(b as i32).1)
}

/// Shift of a register operand. As in the encodings, and one more for a rotation through the carry.
pub(super) const LEFT: u8 = 0;
pub(super) const RIGHT: u8 = 1;
pub(super) const ARITHMETIC: u8 = 2;
pub(super) const ROTATE: u8 = 3;
pub(super) const EXTEND: u8 = 4;

/// Shifted value and carry out (Shift_C). An amount of 0 leaves both; any amount up to 255 is defined.
#[inline(always)]
pub(super) fn shift(kind: u8, value: u32, amount: u32, carry: bool) -> (u32, bool) {
    if kind == EXTEND {
        return (value >> 1 | u32::from(carry) << 31, value & 1 != 0);
    }
    if amount == 0 {
        return (value, carry);
    }
    match kind {
        LEFT => {
            let wide = if amount > 32 { 0 } else { u64::from(value) << amount };
            (wide as u32, wide >> 32 & 1 != 0)
        }
        RIGHT => {
            let wide = if amount > 32 { 0 } else { (u64::from(value) << 32) >> amount };
            ((wide >> 32) as u32, wide >> 31 & 1 != 0)
        }
        ARITHMETIC => {
            let wide = (i64::from(value as i32) << 32) >> amount.min(32);
            ((wide >> 32) as u32, wide >> 31 & 1 != 0)
        }
        _ => {
            let rotated = value.rotate_right(amount & 31);
            (rotated, rotated >> 31 != 0)
        }
    }
}

/// Meaning of an immediate shift of five bits (DecodeImmShift): its kind and amount.
pub(super) fn immediate_shift(kind: u32, amount: u32) -> (u8, u32) {
    match (kind, amount) {
        (0, _) => (LEFT, amount),
        (1, 0) => (RIGHT, 32),
        (2, 0) => (ARITHMETIC, 32),
        (3, 0) => (EXTEND, 1),
        (1, _) => (RIGHT, amount),
        (2, _) => (ARITHMETIC, amount),
        _ => (ROTATE, amount),
    }
}

/// Effect of a constant on the carry of a logical operation.
pub(super) const CARRY_KEPT: u32 = 0;
pub(super) const CARRY_CLEARED: u32 = 1;
pub(super) const CARRY_SET: u32 = 2;

/// Constant and what it does to the carry, from twelve bits (ThumbExpandImm_C). None where that is unpredictable.
pub(super) fn expanded(bits: u32) -> Option<(u32, u32)> {
    let byte = bits & 0xff;
    if bits >> 10 != 0 {
        let value = (0x80 | bits & 0x7f).rotate_right(bits >> 7);
        return Some((value, if value >> 31 != 0 { CARRY_SET } else { CARRY_CLEARED }));
    }
    let pattern = bits >> 8 & 3;
    if pattern != 0 && byte == 0 {
        return None;
    }
    let value = match pattern {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        _ => byte * 0x0101_0101,
    };
    Some((value, CARRY_KEPT))
}

/// `value` within `bits` bits with sign, 1 to 32, and whether it was not (SignedSatQ).
#[inline(always)]
pub(super) fn saturate_signed(value: i64, bits: u32) -> (i32, bool) {
    let most = (1i64 << (bits - 1)) - 1;
    let kept = value.clamp(-most - 1, most);
    (kept as i32, kept != value)
}

/// `value` within `bits` bits without sign, 0 to 31, and whether it was not (UnsignedSatQ).
#[inline(always)]
pub(super) fn saturate_unsigned(value: i64, bits: u32) -> (u32, bool) {
    let kept = value.clamp(0, (1i64 << bits) - 1);
    (kept as u32, kept != value)
}

/// `value` of `bits` bits, 1 to 32, with its sign (SignExtend).
#[inline(always)]
pub(super) fn sign_extend(value: u32, bits: u32) -> u32 {
    let unused = 32 - bits;
    ((value << unused) as i32 >> unused) as u32
}
