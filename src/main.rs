//! The board's program: what starts, what runs at which priority, and where the joint is made. No arithmetic.
//!
//! | priority | runs | does |
//! |---|---|---|
//! | 0 | control interrupt, every PWM period | measure, one control step, set the bridge |
//! | 0 | PWM timer's update, twice a period | write the duties of the step |
//! | 4 | CAN receive interrupt | NMT, SYNC, RPDOs to commands |
//! | 6 | interrupts of drivers and of time | wake tasks |
//! | 8 | interrupt executor | every millisecond: temperatures, button, watchdog, model in shadow; at 100 Hz: thermal model |
//! | thread | thread executor | CANopen server, images, flash; LED, log |
//!
//! Nothing has run on a board yet.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]
#![deny(unsafe_code)]

// Two boards are refused by build.rs: embassy's chip crate fails before this is compiled.
#[cfg(all(target_os = "none", not(feature = "board")))]
compile_error!("no board is chosen: build with `--features b-g431b-esc1` or `--features moteus-r4`");

#[cfg(all(target_os = "none", feature = "board"))]
#[allow(unsafe_code, reason = "registers, interrupts and statics of the board have no safe form")]
mod board;
#[cfg(all(target_os = "none", feature = "board"))]
mod tasks;

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("This is the program of the joint's board. It is flashed with");
    eprintln!("cargo --config .cargo/b-g431b-esc1.toml run --release --target thumbv7em-none-eabihf");
    std::process::exit(2);
}
