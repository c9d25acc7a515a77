//! Conversions: integers, fixed point, half precision (FPToFixed, FixedToFP, FPHalfToSingle, FPSingleToHalf of ARM DDI
//! 0403, A2.5).

use super::exact::{HALF, Kind, SINGLE, flushed, invalid, round_to, shifted, sign, unpack};
use super::{ALTERNATIVE_HALF, DEFAULT_NAN, DEFAULT_NAN_MODE, INEXACT, INVALID, OVERFLOW, Rounding, Status};

/// Fixed point of `bits` bits in all, `fraction` of them behind the point, with or without sign; saturated, and
/// extended to 32 bits by its sign. `rounding` is the mode's where it is None.
pub fn to_fixed(
    value: u32,
    bits: u32,
    fraction: u32,
    unsigned: bool,
    rounding: Option<Rounding>,
    status: &mut Status,
) -> u32 {
    let (least, most) = match unsigned {
        true => (0, (1i64 << bits) - 1),
        false => (-(1i64 << (bits - 1)), (1i64 << (bits - 1)) - 1),
    };
    // The host's own conversion, where nothing is left to flag: a double has room for every number of 24 bits, wherever
    // its point is.
    if status.is_usual() && rounding == Some(Rounding::Zero) && fraction <= 32 {
        let scaled = f64::from(f32::from_bits(value)) * (1u64 << fraction) as f64;
        // Saturated where it is too large, which is out of range then.
        let kept = scaled as i64;
        if !scaled.is_nan() && kept >= least && kept <= most {
            return kept as u32;
        }
    }
    let value = flushed(value, status);
    if value & 0x7fff_ffff > 0x7f80_0000 {
        invalid(status);
        return 0;
    }
    let number = unpack(value);
    let rounding = rounding.unwrap_or(status.rounding());
    let (magnitude, inexact) = match number.kind {
        Kind::Infinite => (i128::MAX, false),
        Kind::Finite { mantissa: 0, .. } => (0, false),
        // No number of 24 bits is shifted further than that and still in range.
        Kind::Finite { exponent, .. } if exponent + fraction as i32 > 64 => (i128::MAX, false),
        Kind::Finite { exponent, mantissa } => {
            let dropped = -(exponent + fraction as i32);
            let (magnitude, inexact) = shifted(u128::from(mantissa), dropped, rounding, number.negative);
            (magnitude as i128, inexact)
        }
    };
    let exact = if number.negative { -magnitude } else { magnitude };
    let kept = exact.clamp(least.into(), most.into());
    if kept != exact {
        status.flag(INVALID);
    } else if inexact {
        status.flag(INEXACT);
    }
    kept as u32
}

/// The number that fixed point of `bits` bits stands for, `fraction` of them behind the point.
pub fn from_fixed(
    value: u32,
    bits: u32,
    fraction: u32,
    unsigned: bool,
    rounding: Option<Rounding>,
    status: &mut Status,
) -> u32 {
    let unused = 32 - bits;
    let exact = match unsigned {
        true => i64::from(value << unused >> unused),
        false => i64::from((value << unused) as i32 >> unused),
    };
    if exact == 0 {
        return 0;
    }
    // In the usual mode the host's own conversion is the unit's; moving the point is exact.
    if status.is_usual() && fraction <= 32 {
        return (exact as f32 / (1u64 << fraction) as f32).to_bits();
    }
    let rounding = rounding.unwrap_or(status.rounding());
    let magnitude = u128::from(exact.unsigned_abs());
    let (result, _) = round_to(SINGLE, rounding, exact < 0, -(fraction as i32), magnitude, status);
    sign(exact < 0) | result
}

/// The number in the lower half-word.
pub fn from_half(half: u32, status: &mut Status) -> u32 {
    let (negative, exponent, fraction) = (half >> 15 & 1 != 0, half >> 10 & 0x1f, half & 0x3ff);
    match (exponent, fraction) {
        (0, 0) => sign(negative),
        (31, _) if status.0 & ALTERNATIVE_HALF == 0 => {
            if fraction == 0 {
                return sign(negative) | 0x7f80_0000;
            }
            if fraction & 0x200 == 0 {
                status.flag(INVALID);
            }
            match status.0 & DEFAULT_NAN_MODE {
                0 => sign(negative) | 0x7fc0_0000 | (fraction & 0x1ff) << 13,
                _ => DEFAULT_NAN,
            }
        }
        _ => {
            // Exact, whatever the mode.
            let (mantissa, exponent) =
                if exponent == 0 { (fraction, -24) } else { (fraction | 0x400, exponent as i32 - 25) };
            let (bits, _) = round_to(SINGLE, Rounding::Nearest, negative, exponent, u128::from(mantissa), status);
            sign(negative) | bits
        }
    }
}

/// Half precision in the lower half-word.
pub fn to_half(value: u32, status: &mut Status) -> u32 {
    let value = flushed(value, status);
    let alternative = status.0 & ALTERNATIVE_HALF != 0;
    let negative = value >> 31 != 0;
    let half_sign = u32::from(negative) << 15;
    if value & 0x7fff_ffff > 0x7f80_0000 {
        if alternative || value & 0x40_0000 == 0 {
            status.flag(INVALID);
        }
        return match (alternative, status.0 & DEFAULT_NAN_MODE) {
            (true, _) => half_sign,
            (false, 0) => half_sign | 0x7e00 | value >> 13 & 0x1ff,
            _ => 0x7e00,
        };
    }
    let (exponent, mantissa) = match unpack(value).kind {
        Kind::Infinite if alternative => {
            status.flag(INVALID);
            return half_sign | 0x7fff;
        }
        Kind::Infinite => return half_sign | 0x7c00,
        Kind::Finite { mantissa: 0, .. } => return half_sign,
        Kind::Finite { exponent, mantissa } => (exponent, u128::from(mantissa)),
    };
    let rounding = status.rounding();
    // The alternative format has numbers where the other has infinities and NaNs.
    let format = super::exact::Format { full: if alternative { 32 } else { 31 }, ..HALF };
    let (bits, overflows) = round_to(format, rounding, negative, exponent, mantissa, status);
    if !overflows {
        return half_sign | bits;
    }
    if alternative {
        status.flag(INVALID);
        return half_sign | 0x7fff;
    }
    status.flag(OVERFLOW | INEXACT);
    let away = match rounding {
        Rounding::Nearest => true,
        Rounding::Up => !negative,
        Rounding::Down => negative,
        Rounding::Zero => false,
    };
    half_sign | if away { 0x7c00 } else { 0x7bff }
}
