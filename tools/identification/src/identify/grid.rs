//! Starting points of the descents: a coarse grid over the shapes, with the linear parameters solved at every point;
//! host.
//!
//! The mean square has many minima only over the shapes (slopes, hysteresis, harmonic frequency), a handful of numbers.
//! They are gone through group by group, the other groups held at the best point so far.

use super::linear::bounded_step;
use super::nonlinear::{Candidate, Effort, Fit, Problem, Residuals};
use super::observations::{Row, decimated};
use crate::friction_model::{FrictionModel, Term};
use crate::friction_parameter::{FrictionParameter as P, Role};
use crate::levenberg_marquardt::LeastSquares;
use crate::presets::Structure;
use crate::rigid::RigidParameters;
use nalgebra::DVector;
use rayon::prelude::*;

/// Rows at which grids over slopes and hysteresis are evaluated.
const ROWS: usize = 3_000;
/// Rows at which the grid over the harmonic frequency is evaluated: it has hundreds of points.
const FREQUENCY_ROWS: usize = 1_500;
/// Points of a grid over one slope, and over each of two or three.
const SLOPES: [usize; 3] = [24, 9, 6];
/// Velocity weakening of a grid over its slope.
const WEAKENING: f64 = 0.5;
/// Widths z of the hysteresis that the grid tries.
const WIDTHS: [f64; 4] = [-0.7, 0.3, 1.0, 3.0];
/// Limit on the points of the grid over the harmonic frequency.
const FREQUENCIES: usize = 1_000;
/// Grid points from which a search descends.
const STARTS: usize = 3;
/// Length of a search's descent.
const SEARCH: Effort = Effort { iterations: 60, tolerance: 1e-7 };
/// Length of the descent of a search that starts near the minimum.
const NEARBY: Effort = Effort { iterations: 30, tolerance: 1e-6 };

/// The values of one shape that a grid tries.
struct Axis {
    column: usize,
    values: Vec<f64>,
}

/// A point of the grid.
struct Point {
    /// Position in the grid along each axis.
    at: Vec<usize>,
    cost: f64,
    x: DVector<f64>,
}

/// Fits a structure from nothing over the search rows.
pub fn search(problem: &Problem, structure: &Structure) -> Fit {
    let candidate = Candidate::new(problem, structure);
    let fits: Vec<Fit> = starts(problem, &candidate)
        .into_par_iter()
        .map(|x| candidate.descend(problem, &problem.search, &x, SEARCH))
        .collect();
    let best = fits.into_iter().reduce(|best, fit| if fit.at.cost < best.at.cost { fit } else { best });
    best.unwrap_or_else(|| {
        let x = candidate.layout.encode(&problem.theoretical, &problem.template);
        candidate.descend(problem, &problem.search, &x, SEARCH)
    })
}

/// Fits a structure over the search rows from the parameters of another fit; the shapes of a term that is new to it are
/// searched on the grid.
pub fn search_from(problem: &Problem, structure: &Structure, start: &Fit, new: Option<Term>) -> Fit {
    let candidate = Candidate::new(problem, structure);
    let x = encoded(&candidate, &start.rigid, &start.friction);
    let (_, hysteresis, frequency) = axes(problem, &candidate);
    let (axes, rows) = match new {
        Some(Term::Stribeck) => (slope_axes(&candidate, &[P::StribeckSlope]), ROWS),
        Some(Term::VelocityWeakening) => (slope_axes(&candidate, &[P::WeakeningSlope]), ROWS),
        Some(Term::Hysteresis) => (hysteresis, ROWS),
        Some(Term::Harmonics) => (frequency, FREQUENCY_ROWS),
        _ => (vec![], 0),
    };
    if axes.is_empty() {
        return candidate.descend(problem, &problem.search, &x, NEARBY);
    }
    let points = apart(evaluate(&candidate, &decimated(&problem.search, rows), &x, &axes));
    let fits: Vec<Fit> =
        points.into_par_iter().map(|x| candidate.descend(problem, &problem.search, &x, NEARBY)).collect();
    let best = fits.into_iter().reduce(|best, fit| if fit.at.cost < best.at.cost { fit } else { best });
    best.unwrap_or_else(|| candidate.descend(problem, &problem.search, &x, NEARBY))
}

/// The vector of a model, with some weakening where it has none: factors are held on the grid, and without any its
/// slope would not be seen.
fn encoded(candidate: &Candidate, rigid: &RigidParameters, friction: &FrictionModel) -> DVector<f64> {
    let mut x = candidate.layout.encode(rigid, friction);
    let columns = [P::WeakeningPositive, P::WeakeningNegative].map(|side| candidate.layout.column_of(side));
    for column in columns.into_iter().flatten() {
        x[column] = if x[column] == 0.0 { WEAKENING } else { x[column] };
    }
    x
}

/// The best points of the grid, far enough apart to lead to different minima.
fn starts(problem: &Problem, candidate: &Candidate) -> Vec<DVector<f64>> {
    let rows = decimated(&problem.search, ROWS);
    let few = decimated(&problem.search, FREQUENCY_ROWS);
    let (slopes, hysteresis, frequency) = axes(problem, candidate);
    let mut x = encoded(candidate, &problem.theoretical, &problem.template);
    let mut points = evaluate(candidate, &rows, &x, &slopes);
    let mut refined = false;
    for (axes, rows) in [(&hysteresis, &rows), (&frequency, &few)] {
        if !axes.is_empty() {
            x = best(points, &x);
            points = evaluate(candidate, rows, &x, axes);
            refined = true;
        }
    }
    if refined && !slopes.is_empty() {
        x = best(points, &x);
        points = evaluate(candidate, &rows, &x, &slopes);
    }
    apart(points)
}

/// The axes over slopes, over the hysteresis and over the harmonic frequency.
fn axes(problem: &Problem, candidate: &Candidate) -> (Vec<Axis>, Vec<Axis>, Vec<Axis>) {
    let bounds = candidate.layout.bounds();
    let even = |column: usize, points: usize| even(bounds[column], column, points);
    let column_of = |parameter| candidate.layout.column_of(parameter);
    let slopes = slope_axes(candidate, &[P::CoulombSlope, P::StribeckSlope, P::WeakeningSlope]);
    let mut hysteresis: Vec<Axis> =
        column_of(P::HysteresisVelocitySlope).map(|column| even(column, 9)).into_iter().collect();
    hysteresis.extend(column_of(P::HysteresisWidth).map(|column| Axis { column, values: WIDTHS.to_vec() }));
    let frequency = column_of(P::HarmonicFrequency).map(|column| {
        // The ninth multiple of the frequency must not slip by more than about a quarter period between two points.
        let step = 1.0 / (6.0 * problem.limits.position.max(f64::MIN_POSITIVE));
        let points = ((bounds[column].1 - bounds[column].0) / step).ceil() as usize;
        even(column, points.clamp(1, FREQUENCIES))
    });
    (slopes, hysteresis, frequency.into_iter().collect())
}

/// The axes over those of the slopes that have a column.
fn slope_axes(candidate: &Candidate, slopes: &[P]) -> Vec<Axis> {
    let bounds = candidate.layout.bounds();
    let mut columns: Vec<usize> = slopes.iter().filter_map(|&slope| candidate.layout.column_of(slope)).collect();
    columns.dedup();
    columns.iter().map(|&column| even(bounds[column], column, SLOPES[columns.len() - 1])).collect()
}

/// Points in the middle of equal intervals.
fn even((low, high): (f64, f64), column: usize, points: usize) -> Axis {
    Axis { column, values: (0..points).map(|i| low + (high - low) * (i as f64 + 0.5) / points as f64).collect() }
}

/// The points of the grid spanned by the axes around `x`, each with its linear parameters solved; without axes, `x`
/// alone.
fn evaluate(candidate: &Candidate, rows: &[Row], x: &DVector<f64>, axes: &[Axis]) -> Vec<Point> {
    let count: usize = axes.iter().map(|axis| axis.values.len()).product();
    let point = |mut number: usize| {
        let mut x = x.clone();
        let mut at = Vec::with_capacity(axes.len());
        for axis in axes {
            at.push(number % axis.values.len());
            number /= axis.values.len();
            x[axis.column] = axis.values[at[at.len() - 1]];
        }
        let (cost, x) = solve_linear(candidate, rows, x);
        Point { at, cost, x }
    };
    (0..count).into_par_iter().map(point).collect()
}

/// Solves the coefficients within their bounds; factors and shapes stay as they are.
fn solve_linear(candidate: &Candidate, rows: &[Row], mut x: DVector<f64>) -> (f64, DVector<f64>) {
    let columns = &candidate.layout.columns;
    for (value, column) in x.iter_mut().zip(columns) {
        if column.role == Role::Coefficient {
            *value = 0.0;
        }
    }
    let free: Vec<usize> = (0..columns.len()).filter(|&i| columns[i].role == Role::Coefficient).collect();
    let at = Residuals { rows, candidate }.normal_equations(&x);
    let (step, cost) = bounded_step(&at, &free, free.iter().map(|&i| columns[i].bounds).collect());
    free.iter().zip(&step).for_each(|(&i, value)| x[i] = *value);
    (cost, x)
}

fn best(points: Vec<Point>, otherwise: &DVector<f64>) -> DVector<f64> {
    apart(points).into_iter().next().unwrap_or_else(|| otherwise.clone())
}

/// The best points, best first, without the neighbours of better ones.
fn apart(mut points: Vec<Point>) -> Vec<DVector<f64>> {
    points.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut chosen: Vec<Point> = Vec::new();
    for point in points {
        let near = |other: &Point| other.at.iter().zip(&point.at).all(|(a, b)| a.abs_diff(*b) <= 1);
        if chosen.len() < STARTS && !chosen.iter().any(near) {
            chosen.push(point);
        }
    }
    chosen.into_iter().map(|point| point.x).collect()
}
