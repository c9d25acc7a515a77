//! Limits of a board and ranges of its converters: no joint on it may be configured for more; task, host.
//!
//! They are checked with the [whole configuration](super::configuration::Configuration::prepare), and what the control
//! step uses is held to them once more, so that no record from elsewhere switches a protection off. A reading at the
//! end of a converter's range may stand for anything beyond it, and counts as beyond its limit: no limit reaches that
//! far, and no offset of a sensor takes the reading back below it.

use super::limits::Limits;
use crate::motor::number::lesser;
use crate::sensors::analog::Analog;

/// Largest offset that a sound current sensor has, as a part of the over-current limit.
const LARGEST_OFFSET: f32 = 0.25;
/// Part of the converters' range up to its nearer end that an over-current limit may take: the rest is for the sensors'
/// offsets.
const SEEN: f32 = 0.95;

/// Highest settings that a board permits, and the ends of its converters' ranges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardLimits {
    /// Highest supply that may be permitted, V.
    pub supply: f32,
    /// Highest over-current limit, A: what the board bears for an instant, within the converters' range.
    pub over_current: f32,
    /// Largest current limit of a motor, A; 5 % below the over-current limit at least.
    pub current: f32,
    /// Highest limit of the bridge's temperature, °C.
    pub bridge_temperature: f32,
    /// Longest time without a command, s.
    pub command_deadline: f32,
    /// Phase currents from which on a converter is at the lower or upper end of its range, A.
    pub current_range: (f32, f32),
    /// Supply from which on its converter is at its upper end, V.
    pub supply_end: f32,
}

impl BoardLimits {
    /// The same with the ends of converters that are scaled like this.
    pub const fn seen_by(self, analog: &Analog) -> Self {
        Self { current_range: analog.current_range(), supply_end: analog.supply_end(), ..self }
    }

    /// End of the currents' range that is nearest to none, A.
    fn nearest_end(&self) -> f32 {
        let (low, high) = self.current_range;
        lesser(-low, high)
    }

    /// Largest offset, A, that a sound sensor has with an over-current limit, A: a quarter of it, and no more than lets
    /// the end of the range lie beyond the limit once the offset is taken off.
    pub(super) fn largest_offset(&self, over_current: f32) -> f32 {
        lesser(LARGEST_OFFSET * over_current, self.nearest_end() - over_current)
    }

    /// Limits of which none is above the board's.
    pub(super) fn hold(&self, limits: &Limits) -> Limits {
        let (lowest, highest) = limits.bus_voltage;
        Limits {
            over_current: lesser(limits.over_current, lesser(self.over_current, SEEN * self.nearest_end())),
            bus_voltage: (lowest, lesser(highest, lesser(self.supply, self.supply_end))),
            bridge_temperature: lesser(limits.bridge_temperature, self.bridge_temperature),
            command_deadline: lesser(limits.command_deadline, self.command_deadline),
            ..*limits
        }
    }
}

#[cfg(test)]
mod tests;
