//! What a calibration is allowed to do, and the numbers of steps and limits that follow; task, host.

use crate::motor::number::greater;
use crate::motor::setting::{SettingError, check};

/// Most pole pairs that are looked for.
pub(super) const MOST_POLE_PAIRS: u32 = 64;
/// Settling times within which the current that measures the resistance must be reached. The voltage rises to its highest in one, and approaches what is needed with
/// a time constant of one at most.
pub(super) const REACH: u32 = 4;
/// Cycles of the inductance's alternating voltage in which the amplitude rises to its highest.
pub(super) const RISE: u32 = 250;
/// Cycles from the last rise to the measurement.
pub(super) const SETTLE: u32 = 30;
/// Cycles that are measured.
pub(super) const MEASURE: u32 = 128;
/// Longest time that an inductance takes, steps.
const INDUCTANCE: u32 = 8 * (RISE + SETTLE + MEASURE + 2);
/// Time for which offsets are averaged, s.
const OFFSET_TIME: f32 = 0.1;

/// What a calibration is allowed to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationSettings {
    /// Control steps a second, Hz; 1 kHz to 200 kHz.
    pub rate: f32,
    /// Current that the rotor is held and turned with, A; 0.1 to 100. Enough to overcome friction and load with ease.
    pub current: f32,
    /// Highest phase current, A; beyond it the calibration fails. At least 1.3 times the current.
    pub highest_current: f32,
    /// Longest voltage vector, V; 0.5 to 100.
    pub highest_voltage: f32,
    /// Largest plausible offset of a current sensor, A; 0.01 to 100.
    pub highest_offset: f32,
    /// Electrical turns that are evaluated in each direction; 1 to 16.
    pub electrical_turns: u32,
    /// Time of an electrical turn, s; 0.1 to 5.
    pub turn_time: f32,
    /// Time for the voltage to rise to its highest, and for the rotor to come to rest, s; 0.05 to 5.
    pub settle_time: f32,
    /// Pole pairs by the motor's data sheet, where there is one; 1 to 64.
    pub expected_pole_pairs: Option<u32>,
}

/// Settings, checked and prepared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plan {
    pub rate: f32,
    pub current: f32,
    pub highest_current: f32,
    pub highest_voltage: f32,
    pub highest_offset: f32,
    pub electrical_turns: u32,
    pub expected_pole_pairs: Option<u32>,
    /// Supply that lets the highest voltage be applied at any angle with duties from 0.05 to 0.95, V.
    pub least_bus_voltage: f32,
    /// Steps of the offsets' average.
    pub offset_steps: u32,
    /// Steps to settle.
    pub settle_steps: u32,
    /// Steps of an electrical turn.
    pub turn_steps: u32,
    /// Way of the field in a step, 2^32 a turn.
    pub field_step: u32,
    /// V in a step.
    pub ramp: f32,
    /// Steps of the whole sequence at most.
    pub longest: u32,
}

impl Plan {
    pub fn new(settings: &CalibrationSettings) -> Result<Self, SettingError> {
        let s = settings;
        let rate = check("control rate", "Hz", s.rate, 1e3, 200e3)?;
        let current = check("calibration current", "A", s.current, 0.1, 100.0)?;
        check("highest calibration current", "A", s.highest_current, 1.3 * current, 1000.0)?;
        check("highest calibration voltage", "V", s.highest_voltage, 0.5, 100.0)?;
        check("highest offset", "A", s.highest_offset, 0.01, 100.0)?;
        check("electrical turns", "", s.electrical_turns as f32, 1.0, 16.0)?;
        check("time of an electrical turn", "s", s.turn_time, 0.1, 5.0)?;
        check("settling time", "s", s.settle_time, 0.05, 5.0)?;
        if let Some(pole_pairs) = s.expected_pole_pairs {
            check("expected pole pairs", "", pole_pairs as f32, 1.0, MOST_POLE_PAIRS as f32)?;
        }
        let offset_steps = (OFFSET_TIME * rate) as u32;
        let settle_steps = (s.settle_time * rate) as u32;
        let turn_steps = (s.turn_time * rate) as u32;
        let sweeps = 4 * (s.electrical_turns + 1) * turn_steps;
        // Twice: reach, settle, average. Then two inductances, two sweeps with each current, the ramp down; and a step between each two.
        let longest = offset_steps + 2 * (REACH + 2) * settle_steps + 2 * INDUCTANCE + sweeps + settle_steps + 20;
        Ok(Self {
            rate,
            current,
            highest_current: s.highest_current,
            highest_voltage: s.highest_voltage,
            highest_offset: s.highest_offset,
            electrical_turns: s.electrical_turns,
            expected_pole_pairs: s.expected_pole_pairs,
            least_bus_voltage: greater(s.highest_voltage * 1.732_050_8 / 0.9, 1.0),
            offset_steps,
            settle_steps,
            turn_steps,
            field_step: (crate::motor::angle::STEPS / (s.turn_time * rate)) as u32,
            ramp: s.highest_voltage / (s.settle_time * rate),
            longest,
        })
    }
}
