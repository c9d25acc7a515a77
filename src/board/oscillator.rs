//! The internal oscillator, from which everything on both boards is clocked, the bus as well; thread mode.

use embassy_stm32::pac;

/// Trims it (RM0440, 7.4.2). Everything runs on: a step is some 0.3 %, which the PLL follows.
pub fn trim(trim: u8) {
    pac::RCC.icscr().modify(|w| w.set_hsitrim(trim));
}
