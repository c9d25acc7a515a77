//! A joint as a user commissions it: excite it without compensation, record, fit, and take what the board would load.

use joint_firmware::friction::FrictionModel;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Command, Demand, Mode, Telemetry};
use joint_firmware::parameters::image::Image;
use jointctl::dataset::prepare;
use jointctl::fit::{Options, fit};
use jointctl::progress::Silent;
use plant::VirtualJoint;
use plant::actuator::{ActuatorParameters, ActuatorState};
use plant::excitation::{Excitation, Trajectory};
use plant::virtual_joint::{Setup, VirtualJointError};
use std::fmt::Write;

/// Control steps between two commands: a bus at 1 kHz.
const COMMAND_STEPS: u64 = 20;
/// Control steps between two rows of the recording: 4 ms.
const RECORD_STEPS: u64 = 80;

/// Follows a trajectory in impedance mode, as a controller on the bus would; `look` sees every control step.
pub fn follow(
    joint: &mut VirtualJoint,
    trajectory: &Trajectory,
    mut look: impl FnMut(f64, &Telemetry, &ActuatorState),
) -> Result<(), State> {
    let steps = (trajectory.duration() / joint.period()) as u64;
    let gains = joint.active().motion;
    let mut demand = Demand { controlword: Controlword::ENABLE_OPERATION, ..Demand::default() };
    for n in 0..steps {
        let time = n as f64 * joint.period();
        if n % COMMAND_STEPS == 0 {
            let reference = trajectory.at(time);
            demand.sequence = demand.sequence.wrapping_add(1);
            demand.command = Command {
                mode: Mode::Impedance,
                position: reference.position as f32,
                velocity: reference.velocity as f32,
                torque: 0.0,
                stiffness: gains.stiffness,
                damping: gains.damping,
            };
        }
        let telemetry = *joint.step(&demand, 0.0);
        if telemetry.state != State::OperationEnabled {
            return Err(telemetry.state);
        }
        look(time, &telemetry, joint.actuator().state());
    }
    Ok(())
}

/// A joint switched on, at rest.
pub fn enabled(
    parameters: &ActuatorParameters,
    setup: &Setup,
    warmth: f64,
    seed: u64,
) -> Result<VirtualJoint, VirtualJointError> {
    let temperature = parameters.joint.thermal.ambient + warmth;
    let mut joint = VirtualJoint::new(*parameters, setup, temperature, seed)?;
    joint.enable()?;
    Ok(joint)
}

/// The recording of a joint through its excitation: what telemetry over the bus would give.
pub fn record(parameters: &ActuatorParameters, setup: &Setup, seed: u64) -> Result<String, String> {
    let excitation = Excitation::for_joint(&parameters.joint, seed).map_err(|error| error.to_string())?;
    let mut csv = String::from("run,t_s,position_rad,velocity_rad_s,torque_Nm,temperature_C\n");
    for (number, run) in excitation.runs.iter().enumerate() {
        let mut joint =
            enabled(parameters, setup, run.warmth, seed + number as u64).map_err(|error| error.to_string())?;
        // Means over the row's 4 ms, of all signals alike: a mean of one and a sample of another would differ by 2 ms.
        let mut sums = [0.0f64; 4];
        let mut steps = 0;
        let result = follow(&mut joint, &run.trajectory, |time, t, _| {
            let signals = [t.motion.position, t.motion.velocity, t.measured_torque, t.gear_temperature];
            sums.iter_mut().zip(signals).for_each(|(sum, signal)| *sum += f64::from(signal));
            steps += 1;
            if steps == RECORD_STEPS {
                let [position, velocity, torque, gear] = sums.map(|sum| sum / RECORD_STEPS as f64);
                let _ = writeln!(csv, "{number},{time:.4},{position:.6},{velocity:.5},{torque:.4},{gear:.1}");
                (sums, steps) = ([0.0; 4], 0);
            }
        });
        result.map_err(|state| {
            format!("run {number} ended in {state:?}: {:?}", joint.joint().latched_faults().iter().collect::<Vec<_>>())
        })?;
    }
    Ok(csv)
}

/// What commissioning leaves.
pub struct Commissioned {
    pub image: Image,
    pub model: FrictionModel,
    /// Relative error of the offline prediction on the recording's test part, %.
    pub offline: Option<f64>,
    pub network: bool,
}

/// Excites, records, fits.
pub fn commission(parameters: &ActuatorParameters, setup: &Setup, seed: u64) -> Result<Commissioned, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).map_err(|e| e.to_string());
    write("log.csv", &record(parameters, setup, seed)?)?;
    let mut description = include_str!("../../../tools/jointctl/src/commands/demo.toml").to_owned();
    if let Ok(hz) = std::env::var("HZ") {
        description = description.replace("15.0", &hz);
    }
    if let Ok(v) = std::env::var("VMIN") {
        description += &format!("\n[select]\nminimum_speed = {v}\n");
    }
    write("dataset.toml", &description)?;
    let mut prepared = prepare(&folder.path().join("dataset.toml")).map_err(|error| error.to_string())?;
    let presets = match std::env::var("PRESETS") {
        Ok(list) => list
            .split(',')
            .map(|p| jointctl::presets::Preset::ALL.into_iter().find(|q| q.name() == p).unwrap())
            .collect(),
        Err(_) => Options::default().presets,
    };
    let options = Options { restarts: 2, samples: 4000, reference: false, presets, ..Options::default() };
    let fitted = fit(&mut prepared, &options, &Silent).map_err(|error| error.to_string())?;
    if std::env::var_os("DUMP").is_some() {
        for p in &fitted.report.parameters {
            println!("{} {} {} ± {:?}", p.name, p.value, p.unit, p.standard_error);
        }
        for c in &fitted.report.candidates {
            println!("{} {} {}", c.model, c.validation_rmse, c.reason);
        }
    }
    let model = FrictionModel::new(&fitted.image.friction, setup.bridge.rate as u32);
    let row = fitted.report.errors.first().and_then(|table| table.row(jointctl::report::Role::FixedPoint));
    let offline = row.and_then(|row| row.errors.overall.as_ref()).and_then(|metrics| metrics.relative_torque_error);
    let network = fitted.image.friction.sets.iter().any(|set| set.network.is_some());
    Ok(Commissioned { image: fitted.image, model, offline, network })
}
