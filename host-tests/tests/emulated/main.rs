//! The flashed programs on the emulated boards: a file a promise. One program of tests, because each that has a core in
//! it compiles it anew.
//!
//! Needs the target; where it is missing the tests are reported as ignored, by name; with `CI` set they run and fail.

mod boards;
mod commissioning;
mod commissioning_stops;
mod control_loop;
mod faults;
mod full_bus;
mod gate_driver;
mod images;
mod oscillator;
mod outputs;
mod ownership;
mod power_cut;
mod receive_interrupt;
mod same_run;
mod settings;
mod settling;
mod supported_modes;
mod workbench;

use host_tests::bare_metal::target_installed;
use libtest_mimic::Arguments;

fn main() {
    let arguments = Arguments::from_args();
    let ignored = std::env::var_os("CI").is_none() && !target_installed();
    // The longest first.
    let rooms = [
        commissioning_stops::trials(),
        commissioning::trials(),
        power_cut::trials(),
        control_loop::trials(),
        faults::trials(),
        full_bus::trials(),
        gate_driver::trials(),
        boards::trials(),
        images::trials(),
        oscillator::trials(),
        outputs::trials(),
        ownership::trials(),
        receive_interrupt::trials(),
        same_run::trials(),
        settings::trials(),
        settling::trials(),
        supported_modes::trials(),
        workbench::trials(),
    ];
    let trials = rooms.into_iter().flatten().map(|trial| trial.with_ignored_flag(ignored)).collect();
    libtest_mimic::run(&arguments, trials).exit();
}
