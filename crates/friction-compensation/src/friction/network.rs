//! The 3x5 friction network: five inputs, three hidden layers of five tanh neurons, one output (001, section 2.2.3);
//! control step.
//!
//! Hybrid fixed point. Layer 0 multiplies Q31 inputs with 32-bit weights, because the velocity weights see the Coulomb
//! edge and 16 bits there cost ten times the error of all other layers. Layers 1 to 3 use 16-bit weights with a
//! power of two per neuron, two products an instruction, the bias as a sixth input. Every neuron's sum reaches the
//! table in Q25. Sums wrap: an image is used only after the [certificate](crate::parameters::certificate) has proved
//! that they fit.

use super::domain::{Domain, Range};
use super::smooth::tanh;
use crate::dsp::{asr, in_turn, movt, pkhtb, smlad, smmla, smmul, smmulr, smuad};
use crate::quantity::Torque;

/// Inputs of the network: the first five [`Signal`](super::state::Signal)s.
pub const INPUTS: usize = 5;
/// Neurons in each hidden layer.
pub const NEURONS: usize = 5;
/// Fewest fraction bits of a 16-bit weight: |weight| < 32.
pub const MIN_FRACTION: u8 = 10;
/// Most fraction bits of a 16-bit weight: |weight| < 1/32.
pub const MAX_FRACTION: u8 = 20;

/// Largest torque for an output of 1, Q16.16: below 256 Nm. With seven bits more it fits a word still, and the upper
/// word of its product with the output is the torque.
pub const MAX_SCALE: i32 = (1 << 24) - 1;

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
    /// Layer 0: per neuron five weights in Q26 and a bias in Q25. Inputs are scaled so that the trained box is [-1,
    /// 1].
    pub first: [[i32; INPUTS + 1]; NEURONS],
    /// Layers 1 and 2.
    pub hidden: [[Neuron; NEURONS]; 2],
    /// Layer 3, linear.
    pub output: Neuron,
    /// Torque for an output of 1, Nm in Q16.16, -[`MAX_SCALE`] to [`MAX_SCALE`].
    pub scale: i32,
}

/// Scaling of one input to Q31: centred, clamped to its range, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputScale {
    centre: i32,
    /// Distance from the upper end of the centred range to that of 32 bits: what saturates when it is added has left
    /// the range.
    above: i32,
    /// A power of two.
    factor: i32,
    /// Shift by the addition of `below`, times the factor.
    offset: i32,
    /// Counterpart of `above` for the lower end, negative.
    below: i32,
    gain: i32,
}

impl InputScale {
    /// Scaling that is not prepared yet.
    const NONE: Self = Self { centre: 0, above: 0, below: 0, factor: 0, offset: 0, gain: 0 };

    /// Maps `range` to [-1, 1]; an empty range gives zero for every input.
    pub fn new(range: Range) -> Self {
        let half_width = range.half_width();
        let Some(divisor) = core::num::NonZeroU64::new(half_width as u64) else { return Self::NONE };
        // The centred value is first shifted left until the half width lies in [2^30, 2^31], then multiplied by a gain
        // in (2^29, 2^31): the high word of the product is below 2^29, so that a last shift by two gives Q31.
        let shift = half_width.leading_zeros().saturating_sub(1);
        let gain = (((1u64 << 61) - (1 << 33)) / divisor) >> shift;
        let gain = gain.min(i32::MAX as u64) as i32;
        let (centre, factor) = (range.centre(), 1i32.wrapping_shl(shift));
        let above = i32::MAX.wrapping_sub(range.high.wrapping_sub(centre));
        let below = i32::MIN.wrapping_sub(range.low.wrapping_sub(centre));
        Self { centre, above, below, factor, offset: below.wrapping_neg().wrapping_mul(factor), gain }
    }

    /// The scaled inputs that the range can give, Q31: lowest and highest.
    pub(crate) fn interval(&self) -> (i32, i32) {
        (self.apply(i32::MIN), self.apply(i32::MAX))
    }

    /// The scaled input, Q31. Clamped by sums that saturate: a comparison takes three instructions where one of them
    /// takes one.
    #[inline(always)]
    pub fn apply(&self, value: i32) -> i32 {
        let centred = value.saturating_sub(self.centre);
        let not_above = centred.saturating_add(self.above).wrapping_sub(self.above);
        let shifted = not_above.saturating_add(self.below).wrapping_mul(self.factor).wrapping_add(self.offset);
        smmul(shifted, self.gain) << 2
    }
}

/// Scaling of every input: the same for every network of an image.
#[derive(Clone, Copy, Debug)]
pub struct Inputs([InputScale; INPUTS]);

/// A network with its inputs' scales.
#[derive(Clone, Copy, Debug)]
pub struct Network {
    inputs: Inputs,
    layers: Layers,
}

/// The network ready to be evaluated: the weights of layer 0 by input, the others packed in pairs.
#[derive(Clone, Copy, Debug)]
pub struct Layers {
    biases: [i32; NEURONS],
    first: [[i32; NEURONS]; INPUTS],
    hidden: [[PackedNeuron; NEURONS]; 2],
    output: PackedNeuron,
    scale: i32,
}

/// Weights of a neuron in pairs, the bias last, and how far its sum is shifted: four words, which are loaded together.
#[derive(Clone, Copy, Debug)]
struct PackedNeuron {
    pairs: [u32; 3],
    shift: u32,
}

impl PackedNeuron {
    fn new(neuron: &Neuron) -> Self {
        let [a, b, c, d, e, bias] = neuron.weights;
        let pack = |low: i16, high: i16| low as u16 as u32 | (high as u16 as u32) << 16;
        let shift = neuron.fraction.saturating_sub(MIN_FRACTION).into();
        Self { pairs: [pack(a, b), pack(c, d), pack(e, bias)], shift }
    }

    /// The neuron's sum in Q25.
    #[inline(always)]
    fn sum(&self, activations: [u32; 3]) -> i32 {
        let Self { pairs: [first, second, third], shift } = *self;
        asr(smlad(third, activations[2], smlad(second, activations[1], smuad(first, activations[0]))), shift)
    }

    /// The neuron's activation, Q31.
    #[inline(always)]
    fn activation(&self, before: [u32; 3]) -> i32 {
        tanh(self.sum(before))
    }
}

/// The input that multiplies a bias: the largest value of Q15, in the upper half of the third pair.
const ONE: u16 = 0x7fff;

#[inline(always)]
fn activate(sums: [i32; NEURONS]) -> [u32; 3] {
    let [a, b, c, d, e] = sums;
    // In this order only one value at a time waits for its partner.
    [pkhtb(tanh(a), tanh(b)), pkhtb(tanh(c), tanh(d)), movt::<ONE>(tanh(e) as u32 >> 16)]
}

/// Layer 0's sums with one more input. No closure, here and below: optimised for nothing but size, the compiler calls
/// those.
#[inline(always)]
fn add([a, b, c, d, e]: [i32; NEURONS], [wa, wb, wc, wd, we]: &[i32; NEURONS], x: i32) -> [i32; NEURONS] {
    in_turn([smmla(*wa, x, a), smmla(*wb, x, b), smmla(*wc, x, c), smmla(*wd, x, d), smmla(*we, x, e)])
}

/// The activations of a layer of packed neurons.
#[inline(always)]
fn layer([a, b, c, d, e]: &[PackedNeuron; NEURONS], before: [u32; 3]) -> [u32; 3] {
    // In this order only one value at a time waits for its partner.
    let first = pkhtb(a.activation(before), b.activation(before));
    let second = pkhtb(c.activation(before), d.activation(before));
    [first, second, movt::<ONE>(e.activation(before) as u32 >> 16)]
}

impl Inputs {
    /// Scalings that are not prepared yet.
    pub(super) const NONE: Self = Self([InputScale::NONE; INPUTS]);

    /// Prepares the scales for `domain`.
    pub fn new(domain: &Domain) -> Self {
        let [q, v, theoretical, measured, temperature, _] = domain.ranges;
        Self([q, v, theoretical, measured, temperature].map(InputScale::new))
    }

    /// Scaling of each input.
    pub(crate) const fn scales(&self) -> &[InputScale; INPUTS] {
        &self.0
    }
}

impl Network {
    /// Prepares a network for evaluation in `domain`.
    pub fn new(parameters: &NetworkParameters, domain: &Domain) -> Self {
        Self { inputs: Inputs::new(domain), layers: Layers::new(parameters) }
    }

    /// The network's torque. `signals` in Q16.16, in the order of [`Signal`](super::state::Signal).
    pub fn evaluate(&self, signals: &[i32; super::state::SIGNALS]) -> Torque {
        self.layers.evaluate(&self.inputs, signals)
    }
}

impl Layers {
    /// Prepares the weights.
    pub fn new(parameters: &NetworkParameters) -> Self {
        let [a, b, c, d, e] = &parameters.first;
        let column = |input: usize| [a[input], b[input], c[input], d[input], e[input]];
        Self {
            biases: column(INPUTS),
            first: [column(0), column(1), column(2), column(3), column(4)],
            hidden: parameters.hidden.map(|layer| layer.each_ref().map(PackedNeuron::new)),
            output: PackedNeuron::new(&parameters.output),
            scale: output_scale(parameters.scale),
        }
    }

    /// The network's torque. `signals` in Q16.16, in the order of [`Signal`](super::state::Signal); each is clamped to
    /// its trained range.
    ///
    /// Written out, neuron by neuron and layer 0 input by input: optimised for size, the compiler keeps a loop, and
    /// with it every sum in memory.
    #[inline]
    pub fn evaluate(&self, inputs: &Inputs, signals: &[i32; super::state::SIGNALS]) -> Torque {
        let ([s0, s1, s2, s3, s4], [w0, w1, w2, w3, w4]) = (&inputs.0, &self.first);
        let sums = add(self.biases, w0, s0.apply(signals[0]));
        let sums = add(sums, w1, s1.apply(signals[1]));
        let sums = add(sums, w2, s2.apply(signals[2]));
        let sums = add(sums, w3, s3.apply(signals[3]));
        let activations = activate(add(sums, w4, s4.apply(signals[4])));
        let [second, third] = &self.hidden;
        let activations = layer(third, layer(second, activations));
        Torque::from_bits(to_torque(self.output.sum(activations), self.scale))
    }
}

/// The scale (Q16.16) for [`to_torque`], in Q23.
pub(crate) fn output_scale(scale: i32) -> i32 {
    scale.clamp(-MAX_SCALE, MAX_SCALE) << 7
}

/// Output sum (Q25) times [`output_scale`], rounded half up.
#[inline(always)]
pub(crate) fn to_torque(sum: i32, scale: i32) -> i32 {
    smmulr(sum, scale)
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
        fn the_torque_is_the_output_times_the_scale_rounded_half_up(
            sum in prop_oneof![any::<i32>(), Just(i32::MIN), Just(i32::MAX)],
            scale in prop_oneof![-MAX_SCALE..=MAX_SCALE, Just(-MAX_SCALE), Just(MAX_SCALE), -2..=2i32],
        ) {
            let exact = (sum as i64 * scale as i64 + (1 << 24)) >> 25;
            prop_assert_eq!(to_torque(sum, output_scale(scale)) as i64, exact);
        }

        #[test]
        fn an_input_is_clamped_to_its_range_wherever_that_lies(
            a in prop_oneof![any::<i32>(), Just(i32::MIN), Just(i32::MAX)],
            b in prop_oneof![any::<i32>(), Just(i32::MIN), Just(i32::MAX)],
            value: i32,
            near in -2..=2i32,
        ) {
            let range = Range { low: a.min(b), high: a.max(b) };
            let InputScale { centre, factor, gain, .. } = InputScale::new(range);
            for value in [value, range.low.saturating_add(near), range.high.saturating_add(near), i32::MIN, i32::MAX] {
                let centred = range.nearest(value).wrapping_sub(centre);
                let scaled = smmul(centred.wrapping_mul(factor), gain) << 2;
                prop_assert_eq!(InputScale::new(range).apply(value), scaled, "{} in {:?}", value, range);
            }
        }

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
