//! Shapes that are chosen once, before the terms that have them are judged: distances of pre-sliding elements,
//! frequencies of ripples; host.
//!
//! Beside the rigid part and what friction has over velocity and load, all linear, every distance of a geometric row is
//! offered as an element, and those are taken one after the other that lower the mean square most. The residual then
//! shows the frequencies: every one of a grid is offered with sine and cosine, of the Coulomb friction and whatever the
//! direction, and the best is refined. Whether the terms pay is for the folds to say.

use super::linear::{add_to_normal_sums, bounded_step, dependences, normal_equations, normal_sums, sum_over_rows};
use super::nonlinear::Problem;
use super::observations::{self, Row};
use crate::friction_model::RIPPLES;
use crate::levenberg_marquardt::NormalEquations;
use crate::pre_sliding;
use crate::rigid::RigidRegressor;
use crate::samples::Samples;
use friction_compensation::friction::maxwell_slip::{ELEMENTS, MAX_STIFFNESS};
use nalgebra::{Matrix4, Vector4};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Distances that are offered: the position range divided by 2, and each the one before divided by the root of two.
const DISTANCES: usize = 26;
/// An element is taken as long as it lowers the mean square by this fraction.
const ELEMENT_WORTH: f64 = 0.005;
/// A ripple is offered where it lowers the mean square by this fraction.
const RIPPLE_WORTH: f64 = 0.01;
/// Rows that the search for frequencies uses.
const FREQUENCY_ROWS: usize = 3_000;
/// Limit on the frequencies of the grid.
const FREQUENCIES: usize = 2_000;
/// Points of the grid in a period over the position range.
const DENSITY: f64 = 8.0;
/// Fewest periods of a ripple over the position range.
const PERIODS: f64 = 2.0;

/// Fewest periods of a ripple over the position range with which it has a part that does not know the direction. A
/// slower one is also what gravity leaves, or the motion of other joints; friction changes its sign with the direction,
/// so its ripple is told apart at any frequency.
const TORQUE_PERIODS: f64 = 8.0;

/// Columns of the regression that the elements are offered beside: the rigid part's and those of [`friction_columns`].
const BASE: usize = RIGID + 12;
/// Columns of the rigid part.
const RIGID: usize = RigidRegressor::ALL.len();

/// Chooses distances and frequencies from the rows for training and validation; fills in how far the elements are bent
/// at all samples and rows.
pub fn choose(problem: &mut Problem, samples: &mut Samples) {
    let base: Vec<[f64; BASE]> = problem.train.iter().map(|row| columns(problem, row)).collect();
    let distances = elements(problem, samples, &base);
    for (stiffness, distance) in problem.template.element_stiffness.iter_mut().zip(&distances) {
        *stiffness = 1.0 / distance;
    }
    problem.limits.elements = distances.len();
    samples.bent = pre_sliding::bent(samples, &problem.template.element_stiffness[..distances.len()]);
    let used = observations::used(samples);
    problem.train.iter_mut().zip(used).for_each(|(row, i)| row.joint.bent = samples.bent[i]);
    let step = problem.train.len().div_ceil(problem.search.len().max(1)).max(1);
    problem.search.iter_mut().zip(problem.train.iter().step_by(step)).for_each(|(row, from)| *row = *from);

    let frequencies = frequencies(problem, samples, &base);
    for (ripple, frequency) in problem.template.ripples.iter_mut().zip(&frequencies) {
        ripple.frequency = *frequency;
    }
    let range = problem.limits.position_range;
    for (torque, frequency) in problem.limits.ripple_torques.iter_mut().zip(&frequencies) {
        *torque = has_torque(*frequency, range);
    }
    problem.limits.ripples = frequencies.len();
}

/// The linear columns of one row.
fn columns(problem: &Problem, row: &Row) -> [f64; BASE] {
    let (v, load) = (row.joint.velocity, row.joint.load.abs());
    let direction = (v * problem.template.coulomb_slope).tanh();
    let (forward, backward) = if v < 0.0 { (0.0, direction) } else { (direction, 0.0) };
    let fastest = problem.limits.velocity.max(f64::MIN_POSITIVE);
    let weakening = |part: f64| direction * (1.0 - (v / (part * fastest)).tanh().powi(2));
    let mut columns = [0.0; BASE];
    for regressor in problem.rigid.regressors() {
        columns[regressor.index()] = row.regressors[regressor.index()];
    }
    let friction = [
        1.0,
        v,
        v.abs(),
        v * v.abs(),
        forward,
        backward,
        load * direction,
        row.joint.acceleration,
        weakening(0.02),
        weakening(0.1),
        weakening(0.4),
        if row.joint.following { direction } else { 0.0 },
    ];
    columns[RIGID..].copy_from_slice(&friction);
    columns
}

/// The distances of up to [`ELEMENTS`] elements, the longest first.
fn elements(problem: &Problem, samples: &Samples, base: &[[f64; BASE]]) -> Vec<f64> {
    let shortest = 65_536.0 / f64::from(MAX_STIFFNESS);
    let offered: Vec<f64> = (1..=DISTANCES)
        .map(|n| problem.limits.position_range * 0.5f64.powf(0.5 * (n as f64 + 1.0)))
        .filter(|distance| *distance >= shortest)
        .collect();
    let n = BASE + offered.len();
    let bent: Vec<Vec<f64>> = offered.par_iter().map(|distance| bent_at_used(samples, 1.0 / distance)).collect();
    let rows: Vec<usize> = (0..base.len()).collect();
    let sums = sum_over_rows(&rows, normal_sums(n), |sums, &i| {
        let mut row = [0.0; BASE + DISTANCES];
        row[..BASE].copy_from_slice(&base[i]);
        row[BASE..].iter_mut().zip(&bent).for_each(|(place, bent)| *place = bent[i]);
        add_to_normal_sums(sums, &row[..n], -problem.train[i].effort);
    });
    let at = normal_equations(&sums, n, rows.len());
    let mut taken: Vec<usize> = vec![];
    let mut cost = regression(&at, &[]).1;
    while taken.len() < ELEMENTS {
        let with = |element: usize| [&taken[..], &[element]].concat();
        let rest = (BASE..n).filter(|element| !taken.contains(element));
        let found = rest.map(|element| (element, regression(&at, &with(element)).1));
        let Some((element, lowest)) = found.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        if lowest > (1.0 - ELEMENT_WORTH) * cost {
            break;
        }
        taken.push(element);
        cost = lowest;
    }
    taken.sort_unstable();
    taken.into_iter().map(|element| offered[element - BASE]).collect()
}

/// Deflection of one element at the samples that identification uses.
fn bent_at_used(samples: &Samples, stiffness: f64) -> Vec<f64> {
    let bent = pre_sliding::bent(samples, &[stiffness]);
    observations::used(samples).into_iter().map(|i| bent[i][0]).collect()
}

/// Solves the linear columns with these elements, which have positive levels: columns, coefficients, and the mean
/// square.
fn regression(at: &NormalEquations, elements: &[usize]) -> (Vec<(usize, f64)>, f64) {
    let base: Vec<usize> = (0..BASE).collect();
    let dependent = dependences(&at.hessian, &base);
    let mut free: Vec<usize> = base.into_iter().filter(|i| dependent.iter().all(|d| d.column != *i)).collect();
    free.extend(elements);
    let bounds = free.iter().map(|i| (if *i < BASE { f64::NEG_INFINITY } else { 0.0 }, f64::INFINITY)).collect();
    let (step, cost) = bounded_step(at, &free, bounds);
    (free.into_iter().zip(step.iter().copied()).collect(), cost)
}

/// True for a ripple that may have a part whatever the direction.
fn has_torque(frequency: f64, range: f64) -> bool {
    frequency * range >= TORQUE_PERIODS * TAU
}

/// One row of the search for frequencies.
struct Residual {
    position: f64,
    direction: f64,
    left: f64,
}

impl Residual {
    /// Sine and cosine of the Coulomb friction and, with `torque`, whatever the direction.
    fn columns(&self, frequency: f64, torque: bool) -> Vector4<f64> {
        let (sine, cosine) = (frequency * self.position).sin_cos();
        let part = if torque { 1.0 } else { 0.0 };
        Vector4::new(self.direction * sine, self.direction * cosine, part * sine, part * cosine)
    }
}

/// The best amplitudes of a ripple, and what they take off the sum of squares.
fn ripple(rows: &[Residual], frequency: f64, torque: bool) -> (Vector4<f64>, f64) {
    let (mut hessian, mut gradient) = (Matrix4::zeros(), Vector4::zeros());
    for row in rows {
        let columns = row.columns(frequency, torque);
        hessian += columns * columns.transpose();
        gradient += row.left * columns;
    }
    // A hundredth of a thousandth of its own square keeps a column that is not excited at nothing.
    let damping = 1e-5 * hessian.trace();
    let Some(amplitudes) = (hessian + Matrix4::identity() * damping).cholesky().map(|c| c.solve(&gradient)) else {
        return (Vector4::zeros(), 0.0);
    };
    (amplitudes, 2.0 * amplitudes.dot(&gradient) - amplitudes.dot(&(hessian * amplitudes)))
}

/// The frequencies of up to [`RIPPLES`] ripples, rad per unit of position.
fn frequencies(problem: &Problem, samples: &Samples, base: &[[f64; BASE]]) -> Vec<f64> {
    let range = problem.limits.position_range;
    let mut speeds: Vec<f64> = problem.train.iter().map(|row| row.joint.velocity.abs()).collect();
    speeds.sort_by(f64::total_cmp);
    let way = speeds[speeds.len() / 2] * samples.period();
    let unit = TAU / range.max(f64::MIN_POSITIVE);
    let step = unit / DENSITY;
    // A sample must not pass more than a quarter of a period at the middle speed.
    let highest = (TAU / 4.0 / way.max(f64::MIN_POSITIVE)).min(PERIODS * unit + FREQUENCIES as f64 * step);
    let lowest = PERIODS * unit;
    if !problem.limits.position_covered || lowest >= highest {
        return vec![];
    }
    let mut rows = residuals(problem, base);
    let mut found: Vec<f64> = vec![];
    let total: f64 = rows.iter().map(|row| row.left * row.left).sum();
    for _ in 0..RIPPLES {
        let grid: Vec<f64> = (0..).map(|n| lowest + f64::from(n) * step).take_while(|h| *h <= highest).collect();
        let apart = |h: &&f64| found.iter().all(|other| (**h - other).abs() > unit);
        let gain = |frequency: &f64| (*frequency, ripple(&rows, *frequency, has_torque(*frequency, range)).1);
        let offered: Vec<f64> = grid.iter().filter(apart).copied().collect();
        let best = offered.par_iter().map(gain).reduce(|| (0.0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
        let fine = (-10..=10).map(|n| gain(&(best.0 + f64::from(n) * step / 10.0)));
        let (frequency, taken) = fine.fold(best, |a, b| if b.1 > a.1 { b } else { a });
        if taken < RIPPLE_WORTH * total {
            break;
        }
        let torque = has_torque(frequency, range);
        let (amplitudes, _) = ripple(&rows, frequency, torque);
        rows.iter_mut().for_each(|row| row.left -= amplitudes.dot(&row.columns(frequency, torque)));
        found.push(frequency);
    }
    found
}

/// Residuals of the effort after the linear columns and the chosen elements, over rows as they are searched.
fn residuals(problem: &Problem, base: &[[f64; BASE]]) -> Vec<Residual> {
    let n = BASE + problem.limits.elements;
    let rows: Vec<usize> = (0..base.len()).step_by(base.len().div_ceil(FREQUENCY_ROWS).max(1)).collect();
    let all = |i: usize| {
        let mut row = [0.0; BASE + ELEMENTS];
        row[..BASE].copy_from_slice(&base[i]);
        row[BASE..].copy_from_slice(&problem.train[i].joint.bent);
        row
    };
    let sums = sum_over_rows(&rows, normal_sums(n), |sums, &i| {
        add_to_normal_sums(sums, &all(i)[..n], -problem.train[i].effort)
    });
    let at = normal_equations(&sums, n, rows.len());
    let (solved, _) = regression(&at, &(BASE..n).collect::<Vec<_>>());
    let residual = |i: usize| {
        let (row, joint) = (all(i), &problem.train[i].joint);
        let explained: f64 = solved.iter().map(|(column, value)| value * row[*column]).sum();
        Residual {
            position: joint.position,
            direction: (joint.velocity * problem.template.coulomb_slope).tanh(),
            left: problem.train[i].effort - explained,
        }
    };
    rows.into_iter().map(residual).collect()
}

#[cfg(test)]
#[path = "shapes_tests.rs"]
mod tests;
