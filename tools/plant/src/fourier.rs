//! Finite Fourier series as an excitation.
//!
//! Source: "Non-symmetric Coulomb friction with Deep Lagrangian Networks", section III-B. The coefficients are those
//! of the velocity, so one amplitude weighs the same at every harmonic. That paper then optimises them for the
//! conditioning of its regressor; here they are drawn at random and scaled into the joint's limits, because a user's
//! log is not optimal either.
//!
//! Erratum: the paper prints the velocity with -b_l sin(w l t) and the acceleration with -b_l w l cos(w l t), which
//! are not the derivatives of its position; here both have the plus sign.

use crate::noise::Noise;
use std::f64::consts::TAU;

/// Reference motion of the joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reference {
    /// Position, rad.
    pub position: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
    /// Acceleration, rad/s².
    pub acceleration: f64,
}

/// Harmonics of a series drawn at random.
pub const HARMONICS: usize = 5;

/// Seconds over which a series fades in from rest and out to rest.
pub const FADE: f64 = 1.0;

/// q(t) = sum over l of a_l / (w l) sin(w l t) - b_l / (w l) cos(w l t), about the position where the motion starts.
#[derive(Clone, Debug, PartialEq)]
pub struct FourierSeries {
    /// Fundamental frequency w, rad/s.
    pub fundamental: f64,
    /// Coefficients a_l of the velocity's cosines, l = 1, 2, ..., rad/s.
    pub cosine: Vec<f64>,
    /// Coefficients b_l of the velocity's sines, l = 1, 2, ..., rad/s.
    pub sine: Vec<f64>,
}

impl FourierSeries {
    /// The series itself at `time` (s).
    #[must_use]
    pub fn at(&self, time: f64) -> Reference {
        let mut reference = Reference::default();
        for (index, (a, b)) in self.cosine.iter().zip(&self.sine).enumerate() {
            let frequency = self.fundamental * (index + 1) as f64;
            let (sine, cosine) = libm::sincos(frequency * time);
            reference.position += (a * sine - b * cosine) / frequency;
            reference.velocity += a * cosine + b * sine;
            reference.acceleration += frequency * (b * cosine - a * sine);
        }
        reference
    }

    /// The series between `FADE` seconds of fading in and the same of fading out, so that it begins and ends at rest
    /// at zero. `duration` in s.
    #[must_use]
    pub fn faded(&self, time: f64, duration: f64) -> Reference {
        let fade = FADE.min(0.5 * duration);
        let rising = smooth_step(time / fade);
        let falling = smooth_step((duration - time) / fade);
        let (level, sign) = if rising.0 < falling.0 { (rising, 1.0) } else { (falling, -1.0) };
        let (level, slope, curvature) = (level.0, sign * level.1 / fade, level.2 / (fade * fade));
        let series = self.at(time);
        Reference {
            position: level * series.position,
            velocity: level * series.velocity + slope * series.position,
            acceleration: level * series.acceleration + 2.0 * slope * series.velocity + curvature * series.position,
        }
    }

    /// A random series with one period in `duration` (s) which stays within the limits (rad, rad/s, rad/s²) while
    /// [`faded`](Self::faded) and reaches 70 to 100 % of the tightest one.
    pub(crate) fn drawn(draw: &mut Noise, duration: f64, limits: &Reference) -> Self {
        let mut series = Self {
            fundamental: TAU / duration,
            cosine: (0..HARMONICS).map(|_| draw.normal()).collect(),
            sine: (0..HARMONICS).map(|_| draw.normal()).collect(),
        };
        let mut excess: f64 = 0.0;
        for step in 0..=1000 {
            let reference = series.faded(duration * f64::from(step) / 1000.0, duration);
            excess = excess
                .max(reference.position.abs() / limits.position)
                .max(reference.velocity.abs() / limits.velocity)
                .max(reference.acceleration.abs() / limits.acceleration);
        }
        let scale = draw.uniform(0.7, 1.0) / excess;
        for coefficient in series.cosine.iter_mut().chain(&mut series.sine) {
            *coefficient *= scale;
        }
        series
    }
}

/// Value, slope and curvature of the fifth-order polynomial from (0, 0) to (1, 1) with flat ends.
#[must_use]
pub fn smooth_step(x: f64) -> (f64, f64, f64) {
    let x = x.clamp(0.0, 1.0);
    let value = x * x * x * (10.0 + x * (6.0 * x - 15.0));
    let slope = 30.0 * x * x * (1.0 - x) * (1.0 - x);
    let curvature = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x);
    (value, slope, curvature)
}
