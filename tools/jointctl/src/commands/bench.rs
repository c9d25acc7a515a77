//! Actuators behind boards.

use plant::ActuatorParameters;

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
