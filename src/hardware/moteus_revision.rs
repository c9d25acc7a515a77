//! Family and revision of a board of the moteus family by its pins, before any other pin is driven.
//!
//! Method of the vendor's firmware (fw/moteus_hw.cc), read not copied. Boards of other families (c1, x1) pull PB10 or
//! PB11; those of the families r4 and n1 leave both floating, so they follow the chip's own pull-up and pull-down. An
//! r4 tells its revision by pulling PC6, PA15 and PA10 low. A board of the family n1 is told from an r4 by its gate
//! driver, which lies elsewhere: as an r4 of revision 4 it shows a driver that does not answer, unless its pins happen
//! to tell of another revision (unconfirmed).
//!
//! | code | silk | gate driver |
//! |---|---|---|
//! | 0 | r4.1 to r4.3 | DRV8323 |
//! | 1 | r4.4 | DRV8323 |
//! | 2 | r4.5 | DRV8323 |
//! | 3 | r4.5b to r4.8 | DRV8353 with a dead time of 200 ns |
//! | 4 | r4.10, r4.11 | DRV8353 with a dead time of 50 ns |
//!
//! The program is for code 4 alone: dead time, supply divider and gate currents are those of that revision, and
//! stronger gate currents damage the revisions of code 3.

/// Code of the revision that the program is for.
pub const SUPPORTED: u8 = 4;
/// Bit of [`Pins::code`]: PB10 or PB11 does not float, so the board is of another family.
pub const OTHER_FAMILY: u8 = 1 << 7;

/// Levels of the pins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pins {
    /// PB10 and PB11, pulled up.
    pub pulled_up: [bool; 2],
    /// PB10 and PB11, pulled down.
    pub pulled_down: [bool; 2],
    /// PC6, PA15, PA10, pulled up.
    pub revision: [bool; 3],
}

impl Pins {
    /// Revision, bits 0 to 2, of an r4 or an n1; with [`OTHER_FAMILY`] of neither.
    pub fn code(&self) -> u8 {
        let [a, b, c] = self.revision.map(|high| u8::from(!high));
        let family = if self.pulled_up == [true; 2] && self.pulled_down == [false; 2] { 0 } else { OTHER_FAMILY };
        family | c << 2 | b << 1 | a
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const R4_11: Pins = Pins { pulled_up: [true; 2], pulled_down: [false; 2], revision: [true, true, false] };

    #[test]
    fn an_r4_11_pulls_the_third_pin_alone() {
        assert_eq!(R4_11.code(), SUPPORTED);
    }

    #[test]
    fn every_other_code_is_another_revision() {
        for code in 0..8u8 {
            let pins = Pins { revision: [0, 1, 2].map(|bit| code >> bit & 1 == 0), ..R4_11 };
            assert_eq!(pins.code(), code);
        }
    }

    #[test]
    fn a_pin_that_does_not_float_is_another_family() {
        for pins in [
            Pins { pulled_up: [false, true], ..R4_11 },
            Pins { pulled_up: [true, false], ..R4_11 },
            Pins { pulled_down: [true, false], ..R4_11 },
            Pins { pulled_down: [false, true], ..R4_11 },
        ] {
            assert_eq!(pins.code(), OTHER_FAMILY | SUPPORTED);
        }
    }
}
