//! Parameters of one actuator, and the reference joint's electrical side.

use super::bus::BusParameters;
use super::current_sensors::CurrentSensorParameters;
use super::inverter::InverterParameters;
use super::rotor_encoder::EncoderParameters;
use super::sensors::{DriveSensorParameters, VoltageSensorParameters};
use super::thermistor::ThermistorParameters;
use super::windings::{COPPER_RISE, Cogging, PhaseOrder, WindingParameters};
use crate::error::ParameterError;
use crate::parameters::JointParameters;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// One virtual actuator.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ActuatorParameters {
    /// Gear, load, friction, heat; its sensors are those of a recording drive and not used here, and its current limit
    /// is what the drive should keep, not what the windings do.
    pub joint: JointParameters,
    /// Windings.
    pub windings: WindingParameters,
    /// Bridge and timer.
    pub inverter: InverterParameters,
    /// Supply.
    pub bus: BusParameters,
    /// Sensors of the drive.
    pub sensors: DriveSensorParameters,
}

impl ActuatorParameters {
    /// The reference joint on a 36 V battery with a bridge of 2 mOhm at 500 ns of dead time, a 14-bit rotor encoder
    /// and 12-bit current sensors.
    #[must_use]
    pub fn reference() -> Self {
        Self {
            joint: JointParameters::reference(),
            windings: WindingParameters {
                pole_pairs: 7,
                inductance_d: 1.8e-4,
                inductance_q: 2.2e-4,
                resistance_rise: COPPER_RISE,
                flux_fall: 0.0,
                electrical_zero: 0.6,
                phase_order: PhaseOrder::Forward,
                cogging: Cogging { amplitude: 0.003, periods_per_turn: 84.0, phase: 0.4 },
            },
            inverter: InverterParameters {
                dead_time: 5e-7,
                clamping_current: 0.1,
                duty_steps: 4250,
                duty_delay: 1,
                on_resistance: 5e-3,
                diode_drop: 0.8,
                thermal_resistance: 8.0,
                heat_capacity: 4.0,
                idle_power: 0.7,
            },
            bus: BusParameters { source_voltage: 36.0, source_resistance: 0.06, capacitance: 5e-4, takes_back: true },
            sensors: DriveSensorParameters {
                currents: CurrentSensorParameters {
                    offset: [0.12, -0.2, 0.07],
                    gain_error: [0.004, -0.006, 0.002],
                    noise: 0.03,
                    resolution: 0.03,
                    lowest: -60.0,
                    highest: 60.0,
                    delay: 0,
                },
                encoder: EncoderParameters {
                    counts_per_turn: 16_384,
                    zero: 0.31,
                    reversed: false,
                    noise: 2e-5,
                    eccentricity: 0.004,
                    eccentricity_phase: 0.9,
                    delay: 0,
                },
                bus: VoltageSensorParameters { gain_error: 0.005, noise: 0.02, resolution: 0.018, highest: 73.0 },
                winding: ThermistorParameters {
                    fitted: true,
                    lag: 4.0,
                    resolution: 0.2,
                    lowest: -50.0,
                    highest: 250.0,
                },
                bridge: ThermistorParameters { fitted: true, lag: 1.0, resolution: 0.2, lowest: -50.0, highest: 200.0 },
            },
        }
    }

    /// The same actuator whose rotor, encoder and phases agree from the start: electrical zero and encoder zero at
    /// rotor angle zero, all counting forward. What a commissioned drive has.
    #[must_use]
    pub fn aligned(mut self) -> Self {
        self.windings.electrical_zero = 0.0;
        self.windings.phase_order = PhaseOrder::Forward;
        self.sensors.encoder.zero = 0.0;
        self.sensors.encoder.reversed = false;
        self
    }

    /// The same actuator with a payload of `mass` (kg) on an arm of `length` (m).
    #[must_use]
    pub fn with_payload(mut self, mass: f64, length: f64) -> Self {
        (self.joint.load.mass, self.joint.load.length) = (mass, length);
        self
    }

    /// The same actuator with nothing on its link.
    #[must_use]
    pub fn without_payload(mut self) -> Self {
        self.joint.load.mass = 0.0;
        self
    }

    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.joint.validate()?;
        self.windings.validate()?;
        self.inverter.validate()?;
        self.bus.validate()?;
        self.sensors.validate()
    }

    /// Angle of the rotor when the link is at `position` (rad), rad.
    #[must_use]
    pub fn rotor_angle(&self, position: f64) -> f64 {
        position * self.joint.motor.gear_ratio
    }

    /// Electrical angle when the link is at `position` (rad), 0 to 2 pi rad; counted in the motor's own phase order.
    #[must_use]
    pub fn electrical_angle(&self, position: f64) -> f64 {
        let turns =
            (self.windings.pole_pairs as f64 * self.rotor_angle(position) + self.windings.electrical_zero) / TAU;
        (turns - turns.floor()) * TAU
    }

    /// Peak phase voltage that turns the rotor steadily at the link's `speed` (rad/s) while the torque-producing
    /// `current` (A) flows, cold and without dead time, V. The linear range of a bridge ends at bus voltage /
    /// sqrt(3).
    #[must_use]
    pub fn voltage_for(&self, speed: f64, current: f64) -> f64 {
        let electrical = self.windings.pole_pairs as f64 * self.joint.motor.gear_ratio * speed;
        let resistance = self.joint.motor.resistance / 1.5 + self.inverter.on_resistance;
        let along = resistance * current + electrical * self.windings.flux_linkage(&self.joint.motor);
        along.hypot(electrical * self.windings.inductance_q * current)
    }
}
