//! Number of times that a client may have the record of object 1010h or an image written, so that one that stores in a
//! loop does not wear the flash out; the task.
//!
//! A page bears at least 10,000 erases (STM32G431, DS12589 Rev 6, table 47: N_END, -40 to 105 °C; the STM32G474 is
//! taken to be alike), record and images lie in two pages each, in turn. A client that stores as often as it may for
//! 20,000 stores needs more than two years with the supply on.

/// Stores after power-up.
pub const STORES: u8 = 32;
/// Time after which one more is permitted, ms.
pub const REFILL: u32 = 3_600_000;

/// Stores that are left. A reset over the bus refills nothing: the program keeps [`StoreBudget::left`] over it.
#[derive(Clone, Copy, Debug)]
pub(super) struct StoreBudget {
    left: u8,
    /// Time since which time counts towards the next one, ms; wraps.
    since: u32,
}

impl StoreBudget {
    /// Budget with so many left.
    pub(super) const fn new(left: u8) -> Self {
        Self { left, since: 0 }
    }

    /// Stores that are left.
    pub(super) const fn left(&self) -> u8 {
        self.left
    }

    /// Time goes on, to `now` (ms, wrapping), more often than it wraps; true where one more is permitted.
    pub(super) const fn refill(&mut self, now: u32) -> bool {
        let whole = self.left >= STORES;
        let due = !whole && now.wrapping_sub(self.since) >= REFILL;
        if whole || due {
            self.since = now;
            self.left += due as u8;
        }
        due
    }

    /// Takes one; false where none is left.
    pub(super) const fn take(&mut self) -> bool {
        let some = self.left > 0;
        self.left = self.left.saturating_sub(1);
        some
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_hour_gives_one_store_back_and_no_more_than_there_were() {
        let mut budget = StoreBudget::new(STORES);
        assert!(!budget.refill(5 * REFILL), "it is whole");
        assert!((0..STORES).all(|_| budget.take()) && !budget.take());
        let begun = 5 * REFILL;
        assert!(!budget.refill(begun + REFILL - 1) && !budget.take());
        assert!(budget.refill(begun + REFILL) && !budget.refill(begun + 2 * REFILL - 1));
        assert!(budget.take() && !budget.take());
        for hour in 2..100 {
            budget.refill(begun + hour * REFILL);
        }
        assert_eq!(budget.left(), STORES);
    }
}
