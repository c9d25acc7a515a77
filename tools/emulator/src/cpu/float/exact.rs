//! The operations by integers: exact results, rounded once (FPUnpack, FPProcessNaNs, FPRound of ARM DDI 0403, A2.5).

use super::{
    DEFAULT_NAN, DEFAULT_NAN_MODE, DIVISION_BY_ZERO, INEXACT, INPUT_DENORMAL, INVALID, OVERFLOW, Rounding, Status,
    UNDERFLOW,
};

/// A format: bits of the fraction, exponent of the smallest normal number, greatest exponent field.
#[derive(Clone, Copy)]
pub(super) struct Format {
    pub fraction: u32,
    pub least: i32,
    pub full: i32,
}

pub(super) const SINGLE: Format = Format { fraction: 23, least: -126, full: 255 };
pub(super) const HALF: Format = Format { fraction: 10, least: -14, full: 31 };

/// A number that is not a NaN. A finite one is `mantissa` 2^`exponent`.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    Finite { exponent: i32, mantissa: u64 },
    Infinite,
}

#[derive(Clone, Copy)]
pub(super) struct Number {
    pub negative: bool,
    pub kind: Kind,
}

impl Number {
    fn is_zero(self) -> bool {
        matches!(self.kind, Kind::Finite { mantissa: 0, .. })
    }
}

pub(super) fn sign(negative: bool) -> u32 {
    u32::from(negative) << 31
}

const INFINITY: u32 = 0x7f80_0000;

/// A denormal number as zero where the mode says so, which is flagged.
pub(super) fn flushed(bits: u32, status: &mut Status) -> u32 {
    if status.flushes() && bits & INFINITY == 0 && bits & 0x7f_ffff != 0 {
        status.flag(INPUT_DENORMAL);
        return bits & 0x8000_0000;
    }
    bits
}

fn is_nan(bits: u32) -> bool {
    bits & 0x7fff_ffff > INFINITY
}

fn is_signalling(bits: u32) -> bool {
    is_nan(bits) && bits & 0x40_0000 == 0
}

/// A number of bits that are no NaN and already flushed.
pub(super) fn unpack(bits: u32) -> Number {
    let negative = bits >> 31 != 0;
    let fraction = u64::from(bits & 0x7f_ffff);
    let kind = match (bits >> 23 & 0xff) as i32 {
        0 => Kind::Finite { exponent: -149, mantissa: fraction },
        255 => Kind::Infinite,
        exponent => Kind::Finite { exponent: exponent - 150, mantissa: fraction | 1 << 23 },
    };
    Number { negative, kind }
}

/// FPProcessNaN.
fn quieted(bits: u32, status: &mut Status) -> u32 {
    if is_signalling(bits) {
        status.flag(INVALID);
    }
    if status.0 & DEFAULT_NAN_MODE != 0 { DEFAULT_NAN } else { bits | 0x40_0000 }
}

/// FPProcessNaNs: the first signalling operand, otherwise the first quiet one.
fn chosen_nan<const N: usize>(operands: [u32; N], status: &mut Status) -> Option<u32> {
    let signalling = operands.into_iter().find(|bits| is_signalling(*bits));
    let nan = signalling.or_else(|| operands.into_iter().find(|bits| is_nan(*bits)))?;
    Some(quieted(nan, status))
}

pub(super) fn invalid(status: &mut Status) -> u32 {
    status.flag(INVALID);
    DEFAULT_NAN
}

/// Rounds `mantissa` 2^`exponent`, of which the lowest bit may stand for anything below it (FPRound). Not 0.
pub(super) fn round(negative: bool, exponent: i32, mantissa: u128, status: &mut Status) -> u32 {
    let top = 127 - mantissa.leading_zeros() as i32;
    if status.flushes() && top + exponent < SINGLE.least {
        status.flag(UNDERFLOW);
        return sign(negative);
    }
    let rounding = status.rounding();
    let (bits, overflows) = round_to(SINGLE, rounding, negative, exponent, mantissa, status);
    if !overflows {
        return sign(negative) | bits;
    }
    status.flag(OVERFLOW | INEXACT);
    let away = match rounding {
        Rounding::Nearest => true,
        Rounding::Up => !negative,
        Rounding::Down => negative,
        Rounding::Zero => false,
    };
    sign(negative) | if away { INFINITY } else { INFINITY - 1 }
}

/// Exponent and fraction without sign, and whether that is more than the format has; underflow and inexactness are
/// flagged, unless it overflows.
pub(super) fn round_to(
    format: Format,
    rounding: Rounding,
    negative: bool,
    exponent: i32,
    mantissa: u128,
    status: &mut Status,
) -> (u32, bool) {
    let top = 127 - mantissa.leading_zeros() as i32;
    let magnitude = top + exponent;
    let dropped = magnitude.max(format.least) - format.fraction as i32 - exponent;
    let (kept, inexact) = shifted(mantissa, dropped, rounding, negative);
    // A carry out of the fraction makes the exponent one greater by itself.
    let bits = match magnitude < format.least {
        true => kept as i64,
        false => i64::from(magnitude - format.least) * (1 << format.fraction) + kept as i64,
    };
    let overflows = bits >> format.fraction >= i64::from(format.full);
    if !overflows && inexact {
        status.flag(INEXACT | if magnitude < format.least { UNDERFLOW } else { 0 });
    }
    (bits as u32, overflows)
}

/// `mantissa` 2^-`dropped` as an integer, and whether it was none.
pub(super) fn shifted(mantissa: u128, dropped: i32, rounding: Rounding, negative: bool) -> (u128, bool) {
    if dropped <= 0 {
        return (mantissa << -dropped, false);
    }
    let (kept, rest, half) = match dropped {
        0..=127 => (mantissa >> dropped, mantissa & ((1 << dropped) - 1), 1u128 << (dropped - 1)),
        // Less than a half, whatever it is.
        _ => (0, u128::from(mantissa != 0), u128::MAX),
    };
    let up = match rounding {
        Rounding::Nearest => rest > half || rest == half && kept & 1 == 1,
        Rounding::Up => !negative && rest != 0,
        Rounding::Down => negative && rest != 0,
        Rounding::Zero => false,
    };
    (kept + u128::from(up), rest != 0)
}

/// Sum of two finite numbers. Mantissas have at most 48 bits.
fn sum(a: (bool, i32, u64), b: (bool, i32, u64), status: &mut Status) -> u32 {
    // A zero says nothing about the exponent.
    let exponent = |(_, exponent, mantissa): (bool, i32, u64)| if mantissa == 0 { i32::MIN / 4 } else { exponent };
    let (high, low) = if exponent(a) >= exponent(b) { (a, b) } else { (b, a) };
    if high.2 == 0 {
        let negative = if a.0 == b.0 { a.0 } else { status.rounding() == Rounding::Down };
        return sign(negative);
    }
    let distance = exponent(high) - exponent(low);
    // Shift as far as fits; what is below that only has to be told from nothing.
    let up = distance.min(76);
    let rest = distance - up;
    let low_part = match rest {
        0 => i128::from(low.2),
        1..=63 => i128::from(low.2 >> rest | u64::from(low.2 & ((1 << rest) - 1) != 0)),
        _ => i128::from(low.2 != 0),
    };
    let signed = |negative: bool, value: i128| if negative { -value } else { value };
    let total = signed(high.0, i128::from(high.2) << up) + signed(low.0, low_part);
    if total == 0 {
        return sign(status.rounding() == Rounding::Down);
    }
    round(total < 0, high.1 - up, total.unsigned_abs(), status)
}

pub(super) fn add(a: u32, b: u32, status: &mut Status) -> u32 {
    let (a, b) = (flushed(a, status), flushed(b, status));
    if let Some(nan) = chosen_nan([a, b], status) {
        return nan;
    }
    add_numbers(unpack(a), unpack(b), status)
}

pub(super) fn subtract(a: u32, b: u32, status: &mut Status) -> u32 {
    let (a, b) = (flushed(a, status), flushed(b, status));
    if let Some(nan) = chosen_nan([a, b], status) {
        return nan;
    }
    let b = unpack(b);
    add_numbers(unpack(a), Number { negative: !b.negative, ..b }, status)
}

fn add_numbers(a: Number, b: Number, status: &mut Status) -> u32 {
    match (a.kind, b.kind) {
        (Kind::Infinite, Kind::Infinite) if a.negative != b.negative => invalid(status),
        (Kind::Infinite, _) => sign(a.negative) | INFINITY,
        (_, Kind::Infinite) => sign(b.negative) | INFINITY,
        (Kind::Finite { exponent: ea, mantissa: ma }, Kind::Finite { exponent: eb, mantissa: mb }) => {
            sum((a.negative, ea, ma), (b.negative, eb, mb), status)
        }
    }
}

pub(super) fn multiply(a: u32, b: u32, status: &mut Status) -> u32 {
    let (a, b) = (flushed(a, status), flushed(b, status));
    if let Some(nan) = chosen_nan([a, b], status) {
        return nan;
    }
    let (a, b) = (unpack(a), unpack(b));
    let negative = a.negative != b.negative;
    match (a.kind, b.kind) {
        (Kind::Infinite, _) if b.is_zero() => invalid(status),
        (_, Kind::Infinite) if a.is_zero() => invalid(status),
        (Kind::Infinite, _) | (_, Kind::Infinite) => sign(negative) | INFINITY,
        (Kind::Finite { exponent: ea, mantissa: ma }, Kind::Finite { exponent: eb, mantissa: mb }) => {
            match u128::from(ma) * u128::from(mb) {
                0 => sign(negative),
                product => round(negative, ea + eb, product, status),
            }
        }
    }
}

pub(super) fn divide(a: u32, b: u32, status: &mut Status) -> u32 {
    let (a, b) = (flushed(a, status), flushed(b, status));
    if let Some(nan) = chosen_nan([a, b], status) {
        return nan;
    }
    let (a, b) = (unpack(a), unpack(b));
    let negative = a.negative != b.negative;
    match (a.kind, b.kind) {
        (Kind::Infinite, Kind::Infinite) => invalid(status),
        (Kind::Infinite, _) => sign(negative) | INFINITY,
        (_, Kind::Infinite) => sign(negative),
        _ if a.is_zero() && b.is_zero() => invalid(status),
        _ if a.is_zero() => sign(negative),
        _ if b.is_zero() => {
            status.flag(DIVISION_BY_ZERO);
            sign(negative) | INFINITY
        }
        (Kind::Finite { exponent: ea, mantissa: ma }, Kind::Finite { exponent: eb, mantissa: mb }) => {
            // More bits than any quotient keeps, and one for the remainder.
            let (dividend, divisor) = (u128::from(ma) << 60, u128::from(mb));
            let quotient = (dividend / divisor) << 1 | u128::from(!dividend.is_multiple_of(divisor));
            round(negative, ea - eb - 61, quotient, status)
        }
    }
}

pub(super) fn square_root(a: u32, status: &mut Status) -> u32 {
    let a = flushed(a, status);
    if let Some(nan) = chosen_nan([a], status) {
        return nan;
    }
    let number = unpack(a);
    match number.kind {
        _ if number.is_zero() => sign(number.negative),
        _ if number.negative => invalid(status),
        Kind::Infinite => INFINITY,
        Kind::Finite { exponent, mantissa } => {
            let up = if exponent & 1 == 0 { 80 } else { 81 };
            let wide = u128::from(mantissa) << up;
            let root = wide.isqrt();
            round(false, (exponent - up) / 2 - 1, root << 1 | u128::from(root * root != wide), status)
        }
    }
}

/// FPMulAdd.
pub(super) fn multiply_add(addend: u32, a: u32, b: u32, status: &mut Status) -> u32 {
    let (addend, a, b) = (flushed(addend, status), flushed(a, status), flushed(b, status));
    let nan = chosen_nan([addend, a, b], status);
    let endless = |bits: u32| bits & 0x7fff_ffff == INFINITY;
    let zero = |bits: u32| bits & 0x7fff_ffff == 0;
    let undefined = endless(a) && zero(b) || zero(a) && endless(b);
    if let Some(nan) = nan {
        // A quiet addend does not hide a product that is not defined.
        return if undefined && !is_signalling(addend) { invalid(status) } else { nan };
    }
    if undefined {
        return invalid(status);
    }
    let (addend, a, b) = (unpack(addend), unpack(a), unpack(b));
    let negative = a.negative != b.negative;
    match (addend.kind, a.kind, b.kind) {
        (
            Kind::Finite { exponent, mantissa },
            Kind::Finite { exponent: ea, mantissa: ma },
            Kind::Finite { exponent: eb, mantissa: mb },
        ) => sum((addend.negative, exponent, mantissa), (negative, ea + eb, ma * mb), status),
        (Kind::Infinite, Kind::Finite { .. }, Kind::Finite { .. }) => sign(addend.negative) | INFINITY,
        (Kind::Infinite, ..) if addend.negative != negative => invalid(status),
        _ => sign(negative) | INFINITY,
    }
}
