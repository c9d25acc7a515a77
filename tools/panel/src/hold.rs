//! The dead man's switch of a page: held as long as held-messages come; any context, time is passed in.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Age of a held-message from which on it counts no longer.
pub const LIMIT: Duration = Duration::from_millis(200);

#[derive(Debug, Default)]
struct Inner {
    /// Number of the hold and when it was confirmed last.
    held: Option<(u64, Instant)>,
    /// Holds up to this number are over: a held-message that comes late does not renew them.
    released: u64,
}

/// Switch of one page. Every press of the button is a hold with a number of its own, counted up from 1.
#[derive(Debug, Default)]
pub struct Hold(Mutex<Inner>);

impl Hold {
    fn with<T>(&self, change: impl FnOnce(&mut Inner) -> T) -> T {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// A held-message of hold `number` has come. One whose messages were missing for [`LIMIT`] is over and stays so.
    pub fn renew(&self, number: u64, now: Instant) {
        self.with(|inner| {
            if let Some((held, at)) = inner.held
                && (held < number || now.saturating_duration_since(at) >= LIMIT)
            {
                inner.released = inner.released.max(held);
            }
            if number > inner.released {
                inner.held = Some((number, now));
            }
        });
    }

    /// The button was let go, or the page is gone: every hold so far is over.
    pub fn release(&self) {
        self.with(|inner| {
            if let Some((held, _)) = inner.held.take() {
                inner.released = inner.released.max(held);
            }
        });
    }

    /// Hold `number` and those before it are over; one that was begun after it is not.
    pub fn end(&self, number: u64) {
        self.with(|inner| {
            inner.released = inner.released.max(number);
            inner.held = inner.held.filter(|(held, _)| *held > number);
        });
    }

    /// Returns `true` if hold `number` lasts.
    pub fn is_held(&self, number: u64, now: Instant) -> bool {
        self.with(|inner| {
            inner.held.is_some_and(|(held, at)| held == number && now.saturating_duration_since(at) < LIMIT)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hold_ends_200_ms_after_its_last_message_and_not_before() {
        let (hold, start) = (Hold::default(), Instant::now());
        hold.renew(1, start);
        let below = start + LIMIT - Duration::from_nanos(1);
        assert!(hold.is_held(1, below));
        assert!(!hold.is_held(1, start + LIMIT));
        // The message that comes in time carries on, the one that does not cannot.
        hold.renew(1, below);
        assert!(hold.is_held(1, below + LIMIT - Duration::from_nanos(1)));
        hold.renew(1, below + LIMIT);
        assert!(!hold.is_held(1, below + LIMIT));
        assert_eq!(LIMIT, Duration::from_millis(200));
    }

    #[test]
    fn a_hold_that_was_released_is_not_renewed_by_a_late_message_and_the_next_one_is_another() {
        let (hold, now) = (Hold::default(), Instant::now());
        hold.renew(1, now);
        hold.release();
        hold.renew(1, now);
        assert!(!hold.is_held(1, now));
        hold.renew(2, now);
        assert!(hold.is_held(2, now) && !hold.is_held(1, now));
        // The third press makes the second one's messages late.
        hold.renew(3, now);
        hold.renew(2, now);
        assert!(!hold.is_held(2, now) && hold.is_held(3, now));
        hold.end(2);
        assert!(hold.is_held(3, now));
        hold.end(3);
        hold.renew(3, now);
        assert!(!hold.is_held(3, now));
    }
}
