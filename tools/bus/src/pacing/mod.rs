//! The wire as a model: what frames cost, who goes first, how loaded the bus is; no I/O, time passed in, host.
//!
//! [`PacedBus`] is a discrete-event model of a classic CAN bus (ISO 11898-1) with any number of stations. A simulation
//! moves it on with [`PacedBus::advance`]; `virtual:NAME?bitrate=1000000` moves it on with the clock.
//!
//! Modelled: every bit of a data frame with 11-bit identifier including the stuff bits of its real content, interframe
//! space, arbitration among the frames that wait when the bus falls idle, stations that send their own frames by
//! identifier or in order, identical frames of several stations that merge into one (as the answers to an LSS fastscan
//! do). Not modelled: error frames, error counters, propagation.

mod bits;
mod statistics;
mod wire;

pub use bits::{bit_time, bits};
pub use statistics::{Latency, Statistics};
pub use wire::{Delivery, Order, PacedBus, Station};
