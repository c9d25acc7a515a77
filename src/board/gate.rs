//! The moteus r4's gate driver, looked after by a task: set up as often as it takes, its faults read, counted and
//! named, cleared where the joint's fault is reset.
//!
//! The control interrupt knows of it what its fault line and one byte say ([`State`]): the bridge is off unless the
//! driver is ready, and only the task makes it ready, once every register has been read back and the fault line is
//! high. Before it is ready for the first time there is no control step: the joint is "not ready to switch on", because
//! its current amplifiers are in the driver.

use super::control;
use super::drv8353::Drv8353;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU16, AtomicU32, Ordering};
use embassy_stm32::gpio::Output;
use embassy_stm32::pac;
use embassy_time::{Duration, Timer};
use joint_firmware::hardware::drv8353::name;
use joint_firmware::hardware::moteus_revision::SUPPORTED;
use joint_firmware::hardware::{GateDriver, Setup};

/// Time between two attempts to set the driver up, and from its enable to the first: twice the time that it needs
/// (SLVSDY6, t_WAKE). Also how long the enable is low where the driver is to forget: longer than its reset pulse of 40
/// µs and than the 1 ms after which it sleeps.
const ATTEMPT: Duration = Duration::from_millis(2);
/// Time between two looks at the fault line.
const LOOK: Duration = Duration::from_millis(1);
/// Looks from one check of the registers to the next, while the bridge is off.
const CHECK: u32 = 100;

/// State of the driver as the control interrupt is told.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
enum State {
    /// Initial state, not set up since the start: no control step.
    Starting = 0,
    /// The bridge may switch.
    Ready = 1,
    /// A fault that has not been cleared.
    Faulty = 2,
    /// A fault, and the amplifiers are without power, too.
    Asleep = 3,
}

static STATE: AtomicU8 = AtomicU8::new(State::Starting as u8);
static SETUP: AtomicU8 = AtomicU8::new(Setup::Waking as u8);
/// Both status words, the first one lower.
static STATUS: AtomicU32 = AtomicU32::new(0);
static FAULTS: AtomicU16 = AtomicU16::new(0);
/// The control interrupt has seen a fault that the task has not.
static UNREAD: AtomicBool = AtomicBool::new(false);
/// A fault reset waits for the driver.
static RESET: AtomicBool = AtomicBool::new(false);

/// Returns `true` while the fault line is low.
#[inline(always)]
fn line_is_low() -> bool {
    pac::GPIOB.idr().read().idr(6) == pac::gpio::vals::Idr::LOW
}

/// Returns `true` if the driver has been ready since the start; control interrupt.
#[inline(always)]
pub fn is_started() -> bool {
    STATE.load(Ordering::Acquire) != State::Starting as u8
}

/// Returns `true` while the current amplifiers have power; control interrupt.
#[inline(always)]
pub fn amplifies() -> bool {
    STATE.load(Ordering::Relaxed) != State::Asleep as u8
}

/// Returns `true` while the bridge may not switch; a fault stays one until the task has cleared it. Control interrupt.
#[inline(always)]
pub fn is_faulty() -> bool {
    if STATE.load(Ordering::Acquire) != State::Ready as u8 {
        return true;
    }
    let low = line_is_low();
    if low {
        UNREAD.store(true, Ordering::Relaxed);
        STATE.store(State::Faulty as u8, Ordering::Release);
    }
    low
}

/// A fault reset waits for the driver; control interrupt.
#[inline(always)]
pub fn ask_reset(waits: bool) {
    if waits {
        RESET.store(true, Ordering::Release);
    }
}

/// State of the gate driver as known now; task.
pub fn report() -> GateDriver {
    let status = STATUS.load(Ordering::Relaxed);
    GateDriver {
        status: [status as u16, (status >> 16) as u16],
        faults: FAULTS.load(Ordering::Relaxed),
        setup: Setup::at(SETUP.load(Ordering::Relaxed)),
        unread: UNREAD.load(Ordering::Relaxed),
    }
}

fn enter(state: State, setup: Setup) {
    SETUP.store(setup as u8, Ordering::Relaxed);
    STATE.store(state as u8, Ordering::Release);
}

fn note(status: [u16; 2]) {
    STATUS.store(u32::from(status[0]) | u32::from(status[1]) << 16, Ordering::Relaxed);
}

/// The driver with its enable, on a board that the program is for.
pub struct Gate {
    /// Its bus.
    pub driver: Drv8353,
    /// Low it sleeps, and has forgotten its configuration when it wakes up.
    pub enable: Output<'static>,
}

/// Parts that the board cannot start without.
pub enum Parts {
    /// All is there.
    Gate(Gate),
    /// Missing parts: nothing may be driven, or measured.
    Missing(Setup, u8),
}

/// Looks after it for ever.
pub async fn supervise(parts: Parts) {
    match parts {
        Parts::Gate(gate) => gate.supervise().await,
        Parts::Missing(setup, revision) => {
            SETUP.store(setup as u8, Ordering::Relaxed);
            match setup {
                Setup::WrongBoard => defmt::error!(
                    "the board's pins tell of code {:#x} instead of {}: nothing is driven",
                    revision,
                    SUPPORTED
                ),
                _ => {
                    defmt::error!("a converter does not get ready: the program starts anew in a second");
                    Timer::after_secs(1).await;
                    super::faults::restart();
                }
            }
        }
    }
}

impl Gate {
    async fn supervise(mut self) {
        self.enable.set_high();
        self.set_up().await;
        let mut looks = 0;
        loop {
            Timer::after(LOOK).await;
            looks += 1;
            if STATE.load(Ordering::Acquire) == State::Ready as u8 {
                if looks >= CHECK && !control::statistics().switching {
                    looks = 0;
                    self.check().await;
                }
                continue;
            }
            self.fault().await;
        }
    }

    /// Sets the driver up until it answers, keeps what is written, and reports no fault.
    async fn set_up(&mut self) {
        let mut before = Setup::Waking;
        loop {
            Timer::after(ATTEMPT).await;
            let setup = match self.configure() {
                Ok(()) => break,
                Err(setup) => setup,
            };
            SETUP.store(setup as u8, Ordering::Relaxed);
            if setup != before {
                before = setup;
                defmt::warn!("gate driver: {=str}; tried again until it is ready", describe(setup));
            }
        }
        note([0; 2]);
        enter(State::Ready, Setup::Complete);
        defmt::info!("gate driver: ready");
    }

    /// Configures it, clears what its start or its supply has left, and looks whether it is well.
    fn configure(&mut self) -> Result<(), Setup> {
        self.driver.configure()?;
        self.clear()
    }

    fn clear(&mut self) -> Result<(), Setup> {
        self.driver.clear();
        // The line follows within microseconds.
        cortex_m::asm::delay(20 * 170);
        if line_is_low() {
            note(self.driver.status());
            return Err(Setup::Fault);
        }
        self.driver.verify()
    }

    /// While the bridge is off: a driver that has lost its configuration, or its bus, is found before the bridge
    /// switches. Noise may spoil a frame: twice wrong is wrong.
    async fn check(&mut self) {
        if self.driver.verify().is_err() {
            Timer::after(LOOK).await;
            if self.driver.verify().is_err() && STATE.load(Ordering::Acquire) == State::Ready as u8 {
                UNREAD.store(true, Ordering::Relaxed);
                STATE.store(State::Faulty as u8, Ordering::Release);
            }
        }
    }

    /// Handles a fault until it has been cleared: by a fault reset.
    async fn fault(&mut self) {
        RESET.store(false, Ordering::Relaxed);
        let status = self.driver.status();
        note(status);
        SETUP.store(self.missing() as u8, Ordering::Relaxed);
        FAULTS.store(FAULTS.load(Ordering::Relaxed).saturating_add(1), Ordering::Relaxed);
        UNREAD.store(false, Ordering::Release);
        defmt::warn!("gate driver: {=str}, status {:#05x} {:#05x}", name(status), status[0], status[1]);
        loop {
            Timer::after(LOOK).await;
            if !RESET.swap(false, Ordering::Acquire) {
                continue;
            }
            let mut outcome = self.clear();
            if outcome.is_err() {
                outcome = self.wake_anew().await;
            }
            match outcome {
                Ok(()) => break,
                Err(setup) => enter(State::Faulty, setup),
            }
        }
        note([0; 2]);
        enter(State::Ready, Setup::Complete);
        defmt::info!("gate driver: cleared");
    }

    /// Kind of the fault: one that it reports, or that it does not answer.
    fn missing(&mut self) -> Setup {
        self.driver.verify().err().unwrap_or(Setup::Fault)
    }

    /// Enable low and high again: everything that is latched is forgotten, the configuration with it.
    async fn wake_anew(&mut self) -> Result<(), Setup> {
        enter(State::Asleep, Setup::Waking);
        self.enable.set_low();
        Timer::after(ATTEMPT).await;
        self.enable.set_high();
        Timer::after(ATTEMPT).await;
        self.configure()
    }
}

/// Description for the log.
fn describe(setup: Setup) -> &'static str {
    match setup {
        Setup::NoAnswer => "does not answer",
        Setup::NotConfigured => "does not keep what is written",
        _ => "reports a fault",
    }
}
