//! Why a calibration was given up, with the numbers; any context.

/// One of the three phases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// A, or U.
    A,
    /// B, or V.
    B,
    /// C, or W.
    C,
}

/// Why a calibration was given up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    /// It was asked to.
    Aborted,
    /// A step took the sequence beyond its longest time, s.
    TooLong {
        /// The longest time, s.
        limit: f32,
    },
    /// The supply cannot give the highest voltage, or is not measured.
    SupplyTooLow {
        /// Supply, V.
        voltage: f32,
        /// Least supply, V.
        least: f32,
    },
    /// A phase current is beyond its limit, or not a number.
    OverCurrent {
        /// Which phase.
        phase: Phase,
        /// Current, A.
        current: f32,
        /// Limit, A.
        limit: f32,
    },
    /// The encoder did not answer.
    EncoderLost {
        /// Steps in a row.
        steps: u32,
    },
    /// The rotor turned while it should have stood still.
    RotorMoves {
        /// Way, mechanical turns.
        turns: f32,
        /// Limit, mechanical turns.
        limit: f32,
    },
    /// A current sensor reads a current where there can be none.
    OffsetTooLarge {
        /// Which phase.
        phase: Phase,
        /// What it reads, A.
        offset: f32,
        /// Limit, A.
        limit: f32,
    },
    /// A phase carries no current, and the others do; phase A stands for all where none does.
    PhaseOpen {
        /// Which phase.
        phase: Phase,
        /// Its current, A.
        current: f32,
        /// The current that it should carry, A.
        expected: f32,
    },
    /// The highest voltage does not drive the current: the resistance is too high, or a current sensor has the wrong sign.
    CurrentNotReached {
        /// Current, A.
        current: f32,
        /// Wanted current, A.
        wanted: f32,
        /// Voltage, V.
        voltage: f32,
    },
    /// The three currents do not add up to zero: a sensor has the wrong gain or sign, or current leaks.
    CurrentsDoNotAddUp {
        /// Sum, A.
        sum: f32,
        /// Limit, A.
        limit: f32,
    },
    /// The resistance cannot be one of a motor.
    ResistanceImplausible {
        /// Resistance, Ω.
        resistance: f32,
        /// Least, Ω.
        least: f32,
        /// Greatest, Ω.
        greatest: f32,
    },
    /// The alternating current was too small to measure an inductance by: the highest voltage is too low.
    RippleTooSmall {
        /// Amplitude, A.
        amplitude: f32,
        /// Least amplitude, A.
        least: f32,
    },
    /// The winding answers like a resistor: its inductance is too small to be measured at this rate.
    NotInductive {
        /// Impedance in parts of the resistance.
        ratio: f32,
        /// Least ratio.
        least: f32,
    },
    /// The rotor did not follow the field: it is blocked, the encoder is not on this motor, or the current is too low.
    RotorDidNotMove {
        /// Way, mechanical turns.
        turns: f32,
        /// Least way, mechanical turns.
        least: f32,
    },
    /// The rotor did not come back the way that it went: it slipped, or met a stop.
    RotorSlipped {
        /// Way with the field turning forward, mechanical turns.
        forward: f32,
        /// Way with the field turning back, mechanical turns.
        backward: f32,
    },
    /// The field's turns are no whole multiple of the rotor's.
    PolePairsUnclear {
        /// Electrical turns in a mechanical one.
        ratio: f32,
    },
    /// The motor has another number of pole pairs than expected.
    PolePairs {
        /// What was counted.
        counted: u32,
        /// What was expected.
        expected: u32,
    },
    /// The rotor lagged so far behind the field that its zero is not known well: friction is too high for the current.
    LagTooLarge {
        /// Lag, electrical turns.
        lag: f32,
        /// Limit, electrical turns.
        limit: f32,
    },
    /// The electrical zero is another with less current: the rotor lies beside the field, not in line with it. The current is too high
    /// for this motor's saliency.
    RotorBesideField {
        /// Difference, electrical turns.
        turns: f32,
        /// Limit, electrical turns.
        limit: f32,
    },
}

impl Failure {
    /// What it is called over a bus, in object 2107h:3: 1 to 19.
    pub const fn number(&self) -> u8 {
        match self {
            Self::Aborted => 1,
            Self::TooLong { .. } => 2,
            Self::SupplyTooLow { .. } => 3,
            Self::OverCurrent { .. } => 4,
            Self::EncoderLost { .. } => 5,
            Self::RotorMoves { .. } => 6,
            Self::OffsetTooLarge { .. } => 7,
            Self::PhaseOpen { .. } => 8,
            Self::CurrentNotReached { .. } => 9,
            Self::CurrentsDoNotAddUp { .. } => 10,
            Self::ResistanceImplausible { .. } => 11,
            Self::RippleTooSmall { .. } => 12,
            Self::NotInductive { .. } => 13,
            Self::RotorDidNotMove { .. } => 14,
            Self::RotorSlipped { .. } => 15,
            Self::PolePairsUnclear { .. } => 16,
            Self::PolePairs { .. } => 17,
            Self::LagTooLarge { .. } => 18,
            Self::RotorBesideField { .. } => 19,
        }
    }

    /// What was measured, and what it was held against, in the failure's unit; 0 where there is no such number.
    pub const fn numbers(&self) -> (f32, f32) {
        match *self {
            Self::Aborted => (0.0, 0.0),
            Self::TooLong { limit } => (0.0, limit),
            Self::SupplyTooLow { voltage, least } => (voltage, least),
            Self::OverCurrent { current, limit, .. } => (current, limit),
            Self::EncoderLost { steps } => (steps as f32, super::TOLERATED_ENCODER_LOSS as f32),
            Self::RotorMoves { turns, limit } => (turns, limit),
            Self::OffsetTooLarge { offset, limit, .. } => (offset, limit),
            Self::PhaseOpen { current, expected, .. } => (current, expected),
            Self::CurrentNotReached { current, wanted, .. } => (current, wanted),
            Self::CurrentsDoNotAddUp { sum, limit } => (sum, limit),
            Self::ResistanceImplausible { resistance, greatest, .. } => (resistance, greatest),
            Self::RippleTooSmall { amplitude, least } => (amplitude, least),
            Self::NotInductive { ratio, least } => (ratio, least),
            Self::RotorDidNotMove { turns, least } => (turns, least),
            Self::RotorSlipped { forward, backward } => (forward, backward),
            Self::PolePairsUnclear { ratio } => (ratio, 0.0),
            Self::PolePairs { counted, expected } => (counted as f32, expected as f32),
            Self::LagTooLarge { lag, limit } => (lag, limit),
            Self::RotorBesideField { turns, limit } => (turns, limit),
        }
    }
}

impl core::fmt::Display for Failure {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        match *self {
            Self::Aborted => f.write_str("calibration was aborted"),
            Self::TooLong { limit } => write!(f, "calibration took longer than {limit} s"),
            Self::SupplyTooLow { voltage, least } => {
                write!(f, "supply is {voltage} V, calibration needs at least {least} V")
            }
            Self::OverCurrent { phase, current, limit } => {
                write!(f, "current of phase {phase:?} is {current} A, limit is {limit} A")
            }
            Self::EncoderLost { steps } => write!(f, "encoder did not answer for {steps} control steps"),
            Self::RotorMoves { turns, limit } => {
                write!(f, "rotor turned by {turns} turns while the bridge was off, limit is {limit}")
            }
            Self::OffsetTooLarge { phase, offset, limit } => {
                write!(f, "current sensor of phase {phase:?} reads {offset} A without current, limit is {limit} A")
            }
            Self::PhaseOpen { phase, current, expected } => {
                write!(f, "phase {phase:?} is open: it carries {current} A instead of {expected} A")
            }
            Self::CurrentNotReached { current, wanted, voltage } => {
                write!(
                    f,
                    "{voltage} V drive only {current} A of {wanted} A: resistance too high or wrong sign of a sensor"
                )
            }
            Self::CurrentsDoNotAddUp { sum, limit } => {
                write!(f, "phase currents add up to {sum} A instead of zero, limit is {limit} A")
            }
            Self::ResistanceImplausible { resistance, least, greatest } => {
                write!(f, "resistance is {resistance} Ω, must lie in {least} to {greatest} Ω")
            }
            Self::RippleTooSmall { amplitude, least } => {
                write!(f, "alternating current is {amplitude} A, inductance needs at least {least} A")
            }
            Self::NotInductive { ratio, least } => {
                write!(f, "impedance is {ratio} times the resistance, inductance needs at least {least} times")
            }
            Self::RotorDidNotMove { turns, least } => {
                write!(f, "rotor followed the field by {turns} turns, expected at least {least}")
            }
            Self::RotorSlipped { forward, backward } => {
                write!(f, "rotor went {forward} turns forward but {backward} turns back")
            }
            Self::PolePairsUnclear { ratio } => {
                write!(f, "field turned {ratio} times as far as the rotor, which is no whole number of pole pairs")
            }
            Self::PolePairs { counted, expected } => {
                write!(f, "motor has {counted} pole pairs, expected {expected}")
            }
            Self::LagTooLarge { lag, limit } => {
                write!(f, "rotor lagged {lag} electrical turns behind the field, limit is {limit}")
            }
            Self::RotorBesideField { turns, limit } => {
                write!(
                    f,
                    "electrical zero differs by {turns} turns with less current, limit is {limit}: the rotor lies beside the field, calibrate with less current"
                )
            }
        }
    }
}

impl core::error::Error for Failure {}
