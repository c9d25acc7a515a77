//! The log of a virtual joint as a user would record it over the bus: excited without compensation, a row every 4 ms;
//! host.
//!
//! A row holds means over its time, of all signals alike. A mean of the torque beside a sample of the position would
//! lag by half a row, and a network takes such a lag for friction.

use super::run::{Ending, USUAL_SAMPLE_PERIOD, drive, every};
use super::{Motion, Part, SimulationError};
use plant::ActuatorParameters;
use plant::excitation::{Excitation, Run};
use plant::virtual_joint::Setup;
use rayon::prelude::*;
use std::fmt::Write;

/// Columns of the table.
pub const HEADER: &str = "run,t_s,position_rad,velocity_rad_s,torque_Nm,temperature_C\n";

/// Excites the joint and records it: the table that [`DESCRIPTION`] describes. The same `seed` gives the same table.
///
/// # Errors
/// Refusals of plant or firmware, and a run that a fault ended.
pub fn record(plant: &ActuatorParameters, setup: &Setup, seed: u64) -> Result<String, SimulationError> {
    let excitation = Excitation::for_joint(&plant.joint, seed)?;
    let runs = excitation.runs.par_iter().enumerate();
    let tables =
        runs.map(|(number, run)| record_run(plant, setup, run, number, seed)).collect::<Result<Vec<_>, _>>()?;
    Ok(HEADER.to_owned() + &tables.concat())
}

/// Describes the table as a user would describe his own.
pub const DESCRIPTION: &str = include_str!("recording.toml");

fn record_run(
    plant: &ActuatorParameters,
    setup: &Setup,
    run: &Run,
    number: usize,
    seed: u64,
) -> Result<String, SimulationError> {
    let motion = Motion::Trajectory(run.trajectory.clone());
    let part = Part { temperature: plant.joint.thermal.ambient + run.warmth, ..Part::new("run", plant, motion) };
    let mut text = String::new();
    let mut sums = [0.0; 4];
    let (ending, _) = drive(&part, setup, None, seed.wrapping_add(number as u64), |joint, step| {
        let telemetry = joint.joint().telemetry();
        let motion = &telemetry.motion;
        let signals = [motion.position, motion.velocity, telemetry.measured_torque, telemetry.gear_temperature];
        sums.iter_mut().zip(signals).for_each(|(sum, signal)| *sum += f64::from(signal));
        let per_row = every(USUAL_SAMPLE_PERIOD, joint.period());
        if (step + 1) % per_row == 0 {
            let [position, velocity, torque, temperature] = sums.map(|sum| sum / per_row as f64);
            let time = (step + 1) as f64 * joint.period();
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{number},{time:.4},{position:.6},{velocity:.5},{torque:.4},{temperature:.1}");
            sums = [0.0; 4];
        }
    })?;
    match ending {
        Ending::Whole => Ok(text),
        stopped => Err(SimulationError::Recording { run: number, reason: stopped.to_string() }),
    }
}
