//! A trained network as the image holds it: layer 0 in 32 bits, the others in 16 with a power of two per neuron.

use super::QuantizeError;
use super::full_scale::from_q16;
use super::full_scale::to_integer;
use crate::network::{FIRMWARE_HIDDEN, InputBox, Network};
use friction_compensation::friction::domain::Domain;
use friction_compensation::friction::network::{
    INPUTS, MAX_FRACTION, MAX_SCALE, MIN_FRACTION, NEURONS, NetworkParameters, Neuron,
};

/// Largest sum of a neuron's weights and bias that fits: Q25 in layer 0, Q15 times at least 10 fraction bits in the
/// others.
const SUM_LIMIT: f64 = 64.0;
/// Factor with which the firmware multiplies a 16-bit bias, instead of one.
const BIAS_INPUT: f64 = 32767.0 / 32768.0;

/// Quantises `network`. Its box must be the one of the image's domain, to a step of Q16.16.
pub fn quantize(network: &Network) -> Result<NetworkParameters, QuantizeError> {
    let sizes = network.shape().sizes();
    if sizes != [INPUTS, NEURONS, NEURONS, NEURONS, 1] {
        return Err(QuantizeError::Shape { found: sizes.to_vec() });
    }
    let layers: Vec<_> = network.layers().collect();
    let mut parameters = NetworkParameters::default();
    for (j, (weights, bias)) in layers[0].iter().enumerate() {
        check_sum(0, j, weights, *bias)?;
        for (i, weight) in weights.iter().enumerate() {
            parameters.first[j][i] = fixed(&format!("weight {i} of neuron {j} in layer 0"), *weight, 26)?;
        }
        parameters.first[j][INPUTS] = fixed(&format!("bias of neuron {j} in layer 0"), *bias, 25)?;
    }
    for (layer, neurons) in parameters.hidden.iter_mut().enumerate() {
        for (j, place) in neurons.iter_mut().enumerate() {
            let (weights, bias) = layers[layer + 1][j];
            *place = neuron(layer + 1, j, weights, bias)?;
        }
    }
    let (weights, bias) = layers[3][0];
    // The scale takes the output's magnitude, a whole number of steps of Q16.16; the weights take the exact rest.
    let torques: Vec<f64> = weights.iter().map(|w| w * network.output_scale()).collect();
    let bias = bias * network.output_scale();
    let largest = torques.iter().fold(bias.abs(), |most, t| most.max(t.abs()));
    let scale = (largest * 65536.0).ceil().max(1.0);
    parameters.scale = to_integer("scale of the network", scale / 65536.0, 65536.0, 1.0, f64::from(MAX_SCALE))?;
    let weights: Vec<f64> = torques.iter().map(|t| t * 65536.0 / scale).collect();
    parameters.output = neuron(3, 0, &weights, bias * 65536.0 / scale)?;
    Ok(parameters)
}

/// The network that stored parameters stand for. Inputs whose range is empty or without limits have no influence.
pub fn dequantize(parameters: &NetworkParameters, domain: &Domain) -> Result<Network, QuantizeError> {
    let ends = |pick: fn(&friction_compensation::friction::domain::Range) -> i32| {
        std::array::from_fn(|i| from_q16(pick(&domain.ranges[i])))
    };
    let impossible = |error: crate::network::NetworkError| QuantizeError::Network(error.to_string());
    let used: [bool; INPUTS] = std::array::from_fn(|i| parameters.first.iter().any(|weights| weights[i] != 0));
    let input_box = InputBox::new(ends(|range| range.low), ends(|range| range.high), used).map_err(impossible)?;
    let active = input_box.active();
    let mut values = Vec::new();
    for weights in &parameters.first {
        let weight = |i: usize| if active[i] { f64::from(weights[i]) / 2f64.powi(26) } else { 0.0 };
        values.extend((0..INPUTS).map(weight));
        values.push(f64::from(weights[INPUTS]) / 2f64.powi(25));
    }
    for neuron in parameters.hidden.iter().flatten().chain([&parameters.output]) {
        let unit = 2f64.powi(i32::from(neuron.fraction));
        values.extend(neuron.weights[..NEURONS].iter().map(|w| f64::from(*w) / unit));
        values.push(f64::from(neuron.weights[NEURONS]) * BIAS_INPUT / unit);
    }
    Network::new(&FIRMWARE_HIDDEN, input_box, from_q16(parameters.scale), values).map_err(impossible)
}

fn fixed(what: &str, value: f64, fraction: i32) -> Result<i32, QuantizeError> {
    to_integer(what, value, 2f64.powi(fraction), f64::from(i32::MIN), f64::from(i32::MAX))
}

fn check_sum(layer: usize, neuron: usize, weights: &[f64], bias: f64) -> Result<(), QuantizeError> {
    let sum = weights.iter().map(|w| w.abs()).sum::<f64>() + bias.abs();
    if sum < SUM_LIMIT { Ok(()) } else { Err(QuantizeError::Sum { layer, neuron, sum, limit: SUM_LIMIT }) }
}

/// The finest scale at which all weights fit 16 bits and their sum 32.
fn neuron(layer: usize, index: usize, weights: &[f64], bias: f64) -> Result<Neuron, QuantizeError> {
    check_sum(layer, index, weights, bias)?;
    for fraction in (MIN_FRACTION..=MAX_FRACTION).rev() {
        let scale = 2f64.powi(i32::from(fraction));
        let rounded: Vec<f64> =
            weights.iter().map(|w| (w * scale).round()).chain([(bias / BIAS_INPUT * scale).round()]).collect();
        let fits = rounded.iter().all(|w| w.abs() <= f64::from(i16::MAX));
        let sum: f64 = rounded.iter().map(|w| w.abs()).sum();
        if fits && sum * 32768.0 < 2f64.powi(31) {
            return Ok(Neuron { weights: std::array::from_fn(|i| rounded[i] as i16), fraction });
        }
    }
    let sum = weights.iter().map(|w| w.abs()).sum::<f64>() + bias.abs();
    Err(QuantizeError::Sum { layer, neuron: index, sum, limit: SUM_LIMIT / 2.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::{TrainingSet, levenberg_marquardt};
    use friction_compensation::friction::domain::Range;
    use friction_compensation::friction::network::Network as FirmwareNetwork;
    use friction_compensation::friction::state::SIGNALS;
    use rand::RngExt;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    /// A network like a trained one: weights of the first layer up to 3, of the velocity up to 20, of the others up to
    /// 1.5.
    fn network(seed: u64) -> (Network, Domain) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let range = Range { low: -(4 << 16), high: 4 << 16 };
        let domain = Domain { ranges: [range; SIGNALS], margin: 0, reference_temperature: 0 };
        let input_box = InputBox::new([-4.0; INPUTS], [4.0; INPUTS], [true; INPUTS]).unwrap();
        let mut parameters = Vec::new();
        for _ in 0..NEURONS {
            for input in 0..=INPUTS {
                let largest = if input == 1 { 20.0 } else { 3.0 };
                parameters.push(random.random_range(-largest..=largest));
            }
        }
        parameters.extend((0..2 * NEURONS * (NEURONS + 1) + NEURONS + 1).map(|_| random.random_range(-1.5..=1.5)));
        (Network::new(&FIRMWARE_HIDDEN, input_box, 2.5, parameters).unwrap(), domain)
    }

    #[test]
    fn sixteen_random_networks_depart_from_f64_by_at_most_a_thousandth_of_full_scale() {
        for seed in 0..16 {
            let (float, domain) = network(seed);
            let (worst, full_scale) = departure(&float, &domain, 100 + seed);
            assert!(worst <= 1e-3 * full_scale, "seed {seed}: {worst} of {full_scale}");
        }
    }

    /// Largest departure from f64, and the largest output, over random states in the box.
    fn departure(float: &Network, domain: &Domain, seed: u64) -> (f64, f64) {
        let fixed = FirmwareNetwork::new(&quantize(float).unwrap(), domain);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut worst, mut full_scale) = (0.0f64, 0.0f64);
        for _ in 0..20_000 {
            let signals: [i32; SIGNALS] = std::array::from_fn(|_| random.random_range(-(4 << 16)..=4 << 16));
            let exact = float.evaluate(&std::array::from_fn(|i| f64::from(signals[i]) / 65536.0));
            full_scale = full_scale.max(exact.abs());
            worst = worst.max((fixed.evaluate(&signals).to_f64() - exact).abs());
        }
        (worst, full_scale)
    }

    /// Friction with an edge at standstill of `width` rad/s, learned from 1500 samples.
    fn trained(seed: u64, width: f64) -> Network {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut set = |count: usize| {
            let inputs: Vec<[f64; INPUTS]> = (0..count)
                .map(|_| {
                    let mut row = std::array::from_fn(|_| random.random_range(-4.0..4.0));
                    // Half of the samples around standstill, as in a recording of slow reversals.
                    row[1] *= if random.random_range(0..2) == 0 { 0.05 } else { 1.0 };
                    row
                })
                .collect();
            let friction = |[q, v, load, _, temperature]: &[f64; INPUTS]| {
                (1.0 + 0.1 * q.sin() + 0.05 * load.abs() - 0.03 * temperature) * (v / width).tanh() + 0.2 * v
            };
            let targets = inputs.iter().map(friction).collect();
            TrainingSet::unweighted(inputs, targets)
        };
        let (train, validation) = (set(1500), set(500));
        let input_box = InputBox::new([-4.0; INPUTS], [4.0; INPUTS], [true; INPUTS]).unwrap();
        let options = levenberg_marquardt::Options {
            seeds: vec![seed],
            decay: 0.0,
            max_epochs: 300,
            max_fail: 300,
            ..Default::default()
        };
        levenberg_marquardt::train(&train, &validation, &input_box, &options, &|_| ()).unwrap().network
    }

    /// The same function over a box so much wider that the largest weight of the velocity is 20.
    fn stretched(float: &Network) -> Network {
        let mut parameters = float.parameters().to_vec();
        let weights = (0..NEURONS).map(|j| j * (INPUTS + 1) + 1);
        let largest = weights.clone().map(|i| parameters[i].abs()).fold(0.0, f64::max);
        weights.for_each(|i| parameters[i] *= 20.0 / largest);
        Network::new(&FIRMWARE_HIDDEN, *float.input_box(), 2.5, parameters).unwrap()
    }

    #[test]
    fn twelve_trained_networks_depart_from_f64_by_at_most_a_thousandth_of_full_scale() {
        let domain = network(0).1;
        for seed in 0..12 {
            let float = trained(seed, [0.4, 0.2, 0.1][seed as usize % 3]);
            for (kind, float) in [("as trained", &float), ("velocity weight 20", &stretched(&float))] {
                let (worst, full_scale) = departure(float, &domain, 100 + seed);
                println!("seed {seed}, {kind}: {:.4} % of full scale", 100.0 * worst / full_scale);
                assert!(worst <= 1e-3 * full_scale, "seed {seed}, {kind}: {worst} of {full_scale}");
            }
        }
    }

    #[test]
    fn a_stored_network_stands_for_what_was_stored() {
        let (float, domain) = network(1);
        let stored = quantize(&float).unwrap();
        assert_eq!(quantize(&dequantize(&stored, &domain).unwrap()).unwrap().first, stored.first);
    }

    #[test]
    fn a_weight_that_does_not_fit_is_refused_by_layer_and_neuron() {
        let (float, _) = network(1);
        let mut parameters = float.parameters().to_vec();
        parameters[NEURONS * (INPUTS + 1) + NEURONS + 1] = 70.0;
        let network = Network::new(&FIRMWARE_HIDDEN, *float.input_box(), 1.0, parameters).unwrap();
        let text = quantize(&network).unwrap_err().to_string();
        assert!(text.starts_with("neuron 1 of layer 1"), "{text}");
    }
}
