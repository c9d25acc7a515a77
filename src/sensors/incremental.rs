//! An incremental encoder with A, B and an index pulse a turn, counted by a timer; control step.

/// Counts between two index pulses that may differ from a turn before counts are reported as lost: the index is as wide
/// as one state of A and B, and its edge depends on the direction.
const INDEX_TOLERANCE: u16 = 4;

/// Conversion of counts into an angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Incremental {
    counts_per_turn: u16,
    scale: u32,
    index: Option<u16>,
    /// Angle of the index before it is subtracted.
    zero: u32,
}

impl Incremental {
    /// An encoder with `counts_per_turn` counts (four times its lines); none below 16 counts.
    pub const fn new(counts_per_turn: u16) -> Option<Self> {
        if counts_per_turn < 4 * INDEX_TOLERANCE {
            return None;
        }
        // Rounded: at the end of the turn the angle is off by at most half a count in 2^16.
        let turn = 1u64 << 32;
        let scale = ((turn + counts_per_turn as u64 / 2) / counts_per_turn as u64) as u32;
        Some(Self { counts_per_turn, scale, index: None, zero: 0 })
    }

    /// Counts a turn: the timer counts from 0 to one less.
    pub const fn counts_per_turn(&self) -> u16 {
        self.counts_per_turn
    }

    /// Angle of a count, 2^32 a turn; zero is where the last index pulse was, and before the first one where the
    /// counter was zero.
    #[inline(always)]
    pub const fn angle(&self, count: u16) -> u32 {
        (count as u32).wrapping_mul(self.scale).wrapping_sub(self.zero)
    }

    /// Returns `true` if the angle's zero is the index: without it a rotor that was switched on elsewhere has another
    /// electrical zero.
    #[inline(always)]
    pub const fn is_referenced(&self) -> bool {
        self.index.is_some()
    }

    /// Takes the count at an index pulse, where the angle's zero is from now on unless it was there already; whether it
    /// is where the pulse before was, within four counts.
    ///
    /// False means that counts were lost or invented since. The first pulse is always true.
    #[inline(always)]
    pub const fn index(&mut self, count: u16) -> bool {
        if let Some(last) = self.index {
            let apart = count.abs_diff(last);
            let other_way = self.counts_per_turn.saturating_sub(apart);
            if apart <= INDEX_TOLERANCE || other_way <= INDEX_TOLERANCE {
                return true;
            }
        }
        let is_first = self.index.is_none();
        self.index = Some(count);
        self.zero = (count as u32).wrapping_mul(self.scale);
        is_first
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_angle_is_the_count_over_the_counts_a_turn(counts in 16u16.., fraction in 0.0..1.0) {
            let encoder = Incremental::new(counts).unwrap();
            let count = (fraction * f64::from(counts)) as u16;
            let exact = f64::from(count) / f64::from(counts) * 2f64.powi(32);
            // Half a count of the 16-bit counter at most, in units of 2^-32 turn.
            prop_assert!((f64::from(encoder.angle(count)) - exact).abs() <= 32_768.0);
        }

        #[test]
        fn lost_counts_are_found_at_the_next_index(counts in 64u16.., first in any::<u16>(), lost in 5u16..32) {
            let mut encoder = Incremental::new(counts).unwrap();
            let first = first % counts;
            prop_assert!(encoder.index(first));
            prop_assert!(encoder.index(first));
            let later = ((u32::from(first) + u32::from(lost)) % u32::from(counts)) as u16;
            prop_assert!(!encoder.index(later));
            // From there on the angle is right again.
            prop_assert!(encoder.index(later));
            prop_assert_eq!(encoder.angle(later), 0);
        }

        #[test]
        fn from_the_index_on_the_angle_does_not_know_where_the_power_came(counts in 64u16.., at in any::<u16>(), way in any::<u16>()) {
            let (at, way) = (at % counts, way % counts);
            let mut encoder = Incremental::new(counts).unwrap();
            prop_assert!(!encoder.is_referenced() && encoder.index(at) && encoder.is_referenced());
            let count = ((u32::from(at) + u32::from(way)) % u32::from(counts)) as u16;
            let exact = f64::from(way) / f64::from(counts) * 2f64.powi(32);
            let off = (encoder.angle(count) as i32).wrapping_sub(exact as u64 as u32 as i32);
            prop_assert!(off.abs() <= 2 * 65_536, "{off}");
        }
    }

    #[test]
    fn an_index_beside_the_wrap_is_the_same_index() {
        let mut encoder = Incremental::new(4096).unwrap();
        assert!(encoder.index(4094) && encoder.index(1) && encoder.index(4092));
        assert!(!encoder.index(3));
    }

    #[test]
    fn an_encoder_with_too_few_counts_is_refused() {
        assert_eq!(Incremental::new(0), None);
        assert_eq!(Incremental::new(15), None);
    }
}
