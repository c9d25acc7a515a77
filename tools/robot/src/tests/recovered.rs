//! Parameters are recovered within their stated errors, and every link is one that a body can have.

use super::synthetic::{EffortNoise, Measured, Truth, fourier, robot, rows, weighted};
use crate::convex::{self, Prior, links};
use crate::equations::Rows;
use crate::friction_columns::Friction;
use crate::least_squares::{Weighting, base, solve};
use rayon::prelude::*;
use rigid_body::Robot;

/// Robots of a test: every number of joints from 2 to 12 twice.
const ROBOTS: u64 = 22;
/// Robots whose parameters are counted: so many that the part within an interval is told to half a per cent.
const COUNTED: u64 = 110;
/// Noise of effort and position: 2 % of the effort's RMS, and an encoder of 18 bits.
const NOISE: Measured = Measured { friction: 0.0, effort: EffortNoise::Part(0.02), position: 7e-6 };

/// Errors of the unknowns that are solved for, over their standard errors.
fn departures(truth: &Truth, rows: &Rows) -> Vec<f64> {
    let base = base(&truth.robot, 1);
    let solution = solve(rows, &base, Weighting::ByJoint);
    let all = truth.unknowns(rows.layout.friction);
    let mut expected = base.values(&all.as_slice()[..rows.layout.rigid()]);
    expected.extend(&all.as_slice()[rows.layout.rigid()..]);
    let found = solution.solved.iter().map(|&at| solution.unknowns[at]);
    let departs = |((found, expected), error): ((f64, f64), &f64)| (found - expected) / error;
    found.zip(expected).zip(&solution.standard_errors).map(departs).collect()
}

/// Part of all departures within the 95 % interval of a normal distribution, and their RMS.
fn coverage(departures: &[f64]) -> (f64, f64) {
    let n = departures.len() as f64;
    let within = departures.iter().filter(|z| z.abs() <= 1.96).count() as f64;
    (within / n, (departures.iter().map(|z| z * z).sum::<f64>() / n).sqrt())
}

#[test]
fn unknowns_lie_within_their_95_percent_intervals_in_95_percent_of_cases_and_intervals_are_no_wider_than_they_must_be()
{
    for (name, friction, seconds, harmonics) in
        [("short, rich motion", Friction::None, 10.0, 8), ("long motion", Friction::None, 20.0, 5)]
    {
        let part = if friction == Friction::None { 0.0 } else { 1.0 };
        let all: Vec<f64> = (0..COUNTED)
            .into_par_iter()
            .flat_map(|seed| {
                let truth = robot(seed);
                let motion = fourier(&truth.robot, seconds, harmonics, 100 + seed);
                departures(&truth, &rows(&truth, &motion, friction, &Measured { friction: part, ..NOISE }, seed))
            })
            .collect();
        let (within, rms) = coverage(&all);
        println!("{name}: {:.1} % of {} within, errors over standard errors {rms:.2} RMS", 100.0 * within, all.len());
        assert!(within >= 0.95, "{name}: {within}");
        assert!((0.9..1.05).contains(&rms), "{name}: {rms}");
    }
}

#[test]
fn every_link_and_rotor_is_physical_whatever_the_prior_its_weight_and_the_noise() {
    let checked: usize = (0..ROBOTS)
        .into_par_iter()
        .map(|seed| {
            let truth = robot(seed);
            let motion = fourier(&truth.robot, 6.0, 3, 200 + seed);
            // A twentieth to a half of the effort is noise: least squares alone finds negative masses.
            let effort = EffortNoise::Part([0.05, 0.5][seed as usize % 2]);
            let measured = Measured { friction: 1.0, effort, position: 1e-5 };
            let rows = rows(&truth, &motion, Friction::Simple, &measured, seed);
            let solution = solve(&rows, &base(&truth.robot, 1), Weighting::ByJoint);
            let normal = weighted(&rows, &solution.noise);
            // A prior that is wrong by a third in every mass, or three times too heavy.
            let factor = [1.33, 3.0][seed as usize / 2 % 2];
            let wrong: Vec<f64> = truth.robot.tree.parameters().iter().map(|parameter| factor * parameter).collect();
            let prior = Prior::of(&Robot { tree: truth.robot.tree.with_parameters(&wrong), ..truth.robot.clone() });
            for gamma in [1e-4, 1.0, 1e4] {
                let found = convex::solve(&normal, rows.layout, &prior, gamma).unwrap();
                let links = links(&found, rows.layout);
                assert!(links.iter().all(|link| link.is_physical()), "robot {seed}, weight {gamma}");
                let rotors = found.rows(rows.layout.inertial(), rows.layout.joints);
                for (rotor, drive) in rotors.iter().zip(&truth.robot.drives) {
                    assert!(drive.rotor_inertia.is_some() || *rotor > 0.0, "robot {seed}, weight {gamma}");
                }
            }
            3 * rows.layout.joints
        })
        .sum();
    assert_eq!(checked, 3 * 2 * (2..=12).sum::<usize>());
}

#[test]
fn the_convex_fit_without_noise_and_with_a_light_prior_finds_the_base_parameters() {
    for seed in [0, 3, 4] {
        let truth = robot(seed);
        let motion = fourier(&truth.robot, 20.0, 6, 300 + seed);
        let exact = Measured { friction: 0.0, effort: EffortNoise::Part(1e-4), position: 0.0 };
        let rows = rows(&truth, &motion, Friction::None, &exact, seed);
        let base = base(&truth.robot, 1);
        let solution = solve(&rows, &base, Weighting::ByJoint);
        let wrong: Vec<f64> = truth.robot.tree.parameters().iter().map(|parameter| 1.33 * parameter).collect();
        let prior = Prior::of(&Robot { tree: truth.robot.tree.with_parameters(&wrong), ..truth.robot.clone() });
        let found = convex::solve(&weighted(&rows, &solution.noise), rows.layout, &prior, 1e-4).unwrap();
        let (found, expected) = (base.values(found.as_slice()), base.values(truth.unknowns(Friction::None).as_slice()));
        let departs: f64 = found.iter().zip(&expected).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        let size: f64 = expected.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!(departs < 0.01 * size, "robot {seed}: {departs} of {size}");
    }
}

#[test]
fn a_motion_that_leaves_a_parameter_open_states_no_error_for_it() {
    let truth = robot(2);
    let mut motion = fourier(&truth.robot, 10.0, 5, 400);
    // The last joint stands still: its rotor's inertia turns no motor.
    motion[3].iter_mut().for_each(|m| *m = Default::default());
    let still = Measured { position: 0.0, ..NOISE };
    let rows = rows(&truth, &motion, Friction::None, &still, 2);
    let base = base(&truth.robot, 1);
    let solution = solve(&rows, &base, Weighting::ByJoint);
    let of = |column: usize| {
        let at = solution.solved.iter().position(|&solved| solved == column);
        at.map(|at| solution.standard_errors[at])
    };
    assert_eq!(of(rows.layout.inertial() + 3), Some(f64::INFINITY));
    assert!(solution.standard_errors.iter().any(|error| error.is_finite()));
}

#[test]
fn outliers_move_the_reweighted_solution_less_than_the_weighted_one() {
    let truth = robot(7);
    let motion = fourier(&truth.robot, 15.0, 6, 500);
    let mut rows = rows(&truth, &motion, Friction::None, &NOISE, 7);
    for effort in &mut rows.effort {
        let most = effort.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        effort.iter_mut().step_by(17).for_each(|effort| *effort += most);
    }
    let base = base(&truth.robot, 1);
    let expected = base.values(truth.unknowns(Friction::None).as_slice());
    let departs = |weighting| {
        let solution = solve(&rows, &base, weighting);
        let left = solution.solved.iter().zip(&expected);
        left.map(|(&at, expected)| (solution.unknowns[at] - expected).powi(2)).sum::<f64>().sqrt()
    };
    let (reweighted, weighted) = (departs(Weighting::Reweighted), departs(Weighting::ByJoint));
    assert!(reweighted < 0.5 * weighted, "{reweighted} {weighted}");
}
