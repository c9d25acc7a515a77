//! First values of the weights, and the bounds that keep them inside the firmware's number format; host.
//!
//! First values after D. Nguyen and B. Widrow, "Improving the learning speed of 2-layer neural networks by choosing
//! initial values of the adaptive weights", IJCNN 1990: the neurons of a layer share out the input box between them.

use crate::network::Shape;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Bounds of the weights and biases.
///
/// The firmware's format needs sum |w| + |b| < 64 for every neuron and |w| < 32 for every weight (DESIGN, number
/// formats). Bounds of single weights keep the training problem simple (a box); they are chosen so that no neuron can
/// leave the format whatever its weights do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bounds {
    /// Bounds by the firmware's format: in the first layer 62.7 / (number of active inputs + 1), at most 31.9; 8 in all
    /// further layers or what their width allows.
    Firmware,
    /// Everywhere: for networks that stay in floating point.
    None,
}

/// Limit of sum |w| + |b| of a neuron: that of the format less 2 %, since rounding to fixed point may add to it.
const NEURON_SUM: f64 = 0.98 * 64.0;
/// Limit of one weight.
const WEIGHT: f64 = 31.9;
/// Limit of one weight or bias behind the first layer.
const FURTHER_WEIGHT: f64 = 8.0;

impl Bounds {
    /// Lower and upper bound of every parameter of `shape`; empty where there are none.
    pub fn of_parameters(self, shape: &Shape) -> Vec<(f64, f64)> {
        let mut bounds = Vec::new();
        if self == Self::Firmware {
            for (l, layer) in shape.layers().enumerate() {
                let largest = if l == 0 { WEIGHT } else { FURTHER_WEIGHT };
                let bound = largest.min(NEURON_SUM / (layer.inputs + 1) as f64);
                bounds.resize(bounds.len() + layer.neurons * (layer.inputs + 1), (-bound, bound));
            }
        }
        bounds
    }

    /// Largest sum |w| + |b| of a neuron.
    pub fn neuron_sum(self) -> f64 {
        match self {
            Self::Firmware => NEURON_SUM,
            Self::None => f64::INFINITY,
        }
    }

    /// Largest magnitude of a weight.
    pub fn weight(self) -> f64 {
        match self {
            Self::Firmware => WEIGHT,
            Self::None => f64::INFINITY,
        }
    }
}

/// First values of all parameters of `shape` after Nguyen and Widrow.
///
/// The weights of a tanh neuron point in a random direction with length 0.7 H^(1/n) (n inputs, H neurons) and its bias
/// is uniform in +-that length. The linear output starts small, so that the first error is that of no network.
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

/// First values uniform in +-1 / sqrt(n), n the inputs of the neuron: the default of the framework that the
/// mobile-robot paper used.
pub fn uniform(shape: &Shape, random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut parameters = Vec::with_capacity(shape.parameter_count());
    for layer in shape.layers() {
        let limit = 1.0 / (layer.inputs.max(1) as f64).sqrt();
        parameters.extend((0..layer.neurons * (layer.inputs + 1)).map(|_| random.random_range(-limit..limit)));
    }
    parameters
}
