//! The configuration of a joint as text, `joint.toml`; host.
//!
//! Every value stands in the file, none has a default: what a joint is and may do is nothing to be guessed. Unknown
//! keys are refused, missing ones named, and the whole is checked by the same [`Configuration::prepare`] and the same
//! thermal model that a joint starts with. Reading and writing lose no bit.
//!
//! The form of the file is that of the firmware's own records, which have serde with its feature `serde`; [`fields`]
//! is the meaning of each key, with unit and range, as the file's comments say it.

pub mod fields;

use fields::FIELDS;
use joint_firmware::joint::configuration::{BridgeConfiguration, Configuration, ConfigurationError};
use joint_firmware::motor::thermal::WindingTemperature;
use std::path::{Path, PathBuf};

/// Reason for which a file is not the configuration of a joint.
#[derive(Debug, thiserror::Error)]
pub enum JointTextError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {source}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Not TOML, an unknown key, a missing key or a value of the wrong type.
    #[error("{}: {message}", file.display())]
    Toml {
        /// The file.
        file: PathBuf,
        /// Line, column and reason.
        message: String,
    },
    /// A value that no joint may have.
    #[error("{}: {source}", file.display())]
    Refused {
        /// The file.
        file: PathBuf,
        /// Refused value, and what it may be.
        source: ConfigurationError,
    },
}

/// Reads a configuration and checks it on `bridge`.
///
/// # Errors
/// [`JointTextError`].
pub fn read(file: &Path, bridge: &BridgeConfiguration) -> Result<Configuration, JointTextError> {
    let text =
        std::fs::read_to_string(file).map_err(|source| JointTextError::Unreadable { file: file.to_owned(), source })?;
    from_text(&text, file, bridge)
}

/// The configuration that `text` describes, checked on `bridge`; `file` is only named in errors.
///
/// # Errors
/// [`JointTextError`].
pub fn from_text(text: &str, file: &Path, bridge: &BridgeConfiguration) -> Result<Configuration, JointTextError> {
    let configuration: Configuration = toml::from_str(text).map_err(|error| JointTextError::Toml {
        file: file.to_owned(),
        message: error.to_string().trim_end().to_owned(),
    })?;
    check(&configuration, bridge).map_err(|source| JointTextError::Refused { file: file.to_owned(), source })?;
    Ok(configuration)
}

/// Checks of a joint when it starts: the record as a whole, and its thermal model, which the slow task makes of it.
fn check(configuration: &Configuration, bridge: &BridgeConfiguration) -> Result<(), ConfigurationError> {
    let active = configuration.prepare(bridge)?;
    WindingTemperature::new(&active.thermal, configuration.thermal.ambient)?;
    Ok(())
}

/// The configuration as text, each key below a comment with its meaning, unit and range.
///
/// # Errors
/// The configuration holds a number that TOML cannot: none that was read or prepared does.
pub fn to_text(configuration: &Configuration) -> Result<String, toml::ser::Error> {
    let plain = toml::to_string(configuration)?;
    let mut text = String::from("# What this joint is and may do. SI units; every key is needed.\n\n");
    let mut table = "";
    for line in plain.lines() {
        if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
            table = name;
        } else if let Some((key, _)) = line.split_once(" = ")
            && let Some(field) = FIELDS.iter().find(|field| field.table == table && field.key == key)
        {
            text.push_str(&format!("# {}\n", field.comment()));
        }
        text.push_str(line);
        text.push('\n');
    }
    Ok(text)
}

#[cfg(test)]
mod tests;
