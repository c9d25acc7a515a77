//! Sine and cosine of an angle in integers; any context, the control step among them.
//!
//! The algorithm, the table and therefore the bits are those of `idsp::cossin` 0.23 (quartiq/idsp, from the core
//! `cossin` of m-labs/misoc; MIT or Apache-2.0), which the tests compare with: error at most 9e-6. It is written out
//! here for two reasons. Its table is a constant without a name in the crate, so the linker cannot be told to place it
//! in SRAM, and the control interrupt must not wait for the flash. And a function that is not called but inlined
//! computes the sine alone, where no cosine is asked for.

/// log2 of the table's length.
const DEPTH: u32 = 7;
/// Bits of an angle in an octant that are interpolated.
const FRACTION: u32 = 15;

/// Sine (upper half, Q16) and twice the cosine less one (lower half, Q16) in the middle of each step of the first
/// octant.
static SINES: [u32; 1 << DEPTH] = table();

/// Cosine and sine of `angle`, 2^32 a turn; amplitude 2^31 - 0.85 * 2^15.
#[inline(always)]
pub fn cos_sin(angle: u32) -> (i32, i32) {
    // Every second octant is passed backwards.
    let forward = if angle & 1 << 29 != 0 { !angle } else { angle };
    let place = (forward << 3) >> (32 - DEPTH - FRACTION);
    let word = SINES[(place >> FRACTION) as usize];
    // The table holds the middles of its steps.
    let offset = (place & ((1 << FRACTION) - 1)) as i32 - (1 << (FRACTION - 1));
    /// Pi / 4, Q16.
    const QUARTER_PI: i32 = (core::f64::consts::FRAC_PI_4 * 65536.0) as i32;
    let distance = (offset * QUARTER_PI) >> 16;
    let cos = (word & 0xffff) as i32 + (1 << 16);
    let sin = (word >> 16) as i32;
    let near = (cos << (FRACTION - 1)) - ((sin * distance) >> DEPTH);
    let far = (sin << FRACTION) + ((cos * distance) >> (DEPTH + 1));

    let octant = angle ^ angle >> 1;
    let (cos, sin) = if octant & 1 << 29 != 0 { (far, near) } else { (near, far) };
    (if octant & 1 << 30 != 0 { -cos } else { cos }, if angle & 1 << 31 != 0 { -sin } else { sin })
}

/// Cosine and sine of an angle, rad; amplitude 1 - 1.3e-5, error beside that at most 9e-6 and what a single-precision
/// number of this size leaves of an angle. Beyond 2^31 turns, and for NaN, those of some angle.
pub fn cos_sin_of(radians: f32) -> (f32, f32) {
    let turns = radians * (0.5 * core::f32::consts::FRAC_1_PI);
    let (cos, sin) = cos_sin(((turns - (turns as i32) as f32) * 4_294_967_296.0) as i64 as u32);
    (cos as f32 * (1.0 / 2_147_483_648.0), sin as f32 * (1.0 / 2_147_483_648.0))
}

const fn table() -> [u32; 1 << DEPTH] {
    let mut words = [0; 1 << DEPTH];
    let mut i = 0;
    while i < words.len() {
        let angle = core::f64::consts::FRAC_PI_4 * (i as f64 + 0.5) / words.len() as f64;
        let (mut sin, mut cos, mut term, mut n) = (0.0, 0.0, 1.0, 0);
        // Power series: the term is angle^n / n!, with the sign of its series.
        while n < 20 {
            if n % 2 == 0 {
                cos += term;
                term *= angle / (n + 1) as f64;
            } else {
                sin += term;
                term *= -angle / (n + 1) as f64;
            }
            n += 1;
        }
        let sin = (sin * 65535.0 + 0.5) as u32;
        // The one that is taken away comes back with the half of the scale that cos has in `cos_sin`.
        let cos = ((2.0 * cos - 1.0) * 65535.0 - 1.0 + 0.5) as u32;
        words[i] = sin << 16 | cos;
        i += 1;
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_step_of_the_table_gives_the_bits_of_idsp() {
        // Every 4,001st angle passes each of the 1,024 steps of a turn a thousand times.
        for angle in (0..=u32::MAX).step_by(4_001) {
            assert_eq!(cos_sin(angle), idsp::cossin(angle as i32), "{angle:#010x}");
        }
    }

    proptest! {
        #[test]
        fn every_angle_gives_the_bits_of_idsp(angle: u32, octant in 0u32..8, near in -3i32..=3) {
            for angle in [angle, (octant << 29).wrapping_add_signed(near)] {
                prop_assert_eq!(cos_sin(angle), idsp::cossin(angle as i32));
            }
        }
    }
}
