//! A joint as a user commissions it: excite it without compensation, record, fit, and take what the board would load.

use friction_compensation::friction::FrictionModel;
use identification::dataset::prepare;
use identification::fit::{Options, fit};
use identification::progress::Silent;
use jointctl::simulation::recording::{DESCRIPTION, record};
use plant::actuator::ActuatorParameters;
use plant::virtual_joint::Setup;

/// Results of commissioning.
pub struct Commissioned {
    /// The model as the board would run it.
    pub model: FrictionModel,
    /// `true` if a network is part of it.
    pub network: bool,
    /// Part of its friction that the joint may not have, as the fit states it.
    pub uncertainty: Option<f32>,
    /// Lowest and highest temperature in its recording, °C, by the board's sensor.
    pub recorded: [f64; 2],
}

/// Excites, records, fits.
pub fn commission(parameters: &ActuatorParameters, setup: &Setup, seed: u64) -> Result<Commissioned, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).map_err(|e| e.to_string());
    write("log.csv", &record(parameters, setup, seed).map_err(|error| error.to_string())?)?;
    write("dataset.toml", DESCRIPTION)?;
    let mut prepared = prepare(&folder.path().join("dataset.toml")).map_err(|error| error.to_string())?;
    let options = Options { restarts: 2, samples: 4000, reference: false, ..Options::default() };
    let fitted = fit(&mut prepared, &options, &Silent).map_err(|error| error.to_string())?;
    let model = FrictionModel::new(&fitted.image.friction, setup.bridge.motion_rate());
    let network = fitted.image.friction.sets.iter().any(|set| set.network.is_some());
    let uncertainty = fitted.report.uncertainty.map(|uncertainty| uncertainty.value as f32);
    let temperatures = prepared.samples.temperature.iter();
    let recorded = temperatures.fold([f64::MAX, f64::MIN], |[low, high], t| [low.min(*t), high.max(*t)]);
    Ok(Commissioned { model, network, uncertainty, recorded })
}
