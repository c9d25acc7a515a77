//! A joint as a user commissions it: excite it without compensation, record, fit, and take what the board would load.

use host_tests::driving::{enabled, follow};
use joint_firmware::friction::FrictionModel;
use jointctl::dataset::prepare;
use jointctl::fit::{Options, fit};
use jointctl::progress::Silent;
use plant::actuator::ActuatorParameters;
use plant::excitation::Excitation;
use plant::virtual_joint::Setup;
use std::fmt::Write;

/// Control steps between two rows of the recording: 4 ms.
const RECORD_STEPS: u64 = 80;

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
    /// The model as the board would run it.
    pub model: FrictionModel,
    /// Whether a network is part of it.
    pub network: bool,
}

/// Excites, records, fits.
pub fn commission(parameters: &ActuatorParameters, setup: &Setup, seed: u64) -> Result<Commissioned, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).map_err(|e| e.to_string());
    write("log.csv", &record(parameters, setup, seed)?)?;
    write("dataset.toml", include_str!("../../../tools/jointctl/src/commands/demo.toml"))?;
    let mut prepared = prepare(&folder.path().join("dataset.toml")).map_err(|error| error.to_string())?;
    let options = Options { restarts: 2, samples: 4000, reference: false, ..Options::default() };
    let fitted = fit(&mut prepared, &options, &Silent).map_err(|error| error.to_string())?;
    let model = FrictionModel::new(&fitted.image.friction, setup.bridge.rate as u32);
    let network = fitted.image.friction.sets.iter().any(|set| set.network.is_some());
    Ok(Commissioned { model, network })
}
