//! The learned part of the friction model in f64: a small tanh network with a box around its inputs; host.
//!
//! This is the network before quantisation: what the trainers return, what reports draw and what the fixed-point
//! network of the firmware is compared with. Structure: five inputs and three hidden layers of five neurons after the
//! mobile-robot paper (section 2.2.3, figure 4), linear output; other hidden layers are allowed for comparison.
//!
//! Inputs are clamped to the box they were trained on and scaled to [-1, 1], exactly as the firmware does it: outside
//! its box a network knows nothing, so it repeats what it knew at the border.

use thiserror::Error;

/// Number of inputs: position, velocity, theoretical torque, measured torque, temperature, in this order and in SI
/// units.
pub const INPUTS: usize = 5;

/// Names of the inputs, for messages and reports.
pub const INPUT_NAMES: [&str; INPUTS] =
    ["position", "velocity", "theoretical torque", "measured torque", "temperature"];

/// Hidden layers of the network that the firmware runs.
pub const FIRMWARE_HIDDEN: [usize; 3] = [5, 5, 5];

/// Reason for which a network or its box cannot be built.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum NetworkError {
    /// A limit of the box is not a number or the limits are exchanged.
    #[error("the box of input `{input}` is [{low}, {high}]: both limits must be finite and the lower one first")]
    Box {
        /// Name of the input.
        input: &'static str,
        /// Lower limit, SI units.
        low: f64,
        /// Upper limit, SI units.
        high: f64,
    },
    /// A hidden layer without neurons.
    #[error("hidden layer {0} has no neurons")]
    EmptyLayer(usize),
    /// The parameter vector does not fit the shape.
    #[error("{given} parameters given, a network of this shape has {expected}")]
    ParameterCount {
        /// Length of the vector.
        given: usize,
        /// Length the shape asks for.
        expected: usize,
    },
    /// A parameter is infinite or not a number.
    #[error("parameter {index} is {value}, which is not finite")]
    Parameter {
        /// Index into the parameter vector.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// The output scale is not a positive number.
    #[error("the output scale is {0}, it must be positive and finite")]
    OutputScale(f64),
    /// A weight of an unused input is not zero.
    #[error("neuron {neuron} of the first layer has weight {weight} on the unused input `{input}`")]
    UnusedInput {
        /// Name of the input.
        input: &'static str,
        /// Index of the neuron.
        neuron: usize,
        /// The weight that should be zero.
        weight: f64,
    },
}

/// The range each input was trained on, and which inputs the network uses at all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputBox {
    low: [f64; INPUTS],
    high: [f64; INPUTS],
    active: [bool; INPUTS],
}

impl InputBox {
    /// A box from limits in SI units. Inputs that are not `used`, or whose limits are equal, are inactive.
    pub fn new(low: [f64; INPUTS], high: [f64; INPUTS], used: [bool; INPUTS]) -> Result<Self, NetworkError> {
        for (i, input) in INPUT_NAMES.into_iter().enumerate() {
            let valid =
                low[i].is_finite() && high[i].is_finite() && low[i] <= high[i] && (high[i] - low[i]).is_finite();
            if !valid {
                return Err(NetworkError::Box { input, low: low[i], high: high[i] });
            }
        }
        Ok(Self { low, high, active: std::array::from_fn(|i| used[i] && low[i] < high[i]) })
    }

    /// The smallest box around `inputs` (at least one row, SI units).
    pub fn around(inputs: &[[f64; INPUTS]], used: [bool; INPUTS]) -> Result<Self, NetworkError> {
        let mut low = [f64::INFINITY; INPUTS];
        let mut high = [f64::NEG_INFINITY; INPUTS];
        for row in inputs {
            for i in 0..INPUTS {
                low[i] = low[i].min(row[i]);
                high[i] = high[i].max(row[i]);
            }
        }
        Self::new(low, high, used)
    }

    /// Lower limits, SI units.
    pub fn low(&self) -> &[f64; INPUTS] {
        &self.low
    }

    /// Upper limits, SI units.
    pub fn high(&self) -> &[f64; INPUTS] {
        &self.high
    }

    /// Inputs that the network sees: used and of non-zero width.
    pub fn active(&self) -> &[bool; INPUTS] {
        &self.active
    }

    /// Indices of the active inputs, ascending.
    pub fn active_inputs(&self) -> Vec<usize> {
        (0..INPUTS).filter(|&i| self.active[i]).collect()
    }

    /// Clamps `inputs` (SI units) to the box and scales them to [-1, 1]; an inactive input becomes 0.
    pub fn normalise(&self, inputs: &[f64; INPUTS]) -> [f64; INPUTS] {
        std::array::from_fn(|i| match self.active[i] {
            true => {
                2.0 * (inputs[i].clamp(self.low[i], self.high[i]) - self.low[i]) / (self.high[i] - self.low[i]) - 1.0
            }
            false => 0.0,
        })
    }
}

/// Number of neurons in each layer, from the inputs to the one output.
///
/// Parameters are one vector: layer by layer, within a layer neuron by neuron, within a neuron its weights in the order
/// of its inputs and then its bias.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    sizes: Vec<usize>,
}

/// Place of one layer in the parameter vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerShape {
    /// Values that enter each neuron.
    pub inputs: usize,
    /// Neurons.
    pub neurons: usize,
    /// Index of the layer's first parameter.
    pub offset: usize,
}

impl LayerShape {
    /// Index of the first weight of `neuron`; its bias follows `inputs` places later.
    pub fn neuron(&self, neuron: usize) -> usize {
        self.offset + neuron * (self.inputs + 1)
    }
}

impl Shape {
    /// `inputs` values, tanh layers of the sizes `hidden`, one linear output.
    pub fn new(inputs: usize, hidden: &[usize]) -> Result<Self, NetworkError> {
        if let Some(empty) = hidden.iter().position(|&neurons| neurons == 0) {
            return Err(NetworkError::EmptyLayer(empty));
        }
        Ok(Self { sizes: [&[inputs], hidden, &[1]].concat() })
    }

    /// Values in each layer: inputs, hidden layers, output.
    pub fn sizes(&self) -> &[usize] {
        &self.sizes
    }

    /// The layers from the first hidden one to the output.
    pub fn layers(&self) -> impl DoubleEndedIterator<Item = LayerShape> + ExactSizeIterator {
        let mut offset = 0;
        let layers: Vec<_> = self
            .sizes
            .windows(2)
            .map(|pair| {
                let layer = LayerShape { inputs: pair[0], neurons: pair[1], offset };
                offset += pair[1] * (pair[0] + 1);
                layer
            })
            .collect();
        layers.into_iter()
    }

    /// Length of the parameter vector.
    pub fn parameter_count(&self) -> usize {
        self.sizes.windows(2).map(|pair| pair[1] * (pair[0] + 1)).sum()
    }
}

/// A trained (or to be trained) network: shape, parameters, input box and output scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    shape: Shape,
    input_box: InputBox,
    output_scale: f64,
    parameters: Vec<f64>,
}

impl Network {
    /// A network with [`INPUTS`] inputs and the hidden layers `hidden`; `parameters` in the order of [`Shape`].
    ///
    /// `output_scale` is in the unit of the targets (Nm): the output is that many times the output neuron's value.
    /// Weights of inactive inputs must be exactly zero, so that the firmware may skip or keep those inputs alike.
    pub fn new(
        hidden: &[usize],
        input_box: InputBox,
        output_scale: f64,
        parameters: Vec<f64>,
    ) -> Result<Self, NetworkError> {
        let shape = Shape::new(INPUTS, hidden)?;
        if parameters.len() != shape.parameter_count() {
            let (given, expected) = (parameters.len(), shape.parameter_count());
            return Err(NetworkError::ParameterCount { given, expected });
        }
        if let Some(index) = parameters.iter().position(|p| !p.is_finite()) {
            return Err(NetworkError::Parameter { index, value: parameters[index] });
        }
        if !(output_scale.is_finite() && output_scale > 0.0) {
            return Err(NetworkError::OutputScale(output_scale));
        }
        let network = Self { shape, input_box, output_scale, parameters };
        let first = network.layers().next().into_iter().flatten();
        for (neuron, (weights, _)) in first.enumerate() {
            for (i, input) in INPUT_NAMES.into_iter().enumerate() {
                if !input_box.active[i] && weights[i] != 0.0 {
                    return Err(NetworkError::UnusedInput { input, neuron, weight: weights[i] });
                }
            }
        }
        Ok(network)
    }

    /// A network from parameters of the active inputs only, as the trainers hold them.
    pub(crate) fn from_active(
        hidden: &[usize],
        input_box: InputBox,
        output_scale: f64,
        active_parameters: &[f64],
    ) -> Result<Self, NetworkError> {
        let active = input_box.active_inputs();
        let per_neuron = active.len() + 1;
        let neurons = hidden.first().copied().unwrap_or(1);
        let (first, rest) =
            active_parameters.split_at_checked(neurons * per_neuron).unwrap_or((active_parameters, &[]));
        let mut parameters = Vec::with_capacity(neurons * (INPUTS + 1) + rest.len());
        for neuron in first.chunks_exact(per_neuron) {
            let mut weights = [0.0; INPUTS];
            for (&input, &weight) in active.iter().zip(neuron) {
                weights[input] = weight;
            }
            parameters.extend_from_slice(&weights);
            parameters.push(neuron[active.len()]);
        }
        parameters.extend_from_slice(rest);
        Self::new(hidden, input_box, output_scale, parameters)
    }

    /// Number of neurons in each layer.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// The box that the inputs are clamped to.
    pub fn input_box(&self) -> &InputBox {
        &self.input_box
    }

    /// Factor from the output neuron to the target's unit.
    pub fn output_scale(&self) -> f64 {
        self.output_scale
    }

    /// All weights and biases, in the order of [`Shape`]; in units of normalised inputs and output.
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
    }

    /// Layers from the first hidden one to the output; each is a list of neurons: (weights, bias).
    pub fn layers(&self) -> impl Iterator<Item = Vec<(&[f64], f64)>> {
        self.shape.layers().map(|layer| {
            let neuron = |n| {
                let (weights, bias) = self.parameters[layer.neuron(n)..].split_at(layer.inputs);
                (weights, bias[0])
            };
            (0..layer.neurons).map(neuron).collect()
        })
    }

    /// The output in the unit of the targets (Nm) for inputs in SI units.
    pub fn evaluate(&self, inputs: &[f64; INPUTS]) -> f64 {
        let mut values = self.input_box.normalise(inputs).to_vec();
        let output_layer = self.shape.sizes().len() - 2;
        for (l, layer) in self.shape.layers().enumerate() {
            let neuron = |n: usize| {
                let (weights, bias) = self.parameters[layer.neuron(n)..].split_at(layer.inputs);
                let sum = bias[0] + weights.iter().zip(&values).map(|(w, v)| w * v).sum::<f64>();
                if l == output_layer { sum } else { sum.tanh() }
            };
            values = (0..layer.neurons).map(neuron).collect();
        }
        values[0] * self.output_scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_box(used: [bool; INPUTS]) -> InputBox {
        InputBox::new([-1.0; INPUTS], [1.0; INPUTS], used).unwrap()
    }

    #[test]
    fn the_firmware_network_has_96_parameters() {
        assert_eq!(Shape::new(INPUTS, &FIRMWARE_HIDDEN).unwrap().parameter_count(), 96);
    }

    #[test]
    fn the_output_is_the_formula_written_out() {
        let parameters = vec![0.5, 0.0, -1.0, 0.0, 0.25, 0.1, 2.0, -0.3];
        let network = Network::new(&[1], unit_box([true; INPUTS]), 3.0, parameters).unwrap();
        let expected = 3.0 * (2.0 * (0.5_f64 * 0.2 - 0.4 + 0.25 * -0.8 + 0.1).tanh() - 0.3);
        let found = network.evaluate(&[0.2, 0.9, 0.4, -0.7, -0.8]);
        assert!((found - expected).abs() < 1e-15, "{found} {expected}");
    }

    #[test]
    fn inputs_outside_the_box_act_as_its_border() {
        let limits = InputBox::new([-2.0, 0.0, 0.0, 0.0, 20.0], [2.0, 4.0, 1.0, 1.0, 60.0], [true; INPUTS]).unwrap();
        assert_eq!(limits.normalise(&[-9.0, 1.0, 0.5, 7.0, 60.0]), [-1.0, -0.5, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn an_input_without_width_or_use_is_inactive_and_normalises_to_zero() {
        let used = [true, true, false, true, true];
        let limits = InputBox::new([0.0; INPUTS], [1.0, 1.0, 1.0, 1.0, 0.0], used).unwrap();
        assert_eq!(limits.active(), &[true, true, false, true, false]);
        assert_eq!(limits.normalise(&[1.0, 0.5, 1.0, 0.0, 3.0]), [1.0, 0.0, 0.0, -1.0, 0.0]);
    }

    #[test]
    fn impossible_boxes_and_networks_are_refused_with_the_reason() {
        assert!(matches!(
            InputBox::new([1.0, 0.0, 0.0, 0.0, 0.0], [0.0; INPUTS], [true; INPUTS]),
            Err(NetworkError::Box { input: "position", .. })
        ));
        assert!(InputBox::around(&[], [true; INPUTS]).is_err());
        let all = unit_box([true; INPUTS]);
        assert_eq!(Network::new(&[5, 0], all, 1.0, vec![]), Err(NetworkError::EmptyLayer(1)));
        let count = NetworkError::ParameterCount { given: 3, expected: 8 };
        assert_eq!(Network::new(&[1], all, 1.0, vec![0.0; 3]), Err(count));
        assert_eq!(Network::new(&[1], all, 0.0, vec![0.0; 8]), Err(NetworkError::OutputScale(0.0)));
        let mut parameters = vec![0.0; 8];
        parameters[4] = 0.5;
        let no_temperature = unit_box([true, true, true, true, false]);
        assert_eq!(
            Network::new(&[1], no_temperature, 1.0, parameters),
            Err(NetworkError::UnusedInput { input: "temperature", neuron: 0, weight: 0.5 })
        );
    }

    #[test]
    fn parameters_of_the_active_inputs_land_on_their_inputs() {
        let limits = unit_box([false, true, false, false, true]);
        let network = Network::from_active(&[2], limits, 1.0, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]).unwrap();
        let layers: Vec<_> = network.layers().collect();
        assert_eq!(layers[0], vec![(&[0.0, 1.0, 0.0, 0.0, 2.0][..], 3.0), (&[0.0, 4.0, 0.0, 0.0, 5.0][..], 6.0)]);
        assert_eq!(layers[1], vec![(&[7.0, 8.0][..], 9.0)]);
    }
}
