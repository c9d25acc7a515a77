//! The 3x5 friction network: five inputs, three hidden layers of five tanh neurons, one output (001, section 2.2.3);
//! control step.
//!
//! Hybrid fixed point. Layer 0 multiplies Q31 inputs with 32-bit weights, because the velocity weights see the Coulomb
//! edge and 16 bits there cost ten times the error of all other layers. Layers 1 to 3 use 16-bit weights with a
//! power of two per neuron, two products an instruction, the bias as a sixth input. Every neuron's sum reaches the
//! table in Q25. Sums wrap: an image is used only after the [certificate](crate::parameters::certificate) has proved that they
//! fit.

use super::domain::{Domain, Range};
use super::smooth::tanh;
use crate::dsp::{asr, pkhtb, saturate, smlad, smmla, smmul, smuad};
use crate::quantity::Torque;

/// Inputs of the network: the first five [`Signal`](super::state::Signal)s.
pub const INPUTS: usize = 5;
/// Neurons in each hidden layer.
pub const NEURONS: usize = 5;
/// Fewest fraction bits of a 16-bit weight: |weight| < 32.
pub const MIN_FRACTION: u8 = 10;
/// Most fraction bits of a 16-bit weight: |weight| < 1/32.
pub const MAX_FRACTION: u8 = 20;

/// A neuron of layers 1 to 3: five weights and a bias with a common power-of-two scale.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Neuron {
    /// Weights of the five neurons before, then the bias; value = integer / 2^`fraction`.
    pub weights: [i16; NEURONS + 1],
    /// Fraction bits of the weights, [`MIN_FRACTION`] to [`MAX_FRACTION`].
    pub fraction: u8,
}

/// The network as it is stored and transferred.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NetworkParameters {
    /// Layer 0: per neuron five weights in Q26 and a bias in Q25. Inputs are scaled so that the trained box is [-1, 1].
    pub first: [[i32; INPUTS + 1]; NEURONS],
    /// Layers 1 and 2.
    pub hidden: [[Neuron; NEURONS]; 2],
    /// Layer 3, linear.
    pub output: Neuron,
    /// Torque for an output of 1, Nm in Q16.16.
    pub scale: i32,
}

/// How one input reaches Q31: clamped to its range, centred, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputScale {
    range: Range,
    centre: i32,
    /// A power of two.
    factor: i32,
    gain: i32,
}

impl InputScale {
    /// Maps `range` to [-1, 1]; an empty range gives zero for every input.
    pub fn new(range: Range) -> Self {
        let half_width = range.half_width();
        let Some(divisor) = core::num::NonZeroU64::new(half_width as u64) else {
            return Self { range, centre: range.centre(), factor: 1, gain: 0 };
        };
        // The centred value is first shifted left until the half width lies in [2^30, 2^31], then multiplied by a gain in
        // (2^29, 2^31): the high word of the product is below 2^29, so that a last shift by two gives Q31.
        let shift = half_width.leading_zeros().saturating_sub(1);
        let gain = (((1u64 << 61) - (1 << 33)) / divisor) >> shift;
        let gain = gain.min(i32::MAX as u64) as i32;
        Self { range, centre: range.centre(), factor: 1i32.wrapping_shl(shift), gain }
    }

    /// The scaled inputs that the range can give, Q31: lowest and highest.
    pub(crate) fn interval(&self) -> (i32, i32) {
        (self.apply(self.range.low), self.apply(self.range.high))
    }

    /// The scaled input, Q31.
    #[inline(always)]
    pub fn apply(&self, value: i32) -> i32 {
        let centred = self.range.nearest(value).wrapping_sub(self.centre);
        smmul(centred.wrapping_mul(self.factor), self.gain) << 2
    }
}

/// How every input is scaled: the same for every network of an image.
#[derive(Clone, Copy, Debug)]
pub struct Inputs([InputScale; INPUTS]);

/// A network with its inputs' scales.
#[derive(Clone, Copy, Debug)]
pub struct Network {
    inputs: Inputs,
    layers: Layers,
}

/// The network ready to be evaluated: weights packed in pairs.
#[derive(Clone, Copy, Debug)]
pub struct Layers {
    first: [[i32; INPUTS + 1]; NEURONS],
    hidden: [PackedLayer; 2],
    output: PackedNeuron,
    output_shift: u8,
    scale: i32,
}

/// Five neurons, and how far each one's sum is shifted.
#[derive(Clone, Copy, Debug)]
struct PackedLayer {
    neurons: [PackedNeuron; NEURONS],
    shifts: [u8; NEURONS],
}

/// Weights of a neuron in pairs, the bias last.
type PackedNeuron = [u32; 3];

fn packed(neuron: &Neuron) -> PackedNeuron {
    let [a, b, c, d, e, bias] = neuron.weights;
    let pack = |low: i16, high: i16| low as u16 as u32 | (high as u16 as u32) << 16;
    [pack(a, b), pack(c, d), pack(e, bias)]
}

/// Distance by which a neuron's sum is shifted to Q25.
fn shift(neuron: &Neuron) -> u8 {
    neuron.fraction.saturating_sub(MIN_FRACTION)
}

/// A neuron's sum in Q25.
#[inline(always)]
fn sum(neuron: &PackedNeuron, shift: u8, activations: [u32; 3]) -> i32 {
    let [first, second, third] = *neuron;
    asr(smlad(third, activations[2], smlad(second, activations[1], smuad(first, activations[0]))), shift)
}

/// The input that multiplies a bias: the largest value of Q15, in the upper half of the third pair.
const ONE: i32 = 0x7fff_0000;

#[inline(always)]
fn activate(sums: [i32; NEURONS]) -> [u32; 3] {
    let [a, b, c, d, e] = sums;
    // In this order only one value at a time waits for its partner.
    [pkhtb(tanh(a), tanh(b)), pkhtb(tanh(c), tanh(d)), pkhtb(tanh(e), ONE)]
}

impl Inputs {
    /// Not prepared yet.
    pub(super) const NONE: Self =
        Self([InputScale { range: Range { low: 0, high: 0 }, centre: 0, factor: 0, gain: 0 }; INPUTS]);

    /// Prepares the scales for `domain`.
    pub fn new(domain: &Domain) -> Self {
        let [q, v, theoretical, measured, temperature, _] = domain.ranges;
        Self([q, v, theoretical, measured, temperature].map(InputScale::new))
    }

    /// How each input is scaled.
    pub(crate) const fn scales(&self) -> &[InputScale; INPUTS] {
        &self.0
    }

    /// The scaled inputs, Q31. `signals` in Q16.16, in the order of [`Signal`](super::state::Signal); each is clamped to its trained
    /// range.
    #[inline(always)]
    pub fn apply(&self, signals: &[i32; super::state::SIGNALS]) -> [i32; INPUTS] {
        let [s0, s1, s2, s3, s4] = &self.0;
        [s0.apply(signals[0]), s1.apply(signals[1]), s2.apply(signals[2]), s3.apply(signals[3]), s4.apply(signals[4])]
    }
}

impl Network {
    /// Prepares a network for evaluation in `domain`.
    pub fn new(parameters: &NetworkParameters, domain: &Domain) -> Self {
        Self { inputs: Inputs::new(domain), layers: Layers::new(parameters) }
    }

    /// The network's torque. `signals` in Q16.16, in the order of [`Signal`](super::state::Signal).
    pub fn evaluate(&self, signals: &[i32; super::state::SIGNALS]) -> Torque {
        self.layers.evaluate(&self.inputs.apply(signals))
    }
}

impl Layers {
    /// Prepares the weights.
    pub fn new(parameters: &NetworkParameters) -> Self {
        Self {
            first: parameters.first,
            hidden: parameters.hidden.map(|layer| PackedLayer {
                neurons: layer.each_ref().map(packed),
                shifts: layer.each_ref().map(shift),
            }),
            output: packed(&parameters.output),
            output_shift: shift(&parameters.output),
            scale: parameters.scale,
        }
    }

    /// The network's torque for inputs [scaled](Inputs::apply).
    ///
    /// Written out neuron by neuron: optimised for size, the compiler keeps a loop, and with it every sum in memory.
    #[inline]
    pub fn evaluate(&self, x: &[i32; INPUTS]) -> Torque {
        let neuron = |weights: &[i32; INPUTS + 1]| {
            let [w0, w1, w2, w3, w4, bias] = *weights;
            smmla(w4, x[4], smmla(w3, x[3], smmla(w2, x[2], smmla(w1, x[1], smmla(w0, x[0], bias)))))
        };
        let [a, b, c, d, e] = &self.first;
        let mut activations = activate([neuron(a), neuron(b), neuron(c), neuron(d), neuron(e)]);
        for PackedLayer { neurons: [a, b, c, d, e], shifts } in &self.hidden {
            let [sa, sb, sc, sd, se] = *shifts;
            let neuron = |weights: &PackedNeuron, shift: u8| sum(weights, shift, activations);
            activations = activate([neuron(a, sa), neuron(b, sb), neuron(c, sc), neuron(d, sd), neuron(e, se)]);
        }
        Torque::from_bits(to_torque(sum(&self.output, self.output_shift, activations), self.scale))
    }
}

/// Output sum (Q25) times scale (Q16.16), rounded half up, saturated.
#[inline(always)]
pub(crate) fn to_torque(sum: i32, scale: i32) -> i32 {
    saturate((sum as i64 * scale as i64 + (1 << 24)) >> 25)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::state::SIGNALS;
    use proptest::prelude::*;

    fn unit_domain() -> Domain {
        let unit = Range { low: -65536, high: 65536 };
        Domain { ranges: [unit; SIGNALS], margin: 0, reference_temperature: 0 }
    }

    /// The same network in f64, from the same integers.
    fn exact(parameters: &NetworkParameters, x: [f64; INPUTS]) -> f64 {
        let mut a: [f64; NEURONS] = parameters.first.map(|w| {
            let sum: f64 = (0..INPUTS).map(|i| w[i] as f64 / 2f64.powi(26) * x[i]).sum();
            (sum + w[INPUTS] as f64 / 2f64.powi(25)).tanh()
        });
        let value = |neuron: &Neuron, a: &[f64; NEURONS]| {
            let weight = |i: usize| neuron.weights[i] as f64 / 2f64.powi(neuron.fraction as i32);
            (0..NEURONS).map(|i| weight(i) * a[i]).sum::<f64>() + weight(NEURONS)
        };
        for layer in &parameters.hidden {
            a = layer.each_ref().map(|neuron| value(neuron, &a).tanh());
        }
        value(&parameters.output, &a) * parameters.scale as f64 / 65536.0
    }

    fn neuron(weights: [f64; NEURONS + 1], fraction: u8) -> Neuron {
        Neuron { weights: weights.map(|w| (w * 2f64.powi(fraction as i32)).round() as i16), fraction }
    }

    fn sample() -> NetworkParameters {
        let mut first = [[0; INPUTS + 1]; NEURONS];
        for (j, row) in first.iter_mut().enumerate() {
            for (i, w) in row.iter_mut().enumerate() {
                *w = (((7 * i + 3 * j) % 11) as i32 - 5) * (1 << 24) + 12_345;
            }
        }
        first[0][1] = 20 << 26; // the velocity weight that sees the Coulomb edge
        let row = |k: usize| neuron([0.3, -0.8, 0.5, 0.1 * k as f64, -0.6, 0.2], 14);
        NetworkParameters {
            first,
            hidden: [core::array::from_fn(row), core::array::from_fn(|k| row(k + 2))],
            output: neuron([1.5, -0.7, 0.4, 0.9, -1.1, 0.05], 13),
            scale: 3 << 16,
        }
    }

    #[test]
    fn agrees_with_floating_point_to_a_thousandth_of_full_scale() {
        let parameters = sample();
        let network = Network::new(&parameters, &unit_domain());
        let (mut worst, mut full_scale) = (0.0f64, 0.0f64);
        for n in 0..20_000i64 {
            let mut signals = [0; SIGNALS];
            for (i, s) in signals.iter_mut().enumerate() {
                *s = ((n * (7919 + 104_729 * i as i64)) % 131_073 - 65_536) as i32;
            }
            let x = core::array::from_fn(|i| signals[i] as f64 / 65536.0);
            let want = exact(&parameters, x);
            full_scale = full_scale.max(want.abs());
            worst = worst.max((network.evaluate(&signals).to_f64() - want).abs());
        }
        assert!(worst < 1e-3 * full_scale, "{worst} of {full_scale}");
        assert!(full_scale > 1.0);
    }

    #[test]
    fn an_input_beyond_its_range_counts_as_the_range_s_end() {
        let network = Network::new(&sample(), &unit_domain());
        assert_eq!(network.evaluate(&[i32::MAX; SIGNALS]), network.evaluate(&[65536; SIGNALS]));
        assert_eq!(network.evaluate(&[i32::MIN; SIGNALS]), network.evaluate(&[-65536; SIGNALS]));
    }

    #[test]
    fn an_input_with_an_empty_range_has_no_influence() {
        let mut domain = unit_domain();
        domain.ranges[4] = Range { low: 20 << 16, high: 20 << 16 };
        let network = Network::new(&sample(), &domain);
        let at = |temperature: i32| network.evaluate(&[1000, 2000, 3000, 4000, temperature, 0]);
        assert_eq!(at(0), at(40 << 16));
    }

    proptest! {
        #[test]
        fn input_scaling_is_exact_to_two_parts_in_a_billion(a: i32, b: i32, t in 0.0f64..=1.0) {
            let range = Range { low: a.min(b), high: a.max(b) };
            prop_assume!(range.low < range.high);
            let value = (range.low as f64 + t * (range.high as f64 - range.low as f64)) as i32;
            let want = (value as i64 - range.centre() as i64) as f64 / range.half_width() as f64;
            let have = InputScale::new(range).apply(value) as f64 / 2f64.powi(31);
            prop_assert!((have - want).abs() < 1e-8, "{} {}", have, want);
            prop_assert!(have.abs() <= 1.0);
        }
    }
}
