use super::*;
use rand_distr::{Distribution, StandardNormal};

fn random(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    DMatrix::from_fn(rows, columns, |_, _| random.random_range(-1.0..1.0))
}

/// Two functions of three inputs.
fn known(inputs: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(inputs.nrows(), 2, |row, column| {
        let x = inputs.row(row);
        if column == 0 { (3.0 * x[0]).tanh() + 0.5 * x[1] * x[2] } else { 40.0 * x[2] * x[2] - 20.0 * x[0] }
    })
}

#[test]
fn gradient_and_normal_matrix_are_those_of_central_differences() {
    let task = Task::new(&random(40, 3, 1), random(40, 2, 2));
    let x = 2.0 * first_weights(3, 2, &mut ChaCha8Rng::seed_from_u64(3));
    let errors = |x: &DVector<f64>| task.outputs(x).1 - &task.targets;
    let step = 1e-6;
    let mut jacobian = DMatrix::zeros(80, x.len());
    for k in 0..x.len() {
        let moved = |by: f64| {
            let mut x = x.clone();
            x[k] += by;
            errors(&x)
        };
        let slope = (moved(step) - moved(-step)) / (2.0 * step);
        jacobian.column_mut(k).copy_from_slice(slope.as_slice());
    }
    let error = DVector::from_column_slice(errors(&x).as_slice());
    let found = task.normal_equations(&x);
    assert!((found.cost - task.cost(&x)).abs() < 1e-14);
    assert!((found.gradient - jacobian.transpose() * error / 80.0).amax() < 1e-8);
    assert!((found.hessian - jacobian.transpose() * jacobian / 80.0).amax() < 1e-7);
}

#[test]
fn a_known_function_of_several_outputs_is_learned_to_a_hundredth() {
    let inputs = random(1000, 3, 4);
    let targets = known(&inputs);
    let split = Split::random(&(0..1000).collect::<Vec<_>>(), 5).unwrap();
    let network = Network::train(&inputs, &targets, &split.training, &split.validation, 6).unwrap();
    let error = network.predict(&inputs) - &targets;
    for column in 0..2 {
        let rms = |m: &DMatrix<f64>| split.test.iter().map(|&i| m[(i, column)].powi(2)).sum::<f64>().sqrt();
        assert!(rms(&error) < 0.01 * rms(&targets), "{column}: {}", rms(&error) / rms(&targets));
    }
}

#[test]
fn noise_is_not_learned_beyond_the_least_validation_error() {
    let mut draw = ChaCha8Rng::seed_from_u64(7);
    let inputs = random(200, 3, 8);
    let targets = DMatrix::from_fn(200, 2, |row, _| {
        let noise: f64 = StandardNormal.sample(&mut draw);
        inputs[(row, 0)] + noise
    });
    let split = Split::random(&(0..200).collect::<Vec<_>>(), 9).unwrap();
    let network = Network::train(&inputs, &targets, &split.training, &split.validation, 10).unwrap();
    assert_eq!(network.stop, Stop::Caller);
    let errors = &network.validation;
    // Six epochs without a lower error: the default of the toolbox that 000 uses (table 3.1).
    let (before, last) = errors.split_at(errors.len() - 6);
    let least = before.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(before.last().copied(), Some(least), "six epochs after the least error");
    assert!(last.iter().all(|error| *error >= least));
    // The weights are those of the least error, not of the end.
    let (predicted, scaling) = (network.predict(&inputs), &network.outputs);
    let error = |i: usize, j: usize| (predicted[(i, j)] - targets[(i, j)]) / scaling.half[j];
    let squares = split.validation.iter().flat_map(|&i| [error(i, 0), error(i, 1)]).map(|e| e * e);
    assert!((squares.sum::<f64>() / (2 * split.validation.len()) as f64 - least).abs() < 1e-12);
}

#[test]
fn a_split_has_the_papers_shares_without_overlap_and_differs_by_its_seed() {
    let samples: Vec<usize> = (100..200).collect();
    let split = Split::random(&samples, 1).unwrap();
    assert_eq!([split.training.len(), split.validation.len(), split.test.len()], [50, 20, 30]);
    let mut all = [split.training.clone(), split.validation.clone(), split.test.clone()].concat();
    all.sort_unstable();
    assert_eq!(all, samples);
    assert_eq!(Split::random(&samples, 1).unwrap(), split);
    assert_ne!(Split::random(&samples, 2).unwrap(), split);
}

#[test]
fn parts_without_samples_are_refused() {
    assert_eq!(Split::random(&[], 1), Err(EmptyPart("training")));
    assert_eq!(Split::random(&[1], 1), Err(EmptyPart("validation")));
    let train = |training: &[usize], validation: &[usize]| {
        Network::train(&random(4, 3, 1), &random(4, 2, 1), training, validation, 1).map(|_| ())
    };
    assert_eq!(train(&[], &[1]), Err(EmptyPart("training")));
    assert_eq!(train(&[1], &[]), Err(EmptyPart("validation")));
}

#[test]
fn an_input_that_never_changes_is_no_input() {
    let mut inputs = random(300, 3, 11);
    inputs.column_mut(1).fill(7.0);
    let targets = DMatrix::from_fn(300, 1, |row, _| inputs[(row, 0)]);
    let all: Vec<usize> = (0..300).collect();
    let network = Network::train(&inputs, &targets, &all[..200], &all[200..], 12).unwrap();
    let expected = network.predict(&inputs);
    inputs.column_mut(1).fill(-1e6);
    assert_eq!(network.predict(&inputs), expected);
}
