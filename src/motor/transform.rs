//! Clarke and Park transforms and their inverses, amplitude-invariant; control step.
//!
//! A sine of amplitude A in the phases is a vector of length A in both frames. Power is therefore 3/2 of the product of
//! the vectors. Phase A lies on the alpha axis; the rotor's d axis is its magnet's north pole, q leads d by a quarter
//! of an electrical turn. Any standard text on field-oriented control has these formulas, for example Krishnan,
//! Permanent Magnet Synchronous and Brushless DC Motor Drives, chapter 3.

use super::angle::SinCos;
use super::number::square_root;
use super::phases::Phases;
use core::ops::{Add, Mul, Neg, Sub};

/// 1 / sqrt 3.
pub const FRAC_1_SQRT_3: f32 = 0.577_350_26;
/// sqrt 3 / 2.
const SQRT_3_HALVES: f32 = 0.866_025_4;

/// A vector in the stationary frame, in the unit that the value carrying it states.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AlphaBeta {
    /// Along phase A.
    pub alpha: f32,
    /// A quarter of an electrical turn ahead of phase A.
    pub beta: f32,
}

/// A vector in the rotor's frame, in the unit that the value carrying it states.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dq {
    /// Direct: along the magnet's flux. Current here makes no torque (but by saliency).
    pub d: f32,
    /// Quadrature: a quarter of an electrical turn ahead. Current here is torque.
    pub q: f32,
}

impl AlphaBeta {
    /// No vector.
    pub const ZERO: Self = Self { alpha: 0.0, beta: 0.0 };

    /// Clarke transform. What the three phases have in common drops out.
    #[inline(always)]
    pub fn from_phases(phases: Phases) -> Self {
        let Phases { a, b, c } = phases;
        Self { alpha: (1.0 / 3.0) * (2.0 * a - b - c), beta: FRAC_1_SQRT_3 * (b - c) }
    }

    /// Inverse Clarke transform. The phases add up to zero but for rounding.
    #[inline(always)]
    pub fn to_phases(self) -> Phases {
        let (half, quarter_ahead) = (-0.5 * self.alpha, SQRT_3_HALVES * self.beta);
        Phases { a: self.alpha, b: half + quarter_ahead, c: half - quarter_ahead }
    }

    /// Park transform into a rotor's frame that is ahead of the stationary one by the angle of `sin_cos`.
    #[inline(always)]
    pub fn to_rotor(self, sin_cos: SinCos) -> Dq {
        let SinCos { sin, cos } = sin_cos;
        Dq { d: cos * self.alpha + sin * self.beta, q: cos * self.beta - sin * self.alpha }
    }
}

impl Dq {
    /// No vector.
    pub const ZERO: Self = Self { d: 0.0, q: 0.0 };

    /// Inverse Park transform.
    #[inline(always)]
    pub fn to_stationary(self, sin_cos: SinCos) -> AlphaBeta {
        let SinCos { sin, cos } = sin_cos;
        AlphaBeta { alpha: cos * self.d - sin * self.q, beta: sin * self.d + cos * self.q }
    }

    /// Square of the length.
    #[inline(always)]
    pub fn norm_squared(self) -> f32 {
        self.d * self.d + self.q * self.q
    }

    /// Length; relative error at most 2e-6.
    #[inline(always)]
    pub fn norm(self) -> f32 {
        square_root(self.norm_squared())
    }
}

macro_rules! vector {
    ($name:ident, $first:ident, $second:ident) => {
        impl Add for $name {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self { $first: self.$first + other.$first, $second: self.$second + other.$second }
            }
        }

        impl Sub for $name {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self { $first: self.$first - other.$first, $second: self.$second - other.$second }
            }
        }

        impl Mul<f32> for $name {
            type Output = Self;
            #[inline(always)]
            fn mul(self, factor: f32) -> Self {
                Self { $first: self.$first * factor, $second: self.$second * factor }
            }
        }

        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self { $first: -self.$first, $second: -self.$second }
            }
        }
    };
}

vector!(AlphaBeta, alpha, beta);
vector!(Dq, d, q);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::angle::ElectricalAngle;
    use core::f64::consts::TAU;
    use proptest::prelude::*;

    fn sin_cos(angle: u32) -> SinCos {
        ElectricalAngle(angle).sin_cos()
    }

    proptest! {
        #[test]
        fn there_and_back_is_the_same_vector(alpha in -100.0f32..100.0, beta in -100.0f32..100.0, angle: u32) {
            let vector = AlphaBeta { alpha, beta };
            let through_phases = AlphaBeta::from_phases(vector.to_phases());
            let through_rotor = vector.to_rotor(sin_cos(angle)).to_stationary(sin_cos(angle));
            for (back, tolerance) in [(through_phases, 1e-6), (through_rotor, 2.5e-5)] {
                let error = back - vector;
                let length = alpha.hypot(beta);
                prop_assert!(error.alpha.hypot(error.beta) <= tolerance * length, "{back:?}");
            }
        }

        #[test]
        fn what_the_phases_have_in_common_drops_out(a in -50.0f32..50.0, b in -50.0f32..50.0, c in -50.0f32..50.0, common in -50.0f32..50.0) {
            let with = AlphaBeta::from_phases(Phases { a: a + common, b: b + common, c: c + common });
            let without = AlphaBeta::from_phases(Phases { a, b, c });
            prop_assert!((with.alpha - without.alpha).abs() < 1e-4 && (with.beta - without.beta).abs() < 1e-4);
        }

        #[test]
        fn amplitude_is_kept_and_the_angle_goes_into_the_rotors_frame(amplitude in 0.1f32..100.0, angle: u32, rotor: u32) {
            let phase = |lag: f64| (amplitude as f64 * (TAU * (angle as f64 / 2f64.powi(32) - lag / 3.0)).cos()) as f32;
            let phases = Phases { a: phase(0.0), b: phase(1.0), c: phase(2.0) };
            let seen = AlphaBeta::from_phases(phases).to_rotor(sin_cos(rotor));
            let (sin, cos) = (TAU * angle.wrapping_sub(rotor) as f64 / 2f64.powi(32)).sin_cos();
            prop_assert!((seen.norm() - amplitude).abs() < 2e-5 * amplitude);
            prop_assert!((seen.d as f64 - amplitude as f64 * cos).abs() < 2e-5 * amplitude as f64, "{seen:?}");
            prop_assert!((seen.q as f64 - amplitude as f64 * sin).abs() < 2e-5 * amplitude as f64, "{seen:?}");
        }

        #[test]
        fn power_is_three_halves_of_the_product(i in (-50.0f32..50.0, -50.0f32..50.0), v in (-50.0f32..50.0, -50.0f32..50.0), angle: u32) {
            let (current, voltage) = (Dq { d: i.0, q: i.1 }, Dq { d: v.0, q: v.1 });
            let phases = |vector: Dq| vector.to_stationary(sin_cos(angle)).to_phases();
            let (ip, vp) = (phases(current), phases(voltage));
            let in_phases = ip.a * vp.a + ip.b * vp.b + ip.c * vp.c;
            let in_rotor = 1.5 * (current.d * voltage.d + current.q * voltage.q);
            prop_assert!((in_phases - in_rotor).abs() < 1e-3 + 1e-4 * current.norm() * voltage.norm());
        }
    }

    #[test]
    fn phase_b_follows_phase_a_by_a_third_of_a_turn() {
        let vector = Dq { d: 1.0, q: 0.0 };
        let at = |turns: f64| vector.to_stationary(sin_cos((turns * 2f64.powi(32)) as u32)).to_phases();
        assert!((at(0.0).a - 1.0).abs() < 1e-4);
        assert!((at(1.0 / 3.0).b - 1.0).abs() < 1e-4);
        assert!((at(2.0 / 3.0).c - 1.0).abs() < 1e-4);
    }
}
