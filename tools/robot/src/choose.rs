//! Friction beside the rigid bodies, and how much the prior counts: by the error on groups of samples that are left
//! out; host.

use super::convex::{self, Prior};
use super::equations::{GROUPS, Normal, Rows};
use super::friction_columns::Friction;
use super::least_squares::{self, Solution, Weighting, base};
use super::recording::{Recording, RobotFitError};
use identification::choice::{compare, rank};
use nalgebra::DVector;
use rayon::prelude::*;

/// Weights of the prior that compete.
const GAMMAS: [f64; 10] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0, 1e3, 1e4, 1e5];
/// The weight with which frictions compete.
const MIDDLE: f64 = 0.1;
/// Samples for training and validation below which nothing is identified.
const LEAST: usize = 300;

/// The rigid bodies of a robot.
#[derive(Debug)]
pub struct Bodies {
    /// Rows with the friction that was chosen.
    pub rows: Rows,
    /// All unknowns of the convex fit.
    pub unknowns: DVector<f64>,
    /// Weighted least squares with viscous and Coulomb friction and an offset, the simplest model, and its rows.
    pub simplest: (Solution, Rows),
    /// Least squares with the friction that was chosen: base parameters with standard errors.
    pub base: Solution,
    /// Friction that was chosen.
    pub friction: Friction,
    /// Weight of the prior that was chosen.
    pub gamma: f64,
    /// Reasons of the choices, a line each.
    pub notes: Vec<String>,
}

/// Identifies the rigid bodies.
///
/// # Errors
/// Too few samples.
pub fn bodies(recording: &Recording) -> Result<Bodies, RobotFitError> {
    let undetermined = |reason| RobotFitError::Undetermined { path: recording.path.clone(), reason };
    let first = Rows::of(recording, Friction::Simple, None);
    let used = first.group.iter().flatten().count();
    if used < LEAST {
        return Err(undetermined(format!(
            "{used} samples for training and validation; at least {LEAST} are needed: record longer, or trim less"
        )));
    }
    let base = base(&recording.robot, 1);
    let simplest = least_squares::solve(&first, &base, Weighting::ByJoint);
    let prior = Prior::of(&recording.robot);
    let groups = weighted(&first, &simplest.noise);
    let start = convex::solve(&sum(&groups, None), first.layout, &prior, MIDDLE).unwrap_or(simplest.unknowns.clone());
    let load = first.rigid_efforts(&start);
    let mut notes = Vec::new();
    let candidates: Vec<(Friction, Vec<f64>)> = Friction::ALL
        .into_par_iter()
        .map(|friction| {
            let rows = first.clone().again(recording, friction, Some(&load));
            let groups = weighted(&rows, &simplest.noise);
            (friction, errors(&rows, &groups, &prior, MIDDLE))
        })
        .collect();
    let all: Vec<Vec<f64>> = candidates.iter().map(|(_, errors)| errors.clone()).collect();
    let widths: Vec<usize> = Friction::ALL.map(Friction::width).into();
    let friction = candidates[rank(&all, &widths)[0]].0;
    for (other, errors) in &candidates {
        let change = compare(&all[0], errors).percent();
        notes.push(format!("friction {}: error on left-out samples {change:+.1} %", other.name()));
    }
    let rows = first.clone().again(recording, friction, Some(&load));
    let solution = least_squares::solve(&rows, &base, Weighting::ByJoint);
    let groups = weighted(&rows, &solution.noise);
    let tried: Vec<(f64, Vec<f64>)> =
        GAMMAS.into_par_iter().map(|gamma| (gamma, errors(&rows, &groups, &prior, gamma))).collect();
    let reference = &tried[0].1;
    let mean = |errors: &Vec<f64>| compare(reference, errors).mean;
    let gamma = tried.iter().min_by(|a, b| mean(&a.1).total_cmp(&mean(&b.1))).map_or(MIDDLE, |best| best.0);
    notes.push(format!("weight of the prior {gamma:e}, of {} that were tried", GAMMAS.len()));
    let unknowns = convex::solve(&sum(&groups, None), rows.layout, &prior, gamma)
        .ok_or_else(|| undetermined("the convex fit finds no minimum; check units and gains".into()))?;
    Ok(Bodies { rows, unknowns, simplest: (simplest, first), base: solution, friction, gamma, notes })
}

/// The joints' equations, group by group, divided by their noise squared, and those of each joint alone.
struct Weighted {
    sums: Vec<Normal>,
    joints: Vec<Vec<Normal>>,
}

fn weighted(rows: &Rows, noise: &[f64]) -> Weighted {
    let joints: Vec<Vec<Normal>> = (0..rows.layout.joints).map(|j| rows.normal(j, |_| 1.0)).collect();
    let sums = (0..GROUPS).map(|group| {
        let mut sum = Normal::zero(rows.layout.unknowns());
        joints.iter().zip(noise).for_each(|(joint, noise)| sum.add(&joint[group], 1.0 / (noise * noise)));
        sum
    });
    Weighted { sums: sums.collect(), joints }
}

fn sum(groups: &Weighted, left_out: Option<usize>) -> Normal {
    let mut sum = Normal::zero(groups.sums[0].right.len());
    let kept = groups.sums.iter().enumerate().filter(|(group, _)| Some(*group) != left_out);
    kept.for_each(|(_, group)| sum.add(group, 1.0));
    sum
}

/// Error on each group that is left out: root of the mean over joints of what is left, as a part of the effort's
/// square.
fn errors(rows: &Rows, groups: &Weighted, prior: &Prior, gamma: f64) -> Vec<f64> {
    let error = |group: usize| {
        let Some(x) = convex::solve(&sum(groups, Some(group)), rows.layout, prior, gamma) else { return 1e6 };
        let joints = groups.joints.iter().map(|joint| joint[group].residual(&x) / joint[group].square.max(1e-30));
        (joints.sum::<f64>() / rows.layout.joints as f64).sqrt()
    };
    (0..GROUPS).filter(|&group| groups.sums[group].count > 0).map(error).collect()
}
