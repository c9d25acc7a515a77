//! Start of the board's program and its tasks; thread mode and the interrupt executor.

use crate::board::{self, Led, Peripherals, control, faults, watchdog};
use embassy_executor::{SendSpawner, Spawner};
use embassy_stm32::gpio::Input;
use embassy_time::{Duration, Instant, Ticker};
use joint_firmware::joint::{Bridge, Measurements};

/// Counts a turn of the incremental encoder, on boards that have one: 1,000 lines, until a configuration says otherwise.
const ENCODER_COUNTS: u16 = 4_000;
/// A program that has run for so long forgets why it stopped before.
const HEALTHY: Duration = Duration::from_secs(10);
/// A button counts as pressed after so many milliseconds: contacts bounce.
const DEBOUNCE_MS: u32 = 20;

/// What the control interrupt calls.
pub struct Joint;

impl Joint {
    /// **The joint is made here**, once, before the control interrupt starts.
    ///
    /// There is none yet: this one keeps the bridge off, whatever is measured.
    fn new() -> Self {
        Self
    }

    /// One control step.
    #[inline]
    pub fn control_step(&mut self, _measurements: &Measurements) -> Bridge {
        Bridge::OFF
    }
}

/// Starts everything; called once in thread mode. `medium` starts the interrupt executor.
pub fn start(slow: Spawner, medium: impl FnOnce() -> SendSpawner, peripherals: Peripherals) {
    faults::report();
    let parts = match board::start(peripherals, ENCODER_COUNTS) {
        Ok(parts) => parts,
        Err(error) => {
            // Without the control interrupt the bridge stays off. The watchdog is not started: a board that stands still is
            // easier to look into than one that resets for ever.
            defmt::error!("{} does not start: {}", board::NAME, error);
            return;
        }
    };
    control::start(parts.sensors, Joint::new());
    defmt::info!("{}: control steps at {} Hz, bridge off", board::NAME, board::CONTROL_HZ);
    // Each task is spawned once, so its only place is free.
    medium().spawn(defmt::unwrap!(supervise(parts.button)));
    slow.spawn(defmt::unwrap!(watch(watchdog::new(parts.watchdog))));
    slow.spawn(defmt::unwrap!(show(parts.led)));
}

/// Every millisecond: temperatures for the control step, and the button, which stops the bridge until the next reset.
#[embassy_executor::task]
async fn supervise(button: Option<Input<'static>>) {
    let mut ticker = Ticker::every(Duration::from_millis(1));
    let mut pressed_ms = 0u32;
    loop {
        ticker.next().await;
        let (bridge, winding) = board::temperatures();
        control::set_temperatures(bridge, winding);
        pressed_ms = match button.as_ref().is_some_and(Input::is_low) {
            true => pressed_ms.saturating_add(1),
            false => 0,
        };
        if pressed_ms == DEBOUNCE_MS {
            control::stop();
            defmt::warn!("button: the bridge stays off until the next reset");
        }
        watchdog::medium_is_alive();
    }
}

/// Feeds the watchdog, and logs the control steps once a second.
#[embassy_executor::task]
async fn watch(watchdog: &'static mut watchdog::Watchdog) {
    watchdog.start();
    let mut ticker = Ticker::every(Duration::from_millis(watchdog::FEED_MS));
    let mut logged = Instant::now();
    let mut healthy = false;
    loop {
        ticker.next().await;
        watchdog.feed();
        if !healthy && Instant::now() > Instant::from_ticks(0) + HEALTHY {
            healthy = true;
            faults::forget();
        }
        if logged.elapsed() >= Duration::from_secs(1) {
            logged = Instant::now();
            let (bridge, winding) = board::temperatures();
            let torn = faults::torn_words();
            defmt::info!(
                "{}; bridge {} °C, winding {} °C, torn words {}",
                control::statistics(),
                bridge,
                winding,
                torn
            );
        }
    }
}

/// The LED: a short blink a second while the bridge is off, lit while it switches, fast blinking after a fault or a stop.
#[embassy_executor::task]
async fn show(mut led: Led) {
    let mut ticker = Ticker::every(Duration::from_millis(100));
    let mut tenth = 0u32;
    loop {
        ticker.next().await;
        tenth = (tenth + 1) % 10;
        let state = control::statistics();
        led.set(match (state.bridge_fault || state.stopped, state.switching) {
            (true, _) => tenth.is_multiple_of(2),
            (false, true) => true,
            (false, false) => tenth == 0,
        });
    }
}
