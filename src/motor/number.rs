//! Limits and roots of single-precision numbers, with the same bits on every machine, NaN included; control step.
//!
//! `f32::min` and `f32::max` are calls of a mathematics library on a Cortex-M4, which has no instruction for them, and
//! they drop a NaN silently. `f32::clamp` links a panic. Here everything is a comparison, and each function says where
//! a NaN goes: it always ends in a bounded number, so that no measurement can leave one behind in a state.
//!
//! A magnitude is compared with its limit as an integer: without their signs, numbers are in the order of their bits,
//! and what is not a number comes after all of them. On the core that is three instructions where two comparisons of
//! the floating-point unit take nine. Nothing but the root is a call: around a call, every number in the floating-point
//! registers is put aside.

/// The lesser; `b` where `a` is NaN.
#[inline(always)]
pub fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater; `b` where `a` is NaN.
#[inline(always)]
pub fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The sign of a number.
const SIGN: u32 = 1 << 31;
/// Infinity; NaN is above.
const INFINITY: u32 = f32::INFINITY.to_bits();

/// The number without its sign.
#[inline(always)]
pub fn magnitude(value: f32) -> f32 {
    f32::from_bits(value.to_bits() & !SIGN)
}

/// Returns `true` if a magnitude is greater than a bound, which must not be negative; so is that of NaN.
#[inline(always)]
pub fn exceeds(value: f32, bound: f32) -> bool {
    value.to_bits() & !SIGN > bound.to_bits() & !SIGN
}

/// The nearest number in `-bound..=bound`; 0 for NaN. The bound must not be negative.
#[inline(always)]
pub fn limited(value: f32, bound: f32) -> f32 {
    let bits = value.to_bits();
    let (sign, magnitude, bound) = (bits & SIGN, bits & !SIGN, bound.to_bits() & !SIGN);
    let held = if magnitude > bound { bound | sign } else { bits };
    f32::from_bits(if magnitude > INFINITY { 0 } else { held })
}

/// The nearest number in `low..=high`; the middle of the two for NaN.
#[inline(always)]
pub fn within(value: f32, low: f32, high: f32) -> f32 {
    if value > high {
        high
    } else if value < low {
        low
    } else if value.is_nan() {
        0.5 * (low + high)
    } else {
        value
    }
}

/// The number itself; 0 for NaN.
#[inline(always)]
pub fn or_zero(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value }
}

/// Square root; 0 for negative numbers and NaN. Relative error at most 2e-6, for arguments in `1e-30..=1e30`.
///
/// The estimate from the halved exponent is `micromath`'s (6 % off); each of two steps of Heron's method squares its
/// error and costs one division. The type `F32` is named because its trait's `sqrt` would lose to the library's own
/// wherever there is a standard library, and the host would compute other bits than the board.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
pub fn square_root(value: f32) -> f32 {
    if value > 0.0 {
        let estimate = micromath::F32(value).sqrt().0;
        let better = 0.5 * (estimate + value / estimate);
        0.5 * (better + value / better)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn square_root_is_within_its_error(exponent in -30.0f64..30.0) {
            let value = 10f64.powf(exponent) as f32;
            let exact = (value as f64).sqrt();
            prop_assert!((square_root(value) as f64 - exact).abs() <= 2e-6 * exact, "{} {}", square_root(value), exact);
        }

        #[test]
        fn limits_are_kept_for_whatever_bits_come(bits: u32, bound in 0.0f32..1e30) {
            let value = f32::from_bits(bits);
            prop_assert!(limited(value, bound).abs() <= bound);
            prop_assert!((-bound..=bound * 0.5).contains(&within(value, -bound, bound * 0.5)));
        }
    }

    /// Reference for [`limited`], by comparisons of numbers.
    fn limited_by_comparison(value: f32, bound: f32) -> f32 {
        if value > bound {
            bound
        } else if value < -bound {
            -bound
        } else {
            or_zero(value)
        }
    }

    proptest! {
        #[test]
        fn comparing_bits_is_comparing_numbers(
            bits in prop_oneof![any::<u32>(), (-2i32..=2).prop_map(|n| 100f32.to_bits().wrapping_add_signed(n)), Just(SIGN), Just(SIGN | INFINITY)],
            bound in prop_oneof![Just(0.0f32), Just(100.0), Just(f32::INFINITY), 0.0f32..1e38],
        ) {
            let value = f32::from_bits(bits);
            prop_assert_eq!(limited(value, bound).to_bits(), limited_by_comparison(value, bound).to_bits());
            prop_assert_eq!(exceeds(value, bound), !(value >= -bound && value <= bound));
            prop_assert_eq!(magnitude(value).to_bits(), value.abs().to_bits());
        }
    }

    #[test]
    fn a_bound_of_negative_zero_is_none_the_less_a_bound() {
        assert_eq!(limited(5.0, -0.0), 0.0);
        assert!(exceeds(5.0, -0.0));
    }

    #[test]
    fn a_nan_goes_where_the_documentation_says() {
        assert_eq!(lesser(f32::NAN, 2.0), 2.0);
        assert_eq!(greater(f32::NAN, 2.0), 2.0);
        assert_eq!(limited(f32::NAN, 3.0), 0.0);
        assert_eq!(within(f32::NAN, 1.0, 3.0), 2.0);
        assert_eq!(square_root(f32::NAN), 0.0);
        assert_eq!(square_root(-1.0), 0.0);
    }

    #[test]
    fn infinities_are_limited() {
        assert_eq!(limited(f32::INFINITY, 3.0), 3.0);
        assert_eq!(limited(f32::NEG_INFINITY, 3.0), -3.0);
    }
}
