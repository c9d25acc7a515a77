//! Result of the last configuration, readable object by object; the task.

use super::field::ConfigurationField;
use crate::joint::configuration::ConfigurationError;
use crate::motor::setting::{Name, SettingError};
use friction_compensation::compensation::SettingsError;

/// Objects 2100h:2 to 6.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Refused {
    result: u8,
    name: Name,
    value: f32,
    lowest: f32,
    highest: f32,
}

impl Refused {
    pub(super) fn busy() -> Self {
        Self { result: 2, ..Self::default() }
    }

    pub(super) fn by(error: &ConfigurationError) -> Self {
        let of = |name, value, lowest, highest| Self { result: 1, name, value, lowest, highest };
        match *error {
            ConfigurationError::Setting(SettingError { name, value, low, high, .. }) => of(name, value, low, high),
            ConfigurationError::Compensation(error) => {
                let torque = |torque: friction_compensation::quantity::Torque| torque.to_bits() as f32 / 65_536.0;
                match error {
                    SettingsError::Gain(gain) => {
                        of(const { Name::of("compensation gain", "") }, gain as f32 / 65_536.0, 0.0, 1.0)
                    }
                    SettingsError::Clamp(clamp) => {
                        of(const { Name::of("compensation clamp", "Nm") }, torque(clamp), 0.0, f32::INFINITY)
                    }
                    SettingsError::Slew { slew, least } => of(
                        const { Name::of("compensation slew limit", "Nm/s") },
                        torque(slew),
                        torque(least),
                        f32::INFINITY,
                    ),
                    SettingsError::Rate(rate) => {
                        of(const { Name::of("rate of evaluations", "") }, rate as f32, 1.0, f32::INFINITY)
                    }
                }
            }
            ConfigurationError::NodeId(id) => of(const { Name::of("node id", "") }, id.into(), 1.0, 127.0),
            ConfigurationError::PolePairs(pairs) => of(const { Name::of("pole pairs", "") }, pairs as f32, 1.0, 64.0),
            // Refused where it is written, before it gets here.
            ConfigurationError::StopOption => Self { result: 1, ..Self::default() },
            ConfigurationError::EncoderCounts(counts) => {
                of(const { Name::of("encoder counts", "") }, counts as f32, 16.0, 65_535.0)
            }
        }
    }

    pub(super) fn get(&self, part: ConfigurationField) -> u32 {
        match part {
            ConfigurationField::Result => self.result.into(),
            ConfigurationField::RefusedSetting => self.name.code(),
            ConfigurationField::RefusedValue => self.value.to_bits(),
            ConfigurationField::Lowest => self.lowest.to_bits(),
            ConfigurationField::Highest => self.highest.to_bits(),
            ConfigurationField::Command | ConfigurationField::Changed => 0,
        }
    }
}
