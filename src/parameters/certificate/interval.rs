//! Closed intervals of 64-bit integers, rounded outwards and held at the ends of the type.

/// All values from `low` to `high`.
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
    pub(super) fn between(a: i64, b: i64) -> Self {
        Self { low: a.min(b), high: a.max(b) }
    }

    pub(super) fn symmetric(magnitude: i64) -> Self {
        let magnitude = magnitude.saturating_abs();
        Self { low: -magnitude, high: magnitude }
    }

    pub(super) fn add(self, other: Self) -> Self {
        Self { low: self.low.saturating_add(other.low), high: self.high.saturating_add(other.high) }
    }

    pub(super) fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub(super) fn contains(self, other: Self) -> bool {
        self.low <= other.low && other.high <= self.high
    }

    /// All products of a value of each.
    pub(super) fn times(self, other: Self) -> Self {
        let a = self.low.saturating_mul(other.low);
        let b = self.low.saturating_mul(other.high);
        let c = self.high.saturating_mul(other.low);
        let d = self.high.saturating_mul(other.high);
        Self { low: a.min(b).min(c).min(d), high: a.max(b).max(c).max(d) }
    }

    /// Division by a power of two, rounded outwards.
    pub(super) fn shift_right(self, bits: u32) -> Self {
        if bits > 62 {
            return Self { low: if self.low < 0 { -1 } else { 0 }, high: if self.high > 0 { 1 } else { 0 } };
        }
        let round_up = (1i64 << bits) - 1;
        Self { low: self.low >> bits, high: self.high.saturating_add(round_up) >> bits }
    }

    pub(super) fn shift_left(self, bits: u32) -> Self {
        let factor = 1i64 << bits.min(62);
        Self { low: self.low.saturating_mul(factor), high: self.high.saturating_mul(factor) }
    }

    /// The image of the interval under a function that never falls or never rises.
    pub(super) fn map(self, monotone: impl Fn(i64) -> i64) -> Self {
        Self::between(monotone(self.low), monotone(self.high))
    }

    /// Magnitudes of the values.
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
