//! The physical friction model: every term of the design's equation, each switchable; control step.
//!
//! | term | formula | source |
//! |---|---|---|
//! | constant, position, temperature, load | c0 + c_q q + c_T th + c_tau tau | 001 eq. 5 |
//! | viscous, quadratic | f_v (1 + k_v th) v + f_2 v abs(v) | |
//! | viscous asymmetry | f_a abs(v): half the difference of both directions | |
//! | Coulomb | (F_c(+/-) + ripple level) (1 + k_c th + k_l abs(tau)) tanh(v / v_c) | 002 eq. 6, 001 eq. 6 |
//! | pre-sliding | (1 + k_c th + k_l abs(tau)) sum of level z | [`maxwell_slip`](super::maxwell_slip) |
//! | velocity weakening | a factor 1 + w(+/-) (1 - tanh(v / v_w)^2) of Coulomb friction and pre-sliding | GMS, LuGre |
//! | Stribeck | sqrt(2e) (F_brk(+/-) - F_c(+/-)) exp(-(v / v_st)^2) v / v_st | 001 eq. 6 |
//! | hysteresis | b_h atan(s v + z sign a) | 003 eq. 4 |
//! | position harmonics | sum over j = 1..5 of b_j(+/-) 4 sin((2j-1) h q) / (pi (2j-1)) | 003 eq. 5 |
//! | ripple | C sin(h q) + D cos(h q) | [`ripple`](super::ripple) |
//! | rotor inertia | I_a a | 002 |
//!
//! q position, v velocity, a acceleration, tau theoretical torque, th temperature minus reference; (+/-): one value for
//! each direction of v. Two steps of the papers' formulas are made continuous, because a loop is closed around them:
//! sign a is `k_a a` held at +-1, and harmonics and weakening pass from one direction's set to the other's along with
//! tanh(v / v_c).
//!
//! The Stribeck term is zero at standstill. Velocity weakening is largest where sliding begins, as in generalised
//! Maxwell slip (Lampaert, Swevers, Al-Bender 2002) and LuGre (Canudas de Wit et al. 1995), whose Gaussian is a squared
//! hyperbolic secant here: its table is there already.
//!
//! Signals come in Q31 of their [full scale](super::domain::Domain::shifts), coefficients are Q16.16 torques at full
//! scale: so a small coefficient of a large signal keeps its resolution. Products have 47 fraction bits and are summed
//! in 64 bits; the sum wraps, an image is used only after its certificate has proved that it fits.

pub use super::coefficients::{Coefficients, Dimension, NEWEST_FORMAT, Terms, held_by};

use super::coefficients::{Factors, oldest_format};
use super::common::CommonTorques;
use super::domain::{Domain, Range};
use super::smooth::{atan, odd_sines, stribeck_of_product, tanh_of_product};
use super::state::{SIGNALS, Signal};
use crate::dsp::{narrow, narrow_product, saturate, smlal, smmul, smull};
use crate::quantity::Torque;

/// Number of position harmonics.
pub const HARMONICS: usize = 5;

/// A physical model as it is stored and transferred.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PhysicalParameters {
    /// The terms that take part; coefficients of the others have no effect.
    pub terms: Terms,
    /// Coefficients.
    pub coefficients: Coefficients,
}

impl PhysicalParameters {
    /// The oldest format of an image that holds the model.
    pub fn format(&self) -> u16 {
        oldest_format(self.terms, &self.coefficients)
    }
}

/// A pair of values, one for each direction of the velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Directional {
    pub(crate) positive: i32,
    pub(crate) negative: i32,
}

impl Directional {
    #[inline(always)]
    fn at(self, velocity: i32) -> i32 {
        if velocity < 0 { self.negative } else { self.positive }
    }
}

/// Scaling of signals to Q31 of full scale, prepared from a domain: the same for every parameter set of an image.
#[derive(Clone, Copy, Debug)]
pub struct Scaling {
    pub(crate) ranges: [Range; SIGNALS],
    /// Powers of two.
    factors: [i32; SIGNALS],
    reference_temperature: i32,
}

/// One parameter set ready to be evaluated: coefficients of absent terms are zero, products of constants are formed.
#[derive(Clone, Copy, Debug)]
pub struct PreparedTerms {
    pub(crate) terms: Terms,
    pub(crate) coefficients: Factors,
    pub(crate) coulomb: Directional,
    /// F_brk - F_c.
    pub(crate) stribeck: Directional,
    /// Mean of both directions' w, Q16.16.
    pub(crate) weakening_mean: i32,
    /// Half their difference.
    pub(crate) weakening_difference: i32,
    /// b_h pi / 2.
    pub(crate) hysteresis: i32,
    /// h in turns at full-scale position, Q16.16.
    pub(crate) harmonic_turns: i32,
    /// 4 / (pi (2j - 1)) times half the sum of both directions' amplitudes.
    pub(crate) harmonic_mean: [i32; HARMONICS],
    /// 4 / (pi (2j - 1)) times half their difference.
    pub(crate) harmonic_difference: [i32; HARMONICS],
}

/// The physical model of one parameter set, with its scaling.
#[derive(Clone, Copy, Debug)]
pub struct Physical {
    pub(crate) scaling: Scaling,
    pub(crate) terms: PreparedTerms,
}

/// One, Q16.16.
const ONE: i32 = 1 << 16;

/// A sum of products with 47 fraction bits; wraps.
#[derive(Clone, Copy)]
struct Sum(i64);

impl Sum {
    /// Adds a coefficient (Q16.16) times a signal (Q31).
    #[inline(always)]
    fn add(&mut self, coefficient: i32, signal: i32) {
        self.0 = smlal(self.0, coefficient, signal);
    }
}

/// The sum of sines (Q30) with their amplitudes (Q16.16), rounded. No closure: optimised for nothing but size, the
/// compiler calls those.
#[inline(always)]
fn weighted([b1, b3, b5, b7, b9]: &[i32; HARMONICS], [s1, s3, s5, s7, s9]: &[i32; HARMONICS]) -> i32 {
    let sum = smlal(smlal(smlal(smlal(smull(*b1, *s1), *b3, *s3), *b5, *s5), *b7, *s7), *b9, *s9);
    saturate((sum >> 30).wrapping_add((sum >> 29) & 1))
}

/// Coefficient (Q16.16) times factor (Q16.16), rounded.
#[inline(always)]
pub(crate) fn times(coefficient: i32, factor: i32) -> i32 {
    saturate(smlal(1 << 15, coefficient, factor) >> 16)
}

/// Hyperbolic tangent of a slope times the velocity, Q31. A function of its own: two terms have one.
#[inline(never)]
fn edge(slope: i32, v: i32) -> i32 {
    tanh_of_product(smull(slope, v))
}

impl Scaling {
    /// Scaling that is not prepared yet.
    pub(super) const NONE: Self =
        Self { ranges: [Range { low: 0, high: 0 }; SIGNALS], factors: [0; SIGNALS], reference_temperature: 0 };

    /// Prepares the scaling of `domain`.
    pub fn new(domain: &Domain) -> Self {
        Self {
            ranges: domain.widened(),
            factors: domain.shifts().map(|shift| 1i32.wrapping_shl(shift)),
            reference_temperature: domain.reference_temperature,
        }
    }

    /// The signals clamped to the widened box and scaled to Q31 of full scale; temperature as difference from the
    /// reference.
    #[inline(always)]
    pub fn apply(&self, signals: &[i32; SIGNALS]) -> [i32; SIGNALS] {
        // Written out: optimised for size, the compiler keeps a loop, and with it every signal in memory.
        let [q, v, load, measured, temperature, a] = *signals;
        let clamped = |signal: Signal, value: i32| self.ranges[signal as usize].nearest(value);
        let scaled = |signal: Signal, value: i32| value.wrapping_mul(self.factors[signal as usize]);
        let plain = |signal: Signal, value: i32| scaled(signal, clamped(signal, value));
        let th = clamped(Signal::Temperature, temperature).saturating_sub(self.reference_temperature);
        [
            plain(Signal::Position, q),
            plain(Signal::Velocity, v),
            plain(Signal::TheoreticalTorque, load),
            plain(Signal::MeasuredTorque, measured),
            scaled(Signal::Temperature, th),
            plain(Signal::Acceleration, a),
        ]
    }
}

impl Physical {
    /// Prepares a model for evaluation in `domain`.
    pub fn new(parameters: &PhysicalParameters, domain: &Domain) -> Self {
        Self { scaling: Scaling::new(domain), terms: PreparedTerms::new(parameters) }
    }

    /// The model's torque without the [common terms](super::common). `signals` in Q16.16, in the order of [`Signal`];
    /// each is clamped to the widened box.
    pub fn evaluate(&self, signals: &[i32; SIGNALS]) -> Torque {
        self.terms.evaluate(&self.scaling.apply(signals), &CommonTorques::default())
    }
}

impl PreparedTerms {
    /// Largest Coulomb friction, with breakaway where that is above it, hysteresis, and pre-sliding elements (their
    /// torque where they slip, Q16.16), with the weakening's largest factor, Nm in Q16.16.
    pub(super) fn breakaway(&self, pre_sliding: i32) -> i32 {
        let of = |coulomb: i32, stribeck: i32| coulomb.saturating_add(stribeck.max(0));
        let forward = of(self.coulomb.positive, self.stribeck.positive);
        let larger = forward
            .max(of(self.coulomb.negative, self.stribeck.negative))
            .max(0)
            .saturating_add(self.hysteresis.saturating_abs());
        times(larger.saturating_add(pre_sliding), saturate(ONE as i64 + self.largest_weakening()))
    }

    /// Largest magnitude of w, Q16.16.
    #[inline(never)]
    pub(crate) fn largest_weakening(&self) -> i64 {
        (self.weakening_mean as i64).abs() + (self.weakening_difference as i64).abs()
    }

    /// No term.
    pub(super) const NONE: Self = Self {
        terms: Terms(0),
        coefficients: Factors::NONE,
        coulomb: Directional { positive: 0, negative: 0 },
        stribeck: Directional { positive: 0, negative: 0 },
        weakening_mean: 0,
        weakening_difference: 0,
        hysteresis: 0,
        harmonic_turns: 0,
        harmonic_mean: [0; HARMONICS],
        harmonic_difference: [0; HARMONICS],
    };

    /// Prepares a parameter set.
    pub fn new(parameters: &PhysicalParameters) -> Self {
        let c = parameters.coefficients;
        let on = |terms: Terms, value: i32| if parameters.terms.contains(terms) { value } else { 0 };
        let coulomb = Directional {
            positive: on(Terms::COULOMB, c.coulomb_positive),
            negative: on(Terms::COULOMB, c.coulomb_negative),
        };
        let harmonic_pairs = [
            (c.harmonic_positive_1, c.harmonic_negative_1),
            (c.harmonic_positive_2, c.harmonic_negative_2),
            (c.harmonic_positive_3, c.harmonic_negative_3),
            (c.harmonic_positive_4, c.harmonic_negative_4),
            (c.harmonic_positive_5, c.harmonic_negative_5),
        ];
        // Half of 4 / (pi (2j - 1)), Q31.
        const FACTORS: [i32; HARMONICS] = [1_367_130_551, 455_710_184, 273_426_110, 195_304_364, 151_903_395];
        let harmonic = |combine: fn(i64, i64) -> i64| {
            let mut amplitudes = [0; HARMONICS];
            for ((amplitude, (positive, negative)), factor) in amplitudes.iter_mut().zip(harmonic_pairs).zip(FACTORS) {
                let both = combine(positive as i64, negative as i64);
                *amplitude = saturate((both * factor as i64 + (1 << 30)) >> 31);
            }
            amplitudes
        };
        // Halves first: their sum and difference fit.
        let (forward, backward) = match parameters.terms.contains(Terms::VELOCITY_WEAKENING) {
            true => (c.weakening_positive >> 1, c.weakening_negative >> 1),
            false => (0, 0),
        };
        Self {
            terms: parameters.terms,
            coefficients: Factors::new(parameters.terms, &c),
            coulomb,
            stribeck: Directional {
                positive: c.breakaway_positive.saturating_sub(coulomb.positive),
                negative: c.breakaway_negative.saturating_sub(coulomb.negative),
            },
            weakening_mean: forward.wrapping_add(backward),
            weakening_difference: forward.wrapping_sub(backward),
            // pi / 2 in Q30.
            hysteresis: saturate((c.hysteresis as i64 * 1_686_629_713 + (1 << 29)) >> 30),
            // 1 / (2 pi) in Q33.
            harmonic_turns: saturate((c.harmonic_frequency as i64 * 1_367_130_551 + (1 << 32)) >> 33),
            harmonic_mean: harmonic(|positive, negative| positive + negative),
            harmonic_difference: harmonic(|positive, negative| positive - negative),
        }
    }

    /// The torque for signals [scaled](Scaling::apply), with the common terms.
    #[inline]
    pub fn evaluate(&self, scaled: &[i32; SIGNALS], common: &CommonTorques) -> Torque {
        let [q, v, load, _, th, a] = *scaled;
        let c = &self.coefficients;
        let speed = v.saturating_abs();

        // The ripple's torque is below twice the range of a torque: its certificate has proved that the sum fits.
        let mut sum = Sum((c.constant as i64).wrapping_add(common.ripple.torque as i64) << 31);
        sum.add(c.position, q);
        sum.add(c.temperature, th);
        sum.add(c.load, load);
        sum.add(c.rotor_inertia, a);

        let viscous_factor = ONE.saturating_add(narrow_product(c.viscous_temperature, th));
        sum.add(times(c.viscous, viscous_factor), v);
        sum.add(c.viscous_asymmetry, speed);
        // Only quadratic friction needs v |v|: the high word of their product in Q30, shifted to Q31.
        sum.add(c.quadratic, saturate(smull(v, speed) >> 31));

        let direction = edge(c.coulomb_slope, v);
        let mut coulomb_factor = ONE
            .saturating_add(narrow_product(c.coulomb_temperature, th))
            .saturating_add(narrow_product(c.coulomb_load, load.saturating_abs()));
        if self.terms.contains(Terms::VELOCITY_WEAKENING) {
            coulomb_factor = times(coulomb_factor, self.weakening(v, direction));
        }
        let level = self.coulomb.at(v).saturating_add(common.ripple.level);
        sum.add(times(level, coulomb_factor), direction);
        sum.add(times(common.pre_sliding, coulomb_factor), i32::MAX);

        if self.terms.contains(Terms::STRIBECK) {
            sum.add(self.stribeck.at(v), stribeck_of_product(smull(c.stribeck_slope, v)));
        }
        if self.terms.contains(Terms::HYSTERESIS) {
            sum.add(self.hysteresis, atan(self.hysteresis_argument(v, a)));
        }
        if self.terms.contains(Terms::HARMONICS) {
            sum.add(self.harmonic_amplitude(q, direction), i32::MAX);
        }
        Torque::from_bits(narrow(sum.0))
    }

    /// 1 + w (1 - tanh(v / v_w)^2), Q16.16. A function of its own, as for the harmonics.
    #[inline(never)]
    fn weakening(&self, v: i32, direction: i32) -> i32 {
        let weakening = self.weakening_mean.saturating_add(narrow_product(self.weakening_difference, direction));
        let tanh = edge(self.coefficients.weakening_slope, v);
        // 1 - tanh^2 in Q31; the square in Q30 is at most one.
        let bell = i32::MAX.wrapping_sub(smmul(tanh, tanh).wrapping_mul(2));
        ONE.saturating_add(narrow_product(weakening, bell))
    }

    /// s v + z sign a, Q16.16.
    #[inline(always)]
    pub(crate) fn hysteresis_argument(&self, v: i32, a: i32) -> i32 {
        let c = &self.coefficients;
        let sign = saturate(smull(c.hysteresis_acceleration_slope, a) >> 16);
        let velocity = narrow_product(c.hysteresis_velocity_slope, v);
        velocity.saturating_add(narrow_product(c.hysteresis_width, sign))
    }

    /// The sum of the harmonics, Q16.16. A function of its own, because not every model has them, and the control
    /// interrupt's code is short of room.
    #[inline(never)]
    fn harmonic_amplitude(&self, q: i32, direction: i32) -> i32 {
        let phase = (smull(self.harmonic_turns, q) >> 15) as u32;
        let sines = odd_sines(phase);
        let difference = weighted(&self.harmonic_difference, &sines);
        weighted(&self.harmonic_mean, &sines).saturating_add(narrow_product(difference, direction))
    }
}
