//! Time as the server gets it: microseconds in a `u32` that wraps around after 71.6 minutes; any context.
//!
//! 32 bits because both contexts exchange instants through atomics and Cortex-M has none of 64. The longest interval
//! of CiA 301 is 65.5 s. Every instant that the server remembers is either looked at in each poll or forgotten when
//! its interval is over, so the time between two polls, not the time between two events, has to stay below half of the
//! range, 35 minutes.

/// Microseconds in a millisecond.
pub(super) const MILLISECOND: u32 = 1_000;

/// Microseconds from `since` to `now`; 0 where `since` is later: an interrupt notes instants after a task has read the
/// clock.
pub(super) const fn elapsed(now: u32, since: u32) -> u32 {
    let difference = now.wrapping_sub(since);
    if difference > i32::MAX as u32 { 0 } else { difference }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_survive_the_wrap_and_an_instant_that_is_noted_late() {
        assert_eq!(elapsed(5, u32::MAX - 4), 10);
        assert_eq!(elapsed(100, 101), 0);
        assert_eq!(elapsed(u32::MAX, 3), 0);
        assert_eq!(elapsed(65_535 * MILLISECOND, 0), 65_535_000);
    }
}
