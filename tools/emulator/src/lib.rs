//! An emulated board: the program as it would be flashed, on a Cortex-M4F with the peripherals of an STM32G4, wired to
//! a plant.
//!
//! Data flows one way: [`cpu`] executes instructions and knows only a [`bus::Bus`]; `chip` is that bus, memories and
//! peripherals; `board` connects the chip's pins to actuator and bus. Everything is deterministic: the same program and
//! the same inputs give the same run, to the cycle.
//!
//! Host only.

#![deny(unsafe_code)]

pub mod board;
pub mod bus;
pub mod chip;
pub mod cpu;
pub mod emulation;
pub mod memory;
pub mod parts;
pub mod program;
pub mod rtt;
pub mod variables;
