//! Time in the chip: the core counts cycles, oscillators that the core does not run on count by themselves.

/// Picoseconds since the run began. Goes on over resets and losses of power: the plant does not stop either. Lasts for
/// 213 days.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Instant(pub u64);

const SECOND: u128 = 1_000_000_000_000;

impl Instant {
    /// Never.
    pub const NEVER: Self = Self(u64::MAX);

    /// Seconds since the run began.
    pub fn seconds(self) -> f64 {
        self.0 as f64 * 1e-12
    }

    /// Later by so many nanoseconds.
    pub const fn after_ns(self, nanoseconds: u64) -> Self {
        Self(self.0.saturating_add(nanoseconds.saturating_mul(1_000)))
    }

    /// Later by `cycles` of a clock of `frequency` Hz, rounded down to a picosecond.
    pub fn after(self, cycles: u64, frequency: u64) -> Self {
        Self(self.0.saturating_add((u128::from(cycles) * SECOND / u128::from(frequency.max(1))) as u64))
    }
}

/// Conversion of the core's cycles into time: since when at which frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clock {
    cycle: u64,
    instant: Instant,
    frequency: u64,
}

impl Clock {
    /// `frequency` Hz from the first cycle on.
    pub const fn new(frequency: u64) -> Self {
        Self { cycle: 0, instant: Instant(0), frequency }
    }

    /// The core's frequency, Hz.
    pub const fn frequency(&self) -> u64 {
        self.frequency
    }

    /// Another frequency from a cycle on.
    pub fn change(&mut self, cycle: u64, frequency: u64) {
        if frequency != self.frequency {
            *self = Self { cycle, instant: self.instant(cycle), frequency };
        }
    }

    /// Instant at which a cycle begins.
    pub fn instant(&self, cycle: u64) -> Instant {
        self.instant.after(cycle.saturating_sub(self.cycle), self.frequency)
    }

    /// The first cycle that does not begin before an instant.
    pub fn cycle(&self, instant: Instant) -> u64 {
        if instant == Instant::NEVER {
            return u64::MAX;
        }
        let elapsed = u128::from(instant.0.saturating_sub(self.instant.0));
        let cycles = (elapsed * u128::from(self.frequency)).div_ceil(SECOND) as u64;
        // Rounding down in `instant` makes this the cycle before the first one whose beginning is not earlier.
        let cycle = self.cycle.saturating_add(cycles);
        if cycle > self.cycle && self.instant(cycle - 1) >= instant { cycle - 1 } else { cycle }
    }
}

/// A cycle, and what it means as an instant.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// The core's cycle.
    pub cycle: u64,
    /// The clock that the core runs on.
    pub clock: Clock,
}

impl Moment {
    /// Value as an instant.
    pub fn instant(&self) -> Instant {
        self.clock.instant(self.cycle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_change_of_the_frequency_keeps_what_has_passed() {
        let mut clock = Clock::new(16_000_000);
        clock.change(1_600, 170_000_000);
        assert_eq!(clock.instant(1_600), Instant(100_000_000));
        assert_eq!(clock.instant(1_770), Instant(101_000_000));
        assert_eq!(clock.cycle(Instant(101_000_000)), 1_770);
    }

    proptest! {
        #[test]
        fn a_cycles_instant_gives_the_cycle_back(cycle in 0u64..1 << 40, frequency in 1_000_000u64..=170_000_000) {
            let clock = Clock::new(frequency);
            prop_assert_eq!(clock.cycle(clock.instant(cycle)), cycle);
        }

        #[test]
        fn the_cycle_of_an_instant_is_the_first_that_is_not_before_it(instant in 0u64..1 << 50) {
            let clock = Clock::new(170_000_000);
            let cycle = clock.cycle(Instant(instant));
            prop_assert!(clock.instant(cycle) >= Instant(instant));
            prop_assert!(cycle == 0 || clock.instant(cycle - 1) < Instant(instant));
        }
    }
}
