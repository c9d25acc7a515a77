//! Friction models of 003, equations (3), (4) and (5), and their two regimes for joints that share a drive (section
//! II-C), each fitted by least squares.
//!
//! ```text
//! (3)  b2 v + b3 atan(s v)
//! (4)  b2 v + b3 atan(s v + z sign(a))
//! (5)  b1 q + b2 v + b3 atan(s v + z sign(a))
//!      + sum_j (b_3+j (1 + sign(v)) / 2 + b_8+j (1 - sign(v)) / 2) 4 sin((2j - 1) h q) / (pi (2j - 1)),  j = 1..5
//! ```
//!
//! The paper says "least-squares techniques" and no more. Here the coefficients b are solved on a grid over s, z and h,
//! and all parameters descend from its best points by Levenberg-Marquardt; s is searched as its logarithm.

use identification::levenberg_marquardt::{Damping, LeastSquares, NormalEquations, Options, minimise};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::{PI, TAU};
use std::ops::ControlFlow;

/// Harmonics of equation (5) in each direction.
const HARMONICS: usize = 5;
/// Most coefficients b of an equation.
const MOST: usize = 3 + 2 * HARMONICS;
/// Steepness s of the grid, in reciprocals of the largest speed.
const STEEPNESS: [f64; 4] = [3.0, 15.0, 75.0, 375.0];
/// Width z of the grid.
const WIDTH: [f64; 3] = [0.3, 1.0, 3.0];
/// Frequencies h of the grid, and the fewest and most periods over the position range that they have.
const FREQUENCIES: usize = 60;
const PERIODS: (f64, f64) = (0.5, 12.0);
/// Points of the grid that are descended from.
const STARTS: usize = 6;
/// Steps of a descent, and the fall of the mean square by which it ends.
const STEPS: usize = 200;
const TOLERANCE: f64 = 1e-9;

/// State of a joint, with its friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// q, rad.
    pub position: f64,
    /// v, rad/s.
    pub velocity: f64,
    /// a, rad/s^2.
    pub acceleration: f64,
    /// Friction by equation (2), Nm.
    pub friction: f64,
}

/// Equation of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Equation {
    /// Equation (3), the paper's initial model.
    Initial,
    /// Equation (4), its basic model.
    Basic,
    /// Equation (5), its advanced model.
    Advanced,
}

impl Equation {
    /// All equations, in the paper's order.
    pub const ALL: [Self; 3] = [Self::Initial, Self::Basic, Self::Advanced];

    /// Number in the paper.
    #[must_use]
    pub fn number(self) -> u32 {
        match self {
            Self::Initial => 3,
            Self::Basic => 4,
            Self::Advanced => 5,
        }
    }

    /// Number of coefficients b.
    fn coefficients(self) -> usize {
        if self == Self::Advanced { MOST } else { 2 }
    }

    /// Number of parameters: coefficients, ln s, z, h.
    fn parameters(self) -> usize {
        self.coefficients() + self.shapes()
    }

    fn shapes(self) -> usize {
        match self {
            Self::Initial => 1,
            Self::Basic => 2,
            Self::Advanced => 3,
        }
    }
}

/// -1, 0 or 1.
fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}

/// A fitted model.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Its equation.
    pub equation: Equation,
    /// Coefficients (b2, b3, b1, b4 to b13), then ln s, z and h; those that the equation has.
    x: DVector<f64>,
}

/// Factors of the coefficients, and derivatives of the friction by ln s, z and h.
struct Row {
    columns: [f64; MOST],
    by_shape: [f64; 3],
}

impl Model {
    /// Fits the equation; None without a sample that moves.
    #[must_use]
    pub fn fit(equation: Equation, samples: &[Sample]) -> Option<Self> {
        let fastest = samples.iter().fold(0.0, |most: f64, sample| most.max(sample.velocity.abs()));
        let positions = samples.iter().map(|sample| sample.position);
        let (low, high) = positions.fold((f64::MAX, f64::MIN), |(low, high), q| (low.min(q), high.max(q)));
        if fastest == 0.0 || high <= low {
            return None;
        }
        let frequency = |n: usize| {
            let part = n as f64 / (FREQUENCIES - 1) as f64;
            TAU / (high - low) * PERIODS.0 * (PERIODS.1 / PERIODS.0).powf(part)
        };
        let (widths, frequencies) = match equation {
            Equation::Initial => (1, 1),
            Equation::Basic => (WIDTH.len(), 1),
            Equation::Advanced => (WIDTH.len(), FREQUENCIES),
        };
        let mut grid: Vec<(f64, Self)> = Vec::new();
        for steepness in STEEPNESS {
            for width in &WIDTH[..widths] {
                for n in 0..frequencies {
                    let shapes = [(steepness / fastest).ln(), *width, frequency(n)];
                    let model = Self::with_shapes(equation, &shapes[..equation.shapes()], samples);
                    grid.push((Problem { equation, samples }.cost(&model.x), model));
                }
            }
        }
        grid.sort_by(|one, other| one.0.total_cmp(&other.0));
        let options = Options {
            max_iterations: STEPS,
            gradient_tolerance: 0.0,
            cost_tolerance: TOLERANCE,
            mu_initial: 1e-3,
            mu_max: 1e10,
            damping: Damping::Diagonal,
            bounds: vec![],
        };
        let descents = grid.iter().take(STARTS).map(|(_, start)| {
            minimise(&Problem { equation, samples }, &start.x, &options, |_, _, _| ControlFlow::Continue(()))
        });
        let best = descents.min_by(|one, other| one.at.cost.total_cmp(&other.at.cost))?;
        Some(Self { equation, x: best.x })
    }

    /// The model of these shapes with the best coefficients.
    fn with_shapes(equation: Equation, shapes: &[f64], samples: &[Sample]) -> Self {
        let n = equation.coefficients();
        let mut x = DVector::zeros(equation.parameters());
        x.rows_mut(n, shapes.len()).copy_from_slice(shapes);
        let model = Self { equation, x };
        let (mut normal, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for sample in samples {
            let columns = DVector::from_column_slice(&model.row(sample).columns[..n]);
            normal.syger(1.0, &columns, &columns, 1.0);
            right.axpy(sample.friction, &columns, 1.0);
        }
        normal.fill_upper_triangle_with_lower_triangle();
        // Harmonics of a low frequency and the position slope are nearly one shape: the least solution of all.
        let solved = normal.svd(true, true).solve(&right, 1e-9).unwrap_or(right);
        let mut x = model.x;
        x.rows_mut(0, n).copy_from(&solved);
        Self { equation, x }
    }

    fn shape(&self, number: usize) -> f64 {
        if number < self.equation.shapes() { self.x[self.equation.coefficients() + number] } else { 0.0 }
    }

    fn row(&self, sample: &Sample) -> Row {
        let Sample { position: q, velocity: v, acceleration: a, .. } = *sample;
        let (s, z, h) = (self.shape(0).exp(), self.shape(1), self.shape(2));
        let w = s * v + z * sign(a);
        let by_w = self.x[1] / (1.0 + w * w);
        let mut row = Row { columns: [0.0; MOST], by_shape: [by_w * s * v, by_w * sign(a), 0.0] };
        (row.columns[0], row.columns[1]) = (v, w.atan());
        if self.equation == Equation::Advanced {
            row.columns[2] = q;
            for (j, odd) in (0..HARMONICS).map(|j| (j, (2 * j + 1) as f64)) {
                let (sine, cosine) = (odd * h * q).sin_cos();
                for (direction, at) in [(1.0, 3 + j), (-1.0, 3 + HARMONICS + j)] {
                    let on = 0.5 * (1.0 + direction * sign(v));
                    row.columns[at] = on * 4.0 * sine / (PI * odd);
                    row.by_shape[2] += self.x[at] * on * 4.0 * q * cosine / PI;
                }
            }
        }
        row
    }

    /// Friction in the state of a sample, Nm.
    #[must_use]
    pub fn friction(&self, sample: &Sample) -> f64 {
        let n = self.equation.coefficients();
        self.row(sample).columns[..n].iter().zip(self.x.iter()).map(|(column, b)| column * b).sum()
    }
}

/// Mean squared error of an equation over samples.
struct Problem<'a> {
    equation: Equation,
    samples: &'a [Sample],
}

impl LeastSquares for Problem<'_> {
    fn cost(&self, x: &DVector<f64>) -> f64 {
        let model = Model { equation: self.equation, x: x.clone() };
        let squares = self.samples.iter().map(|sample| (model.friction(sample) - sample.friction).powi(2));
        squares.sum::<f64>() / self.samples.len() as f64
    }

    fn normal_equations(&self, x: &DVector<f64>) -> NormalEquations {
        let model = Model { equation: self.equation, x: x.clone() };
        let (n, all) = (self.equation.coefficients(), self.equation.parameters());
        let (mut cost, mut gradient, mut hessian) = (0.0, DVector::zeros(all), DMatrix::zeros(all, all));
        for sample in self.samples {
            let row = model.row(sample);
            let by = row.columns[..n].iter().chain(&row.by_shape[..all - n]).copied();
            let by = DVector::from_iterator(all, by);
            let residual = by.rows(0, n).dot(&x.rows(0, n)) - sample.friction;
            cost += residual * residual;
            gradient.axpy(residual, &by, 1.0);
            hessian.syger(1.0, &by, &by, 1.0);
        }
        hessian.fill_upper_triangle_with_lower_triangle();
        let mean = 1.0 / self.samples.len() as f64;
        NormalEquations { cost: cost * mean, gradient: gradient * mean, hessian: hessian * mean }
    }
}

/// Models of a joint that shares its drive: modA while it leads, modB while the other one does.
#[derive(Clone, Debug, PartialEq)]
pub struct Regimes {
    leading: Model,
    following: Model,
}

impl Regimes {
    /// Fits both; `leads` says of each sample whether the joint leads. None where one regime has no sample that moves.
    #[must_use]
    pub fn fit(equation: Equation, samples: &[Sample], leads: &[bool]) -> Option<Self> {
        let of = |regime: bool| -> Vec<Sample> {
            samples.iter().zip(leads).filter(|(_, leads)| **leads == regime).map(|(sample, _)| *sample).collect()
        };
        Some(Self { leading: Model::fit(equation, &of(true))?, following: Model::fit(equation, &of(false))? })
    }

    /// Friction in the state of a sample, Nm.
    #[must_use]
    pub fn friction(&self, sample: &Sample, leads: bool) -> f64 {
        if leads { self.leading.friction(sample) } else { self.following.friction(sample) }
    }
}

/// The paper's transition between modA and modB: true where the joint leads. The paper does not say what is there
/// before either joint was the faster one; it is modA here. Each run begins anew.
#[must_use]
pub fn leads(own: &[f64], other: &[f64], runs: &[u32], band: f64) -> Vec<bool> {
    let mut all: Vec<bool> = Vec::with_capacity(own.len());
    for (i, (own, other)) in own.iter().zip(other).enumerate() {
        let before = i == 0 || runs[i] != runs[i - 1] || all[i - 1];
        let (own, other) = (own.abs(), other.abs());
        all.push(own >= other + band || (other < own + band && before));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion() -> Vec<Sample> {
        let sample = |i: usize| {
            let t = 0.01 * i as f64;
            Sample {
                position: 0.9 * (0.7 * t).sin() + 0.3 * (2.1 * t).sin(),
                velocity: 0.63 * (0.7 * t).cos() + 0.63 * (2.1 * t).cos(),
                acceleration: -0.441 * (0.7 * t).sin() - 1.323 * (2.1 * t).sin(),
                friction: 0.0,
            }
        };
        (0..4_000).map(sample).collect()
    }

    fn truth(equation: Equation) -> Model {
        let all = [0.8, 1.5, -0.3, 0.2, -0.1, 0.1, 0.05, -0.05, 0.1, 0.15, -0.1, 0.02, 0.05];
        let shapes = [12.0f64.ln(), 0.7, 4.3];
        let x = all[..equation.coefficients()].iter().chain(&shapes[..equation.shapes()]).copied();
        Model { equation, x: DVector::from_iterator(equation.parameters(), x) }
    }

    fn of(model: &Model) -> Vec<Sample> {
        motion().into_iter().map(|sample| Sample { friction: model.friction(&sample), ..sample }).collect()
    }

    #[test]
    fn each_equation_is_the_papers() {
        let sample = Sample { position: 0.4, velocity: -0.6, acceleration: 2.0, friction: 0.0 };
        let by_hand = |number: u32| {
            let width = if number == 3 { 0.0 } else { 0.7 };
            let base = 0.8 * -0.6 + 1.5 * f64::atan(12.0 * -0.6 + width);
            let backward = [0.1, 0.15, -0.1, 0.02, 0.05].iter().zip([1.0, 3.0, 5.0, 7.0, 9.0]);
            let wave = backward.map(|(b, odd)| b * 4.0 * (odd * 4.3 * 0.4f64).sin() / (odd * PI)).sum::<f64>();
            if number == 5 { base - 0.3 * 0.4 + wave } else { base }
        };
        for equation in Equation::ALL {
            let found = truth(equation).friction(&sample);
            assert!((found - by_hand(equation.number())).abs() < 1e-12, "({}): {found}", equation.number());
        }
    }

    #[test]
    fn the_gradient_is_that_of_a_central_difference() {
        for equation in Equation::ALL {
            let samples = of(&truth(equation));
            let problem = Problem { equation, samples: &samples };
            let x = truth(equation).x * 1.1;
            let gradient = problem.normal_equations(&x).gradient;
            for i in 0..x.len() {
                let moved = |by: f64| {
                    let mut other = x.clone();
                    other[i] += by;
                    problem.cost(&other)
                };
                let difference = (moved(1e-5) - moved(-1e-5)) / 4e-5;
                assert!((difference - gradient[i]).abs() < 1e-6, "({}), {i}: {difference}", equation.number());
            }
        }
    }

    #[test]
    fn a_model_is_found_again_and_each_equation_has_what_the_one_before_lacks() {
        let error = |equation: Equation, samples: &[Sample]| {
            let model = Model::fit(equation, samples).unwrap();
            Problem { equation, samples }.cost(&model.x).sqrt()
        };
        for (n, equation) in Equation::ALL.into_iter().enumerate() {
            let samples = of(&truth(equation));
            assert!(error(equation, &samples) < 1e-4, "({}): {}", equation.number(), error(equation, &samples));
            for lesser in &Equation::ALL[..n] {
                assert!(error(*lesser, &samples) > 1e-2, "({}) for ({})", lesser.number(), equation.number());
            }
        }
        assert!(Model::fit(Equation::Basic, &motion()[..1]).is_none());
    }

    #[test]
    fn a_joint_leads_from_the_band_on_and_keeps_its_model_between() {
        let own = [1.0, 1.0, -1.0, 1.0, 1.25, 1.0, 1.0];
        let other = [1.0, -1.24, 1.25, 1.0, 1.0, 1.25, 1.0];
        let found = leads(&own, &other, &[0, 0, 0, 0, 0, 0, 1], 0.25);
        assert_eq!(found, [true, true, false, false, true, false, true]);
    }

    #[test]
    fn each_regime_is_fitted_to_its_own_samples() {
        let (whole, mut reduced) = (truth(Equation::Basic), truth(Equation::Basic));
        reduced.x[1] *= 0.5;
        let leads: Vec<bool> = (0..4_000).map(|i| i / 250 % 2 == 0).collect();
        let with = |(sample, leads): (Sample, &bool)| {
            let friction = if *leads { &whole } else { &reduced }.friction(&sample);
            Sample { friction, ..sample }
        };
        let samples: Vec<Sample> = motion().into_iter().zip(&leads).map(with).collect();
        let found = Regimes::fit(Equation::Basic, &samples, &leads).unwrap();
        let worst = samples.iter().zip(&leads).map(|(sample, leads)| found.friction(sample, *leads) - sample.friction);
        assert!(worst.fold(0.0, |worst: f64, error| worst.max(error.abs())) < 1e-3);
    }
}
