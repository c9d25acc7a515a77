//! Promises of both trainers, on samples whose truth is known.

use super::*;
use crate::network::FIRMWARE_HIDDEN;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Mutex;
use weights::Bounds;

const SILENT: OnProgress = &|_| ();

/// Samples of `truth` at inputs uniform in [-1, 1], with uniform noise of the given amplitude.
fn samples(seed: u64, count: usize, noise: f64, truth: impl Fn(&[f64; INPUTS]) -> f64) -> TrainingSet {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let inputs: Vec<[f64; INPUTS]> =
        (0..count).map(|_| std::array::from_fn(|_| random.random_range(-1.0..1.0))).collect();
    let targets = inputs.iter().map(|x| truth(x) + noise * random.random_range(-1.0..=1.0)).collect();
    TrainingSet::unweighted(inputs, targets)
}

fn unit_box(used: [bool; INPUTS]) -> InputBox {
    InputBox::new([-1.0; INPUTS], [1.0; INPUTS], used).unwrap()
}

/// Smooth function of position, velocity and torque that does not depend on the temperature.
fn smooth(x: &[f64; INPUTS]) -> f64 {
    (3.0 * x[1]).tanh() + 0.4 * (2.0 * x[0]).sin() + 0.3 * x[1] * x[2]
}

fn one_seed(seed: u64) -> levenberg_marquardt::Options {
    levenberg_marquardt::Options { seeds: vec![seed], ..Default::default() }
}

fn few_passes() -> stochastic::Options {
    stochastic::Options { seeds: vec![1, 2], epochs: 15, ..Default::default() }
}

fn relative_error(network: &Network, set: &TrainingSet) -> f64 {
    let errors = set.inputs.iter().zip(&set.targets).map(|(x, t)| (network.evaluate(x) - t).powi(2));
    (errors.sum::<f64>() / set.targets.iter().map(|t| t * t).sum::<f64>()).sqrt()
}

/// The two trainers with few epochs, as one function of the samples.
type Trainer = fn(&TrainingSet, &TrainingSet, &InputBox) -> Result<Trained, TrainError>;
const TRAINERS: [Trainer; 2] = [
    |train, validation, limits| {
        let options = levenberg_marquardt::Options { seeds: vec![1, 2], max_epochs: 15, ..Default::default() };
        levenberg_marquardt::train(train, validation, limits, &options, SILENT)
    },
    |train, validation, limits| stochastic::train(train, validation, limits, &few_passes(), SILENT),
];

#[test]
fn levenberg_marquardt_learns_a_known_3x5_network() {
    let limits = unit_box([true; INPUTS]);
    let mut random = ChaCha8Rng::seed_from_u64(40);
    let parameters = (0..96).map(|_| random.random_range(-1.0..1.0)).collect();
    let teacher = Network::new(&FIRMWARE_HIDDEN, limits, 12.0, parameters).unwrap();
    let taught = |seed| samples(seed, 1500, 0.0, |x| teacher.evaluate(x));
    let seeds = vec![1, 2, 3];
    let options =
        levenberg_marquardt::Options { seeds, decay: 0.0, max_epochs: 150, max_fail: 30, ..Default::default() };
    let trained = levenberg_marquardt::train(&taught(1), &taught(2), &limits, &options, SILENT).unwrap();
    let error = relative_error(&trained.network, &taught(3));
    assert!(error < 0.01, "{error}");
}

#[test]
fn levenberg_marquardt_learns_coulomb_and_stribeck_friction_with_its_edge_at_standstill() {
    // Coulomb edge of 20 mrad/s and Stribeck dip of 0.15 rad/s in a range of +-2 rad/s, 30 % less friction when hot.
    let friction = |x: &[f64; INPUTS]| {
        let v: f64 = 2.0 * x[1];
        (1.0 - 0.15 * x[4]) * ((v / 0.02).tanh() * (1.0 + 0.5 * (-(v / 0.15).powi(2)).exp()) + 0.2 * v)
    };
    let limits = unit_box([false, true, false, false, true]);
    // Velocities are dense about standstill, as in a recording with reversals.
    let dense = |seed, count| {
        let mut set = samples(seed, count, 0.0, friction);
        for i in 0..count {
            set.inputs[i][1] = set.inputs[i][1].powi(3);
            set.targets[i] = friction(&set.inputs[i]);
        }
        set
    };
    let options =
        levenberg_marquardt::Options { seeds: vec![0, 1], max_epochs: 100, max_fail: 30, ..Default::default() };
    let trained = levenberg_marquardt::train(&dense(1, 2000), &dense(2, 1000), &limits, &options, SILENT).unwrap();
    let error = relative_error(&trained.network, &dense(3, 4000));
    assert!(error < 0.02, "{error}");
}

#[test]
fn stochastic_descent_learns_a_smooth_function() {
    let (train, validation) = (samples(1, 2000, 0.0, smooth), samples(2, 1000, 0.0, smooth));
    let options = stochastic::Options { seeds: vec![1, 2], epochs: 150, ..Default::default() };
    let trained = stochastic::train(&train, &validation, &unit_box([true; INPUTS]), &options, SILENT).unwrap();
    let error = relative_error(&trained.network, &samples(3, 1000, 0.0, smooth));
    assert!(error < 0.1, "{error}");
}

#[test]
fn the_reference_network_learns_with_one_layer_of_sixteen() {
    let (train, validation) = (samples(1, 2000, 0.0, smooth), samples(2, 1000, 0.0, smooth));
    let options = levenberg_marquardt::Options { max_epochs: 40, ..reference::options(vec![1]) };
    let trained = levenberg_marquardt::train(&train, &validation, &unit_box([true; INPUTS]), &options, SILENT).unwrap();
    assert_eq!(trained.network.shape().sizes(), [5, 16, 1]);
    let error = relative_error(&trained.network, &samples(3, 1000, 0.0, smooth));
    assert!(error < 0.02, "{error}");
}

#[test]
fn early_stopping_waits_max_fail_epochs_and_returns_the_network_of_the_best_one() {
    // Few noisy samples: the network starts to learn the noise, and the validation error rises.
    let (train, validation) = (samples(1, 120, 1.0, smooth), samples(2, 400, 1.0, smooth));
    let limits = unit_box([true; INPUTS]);
    let options = levenberg_marquardt::Options { decay: 0.0, max_fail: 9, ..one_seed(3) };
    let trained = levenberg_marquardt::train(&train, &validation, &limits, &options, SILENT).unwrap();
    let curve = &trained.curve;
    assert_eq!(curve.stop, Stop::Validation);
    assert_eq!(curve.validation_mse.len(), curve.best_epoch + 1 + 9);
    assert_eq!(curve.train_mse.len(), curve.validation_mse.len());
    assert!(curve.validation_mse.iter().all(|&mse| mse >= trained.validation_mse()));
    let errors = validation.inputs.iter().zip(&validation.targets).map(|(x, t)| trained.network.evaluate(x) - t);
    let mse = errors.map(|e| e * e).sum::<f64>() / validation.targets.len() as f64;
    assert!((mse - trained.validation_mse()).abs() < 1e-9, "{mse} {}", trained.validation_mse());
}

#[test]
fn training_gives_the_same_bits_with_one_thread_and_with_two() {
    let (train, validation) = (samples(1, 5000, 0.1, smooth), samples(2, 3000, 0.1, smooth));
    for trainer in TRAINERS {
        let [one, two] = [1, 2].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| trainer(&train, &validation, &unit_box([true; INPUTS])).unwrap())
        });
        assert_eq!(one, two);
    }
}

#[test]
fn the_seed_with_the_lowest_validation_error_wins_and_the_curves_of_the_others_are_kept() {
    let (train, validation) = (samples(1, 400, 0.2, smooth), samples(2, 400, 0.2, smooth));
    let limits = unit_box([true; INPUTS]);
    let run = |seeds: Vec<u64>| {
        let options = levenberg_marquardt::Options { seeds, max_epochs: 20, ..Default::default() };
        levenberg_marquardt::train(&train, &validation, &limits, &options, SILENT).unwrap()
    };
    let alone: Vec<Trained> = (0..4).map(|seed| run(vec![seed])).collect();
    let best = alone.iter().min_by(|a, b| a.validation_mse().total_cmp(&b.validation_mse())).unwrap();
    let together = run(vec![0, 1, 2, 3]);
    assert_eq!((&together.network, &together.curve, together.seed), (&best.network, &best.curve, best.seed));
    let others = alone.iter().filter(|run| run.seed != best.seed).map(|run| (run.seed, run.curve.clone()));
    assert_eq!(together.others, others.collect::<Vec<_>>());
}

#[test]
fn unused_inputs_have_weight_zero_and_change_nothing() {
    let (mut train, validation) = (samples(1, 600, 0.1, smooth), samples(2, 400, 0.1, smooth));
    let limits = unit_box([true, true, true, false, false]);
    for trainer in TRAINERS {
        let trained = trainer(&train, &validation, &limits).unwrap();
        let first = trained.network.layers().next().unwrap();
        assert!(first.iter().all(|(weights, _)| weights[3] == 0.0 && weights[4] == 0.0 && weights[1] != 0.0));
        let at = |torque, temperature| trained.network.evaluate(&[0.1, -0.2, 0.3, torque, temperature]);
        assert_eq!(at(0.0, 0.0), at(0.9, -1e6));
        train.inputs.iter_mut().for_each(|row| row[3] = 7.0);
        assert_eq!(trainer(&train, &validation, &limits).unwrap(), trained);
    }
}

#[test]
fn every_weight_stays_inside_the_firmwares_format() {
    // With one hidden neuron a step takes a steep weight, and its place a large bias.
    let step = |x: &[f64; INPUTS]| if x[1] > 0.6 { 40.0 } else { -1.0 };
    let (train, validation) = (samples(1, 800, 0.0, step), samples(2, 400, 0.0, step));
    let trained = |bounds, used| {
        let options =
            levenberg_marquardt::Options { hidden: vec![1], decay: 0.0, bounds, max_epochs: 200, ..one_seed(1) };
        levenberg_marquardt::train(&train, &validation, &unit_box(used), &options, SILENT).unwrap().network
    };
    let sum = |(weights, bias): &(&[f64], f64)| weights.iter().map(|w| w.abs()).sum::<f64>() + bias.abs();
    for used in [[false, true, false, false, false], [true; INPUTS]] {
        let free = trained(Bounds::None, used);
        assert!(free.layers().flatten().any(|neuron| sum(&neuron) > 64.0), "the step is too easy: {free:?}");
        let bounded = trained(Bounds::Firmware, used);
        for neuron in bounded.layers().flatten() {
            assert!(sum(&neuron) < 63.0 && neuron.0.iter().all(|w| w.abs() < 32.0), "{neuron:?}");
        }
        assert!(relative_error(&bounded, &validation) < 0.5, "{}", relative_error(&bounded, &validation));
    }
}

#[test]
fn constant_and_zero_targets_are_learned_without_a_division_by_zero() {
    for (constant, limits) in
        [(2.5, unit_box([true; INPUTS])), (0.0, unit_box([true; INPUTS])), (2.5, unit_box([false; INPUTS]))]
    {
        let (train, validation) = (samples(1, 200, 0.0, |_| constant), samples(2, 100, 0.0, |_| constant));
        for trainer in TRAINERS {
            let trained = trainer(&train, &validation, &limits).unwrap();
            let output = trained.network.evaluate(&[0.3; INPUTS]);
            assert!((output - constant).abs() < 0.5, "{output} instead of {constant}");
        }
    }
}

#[test]
fn inputs_without_width_are_left_out() {
    let (mut train, validation) = (samples(1, 400, 0.0, smooth), samples(2, 200, 0.0, smooth));
    train.inputs.iter_mut().for_each(|row| row[4] = 25.0);
    let limits = InputBox::around(&train.inputs, [true; INPUTS]).unwrap();
    for trainer in TRAINERS {
        let trained = trainer(&train, &validation, &limits).unwrap();
        assert!(trained.network.layers().next().unwrap().iter().all(|(weights, _)| weights[4] == 0.0));
        assert!(trained.validation_mse() < 0.5);
    }
}

#[test]
fn samples_of_weight_zero_do_not_exist() {
    let (train, validation) = (samples(1, 300, 0.1, smooth), samples(2, 200, 0.1, smooth));
    let mut with = train.clone();
    for place in [0, 100, 300] {
        with.inputs.insert(place, [0.5; INPUTS]);
        with.targets.insert(place, -1e6);
        with.weights.insert(place, 0.0);
    }
    let limits = unit_box([true; INPUTS]);
    for trainer in TRAINERS {
        assert_eq!(trainer(&with, &validation, &limits).unwrap(), trainer(&train, &validation, &limits).unwrap());
    }
}

#[test]
fn heavy_samples_are_followed_where_samples_disagree() {
    let mut train = samples(1, 400, 0.0, |_| 1.0);
    for i in 0..200 {
        train.targets[i] = -1.0;
        train.weights[i] = 3.0;
    }
    let trained = TRAINERS[0](&train, &train, &unit_box([false, true, false, false, false])).unwrap();
    let mean: f64 = train.inputs.iter().map(|x| trained.network.evaluate(x)).sum::<f64>() / 400.0;
    assert!((mean + 0.5).abs() < 0.15, "{mean}, the weighted mean is -0.5");
}

#[test]
fn every_epoch_of_every_seed_is_reported_as_it_is_in_the_curve() {
    let (train, validation) = (samples(1, 300, 0.1, smooth), samples(2, 200, 0.1, smooth));
    let seen = Mutex::new(Vec::new());
    let progress = |p: Progress| seen.lock().unwrap().push(p);
    let trained = stochastic::train(&train, &validation, &unit_box([true; INPUTS]), &few_passes(), &progress).unwrap();
    let seen = seen.into_inner().unwrap();
    assert_eq!(seen.len(), 2 * 16);
    let of_best: Vec<f64> = seen.iter().filter(|p| p.seed == trained.seed).map(|p| p.validation_mse).collect();
    assert_eq!(of_best, trained.curve.validation_mse);
}

#[test]
fn a_learning_rate_that_diverges_ends_the_run_with_the_best_network_before() {
    let (train, validation) = (samples(1, 300, 0.1, smooth), samples(2, 200, 0.1, smooth));
    let options = stochastic::Options { learning_rate: 1e6, ..few_passes() };
    let trained = stochastic::train(&train, &validation, &unit_box([true; INPUTS]), &options, SILENT).unwrap();
    assert_eq!(trained.curve.stop, Stop::Diverged);
    assert!(trained.validation_mse().is_finite());
}

#[test]
fn sets_and_options_that_make_no_sense_are_refused_by_name() {
    let good = samples(1, 50, 0.0, smooth);
    let limits = unit_box([true; INPUTS]);
    let refused = |train: &TrainingSet, validation: &TrainingSet| {
        TRAINERS.map(|trainer| trainer(train, validation, &limits).unwrap_err().to_string()).concat()
    };
    let empty = TrainingSet::default();
    assert!(refused(&empty, &good).contains("the training set has no sample"));
    assert!(refused(&good, &empty).contains("the validation set has no sample"));
    let mut short = good.clone();
    short.targets.pop();
    assert!(refused(&short, &good).contains("50 rows of inputs, 49 targets"));
    let mut broken = good.clone();
    broken.inputs[7][1] = f64::NAN;
    assert!(refused(&broken, &good).contains("velocity of sample 7 of the training set is NaN"));
    let mut negative = good.clone();
    negative.weights[8] = -1.0;
    assert!(refused(&good, &negative).contains("weight of sample 8 of the validation set is -1"));
    let no_seed = levenberg_marquardt::Options { seeds: vec![], ..Default::default() };
    let refusal = levenberg_marquardt::train(&good, &good, &limits, &no_seed, SILENT).unwrap_err();
    assert!(refusal.to_string().contains("seeds"));
    let no_batch = stochastic::Options { batch_size: 1, ..Default::default() };
    let refusal = stochastic::train(&good, &good, &limits, &no_batch, SILENT).unwrap_err();
    assert!(refusal.to_string().contains("batch_size"));
    let no_layer = levenberg_marquardt::Options { hidden: vec![5, 0], ..Default::default() };
    let refusal = levenberg_marquardt::train(&good, &good, &limits, &no_layer, SILENT).unwrap_err();
    assert_eq!(refusal, TrainError::Network(NetworkError::EmptyLayer(1)));
}
