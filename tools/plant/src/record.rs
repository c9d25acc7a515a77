//! A joint and an excitation in; a log as a user would record it, and the truth behind it, out.
//!
//! The two are separate types on purpose: nothing of the truth can be mistaken for a measurement.

use crate::drive::{Drive, MAXIMUM_CYCLE};
use crate::error::{ParameterError, count_within, within};
use crate::excitation::{Excitation, Run};
use crate::joint::Joint;
use crate::noise::Noise;
use crate::parameters::JointParameters;
use crate::sensors::Sensors;

/// Sample period of a usual log, s: 250 Hz.
pub const USUAL_SAMPLE_PERIOD: f64 = 4e-3;

/// What was measured. All columns have the same length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// Number of the run that the row belongs to, from 0.
    pub run: Vec<u32>,
    /// Time since the run started, s.
    pub time: Vec<f64>,
    /// Position, rad: delayed, noisy, in counts.
    pub position: Vec<f64>,
    /// Velocity, rad/s: the drive's filtered difference of the position.
    pub velocity: Vec<f64>,
    /// Torque that the drive asked for at the link, Nm.
    pub commanded_torque: Vec<f64>,
    /// Torque at the link from the measured current, I K_t N, Nm.
    pub measured_torque: Vec<f64>,
    /// Temperature of the housing, °C: lagging, quantised.
    pub temperature: Vec<f64>,
}

/// What really happened at the instants of the log's rows. All columns have the log's length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// Position, rad.
    pub position: Vec<f64>,
    /// Velocity, rad/s.
    pub velocity: Vec<f64>,
    /// Acceleration, rad/s².
    pub acceleration: Vec<f64>,
    /// Motor torque at the link before friction, Nm.
    pub motor_torque: Vec<f64>,
    /// Gravity torque at the link, Nm.
    pub load_torque: Vec<f64>,
    /// Friction torque, Nm: motor torque - load torque - inertia acceleration.
    pub friction_torque: Vec<f64>,
    /// Temperature of housing and gear, °C.
    pub temperature: Vec<f64>,
}

impl Log {
    /// Rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// Whether nothing was recorded.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }
}

/// A log and the truth behind it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// What a user gets.
    pub log: Log,
    /// What only a test may see.
    pub truth: Truth,
}

/// Records the joint through all runs of `excitation`, one row every `sample_period` (s, 0.0005 to 0.1). `seed`
/// draws the sensors' noise, anew for each run.
///
/// # Errors
/// The first parameter, warmth or sample period that is outside its range.
pub fn record(
    parameters: &JointParameters,
    excitation: &Excitation,
    seed: u64,
    sample_period: f64,
) -> Result<Recording, ParameterError> {
    parameters.validate()?;
    within("sample_period", sample_period, 5e-4, 0.1)?;
    count_within("excitation.runs", excitation.runs.len(), 1, 10_000)?;
    let mut recording = Recording::default();
    let mut seeds = Noise::new(seed, 300);
    for (number, run) in (0..).zip(&excitation.runs) {
        within("excitation.warmth", run.warmth, 0.0, 60.0)?;
        record_run(parameters, run, number, seeds.seed(), sample_period, &mut recording)?;
    }
    Ok(recording)
}

fn record_run(
    parameters: &JointParameters,
    run: &Run,
    number: u32,
    seed: u64,
    sample_period: f64,
    recording: &mut Recording,
) -> Result<(), ParameterError> {
    let mut joint = Joint::new(*parameters, parameters.thermal.ambient + run.warmth)?;
    let mut sensors = Sensors::new(parameters.sensors, parameters.motor, seed)?;
    let mut drive = Drive::new(parameters);
    // Whole cycles in a sample, so that every row is a cycle of the drive.
    let cycles = (sample_period / MAXIMUM_CYCLE - 1e-9).ceil().max(1.0) as u64;
    let period = sample_period / cycles as f64;
    let rows = (run.trajectory.duration() / sample_period + 1e-9).floor() as u64 + 1;
    for cycle in 0..(rows - 1) * cycles + 1 {
        let time = cycle as f64 * period;
        let measured = sensors.sample(joint.state(), period);
        let command = drive.cycle(&run.trajectory.at(time), &measured, period);
        if cycle % cycles == 0 {
            let log = &mut recording.log;
            log.run.push(number);
            log.time.push(time);
            log.position.push(measured.position);
            log.velocity.push(command.velocity);
            log.commanded_torque.push(command.torque);
            log.measured_torque.push(measured.current * parameters.motor.torque_per_ampere());
            log.temperature.push(measured.temperature);
            let (state, truth) = (joint.state(), &mut recording.truth);
            truth.position.push(state.position);
            truth.velocity.push(state.velocity);
            truth.acceleration.push(state.acceleration);
            truth.motor_torque.push(state.motor_torque);
            truth.load_torque.push(state.load_torque);
            truth.friction_torque.push(state.friction_torque);
            truth.temperature.push(state.heat.housing);
        }
        joint.advance(parameters.motor.current_for(command.torque), 0.0, period);
    }
    Ok(())
}
