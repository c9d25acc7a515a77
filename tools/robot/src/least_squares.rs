//! IDIM-LS: base parameters by least squares over the efforts of an inverse dynamic identification model; host.
//!
//! A. Janot, P.-O. Vandanjon, M. Gautier, A Generic Instrumental Variable Approach for Industrial Robot
//! Identification, 2014, section II: ordinary least squares, weighted by the noise of each joint; and with Huber's
//! weights over samples (P. Huber, Robust Statistics, 1981). Their standard errors hold for noise without correlation;
//! [`Solution::standard_errors`] count the correlation of filtered samples ([`super::noise`]). Model errors that depend
//! on the motion are no noise, and are not counted.

use super::equations::{GROUPS, Normal, Rows, rigid_columns};
use super::noise::Noise;
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;
use rigid_body::Robot;
use rigid_body::base_parameters::BaseParameters;

/// Random states over which base parameters are found.
const STATES: usize = 150;
/// Eigenvalues of the scaled normal equations below this part of the largest are not inverted: 1e-6 of the singular
/// values.
const LEAST: f64 = 1e-12;
/// Part of a direction that is not inverted, from which an unknown is left open.
const OPEN: f64 = 1e-3;
/// Standard deviations from which Huber's weight falls.
const HUBER: f64 = 1.345;
/// Rounds of reweighting.
const ROUNDS: usize = 8;

/// Weights of the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weighting {
    /// All alike.
    Ordinary,
    /// Weights by the noise of each joint.
    ByJoint,
    /// Weights by the noise of each joint, and less for samples that depart from the model.
    Reweighted,
}

/// A least-squares solution.
#[derive(Clone, Debug)]
pub struct Solution {
    /// All unknowns; inertial parameters that torques do not show are 0.
    pub unknowns: DVector<f64>,
    /// Places of the unknowns that are solved for: base parameters, then friction.
    pub solved: Vec<usize>,
    /// Standard error of each of them; infinite where the motion does not determine it.
    pub standard_errors: Vec<f64>,
    /// RMS of what is left of each joint's effort.
    pub noise: Vec<f64>,
    /// Condition number of the regressor with columns of unit length.
    pub condition: f64,
}

/// Base parameters of a robot among inertial parameters and rotor inertias that are not known.
pub fn base(robot: &Robot, seed: u64) -> BaseParameters {
    let n = robot.tree.len();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut all = DMatrix::zeros(STATES * n, 11 * n);
    for state in 0..STATES {
        let mut draw = |limit: f64| -> Vec<f64> { (0..n).map(|_| random.random_range(-limit..limit)).collect() };
        let (q, v, a) = (draw(std::f64::consts::PI), draw(2.0), draw(10.0));
        all.rows_mut(state * n, n).copy_from(&rigid_columns(robot, &q, &v, &a));
    }
    for (k, drive) in robot.drives.iter().enumerate() {
        if drive.rotor_inertia.is_some() {
            all.column_mut(10 * n + k).fill(0.0);
        }
    }
    BaseParameters::of(&all)
}

/// Solves for base parameters and friction.
pub fn solve(rows: &Rows, base: &BaseParameters, weighting: Weighting) -> Solution {
    let joints = rows.layout.joints;
    let solved: Vec<usize> =
        base.independent.iter().copied().chain(rows.layout.rigid()..rows.layout.unknowns()).collect();
    let plain: Vec<Normal> = (0..joints).into_par_iter().map(|j| total(&rows.normal(j, |_| 1.0))).collect();
    let mut weights = vec![1.0; joints];
    let mut found = combined(&plain, &weights, &solved);
    let noise = |unknowns: &DVector<f64>| -> Vec<f64> {
        plain.iter().map(|normal| (normal.residual(unknowns) / normal.count.max(1) as f64).sqrt().max(1e-12)).collect()
    };
    if weighting != Weighting::Ordinary {
        for _ in 0..3 {
            weights = noise(&found.unknowns).iter().map(|noise| 1.0 / (noise * noise)).collect();
            found = combined(&plain, &weights, &solved);
        }
    }
    if weighting == Weighting::Reweighted {
        for _ in 0..ROUNDS {
            let unknowns = &found.unknowns;
            let sigma: Vec<f64> = (0..joints).map(|j| spread(rows, unknowns, j)).collect();
            let normals: Vec<Normal> = (0..joints)
                .into_par_iter()
                .map(|j| {
                    let weight = |i: usize| {
                        let departs = rows.residual(unknowns, j, i).abs() / sigma[j];
                        if departs > HUBER { HUBER / departs } else { 1.0 }
                    };
                    total(&rows.normal(j, weight))
                })
                .collect();
            weights = sigma.iter().map(|sigma| 1.0 / (sigma * sigma)).collect();
            found = combined(&normals, &weights, &solved);
        }
    }
    let Combined { unknowns, inverse, condition, open } = found;
    let noise = noise(&unknowns);
    let correlated: Vec<Noise> = (0..joints).into_par_iter().map(|j| Noise::of(rows, &unknowns, j, &solved)).collect();
    let standard_errors = standard_errors(&correlated, &weights, &inverse, &open);
    Solution { unknowns, solved, standard_errors, noise, condition }
}

/// Standard errors from the covariance of a weighted solution, inverse * (sum of w^2 s^2 X^T T X) * inverse.
fn standard_errors(joints: &[Noise], weights: &[f64], inverse: &DMatrix<f64>, open: &[bool]) -> Vec<f64> {
    let mut middle = DMatrix::zeros(open.len(), open.len());
    for (noise, weight) in joints.iter().zip(weights) {
        // A joint without samples to spare leaves the noise of all unknowns open.
        let Some(variance) = noise.variance(inverse, *weight) else { return vec![f64::INFINITY; open.len()] };
        middle += weight * weight * variance * &noise.rows;
    }
    let covariance = inverse * middle * inverse;
    let of = |(variance, open): (&f64, &bool)| if *open { f64::INFINITY } else { variance.max(0.0).sqrt() };
    covariance.diagonal().iter().zip(open).map(of).collect()
}

/// The sum over all groups.
pub fn total(groups: &[Normal]) -> Normal {
    let mut sum = Normal::zero(groups[0].right.len());
    groups.iter().take(GROUPS).for_each(|group| sum.add(group, 1.0));
    sum
}

/// The weighted sum of the joints' equations, solved.
struct Combined {
    unknowns: DVector<f64>,
    /// Inverse over the unknowns that are solved for.
    inverse: DMatrix<f64>,
    /// Condition number of the regressor.
    condition: f64,
    /// Flag of those of them that the motion leaves open.
    open: Vec<bool>,
}

fn combined(joints: &[Normal], weights: &[f64], solved: &[usize]) -> Combined {
    let mut sum = Normal::zero(joints[0].right.len());
    joints.iter().zip(weights).for_each(|(normal, weight)| sum.add(normal, *weight));
    let part = sum.matrix.select_columns(solved).select_rows(solved);
    let scale: Vec<f64> = part.diagonal().iter().map(|d| if *d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }).collect();
    let n = solved.len();
    let scaled = DMatrix::from_fn(n, n, |a, b| part[(a, b)] * scale[a] * scale[b]);
    let eigen = scaled.symmetric_eigen();
    let most = eigen.eigenvalues.max();
    let kept = |value: &f64| *value > LEAST * most;
    let least = eigen.eigenvalues.iter().copied().filter(kept).fold(most, f64::min);
    let inverted = eigen.eigenvalues.map(|value| if kept(&value) { 1.0 / value } else { 0.0 });
    let inverse = &eigen.eigenvectors * DMatrix::from_diagonal(&inverted) * eigen.eigenvectors.transpose();
    let inverse = DMatrix::from_fn(n, n, |a, b| inverse[(a, b)] * scale[a] * scale[b]);
    let dropped: Vec<usize> = (0..n).filter(|&k| !kept(&eigen.eigenvalues[k])).collect();
    let open = (0..n).map(|a| dropped.iter().any(|&k| eigen.eigenvectors[(a, k)].abs() > OPEN)).collect();
    let found = &inverse * sum.right.select_rows(solved);
    let mut unknowns = DVector::zeros(sum.right.len());
    solved.iter().zip(found.iter()).for_each(|(&at, value)| unknowns[at] = *value);
    Combined { unknowns, inverse, condition: (most / least).sqrt(), open }
}

fn residuals(rows: &Rows, unknowns: &DVector<f64>, j: usize) -> Vec<f64> {
    let used = (0..rows.group.len()).filter(|&i| rows.group[i].is_some());
    used.map(|i| rows.residual(unknowns, j, i)).collect()
}

/// Standard deviation by the median of the magnitudes.
fn spread(rows: &Rows, unknowns: &DVector<f64>, j: usize) -> f64 {
    let mut all: Vec<f64> = residuals(rows, unknowns, j).into_iter().map(f64::abs).collect();
    all.sort_by(f64::total_cmp);
    (1.4826 * all.get(all.len() / 2).copied().unwrap_or(0.0)).max(1e-12)
}
