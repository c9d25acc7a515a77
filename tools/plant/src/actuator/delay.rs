//! Values that arrive some periods late.

/// Longest delay, periods.
pub const MAXIMUM_DELAY: usize = 7;

/// The last values, one a period. Before there is a past, all of it is the first value.
#[derive(Clone, Debug)]
pub(crate) struct Delay<T> {
    values: [T; MAXIMUM_DELAY + 1],
    newest: usize,
    periods: usize,
}

impl<T: Copy> Delay<T> {
    /// A delay of `periods`, up to [`MAXIMUM_DELAY`].
    pub(crate) fn new(periods: usize, first: T) -> Self {
        Self { values: [first; MAXIMUM_DELAY + 1], newest: 0, periods: periods.min(MAXIMUM_DELAY) }
    }

    /// Takes the value of a new period.
    pub(crate) fn push(&mut self, value: T) {
        self.newest = (self.newest + 1) % self.values.len();
        self.values[self.newest] = value;
    }

    /// The value as it was the delay ago.
    pub(crate) fn late(&self) -> T {
        self.values[(self.newest + self.values.len() - self.periods) % self.values.len()]
    }
}
