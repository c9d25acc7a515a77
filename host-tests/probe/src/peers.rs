// The friction network of this project in other libraries: included by the program `networks`. Weights are data, as
// they are for this project's own: an image brings them.
//
// - microflow 0.1: 8-bit integers, its own fully connected layer. It has no tanh (its activations are none, ReLU, ReLU6
//   and softmax), so one is looked up in 256 bytes a layer. Its macro takes a network from a file when the program is
//   built: the layers are called one by one.
// - embedded-nn 0.2: 32-bit floats, its own fully connected layer. Its tanh for floats is x / (1 + |x|), which is
//   another function (0.5 at 1 instead of 0.76): libm's is called.
// - Plain Rust in 32-bit floats with libm's tanhf.

use embedded_nn::float_ops::fully_connected_f32;
use embedded_nn::types::Dims;
use microflow::activation::FusedActivation;
use microflow::buffer::Buffer2D;
use microflow::ops::{FullyConnectedOptions, fully_connected};
use microflow::tensor::Tensor2D;

/// Inputs, and neurons of a layer.
pub const WIDTH: usize = 5;

/// A layer of `N` neurons in floats.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct FloatLayer<const N: usize> {
    /// Weights by neuron.
    pub weights: [[f32; WIDTH]; N],
    /// Biases.
    pub biases: [f32; N],
}

/// The network in floats.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Floats {
    /// Three hidden layers.
    pub hidden: [FloatLayer<WIDTH>; 3],
    /// The output.
    pub output: FloatLayer<1>,
}

/// A layer of `N` neurons for microflow: weights in 8 bits, what a product counts and the biases, both in steps of the
/// output.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct ByteLayer<const N: usize> {
    /// Weights by neuron.
    pub weights: [[i8; WIDTH]; N],
    /// One product in steps of the output.
    pub factor: f32,
    /// Biases in steps of the output.
    pub biases: [f32; N],
}

/// The network in 8 bits.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Bytes {
    /// Three hidden layers.
    pub hidden: [ByteLayer<WIDTH>; 3],
    /// tanh of each of their outputs, from -128 on.
    pub tanh: [[i8; 256]; 3],
    /// The output.
    pub output: ByteLayer<1>,
}

fn plain_layer<const N: usize>(layer: &FloatLayer<N>, x: &[f32; WIDTH]) -> [f32; N] {
    let mut sums = layer.biases;
    for (sum, weights) in sums.iter_mut().zip(&layer.weights) {
        *sum = weights.iter().zip(x).fold(*sum, |sum, (weight, x)| sum + weight * x);
    }
    sums
}

/// Plain loops.
pub fn plain(net: &Floats, x: &[f32; WIDTH]) -> f32 {
    let mut x = *x;
    for layer in &net.hidden {
        x = plain_layer(layer, &x).map(libm::tanhf);
    }
    plain_layer(&net.output, &x)[0]
}

fn embedded_layer<const N: usize>(layer: &FloatLayer<N>, x: &[f32; WIDTH]) -> [f32; N] {
    let (input, output) = (Dims::new(1, 1, 1, WIDTH as i32), Dims::new(1, 1, 1, N as i32));
    let (filter, mut y) = (Dims::new(WIDTH as i32, 1, 1, N as i32), [0.0; N]);
    // Refuses dimensions that do not fit together; these do.
    let _ = fully_connected_f32(&input, x, &filter, layer.weights.as_flattened(), Some(&layer.biases), &output, &mut y);
    y
}

/// embedded-nn's layers.
pub fn embedded_nn_f32(net: &Floats, x: &[f32; WIDTH]) -> f32 {
    let mut x = *x;
    for layer in &net.hidden {
        x = embedded_layer(layer, &x).map(libm::tanhf);
    }
    embedded_layer(&net.output, &x)[0]
}

fn byte_layer<const N: usize>(layer: &ByteLayer<N>, x: Buffer2D<i8, 1, WIDTH>) -> Buffer2D<i8, 1, N> {
    let weights = Tensor2D::new(Buffer2D::from_fn(|i, j| layer.weights[j][i]), [1.0], [0]);
    let biases = Buffer2D::from_fn(|j, _| layer.biases[j]);
    let options = FullyConnectedOptions { fused_activation: FusedActivation::None };
    let constants = (biases, layer.factor, Buffer2D::from_element(0), 0);
    fully_connected(Tensor2D::new(x, [1.0], [0]), &weights, [1.0], [0], options, constants).buffer
}

/// microflow's layers.
pub fn microflow_i8(net: &Bytes, x: &[i8; WIDTH]) -> i8 {
    let mut x = Buffer2D::<i8, 1, WIDTH>::from_fn(|_, j| x[j]);
    for (layer, tanh) in net.hidden.iter().zip(&net.tanh) {
        x = byte_layer(layer, x).map(|y| tanh[(i32::from(y) + 128) as usize]);
    }
    byte_layer(&net.output, x)[0]
}
