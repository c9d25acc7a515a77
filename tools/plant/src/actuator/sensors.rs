//! Measurements of the drive's electronics in a control period: [`DriveSample`] is all that a control step may see.

use super::current_sensors::CurrentSensorParameters;
use super::delay::Delay;
use super::faults::{ActiveFaults, Channel, Failure};
use super::rotor_encoder::EncoderParameters;
use super::thermistor::ThermistorParameters;
use crate::error::{ParameterError, within};
use crate::noise::Noise;
use serde::{Deserialize, Serialize};

/// The divider that measures the bus voltage.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct VoltageSensorParameters {
    /// Relative error of the gain, -0.2 to 0.2.
    pub gain_error: f64,
    /// Standard deviation, 0 to 5 V.
    pub noise: f64,
    /// Voltage for one count of the converter, 0 (not quantised) to 5 V.
    pub resolution: f64,
    /// Highest reading, 5 to 1000 V; the lowest is zero.
    pub highest: f64,
}

impl VoltageSensorParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        within("bus_sensor.gain_error", self.gain_error, -0.2, 0.2)?;
        within("bus_sensor.noise", self.noise, 0.0, 5.0)?;
        within("bus_sensor.resolution", self.resolution, 0.0, 5.0)?;
        within("bus_sensor.highest", self.highest, 5.0, 1000.0)
    }
}

/// All sensors of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct DriveSensorParameters {
    /// Phase currents.
    pub currents: CurrentSensorParameters,
    /// Rotor encoder.
    pub encoder: EncoderParameters,
    /// Bus voltage.
    pub bus: VoltageSensorParameters,
    /// Temperature of the winding.
    pub winding: ThermistorParameters,
    /// Temperature of the bridge.
    pub bridge: ThermistorParameters,
}

impl DriveSensorParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.currents.validate()?;
        self.encoder.validate()?;
        self.bus.validate()?;
        self.winding.validate()?;
        self.bridge.validate()
    }
}

/// One sample of all sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveSample {
    /// Phase currents, A, positive into the motor.
    pub phase_currents: [f64; 3],
    /// Bus voltage, V.
    pub bus_voltage: f64,
    /// Rotor angle in the encoder's own direction and zero, 2^32 a turn.
    pub encoder: u32,
    /// `true` if the encoder answered properly.
    pub encoder_valid: bool,
    /// Temperature of the winding, °C; not a number where there is no sensor.
    pub winding_temperature: f64,
    /// Temperature of the bridge, °C; not a number where there is no sensor.
    pub bridge_temperature: f64,
    /// The gate driver reports a fault.
    pub bridge_fault: bool,
}

/// The true values behind a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sensed {
    pub(crate) phase_currents: [f64; 3],
    pub(crate) bus_voltage: f64,
    pub(crate) rotor_angle: f64,
    pub(crate) winding_temperature: f64,
    pub(crate) bridge_temperature: f64,
}

/// The sensors with their noise and their memory.
#[derive(Clone, Debug)]
pub(crate) struct DriveSensors {
    parameters: DriveSensorParameters,
    currents: Delay<[f64; 3]>,
    turns: Delay<f64>,
    bus_voltage: f64,
    /// Temperatures of the winding's and the bridge's bead.
    beads: [f64; 2],
    /// A stream of its own for each channel: changing one leaves the others' noise as it was.
    noise: [Noise; 5],
    failure_noise: Noise,
    /// The last reading of each channel.
    last: [f64; 7],
}

impl DriveSensors {
    pub(crate) fn new(parameters: DriveSensorParameters, first: &Sensed, seed: u64) -> Self {
        let mut sensors = Self {
            parameters,
            currents: Delay::new(0, [0.0; 3]),
            turns: Delay::new(0, 0.0),
            bus_voltage: 0.0,
            beads: [0.0; 2],
            noise: [400, 401, 402, 403, 404].map(|stream| Noise::new(seed, stream)),
            failure_noise: Noise::new(seed, 410),
            last: [0.0; 7],
        };
        sensors.settle(first);
        sensors
    }

    /// Makes `truth` all that the sensors have ever seen.
    pub(crate) fn settle(&mut self, truth: &Sensed) {
        let turns = self.parameters.encoder.shown(truth.rotor_angle);
        let [a, b, c] = truth.phase_currents;
        self.currents = Delay::new(self.parameters.currents.delay, truth.phase_currents);
        self.turns = Delay::new(self.parameters.encoder.delay, turns);
        self.bus_voltage = truth.bus_voltage;
        self.beads = [truth.winding_temperature, truth.bridge_temperature];
        self.last = [a, b, c, turns, truth.bus_voltage, truth.winding_temperature, truth.bridge_temperature];
    }

    /// Lets the sensors follow the truth at the end of a period.
    pub(crate) fn follow(&mut self, truth: &Sensed, period: f64) {
        let p = &self.parameters;
        self.currents.push(truth.phase_currents);
        self.turns.push(p.encoder.shown(truth.rotor_angle));
        self.bus_voltage = truth.bus_voltage;
        self.beads = [
            p.winding.followed(self.beads[0], truth.winding_temperature, period),
            p.bridge.followed(self.beads[1], truth.bridge_temperature, period),
        ];
    }

    pub(crate) fn sample(&mut self, faults: &ActiveFaults) -> DriveSample {
        let p = self.parameters;
        let mut phase_currents = self.currents.late();
        for (k, current) in phase_currents.iter_mut().enumerate() {
            let seen = *current * (1.0 + p.currents.gain_error[k])
                + p.currents.offset[k]
                + p.currents.noise * self.noise[k].normal();
            let range = (p.currents.lowest, p.currents.highest, p.currents.resolution);
            *current = self.read(k, seen, range, faults.sensors[k]);
        }

        let turns = self.turns.late() + p.encoder.noise * self.noise[3].normal();
        let failure = faults.sensors[Channel::Encoder as usize];
        let turns = self.failing(Channel::Encoder as usize, turns, failure);
        self.last[Channel::Encoder as usize] = turns;
        let (encoder, encoder_valid) = match failure {
            Some(Failure::Open) => (u32::MAX, false),
            Some(Failure::Shorted) => (0, true),
            _ => (p.encoder.counted(turns), true),
        };

        let voltage = self.bus_voltage * (1.0 + p.bus.gain_error) + p.bus.noise * self.noise[4].normal();
        let bus = Channel::BusVoltage as usize;
        let bus_voltage = self.read(bus, voltage, (0.0, p.bus.highest, p.bus.resolution), faults.sensors[bus]);

        let [winding_temperature, bridge_temperature] = [
            (Channel::WindingTemperature as usize, p.winding, self.beads[0]),
            (Channel::BridgeTemperature as usize, p.bridge, self.beads[1]),
        ]
        .map(|(channel, sensor, bead)| {
            let range = (sensor.lowest, sensor.highest, sensor.resolution);
            if sensor.fitted { self.read(channel, bead, range, faults.sensors[channel]) } else { f64::NAN }
        });

        DriveSample {
            phase_currents,
            bus_voltage,
            encoder,
            encoder_valid,
            winding_temperature,
            bridge_temperature,
            bridge_fault: faults.gate_driver,
        }
    }

    /// A reading by a converter with (lowest, highest, resolution), and what a failure makes of it.
    fn read(&mut self, channel: usize, value: f64, range: (f64, f64, f64), failure: Option<Failure>) -> f64 {
        let (lowest, highest, resolution) = range;
        let value = self.failing(channel, value, failure);
        let counted = if resolution > 0.0 { (value / resolution).round() * resolution } else { value };
        let reading = match failure {
            Some(Failure::Open) => lowest,
            Some(Failure::Shorted) => highest,
            _ => counted.max(lowest).min(highest),
        };
        self.last[channel] = reading;
        reading
    }

    fn failing(&mut self, channel: usize, value: f64, failure: Option<Failure>) -> f64 {
        match failure {
            Some(Failure::Stuck) => self.last[channel],
            Some(Failure::Offset(offset)) => value + offset,
            Some(Failure::Noisy(deviation)) => value + deviation * self.failure_noise.normal(),
            Some(Failure::Open | Failure::Shorted) | None => value,
        }
    }
}
