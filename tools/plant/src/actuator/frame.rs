//! Phases to dq and back, amplitude-invariant: a current of 1 A along q has 1 A of peak in the phases.
//!
//! Phase k of three stands at the angle k 2 pi/3; its direction in dq is that angle less the electrical angle. Phase
//! quantity = direction . dq, and dq = 2/3 sum of direction x phase quantity. Power is 3/2 of the product in dq.

/// Directions of the three phases in dq, at one electrical angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Components of each phase along d and q; unit vectors.
    pub directions: [[f64; 2]; 3],
}

impl Frame {
    /// The frame at an electrical `angle`, rad.
    #[must_use]
    pub fn at(angle: f64) -> Self {
        let (sine, cosine) = libm::sincos(angle);
        let (half_sine, half_cosine) = (HALF_SQRT_3 * sine, HALF_SQRT_3 * cosine);
        Self {
            directions: [
                [cosine, -sine],
                [-0.5 * cosine + half_sine, 0.5 * sine + half_cosine],
                [-0.5 * cosine - half_sine, 0.5 * sine - half_cosine],
            ],
        }
    }

    /// The phases' shares of `dq`.
    #[must_use]
    pub fn phases(&self, dq: [f64; 2]) -> [f64; 3] {
        self.directions.map(|direction| dot(direction, dq))
    }

    /// The components along d and q of `phases`; what is common to all three drops out.
    #[must_use]
    pub fn dq(&self, phases: [f64; 3]) -> [f64; 2] {
        let mut dq = [0.0; 2];
        for (direction, value) in self.directions.iter().zip(phases) {
            dq[0] += 2.0 / 3.0 * value * direction[0];
            dq[1] += 2.0 / 3.0 * value * direction[1];
        }
        dq
    }
}

const HALF_SQRT_3: f64 = 0.866_025_403_784_438_6;

pub(crate) fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}
