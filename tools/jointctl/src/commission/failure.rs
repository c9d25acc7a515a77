//! Reasons for the end of a commissioning: with what was measured, where, against which limit, and what to do.

use super::bench::Stopped;

/// Reason for the end of a commissioning.
#[derive(Clone, Debug, PartialEq)]
pub enum Failure {
    /// The joint does not go on, or the user does not want to.
    Stopped(Stopped),
    /// The joint has a fault.
    Fault {
        /// Words for the faults.
        faults: String,
    },
    /// Armed joint: somebody commands it, or its motor may be under current.
    Armed {
        /// Words for the state.
        state: String,
    },
    /// Settings are staged and not taken.
    Staged,
    /// The supply is outside the joint's limits.
    Supply {
        /// V.
        supply: f64,
        /// Lowest and highest, V.
        limits: [f64; 2],
    },
    /// Part that is too hot to begin.
    Hot {
        /// Name of the part.
        part: &'static str,
        /// °C.
        temperature: f64,
        /// °C.
        limit: f64,
    },
    /// The current does not go with the joint's limits.
    Current {
        /// A.
        current: f64,
        /// Least and most, A.
        limits: [f64; 2],
    },
    /// A number that the user gave is out of its range.
    Range {
        /// Name of the number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Least and most.
        limits: [f64; 2],
        /// Unit.
        unit: &'static str,
    },
    /// No current flows at the highest voltage.
    NoCurrent {
        /// A.
        current: f64,
        /// V.
        voltage: f64,
    },
    /// A phase carries no current.
    PhaseOpen {
        /// B or C; A shows as no current at all.
        phase: char,
        /// Current across the field as a part of the one along it.
        ratio: f64,
    },
    /// Current flows across the field while the rotor stands still.
    CurrentAside {
        /// Current across the field as a part of the one along it.
        ratio: f64,
        /// Largest part.
        limit: f64,
    },
    /// A positive voltage drives a negative current.
    WrongSign {
        /// A.
        current: f64,
        /// V.
        voltage: f64,
    },
    /// The highest voltage, or the joint's own limit, does not let the current flow.
    CurrentNotReached {
        /// A.
        current: f64,
        /// A.
        wanted: f64,
        /// V.
        voltage: f64,
    },
    /// The rotor does not come to rest in line with a field that stands still.
    RotorMoves {
        /// Mechanical turns between two looks.
        turns: f64,
        /// Mechanical turns.
        limit: f64,
        /// Time for which it was waited for, s.
        seconds: f64,
    },
    /// No motor has this resistance.
    ResistanceImplausible {
        /// Ω.
        resistance: f64,
        /// Least and most, Ω.
        limits: [f64; 2],
    },
    /// The points of voltage over current lie on no straight line.
    ResistanceUnclear {
        /// Standard error as a part of the resistance.
        error: f64,
        /// Largest part.
        limit: f64,
    },
    /// The alternating current is too small to measure an inductance by.
    RippleTooSmall {
        /// A.
        amplitude: f64,
        /// A.
        least: f64,
    },
    /// The winding answers like a resistor.
    NotInductive {
        /// Impedance in parts of the resistance.
        ratio: f64,
        /// Least.
        least: f64,
    },
    /// The rotor does not follow the field.
    RotorDidNotMove {
        /// Mechanical turns.
        turns: f64,
        /// Mechanical turns.
        least: f64,
        /// Electrical turns of the field meanwhile.
        field: f64,
    },
    /// The rotor does not come back the way that it went.
    RotorSlipped {
        /// Mechanical turns.
        forward: f64,
        /// Mechanical turns.
        backward: f64,
    },
    /// The field's turns are no whole multiple of the rotor's.
    PolePairsUnclear {
        /// Electrical turns in a mechanical one.
        ratio: f64,
        /// Largest distance from a whole number.
        limit: f64,
    },
    /// The motor has another number of pole pairs than its data sheet says.
    PolePairs {
        /// Number of pole pairs that was counted.
        counted: u32,
        /// Number of pole pairs that was expected.
        expected: u32,
    },
    /// Friction is too high for the current.
    LagTooLarge {
        /// Electrical turns.
        lag: f64,
        /// Electrical turns.
        limit: f64,
    },
    /// The electrical zero is another with less current.
    RotorBesideField {
        /// Electrical turns.
        turns: f64,
        /// Electrical turns.
        limit: f64,
    },
    /// The index of the encoder is not met.
    IndexNotMet {
        /// Mechanical turns forward and back, by the encoder's counts.
        turns: [f64; 2],
        /// Limit to each side, mechanical turns.
        limit: f64,
    },
    /// The motor does not turn with what was found.
    DoesNotTurn {
        /// Mean velocity, rad/s.
        velocity: f64,
        /// rad/s.
        wanted: f64,
    },
    /// Torque over acceleration gives no inertia.
    InertiaUnclear {
        /// kg m^2; NaN of too few samples.
        inertia: f64,
        /// Standard error, kg m^2.
        error: f64,
        /// Largest error, as a part of the inertia.
        limit: f64,
    },
    /// The user said no.
    Declined,
}

impl From<Stopped> for Failure {
    fn from(stopped: Stopped) -> Self {
        Self::Stopped(stopped)
    }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let percent = |part: &f64| 100.0 * part;
        let degrees = |turns: &f64| 360.0 * turns;
        match self {
            Self::Stopped(stopped) => stopped.fmt(f),
            Self::Fault { faults } => {
                write!(f, "the joint is in a fault: {faults}. Remove its cause, then repeat with --reset")
            }
            Self::Armed { state } => {
                write!(f, "the joint is {state}; `jointctl disable` switches it off, then repeat")
            }
            Self::Staged => write!(
                f,
                "settings were staged and neither taken nor forgotten; `jointctl set configuration.command 2` forgets them"
            ),
            Self::Supply { supply, limits: [low, high] } => write!(
                f,
                "the supply is {supply:.1} V, the joint's limits are {low} to {high} V (2103h:7, 8): set the supply, or \
                 the limits with `jointctl set`"
            ),
            Self::Hot { part, temperature, limit } => {
                write!(f, "the {part} has {temperature:.0} °C, more than {limit:.0} °C: let it cool down, then repeat")
            }
            Self::Current { current, limits: [low, high] } => write!(
                f,
                "--current of {current} A must lie in {low:.2} to {high:.2} A: the alternating current needs room below the \
                 motor's current limit, which --current-limit sets (by the motor's data sheet)"
            ),
            Self::Range { what, value, limits: [low, high], unit } => {
                write!(f, "{what} is {value} {unit}, must lie in {low} to {high} {unit}")
            }
            Self::NoCurrent { current, voltage } => write!(
                f,
                "{voltage:.2} V along phase A drive {current:.3} A: phase A is open, or no motor is connected. Check the motor's \
                 leads"
            ),
            Self::PhaseOpen { phase, ratio } => write!(
                f,
                "phase {phase} carries no current: across the field flow {:+.0} % of what flows along it, an open phase has 58 %. \
                 Check the lead of phase {phase} and its current sensor",
                percent(ratio)
            ),
            Self::CurrentAside { ratio, limit } => write!(
                f,
                "with the rotor at rest {:+.0} % of the current flow across the field, limit is {:.0} %: gain or sign of a current \
                 sensor of phases B and C is wrong, or the winding is not symmetrical. Measure the currents with a clamp",
                percent(ratio),
                percent(limit)
            ),
            Self::WrongSign { current, voltage } => write!(
                f,
                "{voltage:.2} V along phase A drive {current:.2} A, which is against the voltage: the current sensors have the \
                 wrong sign. Nothing can be commissioned before that is mended (docs/boards.md)"
            ),
            Self::CurrentNotReached { current, wanted, voltage } => write!(
                f,
                "{voltage:.2} V, the highest that is applied, drive {current:.2} A of {wanted:.2} A: repeat with a lower \
                 --current or a higher supply"
            ),
            Self::RotorMoves { turns, limit, seconds } => write!(
                f,
                "the rotor still moves by {turns:.5} turns between two looks after {seconds:.0} s in a field that stands still, limit is \
                 {limit:.5}: something else turns the joint, or the encoder is noisy"
            ),
            Self::ResistanceImplausible { resistance, limits: [low, high] } => write!(
                f,
                "the resistance is {resistance:.5} Ω, a motor's lies in {low} to {high} Ω: check the motor's leads for a short circuit, \
                 and the scale of the current sensors"
            ),
            Self::ResistanceUnclear { error, limit } => write!(
                f,
                "the points of voltage over current leave the resistance unclear by {:.0} %, limit is {:.0} %: repeat with a higher \
                 --current, above the range where dead time is not compensated",
                percent(error),
                percent(limit)
            ),
            Self::RippleTooSmall { amplitude, least } => write!(
                f,
                "the alternating current is {amplitude:.3} A at the highest voltage, an inductance needs {least:.3} A: a higher \
                 supply, or a lower --current"
            ),
            Self::NotInductive { ratio, least } => write!(
                f,
                "the impedance is {ratio:.2} times the resistance, an inductance needs {least:.2} times: the winding answers like a \
                 resistor. Enter the inductances by the data sheet (`jointctl set inductance-d`, `inductance-q`)"
            ),
            Self::RotorDidNotMove { turns, least, field } => write!(
                f,
                "the field made {field:.1} turns, the encoder {turns:.4}, at least {least:.4} were expected: the rotor is blocked, \
                 the encoder is not on this motor or not connected, or --current is too low for the friction"
            ),
            Self::RotorSlipped { forward, backward } => write!(
                f,
                "the rotor made {forward:.4} turns there and {backward:.4} back: it met a stop, slipped, or the encoder loses counts. \
                 Repeat where the joint is free to turn (--travel says how far it does), or with a higher --current"
            ),
            Self::PolePairsUnclear { ratio, limit } => write!(
                f,
                "the field made {ratio:.3} turns for each of the encoder, more than {limit} away from a whole number: --counts is wrong, \
                 a gear lies between motor and encoder, or the rotor slips"
            ),
            Self::PolePairs { counted, expected } => write!(
                f,
                "the motor has {counted} pole pairs by its encoder, --pole-pairs says {expected}: wrong --counts, another motor, or \
                 poles instead of pole pairs"
            ),
            Self::LagTooLarge { lag, limit } => write!(
                f,
                "the rotor lies {:.0}° electrical behind the field, limit is {:.0}°: repeat with a higher --current, or take the load \
                 off the joint",
                degrees(lag),
                degrees(limit)
            ),
            Self::RotorBesideField { turns, limit } => write!(
                f,
                "with less current the electrical zero is {:+.1}° another, limit is {:.0}°: the rotor does not lie in line with the \
                 field. Take the load off the joint, or repeat with a higher --current; where the motor is salient, with a lower one",
                degrees(turns),
                degrees(limit)
            ),
            Self::IndexNotMet { turns: [forward, backward], limit } => write!(
                f,
                "the encoder's index was not met within {forward:.2} turns there and {backward:.2} back, limit is {limit:.2} to each \
                 side: it is not connected, --counts is wrong, or the joint met stops at both ends"
            ),
            Self::DoesNotTurn { velocity, wanted } => write!(
                f,
                "the joint turned at {velocity:.3} rad/s instead of {wanted:.3} rad/s with the new configuration: it is disabled. \
                 What was measured is kept; look at gear ratio, gains and limits (`jointctl get gear gains limits`). A new joint's \
                 gains follow --gear and --torque-constant: where those were wrong, `jointctl restore application`, switch it off and on, \
                 and repeat with the right ones"
            ),
            Self::InertiaUnclear { inertia, error, limit } => write!(
                f,
                "the joint's torque gives an inertia of {inertia:.5} +- {error:.5} kg m^2, more than {:.0} % unclear: give it more way \
                 (lowest-position, highest-position) or acceleration, or check the torque constant by --load. What was commissioned is stored",
                percent(limit)
            ),
            Self::Declined => f.write_str("not confirmed; nothing was done further"),
        }
    }
}

impl std::error::Error for Failure {}
