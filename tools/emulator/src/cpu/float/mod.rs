//! Single-precision arithmetic as the floating-point unit does it, to the bit: rounding modes, NaNs, flush to zero,
//! exception flags.
//!
//! ARM DDI 0403, A2.5 and its pseudo-code. The host's arithmetic is the same where the mode is the usual one, the
//! result is a normal number (or exact) and nothing is left to flag: that is nearly always, because the inexact flag is
//! sticky. Everything else takes the way of `exact`, which computes with integers.

mod convert;
mod exact;

pub use convert::{from_fixed, from_half, to_fixed, to_half};

/// Modes: alternative half precision, default NaN, flush to zero, rounding.
pub(super) const MODES: u32 = 0x07c0_0000;
const ALTERNATIVE_HALF: u32 = 1 << 26;
const DEFAULT_NAN_MODE: u32 = 1 << 25;
const FLUSH_TO_ZERO: u32 = 1 << 24;
/// Exception flags.
const INVALID: u32 = 1;
const DIVISION_BY_ZERO: u32 = 1 << 1;
const OVERFLOW: u32 = 1 << 2;
const UNDERFLOW: u32 = 1 << 3;
const INEXACT: u32 = 1 << 4;
const INPUT_DENORMAL: u32 = 1 << 7;
/// Bits that the register has.
const IMPLEMENTED: u32 = 0xf000_0000 | MODES | 0x9f;

/// The NaN that operations without a NaN among their operands give.
const DEFAULT_NAN: u32 = 0x7fc0_0000;

/// Direction of rounding of a result between two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rounding {
    /// Rounding to the nearer, to the even one from the middle.
    Nearest,
    /// Upwards.
    Up,
    /// Downwards.
    Down,
    /// Towards zero.
    Zero,
}

/// FPSCR: flags of the last comparison, modes, sticky exception flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct Status(u32);

impl Status {
    /// Status of the register's bits; those that it does not have are ignored.
    pub fn from_bits(bits: u32) -> Self {
        Self(bits & IMPLEMENTED)
    }

    /// The register's bits.
    pub fn bits(self) -> u32 {
        self.0
    }

    /// Takes over the modes of a new context.
    pub(super) fn set_modes(&mut self, modes: u32) {
        self.0 = self.0 & !MODES | modes & MODES;
    }

    fn rounding(self) -> Rounding {
        match self.0 >> 22 & 3 {
            0 => Rounding::Nearest,
            1 => Rounding::Up,
            2 => Rounding::Down,
            _ => Rounding::Zero,
        }
    }

    fn flushes(self) -> bool {
        self.0 & FLUSH_TO_ZERO != 0
    }

    fn flag(&mut self, flags: u32) {
        self.0 |= flags;
    }

    /// Returns `true` if the host's result is the unit's: nothing could be flagged that is not, and nothing be rounded
    /// otherwise. A result of the smallest exponent may have been rounded up to it, which is an underflow.
    #[inline(always)]
    fn trusts(self, result: u32) -> bool {
        self.is_usual() && (result & 0x7f80_0000).wrapping_sub(0x0100_0000) < 0x7e80_0000
    }

    /// The same of a sum, and of a product with zero: those are exact where they are small, so that no finite one is an
    /// underflow.
    #[inline(always)]
    fn trusts_finite(self, result: u32) -> bool {
        self.is_usual() && result & 0x7f80_0000 != 0x7f80_0000
    }

    /// Bits of the usual mode, with the sticky inexact flag set, and what they are then.
    pub(super) const USUAL: (u32, u32) = (MODES | INEXACT, INEXACT);

    /// The usual mode, with the sticky inexact flag set.
    #[inline(always)]
    pub(super) fn is_usual(self) -> bool {
        self.0 & Self::USUAL.0 == Self::USUAL.1
    }
}

/// The host's result if it can be trusted, the exact way otherwise; and the host's alone.
macro_rules! operation {
    ($(#[$doc:meta])* $name:ident, $at_once:ident($($operand:ident),+) = $host:expr, $trust:expr) => {
        $(#[$doc])*
        #[inline(always)]
        pub fn $name($($operand: u32,)+ status: &mut Status) -> u32 {
            match $at_once($($operand,)+ *status) {
                Some(result) => result,
                None => exact::$name($($operand,)+ status),
            }
        }

        /// The same if the host's result can be trusted; none otherwise.
        #[inline(always)]
        pub(super) fn $at_once($($operand: u32,)+ status: Status) -> Option<u32> {
            let result = {
                $(let $operand = f32::from_bits($operand);)+
                $host.to_bits()
            };
            let trust: fn(Status, u32, bool) -> bool = $trust;
            let zero = [$($operand),+].contains(&0) || [$($operand),+].contains(&0x8000_0000);
            trust(status, result, zero).then_some(result)
        }
    };
}

operation! {
    /// FPAdd.
    add, add_at_once(a, b) = (a + b), |status, result, _| status.trusts_finite(result)
}
operation! {
    /// FPSub.
    subtract, subtract_at_once(a, b) = (a - b), |status, result, _| status.trusts_finite(result)
}
operation! {
    /// FPMul.
    multiply, multiply_at_once(a, b) = (a * b), |status, result, zero| status.trusts(result) || zero && status.trusts_finite(result)
}
operation! {
    /// FPDiv.
    divide, divide_at_once(a, b) = (a / b), |status, result, _| status.trusts(result)
}
operation! {
    /// FPSqrt.
    square_root, square_root_at_once(a) = a.sqrt(), |status, result, _| status.trusts(result)
}
operation! {
    /// FPMulAdd: `addend` + `a` `b`, rounded once.
    multiply_add, multiply_add_at_once(addend, a, b) = a.mul_add(b, addend), |status, result, _| status.trusts(result)
}

/// FPNeg: also of a NaN.
pub fn negate(a: u32) -> u32 {
    a ^ 0x8000_0000
}

/// FPCompare: the four flags as the register has them. A quiet NaN is invalid only if `signals`.
#[inline]
pub fn compare(a: u32, b: u32, signals: bool, status: &mut Status) {
    // Denormal operands count as zero in this mode.
    let (x, y) = if status.flushes() { (exact::flushed(a, status), exact::flushed(b, status)) } else { (a, b) };
    let (first, second) = (f32::from_bits(x), f32::from_bits(y));
    let flags = match (first < second, first == second, first > second) {
        (true, _, _) => 0b1000,
        (_, true, _) => 0b0110,
        (_, _, true) => 0b0010,
        _ => UNORDERED,
    };
    status.0 = status.0 & 0x0fff_ffff | flags << 28;
    let signalling = |bits: u32| bits & 0x7fff_ffff > 0x7f80_0000 && bits & 0x40_0000 == 0;
    if flags == UNORDERED && (signals || signalling(a) || signalling(b)) {
        status.flag(INVALID);
    }
}

/// The flags where one of both is a NaN.
const UNORDERED: u32 = 0b0011;
