//! The independent watchdog: fed only while the control interrupt and both executors are alive.
//!
//! After 100 ms without food the chip resets; its pins then float and the gate drivers' own resistors keep the bridge off.

use super::control;
use core::sync::atomic::{AtomicU32, Ordering};
use embassy_stm32::Peri;
use embassy_stm32::pac;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;
use static_cell::StaticCell;

/// Longest time without food, µs; runs on the low-speed oscillator, which is off by up to 10 % over temperature.
const TIMEOUT_US: u32 = 100_000;
/// How often it is to be fed, ms.
pub const FEED_MS: u64 = 20;

/// Counts up whenever the medium executor runs its task.
static MEDIUM: AtomicU32 = AtomicU32::new(0);

/// Who has to be alive, as last seen.
pub struct Watchdog {
    hardware: IndependentWatchdog<'static, IWDG>,
    control: u32,
    medium: u32,
}

/// The watchdog, stopped.
pub fn new(hardware: Peri<'static, IWDG>) -> &'static mut Watchdog {
    static WATCHDOG: StaticCell<Watchdog> = StaticCell::new();
    WATCHDOG.init(Watchdog { hardware: IndependentWatchdog::new(hardware, TIMEOUT_US), control: 0, medium: 0 })
}

/// The medium executor is alive.
pub fn medium_is_alive() {
    MEDIUM.fetch_add(1, Ordering::Relaxed);
}

impl Watchdog {
    /// Starts it; nothing but a reset stops it.
    ///
    /// It stands still while a debugger holds the core, or else nothing could be looked at.
    pub fn start(&mut self) {
        pac::DBGMCU.apb1lfzr().modify(|w| w.set_iwdg(true));
        self.hardware.unleash();
    }

    /// Feeds it, if control interrupt and medium executor have run since the last call; the caller is the slow one.
    pub fn feed(&mut self) {
        let (control, medium) = (control::statistics().steps, MEDIUM.load(Ordering::Relaxed));
        if control != self.control && medium != self.medium {
            self.hardware.pet();
        }
        (self.control, self.medium) = (control, medium);
    }
}
