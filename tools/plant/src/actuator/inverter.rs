//! The three half bridges, averaged over a PWM period, and the heat that they make.
//!
//! Dead time: while both transistors of a leg are off, the current picks the diode, so a phase that feeds the motor
//! loses the dead time's share of the bus voltage and a phase that draws from it gains as much (S.-G. Jeong, M.-H.
//! Park, "The analysis and compensation of dead-time effects in PWM inverters", IEEE Trans. Industrial Electronics
//! 38(2), 1991). Near zero current the ripple and the transistors' capacitances smear the edge: linear within the
//! clamping current. A leg at duty 0 or 1 does not switch and has no dead time. Switching losses and the current ripple
//! itself are not modelled.

use super::delay::{Delay, MAXIMUM_DELAY};
use super::legs::{Leg, Rails};
use crate::error::{ParameterError, count_within, within};
use serde::{Deserialize, Serialize};

/// Bridge, timer and heat sink.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct InverterParameters {
    /// Dead time at each edge, 0 to 5e-6 s.
    pub dead_time: f64,
    /// Current within which the dead time's effect is proportional, 0.001 to 10 A. Widened in a step that is too long
    /// for the windings' inductance to follow so steep a line.
    pub clamping_current: f64,
    /// Steps of the timer from duty 0 to 1, 0 (not quantised) to 1,000,000.
    pub duty_steps: usize,
    /// Periods from the call that sets a duty to the one in which it acts, 0 to 7; a timer with shadow registers: 1.
    pub duty_delay: usize,
    /// Resistance of a transistor, its shunt and the lead, 1e-4 to 1 ohm.
    pub on_resistance: f64,
    /// Forward voltage of a body diode, 0 to 3 V.
    pub diode_drop: f64,
    /// Thermal resistance from the bridge to ambient, 0.1 to 100 K/W.
    pub thermal_resistance: f64,
    /// Heat capacity of the bridge and its copper, 0.1 to 1000 J/K.
    pub heat_capacity: f64,
    /// Power that the board takes from the bus for itself, 0 to 20 W.
    pub idle_power: f64,
}

impl InverterParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        within("inverter.dead_time", self.dead_time, 0.0, 5e-6)?;
        within("inverter.clamping_current", self.clamping_current, 0.001, 10.0)?;
        count_within("inverter.duty_steps", self.duty_steps, 0, 1_000_000)?;
        count_within("inverter.duty_delay", self.duty_delay, 0, MAXIMUM_DELAY)?;
        within("inverter.on_resistance", self.on_resistance, 1e-4, 1.0)?;
        within("inverter.diode_drop", self.diode_drop, 0.0, 3.0)?;
        within("inverter.thermal_resistance", self.thermal_resistance, 0.1, 100.0)?;
        within("inverter.heat_capacity", self.heat_capacity, 0.1, 1000.0)?;
        within("inverter.idle_power", self.idle_power, 0.0, 20.0)
    }
}

/// The effect of the dead time in one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeadTime {
    /// Dead time of an edge as a share of the period.
    pub share: f64,
    /// Current from which the effect is full, A.
    pub width: f64,
}

impl DeadTime {
    /// Mean connection of a leg that switches at `duty` with `current` (A, into the motor) in it.
    #[must_use]
    pub fn leg(&self, duty: f64, current: f64, rails: &Rails) -> Leg {
        if duty <= 0.0 || duty >= 1.0 || self.share == 0.0 {
            return Leg::Driven { voltage: duty * rails.voltage, duty };
        }
        let direction = (current / self.width).clamp(-1.0, 1.0);
        let duty = (duty - self.share * direction).clamp(0.0, 1.0);
        Leg::Driven { voltage: duty * rails.voltage - 2.0 * self.share * rails.diode_drop * direction, duty }
    }
}

/// The bridge with the duties on their way through the timer.
#[derive(Clone, Debug)]
pub struct Inverter {
    parameters: InverterParameters,
    duties: Delay<[f64; 3]>,
    temperature: f64,
}

impl Inverter {
    /// A bridge at `temperature` (°C) whose duties have been one half.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn new(parameters: InverterParameters, temperature: f64) -> Result<Self, ParameterError> {
        parameters.validate()?;
        Ok(Self { parameters, duties: Delay::new(parameters.duty_delay, [0.5; 3]), temperature })
    }

    /// Another dead time from now on, 0 to 5e-6 s: that of a timer or a gate driver that a program configures.
    ///
    /// # Errors
    /// A dead time that is outside its range.
    pub fn set_dead_time(&mut self, seconds: f64) -> Result<(), ParameterError> {
        let parameters = InverterParameters { dead_time: seconds, ..self.parameters };
        parameters.validate()?;
        self.parameters = parameters;
        Ok(())
    }

    /// Temperature of the bridge, °C.
    #[must_use]
    pub fn temperature(&self) -> f64 {
        self.temperature
    }

    /// Starts a period with new duties (limited to 0 to 1; not a number counts as 0) for the timer; returns those that
    /// act in it.
    pub fn load(&mut self, duties: [f64; 3]) -> [f64; 3] {
        let steps = self.parameters.duty_steps as f64;
        self.duties.push(duties.map(|duty| {
            let duty = if duty.is_nan() { 0.0 } else { duty.clamp(0.0, 1.0) };
            if steps > 0.0 { (duty * steps).round() / steps } else { duty }
        }));
        self.duties.late()
    }

    /// Effect of the dead time in a PWM of `period` (s) between `rails`, to windings of `inductance` (H) that are
    /// stepped by `step` (s).
    #[must_use]
    pub fn dead_time(&self, rails: &Rails, period: f64, inductance: f64, step: f64) -> DeadTime {
        let share = self.parameters.dead_time / period;
        let steepest = share * rails.voltage * step / inductance;
        DeadTime { share, width: self.parameters.clamping_current.max(steepest) }
    }

    /// Current that `legs` take from the positive rail while `currents` (A) flow into the motor, A; negative when the
    /// motor feeds the bus.
    #[must_use]
    pub fn rail_current(legs: &[Leg; 3], currents: &[f64; 3]) -> f64 {
        legs.iter()
            .zip(currents)
            .map(|(leg, current)| match leg {
                Leg::Driven { duty, .. } => duty * current,
                Leg::Diodes => current.min(0.0),
                Leg::Open => 0.0,
            })
            .sum()
    }

    /// Lets `loss` (W) into the bridge for `period` seconds, in surroundings of `ambient` (°C).
    pub fn heat(&mut self, loss: f64, ambient: f64, period: f64) {
        let capacity = self.parameters.heat_capacity / period;
        let outside = 1.0 / self.parameters.thermal_resistance;
        self.temperature = (capacity * self.temperature + loss + outside * ambient) / (capacity + outside);
    }
}
