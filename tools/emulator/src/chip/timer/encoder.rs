//! The encoder mode of a timer: RM0440, 29.3.21 "Encoder interface mode".
//!
//! Every edge of both inputs counts; the direction follows from which came first. The inputs' filters are not modelled:
//! the board says what passed them.

use super::super::wiring::Quadrature;

/// Counts an encoder's edges.
#[derive(Clone, Copy, Debug)]
pub struct Encoder {
    /// The timer's count.
    count: u32,
    /// Count of the encoder then; none before it was asked.
    seen: Option<i64>,
    up: bool,
}

/// Effect of the edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Followed {
    /// The count.
    pub count: u32,
    /// The last edge counted up.
    pub up: bool,
    /// The count went beyond the top or below 0.
    pub wrapped: bool,
    /// The count at an index.
    pub captured: Option<u32>,
}

impl Encoder {
    /// Encoder from a count on.
    pub const fn new(count: u32) -> Self {
        Self { count, seen: None, up: true }
    }

    /// The counter was written.
    pub fn set(&mut self, count: u32) {
        self.count = count;
    }

    /// Edges since the last call: the count goes round between 0 and the top.
    pub fn follow(&mut self, quadrature: Quadrature, top: u32) -> Followed {
        let seen = self.seen.replace(quadrature.count).unwrap_or(quadrature.count);
        let around = i64::from(top) + 1;
        let before = i64::from(self.count);
        let place = |count: i64| (before + count - seen).rem_euclid(around) as u32;
        let moved = before + quadrature.count - seen;
        if quadrature.count != seen {
            self.up = quadrature.count > seen;
        }
        self.count = place(quadrature.count);
        let captured = quadrature.index.map(place);
        Followed { count: self.count, up: self.up, wrapped: !(0..around).contains(&moved), captured }
    }
}
