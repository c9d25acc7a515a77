//! Samples in blocks of fixed length, and the network's value and derivative over a block; host.
//!
//! A block holds each input as one array over its samples, so that every loop of the forward and backward pass is a
//! short multiply-add over such an array, which the compiler vectorises. The last block is filled up with samples of
//! weight zero, which add exactly nothing.

use super::TrainingSet;
use super::tanh::tanh;
use super::wide_vectors::{Loop, on_wide_vectors};
use crate::network::{InputBox, Shape};
use rayon::prelude::*;

/// Samples in a block: the Jacobian of a block (97 columns) stays in the second-level cache.
pub const BLOCK: usize = 64;

/// Blocks in the piece of work that one thread takes. Fixed: sums are formed within pieces and then over them in order.
pub(super) const PIECE: usize = 32;

/// One value of each sample of a block.
pub(super) type Column = [f64; BLOCK];

/// Samples of one block, normalised.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Active inputs in [-1, 1].
    pub(super) inputs: Vec<Column>,
    /// Targets in units of the output scale.
    pub(super) targets: Column,
    /// Square root of the sample's share in the total weight.
    pub(super) root_weights: Column,
}

/// Normalised samples without those of weight zero.
#[derive(Clone, Debug)]
pub struct Batch {
    pub(super) blocks: Vec<Block>,
    samples: usize,
    inputs: usize,
}

impl Batch {
    /// Normalises the inputs of `set` by `input_box` and its targets by `output_scale`; inactive inputs are left out.
    pub fn new(set: &TrainingSet, input_box: &InputBox, output_scale: f64) -> Self {
        let active = input_box.active_inputs();
        let counted: Vec<usize> = (0..set.targets.len()).filter(|&i| set.weights[i] > 0.0).collect();
        let total: f64 = counted.iter().map(|&i| set.weights[i]).sum();
        let blocks = counted
            .chunks(BLOCK)
            .map(|samples| {
                let mut block = Block {
                    inputs: vec![[0.0; BLOCK]; active.len()],
                    targets: [0.0; BLOCK],
                    root_weights: [0.0; BLOCK],
                };
                for (s, &sample) in samples.iter().enumerate() {
                    let normal = input_box.normalise(&set.inputs[sample]);
                    for (column, &input) in block.inputs.iter_mut().zip(&active) {
                        column[s] = normal[input];
                    }
                    block.targets[s] = set.targets[sample] / output_scale;
                    block.root_weights[s] = (set.weights[sample] / total).sqrt();
                }
                block
            })
            .collect();
        Self { blocks, samples: counted.len(), inputs: active.len() }
    }

    /// Number of samples of positive weight.
    pub fn len(&self) -> usize {
        self.samples
    }

    /// True where no sample counts.
    pub fn is_empty(&self) -> bool {
        self.samples == 0
    }

    /// Number of active inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// The block of a sample and its place there.
    pub(super) fn locate(&self, sample: usize) -> (&Block, usize) {
        (&self.blocks[sample / BLOCK], sample % BLOCK)
    }

    /// Weighted mean of squared errors in units of the output scale; the same for any number of threads.
    pub fn mean_squared_error(&self, shape: &Shape, parameters: &[f64]) -> f64 {
        let pieces: Vec<f64> = self
            .blocks
            .par_chunks(PIECE)
            .map(|piece| on_wide_vectors(SquaredError { shape, parameters, piece }))
            .collect();
        pieces.iter().sum()
    }
}

/// Weighted sum of squared errors of a piece of work.
struct SquaredError<'a> {
    shape: &'a Shape,
    parameters: &'a [f64],
    piece: &'a [Block],
}

impl Loop for SquaredError<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let mut pass = Pass::new(self.shape);
        // Not a closure: it would stay with the baseline.
        let mut sum = 0.0;
        for block in self.piece {
            sum += pass.squared_error(self.parameters, block);
        }
        sum
    }
}

/// Working memory of the forward and backward pass over one block.
pub(super) struct Pass<'a> {
    shape: &'a Shape,
    /// Inputs, then the output of every neuron, layer by layer.
    values: Vec<Column>,
    /// Derivative of the weighted network output with respect to every neuron's sum; indices as in `values`.
    slopes: Vec<Column>,
}

impl<'a> Pass<'a> {
    pub(super) fn new(shape: &'a Shape) -> Self {
        let nodes = shape.sizes().iter().sum();
        Self { shape, values: vec![[0.0; BLOCK]; nodes], slopes: vec![[0.0; BLOCK]; nodes] }
    }

    /// Evaluates the network on a block; the output is in units of the output scale.
    #[inline(always)]
    pub(super) fn forward(&mut self, parameters: &[f64], block: &Block) -> &Column {
        let output = self.values.len() - 1;
        self.values[..block.inputs.len()].copy_from_slice(&block.inputs);
        let mut start = 0;
        for layer in self.shape.layers() {
            let (before, after) = self.values.split_at_mut(start + layer.inputs);
            let inputs = &before[start..];
            for (n, sum) in after[..layer.neurons].iter_mut().enumerate() {
                let (weights, bias) = parameters[layer.neuron(n)..].split_at(layer.inputs);
                *sum = [bias[0]; BLOCK];
                for (&weight, input) in weights.iter().zip(inputs) {
                    for s in 0..BLOCK {
                        sum[s] += weight * input[s];
                    }
                }
                if start + layer.inputs != output {
                    for value in sum.iter_mut() {
                        *value = tanh(*value);
                    }
                }
            }
            start += layer.inputs;
        }
        &self.values[output]
    }

    /// Weighted sum of squared errors of a block.
    #[inline(always)]
    pub(super) fn squared_error(&mut self, parameters: &[f64], block: &Block) -> f64 {
        self.forward(parameters, block);
        self.weighted_errors(block).iter().map(|error| error * error).sum()
    }

    /// Weighted errors of the block that was evaluated last.
    #[inline(always)]
    pub(super) fn weighted_errors(&self, block: &Block) -> Column {
        let output = &self.values[self.values.len() - 1];
        std::array::from_fn(|s| (output[s] - block.targets[s]) * block.root_weights[s])
    }

    /// Derivatives of the weighted errors of the block that was evaluated last, by back-propagation.
    ///
    /// `store` receives the index of a parameter, the slope of its neuron's sum, and the value it is multiplied with
    /// (nothing for a bias): the derivative is the product of both.
    #[inline(always)]
    pub(super) fn backward(
        &mut self,
        parameters: &[f64],
        block: &Block,
        mut store: impl FnMut(usize, &Column, Option<&Column>),
    ) {
        let mut end = self.values.len();
        self.slopes[end - 1] = block.root_weights;
        for layer in self.shape.layers().rev() {
            let first = end - layer.neurons;
            let start = first - layer.inputs;
            let (before, after) = self.slopes.split_at_mut(first);
            let slopes = &after[..layer.neurons];
            for (n, slope) in slopes.iter().enumerate() {
                for (i, value) in self.values[start..first].iter().enumerate() {
                    store(layer.neuron(n) + i, slope, Some(value));
                }
                store(layer.neuron(n) + layer.inputs, slope, None);
            }
            if start > 0 {
                for (i, (back, value)) in before[start..].iter_mut().zip(&self.values[start..first]).enumerate() {
                    *back = [0.0; BLOCK];
                    for (n, slope) in slopes.iter().enumerate() {
                        let weight = parameters[layer.neuron(n) + i];
                        for s in 0..BLOCK {
                            back[s] += weight * slope[s];
                        }
                    }
                    for s in 0..BLOCK {
                        back[s] *= 1.0 - value[s] * value[s];
                    }
                }
            }
            end = first;
        }
    }
}
