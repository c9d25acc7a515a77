//! The independent watchdog: fed only while the control interrupt and both executors are alive. The slow executor may
//! be busy for a while, with the proof of an image or with the flash; the control interrupt never is.
//!
//! After 100 ms without food the chip resets; its pins then float and the gate drivers' own resistors keep the bridge
//! off.

use super::control;
use core::sync::atomic::{AtomicU32, Ordering};
use embassy_stm32::Peri;
use embassy_stm32::pac;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Instant};
use static_cell::StaticCell;

/// Longest time without food, µs; runs on the low-speed oscillator, which is off by up to 10 % over temperature.
const TIMEOUT_US: u32 = 100_000;
/// Feeding period, ms; fed by the medium executor, whose life the feeding itself proves.
pub const FEED_MS: u32 = 20;
/// Longest time that the slow executor may be busy: the proof of an image takes 0.1 s alone, and some ten times as long
/// beside control steps that leave it a tenth of the core.
const PATIENCE: Duration = Duration::from_secs(5);

/// Counts up whenever the slow executor runs its task.
static SLOW: AtomicU32 = AtomicU32::new(0);

/// Watchdog, and the signs of life of all that have to be alive, as last seen.
pub struct Watchdog {
    hardware: IndependentWatchdog<'static, IWDG>,
    control: u32,
    slow: u32,
    slow_seen: Instant,
}

/// The watchdog, stopped.
pub fn new(hardware: Peri<'static, IWDG>) -> &'static mut Watchdog {
    static WATCHDOG: StaticCell<Watchdog> = StaticCell::new();
    WATCHDOG.init(Watchdog {
        hardware: IndependentWatchdog::new(hardware, TIMEOUT_US),
        control: 0,
        slow: 0,
        slow_seen: Instant::now(),
    })
}

/// The slow executor is alive.
pub fn slow_is_alive() {
    SLOW.fetch_add(1, Ordering::Relaxed);
}

impl Watchdog {
    /// Starts it; nothing but a reset stops it.
    ///
    /// It stands still while a debugger holds the core, or else nothing could be looked at.
    pub fn start(&mut self) {
        pac::DBGMCU.apb1lfzr().modify(|w| w.set_iwdg(true));
        self.hardware.unleash();
    }

    /// Feeds it, if the control interrupt, where it has been started, has run since the last call and the slow executor
    /// not too long ago; the caller is the medium one.
    pub fn feed(&mut self) {
        let (steps, slow) = (control::statistics().steps, SLOW.load(Ordering::Relaxed));
        if slow != self.slow {
            (self.slow, self.slow_seen) = (slow, Instant::now());
        }
        if (steps != self.control || !control::is_enabled()) && self.slow_seen.elapsed() < PATIENCE {
            self.hardware.pet();
        }
        self.control = steps;
    }
}
