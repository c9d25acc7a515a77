//! Laws of the model, and a pendulum that it learns.

use super::train::{importance, mean_square};
use super::{Activation, Friction, Inputs, Learned, Model, Sample, Shape, Structure, Training, from_links};
use nalgebra::SVector;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rigid_body::Tree;
use rigid_body::newton_euler::inverse_dynamics;
use rigid_body::random_tree::{self, tree};

/// Drive gains that differ from joint to joint.
fn gain<const N: usize>() -> SVector<f64, N> {
    SVector::from_fn(|j, _| 2.0 + j as f64)
}

/// Samples with efforts of any size.
fn random_samples<const N: usize>(count: usize, seed: u64) -> Vec<Sample<N>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |limit: f64| SVector::from_fn(|_, _| random.random_range(-limit..limit));
    (0..count).map(|_| Sample { q: draw(2.0), v: draw(1.5), a: draw(4.0), effort: draw(3.0) }).collect()
}

/// A model of three joints whose weights, linear ones included, are all random.
fn random_model(inputs: Inputs, activation: Activation, friction: Friction) -> Model<3> {
    let structure = if friction == Friction::Symmetric { Structure::Chain } else { Structure::Any };
    let shape = Shape {
        inputs,
        inertia: vec![(7, activation), (5, Activation::Tanh)],
        potential: vec![(6, activation)],
        friction,
        structure,
    };
    let mut model = Model::new(&shape, &random_samples(50, 1), gain(), 3);
    let (networks, mut random) = (model.networks(), ChaCha8Rng::seed_from_u64(4));
    model.weights[networks..].iter_mut().for_each(|weight| *weight = random.random_range(-1.0..1.0));
    model
}

/// A chain whose networks have one layer of so many sines.
fn chain(width: usize) -> Shape {
    let layer = vec![(width, Activation::Sine)];
    Shape {
        inputs: Inputs::Angles,
        inertia: layer.clone(),
        potential: layer,
        friction: Friction::Nonsymmetric,
        structure: Structure::Chain,
    }
}

#[test]
fn the_gradient_is_that_of_central_differences() {
    let samples = random_samples(4, 2);
    let importance = SVector::from([1.0, 0.3, 2.0]);
    for inputs in [Inputs::Angles, Inputs::SinesAndCosines] {
        for activation in [Activation::Tanh, Activation::Softplus, Activation::Sine] {
            for friction in [Friction::Symmetric, Friction::Nonsymmetric] {
                let mut model = random_model(inputs, activation, friction);
                let mut gradient = vec![0.0; model.weights.len()];
                model.error(&samples, &importance, &mut gradient);
                let largest = gradient.iter().fold(0.0, |largest: f64, g| largest.max(g.abs()));
                for i in 0..gradient.len() {
                    let weight = model.weights[i];
                    let [above, below] = [1e-5, -1e-5].map(|step| {
                        model.weights[i] = weight + step;
                        model.error(&samples, &importance, &mut vec![0.0; gradient.len()])
                    });
                    model.weights[i] = weight;
                    let difference = (above - below) / 2e-5 - gradient[i];
                    assert!(
                        difference.abs() < 1e-6 * gradient[i].abs() + 1e-8 * largest,
                        "{i}: {difference:e}, {}",
                        gradient[i]
                    );
                }
            }
        }
    }
}

#[test]
fn the_mass_matrix_is_symmetric_and_positive_definite_whatever_the_weights() {
    let mut model = random_model(Inputs::Angles, Activation::Tanh, Friction::Symmetric);
    for factor in [1.0, 3.0, 10.0] {
        model.weights.iter_mut().for_each(|weight| *weight *= factor);
        for Sample { q, .. } in random_samples::<3>(50, 5) {
            let mass = model.mass_matrix(&q);
            assert!((mass - mass.transpose()).norm() <= 1e-12 * mass.norm());
            assert!(mass.cholesky().is_some(), "{mass}");
        }
    }
}

#[test]
fn the_mass_matrix_of_a_chain_depends_on_the_positions_after_a_joint_alone() {
    let model = Model::<3>::new(&chain(7), &random_samples(50, 1), gain(), 3);
    let [base, first, second, third] = [[0.1, 0.2, 0.3], [0.9, 0.2, 0.3], [0.1, 0.9, 0.3], [0.1, 0.2, 0.9]]
        .map(|q| model.mass_matrix(&SVector::from(q)));
    let changed = |other: &nalgebra::SMatrix<f64, 3, 3>| {
        (0..3).map(|row| (other.row(row) - base.row(row)).norm() > 1e-6 * base.norm()).collect::<Vec<_>>()
    };
    // Entries of row and column 0 are in the other rows, too.
    let inner = |other: &nalgebra::SMatrix<f64, 3, 3>| {
        (other.fixed_view::<2, 2>(1, 1) - base.fixed_view::<2, 2>(1, 1)).norm() > 1e-6 * base.norm()
    };
    assert_eq!(changed(&first), [false; 3]);
    assert_eq!((changed(&second)[0], inner(&second)), (true, false));
    assert_eq!((changed(&third)[0], inner(&third)), (true, true));
}

#[test]
fn the_power_of_inertial_efforts_is_the_rate_of_kinetic_energy() {
    let mut model = random_model(Inputs::SinesAndCosines, Activation::Softplus, Friction::Nonsymmetric);
    let networks = model.networks();
    model.weights[networks..].fill(0.0);
    for sample in random_samples::<3>(50, 6) {
        let still = Sample { v: SVector::zeros(), a: SVector::zeros(), ..sample };
        let efforts = model.efforts(&[sample, still]);
        let power = sample.v.dot(&(efforts[0] - efforts[1]).component_mul(&gain()));
        let energy = |t: f64| {
            let v = sample.v + t * sample.a;
            0.5 * v.dot(&(model.mass_matrix(&(sample.q + t * sample.v + 0.5 * t * t * sample.a)) * v))
        };
        let rate = (energy(1e-5) - energy(-1e-5)) / 2e-5;
        assert!((power - rate).abs() < 1e-6 * (1.0 + rate.abs()), "{power} {rate}");
    }
}

#[test]
fn a_rotor_inertia_below_zero_is_taken_to_zero_and_nothing_else() {
    let mut model = random_model(Inputs::Angles, Activation::Sine, Friction::Nonsymmetric);
    let networks = model.networks();
    model.weights[networks..].copy_from_slice(&[-0.1, -0.2, -0.3, -1e-9, 0.1, 0.2, 0.3, 1e-9, -1.0, -2.0, -3.0, 4.0]);
    let before = model.weights.clone();
    model.bound_rotors();
    let changed: Vec<usize> = (0..before.len()).filter(|&i| before[i] != model.weights[i]).collect();
    assert_eq!((changed, model.weights[networks + 3]), (vec![networks + 3], 0.0));
}

/// Friction of both pendulum's joints: viscous, Coulomb forward and backward.
const FRICTION: [[f64; 3]; 2] = [[0.8, 1.5, 0.7], [0.4, 0.5, 1.1]];

/// Its links.
fn links() -> Tree {
    tree(random_tree::Shape { joints: 2, branches: false, prismatic: 0.0, armature: false }, 1)
}

/// A pendulum of two links at random states: efforts are its torques over the gains, and friction.
fn pendulum(count: usize, seed: u64) -> Vec<Sample<2>> {
    let links = links();
    let mut samples = random_samples::<2>(count, seed);
    for Sample { q, v, a, effort } in &mut samples {
        let torques = inverse_dynamics(&links, q.as_slice(), v.as_slice(), a.as_slice());
        *effort = SVector::<f64, 2>::from_column_slice(&torques).component_div(&gain());
        for (j, [viscous, forward, backward]) in FRICTION.iter().enumerate() {
            let direction = (100.0 * v[j]).tanh();
            effort[j] += viscous * v[j] + direction * if v[j] > 0.0 { forward } else { backward };
        }
    }
    samples
}

fn learned(friction: Friction) -> (Model<2>, f64) {
    let (samples, validation, test) = (pendulum(1_500, 7), pendulum(300, 8), pendulum(500, 9));
    let hidden = vec![(32, Activation::Tanh); 2];
    let shape = Shape {
        inputs: Inputs::SinesAndCosines,
        inertia: hidden.clone(),
        potential: hidden,
        friction,
        structure: Structure::Any,
    };
    let mut model = Model::new(&shape, &samples, gain(), 1);
    let learned = Learned::All;
    let training = Training { epochs: 200, batch: 50, rate: 0.01, learned, decay: [0.0; 2], every: 5, seed: 1 };
    training.run(&mut model, &samples, &validation, &importance(&samples, 2.0));
    let error = relative(&model, &test);
    (model, error)
}

/// RMS of the errors over that of the efforts.
fn relative(model: &Model<2>, test: &[Sample<2>]) -> f64 {
    let square = test.iter().map(|sample| sample.effort.norm_squared()).sum::<f64>() / test.len() as f64;
    (mean_square(model, test).sum() / square).sqrt()
}

#[test]
fn a_pendulum_of_two_links_and_its_friction_are_learned() {
    let (model, error) = learned(Friction::Nonsymmetric);
    assert!(error < 0.02, "{error}");
    for (j, expected) in FRICTION.iter().enumerate() {
        let found = model.linear(j);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 0.1 * expected, "{found} {expected}");
        }
    }
    // Coulomb friction that differs by direction is not in the earlier model; potential energy stands in for a part.
    let (_, symmetric) = learned(Friction::Symmetric);
    assert!(symmetric > 2.0 * error, "{symmetric} {error}");
}

#[test]
fn what_was_learned_from_the_links_is_kept_but_for_the_outputs_and_helps_where_samples_are_few() {
    let all = pendulum(400, 10);
    // Half of the way of each joint.
    let few: Vec<Sample<2>> = all.iter().filter(|sample| sample.q.min() > 0.0).copied().collect();
    let (samples, validation) = few.split_at(few.len() * 4 / 5);
    // A URDF that is wrong by a fifth.
    let mut wrong = links();
    wrong.joints.iter_mut().for_each(|joint| joint.link.mass *= 1.2);
    let importance = importance(samples, 2.0);
    let test = pendulum(500, 9);
    let mut model = Model::new(&chain(16), samples, gain(), 1);
    let learned = Learned::All;
    let training = Training { epochs: 60, batch: 50, rate: 0.02, learned, decay: [0.0; 2], every: 5, seed: 1 };
    let of_links = |count, seed| from_links::samples(&wrong, &gain(), &all, 0.0, count, seed);
    training.run(&mut model, &of_links(3_000, 11), &of_links(300, 12), &importance);

    let before = model.clone();
    let outputs = Training { epochs: 200, rate: 0.01, learned: Learned::Outputs, decay: [1.0; 2], ..training.clone() };
    outputs.run(&mut model, samples, validation, &importance);
    let rules = model.rules(Learned::Outputs, [1.0; 2]);
    let changed = |i: &usize| before.weights[*i].to_bits() != model.weights[*i].to_bits();
    // Outputs: 2 and 1 entries of M from 16 and no hidden values (the last joint's row has no inputs, and hidden
    // biases all the same), 1 of the potential energy; 4 linear coefficients of each joint.
    let learned = rules.iter().filter(|rule| rule.learned).count();
    assert_eq!(learned, 17 * (2 + 1 + 1) + 4 * 2);
    assert!((0..rules.len()).filter(changed).all(|i| rules[i].learned));

    let mut alone = Model::new(&chain(16), samples, gain(), 1);
    Training { epochs: 260, ..training }.run(&mut alone, samples, validation, &importance);
    let [begun, alone] = [&model, &alone].map(|model| relative(model, &test));
    println!("{begun} begun from the links, {alone} alone, {} from the links alone", relative(&before, &test));
    assert!(begun < 0.7 * alone, "{begun} {alone}");
}

#[test]
fn decay_leads_outputs_to_what_they_were() {
    let samples = pendulum(300, 13);
    let mut distances = Vec::new();
    for decay in [0.0, 30.0] {
        let mut model = Model::new(&chain(8), &samples, gain(), 1);
        let (networks, begin) = (model.networks(), model.weights.clone());
        let learned = Learned::Outputs;
        let training = Training { epochs: 20, batch: 50, rate: 0.01, learned, decay: [decay; 2], every: 5, seed: 1 };
        training.run(&mut model, &samples, &samples, &importance(&samples, 2.0));
        let square = |i: usize| (model.weights[i] - begin[i]).powi(2);
        distances.push((0..networks).map(square).sum::<f64>().sqrt());
    }
    assert!(distances[1] < 0.5 * distances[0] && distances[1] > 0.0, "{distances:?}");
}
