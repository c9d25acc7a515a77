//! The chip's outer side: what a board connects to its pins.
//!
//! The chip calls a board in the order of time, at instants that its own clocks decide: every turn of a PWM counter,
//! every instant at which a converter holds its sample, every end of a frame. Between two calls nothing that the chip
//! drives has changed, so a board may integrate its plant from call to call.

use super::fdcan::line::CanLine;
use super::time::Instant;
use std::fmt;

/// A pin.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Pin {
    /// Port, 0 for A.
    pub port: u8,
    /// Number in the port, 0 to 15.
    pub number: u8,
}

impl Pin {
    /// Pin of a port's letter and a number.
    pub const fn new(port: char, number: u8) -> Self {
        Self { port: port as u8 - b'A', number }
    }
}

impl fmt::Display for Pin {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "P{}{}", char::from(b'A' + self.port), self.number)
    }
}

impl fmt::Debug for Pin {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, formatter)
    }
}

/// A timer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the names say it")]
pub enum TimerName {
    Tim1,
    Tim2,
    Tim3,
    Tim4,
    Tim5,
    Tim15,
}

/// State of a pin for a transistor's gate until told otherwise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Gate {
    /// High while the leg's reference is active, and low otherwise; the other way round where inverted.
    Switching {
        /// Active is low.
        inverted: bool,
    },
    /// High while the leg's reference is inactive, the dead time apart; the other way round where inverted.
    Complement {
        /// Active is low.
        inverted: bool,
    },
    /// Driven to a level.
    Held(bool),
    /// Released pin: not driven by the timer.
    #[default]
    Released,
}

/// A PWM channel with its pins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Leg {
    /// The compare value in force, in counts.
    pub compare: u32,
    /// The reference is active while the counter is below `compare`; where false, while it is not.
    pub active_below: bool,
    /// The channel's own pin.
    pub high: Gate,
    /// The complementary pin.
    pub low: Gate,
}

/// A PWM timer's outputs from now on, until told otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Pwm {
    /// Name of the timer.
    pub timer: TimerName,
    /// `true` if it counts.
    pub running: bool,
    /// Value of the counter.
    pub count: u32,
    /// `true` if it counts up.
    pub up: bool,
    /// The top of the count in force.
    pub top: u32,
    /// Duration of a count, in cycles of the core.
    pub tick: u64,
    /// Dead time before a switched output becomes active, in cycles of the core.
    pub dead_time: u64,
    /// Channels 1 to 3.
    pub legs: [Leg; 3],
}

/// Count and index of an incremental encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Quadrature {
    /// Edges of A and B so far, four a line, signed.
    pub count: i64,
    /// The count at the last rising edge of the index since the last call; none where there was none.
    pub index: Option<i64>,
}

/// A frame on SPI, as the master sends it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SpiFrame {
    /// Number of the peripheral, from 1.
    pub bus: u8,
    /// Clock polarity and phase as a mode, 0 to 3.
    pub mode: u8,
    /// Bits in the frame.
    pub bits: u8,
    /// Bits that are sent, the first bit highest.
    pub sent: u16,
    /// Frequency of the clock, Hz.
    pub frequency: u64,
    /// Instant at which its first bit began.
    pub began: Instant,
}

/// Connections of a board to the chip.
pub trait Wiring {
    /// Volts between a pin and ground, as a high-impedance input sees them.
    fn volts(&mut self, at: Instant, pin: Pin) -> f64;

    /// Resistance of what gives a pin its voltage, Ohm. Where nothing is known of a capacitor beside it, there is none.
    fn source_resistance(&mut self, _at: Instant, _pin: Pin) -> f64 {
        0.0
    }

    /// Volts of VREF+ and VDDA.
    fn reference(&self) -> f64 {
        3.3
    }

    /// Level that the board drives at a pin; none where it drives none.
    fn level(&mut self, at: Instant, pin: Pin) -> Option<bool>;

    /// The chip drives a general-purpose output, or no longer does.
    fn driven(&mut self, at: Instant, pin: Pin, level: Option<bool>);

    /// Count and index of the encoder at a timer's channels 1 to 3. The count may begin anywhere.
    fn quadrature(&mut self, at: Instant, timer: TimerName) -> Quadrature;

    /// A PWM timer's outputs from now on. At every turn of the counter, and when anything changes between two.
    fn pwm(&mut self, at: Instant, pwm: &Pwm);

    /// A frame ended: what the board sent meanwhile.
    fn spi(&mut self, at: Instant, frame: &SpiFrame) -> u16;

    /// The bus that FDCAN1's transceiver is connected to; none where it is to none, and the controller never sees it
    /// idle.
    fn can(&mut self) -> Option<&mut dyn CanLine> {
        None
    }
}

/// Chip to which nothing is connected: every pin floats at 0 V, every frame comes back as ones.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unconnected;

impl Wiring for Unconnected {
    fn volts(&mut self, _: Instant, _: Pin) -> f64 {
        0.0
    }

    fn level(&mut self, _: Instant, _: Pin) -> Option<bool> {
        None
    }

    fn driven(&mut self, _: Instant, _: Pin, _: Option<bool>) {}

    fn quadrature(&mut self, _: Instant, _: TimerName) -> Quadrature {
        Quadrature::default()
    }

    fn pwm(&mut self, _: Instant, _: &Pwm) {}

    fn spi(&mut self, _: Instant, _: &SpiFrame) -> u16 {
        u16::MAX
    }
}
