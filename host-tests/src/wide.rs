//! The friction model once more, in 128-bit integers: the same roundings and tables as the control step, but no sum can
//! wrap and no shift can lose a bit. Where the control step gives the same, nothing in it overflowed.

use friction_compensation::friction::FrictionParameters;
use friction_compensation::friction::common::CommonTorques;
use friction_compensation::friction::domain::{Domain, Range};
use friction_compensation::friction::network::{INPUTS, MIN_FRACTION, NetworkParameters, Neuron};
use friction_compensation::friction::physical::{PhysicalParameters, Terms};
use friction_compensation::friction::smooth::{atan, odd_sines, stribeck, tanh};
use friction_compensation::friction::state::{SIGNALS, Signal};

/// Torques of the physical model and of the network of one set, Q16.16, with what the common terms give.
pub fn evaluate(
    parameters: &FrictionParameters,
    set: usize,
    signals: &[i32; SIGNALS],
    common: &CommonTorques,
) -> (i128, i128) {
    let set = &parameters.sets[set];
    let network = set.network.as_ref().map_or(0, |network| evaluate_network(network, &parameters.domain, signals));
    (evaluate_physical(&set.physical, &parameters.domain, signals, common), network)
}

fn saturate(value: i128) -> i128 {
    value.clamp(i32::MIN as i128, i32::MAX as i128)
}

/// A table's argument: tables saturate by themselves.
fn argument(value: i128) -> i32 {
    saturate(value) as i32
}

/// Drops fraction bits, rounding half up.
fn round(value: i128, bits: u32) -> i128 {
    (value + (1 << (bits - 1))) >> bits
}

fn evaluate_physical(
    model: &PhysicalParameters,
    domain: &Domain,
    signals: &[i32; SIGNALS],
    common: &CommonTorques,
) -> i128 {
    const ONE: i128 = 1 << 16;
    let on = |term: Terms, value: i32| if model.terms.contains(term) { value as i128 } else { 0 };
    let c = &model.coefficients;
    let (wide, shifts) = (domain.widened(), domain.shifts());
    let scaled = |signal: Signal| {
        let Range { low, high } = wide[signal as usize];
        let clamped = signals[signal as usize].clamp(low, high) as i128;
        let origin = if signal == Signal::Temperature { domain.reference_temperature as i128 } else { 0 };
        saturate(clamped - origin) << shifts[signal as usize]
    };
    let magnitude = |value: i128| value.abs().min(i32::MAX as i128);
    let by_direction = |positive: i128, negative: i128, v: i128| if v < 0 { negative } else { positive };

    let (q, v, load) = (scaled(Signal::Position), scaled(Signal::Velocity), scaled(Signal::TheoreticalTorque));
    let (th, a) = (scaled(Signal::Temperature), scaled(Signal::Acceleration));

    let mut sum = (on(Terms::CONSTANT, c.constant) + common.ripple.torque as i128) << 31;
    sum += on(Terms::POSITION, c.position) * q;
    sum += on(Terms::TEMPERATURE, c.temperature) * th;
    sum += on(Terms::LOAD, c.load) * load;
    sum += on(Terms::ROTOR_INERTIA, c.rotor_inertia) * a;

    let factor = saturate(ONE + saturate(round(on(Terms::VISCOUS_TEMPERATURE, c.viscous_temperature) * th, 31)));
    sum += saturate(round(on(Terms::VISCOUS, c.viscous) * factor, 16)) * v;
    sum += on(Terms::VISCOUS_ASYMMETRY, c.viscous_asymmetry) * magnitude(v);
    sum += on(Terms::QUADRATIC, c.quadratic) * saturate((v * magnitude(v)) >> 31);

    let direction = tanh(argument((c.coulomb_slope as i128 * v) >> 22)) as i128;
    let coulomb = (on(Terms::COULOMB, c.coulomb_positive), on(Terms::COULOMB, c.coulomb_negative));
    let factor = saturate(ONE + saturate(round(on(Terms::COULOMB_TEMPERATURE, c.coulomb_temperature) * th, 31)));
    let factor = saturate(factor + saturate(round(on(Terms::COULOMB_LOAD, c.coulomb_load) * magnitude(load), 31)));
    let factor = if model.terms.contains(Terms::VELOCITY_WEAKENING) {
        let edge = tanh(argument((c.weakening_slope as i128 * v) >> 22)) as i128;
        let bell = i32::MAX as i128 - 2 * ((edge * edge) >> 32);
        let (forward, backward) = (c.weakening_positive as i128 >> 1, c.weakening_negative as i128 >> 1);
        let amount = saturate(forward + backward + saturate(round((forward - backward) * direction, 31)));
        saturate(round(factor * saturate(ONE + saturate(round(amount * bell, 31))), 16))
    } else {
        factor
    };
    let level = saturate(by_direction(coulomb.0, coulomb.1, v) + common.ripple.level as i128);
    sum += saturate(round(level * factor, 16)) * direction;
    sum += saturate(round(common.pre_sliding as i128 * factor, 16)) * i32::MAX as i128;

    if model.terms.contains(Terms::STRIBECK) {
        let positive = saturate(c.breakaway_positive as i128 - coulomb.0);
        let negative = saturate(c.breakaway_negative as i128 - coulomb.1);
        let bump = stribeck(argument((c.stribeck_slope as i128 * v) >> 21)) as i128;
        sum += by_direction(positive, negative, v) * bump;
    }
    if model.terms.contains(Terms::HYSTERESIS) {
        let sign = saturate((c.hysteresis_acceleration_slope as i128 * a) >> 16);
        let velocity = saturate(round(c.hysteresis_velocity_slope as i128 * v, 31));
        let angle = atan(argument(velocity + saturate(round(c.hysteresis_width as i128 * sign, 31)))) as i128;
        // pi / 2 in Q30.
        sum += saturate(round(c.hysteresis as i128 * 1_686_629_713, 30)) * angle;
    }
    if model.terms.contains(Terms::HARMONICS) {
        // 1 / (2 pi) in Q33, and half of 4 / (pi (2j - 1)) in Q31.
        let turns = saturate(round(c.harmonic_frequency as i128 * 1_367_130_551, 33));
        let sines = odd_sines(((turns * q) >> 15) as u32);
        let pairs = [
            (c.harmonic_positive_1, c.harmonic_negative_1, 1_367_130_551),
            (c.harmonic_positive_2, c.harmonic_negative_2, 455_710_184),
            (c.harmonic_positive_3, c.harmonic_negative_3, 273_426_110),
            (c.harmonic_positive_4, c.harmonic_negative_4, 195_304_364),
            (c.harmonic_positive_5, c.harmonic_negative_5, 151_903_395),
        ];
        let (mut mean, mut difference) = (0, 0);
        for ((positive, negative, half_factor), sine) in pairs.into_iter().zip(sines) {
            let (positive, negative, sine) = (positive as i128, negative as i128, sine as i128);
            mean += saturate(round((positive + negative) * half_factor, 31)) * sine;
            difference += saturate(round((positive - negative) * half_factor, 31)) * sine;
        }
        let difference = saturate(round(saturate(round(difference, 30)) * direction, 31));
        sum += saturate(saturate(round(mean, 30)) + difference) * i32::MAX as i128;
    }
    round(sum, 31)
}

fn evaluate_network(network: &NetworkParameters, domain: &Domain, signals: &[i32; SIGNALS]) -> i128 {
    let inputs: [i128; INPUTS] = core::array::from_fn(|i| scaled_input(domain.ranges[i], signals[i]));
    let mut active = network.first.map(|[w0, w1, w2, w3, w4, bias]| {
        let weights = [w0, w1, w2, w3, w4];
        let products = weights.into_iter().zip(inputs).map(|(weight, x): (i32, i128)| (weight as i128 * x) >> 32);
        fitting(bias as i128 + products.sum::<i128>())
    });
    for layer in &network.hidden {
        let activations = active.map(|sum| (tanh(sum) >> 16) as i128);
        active = layer.each_ref().map(|neuron| neuron_sum(neuron, activations));
    }
    let sum = neuron_sum(&network.output, active.map(|sum| (tanh(sum) >> 16) as i128));
    saturate(round(sum as i128 * network.scale as i128, 25))
}

/// The bias' input is the largest value of Q15.
fn neuron_sum(neuron: &Neuron, activations: [i128; 5]) -> i32 {
    let [weights @ .., bias] = neuron.weights;
    let sum: i128 = weights.into_iter().zip(activations).map(|(weight, active)| weight as i128 * active).sum();
    fitting(sum + bias as i128 * 0x7fff) >> (neuron.fraction - MIN_FRACTION)
}

/// A sum that the control step keeps in 32 bits.
fn fitting(sum: i128) -> i32 {
    i32::try_from(sum).expect("a neuron's sum leaves 32 bits")
}

/// An input in Q31 of its range.
fn scaled_input(range: Range, signal: i32) -> i128 {
    let half_width = range.half_width() as u128;
    if half_width == 0 {
        return 0;
    }
    let centred = signal.clamp(range.low, range.high) as i128 - range.centre() as i128;
    // The half width moves into [2^30, 2^31]; the gain is rounded down, and so is the high word of the product.
    let shift = (half_width as u32).leading_zeros().saturating_sub(1);
    let gain = ((((1 << 61) - (1 << 33)) / half_width) >> shift).min(i32::MAX as u128) as i128;
    (((centred << shift) * gain) >> 32) << 2
}
