//! Closed intervals of 64-bit integers, rounded outwards; an end that leaves the type is unbounded and stays so.
//!
//! Operations are functions of their own and never inlined: a proof has some hundred of them, and 64 bits that saturate
//! take up to fifty instructions on the board. What its innermost loops do has a twin that is inlined there,
//! `..._here`.

/// All values from `low` to `high`; a `low` of `i64::MIN` and a `high` of `i64::MAX` mean that there is no bound on
/// that side.
///
/// Were an end merely held at the end of the type, a later term of the other sign would bring it back and hide that a
/// sum had left the type.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Interval {
    pub(super) low: i64,
    pub(super) high: i64,
}

impl Interval {
    pub(super) const ZERO: Self = Self::point(0);

    pub(super) const fn point(value: i64) -> Self {
        Self { low: value, high: value }
    }

    /// The interval between two values, in any order.
    #[inline(never)]
    pub(super) fn between(a: i64, b: i64) -> Self {
        Self { low: a.min(b), high: a.max(b) }
    }

    pub(super) fn symmetric(magnitude: i64) -> Self {
        let magnitude = magnitude.saturating_abs();
        Self { low: -magnitude, high: magnitude }
    }

    #[inline(never)]
    pub(super) fn add(self, other: Self) -> Self {
        self.add_here(other)
    }

    #[inline(always)]
    pub(super) fn add_here(self, other: Self) -> Self {
        let lowest = self.low.min(other.low);
        let highest = self.high.max(other.high);
        Self {
            low: if lowest == i64::MIN { lowest } else { self.low.saturating_add(other.low) },
            high: if highest == i64::MAX { highest } else { self.high.saturating_add(other.high) },
        }
    }

    #[inline(never)]
    pub(super) fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    #[inline(never)]
    pub(super) fn contains(self, other: Self) -> bool {
        self.low <= other.low && other.high <= self.high
    }

    const fn bounded(self) -> bool {
        self.low > i64::MIN && self.high < i64::MAX
    }

    /// All products of a value of each.
    #[inline(never)]
    pub(super) fn times(self, other: Self) -> Self {
        self.times_here(other)
    }

    /// Ends of 32 bits, by far the most, take one instruction a product on the board, where a saturating one takes
    /// fifty.
    #[inline(always)]
    pub(super) fn times_here(self, other: Self) -> Self {
        if let (Some((low, high)), Some((other_low, other_high))) = (self.narrow(), other.narrow()) {
            return Self::hull(
                low as i64 * other_low as i64,
                low as i64 * other_high as i64,
                high as i64 * other_low as i64,
                high as i64 * other_high as i64,
            );
        }
        self.times_saturating(other)
    }

    #[inline(never)]
    fn times_saturating(self, other: Self) -> Self {
        if self == Self::ZERO || other == Self::ZERO {
            return Self::ZERO;
        }
        if !self.bounded() || !other.bounded() {
            return Self { low: i64::MIN, high: i64::MAX };
        }
        Self::hull(
            saturating_product(self.low, other.low),
            saturating_product(self.low, other.high),
            saturating_product(self.high, other.low),
            saturating_product(self.high, other.high),
        )
    }

    /// Both ends, where they fit 32 bits.
    fn narrow(self) -> Option<(i32, i32)> {
        let (low, high) = (self.low as i32, self.high as i32);
        (low as i64 == self.low && high as i64 == self.high).then_some((low, high))
    }

    #[inline(always)]
    fn hull(a: i64, b: i64, c: i64, d: i64) -> Self {
        Self { low: a.min(b).min(c).min(d), high: a.max(b).max(c).max(d) }
    }

    /// All products with a share of one: an interval within 0 to 2^14.
    #[inline(always)]
    pub(super) fn times_share(self, share: Self) -> Self {
        const SMALL: i64 = 1 << 48;
        if self.low <= -SMALL || self.high >= SMALL {
            return self.times(share);
        }
        Self {
            low: self.low * if self.low < 0 { share.high } else { share.low },
            high: self.high * if self.high < 0 { share.low } else { share.high },
        }
    }

    /// All products with one 16-bit factor, of an interval whose ends fit 32 bits.
    pub(super) fn scaled(self, factor: i16) -> Self {
        let (low, high) = (self.low * factor as i64, self.high * factor as i64);
        if factor < 0 { Self { low: high, high: low } } else { Self { low, high } }
    }

    /// Division by a power of two, rounded outwards.
    #[inline(never)]
    pub(super) fn shift_right(self, bits: u32) -> Self {
        self.shift_right_here(bits)
    }

    #[inline(always)]
    pub(super) fn shift_right_here(self, bits: u32) -> Self {
        let bits = bits.min(63);
        let quotient = self.high >> bits;
        let rounded_up = if quotient << bits == self.high { quotient } else { quotient + 1 };
        Self {
            low: if self.low == i64::MIN { self.low } else { self.low >> bits },
            high: if self.high == i64::MAX { self.high } else { rounded_up },
        }
    }

    pub(super) fn shift_left(self, bits: u32) -> Self {
        let factor = 1i64 << bits.min(62);
        Self { low: saturating_product(self.low, factor), high: saturating_product(self.high, factor) }
    }

    /// The image of the interval under a function that never falls or never rises.
    pub(super) fn map(self, monotone: impl Fn(i64) -> i64) -> Self {
        Self::between(monotone(self.low), monotone(self.high))
    }

    /// Magnitudes of the values.
    #[inline(never)]
    pub(super) fn abs(self) -> Self {
        let (low, high) = (self.low.saturating_abs(), self.high.saturating_abs());
        let least = if self.low <= 0 && self.high >= 0 { 0 } else { low.min(high) };
        Self { low: least, high: low.max(high) }
    }

    /// Largest magnitude; held at the end of the type.
    pub(super) fn magnitude(self) -> u32 {
        self.low.unsigned_abs().max(self.high.unsigned_abs()).min(u32::MAX as u64) as u32
    }
}

#[inline(never)]
fn saturating_product(a: i64, b: i64) -> i64 {
    a.saturating_mul(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn interval(a: i64, b: i64) -> Interval {
        Interval::between(a, b)
    }

    #[test]
    fn an_end_that_left_the_type_does_not_come_back() {
        let far = Interval::point(i64::MAX - 1).add(Interval::point(i64::MAX - 1));
        assert_eq!(far.high, i64::MAX);
        assert_eq!(far.add(Interval::point(-1000)).high, i64::MAX);
        assert_eq!(far.shift_right(40).high, i64::MAX);
        assert_eq!(far.times(Interval::point(-1)).low, i64::MIN);
        assert_eq!(far.times(Interval::ZERO), Interval::ZERO);
    }

    proptest! {
        #[test]
        fn operations_contain_what_they_bound(a: i64, b: i64, c: i64, d: i64, s in 0.0f64..=1.0, t in 0.0f64..=1.0, bits in 0u32..70) {
            let pick = |i: Interval, part: f64| (i.low as f64 + (i.high as f64 - i.low as f64) * part) as i64;
            let (first, second) = (interval(a, b), interval(c, d));
            let (x, y) = (pick(first, s).clamp(first.low, first.high), pick(second, t).clamp(second.low, second.high));
            let holds = |i: Interval, value: i128| {
                (i.low == i64::MIN || i.low as i128 <= value) && (i.high == i64::MAX || value <= i.high as i128)
            };
            let short = interval(a as i32 as i64, b as i32 as i64);
            prop_assert_eq!(short.scaled(c as i16), short.times(Interval::point(c as i16 as i64)));
            let share = interval(c & 0x3fff, d & 0x3fff);
            prop_assert_eq!(interval(a >> 20, b >> 20).times_share(share), interval(a >> 20, b >> 20).times(share));
            prop_assert_eq!(first.times_share(share), first.times(share));
            let (small, factor) = (interval(a >> 33, b >> 33), interval(c >> 33, d >> 33));
            prop_assert_eq!(small.times(factor).shift_left(20), small.shift_left(20).times(factor));
            prop_assert!(holds(first.add(second), x as i128 + y as i128));
            prop_assert!(holds(first.times(second), x as i128 * y as i128));
            prop_assert!(holds(first.shift_right(bits), x as i128 >> bits));
            prop_assert!(holds(first.shift_right(bits), -((-(x as i128)) >> bits)));
            prop_assert!(holds(first.shift_left(bits.min(62)), (x as i128) << bits.min(62)));
            prop_assert!(holds(first.abs(), (x as i128).abs()));
        }
    }
}
