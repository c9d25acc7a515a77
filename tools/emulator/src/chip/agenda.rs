//! Next cycle at which each peripheral that counts cycles does something, and the interrupts that it asks for: computed
//! anew for those only that may have changed.

/// Peripherals that have a place: timers, converters and SPIs.
pub const PLACES: usize = 16;

/// State of each peripheral as last known.
#[derive(Clone, Debug)]
pub struct Agenda {
    next: [u64; PLACES],
    lines: [u128; PLACES],
    /// Bit of each that may have changed since.
    changed: u32,
    /// Number of places that are used, counted from the first.
    used: usize,
    /// The earliest cycle of all, and bits of the places that have it.
    earliest: u64,
    first: u32,
    /// `true` if those two are right.
    ordered: bool,
    /// The levels of all lines.
    all_lines: u128,
}

impl Agenda {
    /// Initial agenda: nothing is known yet of so many peripherals.
    pub const fn new(used: usize) -> Self {
        let (next, lines) = ([u64::MAX; PLACES], [0; PLACES]);
        Self { next, lines, changed: u32::MAX, used, earliest: u64::MAX, first: 0, ordered: false, all_lines: 0 }
    }

    /// Notes that somebody may have changed a peripheral: to be called with every access that can.
    #[inline]
    pub const fn touch(&mut self, place: usize) {
        self.changed |= 1 << (place % PLACES);
    }

    /// Any of them may have changed.
    pub const fn touch_all(&mut self) {
        self.changed = u32::MAX;
    }

    /// The first of the places whose bits are set.
    #[inline]
    pub const fn first_of(&self, places: u32) -> Option<usize> {
        let place = places.trailing_zeros() as usize;
        if place < self.used { Some(place) } else { None }
    }

    /// The first of those that may have changed.
    #[inline]
    pub const fn first_touched(&self) -> Option<usize> {
        self.first_of(self.changed)
    }

    /// Notes the present state of a peripheral: its next cycle, and the levels of its lines. [`order`](Self::order)
    /// follows the last.
    #[inline]
    pub fn note(&mut self, place: usize, next: u64, lines: u128) {
        self.ordered &= std::mem::replace(&mut self.next[place % PLACES], next) == next;
        self.changed &= !(1 << (place % PLACES));
        if self.lines[place % PLACES] != lines {
            self.lines[place % PLACES] = lines;
            self.all_lines = self.lines.iter().fold(0, |all, lines| all | lines);
        }
    }

    /// Finds which of them are due first.
    #[inline]
    pub fn order(&mut self) {
        if std::mem::replace(&mut self.ordered, true) {
            return;
        }
        let (mut earliest, mut first) = (u64::MAX, 0);
        for (place, next) in self.next.iter().take(self.used).enumerate() {
            if *next <= earliest {
                first = if *next < earliest { 0 } else { first } | 1 << place;
                earliest = *next;
            }
        }
        (self.earliest, self.first) = (earliest, first);
    }

    /// Bits of the places that are due first, if that is not behind a cycle.
    #[inline]
    pub const fn due(&self, cycle: u64) -> u32 {
        if self.earliest <= cycle { self.first } else { 0 }
    }

    /// Bits of the places that may have changed.
    #[inline]
    pub const fn changed(&self) -> u32 {
        self.changed
    }

    /// The earliest cycle of all.
    #[inline]
    pub const fn next(&self) -> u64 {
        self.earliest
    }

    /// The levels of all lines.
    #[inline]
    pub const fn lines(&self) -> u128 {
        self.all_lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_earliest_of_all_is_next_and_lines_are_together() {
        let mut agenda = Agenda::new(PLACES);
        agenda.note(3, 700, 1 << 25);
        agenda.note(9, 500, 1 << 100);
        agenda.order();
        assert_eq!((agenda.next(), agenda.lines()), (500, 1 << 25 | 1 << 100));
        agenda.note(9, u64::MAX, 0);
        agenda.order();
        assert_eq!((agenda.next(), agenda.lines()), (700, 1 << 25));
    }

    #[test]
    fn what_was_touched_is_looked_at_until_it_is_noted() {
        let mut agenda = Agenda::new(PLACES);
        agenda.note(0, 100, 0);
        agenda.note(1, 90, 0);
        agenda.order();
        assert_eq!([agenda.due(89), agenda.due(90)], [0, 2]);
        agenda.note(0, 90, 0);
        agenda.order();
        assert_eq!(agenda.due(90), 3);
        agenda.touch(0);
        assert_eq!((agenda.changed() & 3, agenda.first_touched()), (1, Some(0)));
        agenda.note(0, 100, 0);
        assert_eq!(agenda.changed() & 3, 0);
    }
}
