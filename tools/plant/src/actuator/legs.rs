//! Connection of each motor phase.

use serde::{Deserialize, Serialize};

/// One of the three phases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Phase A, or U.
    A,
    /// Phase B, or V.
    B,
    /// Phase C, or W.
    C,
}

impl Phase {
    /// All three, in order.
    pub const ALL: [Self; 3] = [Self::A, Self::B, Self::C];

    /// Its place in an array of three.
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }
}

/// Connection of one phase over one step of the windings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Leg {
    /// The half bridge switches, or a short holds the phase: a mean `voltage` above the negative rail, V.
    Driven {
        /// Mean voltage, V.
        voltage: f64,
        /// Share of the phase's current that the positive rail supplies.
        duty: f64,
    },
    /// Both transistors are off: the phase floats between the rails and its body diodes conduct beyond them.
    Diodes,
    /// The phase's lead is interrupted: no current at all.
    Open,
}

impl Leg {
    /// Power that the motor takes at this terminal, against the negative rail, while `current` (A) flows into it, W.
    #[must_use]
    pub fn power(&self, rails: &Rails, current: f64) -> f64 {
        match self {
            Self::Driven { voltage, .. } => voltage * current,
            Self::Diodes if current < 0.0 => (rails.voltage + rails.diode_drop) * current,
            Self::Diodes => -rails.diode_drop * current,
            Self::Open => 0.0,
        }
    }
}

/// The rails that all legs share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rails {
    /// Voltage between them, V.
    pub voltage: f64,
    /// Forward voltage of a body diode, V.
    pub diode_drop: f64,
}
