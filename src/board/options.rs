//! The chip's option bytes: as they were loaded at the last reset, and set as the programs need them; thread mode.

use embassy_stm32::pac;
use joint_firmware::hardware::chip_options::ChipOptions;

/// Options as loaded.
pub fn found() -> ChipOptions {
    ChipOptions { found: pac::FLASH.optr().read().0 }
}

/// Logs what is wrong; once, at start.
pub fn report() {
    let options = found();
    if options.wrong() != 0 {
        defmt::warn!("option bytes {:#010x} instead of {:#010x}", options.found, options.needed());
    }
}

/// Keys of the flash and of the option bytes (RM0440, 3.4.2: FLASH_KEYR, FLASH_OPTKEYR).
const KEYS: ([u32; 2], [u32; 2]) = ([0x4567_0123, 0xcdef_89ab], [0x0819_2a3b, 0x4c5d_6e7f]);

/// Sets what is wrong and has the chip load it, which resets it (RM0440, 3.4.2, "Modifying user options", and 3.4.3);
/// where nothing is wrong or the flash is not free, restarts. The joint is off.
pub fn set() -> ! {
    super::bridge_off();
    let options = found();
    if options.wrong() != 0 {
        cortex_m::interrupt::disable();
        let flash = pac::FLASH;
        KEYS.0.into_iter().for_each(|key| flash.keyr().write_value(key));
        KEYS.1.into_iter().for_each(|key| flash.optkeyr().write_value(key));
        // Flags that earlier operations have left are cleared by ones.
        flash.sr().write_value(flash.sr().read());
        flash.optr().write(|w| w.0 = options.needed());
        flash.cr().modify(|w| w.set_optstrt(true));
        // The watchdog ends what does not end.
        while flash.sr().read().bsy() {}
        flash.cr().modify(|w| w.set_obl_launch(true));
    }
    super::faults::restart()
}
