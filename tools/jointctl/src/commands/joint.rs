//! The arguments that say which joint a command works on: its configuration, and the actuator that stands for it.

use super::CommandError;
use super::bench::Behind;
use crate::joint_text;
use clap::Args;
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
use std::path::{Path, PathBuf};

/// Which joint.
#[derive(Debug, Args)]
pub struct JointChoice {
    /// Configuration of the joint [default: that of the actuator, as its maker would commission it]
    #[arg(long, value_name = "TOML")]
    config: Option<PathBuf>,
    /// Parameters of the virtual actuator [default: the reference joint]
    #[arg(long, value_name = "TOML")]
    plant: Option<PathBuf>,
    /// Draw the virtual actuator at random, from this seed
    #[arg(long, value_name = "N", conflicts_with = "plant")]
    joint: Option<u64>,
}

impl JointChoice {
    /// Parts behind an emulated board: what is named, as its motor is wired and its encoder mounted.
    pub fn behind(&self) -> Result<Behind, CommandError> {
        Ok(match (&self.plant, self.joint) {
            (Some(path), _) => Behind::Described(Box::new(read_plant(path)?)),
            (None, Some(seed)) => Behind::Actuator(Box::new(ActuatorParameters::randomised(seed))),
            (None, None) => Behind::Reference,
        })
    }

    /// Reads what is named. Without a configuration, the encoder is taken as aligned; with one, what it says of the
    /// encoder counts.
    pub fn read(&self) -> Result<(ActuatorParameters, Setup), CommandError> {
        let plant = match (&self.plant, self.joint) {
            (Some(path), _) => read_plant(path)?,
            (None, Some(seed)) => ActuatorParameters::randomised(seed).aligned(),
            (None, None) => ActuatorParameters::reference().aligned(),
        };
        let Some(config) = &self.config else {
            let plant = plant.aligned();
            return Ok((plant, Setup::of(&plant)));
        };
        let mut setup = Setup::of(&plant);
        setup.configuration = joint_text::read(config, &setup.bridge)?;
        Ok((plant, setup))
    }
}

/// Parameters of an actuator in a file, checked.
pub fn read_plant(path: &Path) -> Result<ActuatorParameters, CommandError> {
    let refused = |reason: String| CommandError::PlantFile { path: path.to_owned(), reason };
    let text = std::fs::read_to_string(path).map_err(|source| CommandError::Read { path: path.to_owned(), source })?;
    let plant: ActuatorParameters =
        toml::from_str(&text).map_err(|error| refused(error.to_string().trim_end().to_owned()))?;
    plant.validate().map_err(|error| refused(error.to_string()))?;
    Ok(plant)
}
