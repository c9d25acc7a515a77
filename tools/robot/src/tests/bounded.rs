//! Mass of a link keeps room in its ellipsoid, and another motion is predicted no worse for it.

use super::synthetic::{EffortNoise, Measured, Truth, fourier, robot, rows, weighted};
use crate::convex::{self, Prior, links};
use crate::equations::Normal;
use crate::friction_columns::Friction;
use crate::least_squares::{Weighting, base, solve};
use nalgebra::{DVector, Matrix3, Vector3};
use rayon::prelude::*;
use rigid_body::ellipsoid::Ellipsoid;
use rigid_body::shape::Shape;
use rigid_body::{LinkInertia, Robot};

/// Robots of a test: every number of joints from 2 to 12 twice.
const ROBOTS: u64 = 22;

/// The box that all mass of the random links lies in.
fn bound() -> Ellipsoid {
    Ellipsoid::around(&Shape::Box { size: [0.4; 3] }.points().unwrap()).unwrap()
}

/// A prior of one who knows nothing: a ball of 2 kg at the middle of each link.
fn placeholder(truth: &Truth) -> Prior {
    let ball = LinkInertia::from_centre(2.0, Vector3::zeros(), Matrix3::identity() * 0.02).parameters();
    Prior::of(&Robot {
        tree: truth.robot.tree.with_parameters(&ball.repeat(truth.robot.tree.len())),
        ..truth.robot.clone()
    })
}

#[test]
fn links_stay_within_their_shapes_whatever_the_noise_and_the_weight_of_the_prior_and_predict_no_worse() {
    let fits: Vec<(usize, usize, f64)> = (0..ROBOTS)
        .into_par_iter()
        .map(|seed| {
            let truth = robot(seed);
            let noise = Measured { friction: 0.0, effort: EffortNoise::Part(0.1), position: 7e-6 };
            let exact = Measured { effort: EffortNoise::Part(1e-6), ..noise };
            let (little, other) =
                (fourier(&truth.robot, 3.0, 3, 200 + seed), fourier(&truth.robot, 10.0, 6, 900 + seed));
            let learned = rows(&truth, &little, Friction::None, &noise, seed);
            let judged = rows(&truth, &other, Friction::None, &exact, seed);
            let solution = solve(&learned, &base(&truth.robot, 1), Weighting::ByJoint);
            let (normal, judge) = (weighted(&learned, &solution.noise), weighted(&judged, &solution.noise));
            let (bounded, outside) = placeholder(&truth).within(&vec![Some(bound()); truth.robot.tree.len()]);
            assert!(outside.is_empty());
            let beyond = |unknowns: &DVector<f64>| {
                let room = |link: &LinkInertia| bound().room(&link.pseudo_inertia());
                links(unknowns, learned.layout).iter().filter(|link| room(link) < 0.0).count()
            };
            let fits = [0.01, 0.1, 1.0, 10.0].map(|gamma| {
                let free = convex::solve(&normal, learned.layout, &placeholder(&truth), gamma).unwrap();
                let held = convex::solve(&normal, learned.layout, &bounded, gamma).unwrap();
                assert!(links(&held, learned.layout).iter().all(LinkInertia::is_physical), "robot {seed}");
                (beyond(&free), beyond(&held), 0.5 * (judge.residual(&held) / judge.residual(&free)).ln())
            });
            fits.into_iter().fold((0, 0, 0.0), |sum, fit| (sum.0 + fit.0, sum.1 + fit.1, sum.2 + 0.25 * fit.2))
        })
        .collect();
    let beyond = fits.iter().map(|fit| fit.0).sum::<usize>();
    let change = (fits.iter().map(|fit| fit.2).sum::<f64>() / ROBOTS as f64).exp();
    println!("links beyond without bounds {beyond}, error on another motion with bounds over without {change:.4}");
    assert_eq!(fits.iter().map(|fit| fit.1).sum::<usize>(), 0);
    assert!(beyond > 10, "{beyond}: the bounds have next to nothing to do");
    assert!(change < 1.0, "{change}");
}

/// The first link that a fit to nothing finds where the prior's are balls with this room in their ellipsoid, part of
/// the mass; and the prior's.
fn of_prior_alone(room: f64) -> (LinkInertia, LinkInertia) {
    let truth = robot(0);
    // Inertia of a ball whose spread leaves this room at the middle of the ellipsoid, and what the prior adds to it.
    let spread = (1.0 - room) / bound().shape.trace() - 1e-4;
    let ball = LinkInertia::from_centre(2.0, bound().centre, Matrix3::identity() * (2.0 * 2.0 * spread));
    let all = ball.parameters().repeat(truth.robot.tree.len());
    let prior = Prior::of(&Robot { tree: truth.robot.tree.with_parameters(&all), ..truth.robot.clone() });
    let (prior, _) = prior.within(&vec![Some(bound()); truth.robot.tree.len()]);
    let noise = Measured { friction: 0.0, effort: EffortNoise::Part(0.1), position: 0.0 };
    let layout = rows(&truth, &fourier(&truth.robot, 3.0, 3, 1), Friction::None, &noise, 1).layout;
    let found = convex::solve(&Normal::zero(layout.unknowns()), layout, &prior, 1.0).unwrap();
    let widened = LinkInertia { inertia: ball.inertia + Matrix3::identity() * (2.0 * 2.0 * 1e-4), ..ball };
    (links(&found, layout)[0], widened)
}

#[test]
fn without_data_the_links_are_the_priors_unless_these_lie_within_a_tenth_of_the_surface() {
    let departs = |room: f64| {
        let (found, expected) = of_prior_alone(room);
        (found.pseudo_inertia() - expected.pseudo_inertia()).norm() / expected.pseudo_inertia().norm()
    };
    assert!(departs(0.4) < 1e-6 && departs(0.101) < 1e-6, "{} {}", departs(0.4), departs(0.101));
    assert!(departs(0.09) > 1e-4, "{}", departs(0.09));
}

#[test]
fn a_prior_that_does_not_fit_in_its_ellipsoid_is_told_and_has_no_bound() {
    let truth = robot(0);
    let mut bounds = vec![Some(bound()); truth.robot.tree.len()];
    let far = Ellipsoid { centre: Vector3::x(), ..bound() };
    bounds[1] = Some(far);
    assert_eq!(placeholder(&truth).within(&bounds).1, [1]);
    bounds[1] = None;
    assert!(placeholder(&truth).within(&bounds).1.is_empty());
}
