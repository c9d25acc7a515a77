//! Physical quantities at every interface: SI units in Q16.16; any context.
//!
//! One newtype a unit, so that a velocity cannot be passed for a torque. The range is [-32768, 32768) with a resolution
//! of 1/65536 (0.000015) of the unit. The same types serve a linear axis, with m for rad and N for Nm.
//!
//! Functions that the control step calls are always inlined: optimised for size, the compiler would rather call a
//! function that does nothing, 25 times a step.

use fixed::types::I16F16;

/// A number that Q16.16 cannot hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfRange {
    /// Number that was to be converted.
    pub value: f64,
    /// Unit of the quantity.
    pub unit: &'static str,
}

impl core::fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        write!(f, "{} {} does not fit Q16.16: it must lie in [-32768, 32768)", self.value, self.unit)
    }
}

impl core::error::Error for OutOfRange {}

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $unit:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
        #[repr(transparent)]
        pub struct $name(I16F16);

        impl $name {
            /// No such quantity at all.
            pub const ZERO: Self = Self(I16F16::ZERO);
            /// The lowest value, -32768.
            pub const MIN: Self = Self(I16F16::MIN);
            /// The highest value, just below 32768.
            pub const MAX: Self = Self(I16F16::MAX);
            /// Symbol of the unit.
            pub const UNIT: &'static str = $unit;

            /// From Q16.16: 65536 is one unit.
            #[inline(always)]
            pub const fn from_bits(bits: i32) -> Self {
                Self(I16F16::from_bits(bits))
            }

            /// As Q16.16: 65536 is one unit.
            #[inline(always)]
            pub const fn to_bits(self) -> i32 {
                self.0.to_bits()
            }

            /// The nearest representable value; an error beyond the range and for NaN. Host.
            pub fn from_f64(value: f64) -> Result<Self, OutOfRange> {
                I16F16::checked_from_num(value).map(Self).ok_or(OutOfRange { value, unit: $unit })
            }

            /// Exact value. Host.
            pub fn to_f64(self) -> f64 {
                self.0.to_num()
            }

            /// Sum, held at the ends of the range.
            #[inline(always)]
            pub const fn saturating_add(self, other: Self) -> Self {
                Self(self.0.saturating_add(other.0))
            }

            /// Difference, held at the ends of the range.
            #[inline(always)]
            pub const fn saturating_sub(self, other: Self) -> Self {
                Self(self.0.saturating_sub(other.0))
            }

            /// Magnitude, held at the upper end of the range.
            #[inline(always)]
            pub const fn saturating_abs(self) -> Self {
                Self(self.0.saturating_abs())
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
                core::fmt::Display::fmt(&self.0, f)?;
                f.write_str(concat!(" ", $unit))
            }
        }
    };
}

quantity!(/** Joint position, rad (m on a linear axis). */ Position, "rad");
quantity!(/** Joint velocity, rad/s (m/s). */ Velocity, "rad/s");
quantity!(/** Joint acceleration, rad/s^2 (m/s^2). */ Acceleration, "rad/s^2");
quantity!(/** Torque at the joint, Nm (force in N). */ Torque, "Nm");
quantity!(/** Current, A. */ Current, "A");
quantity!(/** Voltage, V. */ Voltage, "V");
quantity!(/** Temperature, degrees Celsius. */ Temperature, "°C");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversion_rounds_to_the_nearest_step() {
        assert_eq!(Torque::from_f64(1.0).unwrap().to_bits(), 65536);
        assert_eq!(Torque::from_f64(0.6 / 65536.0).unwrap().to_bits(), 1);
        assert_eq!(Velocity::from_f64(-2.5).unwrap().to_f64(), -2.5);
    }

    #[test]
    fn what_does_not_fit_is_refused_with_value_unit_and_range() {
        for value in [32768.0, -32769.0, f64::NAN, f64::INFINITY] {
            assert!(Position::from_f64(value).is_err(), "{value}");
        }
        let text = Velocity::from_f64(40_000.0).unwrap_err().to_string();
        assert_eq!(text, "40000 rad/s does not fit Q16.16: it must lie in [-32768, 32768)");
    }

    #[test]
    fn sums_hold_at_the_ends_of_the_range() {
        assert_eq!(Torque::MAX.saturating_add(Torque::from_bits(1)), Torque::MAX);
        assert_eq!(Torque::MIN.saturating_sub(Torque::from_bits(1)), Torque::MIN);
        assert_eq!(Torque::MIN.saturating_abs(), Torque::MAX);
    }

    #[test]
    fn display_names_the_unit() {
        assert_eq!(Torque::from_f64(-1.25).unwrap().to_string(), "-1.25 Nm");
    }
}
