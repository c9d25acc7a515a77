//! How a setting of the current loop that is out of its range is refused; task, host.

/// A setting beyond its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettingError {
    /// What was to be set.
    pub name: &'static str,
    /// Unit of the numbers; empty for a ratio.
    pub unit: &'static str,
    /// The refused value.
    pub value: f32,
    /// Least value that is possible here.
    pub low: f32,
    /// Greatest value that is possible here.
    pub high: f32,
}

impl core::fmt::Display for SettingError {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        let Self { name, unit, value, low, high } = self;
        let space = if unit.is_empty() { "" } else { " " };
        write!(f, "{name} is {value}{space}{unit}, must lie in {low} to {high}{space}{unit}")
    }
}

impl core::error::Error for SettingError {}

/// The value, where it lies in `low..=high`. NaN never does. A function of its own: it is called some sixty times.
#[inline(never)]
pub(crate) fn check(
    name: &'static str,
    unit: &'static str,
    value: f32,
    low: f32,
    high: f32,
) -> Result<f32, SettingError> {
    if value >= low && value <= high { Ok(value) } else { Err(SettingError { name, unit, value, low, high }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_says_what_was_wrong_and_what_is_possible() {
        let error = check("resistance", "Ω", -1.0, 0.001, 100.0).unwrap_err();
        assert_eq!(error.to_string(), "resistance is -1 Ω, must lie in 0.001 to 100 Ω");
        let error = check("duty", "", 2.0, 0.0, 1.0).unwrap_err();
        assert_eq!(error.to_string(), "duty is 2, must lie in 0 to 1");
    }

    #[test]
    fn nan_is_in_no_range() {
        assert!(check("resistance", "Ω", f32::NAN, f32::NEG_INFINITY, f32::INFINITY).is_err());
    }
}
