//! The smooth functions of the friction model: tanh, the Stribeck bump, atan, sine; control step.
//!
//! Each is a table for [`interpolate`], computed at compile time from its power series, so every machine holds the same
//! words. Knots are raised by a sixteenth of step^2 times the curvature: that halves the largest error of a chord.
//! Within a table the interpolation is continuous and follows the knots exactly, therefore it is monotone wherever the
//! knots are; the certificate relies on that.
//!
//! All of them are odd, so the 257 knots of half a table are enough: 514 bytes. Only tanh, which a network looks up 15
//! times in a step, has a table of 512 words, each with its slope: sign and slope take nine instructions.

use crate::dsp::{
    HALF_TABLE_LEN, TABLE_LEN, interpolate, interpolate_odd, interpolate_odd_product, interpolate_product, smmul,
};
use crate::sine::cos_sin;

/// Words cover [-8, 8): a step of 1/32. Argument of [`tanh`] in Q25.
pub static TANH: [i32; TABLE_LEN] = table(Shape::Tanh, -256, 1.0 / 32.0);
/// Knots cover [0, 4]: a step of 1/64. Argument of [`stribeck`] in Q26.
static STRIBECK: [i16; HALF_TABLE_LEN] = knots(Shape::Stribeck, 1.0 / 64.0);
/// Knots cover [0, 1]: a step of 1/256. Holds atan in quarter turns.
static ATAN: [i16; HALF_TABLE_LEN] = knots(Shape::Atan, 1.0 / 256.0);

/// Hyperbolic tangent: argument in Q25 (saturates beyond +-8), result in Q31. Error: 7e-5 maximum, 2.2e-5 RMS.
#[inline(always)]
pub fn tanh(x: i32) -> i32 {
    interpolate(&TANH, x)
}

/// [`tanh`] of a product, Q47: the same bits as for the product cut to Q25 and held in 32 bits.
#[inline(always)]
pub fn tanh_of_product(x: i64) -> i32 {
    interpolate_product::<22>(&TANH, x)
}

/// Stribeck bump sqrt(2e) u exp(-u^2) (001 eq. 6), +-1 at u = +-1/sqrt 2: argument in Q26 (zero beyond +-4), result in
/// Q31. Error: 1e-4 maximum.
#[inline(always)]
pub fn stribeck(u: i32) -> i32 {
    interpolate_odd(&STRIBECK, u)
}

/// [`stribeck`] of a product, Q47: the same bits as for the product cut to Q26 and held in 32 bits.
#[inline(always)]
pub fn stribeck_of_product(u: i64) -> i32 {
    interpolate_odd_product::<21>(&STRIBECK, u)
}

/// Slope of the bump's table over step `step` (of 1/64; -256 to 255, held there), Q13: for the certificate.
pub fn stribeck_slope(step: i64) -> i64 {
    // An odd function's slope is even.
    let place = if step < 0 { -1 - step } else { step }.min(255) as usize & 255;
    16 * (STRIBECK[place + 1] as i64 - STRIBECK[place] as i64)
}

/// Arc tangent in quarter turns (1 is pi/2): argument in Q16.16, result in Q31. Error: 2.5e-5 maximum.
///
/// Beyond +-1 it uses atan(x) = pi/2 - atan(1/x).
#[inline(always)]
pub fn atan(x: i32) -> i32 {
    const ONE: u32 = 1 << 16;
    let magnitude = x.unsigned_abs();
    let quarter_turns = match core::num::NonZeroU32::new(magnitude) {
        Some(large) if magnitude > ONE => i32::MAX - atan_up_to_one(u32::MAX / large),
        _ => atan_up_to_one(magnitude),
    };
    if x < 0 { -quarter_turns } else { quarter_turns }
}

/// Arc tangent for x in [0, 1], Q16.16.
#[inline(always)]
fn atan_up_to_one(x: u32) -> i32 {
    interpolate_odd(&ATAN, (x.min(0xffff) << 12) as i32)
}

/// The sines of the first five odd multiples of a phase, Q30. Phase: 2^32 is a turn. Error of the sine of n x: 1e-5
/// (n^2 + 1) maximum (8e-4 for n = 9, of which the model's factor 4 / (pi n) leaves 1.2e-4 of the amplitude).
///
/// One sine and one cosine, then sin((n+2) x) = 2 cos(2x) sin(n x) - sin((n-2) x): a fifth of five calls.
#[inline(always)]
pub fn odd_sines(phase: u32) -> [i32; 5] {
    let (_, sine) = cos_sin(phase);
    let (twice, _) = cos_sin(phase << 1);
    // cos in Q31 times sine in Q30 leaves Q29 in the upper word; twice that, in Q30, is a shift by two.
    let next = |now: i32, before: i32| (smmul(twice, now) << 2).wrapping_sub(before);
    let first = sine >> 1;
    let third = next(first, first.wrapping_neg());
    let fifth = next(third, first);
    let seventh = next(fifth, third);
    [first, third, fifth, seventh, next(seventh, fifth)]
}

/// Function that a table holds. (A function pointer would say the same, but cannot be called at compile time.)
#[derive(Clone, Copy)]
enum Shape {
    Tanh,
    Stribeck,
    Atan,
}

impl Shape {
    const fn exact(self, x: f64) -> f64 {
        match self {
            Shape::Tanh => tanh_exact(x),
            Shape::Stribeck => stribeck_exact(x),
            Shape::Atan => atan_exact(x),
        }
    }
}

/// Interpolation words for a function sampled at `step`, from the step with index `first` on: knot in the upper half
/// (Q15), 16 times the rise to the next knot in the lower half. The word is their sum, so a negative slope borrows from
/// the upper half and the addition in [`interpolate`] gives it back.
const fn table<const LEN: usize>(shape: Shape, first: i32, step: f64) -> [i32; LEN] {
    let mut words = [0; LEN];
    let mut i = 0;
    while i < LEN {
        let here = knot(shape, first + i as i32, step);
        let next = knot(shape, first + i as i32 + 1, step);
        words[i] = here * 65536 + 16 * (next - here);
        i += 1;
    }
    words
}

/// The knots of half a table, from zero on.
const fn knots(shape: Shape, step: f64) -> [i16; HALF_TABLE_LEN] {
    let mut knots = [0; HALF_TABLE_LEN];
    let mut i = 0;
    while i < HALF_TABLE_LEN {
        knots[i] = knot(shape, i as i32, step) as i16;
        i += 1;
    }
    knots
}

const fn knot(shape: Shape, index: i32, step: f64) -> i32 {
    let x = index as f64 * step;
    let curvature = shape.exact(x + step) - 2.0 * shape.exact(x) + shape.exact(x - step);
    let scaled = (shape.exact(x) - curvature / 16.0) * 32768.0;
    let rounded = if scaled < 0.0 { (scaled - 0.5) as i32 } else { (scaled + 0.5) as i32 };
    if rounded > 32767 {
        32767
    } else if rounded < -32767 {
        -32767
    } else {
        rounded
    }
}

const fn exp(x: f64) -> f64 {
    // exp(x) = exp(x / 2^10)^(2^10): the reduced series converges to the last bits in 12 terms.
    let reduced = x / 1024.0;
    let mut term = 1.0;
    let mut sum = 1.0;
    let mut n = 1;
    while n < 12 {
        term *= reduced / n as f64;
        sum += term;
        n += 1;
    }
    let mut squared = 0;
    while squared < 10 {
        sum *= sum;
        squared += 1;
    }
    sum
}

const fn tanh_exact(x: f64) -> f64 {
    let e = exp(2.0 * x);
    (e - 1.0) / (e + 1.0)
}

const fn stribeck_exact(u: f64) -> f64 {
    const SQRT_2E: f64 = 2.331_643_981_597_124;
    SQRT_2E * u * exp(-u * u)
}

/// atan in quarter turns, |x| <= 1 (a little more at the ends, for the curvature).
const fn atan_exact(x: f64) -> f64 {
    // Halving the angle twice, tan(y/2) = x / (1 + sqrt(1 + x^2)), brings the series to |x| < 0.21.
    let half = x / (1.0 + sqrt(1.0 + x * x));
    let quarter = half / (1.0 + sqrt(1.0 + half * half));
    let square = quarter * quarter;
    let mut power = quarter;
    let mut sum = 0.0;
    let mut n = 0;
    while n < 20 {
        let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
        sum += sign * power / (2 * n + 1) as f64;
        power *= square;
        n += 1;
    }
    4.0 * sum / core::f64::consts::FRAC_PI_2
}

const fn sqrt(x: f64) -> f64 {
    let mut root = x;
    let mut n = 0;
    while n < 30 {
        root = 0.5 * (root + x / root);
        n += 1;
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    const Q31: f64 = 2_147_483_648.0;

    /// Largest and RMS error of `have` against `want` over `points` arguments.
    fn error(points: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
        let (mut worst, mut squares, mut count) = (0.0f64, 0.0, 0.0);
        for (have, want) in points {
            worst = worst.max((have - want).abs());
            squares += (have - want).powi(2);
            count += 1.0;
        }
        (worst, f64::sqrt(squares / count))
    }

    #[test]
    fn tanh_is_within_its_stated_error() {
        let arguments = (-(10 << 25)..(10 << 25)).step_by(997);
        let (worst, rms) = error(arguments.map(|x| (tanh(x) as f64 / Q31, (x as f64 / (1 << 25) as f64).tanh())));
        assert!(worst < 7e-5 && rms < 2.2e-5, "{worst:e} {rms:e}");
        assert!(worst > 6e-5, "the stated error is loose: {worst:e}");
    }

    #[test]
    fn stribeck_bump_is_within_its_stated_error_and_peaks_at_one() {
        let bump = |u: f64| (2.0 * std::f64::consts::E).sqrt() * u * (-u * u).exp();
        let arguments = (-(5 << 26)..(5 << 26)).step_by(997);
        let (worst, _) = error(arguments.map(|u| (stribeck(u) as f64 / Q31, bump(u as f64 / (1 << 26) as f64))));
        assert!(worst < 1e-4, "{worst:e}");
        let peak = stribeck((0.5f64.sqrt() * (1 << 26) as f64) as i32) as f64 / Q31;
        assert!((peak - 1.0).abs() < 1e-4, "{peak}");
    }

    #[test]
    fn atan_is_within_its_stated_error_over_the_whole_range() {
        let near = (-(2 << 16)..(2 << 16)).step_by(3);
        let far = (i32::MIN..i32::MAX).step_by(65_521);
        let (worst, _) =
            error(near.chain(far).map(|x| (atan(x) as f64 / Q31, (x as f64 / 65536.0).atan() / FRAC_PI_2)));
        assert!(worst < 2.5e-5, "{worst:e}");
    }

    #[test]
    fn half_a_table_gives_what_the_whole_one_would() {
        let whole: [i32; TABLE_LEN] = table(Shape::Stribeck, -256, 1.0 / 64.0);
        for (place, word) in whole.into_iter().enumerate() {
            assert_eq!(stribeck_slope(place as i64 - 256), word as i16 as i64);
        }
        let far = (i32::MIN..i32::MAX).step_by(9_973);
        let near = (-(5 << 26)..(5 << 26)).step_by(101);
        for u in far.chain(near).chain([i32::MIN, -1, 0, 1, i32::MAX]) {
            assert_eq!(stribeck(u), interpolate(&whole, u), "{u}");
        }
    }

    proptest::proptest! {
        #[test]
        fn a_product_is_looked_up_where_its_upper_bits_are(a: i32, b: i32, small in 0u32..32) {
            use crate::dsp::saturate;
            let product = (a >> small) as i64 * b as i64;
            proptest::prop_assert_eq!(tanh_of_product(product), tanh(saturate(product >> 22)));
            proptest::prop_assert_eq!(stribeck_of_product(product), stribeck(saturate(product >> 21)));
        }
    }

    #[test]
    fn odd_sines_are_within_their_stated_error() {
        for j in 0..5 {
            let multiple = (2 * j + 1) as f64;
            let phases = (0..u32::MAX).step_by(1_000_003);
            let (worst, _) = error(phases.map(|phase| {
                let angle = phase as f64 / 2f64.powi(32) * TAU;
                (odd_sines(phase)[j] as f64 / (Q31 / 2.0), (multiple * angle).sin())
            }));
            assert!(worst < 1e-5 * (multiple * multiple + 1.0), "harmonic {multiple}: {worst:e}");
        }
        assert!((odd_sines((1u32 << 31) / 2)[0] as f64 / (Q31 / 2.0) - (PI / 2.0).sin()).abs() < 4e-5);
    }

    #[test]
    fn tanh_and_atan_never_fall_and_their_ends_are_flat() {
        let mut last = i32::MIN;
        for x in (-(9 << 25)..(9 << 25)).step_by(128) {
            assert!(tanh(x) >= last);
            last = tanh(x);
        }
        last = i32::MIN;
        for x in -(3 << 16)..(3 << 16) {
            assert!(atan(x) >= last, "{x}");
            last = atan(x);
        }
        assert_eq!((tanh(i32::MAX), tanh(i32::MIN)), (32767 << 16, -32767 << 16));
        assert_eq!((stribeck(i32::MAX), stribeck(i32::MIN)), (0, 0));
    }
}
