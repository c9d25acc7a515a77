//! A friction network for the other libraries of the probe's program `networks`: in floats, and quantized to 8 bits;
//! with what each of them gives held against the exact one.

use friction_compensation::friction::domain::Domain;
use friction_compensation::friction::network::{INPUTS, NEURONS, NetworkParameters, Neuron};

/// Weights and bias of each neuron of a layer.
type Layer = Vec<([f64; NEURONS], f64)>;

/// The network in 64-bit floats.
pub struct Exact {
    hidden: [Layer; 3],
    output: Layer,
    /// Torque for an output of 1, Nm.
    pub scale: f64,
}

fn neuron(neuron: &Neuron) -> ([f64; NEURONS], f64) {
    let scale = 2f64.powi(-i32::from(neuron.fraction));
    let [weights @ .., bias] = neuron.weights.map(|weight| f64::from(weight) * scale);
    (weights, bias)
}

fn sums(layer: &Layer, x: &[f64; NEURONS]) -> Vec<f64> {
    layer
        .iter()
        .map(|(weights, bias)| weights.iter().zip(x).map(|(weight, x)| weight * x).sum::<f64>() + bias)
        .collect()
}

impl Exact {
    /// Networks from the integers of an image.
    pub fn new(parameters: &NetworkParameters) -> Self {
        let first = parameters.first.map(|[weights @ .., bias]| {
            (weights.map(|weight| f64::from(weight) * 2f64.powi(-26)), f64::from(bias) * 2f64.powi(-25))
        });
        let [second, third] = parameters.hidden.map(|layer| layer.iter().map(neuron).collect());
        Self {
            hidden: [first.to_vec(), second, third],
            output: vec![neuron(&parameters.output)],
            scale: f64::from(parameters.scale) / 65536.0,
        }
    }

    /// Sums of every hidden layer, and the output, for inputs in [-1, 1].
    fn evaluate(&self, x: [f64; INPUTS]) -> ([Vec<f64>; 3], f64) {
        let mut x = x;
        let layers = self.hidden.each_ref().map(|layer| {
            let sums = sums(layer, &x);
            x = core::array::from_fn(|place| sums[place].tanh());
            sums
        });
        (layers, sums(&self.output, &x)[0])
    }

    /// The output for inputs in [-1, 1].
    pub fn output(&self, x: [f64; INPUTS]) -> f64 {
        self.evaluate(x).1
    }

    /// Bytes in the memory layout of the probe's `Floats`.
    pub fn floats(&self) -> Vec<u8> {
        let layer = |layer: &Layer| {
            let weights = layer.iter().flat_map(|(weights, _)| *weights);
            weights.chain(layer.iter().map(|(_, bias)| *bias)).flat_map(|value| (value as f32).to_le_bytes()).collect()
        };
        self.hidden.iter().chain([&self.output]).flat_map(layer as fn(&Layer) -> Vec<u8>).collect()
    }

    /// Bytes in the memory layout of the probe's `Bytes`, quantized for what occurs over `samples`, and the value of a
    /// step of its output. Sums beyond +-4, where tanh is flat in 8 bits, are cut.
    pub fn bytes(&self, samples: &[[f64; INPUTS]]) -> (Vec<u8>, f64) {
        let evaluated: Vec<_> = samples.iter().map(|x| self.evaluate(*x)).collect();
        let step = |largest: f64| largest / 127.0;
        let (mut layers, mut tables) = (Vec::new(), Vec::new());
        for (place, layer) in self.hidden.iter().enumerate() {
            let largest =
                evaluated.iter().flat_map(|(sums, _)| &sums[place]).fold(0.0f64, |most, sum| most.max(sum.abs()));
            let output = step(largest.min(4.0));
            layers.extend(byte_layer(layer, output));
            tables.extend((-128..128).map(|y| ((f64::from(y) * output).tanh() * 127.0).round() as i8 as u8));
        }
        let output = step(evaluated.iter().fold(0.0f64, |most, (_, output)| most.max(output.abs())));
        layers.extend(tables);
        layers.extend(byte_layer(&self.output, output));
        (layers, output)
    }
}

/// A layer whose inputs are in steps of 1/127 and whose outputs are in steps of `output`: weights, to whole words;
/// factor; biases.
fn byte_layer(layer: &Layer, output: f64) -> Vec<u8> {
    let largest = layer.iter().flat_map(|(weights, _)| weights).fold(0.0f64, |most, weight| most.max(weight.abs()));
    let step = (largest / 127.0).max(f64::MIN_POSITIVE);
    let quantized = |weight: &f64| (weight / step).round() as i8 as u8;
    let mut bytes: Vec<u8> = layer.iter().flat_map(|(weights, _)| weights.iter().map(quantized)).collect();
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let numbers = [step / 127.0 / output].into_iter().chain(layer.iter().map(|(_, bias)| bias / output));
    bytes.extend(numbers.flat_map(|value| (value as f32).to_le_bytes()));
    bytes
}

/// A signal in [-1, 1] of its trained range.
pub fn scaled(domain: &Domain, signals: &[i32]) -> [f64; INPUTS] {
    core::array::from_fn(|place| {
        let range = domain.ranges[place];
        (f64::from(signals[place]) - f64::from(range.centre())) / f64::from(range.half_width())
    })
}
