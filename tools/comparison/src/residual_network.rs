//! Residual network of 000 (section 3.2, table 3.1): one hidden layer of 16 tanh neurons for all joints at once, on
//! the torque that the rigid bodies leave; host.
//!
//! Levenberg-Marquardt with at most 1000 epochs, gradient threshold 1e-7 and mu limit 1e10 as in table 3.1. The paper
//! leaves the rest at the defaults of its toolbox (MATLAB's feedforwardnet), which are followed: inputs and targets
//! scaled to [-1, 1], weights drawn after Nguyen and Widrow, a stop after six epochs without a lower error on the
//! validation samples, and the weights of the least one. One departure: errors are summed over scaled targets, so that
//! every joint counts alike; the toolbox sums them in units of torque.
//!
//! The firmware's own networks ([`identification::network`]) have five inputs and one output: none of them sees a
//! joint's neighbours.

use identification::levenberg_marquardt::{Damping, LeastSquares, NormalEquations, Options, Stop, minimise};
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::ops::ControlFlow;

/// Neurons of the hidden layer.
pub const NEURONS: usize = 16;
/// Shares of training and validation; the rest judges.
pub const SHARES: [f64; 2] = [0.5, 0.2];
/// Epochs without a lower validation error after which training stops.
const PATIENCE: usize = 6;

/// Samples for training, validation and test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// Samples that the weights are fitted to.
    pub training: Vec<usize>,
    /// Samples that end the training.
    pub validation: Vec<usize>,
    /// Samples that judge.
    pub test: Vec<usize>,
}

/// A part of a split without samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no samples for {0}")]
pub struct EmptyPart(pub &'static str);

impl Split {
    /// Random split of single samples (000, section 3.2). Neighbours in time come to lie on both sides of it.
    ///
    /// # Errors
    /// Too few samples for three parts.
    pub fn random(samples: &[usize], seed: u64) -> Result<Self, EmptyPart> {
        let mut all = samples.to_vec();
        all.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
        let share = |share: f64| (share * samples.len() as f64).round() as usize;
        let mut validation = all.split_off(share(SHARES[0]));
        let test = validation.split_off(share(SHARES[1]).min(validation.len()));
        let split = Self { training: all, validation, test };
        for (part, name) in [(&split.training, "training"), (&split.validation, "validation"), (&split.test, "test")] {
            if part.is_empty() {
                return Err(EmptyPart(name));
            }
        }
        Ok(split)
    }
}

/// Scaling of each column to [-1, 1]; a column without width becomes 0.
#[derive(Clone, Debug)]
struct Scaling {
    middle: Vec<f64>,
    half: Vec<f64>,
}

impl Scaling {
    fn of(matrix: &DMatrix<f64>, samples: &[usize]) -> Self {
        let ends = |column: usize| {
            let values = samples.iter().map(|&i| matrix[(i, column)]);
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        };
        let all: Vec<(f64, f64)> = (0..matrix.ncols()).map(ends).collect();
        let middle = all.iter().map(|(low, high)| 0.5 * (low + high)).collect();
        Self { middle, half: all.iter().map(|(low, high)| 0.5 * (high - low)).collect() }
    }

    fn apply(&self, value: f64, column: usize) -> f64 {
        if self.half[column] > 0.0 { (value - self.middle[column]) / self.half[column] } else { 0.0 }
    }

    fn undo(&self, value: f64, column: usize) -> f64 {
        self.middle[column] + self.half[column] * value
    }

    /// Scaled rows of these samples.
    fn rows(&self, matrix: &DMatrix<f64>, samples: &[usize]) -> DMatrix<f64> {
        DMatrix::from_fn(samples.len(), matrix.ncols(), |row, column| {
            self.apply(matrix[(samples[row], column)], column)
        })
    }
}

/// Mean of squared errors of the network over scaled samples, as a function of its weights.
///
/// Weights in one vector: neuron after neuron its inputs' weights and its bias, then output after output its neurons'
/// weights and its bias.
struct Task {
    /// Samples x (inputs + 1); the last column is 1.
    inputs: DMatrix<f64>,
    /// Samples x outputs.
    targets: DMatrix<f64>,
}

impl Task {
    fn new(inputs: &DMatrix<f64>, targets: DMatrix<f64>) -> Self {
        Self { inputs: with_ones(inputs), targets }
    }

    fn weights(&self) -> usize {
        NEURONS * self.inputs.ncols() + self.targets.ncols() * (NEURONS + 1)
    }

    /// Weights of the hidden layer, (inputs + 1) x neurons, and of the outputs, (neurons + 1) x outputs.
    fn layers(&self, x: &DVector<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let hidden = NEURONS * self.inputs.ncols();
        let first = DMatrix::from_column_slice(self.inputs.ncols(), NEURONS, &x.as_slice()[..hidden]);
        (first, DMatrix::from_column_slice(NEURONS + 1, self.targets.ncols(), &x.as_slice()[hidden..]))
    }

    /// Outputs of the neurons with a column of ones, and of the network.
    fn outputs(&self, x: &DVector<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let (first, second) = self.layers(x);
        let neurons = with_ones(&(&self.inputs * first).map(f64::tanh));
        let outputs = &neurons * second;
        (neurons, outputs)
    }

    fn count(&self) -> f64 {
        (self.targets.len() as f64).max(1.0)
    }
}

impl LeastSquares for Task {
    fn cost(&self, x: &DVector<f64>) -> f64 {
        (self.outputs(x).1 - &self.targets).norm_squared() / self.count()
    }

    /// Row of the Jacobian of output o: V_oh tanh'_h x_i by the weight of input i to neuron h, z_h by the output's own
    /// weights. Its square is therefore (V^T V)_hk times sums that no output enters: one product of matrices does for
    /// all outputs.
    fn normal_equations(&self, x: &DVector<f64>) -> NormalEquations {
        let (width, hidden) = (self.inputs.ncols(), NEURONS * self.inputs.ncols());
        let (neurons, outputs) = self.outputs(x);
        let second = self.layers(x).1;
        let own = second.rows(0, NEURONS);
        let error = outputs - &self.targets;
        let slopes = neurons.columns(0, NEURONS).map(|z| 1.0 - z * z);
        let behind = (&error * own.transpose()).component_mul(&slopes);
        let inner = self.inputs.transpose() * behind;
        let outer = neurons.transpose() * &error;
        let gradient: Vec<f64> = inner.iter().chain(outer.iter()).copied().collect();

        let mut sensitivity = DMatrix::zeros(self.inputs.nrows(), hidden + NEURONS + 1);
        for neuron in 0..NEURONS {
            for input in 0..width {
                let mut column = sensitivity.column_mut(neuron * width + input);
                column.copy_from(&self.inputs.column(input));
                column.component_mul_assign(&slopes.column(neuron));
            }
        }
        sensitivity.columns_mut(hidden, NEURONS + 1).copy_from(&neurons);
        let sums = sensitivity.transpose() * &sensitivity;
        let products = own * own.transpose();
        let mut hessian = DMatrix::zeros(self.weights(), self.weights());
        for column in 0..hidden {
            for row in 0..hidden {
                hessian[(row, column)] = sums[(row, column)] * products[(row / width, column / width)];
            }
        }
        for output in 0..self.targets.ncols() {
            let first = hidden + output * (NEURONS + 1);
            for neuron in 0..=NEURONS {
                let column = first + neuron;
                for row in 0..hidden {
                    let cross = sums[(row, hidden + neuron)] * own[(row / width, output)];
                    hessian[(row, column)] = cross;
                    hessian[(column, row)] = cross;
                }
                (0..=NEURONS).for_each(|k| hessian[(first + k, column)] = sums[(hidden + k, hidden + neuron)]);
            }
        }
        let count = self.count();
        let gradient = DVector::from_vec(gradient) / count;
        NormalEquations { cost: error.norm_squared() / count, gradient, hessian: hessian / count }
    }
}

fn with_ones(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    matrix.clone().insert_column(matrix.ncols(), 1.0)
}

/// A trained network.
#[derive(Clone, Debug)]
pub struct Network {
    inputs: Scaling,
    outputs: Scaling,
    weights: DVector<f64>,
    /// Mean squared error of the scaled validation samples at first and after every epoch.
    pub validation: Vec<f64>,
    /// Reason for the end of the training; [`Stop::Caller`]: the validation error.
    pub stop: Stop,
}

impl Network {
    /// Trains on the rows `training` of `inputs` and `targets` (samples x values); the rows `validation` end it.
    ///
    /// # Errors
    /// A part without samples.
    pub fn train(
        inputs: &DMatrix<f64>,
        targets: &DMatrix<f64>,
        training: &[usize],
        validation: &[usize],
        seed: u64,
    ) -> Result<Self, EmptyPart> {
        for (part, name) in [(training, "training"), (validation, "validation")] {
            if part.is_empty() {
                return Err(EmptyPart(name));
            }
        }
        let (scaled, wanted) = (Scaling::of(inputs, training), Scaling::of(targets, training));
        let task = |samples: &[usize]| Task::new(&scaled.rows(inputs, samples), wanted.rows(targets, samples));
        let (fitted, watched) = (task(training), task(validation));
        let start = first_weights(inputs.ncols(), targets.ncols(), &mut ChaCha8Rng::seed_from_u64(seed));
        let options = Options {
            max_iterations: 1000,
            gradient_tolerance: 1e-7,
            cost_tolerance: 0.0,
            mu_initial: 1e-3,
            mu_max: 1e10,
            damping: Damping::Identity,
            bounds: vec![],
        };
        let (mut best, mut weights, mut waited) = (watched.cost(&start), start.clone(), 0);
        let mut errors = vec![best];
        let solution = minimise(&fitted, &start, &options, |_, x, _| {
            let error = watched.cost(x);
            errors.push(error);
            if error < best {
                (best, weights, waited) = (error, x.clone(), 0);
            } else {
                waited += 1;
            }
            if waited < PATIENCE { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        Ok(Self { inputs: scaled, outputs: wanted, weights, validation: errors, stop: solution.stop })
    }

    /// Outputs of all rows of `inputs`, in the targets' units.
    pub fn predict(&self, inputs: &DMatrix<f64>) -> DMatrix<f64> {
        let all: Vec<usize> = (0..inputs.nrows()).collect();
        let targets = DMatrix::zeros(inputs.nrows(), self.outputs.half.len());
        let task = Task::new(&self.inputs.rows(inputs, &all), targets);
        let outputs = task.outputs(&self.weights).1;
        DMatrix::from_fn(outputs.nrows(), outputs.ncols(), |row, column| {
            self.outputs.undo(outputs[(row, column)], column)
        })
    }
}

/// First weights: each neuron's in a random direction of length 0.7 H^(1/n), biases within that; outputs small.
fn first_weights(inputs: usize, outputs: usize, random: &mut ChaCha8Rng) -> DVector<f64> {
    let length = 0.7 * (NEURONS as f64).powf(1.0 / inputs.max(1) as f64);
    let mut weights: Vec<f64> = Vec::new();
    for _ in 0..NEURONS {
        let direction = DVector::from_fn(inputs, |_, _| random.random_range(-1.0..1.0));
        weights.extend((direction.normalize() * length).iter());
        weights.push(random.random_range(-length..length));
    }
    weights.extend((0..outputs * (NEURONS + 1)).map(|_| random.random_range(-0.1..0.1)));
    DVector::from_vec(weights)
}

#[cfg(test)]
mod tests;
