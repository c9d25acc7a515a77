//! Measurements of the board for a control step, and the step's commands to the board; control step.
//!
//! These two types are the whole seam between the joint and a board, real, emulated or virtual.

use crate::motor::phases::Phases;

/// Measurements of one control step: everything that it knows about the outside world.
///
/// The board scales its codes to these units with nominal gains; offsets of the current sensors are the joint's
/// business.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurements {
    /// Phase currents, A, positive into the motor, sampled at the centre of the PWM period.
    pub phase_currents: Phases,
    /// Voltage of the supply, V.
    pub bus_voltage: f32,
    /// Rotor angle as a fraction of a mechanical turn, 2^32 a turn, in the encoder's own direction and zero.
    pub encoder: u32,
    /// `true` if the encoder answered, with a good parity or checksum where it has one.
    pub encoder_valid: bool,
    /// `true` if the encoder's zero is where it always is: false for an incremental encoder that has not met its index
    /// since power-on.
    pub encoder_referenced: bool,
    /// Temperature of the winding's sensor, °C; NaN where the board has none.
    pub winding_temperature: f32,
    /// Temperature of the bridge, °C; NaN where the board has none.
    pub bridge_temperature: f32,
    /// The gate driver or a comparator reports a fault.
    pub bridge_fault: bool,
    /// The control step before took longer than its period.
    pub overrun: bool,
}

/// State of the three half bridges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BridgeState {
    /// All six transistors are off: the phases float.
    #[default]
    Off,
    /// Every half bridge switches with its duty.
    Switching,
}

/// Command to the board for the next PWM period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bridge {
    /// Switching state of the bridge.
    pub state: BridgeState,
    /// Fraction of the period that the high side conducts, 0 to 1; one half in every phase while the bridge is off.
    pub duties: Phases,
}

impl Bridge {
    /// All transistors off.
    pub const OFF: Self = Self { state: BridgeState::Off, duties: Phases::uniform(0.5) };
}

/// States that the board's outputs are to take, a bit each; they are off where nobody asks anything of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outputs(u8);

impl Outputs {
    /// All outputs off: the brake is closed.
    pub const OFF: Self = Self(0);

    /// The holding brake is to open; the brake chopper conducts.
    #[inline(always)]
    pub const fn new(brake_open: bool, chopper: bool) -> Self {
        Self(chopper as u8 | (brake_open as u8) << 1)
    }

    /// The brake chopper conducts.
    #[inline(always)]
    pub const fn chopper(self) -> bool {
        self.0 & 1 != 0
    }

    /// The holding brake is to open.
    #[inline(always)]
    pub const fn brake_open(self) -> bool {
        self.0 & 2 != 0
    }

    /// The chopper in bit 0, the brake in bit 1.
    #[inline(always)]
    pub const fn bits(self) -> u8 {
        self.0
    }
}
