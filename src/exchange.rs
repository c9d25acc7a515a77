//! Ownership of the places by which the control interrupt and a task hand values to each other and neither ever waits;
//! any context.
//!
//! Nothing here holds a value. A value that two contexts share lies in a few places of equal kind, and these types say,
//! by one atomic exchange each, which context owns which place at every instant. Whoever stores the values
//! (`board::shared`) may therefore write and read them without a lock; the tests walk through every order of events.
//!
//!  - [`Newest`]: three places; the newest value arrives, older ones are overwritten. Commands to the control step,
//!    telemetry from it.
//!  - [`Handover`]: two places, for values too large for three; the next value waits until the one before was taken.
//!    Parameters to the control step.

use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};

/// Three places: one is the giver's, one the taker's, one lies between them.
#[derive(Debug)]
pub struct Newest {
    /// Index of the place between the two, and whether the giver was the last to put it there.
    between: AtomicU8,
    split: AtomicBool,
}

/// Flag of [`Newest`]: what lies between has not been taken yet.
const FRESH: u8 = 1 << 7;

/// The side of a [`Newest`] that gives values.
#[derive(Debug)]
pub struct Giver<'a> {
    shared: &'a Newest,
    own: u8,
}

/// The side of a [`Newest`] that takes values.
#[derive(Debug)]
pub struct Taker<'a> {
    shared: &'a Newest,
    own: u8,
}

impl Newest {
    /// Initial state, nothing given yet: the taker has what lies in its place at the start, index 2.
    #[allow(clippy::new_without_default, reason = "it belongs into a static")]
    pub const fn new() -> Self {
        Self { between: AtomicU8::new(1), split: AtomicBool::new(false) }
    }

    /// Both sides; none from the second call on.
    pub fn split(&self) -> Option<(Giver<'_>, Taker<'_>)> {
        let first = !self.split.swap(true, Ordering::AcqRel);
        first.then_some((Giver { shared: self, own: 0 }, Taker { shared: self, own: 2 }))
    }
}

impl Giver<'_> {
    /// The place to write the next value to, 0 to 2. It is the giver's until [`Giver::give`].
    #[inline(always)]
    pub fn place(&self) -> usize {
        self.own.into()
    }

    /// Gives what was written; another place is the giver's from now on, with an old value in it.
    #[inline(always)]
    pub fn give(&mut self) {
        self.own = self.shared.between.swap(self.own | FRESH, Ordering::AcqRel) & !FRESH;
    }
}

impl Taker<'_> {
    /// The place with the value taken last, 0 to 2. It is the taker's until [`Taker::take`].
    #[inline(always)]
    pub fn place(&self) -> usize {
        self.own.into()
    }

    /// Takes the newest value, if one was given since the last time; whether it was.
    #[inline(always)]
    pub fn take(&mut self) -> bool {
        // Only the giver sets the flag and only the taker clears it: seen once, it stays until the exchange.
        let fresh = self.shared.between.load(Ordering::Relaxed) & FRESH != 0;
        if fresh {
            self.own = self.shared.between.swap(self.own, Ordering::AcqRel) & !FRESH;
        }
        fresh
    }
}

/// Two places: one in use, one for the next value.
#[derive(Debug)]
pub struct Handover {
    offered: AtomicBool,
    split: AtomicBool,
}

/// The side of a [`Handover`] that prepares values.
#[derive(Debug)]
pub struct Preparer<'a> {
    shared: &'a Handover,
    own: u8,
    /// `true` once something has been offered.
    any: bool,
}

/// The side of a [`Handover`] that uses values.
#[derive(Debug)]
pub struct User<'a> {
    shared: &'a Handover,
    /// The place in use, once there is one.
    own: Option<u8>,
}

impl Handover {
    /// Initial state: nothing offered yet.
    #[allow(clippy::new_without_default, reason = "it belongs into a static")]
    pub const fn new() -> Self {
        Self { offered: AtomicBool::new(false), split: AtomicBool::new(false) }
    }

    /// Both sides; none from the second call on.
    pub fn split(&self) -> Option<(Preparer<'_>, User<'_>)> {
        let first = !self.split.swap(true, Ordering::AcqRel);
        first.then_some((Preparer { shared: self, own: 0, any: false }, User { shared: self, own: None }))
    }
}

impl Preparer<'_> {
    /// The place with the value in use, 0 or 1, to be read; none before the first was taken, and while a value waits.
    pub fn in_use(&self) -> Option<usize> {
        self.place().filter(|_| self.any).map(|place| place ^ 1)
    }

    /// The place to write the next value to, 0 or 1; none while the value before has not been taken.
    pub fn place(&self) -> Option<usize> {
        (!self.shared.offered.load(Ordering::Acquire)).then_some(self.own.into())
    }

    /// Offers what was written to [`Preparer::place`]; false, and nothing happens, while the value before has not been
    /// taken.
    pub fn offer(&mut self) -> bool {
        if self.place().is_none() {
            return false;
        }
        // The place in use becomes the preparer's, but not before the user has let go of it.
        self.own ^= 1;
        self.any = true;
        self.shared.offered.store(true, Ordering::Release);
        true
    }
}

impl User<'_> {
    /// The place with the value in use, 0 or 1; none before the first was taken. It is the user's until [`User::take`].
    #[inline(always)]
    pub fn place(&self) -> Option<usize> {
        self.own.map(usize::from)
    }

    /// Takes the next value, if one is offered, and lets go of the one in use; whether it did.
    #[inline(always)]
    pub fn take(&mut self) -> bool {
        if !self.shared.offered.load(Ordering::Acquire) {
            return false;
        }
        self.own = Some(self.own.map_or(0, |place| place ^ 1));
        self.shared.offered.store(false, Ordering::Release);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A giver that writes into its place and gives, and a taker that reads: each event is indivisible where the real
    /// ones are one atomic exchange, so the orders of events are all that can happen.
    #[derive(Clone, Copy, Debug)]
    enum Event {
        /// Half of a value.
        WriteFirst,
        /// The other half, and give or offer it.
        WriteSecond,
        Take,
        ReadFirst,
        ReadSecond,
    }

    fn events() -> impl Strategy<Value = Vec<Event>> {
        let event = prop_oneof![
            Just(Event::WriteFirst),
            Just(Event::WriteSecond),
            Just(Event::Take),
            Just(Event::ReadFirst),
            Just(Event::ReadSecond)
        ];
        prop::collection::vec(event, 0..200)
    }

    #[test]
    fn there_is_one_giver_and_one_taker() {
        let newest = Newest::new();
        assert!(newest.split().is_some());
        assert!(newest.split().is_none());
        let handover = Handover::new();
        assert!(handover.split().is_some());
        assert!(handover.split().is_none());
    }

    #[test]
    fn a_second_offer_waits_until_the_first_is_taken() {
        let handover = Handover::new();
        let (mut preparer, mut user) = handover.split().unwrap();
        assert_eq!((preparer.place(), preparer.in_use(), user.place()), (Some(0), None, None));
        assert!(!user.take());
        assert!(preparer.offer());
        assert_eq!((preparer.place(), preparer.in_use()), (None, None));
        assert!(!preparer.offer());
        assert!(user.take());
        assert_eq!((preparer.place(), preparer.in_use(), user.place()), (Some(1), Some(0), Some(0)));
    }

    proptest! {
        #[test]
        fn the_newest_value_arrives_whole_in_every_order_of_events(events in events()) {
            let newest = Newest::new();
            let (mut giver, mut taker) = newest.split().unwrap();
            let mut places = [(0, 0); 3];
            let (mut given, mut writing, mut reading) = (0, None, None);
            for event in events {
                match event {
                    Event::WriteFirst => {
                        writing = Some(given + 1);
                        places[giver.place()].0 = given + 1;
                    }
                    Event::WriteSecond => if let Some(value) = writing.take() {
                        places[giver.place()].1 = value;
                        giver.give();
                        given = value;
                    },
                    Event::Take => {
                        let before = places[taker.place()].0;
                        prop_assert_eq!(taker.take(), before != given);
                        prop_assert_eq!(places[taker.place()], (given, given));
                        reading = None;
                    }
                    Event::ReadFirst => reading = Some(places[taker.place()].0),
                    Event::ReadSecond => if let Some(first) = reading {
                        prop_assert_eq!(places[taker.place()].1, first);
                    },
                }
                prop_assert_ne!(giver.place(), taker.place());
            }
        }

        #[test]
        fn every_offered_value_arrives_whole_in_every_order_of_events(events in events()) {
            let handover = Handover::new();
            let (mut preparer, mut user) = handover.split().unwrap();
            let mut places = [(0, 0); 2];
            let (mut offered, mut taken, mut writing, mut reading) = (0, 0, None, None);
            for event in events {
                match event {
                    Event::WriteFirst => if let Some(place) = preparer.place() {
                        writing = Some(offered + 1);
                        places[place].0 = offered + 1;
                    },
                    Event::WriteSecond => if let (Some(value), Some(place)) = (writing.take(), preparer.place()) {
                        places[place].1 = value;
                        prop_assert!(preparer.offer());
                        offered = value;
                    },
                    Event::Take => {
                        prop_assert_eq!(user.take(), taken != offered);
                        taken = offered;
                        reading = None;
                    }
                    Event::ReadFirst => reading = user.place().map(|place| places[place].0),
                    Event::ReadSecond => if let (Some(first), Some(place)) = (reading, user.place()) {
                        prop_assert_eq!(places[place], (first, first));
                        prop_assert_eq!(first, taken);
                    },
                }
                prop_assert!(preparer.place().is_none() || preparer.place() != user.place());
                prop_assert!(preparer.in_use().is_none() || preparer.in_use() == user.place());
            }
        }
    }
}
