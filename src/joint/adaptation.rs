//! Adaptation: what friction is in service beside what the image says, from the motion that the joint makes anyway;
//! task, host.
//!
//! A thousand times a second a task looks at a control step. Twenty looks make a row: the mean motor torque `y` of 20
//! ms is explained by
//!
//! ```text
//! y = d f + c v + J dv/dt + s sin(q) + k cos(q) + o
//! ```
//!
//! with the image's friction `f`, of which `d` is the factor, and an added viscous coefficient `c` (Nm s/rad). Inertia
//! `J` (kg m²), gravity `s` and `k` (Nm) and an offset `o` (Nm), which is whatever pushes the link, are estimated only
//! so that they are not taken for friction. The torque is a mean over time and not a sample: a controller on a bus
//! moves it once a millisecond, and looks in step with that would see its saw teeth always at the same place. Mean
//! values over a window need no measured acceleration, as in a momentum observer (003, section III-C).
//!
//! The estimate is that of least squares over the last [`MEMORY`] seconds of motion, with weights that fall
//! exponentially, and with a ridge: each number is drawn towards the image (`d` = 1, the rest 0) as strongly as its
//! prior deviation and the noise say. So a motion that does not tell two of them apart leaves them where they were, and
//! nothing winds up. Rows lie far from independent, because ripple and what the image has no term for last longer than
//! one: twenty of them count as one. A row that is far from what all six explain is a blow or a hand, and counts the
//! less the farther it is (Huber's weights).
//!
//! Nothing is learned where the command does not move the joint ([`Learning`]): a joint that is led by hand needs only
//! as much torque as compensation already gives, and would learn that friction is what it gives. What acts stays in its
//! box whatever happens ([`FACTOR`], [`Adaptation::viscous_bound`]), and compensation within its clamp.
//!
//! The energy guard calls a part of the image certain. What was learned beyond the image is not: a factor is right for
//! the velocities at which it was learned, and no more. While the guard withholds, that goes first
//! ([`Factors::guarded`]).

use super::Telemetry;
use super::active::Active;
use super::configuration::{AdaptationRequest, VelocitySource};
use super::state_machine::State;
use crate::motor::number::{exceeds, greater, lesser, limited, magnitude, or_zero, square_root, within};
use friction_compensation::compensation::{Acting, Reason};
use friction_compensation::sine::cos_sin_of;

/// `true` if this program adapts. With the feature `little-room` a chip's program does not; on the host nothing
/// changes.
pub const ADAPTS: bool = !cfg!(all(feature = "little-room", target_os = "none"));
/// Looks a second, Hz.
pub const LOOK_RATE: f32 = 1_000.0;
/// Looks in a row.
const LOOKS: u16 = 20;
/// Duration of a row, s.
const ROW: f32 = LOOKS as f32 / LOOK_RATE;
/// Place of a row's middle.
const MIDDLE: f32 = 0.5 * (LOOKS as f32 - 1.0);
/// Factor from a slope's sum to the slope of the straight line through all looks, 1/s: they are n (n² - 1) / 12 in
/// squares.
const SLOPE: f32 = LOOK_RATE * 12.0 / (LOOKS as f32 * (LOOKS as f32 * LOOKS as f32 - 1.0));
/// Time in which the weight of a row falls to a third (1 / e), s of motion.
pub const MEMORY: f32 = 8.0;
/// Weight of all rows before the newest, each time: exp(-ROW / MEMORY).
const FORGETTING: f32 = 1.0 - ROW / MEMORY + 0.5 * (ROW / MEMORY) * (ROW / MEMORY);
/// Lowest and highest factor of the image's friction that acts.
pub const FACTOR: (f32, f32) = (0.25, 2.5);
/// Largest deviation of the factor from 1 with an image that still fits.
pub const MISFIT: f32 = 0.2;
/// Estimated numbers: factor, viscous coefficient, inertia, gravity along sine and cosine, offset.
const N: usize = 6;
/// Standard deviation of the factor before anything is seen; the image may be half too large.
const PRIOR: f32 = 0.5;
/// The same of gravity, as a part of the torque limit.
const GRAVITY: f32 = 0.25;
/// Rows that count as one.
const ALIKE: f32 = 20.0;
/// Deviation from what is explained, in standard deviations, from which a row counts less.
const HUBER: f32 = 3.0;
/// Rows after which a joint may know its friction, and the factor's deviation from which on it does.
const KNOWN: (u32, f32) = (100, 0.2);
/// Deviation from what is explained, in standard deviations, from which a joint that knows its friction is being
/// touched.
const TOUCHED: f32 = 4.0;
/// Rows without that after which it learns again.
const QUIET_ROWS: u32 = 25;
/// Rows in which it has been touched without such a pause, after which it was friction that has changed: 10 s of
/// motion.
const PATIENCE_ROWS: u32 = 500;
/// Part of what was learned that counts from then on.
const FADED: f32 = 0.1;
/// Rows over which the mean square of what is left unexplained is taken.
const NOISE_ROWS: f32 = 50.0;
/// Least of it, as a part of friction's mean square.
const LEAST_NOISE: f32 = 4e-4;
/// Least friction, as a part of the torque limit.
const LEAST_FRICTION: f32 = 1e-3;

/// Corrections in effect on the image in service.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factors {
    /// Factor of the image's friction, within [`FACTOR`].
    pub factor: f32,
    /// Added viscous friction, Nm s/rad.
    pub viscous: f32,
}

impl Factors {
    /// The image as it is.
    pub const IMAGE: Self = Self { factor: 1.0, viscous: 0.0 };

    /// Corrections that act until the next look: of what was learned beyond the image, the part that the energy guard
    /// does not withhold at a control step. What was learned to be less stays.
    #[must_use]
    pub fn guarded(self, settings: &Settings, telemetry: &Telemetry) -> Self {
        let withheld = withheld(settings, telemetry);
        let beyond = |learned: f32| greater(learned, 0.0) * withheld;
        Self { factor: self.factor - beyond(self.factor - 1.0), viscous: self.viscous - beyond(self.viscous) }
    }
}

impl Default for Factors {
    fn default() -> Self {
        Self::IMAGE
    }
}

/// Learning state: the reason for which nothing is learned, or that something is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Learning {
    /// The joint learns.
    Learns = 0,
    /// Adaptation is off.
    #[default]
    Off = 1,
    /// No image acts, or compensation has no gain.
    NothingActs = 2,
    /// Operation is not enabled.
    NotEnabled = 3,
    /// A signal is outside the range that the image was trained in.
    OutsideTrainedBox = 4,
    /// The joint stands, or nearly.
    Standstill = 5,
    /// The command does not push the joint the way that it moves.
    NotPushed = 6,
    /// Torque or compensation are at a limit.
    Limited = 7,
    /// A torque acts on the link that motion and friction do not explain.
    Touched = 8,
}

/// State of adaptation at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Corrections in effect, or in shadow those that would be.
    pub factors: Factors,
    /// Standard deviation of the factor.
    pub deviation: f32,
    /// Learning state of the joint.
    pub learning: Learning,
}

impl Default for Report {
    /// Report of a joint that does not adapt.
    fn default() -> Self {
        Self { factors: Factors::IMAGE, deviation: PRIOR, learning: Learning::Off }
    }
}

impl Report {
    /// Returns `true` if friction is surely no more what the image says: [`MISFIT`] off, and two deviations. The image
    /// is to be made anew.
    pub fn misfits(&self) -> bool {
        ADAPTS && magnitude(self.factors.factor - 1.0) > MISFIT + 2.0 * self.deviation
    }

    /// Returns `true` if friction may be what the image says, again or still.
    pub fn fits(&self) -> bool {
        magnitude(self.factors.factor - 1.0) < MISFIT
    }
}

/// Settings of adaptation, from a configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Requested adaptation.
    pub request: AdaptationRequest,
    /// The compensation's gain, 0 to 1.
    pub gain: f32,
    /// Friction is computed for the reference velocity, where there is one.
    pub for_reference: bool,
    /// Part of the compensation that the energy guard may take where the joint moves, 0 to 1.
    pub uncertain: f32,
    /// rad/s.
    pub standstill: f32,
    /// Nm.
    pub torque_limit: f32,
    /// rad/s.
    pub velocity_limit: f32,
    /// rad/s².
    pub acceleration: f32,
}

impl Settings {
    /// Settings of a joint that does not adapt.
    pub const OFF: Self = Self {
        request: AdaptationRequest::Off,
        gain: 0.0,
        for_reference: false,
        uncertain: 1.0,
        standstill: 1.0,
        torque_limit: 1.0,
        velocity_limit: 1.0,
        acceleration: 1.0,
    };

    /// Settings of a joint as it is prepared.
    pub fn of(active: &Active) -> Self {
        Self {
            request: active.adaptation.request,
            gain: active.adaptation.gain,
            for_reference: active.compensation.source == VelocitySource::Reference,
            uncertain: 1.0 - active.compensation.certain,
            standstill: active.compensation.standstill,
            torque_limit: active.limits.torque,
            velocity_limit: active.limits.velocity,
            acceleration: active.motion.acceleration,
        }
    }
}

/// Sums of a row, while it fills.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Window {
    looks: u16,
    torque: f32,
    friction: f32,
    velocity: f32,
    sine: f32,
    cosine: f32,
    /// Sum of the velocity times its place before or behind the row's middle.
    slope: f32,
}

/// The estimate of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptation {
    window: Window,
    learning: Learning,
    /// Weighted sums of the rows' products, below and on the diagonal. The offset's own is the sum of the weights.
    products: [[f32; N]; N],
    /// The same of rows and what the image leaves of the torque.
    torques: [f32; N],
    /// Mean square of what a row leaves unexplained, Nm².
    noise: f32,
    /// Rows since the beginning.
    rows: u32,
    /// Rows in which something touched the joint, without a pause of [`QUIET_ROWS`].
    touched: u32,
    /// Rows since the last of them.
    quiet: u32,
    /// Difference from the image; in the units of [`Adaptation::row`].
    estimate: [f32; N],
    /// Standard deviation of the factor.
    deviation: f32,
}

impl Default for Adaptation {
    fn default() -> Self {
        Self::NOTHING
    }
}

impl Adaptation {
    /// Initial state: nothing seen yet.
    pub const NOTHING: Self = Self {
        window: Window { looks: 0, torque: 0.0, friction: 0.0, velocity: 0.0, sine: 0.0, cosine: 0.0, slope: 0.0 },
        learning: Learning::Off,
        products: [[0.0; N]; N],
        torques: [0.0; N],
        noise: 0.0,
        rows: 0,
        touched: 0,
        quiet: 0,
        estimate: [0.0; N],
        deviation: PRIOR,
    };

    /// A look at a control step; [`LOOK_RATE`] times a second. Corrections in service from here on.
    pub fn look(&mut self, settings: &Settings, telemetry: &Telemetry) -> Factors {
        if settings.request == AdaptationRequest::Off {
            *self = Self::NOTHING;
            return Factors::IMAGE;
        }
        self.learning = learning(settings, telemetry);
        if self.learning == Learning::Learns {
            self.note(settings, telemetry);
            if self.touched > 0 {
                self.learning = Learning::Touched;
            }
        } else {
            self.window.looks = 0;
        }
        if settings.request == AdaptationRequest::On { self.factors(settings) } else { Factors::IMAGE }
    }

    /// State of adaptation now.
    pub fn report(&self, settings: &Settings) -> Report {
        Report { factors: self.factors(settings), deviation: self.deviation, learning: self.learning }
    }

    /// Corrections in effect, or those that would be.
    pub fn factors(&self, settings: &Settings) -> Factors {
        if self.rows == 0 {
            return Factors::IMAGE;
        }
        Factors {
            factor: within(1.0 + self.estimate[0], FACTOR.0, FACTOR.1),
            viscous: limited(self.estimate[1] / settings.velocity_limit, self.viscous_bound(settings)),
        }
    }

    /// Largest added viscous friction, Nm s/rad: at the velocity limit three times the image's friction.
    pub fn viscous_bound(&self, settings: &Settings) -> f32 {
        3.0 * self.friction(settings) / settings.velocity_limit
    }

    /// Root of the mean square of the image's friction in what was seen, Nm.
    fn friction(&self, settings: &Settings) -> f32 {
        let weights = greater(self.products[N - 1][N - 1], 1.0);
        greater(square_root(self.products[0][0] / weights), LEAST_FRICTION * settings.torque_limit)
    }

    fn note(&mut self, settings: &Settings, telemetry: &Telemetry) {
        let motion = &telemetry.motion;
        let (cosine, sine) = cos_sin_of(motion.position);
        let window = &mut self.window;
        if window.looks == 0 {
            *window = Window::default();
        }
        window.slope += (f32::from(window.looks) - MIDDLE) * motion.velocity;
        window.looks += 1;
        window.torque += telemetry.mean_torque;
        window.friction += image_torque(telemetry) / settings.gain;
        window.velocity += motion.velocity;
        window.sine += sine;
        window.cosine += cosine;
        if window.looks == LOOKS {
            let (torque, row) = self.row(settings);
            self.window.looks = 0;
            self.learn(settings, torque, &row);
        }
    }

    /// Residual torque of a row against the image, Nm, and the row: friction, velocity as a part of the limit,
    /// acceleration as a part of the ramp's, sine, cosine, one.
    fn row(&self, settings: &Settings) -> (f32, [f32; N]) {
        let Window { torque, friction, velocity, sine, cosine, slope, .. } = self.window;
        let mean = 1.0 / f32::from(LOOKS);
        let velocity = velocity * mean / settings.velocity_limit;
        let row = [friction * mean, velocity, slope * SLOPE / settings.acceleration, sine * mean, cosine * mean, 1.0];
        (or_zero((torque - friction) * mean), row.map(or_zero))
    }

    fn learn(&mut self, settings: &Settings, torque: f32, row: &[f32; N]) {
        let explained: f32 = self.estimate.iter().zip(row).map(|(estimate, signal)| estimate * signal).sum();
        let left = magnitude(torque - explained);
        if self.is_touched(left) {
            return;
        }
        let bound = HUBER * square_root(self.noise);
        let weight = if self.rows == 0 || left <= bound { 1.0 } else { bound / left };
        for (i, &signal) in row.iter().enumerate() {
            self.torques[i] = FORGETTING * self.torques[i] + weight * signal * torque;
            for (product, other) in self.products[i].iter_mut().zip(row).take(i + 1) {
                *product = FORGETTING * *product + weight * signal * other;
            }
        }
        self.rows = self.rows.saturating_add(1);
        let square = left * left;
        let news = greater(1.0 / NOISE_ROWS, 1.0 / self.rows as f32);
        let square = if self.rows == 1 { square } else { lesser(square, 9.0 * self.noise) };
        let friction = self.friction(settings);
        self.noise = greater(self.noise + news * (square - self.noise), LEAST_NOISE * friction * friction);
        let limit = settings.torque_limit;
        self.solve(&[PRIOR, friction, limit, GRAVITY * limit, GRAVITY * limit, friction]);
    }

    /// Returns `true` if a row that leaves so much torque unexplained, Nm, is of a joint that is touched, or was a
    /// moment ago.
    fn is_touched(&mut self, left: f32) -> bool {
        let knows = self.rows >= KNOWN.0 && self.deviation < KNOWN.1;
        if knows && left > TOUCHED * square_root(self.noise) {
            (self.touched, self.quiet) = (self.touched + 1, 0);
        } else if self.touched > 0 {
            self.quiet += 1;
        }
        if self.touched > PATIENCE_ROWS {
            // Learned sums count as a second's rows do.
            self.torques = self.torques.map(|sum| FADED * sum);
            self.products = self.products.map(|sums| sums.map(|sum| FADED * sum));
            (self.rows, self.touched) = (0, 0);
        } else if self.quiet >= QUIET_ROWS {
            (self.touched, self.quiet) = (0, 0);
        }
        self.touched > 0
    }

    /// The estimate and the factor's deviation, by a Cholesky decomposition without roots (L D L') of the sums plus the
    /// ridge, in units of the prior deviations: so the smallest pivot is one, however little a motion tells.
    fn solve(&mut self, prior: &[f32; N]) {
        let share = 1.0 / (ALIKE * self.noise);
        let mut lower = [[0.0f32; N]; N];
        let mut pivots = [1.0f32; N];
        // Right-hand sides: what was seen, and the factor's unit vector.
        let mut seen = [0.0f32; N];
        let mut unit = [0.0f32; N];
        for i in 0..N {
            for j in 0..=i {
                let mut value = self.products[i][j] * prior[i] * prior[j] * share;
                for k in 0..j {
                    value -= lower[i][k] * lower[j][k] * pivots[k];
                }
                if j < i {
                    lower[i][j] = value / pivots[j];
                } else {
                    // Less than one by rounding alone.
                    pivots[i] = greater(value + 1.0, 1.0);
                }
            }
            seen[i] = self.torques[i] * prior[i] * share;
            unit[i] = if i == 0 { 1.0 } else { 0.0 };
            for j in 0..i {
                seen[i] -= lower[i][j] * seen[j];
                unit[i] -= lower[i][j] * unit[j];
            }
        }
        for i in (0..N).rev() {
            (seen[i], unit[i]) = (seen[i] / pivots[i], unit[i] / pivots[i]);
            for j in i + 1..N {
                seen[i] -= lower[j][i] * seen[j];
                unit[i] -= lower[j][i] * unit[j];
            }
        }
        for (estimate, (value, prior)) in self.estimate.iter_mut().zip(seen.iter().zip(prior)) {
            *estimate = or_zero(value * prior);
        }
        self.deviation = PRIOR * square_root(unit[0]);
    }
}

/// The image's torque with gain, Nm.
pub(super) fn image_torque(telemetry: &Telemetry) -> f32 {
    telemetry.compensated.output.torque.to_bits() as f32 * (1.0 / 65_536.0)
}

/// Share of what is uncertain that the energy guard withholds at a control step, 0 to 1; none where friction is
/// computed for a reference velocity. Near standstill, where the guard may take what is certain, too, it is rather too
/// much.
fn withheld(settings: &Settings, telemetry: &Telemetry) -> f32 {
    if settings.for_reference && telemetry.wanted.velocity.is_some() {
        return 0.0;
    }
    let moving = within(magnitude(telemetry.motion.velocity) / settings.standstill, 0.0, 1.0);
    let missing = moving - telemetry.compensated.permitted;
    within(missing / greater(moving * settings.uncertain, f32::MIN_POSITIVE), 0.0, 1.0)
}

/// Learning state of a control step: whether it tells something of friction.
fn learning(settings: &Settings, telemetry: &Telemetry) -> Learning {
    let output = &telemetry.compensated.output;
    let velocity = telemetry.motion.velocity;
    let fast = |velocity: f32| magnitude(velocity) > 2.0 * settings.standstill;
    let pushed = match telemetry.wanted.velocity {
        Some(reference) => reference * velocity > 0.0 && fast(reference),
        None => telemetry.wanted.push * velocity > 0.0,
    };
    match output.reason {
        _ if telemetry.state != State::OperationEnabled => Learning::NotEnabled,
        _ if output.acting == Acting::Nothing || settings.gain <= 0.0 => Learning::NothingActs,
        Reason::Off | Reason::NoModel => Learning::NothingActs,
        Reason::OutsideTrainedBox(_) | Reason::FarOutsideTrainedBox(_) => Learning::OutsideTrainedBox,
        _ if !fast(velocity) => Learning::Standstill,
        _ if !pushed => Learning::NotPushed,
        _ if output.limited || exceeds(telemetry.mean_torque, 0.95 * settings.torque_limit) => Learning::Limited,
        _ => Learning::Learns,
    }
}

#[cfg(test)]
mod tests;
