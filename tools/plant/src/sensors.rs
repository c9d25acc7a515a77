//! What the drive sees of the joint: quantised, noisy, offset and late.

use crate::error::{ParameterError, count_within, within};
use crate::joint::State;
use crate::motor::MotorParameters;
use crate::noise::Noise;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Longest permitted delay, samples.
pub const MAXIMUM_DELAY: usize = 64;

/// The joint's sensors. A sample is one cycle of the drive, see [`crate::drive::MAXIMUM_CYCLE`].
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SensorParameters {
    /// Encoder counts per revolution of the link, 16 to 2^26. An encoder on the rotor counts gear ratio times more.
    pub counts_per_revolution: f64,
    /// Standard deviation of the position before quantisation, 0 to 0.1 rad.
    pub position_noise: f64,
    /// Standard deviation of the current, 0 to 10 A.
    pub current_noise: f64,
    /// Current that the sensor reports at zero, -10 to 10 A.
    pub current_offset: f64,
    /// Current for one count of the converter, 0 (not quantised) to 5 A.
    pub current_resolution: f64,
    /// Age of position and current when the drive sees them, 0 to 64 samples.
    pub delay: usize,
    /// Temperature for one count of the converter, 0 (not quantised) to 5 K.
    pub temperature_resolution: f64,
    /// Time constant of the temperature sensor, 0 to 300 s.
    pub temperature_lag: f64,
}

impl SensorParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        within("sensors.counts_per_revolution", self.counts_per_revolution, 16.0, 67_108_864.0)?;
        within("sensors.position_noise", self.position_noise, 0.0, 0.1)?;
        within("sensors.current_noise", self.current_noise, 0.0, 10.0)?;
        within("sensors.current_offset", self.current_offset, -10.0, 10.0)?;
        within("sensors.current_resolution", self.current_resolution, 0.0, 5.0)?;
        count_within("sensors.delay", self.delay, 0, MAXIMUM_DELAY)?;
        within("sensors.temperature_resolution", self.temperature_resolution, 0.0, 5.0)?;
        within("sensors.temperature_lag", self.temperature_lag, 0.0, 300.0)
    }

    /// Position for one encoder count, rad.
    #[must_use]
    pub fn position_resolution(&self) -> f64 {
        TAU / self.counts_per_revolution
    }
}

/// One sample of all sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// Position of the link, rad, a whole number of counts.
    pub position: f64,
    /// Torque-producing current, A.
    pub current: f64,
    /// Temperature of the housing, °C.
    pub temperature: f64,
}

/// The sensors of one joint, with their noise and their memory.
#[derive(Clone, Debug)]
pub struct Sensors {
    parameters: SensorParameters,
    motor: MotorParameters,
    position_noise: Noise,
    current_noise: Noise,
    late: VecDeque<(f64, f64)>,
    temperature: Option<f64>,
}

impl Sensors {
    /// Sensors whose noise follows from `seed`; each channel has a stream of its own, so changing one channel
    /// leaves the others' noise as it was.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn new(parameters: SensorParameters, motor: MotorParameters, seed: u64) -> Result<Self, ParameterError> {
        parameters.validate()?;
        motor.validate()?;
        Ok(Self {
            parameters,
            motor,
            position_noise: Noise::new(seed, 1),
            current_noise: Noise::new(seed, 2),
            late: VecDeque::with_capacity(parameters.delay + 1),
            temperature: None,
        })
    }

    /// Samples the joint, `period` seconds after the last sample. The first samples, for which there is no past yet,
    /// repeat the first one.
    pub fn sample(&mut self, state: &State, period: f64) -> Measurement {
        let p = &self.parameters;
        let position = state.position + p.position_noise * self.position_noise.normal();
        let current = state.motor_torque / self.motor.torque_per_ampere()
            + p.current_offset
            + p.current_noise * self.current_noise.normal();
        let fresh = (quantised(position, p.position_resolution()), quantised(current, p.current_resolution));
        self.late.push_back(fresh);
        let seen = self.late[0];
        if self.late.len() > p.delay {
            self.late.pop_front();
        }

        let housing = state.heat.housing;
        let before = self.temperature.unwrap_or(housing);
        let lagged = before + (housing - before) * period / (period + p.temperature_lag);
        self.temperature = Some(lagged);
        Measurement { position: seen.0, current: seen.1, temperature: quantised(lagged, p.temperature_resolution) }
    }
}

/// `value` at the nearest multiple of `resolution`; unchanged at a resolution of zero.
fn quantised(value: f64, resolution: f64) -> f64 {
    if resolution > 0.0 { (value / resolution).round() * resolution } else { value }
}
