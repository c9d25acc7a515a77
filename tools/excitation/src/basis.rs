//! Motions of the single coefficients of a faded series: a series is their sum; host.

use plant::excitation::Reference;
use plant::fourier::FourierSeries;
use std::f64::consts::TAU;

/// The motion of each coefficient, cosines first, at evenly spaced times from begin to end.
#[derive(Clone, Debug)]
pub struct Basis {
    duration: f64,
    motions: Vec<Vec<Reference>>,
}

impl Basis {
    /// Motions over `duration` (s) of as many harmonics, at `samples` times.
    pub fn new(duration: f64, harmonics: usize, samples: usize) -> Self {
        let mut basis = Self { duration, motions: Vec::new() };
        for index in 0..2 * harmonics {
            let mut coefficients = vec![0.0; 2 * harmonics];
            coefficients[index] = 1.0;
            let series = basis.series(&coefficients);
            let time = |n: usize| duration * n as f64 / (samples - 1) as f64;
            basis.motions.push((0..samples).map(|n| series.faded(time(n), duration)).collect());
        }
        basis
    }

    /// Duration, s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// The series of these coefficients, one period long.
    pub fn series(&self, coefficients: &[f64]) -> FourierSeries {
        let (cosine, sine) = coefficients.split_at(coefficients.len() / 2);
        FourierSeries { fundamental: TAU / self.duration, cosine: cosine.to_vec(), sine: sine.to_vec() }
    }

    /// The series about position zero at every time.
    pub fn motion(&self, coefficients: &[f64]) -> Vec<Reference> {
        let mut motion = vec![Reference::default(); self.motions.first().map_or(0, Vec::len)];
        for (coefficient, of_one) in coefficients.iter().zip(&self.motions) {
            for (sum, part) in motion.iter_mut().zip(of_one) {
                sum.position += coefficient * part.position;
                sum.velocity += coefficient * part.velocity;
                sum.acceleration += coefficient * part.acceleration;
            }
        }
        motion
    }
}
