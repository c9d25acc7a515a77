//! Boards, and actuators behind them.

use clap::ValueEnum;
use plant::ActuatorParameters;

/// The boards.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Board {
    #[value(name = "b-g431b-esc1")]
    BG431BEsc1,
    #[value(name = "moteus-r4")]
    MoteusR4,
}

/// Parts behind a board.
#[derive(Debug)]
#[cfg_attr(not(feature = "emulator"), allow(dead_code, reason = "the emulator alone reads it"))]
pub enum Behind {
    /// The reference actuator at a low voltage, aligned, with the board's usual encoder.
    Reference,
    /// An actuator with the board's usual encoder, as it is mounted there.
    Actuator(Box<ActuatorParameters>),
    /// An actuator with its encoder's counts too.
    Described(Box<ActuatorParameters>),
}
