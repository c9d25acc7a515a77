//! Real numbers as the integers of process data: rounded to nearest, held at the ends of the type, 0 for what is not a
//! number; any context.

/// The nearest integer, as a real number.
fn rounded(value: f32) -> f32 {
    // Casts cut off towards zero.
    if value < 0.0 { value - 0.5 } else { value + 0.5 }
}

/// 32 bits.
pub(super) fn to_i32(value: f32) -> i32 {
    rounded(value) as i32
}

/// 16 bits.
pub(super) fn to_i16(value: f32) -> i16 {
    rounded(value) as i16
}

/// 16 bits without a sign.
pub(super) fn to_u16(value: f32) -> u16 {
    rounded(value) as u16
}

/// 32 bits without a sign.
pub(super) fn to_u32(value: f32) -> u32 {
    rounded(value) as u32
}

/// A temperature in tenths of a degree; the lowest number where it is not known.
pub(super) fn temperature(celsius: f32) -> i16 {
    if celsius.is_nan() { i16::MIN } else { to_i16(10.0 * celsius).max(i16::MIN + 1) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_and_held_at_the_ends() {
        assert_eq!([-1.5, -1.4, 0.49, 0.5, 32_767.4].map(to_i16), [-2, -1, 0, 1, 32_767]);
        assert_eq!([f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1e9].map(to_i16), [i16::MAX, i16::MIN, 0, i16::MAX]);
        assert_eq!([3e9, -3e9, f32::NAN].map(to_i32), [i32::MAX, i32::MIN, 0]);
        assert_eq!([-1.0, 65_535.9, f32::NAN].map(to_u16), [0, u16::MAX, 0]);
        assert_eq!([25.04, -4e3, f32::NAN, 4e3].map(temperature), [250, -32_767, i16::MIN, i16::MAX]);
    }
}
