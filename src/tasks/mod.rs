//! Start of the board's program and its tasks; thread mode and the interrupt executor.

use crate::board::{self, Led, Offering, Peripherals, Publisher, control, faults, watchdog};
use defmt::{Debug2Format, Display2Format};
use embassy_executor::{SendSpawner, Spawner};
use embassy_stm32::gpio::Input;
use embassy_time::{Duration, Instant, Ticker};
use joint_firmware::joint::active::SLOW_RATE;
use joint_firmware::joint::configuration::ConfigurationError;
use joint_firmware::joint::state_machine::Controlword;
use joint_firmware::joint::{Active, Demand, Slow};
use joint_firmware::motor::setting::SettingError;
use joint_firmware::motor::thermal::{PLAUSIBLE_SENSOR, WindingTemperature};

/// Counts a turn of the incremental encoder, on boards that have one: 1,000 lines, until a configuration says otherwise.
const ENCODER_COUNTS: u16 = 4_000;
/// A program that has run for so long forgets why it stopped before.
const HEALTHY: Duration = Duration::from_secs(10);
/// A button counts as pressed after so many milliseconds: contacts bounce.
const DEBOUNCE_MS: u32 = 20;

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
    // Started once, so the exchange is new and empty.
    let (mut commands, ends) = defmt::unwrap!(control::exchange());
    let winding = match configure(&mut commands.active) {
        Ok(winding) => winding,
        Err(error) => return refuse(&error),
    };
    control::start(parts.sensors, ends);
    defmt::info!("{}: control steps at {} Hz, not commissioned", board::NAME, board::CONTROL_HZ);
    // Each task is spawned once, so its only place is free.
    let medium = medium();
    medium.spawn(defmt::unwrap!(supervise(parts.button, commands.demand)));
    medium.spawn(defmt::unwrap!(keep_cool(winding)));
    slow.spawn(defmt::unwrap!(watch(watchdog::new(parts.watchdog))));
    slow.spawn(defmt::unwrap!(show(parts.led)));
}

/// Says why the board's own configuration is refused; without the control interrupt the bridge stays off.
fn refuse(error: &ConfigurationError) {
    let what = match error {
        ConfigurationError::Setting(SettingError { name, .. }) => name,
        ConfigurationError::Compensation(_) => "compensation",
        ConfigurationError::NodeId(_) => "node id",
        ConfigurationError::PolePairs(_) => "pole pairs",
    };
    defmt::error!("{} does not start: {} out of range in its configuration", board::NAME, what);
}

/// Prepares and offers the board's own configuration. Returns its thermal model, at the sensor's temperature or, as nobody knows
/// how hot the motor was when the power went, where derating begins.
fn configure(active: &mut Offering<Active>) -> Result<WindingTemperature, ConfigurationError> {
    let board::BoardConfiguration { bridge, joint } = &board::CONFIGURATION;
    let prepared = defmt::unwrap!(active.prepare(|| joint.prepare(bridge)))?;
    let thermal = &prepared.value().thermal;
    let (_, sensor) = board::temperatures();
    let plausible = sensor >= PLAUSIBLE_SENSOR.0 && sensor <= PLAUSIBLE_SENSOR.1;
    let winding = WindingTemperature::new(thermal, if plausible { sensor } else { thermal.warning })?;
    prepared.offer();
    Ok(winding)
}

/// At the thermal model's rate: how much current the winding bears, and how warm the gear is.
#[embassy_executor::task]
async fn keep_cool(mut winding: WindingTemperature) {
    let mut ticker = Ticker::every(Duration::from_hz(SLOW_RATE as u64));
    loop {
        ticker.next().await;
        let (_, sensor) = board::temperatures();
        winding.step(control::mean_square_current(), sensor);
        // The gear has no sensor; it is bolted to the motor's housing.
        control::set_slow(&Slow { derating: winding.derating(), gear_temperature: winding.housing() });
    }
}

/// Every millisecond: temperatures for the control step; the button, which stops the bridge until the next reset; and the command,
/// which is "disable voltage" as long as there is no bus to take another from.
#[embassy_executor::task]
async fn supervise(button: Option<Input<'static>>, mut commands: Publisher<Demand>) {
    let mut sequence = 0u32;
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
        sequence = sequence.wrapping_add(1);
        commands.publish(&Demand { controlword: Controlword::DISABLE_VOLTAGE, sequence, ..Demand::default() });
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
            if let Some(report) = control::report() {
                let telemetry = report.telemetry;
                defmt::info!(
                    "joint: {}, statusword {:#06x}, supply {} V, position {} rad, currents {} {} {} A",
                    Debug2Format(&telemetry.state),
                    telemetry.statusword(),
                    telemetry.bus_voltage,
                    telemetry.motion.position,
                    report.phase_currents.a,
                    report.phase_currents.b,
                    report.phase_currents.c
                );
                for fault in report.latched.iter() {
                    defmt::warn!("fault: {}", Display2Format(&fault));
                }
            }
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
        let fault = control::report().is_some_and(|report| !report.latched.is_empty());
        led.set(match (fault || state.stopped, state.switching) {
            (true, _) => tenth.is_multiple_of(2),
            (false, true) => true,
            (false, false) => tenth == 0,
        });
    }
}
