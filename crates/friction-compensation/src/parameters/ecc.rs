//! Response to a double error of the flash's ECC: go on where a parameter word is torn, stop everywhere else.
//!
//! Called by the handler of the non-maskable interrupt; pure. A loss of power leaves torn double words in the
//! parameters' pages, and reading one raises that interrupt (RM0440, FLASH_ECCR). That the address counts bytes from
//! the bank's start is unconfirmed.

use core::ops::Range;

/// FLASH_ECCR: address of the error in its bank.
const ADDRESS: u32 = 0x0007_ffff;
/// The error is in the second bank.
const SECOND_BANK: u32 = 1 << 21;
/// The error is in the system flash.
const SYSTEM: u32 = 1 << 22;
/// Interrupt on a corrected error is enabled.
const CORRECTION_INTERRUPT: u32 = 1 << 24;
/// A double error in the upper half of a 128-bit word, which exists only where two banks are read as one.
const DOUBLE_ERROR_UPPER: u32 = 1 << 29;
/// A double error.
const DOUBLE_ERROR: u32 = 1 << 31;

/// Addresses of the flash and of the parameters in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Storage {
    /// Address of the flash.
    pub flash: u32,
    /// Bytes of a bank.
    pub bank: u32,
    /// The pages that are written while the program is in use.
    pub parameters: Range<u32>,
}

/// Action of the handler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// A parameter word is torn: write `clear` to FLASH_ECCR, note it, go on.
    Resume {
        /// Address of the double word.
        address: u32,
        /// Clears the flag of the double error and no other.
        clear: u32,
    },
    /// Another error: the program cannot go on.
    Fatal {
        /// Address that the register speaks of.
        address: u32,
    },
}

/// Decides from the value of FLASH_ECCR.
pub fn decide(status: u32, storage: &Storage) -> Decision {
    let bank = if status & SECOND_BANK != 0 { storage.bank } else { 0 };
    let offset = status & ADDRESS;
    let address = storage.flash.wrapping_add(bank).wrapping_add(offset);
    let torn = status & (DOUBLE_ERROR | DOUBLE_ERROR_UPPER | SYSTEM) == DOUBLE_ERROR;
    if torn && offset < storage.bank && storage.parameters.contains(&address) {
        // All flags are cleared by a one; the corrected errors' are somebody else's.
        Decision::Resume { address, clear: status & CORRECTION_INTERRUPT | DOUBLE_ERROR }
    } else {
        Decision::Fatal { address }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one_bank() -> Storage {
        Storage { flash: 0x0800_0000, bank: 128 << 10, parameters: 0x0801_e000..0x0802_0000 }
    }

    fn two_banks() -> Storage {
        Storage { flash: 0x0800_0000, bank: 256 << 10, parameters: 0x0807_e000..0x0808_0000 }
    }

    #[test]
    fn a_torn_parameter_word_is_cleared_and_the_program_goes_on() {
        for offset in (0x1_e000..0x2_0000).step_by(8) {
            let address = 0x0800_0000 + offset;
            let expected = Decision::Resume { address, clear: 1 << 31 };
            assert_eq!(decide(1 << 31 | offset, &one_bank()), expected);
            let address = 0x0804_0000 + 0x2_0000 + offset;
            let expected = Decision::Resume { address, clear: 1 << 31 };
            assert_eq!(decide(1 << 31 | 1 << 21 | (0x2_0000 + offset), &two_banks()), expected);
        }
    }

    #[test]
    fn only_the_flag_of_the_double_error_is_cleared() {
        let others = 1 << 30 | 1 << 28 | 1 << 24;
        let Decision::Resume { clear, .. } = decide(1 << 31 | others | 0x1_e000, &one_bank()) else {
            panic!("a torn parameter word");
        };
        assert_eq!(clear, 1 << 31 | 1 << 24, "the interrupt stays enabled, corrected errors stay flagged");
    }

    #[test]
    fn everything_else_is_fatal() {
        let fatal = |status, storage: &Storage| matches!(decide(status, storage), Decision::Fatal { .. });
        assert!(fatal(0x1_e000, &one_bank()), "no flag: clock security, SRAM parity");
        assert!(fatal(1 << 30 | 0x1_e000, &one_bank()), "a corrected error");
        assert!(fatal(1 << 29 | 0x1_e000, &one_bank()), "upper half of 128 bits alone");
        assert!(fatal(1 << 31 | 1 << 29 | 0x1_e000, &one_bank()), "both halves of 128 bits");
        assert!(fatal(1 << 31 | 1 << 22 | 0x1_e000, &one_bank()), "system flash");
        assert!(fatal(1 << 31 | 0x1_dff8, &one_bank()), "the program's last double word");
        assert!(fatal(1 << 31 | 0x2_0000, &one_bank()), "behind the parameters");
        assert!(fatal(1 << 31 | 1 << 21 | 0x1_e000, &one_bank()), "a second bank that is not there");
        assert!(fatal(1 << 31 | 0x7_e000, &two_banks()), "beyond the first bank");
        assert!(fatal(1 << 31 | 0x3_e000, &two_banks()), "the same offset in the program's bank");
        assert_eq!(decide(1 << 31, &one_bank()), Decision::Fatal { address: 0x0800_0000 });
    }
}
