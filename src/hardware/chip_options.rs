//! Option bytes of the STM32G4 that the boards' programs need: FLASH_OPTR (RM0440, 3.7.8 and 5.7.8).
//!
//! | bit | name | needed | because |
//! |---|---|---|---|
//! | 24 | SRAM_PE | 0: parity of the SRAM is checked | a flipped bit then switches the bridge off: by TIM1's break on the B-G431B-ESC1, by the non-maskable interrupt on both |
//! | 26 | nSWBOOT0 | 0: BOOT0 is an option bit | PB8 is BOOT0 otherwise, where the B-G431B-ESC1 has its encoder's index and the moteus r4 a connector: a reset could end in the bootloader |
//! | 27 | nBOOT0 | 1: boots from flash | the option bit counts once nSWBOOT0 is 0 |
//!
//! SRAM_PE and nSWBOOT0 are 1 as delivered. They are set by an explicit command alone: it resets the chip.

/// SRAM parity is not checked.
pub const SRAM_PE: u32 = 1 << 24;
/// BOOT0 is the pin PB8.
pub const N_SWBOOT0: u32 = 1 << 26;
/// BOOT0 is low, where it is an option bit.
pub const N_BOOT0: u32 = 1 << 27;
/// Number that is written to object 2303h:4 to set them: "OPTB".
pub const COMMAND: u32 = u32::from_le_bytes(*b"OPTB");

/// The option bytes as the chip has loaded them. 0 where there is no chip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChipOptions {
    /// FLASH_OPTR.
    pub found: u32,
}

impl ChipOptions {
    /// FLASH_OPTR as the program needs it; 0 where there is no chip.
    pub const fn needed(self) -> u32 {
        match self.found {
            0 => 0,
            found => found & !(SRAM_PE | N_SWBOOT0) | N_BOOT0,
        }
    }

    /// Mask of the wrong ones of the three: bit 0 SRAM_PE, bit 1 nSWBOOT0, bit 2 nBOOT0.
    pub const fn wrong(self) -> u8 {
        let different = self.found ^ self.needed();
        (different >> 24 & 1 | different >> 25 & 0b110) as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Options of an STM32G431CB as delivered.
    const DELIVERED: u32 = 0xffaf_f8aa;

    #[test]
    fn a_chip_as_delivered_has_two_of_three_wrong() {
        let options = ChipOptions { found: DELIVERED };
        assert_eq!(options.wrong(), 0b011);
        assert_eq!(options.needed(), 0xfaaf_f8aa, "and nothing else is changed");
        assert_eq!(ChipOptions { found: options.needed() }.wrong(), 0);
    }

    #[test]
    fn each_bit_is_told_by_itself() {
        let right = ChipOptions { found: DELIVERED }.needed();
        for (place, (bit, set)) in [(SRAM_PE, false), (N_SWBOOT0, false), (N_BOOT0, true)].into_iter().enumerate() {
            assert_eq!(right & bit != 0, set);
            assert_eq!(ChipOptions { found: right ^ bit }.wrong(), 1 << place);
        }
    }

    #[test]
    fn without_a_chip_nothing_is_wrong() {
        assert_eq!((ChipOptions::default().needed(), ChipOptions::default().wrong()), (0, 0));
    }
}
