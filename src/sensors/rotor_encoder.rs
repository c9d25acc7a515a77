//! Absolute encoder of the rotor on SPI, as a board's program and the host's tests see any such chip; control step.
//!
//! A chip is a file that implements [`RotorEncoder`]; the board's alias in [`crate::default_configuration`] chooses it.
//! All of it is known when the program is compiled: the control step pays nothing for the choice.

/// Encoder that answers a command of 16 bits with the rotor's angle, one frame a selection.
pub trait RotorEncoder {
    /// Command that reads the angle.
    const READ: u16;
    /// SPI mode: polarity of the clock, twice, plus its phase; 0 to 3.
    const MODE: u8;
    /// Fastest clock, Hz.
    const FASTEST: u32;
    /// Time from selection to the first edge of the clock, ns.
    const SELECT: u32;
    /// Frames from a command to its answer: 0 where the same frame brings it, 1 where the next does.
    const ANSWERS_AFTER: u32;

    /// Angle in an answer, 2^32 a turn; none where the answer shows a fault of the line or of the encoder.
    fn angle(frame: u16) -> Option<u32>;
}

/// Fastest clock of a bus that the encoder bears, Hz: the kernel's clock divided by a power of two from 2 to 256
/// (RM0440, SPIx_CR1, field BR). The slowest one where all are too fast.
pub const fn clock<E: RotorEncoder>(kernel: u32) -> u32 {
    let mut divider = 2;
    while divider < 256 && kernel > E::FASTEST.saturating_mul(divider) {
        divider *= 2;
    }
    kernel / divider
}

/// Core cycles from selection to the first edge of the clock, for a core with a clock in MHz; rounded up.
pub const fn select_cycles<E: RotorEncoder>(megahertz: u32) -> u32 {
    (E::SELECT * megahertz).div_ceil(1_000)
}

/// Age of an angle when the control step takes it, s. A frame runs while a step does, so the next step takes what it
/// brought.
pub const fn age<E: RotorEncoder>(steps_per_second: f32) -> f32 {
    (1 + E::ANSWERS_AFTER) as f32 / steps_per_second
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Encoder with a fastest clock, Hz.
    struct Bears<const FASTEST: u32>;

    impl<const FASTEST: u32> RotorEncoder for Bears<FASTEST> {
        const READ: u16 = 0;
        const MODE: u8 = 0;
        const FASTEST: u32 = FASTEST;
        const SELECT: u32 = 100;
        const ANSWERS_AFTER: u32 = 0;

        fn angle(_: u16) -> Option<u32> {
            None
        }
    }

    #[test]
    fn the_clock_is_the_fastest_that_the_encoder_bears() {
        assert_eq!(clock::<Bears<10_625_000>>(170_000_000), 10_625_000);
        assert_eq!(clock::<Bears<10_624_999>>(170_000_000), 5_312_500);
        assert_eq!(clock::<Bears<{ u32::MAX }>>(170_000_000), 85_000_000);
        assert_eq!(clock::<Bears<1>>(170_000_000), 664_062);
    }

    #[test]
    fn a_selection_is_never_too_short_by_a_part_of_a_cycle() {
        assert_eq!(select_cycles::<Bears<1>>(170), 17);
        assert_eq!(select_cycles::<Bears<1>>(171), 18);
    }

    #[test]
    fn an_answer_in_the_same_frame_is_a_step_old() {
        assert_eq!(age::<Bears<1>>(40_000.0), 25e-6);
    }
}
