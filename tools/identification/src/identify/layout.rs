//! Layout of a model's parameters in the vector that is searched: columns, links, bounds; host.
//!
//! One column may serve several parameters (symmetric Coulomb friction, coupled slopes) and one parameter may be the
//! sum of two columns (breakaway = Coulomb friction + excess, so that F_brk >= F_c is a bound on one number). Slopes
//! are searched as logarithms: their plausible range covers three decades.

use super::observations::Limits;
use crate::friction_model::{FrictionModel, Ripple, Term};
use crate::friction_parameter::{Bounds, FrictionParameter as P, HARMONICS, Role};
use crate::presets::Structure;
use crate::rigid::{RigidModel, RigidParameters, RigidRegressor};
use nalgebra::DVector;
use std::f64::consts::{PI, SQRT_2};

/// v_st / v_c where both follow from one breakaway velocity (001 eq. 7 and 8).
pub const STRIBECK_OVER_COULOMB: f64 = 10.0 * SQRT_2;
/// Number of physical parameters, rigid ones first.
pub const PARAMETERS: usize = RigidRegressor::ALL.len() + P::COUNT;

/// Range of v_c and of the hysteresis' 1/s, as fractions of the highest velocity.
const EDGE_VELOCITY: (f64, f64) = (5e-4, 0.5);
/// Range of v_st, as fractions of the highest velocity.
const STRIBECK_VELOCITY: (f64, f64) = (2e-3, 0.5);
/// Largest breakaway friction over Coulomb friction, less one: few slow samples of a joint that sticks and slips would
/// ask for more, and joints have 1.1 to 1.9 times their Coulomb friction.
const WEAKENING: f64 = 1.0;
/// Largest relative change of a friction over the temperatures of the train rows.
const TEMPERATURE_EFFECT: f64 = 0.9;
/// Largest part of the dry friction that the joint that shares the drive can take off.
const RELIEF: f64 = 0.95;
/// Largest relative change of the Coulomb friction over the loads of the train rows.
const LOAD_EFFECT: f64 = 20.0;
/// Largest |z|: the arctangent is saturated beyond.
const HYSTERESIS_WIDTH: f64 = 20.0;
/// Range of the harmonic frequency in periods over the position range.
const HARMONIC_PERIODS: (f64, f64) = (0.5, 20.0);
/// Fewest periods over the position range where the rigid part has gravity: a slower wave, the position slope and a
/// piece of gravity's sine are almost one shape, and fitted together they cancel each other at thousands of times the
/// effort.
const PERIODS_BESIDE_GRAVITY: f64 = 1.5;
/// Lowest harmonic frequency where the rigid part has gravity, whose own is 1: closer to it, harmonics and gravity grow
/// without limit against each other, and friction becomes many times the measured effort for hardly any gain.
const FREQUENCY_ABOVE_GRAVITY: f64 = 2.0;

/// Bounds of a number without any.
const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
/// Bounds of a number that is not negative.
const POSITIVE: (f64, f64) = (0.0, f64::INFINITY);

/// Terms whose columns stand before those of the rigid part.
const FIRST: [Term; 2] = [Term::Viscous, Term::Constant];
/// Terms whose columns stand right behind those of the rigid part.
const SECOND: [Term; 2] = [Term::RotorInertia, Term::Load];

/// The other terms that have a column of their own in this role, in the order of the formula.
fn rest(role: Role) -> impl Iterator<Item = Term> {
    let others = Term::ALL.into_iter().filter(|term| !FIRST.contains(term) && !SECOND.contains(term));
    others.filter(move |term| term.facts().column.is_some_and(|column| column.0 == role))
}

/// The numbers of a column's bounds.
fn numbers(bounds: Bounds, limits: &Limits) -> (f64, f64) {
    match bounds {
        Bounds::Free => FREE,
        Bounds::Positive => POSITIVE,
        Bounds::OverTemperatures => {
            let effect = TEMPERATURE_EFFECT / limits.warming.max(f64::MIN_POSITIVE);
            (-effect, effect)
        }
        Bounds::OverLoads => (0.0, LOAD_EFFECT / limits.load.max(f64::MIN_POSITIVE)),
        Bounds::OfRelief => (0.0, RELIEF),
    }
}

/// A physical parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// Regressor of the rigid part.
    Rigid(RigidRegressor),
    /// Parameter of the friction.
    Friction(P),
}

impl Parameter {
    /// Position in a table of all parameters, 0..PARAMETERS.
    pub fn index(self) -> usize {
        match self {
            Self::Rigid(regressor) => regressor.index(),
            Self::Friction(parameter) => RigidRegressor::ALL.len() + parameter.index(),
        }
    }
}

/// One searched number.
#[derive(Clone, Debug)]
pub struct Column {
    /// Name for messages.
    pub name: String,
    /// Role in the model.
    pub role: Role,
    /// Bounds of the physical value.
    pub bounds: (f64, f64),
}

/// parameter += factor * physical value of the column.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// The parameter.
    pub parameter: Parameter,
    /// The column.
    pub column: usize,
    /// The factor.
    pub factor: f64,
    /// The column was made for this parameter (else it only contributes).
    pub made_for: bool,
}

/// The columns of one identification, in the order in which they are kept when the data cannot tell them apart.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// Searched numbers.
    pub columns: Vec<Column>,
    /// Links by which parameters follow from them.
    pub links: Vec<Link>,
    /// Coefficients of the rigid part without a column.
    pub fixed: RigidParameters,
}

impl Layout {
    /// Lays out a structure beside the given rigid part, with bounds from the limits of the train rows.
    pub fn new(structure: &Structure, rigid: &RigidModel, limits: &Limits) -> Self {
        let mut layout = Self { fixed: rigid.fixed(), ..Self::default() };
        let regressors = rigid.regressors();
        layout.coulomb(structure);
        let on = |term| structure.terms.contains(term);
        for term in FIRST {
            layout.term(structure, limits, term);
        }
        if !structure.holds_rigid() {
            for &regressor in &regressors {
                let inertial = matches!(regressor, RigidRegressor::Inertia | RigidRegressor::LoadInertia);
                let column = layout.column(regressor, Role::Coefficient, if inertial { POSITIVE } else { FREE });
                layout.links.push(Link { parameter: Parameter::Rigid(regressor), column, factor: 1.0, made_for: true });
            }
        }
        for term in SECOND.into_iter().chain(rest(Role::Coefficient)) {
            layout.term(structure, limits, term);
        }
        if on(Term::PreSliding) {
            (0..limits.elements).for_each(|n| layout.own(P::Element(n), Role::Coefficient, POSITIVE));
        }
        for k in (0..limits.ripples).filter(|&k| on([Term::Ripple, Term::SecondRipple][k])) {
            let level = [P::RippleLevelSine(k), P::RippleLevelCosine(k)];
            let torque = [P::RippleTorqueSine(k), P::RippleTorqueCosine(k)];
            for parameter in level.into_iter().chain(torque.into_iter().filter(|_| limits.ripple_torques[k])) {
                layout.own(parameter, Role::Coefficient, FREE);
            }
        }
        if on(Term::Stribeck) {
            layout.stribeck(structure);
        }
        if on(Term::Hysteresis) {
            layout.own(P::Hysteresis, Role::Coefficient, POSITIVE);
        }
        for term in rest(Role::Factor) {
            layout.term(structure, limits, term);
        }
        if on(Term::VelocityWeakening) {
            let sides: &[&[P]] = match structure.asymmetric_breakaway {
                true => &[&[P::WeakeningPositive], &[P::WeakeningNegative]],
                false => &[&[P::WeakeningPositive, P::WeakeningNegative]],
            };
            for side in sides {
                let name = if side.len() == 2 { "velocity weakening".into() } else { side[0].to_string() };
                let column = layout.column(name, Role::Factor, (0.0, WEAKENING));
                side.iter().for_each(|&parameter| layout.link(parameter, column, 1.0, true));
            }
        }
        if on(Term::Harmonics) {
            for j in 0..HARMONICS {
                layout.own(P::HarmonicPositive(j), Role::Coefficient, FREE);
                layout.own(P::HarmonicNegative(j), Role::Coefficient, FREE);
            }
        }
        layout.shapes(structure, limits, regressors.iter().any(|regressor| regressor.is_gravity()));
        layout
    }

    fn column(&mut self, name: impl ToString, role: Role, bounds: (f64, f64)) -> usize {
        self.columns.push(Column { name: name.to_string(), role, bounds });
        self.columns.len() - 1
    }

    fn link(&mut self, parameter: P, column: usize, factor: f64, made_for: bool) {
        self.links.push(Link { parameter: Parameter::Friction(parameter), column, factor, made_for });
    }

    fn own(&mut self, parameter: P, role: Role, bounds: (f64, f64)) {
        let column = self.column(parameter, role, bounds);
        self.link(parameter, column, 1.0, true);
    }

    /// The column of a term that has one of its own.
    fn term(&mut self, structure: &Structure, limits: &Limits, term: Term) {
        let facts = term.facts();
        if let (true, Some(parameter), Some((role, bounds))) =
            (structure.terms.contains(term), facts.size, facts.column)
        {
            self.own(parameter, role, numbers(bounds, limits));
        }
    }

    fn coulomb(&mut self, structure: &Structure) {
        if !structure.terms.contains(Term::Coulomb) {
            return;
        }
        let sides: &[&[usize]] = if structure.asymmetric_coulomb { &[&[0], &[1]] } else { &[&[0, 1]] };
        let parameters = [(P::CoulombPositive, P::BreakawayPositive), (P::CoulombNegative, P::BreakawayNegative)];
        for side in sides {
            let name = if side.len() == 2 { "Coulomb friction".into() } else { parameters[side[0]].0.to_string() };
            let column = self.column(name, Role::Coefficient, (0.0, f64::INFINITY));
            for &direction in *side {
                self.link(parameters[direction].0, column, 1.0, true);
                self.link(parameters[direction].1, column, 1.0, false);
            }
        }
    }

    fn stribeck(&mut self, structure: &Structure) {
        let sides: &[&[P]] = if structure.asymmetric_breakaway {
            &[&[P::BreakawayPositive], &[P::BreakawayNegative]]
        } else {
            &[&[P::BreakawayPositive, P::BreakawayNegative]]
        };
        for side in sides {
            let name = if side.len() == 2 { "breakaway friction".into() } else { side[0].to_string() };
            let column = self.column(name, Role::Coefficient, (0.0, f64::INFINITY));
            side.iter().for_each(|&parameter| self.link(parameter, column, 1.0, true));
        }
    }

    fn shapes(&mut self, structure: &Structure, limits: &Limits, gravity: bool) {
        let on = |term| structure.terms.contains(term);
        let velocity = limits.velocity.max(f64::MIN_POSITIVE);
        let slope = |(slowest, fastest): (f64, f64)| (1.0 / (fastest * velocity), 1.0 / (slowest * velocity));
        let (edge, peak) = (slope(EDGE_VELOCITY), slope(STRIBECK_VELOCITY));
        if on(Term::Coulomb) && on(Term::Stribeck) && structure.coupled_slopes {
            let low = peak.0.max(edge.0 / STRIBECK_OVER_COULOMB);
            let high = peak.1.min(edge.1 / STRIBECK_OVER_COULOMB);
            self.own(P::StribeckSlope, Role::Slope, (low, high));
            self.link(P::CoulombSlope, self.columns.len() - 1, STRIBECK_OVER_COULOMB, false);
        } else if on(Term::Coulomb) {
            self.own(P::CoulombSlope, Role::Slope, edge);
            if on(Term::Stribeck) {
                self.own(P::StribeckSlope, Role::Slope, peak);
            }
        }
        if on(Term::VelocityWeakening) {
            self.own(P::WeakeningSlope, Role::Slope, peak);
        }
        if on(Term::Hysteresis) {
            self.own(P::HysteresisVelocitySlope, Role::Slope, edge);
            self.own(P::HysteresisWidth, Role::Shape, (-HYSTERESIS_WIDTH, HYSTERESIS_WIDTH));
        }
        if on(Term::Harmonics) {
            let turn = 2.0 * PI / limits.position_range.max(f64::MIN_POSITIVE);
            let low = match gravity {
                true => (PERIODS_BESIDE_GRAVITY * turn).max(FREQUENCY_ABOVE_GRAVITY),
                false => HARMONIC_PERIODS.0 * turn,
            };
            self.own(P::HarmonicFrequency, Role::Shape, (low, (HARMONIC_PERIODS.1 * turn).max(low)));
        }
    }

    /// Number of columns.
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// The column that determines a parameter of the friction alone or on top of others.
    pub fn column_of(&self, parameter: P) -> Option<usize> {
        let parameter = Parameter::Friction(parameter);
        self.links.iter().rev().find(|link| link.parameter == parameter).map(|link| link.column)
    }

    /// The layout without some columns; their parameters keep what other columns give them, or 0.
    pub fn without(&self, dropped: &[bool]) -> Self {
        let mut target = 0;
        let mut moved = Vec::with_capacity(self.len());
        for &drop in dropped {
            moved.push(target);
            target += usize::from(!drop);
        }
        let columns = self.columns.iter().zip(dropped).filter(|(_, drop)| !**drop).map(|(column, _)| column.clone());
        let links = self.links.iter().filter(|link| !dropped[link.column]);
        Self {
            columns: columns.collect(),
            links: links.map(|link| Link { column: moved[link.column], ..*link }).collect(),
            fixed: self.fixed,
        }
    }

    /// Bounds of the searched numbers.
    pub fn bounds(&self) -> Vec<(f64, f64)> {
        let bounds = |c: &Column| match c.role {
            Role::Slope => (c.bounds.0.ln(), c.bounds.1.ln()),
            _ => c.bounds,
        };
        self.columns.iter().map(bounds).collect()
    }

    /// Derivative of a column's physical value by its searched number.
    pub fn physical_derivative(&self, column: usize, x: f64) -> f64 {
        if self.columns[column].role == Role::Slope { x.exp() } else { 1.0 }
    }

    /// The model at `x`. Parameters without a column are 0, but those that only shape (slopes, widths) and the fixed
    /// ones come from `template`.
    pub fn decode(&self, x: &DVector<f64>, template: &FrictionModel) -> (RigidParameters, FrictionModel) {
        let mut rigid = self.fixed;
        let mut friction = FrictionModel {
            terms: template.terms,
            coulomb_slope: template.coulomb_slope,
            hysteresis_acceleration_slope: template.hysteresis_acceleration_slope,
            reference_temperature: template.reference_temperature,
            element_stiffness: template.element_stiffness,
            ripples: template.ripples.map(|ripple| Ripple { frequency: ripple.frequency, ..Ripple::default() }),
            ..FrictionModel::default()
        };
        if self.column_of(P::CoulombSlope).is_some() {
            friction.coulomb_slope = 0.0;
        }
        for link in &self.links {
            let physical = match self.columns[link.column].role {
                Role::Slope => x[link.column].exp(),
                _ => x[link.column],
            };
            match link.parameter {
                Parameter::Rigid(regressor) => *rigid.coefficient_mut(regressor) += link.factor * physical,
                Parameter::Friction(p) => *friction.parameter_mut(p) += link.factor * physical,
            }
        }
        (rigid, friction)
    }

    /// The vector whose model comes closest to the given one: columns that serve several parameters take their mean,
    /// and all are moved into their bounds.
    pub fn encode(&self, rigid: &RigidParameters, friction: &FrictionModel) -> DVector<f64> {
        let mut x = DVector::zeros(self.len());
        for (column, of) in self.columns.iter().enumerate() {
            let values: Vec<f64> = self
                .links
                .iter()
                .filter(|link| link.column == column && link.made_for)
                .map(|link| {
                    let value = match link.parameter {
                        Parameter::Rigid(regressor) => rigid.coefficient(regressor),
                        Parameter::Friction(p) => friction.parameter(p),
                    };
                    // Earlier columns of the same parameter (breakaway: the Coulomb friction) have their part already.
                    let earlier = self.links.iter().filter(|l| l.parameter == link.parameter && l.column < column);
                    (value - earlier.map(|l| l.factor * x[l.column]).sum::<f64>()) / link.factor
                })
                .collect();
            let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
            let inside = mean.clamp(of.bounds.0, of.bounds.1);
            x[column] = if of.role == Role::Slope { inside.ln() } else { inside };
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{RIGID, friction, motion, rigid};
    use super::*;
    use crate::friction_model::Terms;

    fn layout(structure: &Structure) -> Layout {
        let limits = Limits::of(&super::super::observations::rows(&motion(2_000)), 30.0);
        let limits = Limits { elements: 4, ripples: 2, ripple_torques: [true; 2], ..limits };
        Layout::new(structure, &RIGID, &limits)
    }

    fn free() -> Structure {
        let terms = Terms::of(&Term::ALL).without(Term::Load);
        Structure { terms, asymmetric_coulomb: true, asymmetric_breakaway: true, coupled_slopes: false }
    }

    #[test]
    fn a_model_survives_the_way_into_the_vector_and_back() {
        let layout = layout(&free());
        let bounds = layout.bounds()[layout.column_of(P::HarmonicFrequency).unwrap()];
        let truth = FrictionModel { harmonic_frequency: 0.5 * (bounds.0 + bounds.1), ..friction(free().terms) };
        let (r, f) = layout.decode(&layout.encode(&rigid(), &truth), &truth);
        assert_eq!(r, rigid());
        for p in P::all().into_iter().filter(|&p| p != P::LoadSlope) {
            assert!((f.parameter(p) - truth.parameter(p)).abs() < 1e-12, "{p}");
        }
    }

    #[test]
    fn a_smaller_structure_takes_over_what_it_shares_with_a_larger_one() {
        let truth = friction(free().terms);
        let layout = layout(&Structure { terms: free().terms.without(Term::Stribeck), ..Structure::default() });
        let (_, f) = layout.decode(&layout.encode(&rigid(), &truth), &truth);
        let mean = 0.5 * (truth.coulomb.positive + truth.coulomb.negative);
        assert!((f.coulomb.positive - mean).abs() < 1e-12 && (f.coulomb.negative - mean).abs() < 1e-12);
        assert!((f.viscous - truth.viscous).abs() < 1e-12);
    }

    #[test]
    fn breakaway_friction_is_never_below_coulomb_friction() {
        let mut weak = friction(free().terms);
        weak.breakaway.positive = 0.0;
        let layout = layout(&free());
        let (_, f) = layout.decode(&layout.encode(&rigid(), &weak), &weak);
        assert_eq!(f.breakaway.positive, f.coulomb.positive);
    }

    #[test]
    fn breakaway_friction_is_at_most_twice_coulomb_friction() {
        let layout = layout(&free());
        for (weakening, kept) in [(0.99, 0.99), (1.01, 1.0)] {
            let mut joint = friction(free().terms);
            joint.weakening.negative = weakening;
            let (_, f) = layout.decode(&layout.encode(&rigid(), &joint), &joint);
            assert_eq!(f.weakening.negative, kept);
        }
    }

    #[test]
    fn harmonics_keep_away_from_the_frequency_of_gravity() {
        let layout = layout(&free());
        let column = layout.column_of(P::HarmonicFrequency).unwrap();
        assert!(layout.columns[column].bounds.0 >= FREQUENCY_ABOVE_GRAVITY);
    }
}
