//! Numbers of the image as numbers in SI, and back.
//!
//! A coefficient is stored in Q16.16 at full scale of the signal it multiplies; full scale is a power of two of the
//! signal's unit, so the conversion to SI is exact in f64 and a number that came from an image returns to the same
//! bits.

use super::QuantizeError;
use friction_compensation::friction::physical::Dimension;
use friction_compensation::friction::state::SIGNALS;

const Q16: f64 = 65536.0;

/// The nearest Q16.16.
pub fn to_q16(what: &str, value: f64) -> Result<i32, QuantizeError> {
    to_integer(what, value, Q16, f64::from(i32::MIN), f64::from(i32::MAX))
}

/// The nearest unsigned Q16.16.
pub fn to_unsigned_q16(what: &str, value: f64) -> Result<u32, QuantizeError> {
    let bits = scaled(what, value, Q16, 0.0, f64::from(u32::MAX))?;
    Ok(bits as u32)
}

/// The nearest multiple of 1/256, unsigned.
pub fn to_unsigned_q8(what: &str, value: f64) -> Result<u32, QuantizeError> {
    let bits = scaled(what, value, 256.0, 0.0, f64::from(u32::MAX))?;
    Ok(bits as u32)
}

/// The nearest integer to `value * scale`, between `low` and `high`.
pub fn to_integer(what: &str, value: f64, scale: f64, low: f64, high: f64) -> Result<i32, QuantizeError> {
    scaled(what, value, scale, low, high).map(|bits| bits as i32)
}

fn scaled(what: &str, value: f64, scale: f64, low: f64, high: f64) -> Result<f64, QuantizeError> {
    let bits = (value * scale).round();
    if (low..=high).contains(&bits) {
        return Ok(bits);
    }
    Err(QuantizeError::Range { what: what.to_owned(), value, limit: (high + 1.0) / scale })
}

/// Q16.16 as a number.
pub fn from_q16(bits: i32) -> f64 {
    f64::from(bits) / Q16
}

/// Value of one unit at full scale in SI, for a coefficient of this dimension; `shifts` as of
/// [`Domain::shifts`](friction_compensation::friction::domain::Domain::shifts).
fn unit(dimension: Dimension, shifts: &[u32; SIGNALS]) -> f64 {
    match dimension.per {
        None => 1.0,
        Some((signal, power)) => {
            let exponent = shifts[signal as usize] as i32 - 15;
            2f64.powi(exponent * i32::from(power))
        }
    }
}

/// A stored coefficient in SI; exact.
pub fn to_si(bits: i32, dimension: Dimension, shifts: &[u32; SIGNALS]) -> f64 {
    from_q16(bits) * unit(dimension, shifts)
}

/// The stored coefficient nearest to a number in SI.
pub fn from_si(what: &str, value: f64, dimension: Dimension, shifts: &[u32; SIGNALS]) -> Result<i32, QuantizeError> {
    let unit = unit(dimension, shifts);
    to_q16(what, value / unit).map_err(|error| match error {
        QuantizeError::Range { what, limit, .. } => QuantizeError::Range { what, value, limit: limit * unit },
        other => other,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use friction_compensation::friction::physical::Coefficients;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_stored_number_survives_the_way_to_si_and_back(
            bits: i32,
            shifts in proptest::array::uniform6(0u32..=30),
            which in 0..Coefficients::COUNT,
        ) {
            let dimension = Coefficients::DIMENSIONS[which];
            let si = to_si(bits, dimension, &shifts);
            prop_assert_eq!(from_si("x", si, dimension, &shifts), Ok(bits));
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_limit() {
        let text = to_q16("margin", 40_000.0).unwrap_err().to_string();
        assert_eq!(text, "margin is 40000, which does not fit: its magnitude must stay below 32768");
        assert!(to_q16("margin", f64::NAN).is_err());
        assert!(to_unsigned_q16("limit", -1.0).is_err());
    }
}
