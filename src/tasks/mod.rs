//! Start of the board's program and its tasks; thread mode and the interrupt executor.

mod adaptation;
mod connection;
mod load;

use crate::board::watchdog::{self, Watchdog};
use crate::board::{self, Led, Peripherals, StartError, can, control, faults, options};
use connection::Watching;
use embassy_executor::{SendSpawner, Spawner};
use embassy_stm32::gpio::Input;
use embassy_time::{Duration, Instant, Ticker};
use friction_compensation::parameters::slots::WriteError;
use joint_firmware::joint::PROFILES;
use joint_firmware::joint::active::SLOW_RATE;
use joint_firmware::joint::configuration::ConfigurationError;
use joint_firmware::joint::state_machine::State;
use joint_firmware::motor::thermal::{PLAUSIBLE_SENSOR, ThermalSettings, WindingTemperature};

/// A program that has run for so long forgets why it stopped before.
const HEALTHY: Duration = Duration::from_secs(10);
/// A button counts as pressed after so many milliseconds: contacts bounce.
const DEBOUNCE_MS: u32 = 20;

/// Reason for which the joint does not start. Without the control interrupt the bridge stays off. The watchdog is not
/// started: a board that stands still is easier to look into than one that resets for ever.
pub enum NotStarted {
    /// The board.
    Board(StartError),
    /// The flash that holds parameters cannot be written.
    Flash(WriteError),
    /// The board's own configuration.
    Configuration,
}

impl From<StartError> for NotStarted {
    fn from(error: StartError) -> Self {
        Self::Board(error)
    }
}

impl From<WriteError> for NotStarted {
    fn from(error: WriteError) -> Self {
        Self::Flash(error)
    }
}

impl From<ConfigurationError> for NotStarted {
    fn from(_: ConfigurationError) -> Self {
        Self::Configuration
    }
}

/// Values of the first configuration that are needed besides the control step.
pub struct Started {
    /// Settings of the thermal model.
    thermal: ThermalSettings,
    /// Counts a turn of an incremental encoder.
    encoder_counts: u32,
}

/// Starts everything; called once in thread mode. `medium` starts the interrupt executor. A function of its own: its
/// stack is free again for the tasks.
#[inline(never)]
pub fn start(slow: Spawner, medium: impl FnOnce() -> SendSpawner, peripherals: Peripherals) {
    faults::report();
    options::report();
    match begin(slow, medium, peripherals) {
        Ok(()) => defmt::info!("control steps at {} Hz", board::CONTROL_HZ),
        Err(NotStarted::Board(error)) => defmt::error!("no start: {}", error),
        Err(NotStarted::Flash(WriteError { word })) => {
            defmt::error!("no start: the flash refuses to write double word {}", word);
        }
        // A test of the library's has the board's own configuration prepared, and tells which setting.
        Err(NotStarted::Configuration) => defmt::error!("no start: the board's own configuration is refused"),
    }
}

fn begin(slow: Spawner, medium: impl FnOnce() -> SendSpawner, peripherals: Peripherals) -> Result<(), NotStarted> {
    let parts = board::start(peripherals)?;
    // Started once, so the exchange is new and empty.
    let (commands, ends) = defmt::unwrap!(control::exchange());
    let of_the_bus = connection::Parts { can: parts.can, flash: parts.flash };
    let (connection, Started { thermal, encoder_counts }) = connection::start(commands, of_the_bus)?;
    let winding = winding(&thermal)?;
    if let Some(mut sensors) = parts.sensors {
        sensors.set_encoder_counts(encoder_counts);
        control::start(sensors, ends);
    }
    let medium = medium();
    let watching = connection.spawn(slow);
    // Each task is spawned once, so its only place is free.
    medium.spawn(defmt::unwrap!(supervise(parts.button, watching, watchdog::new(parts.watchdog))));
    medium.spawn(defmt::unwrap!(keep_cool(winding)));
    #[cfg(feature = "gate-driver")]
    medium.spawn(defmt::unwrap!(mind_gate_driver(parts.gate)));
    slow.spawn(defmt::unwrap!(log()));
    slow.spawn(defmt::unwrap!(show(parts.led)));
    Ok(())
}

/// The thermal model, at the sensor's temperature or, as nobody knows how hot the motor was when the power went, where
/// derating begins.
fn winding(thermal: &ThermalSettings) -> Result<WindingTemperature, ConfigurationError> {
    let (_, sensor) = board::temperatures();
    let plausible = sensor >= PLAUSIBLE_SENSOR.0 && sensor <= PLAUSIBLE_SENSOR.1;
    Ok(WindingTemperature::new(thermal, if plausible { sensor } else { thermal.warning })?)
}

/// Computes, at the thermal model's rate, how much current the winding bears, and how warm the gear is.
#[embassy_executor::task]
async fn keep_cool(mut winding: WindingTemperature) {
    let mut ticker = Ticker::every(Duration::from_hz(SLOW_RATE as u64));
    ticker.next().await;
    // The winding is as hot as it may be, the gear as warm as it probably is: as the electronics beside it when the
    // power came.
    let mut gear = winding.starting_at(board::temperatures().0);
    loop {
        ticker.next().await;
        let (_, sensor) = board::temperatures();
        let mean_square = control::mean_square_current();
        winding.step(mean_square, sensor);
        gear.step(mean_square, sensor);
        // The gear has no sensor; it is bolted to the motor's housing.
        control::set_thermal(winding.derating(), gear.housing());
    }
}

/// Every millisecond: temperatures for the control step; the model in shadow; what the bus shows of the joint; the
/// button, which stops the bridge until the next reset; the watchdog.
#[embassy_executor::task]
async fn supervise(button: Option<Input<'static>>, mut watching: Watching, watchdog: &'static mut Watchdog) {
    watchdog.start();
    let mut ticker = Ticker::every(Duration::from_millis(1));
    let (mut pressed_ms, mut unfed_ms) = (0u32, 0u32);
    loop {
        ticker.next().await;
        let (bridge, winding) = board::temperatures();
        control::set_temperatures(bridge, winding);
        watching.look(bridge, winding);
        if PROFILES {
            // Set-points are interpolated in the receive interrupt.
            can::attend();
        }
        pressed_ms = match button.as_ref().is_some_and(Input::is_low) {
            true => pressed_ms.saturating_add(1),
            false => 0,
        };
        if pressed_ms == DEBOUNCE_MS {
            control::stop();
            defmt::warn!("button: the bridge stays off until the next reset");
        }
        unfed_ms += 1;
        if unfed_ms == watchdog::FEED_MS {
            unfed_ms = 0;
            watchdog.feed();
        }
    }
}

/// Sets the gate driver up, and clears its faults.
#[cfg(feature = "gate-driver")]
#[embassy_executor::task]
async fn mind_gate_driver(parts: board::gate::Parts) {
    board::gate::supervise(parts).await;
}

/// Logs the control steps once a second.
#[embassy_executor::task]
async fn log() {
    let mut ticker = Ticker::every(Duration::from_secs(1));
    let mut healthy = false;
    loop {
        ticker.next().await;
        if !healthy && Instant::now().as_ticks() > HEALTHY.as_ticks() {
            healthy = true;
            faults::forget();
        }
        let (bridge, winding) = board::temperatures();
        defmt::info!(
            "{}; bridge {} °C, winding {} °C, torn words {}",
            control::statistics(),
            bridge,
            winding,
            faults::torn_words()
        );
        connection::log();
        if let Some(report) = control::report() {
            let telemetry = report.telemetry;
            defmt::info!(
                "joint: {}, statusword {:#06x}, faults {:#06x}, supply {} V, position {} rad, currents {} {} {} A",
                state_name(telemetry.state),
                telemetry.statusword(),
                // Bits as in object 2021h:4.
                report.latched.bits() >> 1,
                telemetry.bus_voltage,
                telemetry.motion.position,
                report.phase_currents.a,
                report.phase_currents.b,
                report.phase_currents.c
            );
        }
    }
}

/// Names for the log: the words stay on the host, and no formatting of the core library is linked for them.
fn state_name(state: State) -> defmt::Str {
    match state {
        State::NotReadyToSwitchOn => defmt::intern!("not ready to switch on"),
        State::SwitchOnDisabled => defmt::intern!("switch on disabled"),
        State::ReadyToSwitchOn => defmt::intern!("ready to switch on"),
        State::SwitchedOn => defmt::intern!("switched on"),
        State::OperationEnabled => defmt::intern!("operation enabled"),
        State::QuickStopActive => defmt::intern!("quick stop active"),
        State::FaultReactionActive => defmt::intern!("fault reaction active"),
        State::Fault => defmt::intern!("fault"),
        State::OpenLoop => defmt::intern!("open loop"),
    }
}

/// The LED: a short blink a second while the bridge is off, lit while it switches, fast blinking after a fault or a
/// stop.
#[embassy_executor::task]
async fn show(mut led: Led) {
    let mut ticker = Ticker::every(Duration::from_millis(100));
    let mut tenth = 0u32;
    loop {
        ticker.next().await;
        tenth = (tenth + 1) % 10;
        watchdog::slow_is_alive();
        let state = control::statistics();
        let fault = control::report().is_some_and(|report| !report.latched.is_empty());
        led.set(match (fault || state.stopped, state.switching) {
            (true, _) => tenth.is_multiple_of(2),
            (false, true) => true,
            (false, false) => tenth == 0,
        });
    }
}
