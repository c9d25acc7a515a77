//! SysTick: counts down and pends its exception whenever it reaches zero (ARM DDI 0403, B3.3). Computed from the time,
//! not counted.

#[derive(Clone, Default)]
pub(super) struct SystemTimer {
    enabled: bool,
    interrupts: bool,
    /// The core's own clock, otherwise an eighth of it (RM0440, 7.2.9).
    core_clock: bool,
    reload: u32,
    /// The counter at the cycle `since`.
    value: u32,
    since: u64,
    /// Zero was reached since the control register was read; and since `expire` was asked.
    counted: bool,
    fired: bool,
}

/// The counter's 24 bits.
const COUNTER: u32 = 0xff_ffff;

impl SystemTimer {
    fn cycles_per_count(&self) -> u64 {
        if self.core_clock { 1 } else { 8 }
    }

    fn period(&self) -> u64 {
        u64::from(self.reload) + 1
    }

    /// Counts from `since` to the next zero; None where it stands still.
    fn to_zero(&self) -> Option<u64> {
        match (self.enabled, self.value, self.reload) {
            (false, ..) | (_, 0, 0) => None,
            (_, 0, _) => Some(self.period()),
            (_, value, _) => Some(u64::from(value)),
        }
    }

    /// Brings the counter to the cycle `now`.
    fn catch_up(&mut self, now: u64) {
        let passed = now.saturating_sub(self.since) / self.cycles_per_count();
        let Some(first) = self.to_zero() else {
            self.since = now;
            return;
        };
        self.since += passed * self.cycles_per_count();
        if passed < first {
            // From zero it goes on at the reload value.
            let start = if self.value == 0 { self.period() } else { u64::from(self.value) };
            self.value = if passed == 0 { self.value } else { (start - passed) as u32 };
            return;
        }
        (self.counted, self.fired) = (true, self.fired | self.interrupts);
        let behind = (passed - first) % self.period();
        self.value = match behind {
            _ if self.reload == 0 => 0,
            0 => 0,
            _ => (self.period() - behind) as u32,
        };
    }

    /// The cycle at which it next pends its exception, `u64::MAX` for never.
    pub fn next(&self) -> u64 {
        if self.fired {
            return 0;
        }
        match self.to_zero() {
            Some(counts) if self.interrupts => self.since.saturating_add(counts * self.cycles_per_count()),
            _ => u64::MAX,
        }
    }

    /// Returns `true` if it has reached zero since it was last asked, with its exception enabled.
    pub fn expire(&mut self, now: u64) -> bool {
        if self.interrupts {
            self.catch_up(now);
        }
        std::mem::take(&mut self.fired)
    }

    /// A register, by its offset from 0xe000_e010.
    pub fn read(&mut self, now: u64, offset: u32) -> Option<u32> {
        self.catch_up(now);
        Some(match offset {
            0x0 => {
                let bit = |set: bool, bit: u32| u32::from(set) << bit;
                let counted = std::mem::take(&mut self.counted);
                bit(counted, 16) | bit(self.core_clock, 2) | bit(self.interrupts, 1) | bit(self.enabled, 0)
            }
            0x4 => self.reload,
            0x8 => self.value,
            _ => return None,
        })
    }

    /// Sets a register; false where there is none.
    pub fn write(&mut self, now: u64, offset: u32, value: u32) -> bool {
        self.catch_up(now);
        match offset {
            0x0 => {
                (self.enabled, self.interrupts, self.core_clock) = (value & 1 != 0, value & 2 != 0, value & 4 != 0);
                self.since = now;
            }
            0x4 => self.reload = value & COUNTER,
            // Any value clears it.
            0x8 => (self.value, self.counted, self.since) = (0, false, now),
            _ => return false,
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_down_from_the_reload_value_and_reaches_zero_once_a_period() {
        let mut timer = SystemTimer::default();
        assert!(timer.write(0, 4, 9) && timer.write(0, 8, 123) && timer.write(0, 0, 0b111));
        let seen: Vec<_> = (0..22).map(|now| timer.read(now, 8)).collect();
        let expected = [0, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0, 9].map(Some);
        assert_eq!(seen, expected);
        assert_eq!(timer.read(22, 0), Some(1 << 16 | 7), "zero was reached");
        assert_eq!(timer.read(23, 0), Some(7), "reading forgets it");
    }

    #[test]
    fn fires_at_the_cycle_that_it_says_and_not_before() {
        let mut timer = SystemTimer::default();
        assert!(timer.write(5, 4, 99) && timer.write(5, 8, 0) && timer.write(5, 0, 0b111));
        assert_eq!(timer.next(), 105);
        assert!(!timer.expire(104));
        assert!(timer.expire(105) && !timer.expire(105));
        assert_eq!(timer.next(), 205);
        assert!(timer.expire(1000), "however late, once");
        assert_eq!(timer.next(), 1005);
    }

    #[test]
    fn an_eighth_of_the_clock_takes_eight_times_as_long() {
        let mut timer = SystemTimer::default();
        assert!(timer.write(0, 4, 9) && timer.write(0, 0, 0b011));
        assert_eq!(timer.next(), 80);
        assert_eq!((timer.read(7, 8), timer.read(8, 8)), (Some(0), Some(9)));
    }

    #[test]
    fn stands_still_without_reload_value_or_switched_off() {
        let mut timer = SystemTimer::default();
        assert!(timer.write(0, 0, 0b111));
        assert_eq!(timer.next(), u64::MAX);
        assert!(timer.write(0, 4, 9) && timer.write(0, 0, 0b110));
        assert_eq!(timer.next(), u64::MAX);
    }
}
