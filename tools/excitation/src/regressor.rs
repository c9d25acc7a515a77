//! Regressor of the joint's linear model and its condition number: what samples tell apart; host.
//!
//! torque = inertia a + gravity_s sin q + gravity_c cos q + Coulomb sign(v) + viscous v + offset. Each column is
//! measured in units of its bound (acceleration over the largest acceleration, velocity over the largest velocity), so
//! that the condition number has no unit and a timid motion counts as a worse one. With singular values s, the error
//! of a parameter from noise in the torque is at most in proportion to 1 / s_min; the condition number is s_max /
//! s_min.

use super::Bounds;
use nalgebra::SMatrix;
use plant::excitation::Reference;

/// Parameters of the model.
pub const COLUMNS: usize = 6;

/// Part of the largest velocity below which friction is not Coulomb friction yet: the sign fades.
const STANDSTILL: f64 = 0.01;

/// The sums over samples from which the condition number follows.
#[derive(Clone, Debug)]
pub struct Regressor {
    velocity: f64,
    acceleration: f64,
    /// Gram matrix: columns times columns.
    gram: SMatrix<f64, COLUMNS, COLUMNS>,
}

impl Regressor {
    /// Empty regressor: nothing sampled yet.
    #[must_use]
    pub fn new(bounds: &Bounds) -> Self {
        Self { velocity: bounds.velocity, acceleration: bounds.acceleration, gram: SMatrix::zeros() }
    }

    /// Adds a sample.
    pub fn add(&mut self, motion: &Reference) {
        let (sine, cosine) = motion.position.sin_cos();
        let velocity = motion.velocity / self.velocity;
        let sign = (velocity / STANDSTILL).clamp(-1.0, 1.0);
        let row = [motion.acceleration / self.acceleration, sine, cosine, sign, velocity, 1.0];
        for (i, left) in row.iter().enumerate() {
            for (j, right) in row.iter().enumerate().skip(i) {
                self.gram[(i, j)] += left * right;
            }
        }
    }

    /// Condition number of the regressor; infinite where the samples leave a parameter undetermined. Exact up to 1e7:
    /// it is the root of that of the Gram matrix.
    #[must_use]
    pub fn condition_number(&self) -> f64 {
        let mut gram = self.gram;
        gram.fill_lower_triangle_with_upper_triangle();
        let values = gram.symmetric_eigenvalues();
        let (least, greatest) = (values.min(), values.max());
        // Remainder of zero after rounding.
        if least > 1e-14 * greatest { (greatest / least).sqrt() } else { f64::INFINITY }
    }
}

/// Condition number of the regressor of these samples.
pub fn condition_number<'a>(bounds: &Bounds, samples: impl IntoIterator<Item = &'a Reference>) -> f64 {
    let mut regressor = Regressor::new(bounds);
    samples.into_iter().for_each(|motion| regressor.add(motion));
    regressor.condition_number()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    const BOUNDS: Bounds = Bounds { position: (-1.0, 1.0), velocity: 2.0, acceleration: 10.0 };

    fn sine(amplitude: f64, frequency: f64, n: usize) -> Reference {
        let (sine, cosine) = (frequency * 0.01 * n as f64).sin_cos();
        Reference {
            position: amplitude * sine,
            velocity: amplitude * frequency * cosine,
            acceleration: -amplitude * frequency * frequency * sine,
        }
    }

    #[test]
    fn the_condition_number_is_that_of_the_singular_values() {
        let samples: Vec<Reference> = (0..700)
            .map(|n| {
                let (slow, fast) = (sine(0.6, 0.9, n), sine(0.2, 4.0, n));
                Reference {
                    position: slow.position + fast.position,
                    velocity: slow.velocity + fast.velocity,
                    acceleration: slow.acceleration + fast.acceleration,
                }
            })
            .collect();
        let matrix = DMatrix::from_fn(samples.len(), COLUMNS, |i, j| {
            let motion = &samples[i];
            [
                motion.acceleration / 10.0,
                motion.position.sin(),
                motion.position.cos(),
                (motion.velocity / 0.02).clamp(-1.0, 1.0),
                motion.velocity / 2.0,
                1.0,
            ][j]
        });
        let values = matrix.singular_values();
        let expected = values.max() / values.min();
        let found = condition_number(&BOUNDS, &samples);
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
    }

    #[test]
    fn samples_that_leave_a_parameter_open_have_no_finite_condition_number() {
        assert_eq!(condition_number(&BOUNDS, &[]), f64::INFINITY);
        assert_eq!(condition_number(&BOUNDS, &[Reference::default(); 100]), f64::INFINITY);
        // One constant speed: viscous and Coulomb friction look the same.
        let samples: Vec<Reference> = (0..100)
            .map(|n| Reference { position: 0.01 * f64::from(n), velocity: 1.0, acceleration: f64::from(n % 7) })
            .collect();
        assert_eq!(condition_number(&BOUNDS, &samples), f64::INFINITY);
    }

    #[test]
    fn a_timid_motion_is_conditioned_worse() {
        let motion = |amplitude| -> Vec<Reference> { (0..2000).map(|n| sine(amplitude, 1.3, n)).collect() };
        let bold = condition_number(&BOUNDS, &motion(0.9));
        assert!(condition_number(&BOUNDS, &motion(0.3)) > 2.0 * bold, "{bold}");
    }
}
