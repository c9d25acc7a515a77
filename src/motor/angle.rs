//! Angle of the rotor's magnetic axis: electrical angle from the encoder's, with sine and cosine; control step.
//!
//! Angles are 32-bit fractions of a turn and wrap with the integers, so a multiple of the encoder's angle is exact
//! however often it wraps.
//!
//! Sine and cosine come from [`friction_compensation::sine`], in integers: the same bits everywhere, within 9e-6, for
//! about 40 instructions. The CORDIC unit of the STM32G4 takes no less: 103 cycles for the pair, with the accesses to
//! it, have been reported from a G431. It would bring registers into this arithmetic, and the host would have to
//! imitate it bit for bit; an encoder of 14 bits is 40 times coarser than the error of either.

use friction_compensation::sine::cos_sin;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Radians in a turn.
pub const TAU: f32 = core::f32::consts::TAU;
/// Steps of an angle in a turn, as a number.
pub const STEPS: f32 = 4_294_967_296.0;

/// Sine and cosine of one angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SinCos {
    /// Sine.
    pub sin: f32,
    /// Cosine.
    pub cos: f32,
}

/// Angle of the rotor's d axis ahead of phase A, as a fraction of an electrical turn: 2^32 a turn, wrapping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ElectricalAngle(
    /// 2^32 a turn.
    pub u32,
);

impl ElectricalAngle {
    /// Sine and cosine, each within 1e-5.
    #[inline(always)]
    pub fn sin_cos(self) -> SinCos {
        // The routine leaves a margin below 2^31: its amplitude, in its own tests, is 2^31 - 0.85 * 2^15.
        const TO_UNIT: f32 = 1.0 / (2_147_483_648.0 - 0.85 * 32_768.0);
        let (cos, sin) = cos_sin(self.0);
        SinCos { sin: sin as f32 * TO_UNIT, cos: cos as f32 * TO_UNIT }
    }

    /// The angle a fraction of a turn further; held at half a turn either way, 0 for NaN.
    #[inline(always)]
    pub fn advanced(self, turns: f32) -> Self {
        Self(self.0.wrapping_add((turns * STEPS) as i32 as u32))
    }
}

/// Counting direction of the encoder while the field turns forward, from phase A to B to C.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
pub enum Direction {
    /// Counts up.
    #[default]
    Forward,
    /// Down.
    Reverse,
}

impl Direction {
    /// 1 or -1.
    #[inline(always)]
    pub const fn sign(self) -> f32 {
        match self {
            Self::Forward => 1.0,
            Self::Reverse => -1.0,
        }
    }
}

/// Alignment of the encoder on the motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct EncoderAlignment {
    /// Pairs of poles: electrical turns in a mechanical one.
    pub pole_pairs: u32,
    /// Counting direction of the encoder.
    pub direction: Direction,
    /// Reading of `direction * pole_pairs * encoder` where the d axis lies on phase A.
    #[cfg_attr(feature = "serde", serde(with = "turns"))]
    pub electrical_zero: ElectricalAngle,
}

impl EncoderAlignment {
    /// Electrical angle at an encoder's angle. Exact.
    #[inline(always)]
    pub fn electrical(&self, encoder: u32) -> ElectricalAngle {
        let multiple = encoder.wrapping_mul(self.pole_pairs);
        let multiple = match self.direction {
            Direction::Forward => multiple,
            Direction::Reverse => multiple.wrapping_neg(),
        };
        ElectricalAngle(multiple.wrapping_sub(self.electrical_zero.0))
    }

    /// Electrical speed, rad/s, from the encoder's, rad/s.
    #[inline(always)]
    pub fn electrical_speed(&self, encoder_speed: f32) -> f32 {
        self.direction.sign() * self.pole_pairs as f32 * encoder_speed
    }
}

/// Form of [`EncoderAlignment::electrical_zero`] in a file: fraction of an electrical turn, whose 32 bits a double
/// holds exactly; host.
#[cfg(feature = "serde")]
mod turns {
    use super::{ElectricalAngle, STEPS};
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(angle: &ElectricalAngle, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(f64::from(angle.0) / f64::from(STEPS))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<ElectricalAngle, D::Error> {
        let turns = f64::deserialize(deserializer)?;
        if !(0.0..1.0).contains(&turns) {
            return Err(D::Error::custom(format_args!("electrical_zero is {turns} turns, must lie in 0 to below 1")));
        }
        let steps = turns * f64::from(STEPS);
        let whole = steps as u64;
        let nearest = whole + u64::from(steps - whole as f64 >= 0.5);
        // An angle within half a step of a whole turn is zero again.
        Ok(ElectricalAngle(nearest as u32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn sine_and_cosine_are_within_their_error() {
        let mut worst = 0f64;
        for n in 0..1u32 << 20 {
            let angle = n << 12;
            let SinCos { sin, cos } = ElectricalAngle(angle).sin_cos();
            let (exact_sin, exact_cos) = (core::f64::consts::TAU * angle as f64 / 2f64.powi(32)).sin_cos();
            worst = worst.max((sin as f64 - exact_sin).abs()).max((cos as f64 - exact_cos).abs());
        }
        assert!(worst < 1e-5, "{worst:e}");
    }

    #[test]
    fn an_advance_is_held_at_half_a_turn_and_nan_is_none() {
        let angle = ElectricalAngle(7 << 28);
        assert_eq!(angle.advanced(0.25), ElectricalAngle(11 << 28));
        assert_eq!(angle.advanced(-0.25), ElectricalAngle(3 << 28));
        assert_eq!(angle.advanced(-9.0), ElectricalAngle(15 << 28));
        assert_eq!(angle.advanced(f32::NAN), angle);
    }

    proptest! {
        #[test]
        fn the_electrical_angle_turns_pole_pairs_times_as_far(encoder: u32, zero: u32, pole_pairs in 1u32..64, moved: u32) {
            for direction in [Direction::Forward, Direction::Reverse] {
                let alignment = EncoderAlignment { pole_pairs, direction, electrical_zero: ElectricalAngle(zero) };
                let before = alignment.electrical(encoder).0;
                let after = alignment.electrical(encoder.wrapping_add(moved)).0;
                let exact = direction.sign() as i64 * pole_pairs as i64 * moved as i64;
                prop_assert_eq!(after.wrapping_sub(before), exact as u32);
            }
        }
    }
}
