//! The physical friction in f64: the twin of the firmware's fixed-point model, with the same terms and names; host.
//!
//! v velocity, a acceleration, q position, tau_t theoretical torque, th = T - T_ref, d = tanh(v / v_c):
//!
//! ```text
//! friction = c0 + c_q q + c_T th + c_tau tau_t                              linear      (001 eq. 5)
//!          + f_v (1 + k_v th) v + f_2 v |v| + f_a |v|                       viscous
//!          + (1 + k_c th + k_l |tau_t|) (1 + w (1 - tanh(v / v_w)^2)) dry
//!    w     = w+ (1 + d)/2 + w- (1 - d)/2                                    weakening
//!    dry   = (p F_c(+/-) + sum_k A_k sin(h_k q) + B_k cos(h_k q)) d         Coulomb (002 eq. 6, asymmetric), ripple
//!          + sum_n L_n z_n                                                  pre-sliding (Maxwell-slip elements)
//!          + sum_k C_k sin(h_k q) + D_k cos(h_k q)                          ripple
//!          + p sqrt(2e) (F_brk(+/-) - F_c(+/-)) exp(-u^2) u,  u = v / v_st  Stribeck    (001 eq. 6)
//!          + p b_h atan(s v + z clamp(k_a a, -1, 1))                        hysteresis  (003 eq. 4)
//!          + sum_j (b_j+ (1 + d)/2 + b_j- (1 - d)/2) 4 sin((2j-1) h q) / (pi (2j-1))    (003 eq. 5)
//!          + I_a a                                                          rotor       (002)
//! ```
//!
//! (+/-) is one value per direction of v. Where 003 switches the harmonics with sign(v), which jumps at standstill, the
//! two directions are blended by d; its sign(a) is a ramp of slope k_a, so that noise around a = 0 does not chatter.
//!
//! p = 1 - r with the relief r where a joint that shares the drive leads, and 1 elsewhere (003, section II-C). In an
//! image these are two parameter sets; what all sets have in common, elements and ripple, is the same in both.

pub use crate::friction_parameter::{Term, Terms};

use crate::friction_parameter::{FrictionParameter, HARMONICS};
use friction_compensation::friction::maxwell_slip::ELEMENTS;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// sqrt(2 e): makes the Stribeck peak, at u = 1/sqrt(2), exactly F_brk - F_c.
pub const STRIBECK_PEAK: f64 = 2.331_643_981_597_124;

/// Number of ripple series.
pub const RIPPLES: usize = friction_compensation::friction::ripple::RIPPLES;
/// Deflection of each pre-sliding element: z, -1 to 1.
pub type Bent = [f64; ELEMENTS];

/// Variables that friction depends on, in the units of the joint (rad or m, s, Nm or N, A, V; degrees Celsius).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointState {
    /// Position q.
    pub position: f64,
    /// Velocity v.
    pub velocity: f64,
    /// Acceleration a.
    pub acceleration: f64,
    /// Theoretical torque tau_t, never the measured one.
    pub load: f64,
    /// Temperature T.
    pub temperature: f64,
    /// Deflection of the pre-sliding elements.
    pub bent: Bent,
    /// The joint that shares the drive leads.
    pub following: bool,
}

/// One value for each direction of the velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Directional {
    /// Value at v >= 0.
    pub positive: f64,
    /// Value at v < 0.
    pub negative: f64,
}

impl Directional {
    /// The value that applies at this velocity.
    pub fn at(self, velocity: f64) -> f64 {
        if velocity < 0.0 { self.negative } else { self.positive }
    }
}

/// One series over the position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ripple {
    /// h, rad per unit of position; 0: absent.
    pub frequency: f64,
    /// A: sine of what is added to the Coulomb friction of both directions.
    pub level_sine: f64,
    /// B: cosine of it.
    pub level_cosine: f64,
    /// C: sine of what is added to friction, whatever the direction.
    pub torque_sine: f64,
    /// D: cosine of it.
    pub torque_cosine: f64,
}

/// The physical friction model: which terms are on, and all their parameters (module documentation: formula).
///
/// Parameters of terms that are off are ignored. Units are those of the data set.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrictionModel {
    /// Terms that are on.
    pub terms: Terms,
    /// c0.
    pub offset: f64,
    /// c_q.
    pub position_slope: f64,
    /// c_T, 1/K.
    pub temperature_slope: f64,
    /// c_tau, dimensionless.
    pub load_slope: f64,
    /// f_v, including a motor's back-EMF where the effort is a voltage.
    pub viscous: f64,
    /// k_v, 1/K.
    pub viscous_temperature: f64,
    /// f_2.
    pub quadratic: f64,
    /// F_c.
    pub coulomb: Directional,
    /// k_c, 1/K.
    pub coulomb_temperature: f64,
    /// k_l, 1 per unit of effort.
    pub coulomb_load: f64,
    /// 1/v_c.
    pub coulomb_slope: f64,
    /// F_brk.
    pub breakaway: Directional,
    /// 1/v_st.
    pub stribeck_slope: f64,
    /// b_h.
    pub hysteresis: f64,
    /// s.
    pub hysteresis_velocity_slope: f64,
    /// z, dimensionless.
    pub hysteresis_width: f64,
    /// k_a: 1 / the acceleration from which sign(a) counts fully.
    pub hysteresis_acceleration_slope: f64,
    /// h.
    pub harmonic_frequency: f64,
    /// b_j+, j = 1..5.
    pub harmonic_positive: [f64; HARMONICS],
    /// b_j-, j = 1..5.
    pub harmonic_negative: [f64; HARMONICS],
    /// I_a.
    pub rotor_inertia: f64,
    /// T_ref, degrees Celsius.
    pub reference_temperature: f64,
    /// f_a.
    #[serde(default)]
    pub viscous_asymmetry: f64,
    /// w: breakaway over Coulomb friction, less one.
    #[serde(default)]
    pub weakening: Directional,
    /// 1/v_w.
    #[serde(default)]
    pub weakening_slope: f64,
    /// 1/d_n: the reciprocal of the way that bends a pre-sliding element to its end; 0: absent. Not identified, but
    /// chosen.
    #[serde(default)]
    pub element_stiffness: [f64; ELEMENTS],
    /// L_n.
    #[serde(default)]
    pub element_level: [f64; ELEMENTS],
    /// Ripples over the position; their frequencies are not identified, but chosen.
    #[serde(default)]
    pub ripples: [Ripple; RIPPLES],
    /// r: part of the dry friction that a joint loses while the one that shares its drive leads.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub relief: f64,
}

/// True for what a joint with a drive of its own has.
fn is_zero(relief: &f64) -> bool {
    *relief == 0.0
}

/// Velocity weakening in one state.
struct Weakening {
    /// Factor of dry friction.
    factor: f64,
    /// 1 - tanh(v / v_w)^2.
    bell: f64,
    /// Derivative of the factor by 1 / v_w.
    by_slope: f64,
}

impl FrictionModel {
    /// Part of the dry friction that is there in a state: p of the formula.
    fn part(&self, s: &JointState) -> f64 {
        if s.following && self.terms.contains(Term::Relief) { 1.0 - self.relief } else { 1.0 }
    }

    /// The friction of a joint that shares its drive, with and without the other one leading, as a model without
    /// relief.
    #[must_use]
    pub fn of_regime(&self, following: bool) -> Self {
        let part = self.part(&JointState { following, ..JointState::default() });
        let both = |both: Directional| Directional { positive: part * both.positive, negative: part * both.negative };
        Self {
            terms: self.terms.without(Term::Relief),
            coulomb: both(self.coulomb),
            breakaway: both(self.breakaway),
            hysteresis: part * self.hysteresis,
            relief: 0.0,
            ..self.clone()
        }
    }

    /// The friction: the effort that is lost in this state, in the data set's unit of effort.
    pub fn friction(&self, state: &JointState) -> f64 {
        self.friction_and_derivatives(state, |_, _| ())
    }

    /// The friction, and through `derivative` its exact partial derivative by each parameter of the terms that are on
    /// (parameters whose derivative is zero for this direction may be left out).
    #[inline(always)]
    pub fn friction_and_derivatives(&self, s: &JointState, mut derivative: impl FnMut(FrictionParameter, f64)) -> f64 {
        use FrictionParameter as P;
        let on = |term| self.terms.contains(term);
        let (q, v, a) = (s.position, s.velocity, s.acceleration);
        let warming = s.temperature - self.reference_temperature;
        let mut sum = 0.0;
        if on(Term::Constant) {
            sum += self.offset;
            derivative(P::Offset, 1.0);
        }
        if on(Term::Position) {
            sum += self.position_slope * q;
            derivative(P::PositionSlope, q);
        }
        if on(Term::Temperature) {
            sum += self.temperature_slope * warming;
            derivative(P::TemperatureSlope, warming);
        }
        if on(Term::Load) {
            sum += self.load_slope * s.load;
            derivative(P::LoadSlope, s.load);
        }
        if on(Term::Viscous) {
            let mut gain = 1.0;
            if on(Term::ViscousTemperature) {
                gain += self.viscous_temperature * warming;
                derivative(P::ViscousTemperature, self.viscous * warming * v);
            }
            sum += self.viscous * gain * v;
            derivative(P::Viscous, gain * v);
        }
        if on(Term::Quadratic) {
            sum += self.quadratic * v * v.abs();
            derivative(P::Quadratic, v * v.abs());
        }
        if on(Term::ViscousAsymmetry) {
            sum += self.viscous_asymmetry * v.abs();
            derivative(P::ViscousAsymmetry, v.abs());
        }
        if on(Term::RotorInertia) {
            sum += self.rotor_inertia * a;
            derivative(P::RotorInertia, a);
        }
        let (part, mut whole) = (self.part(s), 0.0);
        let mut level = 0.0;
        let mut shapes = [(0.0, 0.0); RIPPLES];
        for (k, (ripple, shape)) in self.ripples.iter().zip(&mut shapes).enumerate() {
            if on([Term::Ripple, Term::SecondRipple][k]) {
                let (sine, cosine) = (ripple.frequency * q).sin_cos();
                *shape = (sine, cosine);
                level += ripple.level_sine * sine + ripple.level_cosine * cosine;
                sum += ripple.torque_sine * sine + ripple.torque_cosine * cosine;
                derivative(P::RippleTorqueSine(k), sine);
                derivative(P::RippleTorqueCosine(k), cosine);
            }
        }
        if on(Term::Coulomb) || on(Term::Harmonics) {
            let direction = (v * self.coulomb_slope).tanh();
            let steepness = v * (1.0 - direction * direction);
            let mut by_slope = 0.0;
            if on(Term::Coulomb) {
                let ripple = (level, shapes);
                sum += self.coulomb_and_stribeck(
                    s,
                    warming,
                    (direction, steepness),
                    ripple,
                    (part, &mut whole, &mut by_slope),
                    &mut derivative,
                );
            }
            if on(Term::Harmonics) {
                sum += self.harmonics(q, direction, steepness, &mut by_slope, &mut derivative);
            }
            derivative(P::CoulombSlope, by_slope);
        }
        if on(Term::Hysteresis) {
            let side = (self.hysteresis_acceleration_slope * a).clamp(-1.0, 1.0);
            let w = self.hysteresis_velocity_slope * v + self.hysteresis_width * side;
            let by_w = part * self.hysteresis / (1.0 + w * w);
            whole += self.hysteresis * w.atan();
            sum += part * self.hysteresis * w.atan();
            derivative(P::Hysteresis, part * w.atan());
            derivative(P::HysteresisVelocitySlope, by_w * v);
            derivative(P::HysteresisWidth, by_w * side);
        }
        if s.following && on(Term::Relief) {
            derivative(P::Relief, -whole);
        }
        sum
    }

    #[inline(always)]
    fn coulomb_and_stribeck(
        &self,
        s: &JointState,
        warming: f64,
        (direction, steepness): (f64, f64),
        (ripple, shapes): (f64, [(f64, f64); RIPPLES]),
        (part, whole, by_slope): (f64, &mut f64, &mut f64),
        derivative: &mut impl FnMut(FrictionParameter, f64),
    ) -> f64 {
        use FrictionParameter as P;
        let (v, coulomb) = (s.velocity, self.coulomb.at(s.velocity));
        let (of_coulomb, of_breakaway) = if v < 0.0 {
            (P::CoulombNegative, P::BreakawayNegative)
        } else {
            (P::CoulombPositive, P::BreakawayPositive)
        };
        let pre_slides = self.terms.contains(Term::PreSliding);
        let mut dry = (part * coulomb + ripple) * direction;
        if pre_slides {
            dry += self.element_level.iter().zip(s.bent).map(|(level, bent)| level * bent).sum::<f64>();
        }
        let weakening = self.weakening(v, direction);
        let mut gain = 1.0;
        if self.terms.contains(Term::CoulombTemperature) {
            gain += self.coulomb_temperature * warming;
            derivative(P::CoulombTemperature, weakening.factor * dry * warming);
        }
        if self.terms.contains(Term::CoulombLoad) {
            gain += self.coulomb_load * s.load.abs();
            derivative(P::CoulombLoad, weakening.factor * dry * s.load.abs());
        }
        if self.terms.contains(Term::VelocityWeakening) {
            derivative(P::WeakeningPositive, gain * dry * weakening.bell * 0.5 * (1.0 + direction));
            derivative(P::WeakeningNegative, gain * dry * weakening.bell * 0.5 * (1.0 - direction));
            derivative(P::WeakeningSlope, gain * dry * weakening.by_slope);
            *by_slope += gain * dry * weakening.bell * self.weakening_difference() * steepness;
        }
        gain *= weakening.factor;
        if pre_slides {
            s.bent.into_iter().enumerate().for_each(|(n, bent)| derivative(P::Element(n), gain * bent));
        }
        for (k, (sine, cosine)) in shapes.into_iter().enumerate() {
            if (sine, cosine) != (0.0, 0.0) {
                derivative(P::RippleLevelSine(k), gain * direction * sine);
                derivative(P::RippleLevelCosine(k), gain * direction * cosine);
            }
        }
        *by_slope += (part * coulomb + ripple) * gain * steepness;
        *whole += coulomb * gain * direction;
        if !self.terms.contains(Term::Stribeck) {
            derivative(of_coulomb, part * gain * direction);
            return gain * dry;
        }
        let u = v * self.stribeck_slope;
        let bell = STRIBECK_PEAK * (-u * u).exp();
        let excess = self.breakaway.at(v) - coulomb;
        *whole += excess * bell * u;
        derivative(of_coulomb, part * (gain * direction - bell * u));
        derivative(of_breakaway, part * bell * u);
        derivative(P::StribeckSlope, part * excess * bell * (1.0 - 2.0 * u * u) * v);
        gain * dry + part * excess * bell * u
    }

    fn weakening_difference(&self) -> f64 {
        0.5 * (self.weakening.positive - self.weakening.negative)
    }

    #[inline(always)]
    fn weakening(&self, v: f64, direction: f64) -> Weakening {
        if !self.terms.contains(Term::VelocityWeakening) {
            return Weakening { factor: 1.0, bell: 0.0, by_slope: 0.0 };
        }
        let edge = (v * self.weakening_slope).tanh();
        let bell = 1.0 - edge * edge;
        let amount =
            0.5 * (self.weakening.positive + self.weakening.negative) + self.weakening_difference() * direction;
        Weakening { factor: 1.0 + amount * bell, bell, by_slope: -2.0 * amount * edge * bell * v }
    }

    #[inline(always)]
    fn harmonics(
        &self,
        q: f64,
        direction: f64,
        steepness: f64,
        by_slope: &mut f64,
        derivative: &mut impl FnMut(FrictionParameter, f64),
    ) -> f64 {
        use FrictionParameter as P;
        let (forward, backward) = (0.5 * (1.0 + direction), 0.5 * (1.0 - direction));
        // sin and cos of the odd multiples by the Chebyshev recurrence f((2j+1) x) = 2 cos(2x) f((2j-1) x) - f((2j-3)
        // x).
        let (sine, cosine) = (self.harmonic_frequency * q).sin_cos();
        let twice = 2.0 * (2.0 * cosine * cosine - 1.0);
        let (mut s, mut s_before, mut c, mut c_before) = (sine, -sine, cosine, cosine);
        let (mut sum, mut by_frequency) = (0.0, 0.0);
        for j in 0..HARMONICS {
            let shape = 4.0 / PI * s / (2 * j + 1) as f64;
            let (positive, negative) = (self.harmonic_positive[j], self.harmonic_negative[j]);
            let amplitude = positive * forward + negative * backward;
            sum += amplitude * shape;
            by_frequency += amplitude * 4.0 / PI * c * q;
            *by_slope += 0.5 * (positive - negative) * shape * steepness;
            derivative(P::HarmonicPositive(j), forward * shape);
            derivative(P::HarmonicNegative(j), backward * shape);
            (s, s_before) = (twice * s - s_before, s);
            (c, c_before) = (twice * c - c_before, c);
        }
        derivative(P::HarmonicFrequency, by_frequency);
        sum
    }

    /// The value of one parameter.
    pub fn parameter(&self, parameter: FrictionParameter) -> f64 {
        *self.clone().parameter_mut(parameter)
    }

    /// The value of one parameter, to be changed.
    pub fn parameter_mut(&mut self, parameter: FrictionParameter) -> &mut f64 {
        use FrictionParameter as P;
        match parameter {
            P::Offset => &mut self.offset,
            P::PositionSlope => &mut self.position_slope,
            P::TemperatureSlope => &mut self.temperature_slope,
            P::LoadSlope => &mut self.load_slope,
            P::Viscous => &mut self.viscous,
            P::ViscousTemperature => &mut self.viscous_temperature,
            P::Quadratic => &mut self.quadratic,
            P::CoulombPositive => &mut self.coulomb.positive,
            P::CoulombNegative => &mut self.coulomb.negative,
            P::CoulombTemperature => &mut self.coulomb_temperature,
            P::CoulombLoad => &mut self.coulomb_load,
            P::CoulombSlope => &mut self.coulomb_slope,
            P::BreakawayPositive => &mut self.breakaway.positive,
            P::BreakawayNegative => &mut self.breakaway.negative,
            P::StribeckSlope => &mut self.stribeck_slope,
            P::Hysteresis => &mut self.hysteresis,
            P::HysteresisVelocitySlope => &mut self.hysteresis_velocity_slope,
            P::HysteresisWidth => &mut self.hysteresis_width,
            P::HarmonicFrequency => &mut self.harmonic_frequency,
            P::RotorInertia => &mut self.rotor_inertia,
            P::ViscousAsymmetry => &mut self.viscous_asymmetry,
            P::WeakeningPositive => &mut self.weakening.positive,
            P::WeakeningNegative => &mut self.weakening.negative,
            P::WeakeningSlope => &mut self.weakening_slope,
            P::Element(n) => &mut self.element_level[n],
            P::RippleLevelSine(k) => &mut self.ripples[k].level_sine,
            P::RippleLevelCosine(k) => &mut self.ripples[k].level_cosine,
            P::RippleTorqueSine(k) => &mut self.ripples[k].torque_sine,
            P::RippleTorqueCosine(k) => &mut self.ripples[k].torque_cosine,
            P::HarmonicPositive(n) => &mut self.harmonic_positive[n],
            P::HarmonicNegative(n) => &mut self.harmonic_negative[n],
            P::Relief => &mut self.relief,
        }
    }
}

#[cfg(test)]
#[path = "friction_model_tests.rs"]
mod tests;
