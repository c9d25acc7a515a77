//! Adaptation: what friction is in service beside what the image says, from the motion that the joint makes anyway; task, host.
//!
//! A thousand times a second a task looks at a control step. Twenty looks make a row: the mean motor torque `y` of a window of 20 ms is explained by
//!
//! ```text
//! y = d f + c v + J dv/dt + s sin(q) + k cos(q) + o
//! ```
//!
//! with the image's friction `f`, of which `d` is the dry factor, and an added viscous coefficient `c` (Nm s/rad). Inertia `J` (kg m²), gravity `s`, `k` (Nm) and an offset
//! `o` (Nm), which is whatever pushes the link, are estimated only so that they are not taken for friction. A Kalman filter follows all six; each walks at random
//! at its own speed, the offset fastest. Mean values over a window need no measured acceleration, as in a momentum observer
//! (003, section III-C): the change of velocity from one end to the other is all that inertia needs.
//!
//! Friction changes its sign with the motion and an offset does not: what tells them apart is a joint that moves to and fro. Until it has done that, the factors stay near
//! 1 and their uncertainty stays wide. A row that is far from what all six explain is a blow or a hand, and goes to the offset alone.
//!
//! Nothing is learned at standstill, beyond the trained box, at a limit of torque or compensation, or while the joint is not enabled. The factors stay
//! in their box whatever happens ([`DRY`], [`Adaptation::viscous_bound`]).

use super::Telemetry;
use super::active::Active;
use super::configuration::AdaptationRequest;
use super::state_machine::State;
use crate::compensation::Reason;
use crate::motor::number::{greater, lesser, limited, magnitude, or_zero, square_root, within};
use crate::sine::cos_sin;

/// Looks a second, Hz.
pub const LOOK_RATE: f32 = 1_000.0;
/// Looks in a row.
const LOOKS: u16 = 20;
/// Place of a row's middle.
const MIDDLE: f32 = 0.5 * (LOOKS as f32 - 1.0);
/// From a slope's sum to the slope of the straight line through all looks, 1/s: they are n (n² - 1) / 12 in squares.
const SLOPE: f32 = LOOK_RATE * 12.0 / (LOOKS as f32 * (LOOKS as f32 * LOOKS as f32 - 1.0));
/// Lowest and highest dry factor.
pub const DRY: (f32, f32) = (0.25, 2.5);
/// Estimated numbers: dry factor, viscous coefficient, inertia, gravity along sine and cosine, offset.
const N: usize = 6;
/// Longest pause that the estimate's walk counts, s.
const LONGEST_PAUSE: f32 = 2.0;
/// Uncertainty that is left when everything is known: what factors cannot mend.
const LEAST_UNCERTAINTY: f32 = 0.1;
/// Standard deviation of the dry factor below which it acts in full, and from which it does not act.
const TRUST: (f32, f32) = (0.1, 0.3);
/// Innovation, in standard deviations, from which a row is a blow.
const BLOW: f32 = 4.0;
/// Rows over which the noise is averaged.
const NOISE_ROWS: f32 = 50.0;

/// What acts of the image in service.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factors {
    /// Factor of the image's friction.
    pub dry: f32,
    /// Added viscous friction, Nm s/rad.
    pub viscous: f32,
    /// Part of friction that may be missing, 0 to 1: how much the energy guard may have to take.
    pub uncertainty: f32,
}

impl Factors {
    /// The image as it is.
    pub const IMAGE: Self = Self { dry: 1.0, viscous: 0.0, uncertainty: 1.0 };
}

/// Mean values of a window, while it fills.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Window {
    looks: u16,
    torque: f32,
    friction: f32,
    velocity: f32,
    sine: f32,
    cosine: f32,
    /// Sum of the velocity times its place before or behind the window's middle.
    slope: f32,
}

/// The estimate of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptation {
    estimate: [f32; N],
    covariance: [[f32; N]; N],
    /// Variance of what a row leaves unexplained, Nm²; 0 before the first row.
    noise: f32,
    /// Size of friction, Nm: the first row's.
    scale: f32,
    window: Window,
    /// Looks since the last row.
    pause: f32,
}

impl Default for Adaptation {
    fn default() -> Self {
        Self::NOTHING
    }
}

impl Adaptation {
    /// Nothing seen yet.
    pub const NOTHING: Self = Self {
        estimate: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        covariance: [[0.0; N]; N],
        noise: 0.0,
        scale: 0.0,
        window: Window { looks: 0, torque: 0.0, friction: 0.0, velocity: 0.0, sine: 0.0, cosine: 0.0, slope: 0.0 },
        pause: 0.0,
    };

    /// A look at a control step; [`LOOK_RATE`] times a second.
    pub fn look(&mut self, active: &Active, telemetry: &Telemetry) -> Factors {
        if active.compensation.adaptation == AdaptationRequest::Off {
            *self = Self::NOTHING;
            return Factors::IMAGE;
        }
        self.note(active, telemetry);
        if active.compensation.adaptation == AdaptationRequest::On { self.factors() } else { Factors::IMAGE }
    }

    fn note(&mut self, active: &Active, telemetry: &Telemetry) {
        self.pause = lesser(self.pause + 1.0, LONGEST_PAUSE * LOOK_RATE);
        let output = &telemetry.compensated.output;
        let speed = magnitude(telemetry.motion.velocity);
        let gain = active.compensation.gain;
        let learns = telemetry.state == State::OperationEnabled
            && matches!(output.reason, Reason::AsRequested | Reason::NoNetwork)
            && speed > 2.0 * active.compensation.standstill
            && gain > 0.0
            && magnitude(telemetry.measured_torque) < 0.95 * active.limits.torque;
        if !learns {
            self.window.looks = 0;
            return;
        }
        let position = telemetry.motion.position;
        let turns = position * (0.5 * core::f32::consts::FRAC_1_PI);
        let (cosine, sine) = cos_sin(((turns - (turns as i32) as f32) * 4_294_967_296.0) as i64 as u32);
        let window = &mut self.window;
        if window.looks == 0 {
            *window = Window::default();
        }
        window.slope += (f32::from(window.looks) - MIDDLE) * telemetry.motion.velocity;
        window.looks += 1;
        window.torque += telemetry.measured_torque;
        window.friction += output.shadow.to_bits() as f32 * (1.0 / 65_536.0) / gain;
        window.velocity += telemetry.motion.velocity;
        window.sine += sine as f32 * (1.0 / 2_147_483_648.0);
        window.cosine += cosine as f32 * (1.0 / 2_147_483_648.0);
        if window.looks == LOOKS {
            let Window { torque, friction, velocity, sine, cosine, slope, .. } = *window;
            window.looks = 0;
            let mean = 1.0 / f32::from(LOOKS);
            let row = [friction * mean, velocity * mean, slope * SLOPE, sine * mean, cosine * mean, 1.0];
            self.learn(active, torque * mean, &row);
        }
    }

    /// Largest added viscous friction, Nm s/rad.
    pub fn viscous_bound(&self, active: &Active) -> f32 {
        3.0 * self.scale / active.limits.velocity
    }

    /// Standard deviation of each number at first.
    fn prior(&self, active: &Active) -> [f32; N] {
        let torque = active.limits.torque;
        [
            0.5,
            self.scale / active.limits.velocity,
            torque / active.motion.acceleration,
            0.5 * torque,
            0.5 * torque,
            self.scale,
        ]
    }

    fn learn(&mut self, active: &Active, torque: f32, row: &[f32; N]) {
        if self.scale == 0.0 {
            self.scale = greater(magnitude(row[0]), 1e-3 * active.limits.torque);
            self.noise = 0.01 * self.scale * self.scale;
            let prior = self.prior(active);
            for (i, deviation) in prior.iter().enumerate() {
                self.covariance[i][i] = deviation * deviation;
            }
        }
        let prior = self.prior(active);
        let time = self.pause * (1.0 / LOOK_RATE);
        self.pause = 0.0;
        // Standard deviation of each number's walk in a second.
        let walk = [0.03, 0.01 * prior[1], 0.003 * prior[2], 0.02 * self.scale, 0.02 * self.scale, 0.1 * self.scale];
        for (i, step) in walk.iter().enumerate() {
            self.covariance[i][i] = lesser(self.covariance[i][i] + step * step * time, prior[i] * prior[i]);
        }
        let mut gains = [0.0; N];
        for (gain, line) in gains.iter_mut().zip(&self.covariance) {
            *gain = line.iter().zip(row).map(|(a, b)| a * b).sum();
        }
        let explained: f32 = gains.iter().zip(row).map(|(a, b)| a * b).sum();
        let variance = explained + self.noise;
        let expected: f32 = self.estimate.iter().zip(row).map(|(a, b)| a * b).sum();
        let innovation = or_zero(torque - expected);
        if innovation * innovation > BLOW * BLOW * variance {
            let offset = &mut self.covariance[N - 1][N - 1];
            *offset = lesser(*offset + innovation * innovation, 4.0 * prior[3] * prior[3]);
            return;
        }
        let share = 1.0 / variance;
        for i in 0..N {
            let gain = gains[i] * share;
            self.estimate[i] += gain * innovation;
            for j in 0..N {
                self.covariance[i][j] -= gain * gains[j];
            }
            self.covariance[i][i] = greater(self.covariance[i][i], 1e-9 * prior[i] * prior[i]);
        }
        let left = innovation * innovation * self.noise * share;
        let noise = self.noise + (lesser(left, 9.0 * self.noise) - self.noise) * (1.0 / NOISE_ROWS);
        let scale = self.scale * self.scale;
        self.noise = within(noise, 4e-4 * scale, scale);
        self.estimate[0] = within(self.estimate[0], DRY.0, DRY.1);
        self.estimate[1] = limited(self.estimate[1], self.viscous_bound(active));
        self.estimate[2] = greater(self.estimate[2], 0.0);
    }

    /// What acts.
    pub fn factors(&self) -> Factors {
        if self.scale == 0.0 {
            return Factors::IMAGE;
        }
        let deviation = square_root(self.covariance[0][0]);
        let known = LEAST_UNCERTAINTY + 2.0 * deviation;
        let trust = within((TRUST.1 - deviation) / (TRUST.1 - TRUST.0), 0.0, 1.0);
        Factors {
            dry: 1.0 + trust * (self.estimate[0] - 1.0),
            viscous: trust * self.estimate[1],
            uncertainty: lesser(known, 1.0),
        }
    }

    /// Estimate and standard deviation of each number.
    pub fn estimate(&self) -> [(f32, f32); N] {
        core::array::from_fn(|i| (self.estimate[i], square_root(self.covariance[i][i])))
    }
}
