//! Watches measurements and loop for faults; control step.
//!
//! Every check answers in the step in which its signal shows the fault. Four signals cannot be told from noise or from an ordinary transient
//! in one step; for them the number of steps is a constant here.

use super::JointMotion;
use super::active::Active;
use super::fault::{Fault, Faults};
use super::signals::Measurements;
use crate::motor::field_oriented::FieldOrientedOutput;
use crate::motor::number::greater;
use crate::motor::observer::Observation;
use crate::motor::phases::Phases;
use crate::motor::transform::Dq;

/// Steps without an encoder sample that the observer bridges.
pub const ENCODER_STEPS: u32 = 5;
/// Steps for which the phase currents must fail to add up to zero: a fast current is not sampled in all phases at once.
pub const CURRENT_SUM_STEPS: u32 = 3;
/// Steps for which the current must miss its reference: many times the current loop's settling time.
pub const FOLLOW_STEPS: u32 = 200;
/// Steps for which encoder and induced voltage must contradict each other: longer than a step of the reference.
pub const IMPLAUSIBLE_STEPS: u32 = 40;
/// A velocity this much above its limit is a fault.
const OVER_SPEED: f32 = 1.2;
/// Part of the current limit by which the current may miss its reference.
const FOLLOW_ERROR: f32 = 0.25;
/// Temperatures outside these are an open or shorted sensor, °C.
const SENSOR_RANGE: (f32, f32) = (-40.0, 180.0);

/// Counters of the checks that take several steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Monitor {
    current_sum: u32,
    follow: u32,
    implausible: u32,
}

/// What the current loop did in the last step in which the bridge switched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loop {
    /// Reference, A.
    pub reference: Dq,
    /// Result.
    pub output: FieldOrientedOutput,
    /// Electrical speed, rad/s.
    pub speed: f32,
    /// Supply, V.
    pub bus_voltage: f32,
}

fn magnitude(value: f32) -> f32 {
    if value < 0.0 { -value } else { value }
}

/// Whether a value lies within bounds. What is not a number does not.
fn within(value: f32, low: f32, high: f32) -> bool {
    value >= low && value <= high
}

/// Whether a magnitude is beyond a limit. What is not a number is.
fn beyond(value: f32, limit: f32) -> bool {
    !within(value, -limit, limit)
}

/// Counts steps in a row.
fn count(counter: &mut u32, condition: bool) -> u32 {
    *counter = if condition { counter.saturating_add(1) } else { 0 };
    *counter
}

impl Monitor {
    /// Faults of the measurements themselves, whether or not the bridge switches. `currents` are without offsets.
    #[inline(always)]
    pub fn measurements(
        &mut self,
        active: &Active,
        measured: &Measurements,
        currents: Phases,
        observation: &Observation,
    ) -> Faults {
        let limits = &active.limits;
        let mut faults = Faults::NONE;
        let Phases { a, b, c } = currents;
        faults.set(Fault::OverCurrent, [a, b, c].iter().any(|current| beyond(*current, limits.over_current)));
        let unbalanced = beyond(a + b + c, active.current_sum_limit);
        faults.set(Fault::CurrentSensor, count(&mut self.current_sum, unbalanced) >= CURRENT_SUM_STEPS);

        let (lowest, highest) = limits.bus_voltage;
        faults.set(Fault::OverVoltage, !within(measured.bus_voltage, 0.0, highest));
        faults.set(Fault::UnderVoltage, !within(measured.bus_voltage, lowest, f32::INFINITY));

        faults.set(Fault::EncoderLost, observation.held > ENCODER_STEPS);
        faults.set(Fault::EncoderJump, beyond(observation.innovation, active.jump_limit));

        let implausible = |sensor: bool, value: f32| sensor && !within(value, SENSOR_RANGE.0, SENSOR_RANGE.1);
        let bridge = implausible(active.bridge.has_bridge_sensor, measured.bridge_temperature);
        let winding = implausible(active.bridge.has_winding_sensor, measured.winding_temperature);
        faults.set(Fault::TemperatureSensor, bridge || winding);
        faults.set(Fault::BridgeTemperature, measured.bridge_temperature > limits.bridge_temperature);
        faults.set(Fault::BridgeDriver, measured.bridge_fault);
        faults.set(Fault::Overrun, measured.overrun);
        faults
    }

    /// Faults that only a joint in motion, or meant to be, can have.
    #[inline(always)]
    pub fn motion(&mut self, active: &Active, motion: &JointMotion, stale_steps: u32, winding_derating: f32) -> Faults {
        let limits = &active.limits;
        let mut faults = Faults::NONE;
        faults.set(Fault::OverSpeed, beyond(motion.velocity, OVER_SPEED * limits.velocity));
        let (low, high) = limits.position;
        let margin = limits.position_margin;
        faults.set(Fault::PositionLimit, !within(motion.position, low - margin, high + margin));
        faults.set(Fault::WindingTemperature, winding_derating <= 0.0);
        faults.set(Fault::StaleCommand, stale_steps > active.deadline_steps);
        faults
    }

    /// Faults that the current loop's last step shows.
    #[inline(always)]
    pub fn current_loop(&mut self, active: &Active, last: &Loop) -> Faults {
        let mut faults = Faults::NONE;
        let Loop { reference, output, speed, bus_voltage } = last;
        let (current, voltage) = (output.current, output.voltage);

        // At a speed whose induced voltage takes most of what the supply gives, a current below its reference is no fault.
        let reach = active.field_oriented.modulator.reach(*bus_voltage);
        let induced = speed * active.flux_linkage;
        let has_voltage = magnitude(induced) < 0.7 * reach;
        let error = greater(magnitude(reference.q - current.q), magnitude(reference.d - current.d));
        let lost = has_voltage && beyond(error, FOLLOW_ERROR * active.current_limit);
        faults.set(Fault::CurrentNotFollowed, count(&mut self.follow, lost) >= FOLLOW_STEPS);

        let unexplained = voltage.q - active.resistance * current.q - induced;
        let contradicts = !output.limited && beyond(unexplained, active.implausible_voltage);
        faults.set(Fault::EncoderImplausible, count(&mut self.implausible, contradicts) >= IMPLAUSIBLE_STEPS);
        faults
    }

    /// The bridge is off: the current loop's checks start anew.
    pub fn loop_is_off(&mut self) {
        self.follow = 0;
        self.implausible = 0;
    }
}
