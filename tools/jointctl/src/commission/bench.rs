//! A joint that applies voltages and samples currents, as the stages see it; no I/O, no clock.

use joint_firmware::objects::settings::Setting;

/// Time that a joint applies a voltage for without being told again, s.
pub const DEAD_MAN: f64 = 0.1;
/// Control steps of a window, over which a joint averages.
pub const WINDOW_STEPS: f64 = 128.0;
/// Change of a voltage that a joint permits itself, V/s.
pub const SLEW: f64 = 50.0;

/// Voltages that a joint is to apply: object 2107h:1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frame {
    /// Voltage along the field, line to neutral, V; 0 to 65.535.
    pub voltage: f64,
    /// Electrical turns per second of the field; -50 to 50.
    pub speed: f64,
    /// Amplitude of the voltage that alternates along the field with an eighth of the control rate, V; 0 to 65.535.
    pub along: f64,
    /// Amplitude of the one across it, V; 0 to 65.535.
    pub across: f64,
}

impl Frame {
    /// The value of object 2107h:1: four 16-bit numbers, the lowest first. What is out of range is limited.
    pub fn raw(&self) -> u64 {
        let unsigned = |volts: f64| u64::from((1e3 * volts).round().clamp(0.0, 65_535.0) as u16);
        let speed = (1e2 * self.speed).round().clamp(-5_000.0, 5_000.0) as i16 as u16;
        unsigned(self.voltage) | u64::from(speed) << 16 | unsigned(self.along) << 32 | unsigned(self.across) << 48
    }
}

/// Means over the last complete window: object 2108h.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Window {
    /// Counts up; 0 before the first.
    pub number: u32,
    /// Mean current along and across the field, A.
    pub current: [f64; 2],
    /// Mean voltage along and across the field, as the bridge believes to have applied it, V.
    pub voltage: [f64; 2],
    /// Amplitude of the current along the field at an eighth of the control rate, A; NaN where it was not asked for.
    pub ripple_along: f64,
    /// The same across the field, A.
    pub ripple_across: f64,
    /// Applied amplitude of the alternating voltage along and across the field, V; NaN where it was not asked for.
    pub alternating: [f64; 2],
    /// Encoder at the window's end, 2^32 a turn.
    pub encoder: u32,
    /// Field at the window's end, 2^32 an electrical turn.
    pub field: u32,
    /// The encoder's angle is an absolute one: it has no index, or has met it.
    pub referenced: bool,
}

/// Condition of a joint while nothing flows, as it tells itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// Words for its state.
    pub state: String,
    /// Words for its faults; empty without one.
    pub faults: String,
    /// The motor may be under current, or somebody commands the joint.
    pub armed: bool,
    /// `true` if somebody has staged settings that are not taken.
    pub staged: bool,
    /// Supply, V.
    pub supply: f64,
    /// Temperature of the winding, by sensor or model, °C; NaN where neither is known.
    pub winding: f64,
    /// Temperature of the bridge, °C; NaN where it is not measured.
    pub bridge: f64,
}

/// Reason for which the joint does not go on applying.
#[derive(Clone, Debug, PartialEq)]
pub enum Stopped {
    /// The user has asked to stop.
    Interrupted,
    /// The joint missed this program for longer than [`DEAD_MAN`], or this program missed so much of the joint that it
    /// does not know where the field is.
    Late,
    /// The joint has left its open-loop state.
    Joint(String),
    /// The joint refuses a setting, or an object.
    Refused(String),
    /// The bus, or the joint is silent.
    Bus(String),
}

impl std::fmt::Display for Stopped {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Interrupted => write!(f, "interrupted; the bridge is off"),
            Self::Late => write!(
                f,
                "frames and answers took up to {} ms or longer: this machine or its CAN adapter is too slow; close what else \
                 keeps it busy, then repeat (after 8100h, a frame that the joint missed, with --reset)",
                1e3 * DEAD_MAN
            ),
            Self::Joint(words) => write!(f, "the joint ended it: {words}"),
            Self::Refused(words) | Self::Bus(words) => f.write_str(words),
        }
    }
}

/// A joint on a bench. Every call waits until it is done.
pub trait Bench {
    /// Switches the bridge on, without voltage: NMT OPERATIONAL, mode -2, operation enabled.
    ///
    /// # Errors
    /// [`Stopped`]; the bridge is then off.
    fn enable(&mut self) -> Result<(), Stopped>;

    /// Applies a frame, and renews the dead man.
    ///
    /// # Errors
    /// [`Stopped`].
    fn apply(&mut self, frame: &Frame) -> Result<(), Stopped>;

    /// The last complete window; `ripple`: with the alternating parts, which take longer to read.
    ///
    /// # Errors
    /// [`Stopped`], also where the joint does not apply any more.
    fn window(&mut self, ripple: bool) -> Result<Window, Stopped>;

    /// Lets time pass, s.
    ///
    /// # Errors
    /// [`Stopped`].
    fn pass(&mut self, seconds: f64) -> Result<(), Stopped>;

    /// Switches the bridge off; acknowledges nothing.
    ///
    /// # Errors
    /// [`Stopped`].
    fn off(&mut self) -> Result<(), Stopped>;

    /// Acknowledges a fault whose cause is gone.
    ///
    /// # Errors
    /// [`Stopped`], also where the fault stays.
    fn acknowledge(&mut self) -> Result<(), Stopped>;

    /// Condition of the joint, as it tells itself.
    ///
    /// # Errors
    /// [`Stopped`].
    fn condition(&mut self) -> Result<Condition, Stopped>;

    /// Control steps per second, Hz.
    ///
    /// # Errors
    /// [`Stopped`].
    fn rate(&mut self) -> Result<f64, Stopped>;

    /// A setting that is in use, in the unit of its object.
    ///
    /// # Errors
    /// [`Stopped`].
    fn setting(&mut self, setting: Setting) -> Result<f64, Stopped>;

    /// Takes settings, all of them or none.
    ///
    /// # Errors
    /// [`Stopped::Refused`] with the setting, its value and its limits.
    fn set(&mut self, settings: &[(Setting, f64)]) -> Result<(), Stopped>;

    /// Stores the configuration and, with `restart`, has the joint start with it.
    ///
    /// # Errors
    /// [`Stopped`].
    fn store(&mut self, restart: bool) -> Result<(), Stopped>;

    /// Enables the joint for a motion, without any.
    ///
    /// # Errors
    /// [`Stopped`]; the bridge is then off.
    fn begin_motion(&mut self, mode: Motion) -> Result<(), Stopped>;

    /// Renews the set-point of a motion: rad/s, or rad.
    ///
    /// # Errors
    /// [`Stopped`], also where the joint does not follow any more.
    fn move_to(&mut self, set_point: f64) -> Result<(), Stopped>;

    /// Position, rad, velocity, rad/s, and measured torque, Nm, of the joint.
    ///
    /// # Errors
    /// [`Stopped`].
    fn motion(&mut self) -> Result<[f64; 3], Stopped>;
}

/// Set-point of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Velocity, rad/s.
    Velocity,
    /// Position, rad.
    Position,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_has_millivolts_and_hundredths_of_a_turn_in_the_order_of_the_object() {
        let frame = Frame { voltage: 1.234, speed: -2.5, along: 0.5, across: 0.002 };
        assert_eq!(frame.raw().to_le_bytes(), [0xD2, 0x04, 0x06, 0xFF, 0xF4, 0x01, 0x02, 0x00]);
    }

    #[test]
    fn what_a_frame_cannot_hold_is_limited() {
        let frame = Frame { voltage: 100.0, speed: 50.01, along: -1.0, across: f64::NAN };
        assert_eq!(frame.raw(), Frame { voltage: 65.535, speed: 50.0, along: 0.0, across: 0.0 }.raw());
        assert_ne!(Frame { speed: 49.99, ..frame }.raw(), frame.raw());
    }
}
