//! Refusals of this crate, with the range that it would have accepted.

use std::fmt;

/// Reason for which a parameter was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterError {
    /// The value is not a number or lies outside the permitted range. Where a limit follows from another parameter
    /// (a breakaway torque is at least the Coulomb torque), that parameter's value is the limit.
    OutOfRange {
        /// The parameter's path, for example `friction.coulomb.forward`.
        name: &'static str,
        /// The value given, in the parameter's own unit.
        value: f64,
        /// Smallest permitted value, in the same unit.
        minimum: f64,
        /// Largest permitted value, in the same unit.
        maximum: f64,
    },
    /// A whole number, or the length of a list, lies outside the permitted range.
    CountOutOfRange {
        /// The parameter's path, for example `motor.gear_ratio` or `trajectory.segments`.
        name: &'static str,
        /// The number given.
        value: usize,
        /// Smallest permitted number.
        minimum: usize,
        /// Largest permitted number.
        maximum: usize,
    },
}

impl fmt::Display for ParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfRange { name, value, minimum, maximum } => {
                write!(f, "{name} = {value} is outside [{minimum}, {maximum}]")
            }
            Self::CountOutOfRange { name, value, minimum, maximum } => {
                write!(f, "{name} = {value} is outside {minimum}..={maximum}")
            }
        }
    }
}

impl std::error::Error for ParameterError {}

/// Accepts `minimum <= value <= maximum`; a NaN is outside every range.
pub(crate) fn within(name: &'static str, value: f64, minimum: f64, maximum: f64) -> Result<(), ParameterError> {
    if (minimum..=maximum).contains(&value) {
        Ok(())
    } else {
        Err(ParameterError::OutOfRange { name, value, minimum, maximum })
    }
}

/// Accepts a whole number in `minimum..=maximum`.
pub(crate) fn count_within(
    name: &'static str,
    value: usize,
    minimum: usize,
    maximum: usize,
) -> Result<(), ParameterError> {
    if (minimum..=maximum).contains(&value) {
        Ok(())
    } else {
        Err(ParameterError::CountOutOfRange { name, value, minimum, maximum })
    }
}
