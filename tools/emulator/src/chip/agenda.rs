//! When each peripheral that counts cycles next does something, and which interrupts it asks for: computed anew for those only that may have
//! changed.

/// Peripherals that have a place: timers, converters and SPIs.
pub const PLACES: usize = 16;

/// What is known of each.
#[derive(Clone, Debug)]
pub struct Agenda {
    next: [u64; PLACES],
    lines: [u128; PLACES],
    /// Bit of each that may have changed since.
    changed: u32,
}

impl Agenda {
    /// Nothing is known yet.
    pub const fn new() -> Self {
        Self { next: [u64::MAX; PLACES], lines: [0; PLACES], changed: u32::MAX }
    }

    /// Somebody may have changed a peripheral: to be called with every access that can.
    #[inline]
    pub const fn touch(&mut self, place: usize) {
        self.changed |= 1 << (place % PLACES);
    }

    /// Any of them may have changed.
    pub const fn touch_all(&mut self) {
        self.changed = u32::MAX;
    }

    /// Whether it may have changed.
    #[inline]
    pub const fn is_touched(&self, place: usize) -> bool {
        self.changed >> (place % PLACES) & 1 != 0
    }

    /// What is true of a peripheral now: its next cycle, and the levels of its lines.
    #[inline]
    pub const fn note(&mut self, place: usize, next: u64, lines: u128) {
        self.next[place % PLACES] = next;
        self.lines[place % PLACES] = lines;
        self.changed &= !(1 << (place % PLACES));
    }

    /// Whether something is due at a cycle in a peripheral, or it may have changed.
    #[inline]
    pub const fn may_be_due(&self, place: usize, cycle: u64) -> bool {
        self.is_touched(place) || self.next[place % PLACES] <= cycle
    }

    /// The earliest cycle of all.
    #[inline]
    pub fn next(&self) -> u64 {
        self.next.iter().fold(u64::MAX, |earliest, next| earliest.min(*next))
    }

    /// The levels of all lines.
    #[inline]
    pub fn lines(&self) -> u128 {
        self.lines.iter().fold(0, |all, lines| all | lines)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_earliest_of_all_is_next_and_lines_are_together() {
        let mut agenda = Agenda::new();
        agenda.note(3, 700, 1 << 25);
        agenda.note(9, 500, 1 << 100);
        assert_eq!((agenda.next(), agenda.lines()), (500, 1 << 25 | 1 << 100));
        agenda.note(9, u64::MAX, 0);
        assert_eq!((agenda.next(), agenda.lines()), (700, 1 << 25));
    }

    #[test]
    fn what_was_touched_is_looked_at_until_it_is_noted() {
        let mut agenda = Agenda::new();
        agenda.note(0, 100, 0);
        assert!(!agenda.may_be_due(0, 99) && agenda.may_be_due(0, 100));
        agenda.touch(0);
        assert!(agenda.may_be_due(0, 0) && agenda.is_touched(0));
        agenda.note(0, 100, 0);
        assert!(!agenda.may_be_due(0, 0));
    }
}
