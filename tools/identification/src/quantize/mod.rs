//! Quantisation of floating-point models to the integers of a parameter image; host.
//!
//! `full_scale` converts single numbers between SI and the image's form, `physical` and `network` whole models. Every
//! number is rounded to nearest; what does not fit is refused by name, value and limit, never clipped.

pub mod common;
pub mod full_scale;
pub mod network;
pub mod physical;

use friction_compensation::friction::domain::{Domain, Range};
use friction_compensation::friction::state::{JointState, SIGNALS, Signal};
use friction_compensation::friction::{FrictionModel, FrictionParameters};
use friction_compensation::parameters::image::{GoldenSequence, GoldenVector};
use full_scale::to_q16;

/// A model that an image cannot hold.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum QuantizeError {
    /// A number beyond the range of its format.
    #[error("{what} is {value}, which does not fit: its magnitude must stay below {limit}")]
    Range {
        /// Name of the number.
        what: String,
        /// Its value.
        value: f64,
        /// Limit of its magnitude.
        limit: f64,
    },
    /// A network of another shape than the firmware's.
    #[error("the network's layers are {found:?}; the firmware evaluates 5-5-5-5-1")]
    Shape {
        /// Neurons in each layer.
        found: Vec<usize>,
    },
    /// A stored network that is no network.
    #[error("{0}")]
    Network(String),
    /// A neuron whose sum would not fit 32 bits.
    #[error("neuron {neuron} of layer {layer}: its weights and bias add up to {sum}, the limit is {limit}")]
    Sum {
        /// Layer, 0 to 3.
        layer: usize,
        /// Neuron in the layer.
        neuron: usize,
        /// Sum of magnitudes.
        sum: f64,
        /// Limit of the sum.
        limit: f64,
    },
}

/// The box of signals between `low` and `high` (SI, in the order of [`Signal`]), rounded outwards; a signal without
/// limits (None) is one that the model does not depend on.
pub fn domain(
    limits: &[Option<(f64, f64)>; SIGNALS],
    margin: f64,
    reference_temperature: f64,
) -> Result<Domain, QuantizeError> {
    let mut ranges = [Range::ANY; SIGNALS];
    for ((range, limits), signal) in ranges.iter_mut().zip(limits).zip(Signal::ALL) {
        if let Some((low, high)) = limits {
            *range = Range {
                low: to_q16(signal.name(), (low * 65536.0).floor() / 65536.0)?,
                high: to_q16(signal.name(), (high * 65536.0).ceil() / 65536.0)?,
            };
        }
    }
    Ok(Domain {
        ranges,
        margin: to_q16("margin", margin)?.max(0) as u32,
        reference_temperature: to_q16("reference temperature", reference_temperature)?,
    })
}

/// Inputs spread over the box of `parameters`, with the exact outputs of the firmware's arithmetic: one vector a set,
/// then more until there are `count`.
pub fn golden_vectors(parameters: &FrictionParameters, count: usize) -> Vec<GoldenVector> {
    let model = FrictionModel::new(parameters, 1);
    let sets = parameters.selector.sets();
    let mut sequence = GoldenSequence::new(&parameters.common);
    let vector = |n: usize| {
        let set = n % sets;
        let mut signals = [0; SIGNALS];
        for (i, (signal, range)) in signals.iter_mut().zip(parameters.domain.ranges).enumerate() {
            // Multiples of irrational numbers fill the box evenly with any number of points (a Kronecker sequence).
            let place =
                (0.5 + (n + 1) as f64 * [0.819_17, 0.671_04, 0.549_70, 0.450_30, 0.368_88, 0.302_18][i]).fract();
            let width = range.high as f64 - range.low as f64;
            *signal = if range == Range::ANY { 0 } else { (range.low as f64 + place * width).round() as i32 };
        }
        let state = JointState::from_signals(signals);
        let expected = model.evaluate_with(set, &state, &sequence.next(&state));
        GoldenVector { set: set as u8, signals, expected }
    };
    (0..count.max(sets)).map(vector).collect()
}
