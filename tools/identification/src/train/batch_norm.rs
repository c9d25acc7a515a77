//! A network with batch normalisation before each dense layer, and how it folds into one without; host.
//!
//! The mobile-robot paper's module is batch normalisation, dense layer, activation (section 2.2.3, figure 3). Every
//! value that enters a dense layer is standardised, x' = gain (x - mean) / sqrt(variance + epsilon) + shift: in a
//! training step with the mean and variance of the mini-batch (S. Ioffe and C. Szegedy, 2015, algorithm 1), in use with
//! fixed ones. A standardisation with fixed statistics is a linear map, so it disappears into the weights and bias of
//! the dense layer behind it; the firmware never sees it.

use super::batch::Batch;
use super::tanh::tanh;
use super::weights::Bounds;
use crate::network::{LayerShape, Shape};

/// Added to every variance, as in the framework that the paper used.
const EPSILON: f64 = 1e-5;

/// Dense layers with a standardisation of every value that enters one.
///
/// The per-value vectors are ordered inputs first, then the neurons of each hidden layer.
#[derive(Clone, Debug)]
pub struct BatchNormNetwork {
    shape: Shape,
    /// Weights and biases in the order of [`Shape`].
    dense: Vec<f64>,
    gain: Vec<f64>,
    shift: Vec<f64>,
    mean: Vec<f64>,
    variance: Vec<f64>,
}

/// The derivative of a mini-batch's loss.
#[derive(Clone, Debug)]
pub struct Gradient {
    /// Derivative with respect to weights and biases.
    pub dense: Vec<f64>,
    /// Derivative with respect to the gains.
    pub gain: Vec<f64>,
    /// Derivative with respect to the shifts.
    pub shift: Vec<f64>,
}

/// Samples of one step, column by column.
#[derive(Clone, Debug, Default)]
pub struct MiniBatch {
    /// One column for each active input.
    inputs: Vec<Vec<f64>>,
    targets: Vec<f64>,
    /// Weights relative to their mean.
    weights: Vec<f64>,
}

impl MiniBatch {
    /// Gathers `samples` (indices below the batch's length).
    pub fn gather(batch: &Batch, samples: &[usize]) -> Self {
        let mut gathered = Self { inputs: vec![Vec::with_capacity(samples.len()); batch.inputs()], ..Self::default() };
        for &sample in samples {
            let (block, s) = batch.locate(sample);
            for (column, values) in gathered.inputs.iter_mut().zip(&block.inputs) {
                column.push(values[s]);
            }
            gathered.targets.push(block.targets[s]);
            gathered.weights.push(block.root_weights[s].powi(2) * batch.len() as f64);
        }
        gathered
    }
}

/// Values that the forward pass of one layer leaves for the backward pass.
struct LayerTrace {
    layer: LayerShape,
    /// Index of the layer's first input among all values.
    first: usize,
    standardised: Vec<Vec<f64>>,
    inverse_deviation: Vec<f64>,
    /// Inputs of the dense layer.
    entered: Vec<Vec<f64>>,
    output: Vec<Vec<f64>>,
}

impl BatchNormNetwork {
    /// A network of `shape` with the weights and biases `dense` that standardises nothing yet.
    pub fn new(shape: &Shape, dense: Vec<f64>) -> Self {
        let values = shape.sizes().iter().sum::<usize>() - 1;
        let (gain, shift, mean, variance) =
            (vec![1.0; values], vec![0.0; values], vec![0.0; values], vec![1.0; values]);
        Self { shape: shape.clone(), dense, gain, shift, mean, variance }
    }

    /// The layers and the index of their first input among all values.
    fn layers(&self) -> impl DoubleEndedIterator<Item = (LayerShape, usize)> {
        let mut first = 0;
        let layers: Vec<_> = self
            .shape
            .layers()
            .map(|layer| {
                let start = first;
                first += layer.inputs;
                (layer, start)
            })
            .collect();
        layers.into_iter()
    }

    fn is_output(&self, first: usize, layer: LayerShape) -> bool {
        first + layer.inputs == self.gain.len()
    }

    /// Sets the fixed statistics to those of all samples of `batch`, layer after layer, each behind folded ones.
    ///
    /// Frameworks carry a running average over the last mini-batches instead; that one lags behind the weights and
    /// depends on the order of the samples, while these are the statistics of the network that is returned.
    pub fn measure_statistics(&mut self, batch: &Batch, bounds: Bounds) {
        let all: Vec<usize> = (0..batch.len()).collect();
        let mut values = MiniBatch::gather(batch, &all).inputs;
        let layers: Vec<_> = self.layers().collect();
        for (layer, first) in layers {
            for (i, column) in values.iter().enumerate() {
                (self.mean[first + i], self.variance[first + i]) = mean_and_variance(column);
            }
            if self.is_output(first, layer) {
                break;
            }
            let folded = self.fold_layer(layer, first, bounds);
            values = dense_layer(layer, &folded, &values, batch.len(), true);
        }
    }

    /// Weights and biases of the network without standardisation that has the same output, as far as `bounds` allow.
    ///
    /// A value that hardly varies gets a huge weight from standardisation, with a huge bias against it. Where that
    /// would leave the bounds, the weight is reduced about the value's mean, and then the neuron's weights
    /// together: the neuron keeps what it has on average and loses steepness.
    pub fn fold(&self, bounds: Bounds) -> Vec<f64> {
        self.layers().flat_map(|(layer, first)| self.fold_layer(layer, first, bounds)).collect()
    }

    fn fold_layer(&self, layer: LayerShape, first: usize, bounds: Bounds) -> Vec<f64> {
        let mut folded = Vec::with_capacity(layer.neurons * (layer.inputs + 1));
        for n in 0..layer.neurons {
            let (weights, bias) = self.dense[layer.neuron(n)..].split_at(layer.inputs);
            let start = folded.len();
            let mut average = bias[0];
            let mut from_mean = 0.0;
            for (i, weight) in weights.iter().enumerate() {
                let v = first + i;
                let limit = bounds.weight();
                let steep = (weight * self.gain[v] / (self.variance[v] + EPSILON).sqrt()).clamp(-limit, limit);
                folded.push(steep);
                average += weight * self.shift[v];
                from_mean += steep * self.mean[v];
            }
            let average = average.clamp(-bounds.neuron_sum(), bounds.neuron_sum());
            let steepness = folded[start..].iter().map(|w| w.abs()).sum::<f64>() + from_mean.abs();
            let room = bounds.neuron_sum() - average.abs();
            let share = if steepness > room { room / steepness } else { 1.0 };
            folded[start..].iter_mut().for_each(|weight| *weight *= share);
            folded.push(average - share * from_mean);
        }
        folded
    }

    /// Weighted mean squared error of a mini-batch, standardised with its own statistics, and its derivative.
    pub fn loss_and_gradient(&self, batch: &MiniBatch) -> (f64, Gradient) {
        let samples = batch.targets.len();
        let traces = self.trace(batch);
        let mut gradient = Gradient {
            dense: vec![0.0; self.dense.len()],
            gain: vec![0.0; self.gain.len()],
            shift: vec![0.0; self.shift.len()],
        };
        let output = traces.last().map_or(&[][..], |trace| &trace.output[0]);
        let errors = output.iter().zip(&batch.targets).zip(&batch.weights);
        let loss = errors.clone().map(|((y, t), w)| w * (y - t).powi(2)).sum::<f64>() / samples as f64;
        let mut slopes = vec![errors.map(|((y, t), w)| 2.0 * w * (y - t) / samples as f64).collect::<Vec<_>>()];
        for (l, trace) in traces.iter().enumerate().rev() {
            let before = l.checked_sub(1).map(|below| &traces[below].output);
            slopes = self.back_propagate(trace, &slopes, before, &mut gradient);
        }
        (loss, gradient)
    }

    fn trace(&self, batch: &MiniBatch) -> Vec<LayerTrace> {
        let mut traces: Vec<LayerTrace> = Vec::with_capacity(self.shape.sizes().len());
        for (layer, first) in self.layers() {
            let values = traces.last().map_or(&batch.inputs, |below| &below.output);
            let mut inverse_deviation = Vec::with_capacity(layer.inputs);
            let mut standardised = Vec::with_capacity(layer.inputs);
            let mut entered = Vec::with_capacity(layer.inputs);
            for (i, column) in values.iter().enumerate() {
                let (mean, variance) = mean_and_variance(column);
                let inverse = 1.0 / (variance + EPSILON).sqrt();
                let standard: Vec<f64> = column.iter().map(|x| (x - mean) * inverse).collect();
                entered.push(standard.iter().map(|x| self.gain[first + i] * x + self.shift[first + i]).collect());
                standardised.push(standard);
                inverse_deviation.push(inverse);
            }
            let parameters = &self.dense[layer.offset..];
            let hidden = !self.is_output(first, layer);
            let output = dense_layer(layer, parameters, &entered, batch.targets.len(), hidden);
            traces.push(LayerTrace { layer, first, standardised, inverse_deviation, entered, output });
        }
        traces
    }

    /// Adds one layer's derivatives and returns the slopes of the sums of the layer before (`before`: its tanh
    /// outputs).
    fn back_propagate(
        &self,
        trace: &LayerTrace,
        slopes: &[Vec<f64>],
        before: Option<&Vec<Vec<f64>>>,
        gradient: &mut Gradient,
    ) -> Vec<Vec<f64>> {
        let LayerTrace { layer, first, .. } = *trace;
        for (n, slope) in slopes.iter().enumerate() {
            for (i, value) in trace.entered.iter().enumerate() {
                gradient.dense[layer.neuron(n) + i] = dot(slope, value);
            }
            gradient.dense[layer.neuron(n) + layer.inputs] = slope.iter().sum();
        }
        let mut back = Vec::with_capacity(layer.inputs);
        for (i, standard) in trace.standardised.iter().enumerate() {
            let samples = standard.len() as f64;
            let mut column = vec![0.0; standard.len()];
            for (n, slope) in slopes.iter().enumerate() {
                add_scaled(&mut column, self.dense[layer.neuron(n) + i], slope);
            }
            let (along, total) = (dot(&column, standard), column.iter().sum::<f64>());
            gradient.gain[first + i] = along;
            gradient.shift[first + i] = total;
            if let Some(before) = before {
                let factor = self.gain[first + i] * trace.inverse_deviation[i];
                for ((slope, x), y) in column.iter_mut().zip(standard).zip(&before[i]) {
                    *slope = factor * (*slope - (total + x * along) / samples) * (1.0 - y * y);
                }
                back.push(column);
            }
        }
        back
    }

    /// One step of steepest descent.
    pub fn descend(&mut self, gradient: &Gradient, rate: f64) {
        add_scaled(&mut self.dense, -rate, &gradient.dense);
        add_scaled(&mut self.gain, -rate, &gradient.gain);
        add_scaled(&mut self.shift, -rate, &gradient.shift);
    }
}

/// One dense layer over columns of `samples` values; `parameters` starts with the layer's first weight.
fn dense_layer(
    layer: LayerShape,
    parameters: &[f64],
    values: &[Vec<f64>],
    samples: usize,
    hidden: bool,
) -> Vec<Vec<f64>> {
    let neurons = parameters.chunks_exact(layer.inputs + 1).take(layer.neurons);
    neurons
        .map(|neuron| {
            let mut sum = vec![neuron[layer.inputs]; samples];
            for (&weight, column) in neuron.iter().zip(values) {
                add_scaled(&mut sum, weight, column);
            }
            if hidden {
                sum.iter_mut().for_each(|value| *value = tanh(*value));
            }
            sum
        })
        .collect()
}

fn mean_and_variance(column: &[f64]) -> (f64, f64) {
    let count = column.len() as f64;
    let mean = column.iter().sum::<f64>() / count;
    (mean, column.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add_scaled(sum: &mut [f64], factor: f64, values: &[f64]) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::{INPUTS, InputBox};
    use crate::train::TrainingSet;
    use crate::train::weights::nguyen_widrow;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    impl BatchNormNetwork {
        /// The output for normalised active inputs, with the fixed statistics; unit: the output scale.
        fn evaluate(&self, inputs: &[f64]) -> f64 {
            let mut values = inputs.to_vec();
            for (layer, first) in self.layers() {
                for (i, value) in values.iter_mut().enumerate() {
                    let v = first + i;
                    let standard = (*value - self.mean[v]) / (self.variance[v] + EPSILON).sqrt();
                    *value = self.gain[v] * standard + self.shift[v];
                }
                let neuron = |n| {
                    let (weights, bias) = self.dense[layer.neuron(n)..].split_at(layer.inputs);
                    let sum = bias[0] + weights.iter().zip(&values).map(|(w, v)| w * v).sum::<f64>();
                    if self.is_output(first, layer) { sum } else { tanh(sum) }
                };
                values = (0..layer.neurons).map(neuron).collect();
            }
            values[0]
        }
    }

    fn samples(count: usize) -> Batch {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let inputs: Vec<[f64; INPUTS]> =
            (0..count).map(|_| std::array::from_fn(|_| random.random_range(-1.0..1.0))).collect();
        let targets = inputs.iter().map(|x| (3.0 * x[1]).tanh() + x[0] * x[2]).collect();
        let weights = (0..count).map(|i| (i % 4) as f64).collect();
        let set = TrainingSet { inputs, targets, weights };
        let limits = InputBox::new([-1.0; INPUTS], [1.0; INPUTS], [true, true, true, false, true]).unwrap();
        Batch::new(&set, &limits, 0.7)
    }

    fn network(batch: &Batch) -> BatchNormNetwork {
        let mut random = ChaCha8Rng::seed_from_u64(6);
        let shape = Shape::new(batch.inputs(), &[4, 3]).unwrap();
        let mut network = BatchNormNetwork::new(&shape, nguyen_widrow(&shape, &mut random));
        network.gain.iter_mut().for_each(|gain| *gain = random.random_range(0.3..2.0));
        network.shift.iter_mut().for_each(|shift| *shift = random.random_range(-0.5..0.5));
        network
    }

    #[test]
    fn every_derivative_agrees_with_finite_differences() {
        let batch = samples(60);
        let mini = MiniBatch::gather(&batch, &(0..batch.len()).collect::<Vec<_>>());
        let network = network(&batch);
        let (_, gradient) = network.loss_and_gradient(&mini);
        let h = 1e-5;
        let difference = |change: &dyn Fn(&mut BatchNormNetwork, f64)| {
            let [up, down] = [h, -h].map(|h| {
                let mut moved = network.clone();
                change(&mut moved, h);
                moved.loss_and_gradient(&mini).0
            });
            (up - down) / (2.0 * h)
        };
        for i in 0..gradient.dense.len() {
            let expected = difference(&|n, h| n.dense[i] += h);
            assert!((gradient.dense[i] - expected).abs() < 1e-8, "weight {i}: {} {expected}", gradient.dense[i]);
        }
        for i in 0..gradient.gain.len() {
            let (gain, shift) = (difference(&|n, h| n.gain[i] += h), difference(&|n, h| n.shift[i] += h));
            assert!((gradient.gain[i] - gain).abs() < 1e-8, "gain {i}: {} {gain}", gradient.gain[i]);
            assert!((gradient.shift[i] - shift).abs() < 1e-8, "shift {i}: {} {shift}", gradient.shift[i]);
        }
    }

    #[test]
    fn the_folded_network_has_the_same_output_on_every_sample_to_1e_12() {
        let batch = samples(3000);
        let mut network = network(&batch);
        network.measure_statistics(&batch, Bounds::None);
        let plain = BatchNormNetwork {
            variance: vec![1.0 - EPSILON; network.gain.len()],
            ..BatchNormNetwork::new(&network.shape, network.fold(Bounds::None))
        };
        for sample in 0..batch.len() {
            let (block, s) = batch.locate(sample);
            let inputs: Vec<f64> = block.inputs.iter().map(|column| column[s]).collect();
            let (with, without) = (network.evaluate(&inputs), plain.evaluate(&inputs));
            assert!((with - without).abs() < 1e-12, "sample {sample}: {with} {without}");
        }
    }

    #[test]
    fn measured_statistics_are_those_of_the_one_mini_batch_that_holds_every_sample() {
        let batch = samples(500);
        let mini = MiniBatch::gather(&batch, &(0..batch.len()).collect::<Vec<_>>());
        let mut network = network(&batch);
        network.measure_statistics(&batch, Bounds::None);
        let output = network.trace(&mini).pop().unwrap().output.remove(0);
        for (sample, expected) in output.iter().enumerate() {
            let inputs: Vec<f64> = mini.inputs.iter().map(|column| column[sample]).collect();
            assert!((network.evaluate(&inputs) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn a_value_that_hardly_varies_is_folded_inside_the_bounds_without_moving_the_average() {
        let batch = samples(500);
        let shape = Shape::new(batch.inputs(), &[3]).unwrap();
        let mut network = BatchNormNetwork::new(&shape, vec![0.9; shape.parameter_count()]);
        // Neurons of the hidden layer close to saturation.
        for n in 0..3 {
            network.dense[5 * n + 4] = 5.0;
        }
        network.measure_statistics(&batch, Bounds::Firmware);
        let (free, bounded) = (network.fold(Bounds::None), network.fold(Bounds::Firmware));
        let sum = |neuron: &[f64]| neuron.iter().map(|p| p.abs()).sum::<f64>();
        assert!(sum(&free[15..]) > 64.0, "{free:?}");
        assert!(sum(&bounded[15..]) <= Bounds::Firmware.neuron_sum() + 1e-9, "{bounded:?}");
        let mean: f64 = (0..3).map(|n| bounded[15 + n] * network.mean[4 + n]).sum();
        assert!((mean + bounded[18] - 0.9).abs() < 1e-9, "{bounded:?}");
    }
}
