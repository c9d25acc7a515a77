//! The boards: everything that knows a pin or a register, and all unsafe code of the program.
//!
//! One file a board, all with the same items (`NAME`, `CONTROL_HZ`, `chip_configuration`, `start_clocks`, `start`,
//! `Sensors`, `apply`, ...); the others are shared. Nothing of this has run on a board; facts that nobody confirmed are
//! marked in the boards' files.
//!
//! embassy's drivers do the clocks, the pins, the timers' time bases, the operational amplifiers, the encoder counter,
//! SPI outside the control interrupt, the independent watchdog and time. Registers are written directly where they are
//! no choice:
//! - in the control interrupt, because the drivers check their arguments and panic;
//! - for injected conversions, because `Adc::new` knows only the asynchronous clock and enables the converter before
//!   another can be chosen, and because its triggers do not take a timer's compare channel as the instant of sampling;
//! - to switch off in a fault handler, which owns no driver.

pub mod adc;
pub mod can;
pub mod control;
mod copy;
mod critical_section;
#[cfg(feature = "b-g431b-esc1")]
mod division;
pub mod entry;
pub mod faults;
pub mod flash;
pub mod memory;
pub mod options;
pub mod oscillator;
pub mod pwm;
pub mod random;
pub mod shadow;
mod shared;
pub mod watchdog;

#[cfg(feature = "b-g431b-esc1")]
mod b_g431b_esc1;
#[cfg(feature = "b-g431b-esc1")]
pub use b_g431b_esc1::*;

#[cfg(feature = "gate-driver")]
mod drv8353;
#[cfg(feature = "gate-driver")]
pub mod gate;
#[cfg(feature = "moteus-r4")]
mod moteus_r4;
#[cfg(feature = "moteus-r4")]
pub use moteus_r4::*;

pub use embassy_stm32::Peripherals;
use embassy_stm32::gpio::{Input, Output};
use embassy_stm32::peripherals::IWDG;
pub use joint_firmware::default_configuration::BoardConfiguration;
pub use shared::{Offering, Prepared, Publisher, Subscriber};

/// Parts of a started board, for the program.
pub struct Parts {
    /// Sensors of the control interrupt. None where it may not start; the bridge then stays off, and the watchdog does
    /// not wait for it.
    pub sensors: Option<Sensors>,
    /// The gate driver, for its task.
    #[cfg(feature = "gate-driver")]
    pub gate: gate::Parts,
    /// The light that a person sees.
    pub led: Led,
    /// The button, on boards that have one.
    pub button: Option<Input<'static>>,
    /// The CAN controller with its pins, stopped.
    pub can: embassy_stm32::can::CanConfigurator<'static>,
    /// The flash.
    pub flash: embassy_stm32::Peri<'static, embassy_stm32::peripherals::FLASH>,
    /// The independent watchdog, not started.
    pub watchdog: embassy_stm32::Peri<'static, IWDG>,
}

/// A light with its polarity.
pub struct Led {
    /// None on a board that the program is not for.
    pin: Option<Output<'static>>,
    lit_when_low: bool,
}

impl Led {
    /// Switches the light.
    pub fn set(&mut self, lit: bool) {
        if let Some(pin) = &mut self.pin {
            pin.set_level((lit != self.lit_when_low).into());
        }
    }
}

/// Reason for which a board does not start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum StartError {
    /// A converter did not get ready.
    Converter,
}
