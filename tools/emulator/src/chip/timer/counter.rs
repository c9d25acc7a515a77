//! A timer's counter: computed from the core's cycles between two turns, not ticked.
//!
//! RM0440, 28.3.2 "Counter modes", 29.3.2 and 30.4.2. Centre-aligned, the counter runs from 0 to the top and back, with
//! an overflow when it reaches the top and an underflow when it reaches 0: a period of twice the top. Counting up, it
//! starts over after the top.

/// A counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counter {
    /// The count at `since`.
    pub count: u32,
    /// `true` if it counts up.
    pub up: bool,
    /// The cycle at which `count` was reached.
    pub since: u64,
    /// Cycles of a count: the prescaler in force plus one.
    pub tick: u64,
    /// The top in force.
    pub top: u32,
    /// `true` if it counts up and down.
    pub centred: bool,
    /// CEN.
    pub running: bool,
}

impl Counter {
    /// Stopped at 0.
    pub const fn new(top: u32) -> Self {
        Self { count: 0, up: true, since: 0, tick: 1, top, centred: false, running: false }
    }

    /// Cycle of the next turn: overflow or underflow. A counter with a top of 0 stands still (ARR, "the counter is
    /// blocked").
    pub const fn turn(&self) -> u64 {
        if !self.running || self.top == 0 {
            return u64::MAX;
        }
        let counts = match (self.centred, self.up) {
            (true, true) => self.top.saturating_sub(self.count),
            (true, false) => self.count,
            // One above the top goes on to the end of the counter first; that is not modelled, and treated as a turn.
            (false, _) => self.top.saturating_sub(self.count) + 1,
        };
        self.since + counts as u64 * self.tick
    }

    /// Cycle at which the counter reaches a value before the next turn, or at it; `u64::MAX` where it does not.
    pub const fn reaches(&self, value: u32) -> u64 {
        if !self.running || self.top == 0 || value > self.top {
            return u64::MAX;
        }
        let counts = match self.up {
            true if value > self.count => value - self.count,
            false if value < self.count => self.count - value,
            _ => return u64::MAX,
        };
        self.since + counts as u64 * self.tick
    }

    /// Moves on to a cycle that is not behind the next turn. Returns the values that were reached: none, or from the
    /// first to the last, in the direction of the count.
    pub fn advance(&mut self, cycle: u64) -> Option<(u32, u32)> {
        if !self.running || self.top == 0 || cycle < self.since + self.tick {
            return None;
        }
        let counts = (cycle - self.since) / self.tick;
        self.since += counts * self.tick;
        let before = self.count;
        if self.up {
            self.count = self.count.saturating_add(counts as u32).min(self.top);
            (self.count > before).then_some((before + 1, self.count))
        } else {
            self.count = self.count.saturating_sub(counts as u32);
            (self.count < before).then_some((before - 1, self.count))
        }
    }

    /// The turn itself, at its cycle. Returns whether it was an overflow.
    pub fn turn_over(&mut self) -> bool {
        let overflow = self.up;
        if self.centred {
            self.up = !self.up;
        } else {
            self.count = 0;
        }
        overflow
    }

    /// A write to the counter: the prescaler goes on (28.3.1).
    pub fn set(&mut self, count: u32) {
        self.count = count;
        if self.centred {
            self.up = count == 0 || self.up && count < self.top;
        }
    }

    /// Stops, or goes on from where it stands.
    pub fn run(&mut self, cycle: u64, running: bool) {
        if running != self.running {
            self.running = running;
            self.since = cycle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn centre_aligned_a_period_is_twice_the_top() {
        let mut counter = Counter { centred: true, running: true, ..Counter::new(4) };
        let mut counts = vec![];
        for cycle in 0..=16 {
            counter.advance(cycle);
            counts.push(counter.count);
            if counter.turn() == cycle {
                counter.turn_over();
            }
        }
        assert_eq!(counts, [0, 1, 2, 3, 4, 3, 2, 1, 0, 1, 2, 3, 4, 3, 2, 1, 0]);
    }

    #[test]
    fn counting_up_a_period_is_the_top_and_one() {
        let mut counter = Counter { running: true, ..Counter::new(3) };
        let mut counts = vec![];
        for cycle in 0..=8 {
            let turn = counter.turn() == cycle;
            counter.advance(cycle);
            if turn {
                counter.turn_over();
            }
            counts.push(counter.count);
        }
        assert_eq!(counts, [0, 1, 2, 3, 0, 1, 2, 3, 0]);
    }

    proptest! {
        #[test]
        fn a_value_is_reached_at_the_cycle_foretold(
            top in 1u32..1_000, start in 0u32..1_000, value in 0u32..1_000, tick in 1u64..20, up: bool
        ) {
            let start = start.min(top);
            let mut counter = Counter { count: start, up, tick, centred: true, running: true, ..Counter::new(top) };
            let cycle = counter.reaches(value);
            if cycle != u64::MAX {
                prop_assert!(cycle <= counter.turn());
                counter.advance(cycle - 1);
                prop_assert!(counter.count != value);
                counter.advance(cycle);
                prop_assert_eq!(counter.count, value);
            }
        }
    }
}
