//! Levenberg-Marquardt for small dense problems, with optional bounds; host.
//!
//! Both the physical friction's shape parameters and the network's weights are found here. The damping schedule is that
//! of the legged-robot paper's trainer (table 3.1: gradient threshold 1e-7, mu limit 1e10; mu starts at 1e-3 and moves
//! by factors of ten). The crate `levenberg-marquardt` has no bounds, no mu limit, no hook for early stopping, and
//! keeps the whole Jacobian; we accumulate the normal equations, so memory does not grow with the number of samples.

use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

/// Value, gradient and Gauss-Newton matrix of a mean of squares at one point.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    /// Weighted mean of squared residuals.
    pub cost: f64,
    /// J^T r, divided by the same number as the cost.
    pub gradient: DVector<f64>,
    /// J^T J, divided by the same number as the cost.
    pub hessian: DMatrix<f64>,
}

/// A mean of squared residuals as a function of a parameter vector.
pub trait LeastSquares {
    /// Mean of squared residuals at `x`.
    fn cost(&self, x: &DVector<f64>) -> f64;
    /// Cost, gradient and Gauss-Newton matrix at `x`.
    fn normal_equations(&self, x: &DVector<f64>) -> NormalEquations;
}

/// Factor of mu before it is added to J^T J.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damping {
    /// The unit matrix (Levenberg; for networks, whose weights are of like scale).
    Identity,
    /// The diagonal of J^T J (Marquardt; for physical parameters of unlike units).
    Diagonal,
}

/// Options for the end of the iteration and its damping.
#[derive(Clone, Debug)]
pub struct Options {
    /// Limit on accepted steps.
    pub max_iterations: usize,
    /// Stop when the largest component of the cost's (projected) gradient is below this.
    pub gradient_tolerance: f64,
    /// Stop when an accepted step lowers the cost by less than this fraction (0 = never).
    pub cost_tolerance: f64,
    /// First value of mu.
    pub mu_initial: f64,
    /// Stop when mu exceeds this.
    pub mu_max: f64,
    /// Form of the damping.
    pub damping: Damping,
    /// Lower and upper bound of each parameter; empty = unbounded.
    pub bounds: Vec<(f64, f64)>,
}

/// Reason for the end of the iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The gradient fell below the tolerance.
    Gradient,
    /// The cost no longer falls.
    Cost,
    /// No step lowers the cost: mu passed its limit.
    Mu,
    /// The iteration limit was reached.
    Iterations,
    /// The caller asked to stop (validation error rising).
    Caller,
}

/// Result at the end of the iteration.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Parameters.
    pub x: DVector<f64>,
    /// The normal equations at `x`, from which standard errors follow.
    pub at: NormalEquations,
    /// Accepted steps.
    pub iterations: usize,
    /// Reason for its end.
    pub stop: Stop,
}

const MU_FACTOR: f64 = 10.0;
const MU_MIN: f64 = 1e-20;

/// Minimises `problem` from `start`. `observe` sees every accepted iterate (number, parameters, cost) and may stop.
///
/// Parameters at a bound whose gradient points outwards are held there for the step; trial points are projected on the
/// bounds, so every accepted iterate is feasible and the cost never rises.
pub fn minimise(
    problem: &impl LeastSquares,
    start: &DVector<f64>,
    options: &Options,
    mut observe: impl FnMut(usize, &DVector<f64>, f64) -> ControlFlow<()>,
) -> Solution {
    let mut x = start.clone();
    project(&mut x, &options.bounds);
    let mut at = problem.normal_equations(&x);
    let mut mu = options.mu_initial;
    let mut iterations = 0;
    let stop = loop {
        let held = held_at_bounds(&x, &at.gradient, &options.bounds);
        let steepest = (0..x.len()).filter(|&i| !held[i]).fold(0.0, |m: f64, i| m.max(2.0 * at.gradient[i].abs()));
        if steepest < options.gradient_tolerance {
            break Stop::Gradient;
        }
        if iterations >= options.max_iterations {
            break Stop::Iterations;
        }
        let Some((trial, cost)) = descend(problem, &x, &at, &held, &mut mu, options) else {
            break Stop::Mu;
        };
        let fall = (at.cost - cost) / at.cost.max(f64::MIN_POSITIVE);
        x = trial;
        at = problem.normal_equations(&x);
        iterations += 1;
        if observe(iterations, &x, at.cost).is_break() {
            break Stop::Caller;
        }
        if fall < options.cost_tolerance {
            break Stop::Cost;
        }
    };
    Solution { x, at, iterations, stop }
}

/// The first damped step that lowers the cost, or nothing once mu passes its limit.
fn descend(
    problem: &impl LeastSquares,
    x: &DVector<f64>,
    at: &NormalEquations,
    held: &[bool],
    mu: &mut f64,
    options: &Options,
) -> Option<(DVector<f64>, f64)> {
    while *mu <= options.mu_max {
        let mut matrix = at.hessian.clone();
        let mut right = -&at.gradient;
        for i in 0..x.len() {
            let scale = match options.damping {
                Damping::Identity => 1.0,
                Damping::Diagonal => at.hessian[(i, i)].max(1e-30),
            };
            matrix[(i, i)] += *mu * scale;
            if held[i] {
                matrix.row_mut(i).fill(0.0);
                matrix.column_mut(i).fill(0.0);
                matrix[(i, i)] = 1.0;
                right[i] = 0.0;
            }
        }
        if let Some(factor) = matrix.cholesky() {
            let mut trial = x + factor.solve(&right);
            project(&mut trial, &options.bounds);
            let cost = problem.cost(&trial);
            if cost < at.cost {
                *mu = (*mu / MU_FACTOR).max(MU_MIN);
                return Some((trial, cost));
            }
        }
        *mu *= MU_FACTOR;
    }
    None
}

fn project(x: &mut DVector<f64>, bounds: &[(f64, f64)]) {
    for (value, &(low, high)) in x.iter_mut().zip(bounds) {
        *value = value.clamp(low, high);
    }
}

fn held_at_bounds(x: &DVector<f64>, gradient: &DVector<f64>, bounds: &[(f64, f64)]) -> Vec<bool> {
    (0..x.len())
        .map(|i| match bounds.get(i) {
            Some(&(low, high)) => (x[i] <= low && gradient[i] > 0.0) || (x[i] >= high && gradient[i] < 0.0),
            None => false,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley as two residuals: 10 (y - x^2), 1 - x.
    struct Rosenbrock;

    impl LeastSquares for Rosenbrock {
        fn cost(&self, x: &DVector<f64>) -> f64 {
            self.normal_equations(x).cost
        }
        fn normal_equations(&self, x: &DVector<f64>) -> NormalEquations {
            let r = DVector::from_vec(vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
            let j = DMatrix::from_row_slice(2, 2, &[-20.0 * x[0], 10.0, -1.0, 0.0]);
            NormalEquations { cost: r.norm_squared(), gradient: j.transpose() * &r, hessian: j.transpose() * j }
        }
    }

    fn options(bounds: Vec<(f64, f64)>) -> Options {
        Options {
            max_iterations: 200,
            gradient_tolerance: 1e-10,
            cost_tolerance: 0.0,
            mu_initial: 1e-3,
            mu_max: 1e10,
            damping: Damping::Identity,
            bounds,
        }
    }

    #[test]
    fn finds_the_bottom_of_rosenbrocks_valley() {
        let start = DVector::from_vec(vec![-1.2, 1.0]);
        let found = minimise(&Rosenbrock, &start, &options(vec![]), |_, _, _| ControlFlow::Continue(()));
        assert!((found.x[0] - 1.0).abs() < 1e-6 && (found.x[1] - 1.0).abs() < 1e-6, "{found:?}");
        assert_eq!(found.stop, Stop::Gradient);
    }

    #[test]
    fn stays_inside_the_bounds_and_finds_the_constrained_minimum() {
        let start = DVector::from_vec(vec![-1.2, 1.0]);
        let bounds = vec![(-2.0, 0.5), (-2.0, 2.0)];
        let found = minimise(&Rosenbrock, &start, &options(bounds), |_, x, _| {
            assert!(x[0] <= 0.5);
            ControlFlow::Continue(())
        });
        assert!((found.x[0] - 0.5).abs() < 1e-9 && (found.x[1] - 0.25).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn the_cost_never_rises_and_the_caller_can_stop() {
        let start = DVector::from_vec(vec![-1.2, 1.0]);
        let mut last = f64::INFINITY;
        let found = minimise(&Rosenbrock, &start, &options(vec![]), |i, _, cost| {
            assert!(cost < last);
            last = cost;
            if i == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!((found.iterations, found.stop), (3, Stop::Caller));
    }
}
