//! Fully connected network with its derivatives by the positions, and the gradient of both by its weights; host.
//!
//! A batch of B samples is one matrix of (1 + n) B columns: B columns of values, then for each of the n positions B
//! columns of derivatives by it (tangents). A layer z = W h + b, h' = f(z) maps a tangent t to f'(z) W t, so one
//! product of matrices carries values and derivatives. In reverse, with adjoints g of h' and g_k of its tangents, and
//! u_k = W t_k: adjoint of z = f'(z) g + f''(z) sum of u_k g_k, adjoint of u_k = f'(z) g_k.

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// Nonlinearity of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// Hyperbolic tangent.
    Tanh,
    /// ln(1 + e^x).
    Softplus,
    /// Sine.
    Sine,
}

impl Activation {
    /// Value, first and second derivative.
    pub fn at(self, x: f64) -> [f64; 3] {
        match self {
            Self::Tanh => {
                let y = x.tanh();
                let slope = 1.0 - y * y;
                [y, slope, -2.0 * y * slope]
            }
            Self::Softplus => {
                let slope = 1.0 / (1.0 + (-x).exp());
                [x.max(0.0) + (-x.abs()).exp().ln_1p(), slope, slope * (1.0 - slope)]
            }
            Self::Sine => {
                let (sine, cosine) = x.sin_cos();
                [sine, cosine, -sine]
            }
        }
    }
}

/// Widths and nonlinearities; the weights are kept apart, layer by layer: W by columns, then b.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Network {
    /// Width of the inputs.
    pub inputs: usize,
    /// Width and nonlinearity of each hidden layer.
    pub hidden: Vec<(usize, Activation)>,
    /// Width of the outputs, which are linear.
    pub outputs: usize,
}

/// A pass forward, as the pass back needs it.
#[derive(Clone, Debug)]
pub struct Pass {
    /// Samples.
    samples: usize,
    /// Inputs of each layer.
    inputs: Vec<DMatrix<f64>>,
    /// Sums W h + b of each hidden layer, and their tangents.
    sums: Vec<DMatrix<f64>>,
    /// Values and derivatives of each hidden layer's nonlinearity.
    derivatives: Vec<Vec<[f64; 3]>>,
    /// Outputs and their tangents.
    pub outputs: DMatrix<f64>,
}

impl Network {
    /// Widths (inputs, outputs) of each layer, and the place of its weights.
    fn layers(&self) -> impl Iterator<Item = (usize, usize, usize)> + use<> {
        let mut widths = vec![self.inputs];
        widths.extend(self.hidden.iter().map(|(width, _)| *width));
        widths.push(self.outputs);
        let mut place = 0;
        (1..widths.len()).map(move |layer| {
            let (from, to, begin) = (widths[layer - 1], widths[layer], place);
            place += (from + 1) * to;
            (from, to, begin)
        })
    }

    /// Number of weights.
    pub fn len(&self) -> usize {
        self.layers().map(|(from, to, _)| (from + 1) * to).sum()
    }

    /// True without a weight.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// True for each weight of a matrix, false for a bias.
    pub fn matrices(&self) -> impl Iterator<Item = bool> + use<> {
        self.layers().flat_map(|(from, to, _)| (0..(from + 1) * to).map(move |i| i < from * to))
    }

    /// True for each weight of the last layer, biases included.
    pub fn output_layer(&self) -> impl Iterator<Item = bool> + use<> {
        let last = self.hidden.len();
        self.layers()
            .enumerate()
            .flat_map(move |(layer, (from, to, _))| (0..(from + 1) * to).map(move |_| layer == last))
    }

    /// Random weights: normal with variance 1 / inputs of the layer; biases likewise with variance 1.
    pub fn random(&self, random: &mut impl Rng) -> Vec<f64> {
        let mut weights = Vec::with_capacity(self.len());
        for (from, to, _) in self.layers() {
            let deviation = (from as f64).sqrt().recip();
            let mut normal = || -> f64 { StandardNormal.sample(random) };
            weights.extend((0..from * to).map(|_| deviation * normal()));
            weights.extend((0..to).map(|_| normal()));
        }
        // Outputs begin without a bias.
        let end = weights.len();
        weights[end - self.outputs..].fill(0.0);
        weights
    }

    /// Values and tangents of the outputs, of a batch of `samples`.
    pub fn forward(&self, weights: &[f64], samples: usize, inputs: DMatrix<f64>) -> Pass {
        let (mut layers, mut sums, mut derivatives, mut next) = (Vec::new(), Vec::new(), Vec::new(), inputs);
        for (layer, (from, to, begin)) in self.layers().enumerate() {
            let matrix = DMatrixView::from_slice(&weights[begin..begin + from * to], to, from);
            let bias = &weights[begin + from * to..begin + (from + 1) * to];
            let mut sum = matrix * &next;
            for sample in 0..samples {
                sum.column_mut(sample).iter_mut().zip(bias).for_each(|(sum, bias)| *sum += bias);
            }
            layers.push(next);
            let Some((_, activation)) = self.hidden.get(layer) else {
                return Pass { samples, inputs: layers, sums, derivatives, outputs: sum };
            };
            let (values, tangents) = sum.as_slice().split_at(to * samples);
            let slopes: Vec<[f64; 3]> = values.iter().map(|value| activation.at(*value)).collect();
            let mut activated: Vec<f64> = slopes.iter().map(|[value, ..]| *value).collect();
            for tangent in tangents.chunks_exact(to * samples) {
                activated.extend(tangent.iter().zip(&slopes).map(|(tangent, [_, slope, _])| slope * tangent));
            }
            next = DMatrix::from_vec(to, sum.ncols(), activated);
            derivatives.push(slopes);
            sums.push(sum);
        }
        unreachable!("there is always a layer of outputs")
    }

    /// Adds the gradient by the weights to `gradient`, from adjoints of the outputs and their tangents.
    pub fn backward(&self, weights: &[f64], pass: &Pass, adjoint: DMatrix<f64>, gradient: &mut [f64]) {
        let mut adjoint = adjoint;
        let layers: Vec<_> = self.layers().collect();
        for (layer, &(from, to, begin)) in layers.iter().enumerate().rev() {
            if let Some(derivatives) = pass.derivatives.get(layer) {
                let block = to * pass.samples;
                let (values, tangents) = adjoint.as_mut_slice().split_at_mut(block);
                let mut bent = vec![0.0; block];
                let sums = pass.sums[layer].as_slice()[block..].chunks_exact(block);
                for (tangent, sum) in tangents.chunks_exact_mut(block).zip(sums) {
                    for (i, [_, slope, _]) in derivatives.iter().enumerate() {
                        bent[i] += tangent[i] * sum[i];
                        tangent[i] *= slope;
                    }
                }
                for (i, [_, slope, curvature]) in derivatives.iter().enumerate() {
                    values[i] = slope * values[i] + curvature * bent[i];
                }
            }
            let (matrix, bias) = gradient[begin..begin + (from + 1) * to].split_at_mut(from * to);
            // Copies of the transposed: products by columns are what matrixmultiply is asked for.
            DMatrixViewMut::from_slice(matrix, to, from).gemm(1.0, &adjoint, &pass.inputs[layer].transpose(), 1.0);
            for sample in 0..pass.samples {
                bias.iter_mut().zip(adjoint.column(sample).iter()).for_each(|(bias, adjoint)| *bias += adjoint);
            }
            if layer > 0 {
                let matrix = DMatrixView::from_slice(&weights[begin..begin + from * to], to, from);
                adjoint = matrix.transpose() * adjoint;
            }
        }
    }
}
