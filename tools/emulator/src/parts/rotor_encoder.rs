//! Absolute encoder of the rotor on SPI, as a board sees any such chip.

use crate::chip::wiring::SpiFrame;

/// Encoder on a line that others can share.
pub trait RotorEncoder: Default {
    /// Counts a turn.
    const COUNTS: u32;

    /// The select line, low or not. `count` is the rotor's angle now, for encoders that take it at an edge of the line.
    fn select(&mut self, selected: bool, count: impl FnOnce() -> u32);

    /// A frame that ended, and the rotor's angle then. The answer; none where the encoder leaves the line alone.
    fn exchange(&mut self, frame: &SpiFrame, count: u32) -> Option<u16>;
}
