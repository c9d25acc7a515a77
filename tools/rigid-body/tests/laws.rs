//! Laws of mechanics on random robots: what must hold whatever the numbers.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use rigid_body::articulated_body::forward_dynamics;
use rigid_body::base_parameters::BaseParameters;
use rigid_body::mass_matrix::mass_matrix;
use rigid_body::newton_euler::inverse_dynamics;
use rigid_body::random_tree::{Shape, state, tree};
use rigid_body::regressor::regressor;
use rigid_body::{JointKind, Tree};

fn robots() -> impl Strategy<Value = (Tree, u64)> {
    (1usize..13, any::<bool>(), 0.0..0.5, any::<bool>(), any::<u64>()).prop_map(
        |(joints, branches, prismatic, armature, seed)| {
            (tree(Shape { joints, branches, prismatic, armature }, seed), seed)
        },
    )
}

/// Largest difference, relative to the largest value.
fn departs(a: &[f64], b: &[f64]) -> f64 {
    let most = a.iter().chain(b).fold(1.0, |most: f64, x| most.max(x.abs()));
    a.iter().zip(b).fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs())) / most
}

/// Kinetic and potential energy, from the mass matrix and from the places of the centres of mass.
fn energy(tree: &Tree, q: &[f64], v: &[f64]) -> f64 {
    let v = DVector::from_row_slice(v);
    let mut kinetic = 0.5 * v.dot(&(mass_matrix(tree, q) * &v));
    let mut places = Vec::new();
    for (joint, q) in tree.joints.iter().zip(q) {
        let place = match joint.parent {
            Some(parent) => {
                let parent: &rigid_body::Placement = &places[parent];
                parent.then(&joint.at(*q))
            }
            None => joint.at(*q),
        };
        let centre = place.translation + place.rotation * joint.link.centre();
        kinetic -= joint.link.mass * tree.gravity.dot(&centre);
        places.push(place);
    }
    kinetic
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn torques_are_the_regressor_times_the_parameters((tree, seed) in robots()) {
        let [q, v, a] = state(tree.len(), seed);
        let linear = regressor(&tree, &q, &v, &a) * DVector::from_vec(tree.parameters());
        let torque: Vec<f64> = inverse_dynamics(&tree, &q, &v, &a).iter().zip(&tree.joints).zip(&a)
            .map(|((torque, joint), a)| torque - joint.armature * a).collect();
        prop_assert!(departs(&torque, linear.as_slice()) < 1e-9);
    }

    #[test]
    fn the_mass_matrix_gives_the_torques_of_an_acceleration((tree, seed) in robots()) {
        let [q, v, a] = state(tree.len(), seed);
        let rest = inverse_dynamics(&tree, &q, &v, &vec![0.0; a.len()]);
        let product = mass_matrix(&tree, &q) * DVector::from_row_slice(&a);
        let torque: Vec<f64> = product.iter().zip(&rest).map(|(m, rest)| m + rest).collect();
        prop_assert!(departs(&torque, &inverse_dynamics(&tree, &q, &v, &a)) < 1e-9);
    }

    #[test]
    fn the_mass_matrix_is_symmetric_and_positive_definite((tree, seed) in robots()) {
        let matrix = mass_matrix(&tree, &state(tree.len(), seed)[0]);
        prop_assert!((&matrix - matrix.transpose()).norm() < 1e-12 * matrix.norm());
        prop_assert!(matrix.cholesky().is_some());
    }

    #[test]
    fn forward_dynamics_takes_torques_back_to_their_accelerations((tree, seed) in robots()) {
        let [q, v, a] = state(tree.len(), seed);
        let torque = inverse_dynamics(&tree, &q, &v, &a);
        let found = forward_dynamics(&tree, &q, &v, &torque).unwrap();
        prop_assert!(departs(&found, &a) < 1e-9, "{found:?} {a:?}");
    }

    #[test]
    fn power_is_the_change_of_energy((tree, seed) in robots()) {
        let [q, v, a] = state(tree.len(), seed);
        let power: f64 = inverse_dynamics(&tree, &q, &v, &a).iter().zip(&v).map(|(torque, v)| torque * v).sum();
        // Central difference along q + v t + a t^2 / 2, of second order.
        let at = |t: f64| {
            let moved: Vec<f64> = (0..q.len()).map(|i| q[i] + v[i] * t + 0.5 * a[i] * t * t).collect();
            let speed: Vec<f64> = (0..q.len()).map(|i| v[i] + a[i] * t).collect();
            energy(&tree, &moved, &speed)
        };
        let (coarse, fine) = ((at(2e-4) - at(-2e-4)) / 4e-4, (at(1e-4) - at(-1e-4)) / 2e-4);
        let found = fine + (fine - coarse) / 3.0;
        let scale = at(0.0).abs().max(power.abs()).max(1.0);
        prop_assert!((found - power).abs() < 1e-6 * scale, "{found} {power}");
    }

    #[test]
    fn base_parameters_give_all_torques_in_states_that_they_were_not_found_in((tree, seed) in robots()) {
        let base = BaseParameters::of_tree(&tree, 60, 1);
        let [q, v, a] = state(tree.len(), seed);
        let matrix = regressor(&tree, &q, &v, &a);
        let all = &matrix * DVector::from_vec(tree.parameters());
        let reduced = matrix.select_columns(&base.independent) * DVector::from_vec(base.values(&tree.parameters()));
        prop_assert!(departs(all.as_slice(), reduced.as_slice()) < 1e-5, "{} {all} {reduced}", base.len());
        let singular = stacked(&tree, 60).svd(false, false).singular_values;
        let rank = singular.iter().filter(|s| **s > 1e-9 * singular.max()).count();
        prop_assert!(base.len() == rank, "{} of {rank}", base.len());
    }
}

fn stacked(tree: &Tree, states: usize) -> DMatrix<f64> {
    let n = tree.len();
    let mut matrix = DMatrix::zeros(n * states, 10 * n);
    for i in 0..states {
        let [q, v, a] = state(n, 1_000 + i as u64);
        matrix.rows_mut(i * n, n).copy_from(&regressor(tree, &q, &v, &a));
    }
    matrix
}

#[test]
fn a_free_pendulum_keeps_its_energy() {
    let tree = tree(Shape { joints: 3, branches: false, prismatic: 0.0, armature: false }, 7);
    assert!(tree.joints.iter().all(|joint| joint.kind == JointKind::Revolute));
    let (mut q, mut v) = (vec![0.3, -0.4, 0.5], vec![0.0; 3]);
    let before = energy(&tree, &q, &v);
    let slope = |q: &[f64], v: &[f64]| (v.to_vec(), forward_dynamics(&tree, q, v, &[0.0; 3]).unwrap());
    let moved = |x: &[f64], by: &[f64], h: f64| -> Vec<f64> { x.iter().zip(by).map(|(x, by)| x + h * by).collect() };
    let h = 2e-4;
    for _ in 0..5_000 {
        let (q1, v1) = slope(&q, &v);
        let (q2, v2) = slope(&moved(&q, &q1, h / 2.0), &moved(&v, &v1, h / 2.0));
        let (q3, v3) = slope(&moved(&q, &q2, h / 2.0), &moved(&v, &v2, h / 2.0));
        let (q4, v4) = slope(&moved(&q, &q3, h), &moved(&v, &v3, h));
        for i in 0..3 {
            q[i] += h / 6.0 * (q1[i] + 2.0 * q2[i] + 2.0 * q3[i] + q4[i]);
            v[i] += h / 6.0 * (v1[i] + 2.0 * v2[i] + 2.0 * v3[i] + v4[i]);
        }
    }
    let after = energy(&tree, &q, &v);
    assert!((after - before).abs() < 1e-6 * before.abs().max(1.0), "{before} {after}");
}
