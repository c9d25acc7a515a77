//! First values of the weights, and the bounds that keep them inside the firmware's number format; host.
//!
//! First values after D. Nguyen and B. Widrow, "Improving the learning speed of 2-layer neural networks by choosing
//! initial values of the adaptive weights", IJCNN 1990: the neurons of a layer share out the input box between them.

use crate::network::Shape;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Largest magnitude that one weight or bias of each layer may take.
///
/// The firmware's format needs sum |w| + |b| < 64 for every neuron and |w| < 32 for every weight (DESIGN, number formats).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightBounds {
    /// Weights and biases of the first layer.
    pub first_layer: f64,
    /// Weights and biases of all further layers.
    pub further_layers: f64,
}

impl WeightBounds {
    /// Limit of sum |w| + |b| of a neuron in the firmware's format.
    pub const NEURON_SUM: f64 = 64.0;
    /// Limit of one weight in the firmware's format.
    pub const WEIGHT: f64 = 31.9;
    /// Share of the limits that training may use: rounding to fixed point must not pass them.
    const SHARE: f64 = 0.98;

    /// The widest equal bounds under which no neuron of `shape` can leave the firmware's format.
    pub fn for_firmware(shape: &Shape) -> Self {
        let limit = |inputs: usize| Self::WEIGHT.min(Self::SHARE * Self::NEURON_SUM / (inputs + 1) as f64);
        let mut inputs = shape.layers().map(|layer| layer.inputs);
        let first_layer = limit(inputs.next().unwrap_or(0));
        Self { first_layer, further_layers: inputs.map(limit).fold(8.0, f64::min) }
    }

    /// Lower and upper bound of every parameter of `shape`.
    pub fn of_parameters(&self, shape: &Shape) -> Vec<(f64, f64)> {
        let bound = |l| if l == 0 { self.first_layer } else { self.further_layers };
        shape
            .layers()
            .enumerate()
            .flat_map(|(l, layer)| std::iter::repeat_n((-bound(l), bound(l)), layer.neurons * (layer.inputs + 1)))
            .collect()
    }
}

/// First values of all parameters of `shape` after Nguyen and Widrow.
///
/// The weights of a tanh neuron point in a random direction with length 0.7 H^(1/n) (n inputs, H neurons) and its bias is
/// uniform in +-that length. The linear output starts small, so that the first error is that of no network.
pub fn nguyen_widrow(shape: &Shape, random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut parameters = Vec::with_capacity(shape.parameter_count());
    let hidden = shape.sizes().len() - 2;
    for (l, layer) in shape.layers().enumerate() {
        let length = match l < hidden {
            true => 0.7 * (layer.neurons as f64).powf(1.0 / layer.inputs.max(1) as f64),
            false => 0.1,
        };
        for _ in 0..layer.neurons {
            let direction: Vec<f64> = (0..layer.inputs).map(|_| random.random_range(-1.0..1.0)).collect();
            let norm = direction.iter().map(|w| w * w).sum::<f64>().sqrt().max(1e-6);
            parameters.extend(direction.iter().map(|w| w / norm * length));
            parameters.push(random.random_range(-length..length));
        }
    }
    parameters
}
