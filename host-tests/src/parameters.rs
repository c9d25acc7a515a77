//! Friction parameters drawn from a seed: [`tame`] ones look like those of identified joints and trained networks,
//! [`extreme`] ones use every bit that an image may hold.

use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::{Domain, Range};
use friction_compensation::friction::maxwell_slip::{ELEMENTS, MAX_LEVEL, MAX_STIFFNESS, MaxwellElement};
use friction_compensation::friction::network::{
    INPUTS, MAX_FRACTION, MAX_SCALE, MIN_FRACTION, NEURONS, NetworkParameters, Neuron,
};
use friction_compensation::friction::physical::{Coefficients, Dimension, PhysicalParameters, Terms, held_by};
use friction_compensation::friction::regime::{Criterion, MAX_CRITERIA, MOST_SETS, Measure, Selector};
use friction_compensation::friction::ripple::Ripple;
use friction_compensation::friction::state::{JointState, SIGNALS, Signal};
use friction_compensation::friction::{Estimate, FrictionModel, FrictionParameters, ParameterSet};
use friction_compensation::parameters::certificate::Limits;
use friction_compensation::parameters::image::{
    GoldenSequence, GoldenVector, Image, ImageError, MAX_GOLDEN, MAX_LENGTH,
};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::states;

/// Q16.16 of a number in SI; held at the ends of the range.
pub fn q16(value: f64) -> i32 {
    (value * 65536.0).round() as i32
}

/// The range from `low` to `high` in SI.
pub fn range(low: f64, high: f64) -> Range {
    Range { low: q16(low), high: q16(high) }
}

/// Value in SI of one full scale of a signal in the physical model.
pub fn full_scale(domain: &Domain, signal: Signal) -> f64 {
    2f64.powi(15 - domain.shifts()[signal as usize] as i32)
}

/// Coefficients from their values in SI, in the order of [`Coefficients::NAMES`].
pub fn coefficients(domain: &Domain, si: &[f64; Coefficients::COUNT]) -> Coefficients {
    let mut stored = [0; Coefficients::COUNT];
    for ((stored, si), Dimension { per, .. }) in stored.iter_mut().zip(si).zip(Coefficients::DIMENSIONS) {
        let scale = per.map_or(1.0, |(signal, power)| full_scale(domain, signal).powi(power as i32));
        *stored = q16(si * scale);
    }
    Coefficients::from_array(stored)
}

/// One set without any term or network, in a box of +-1 of every signal's unit without a margin.
pub fn frictionless() -> FrictionParameters {
    FrictionParameters {
        domain: Domain { ranges: [range(-1.0, 1.0); SIGNALS], margin: 0, reference_temperature: 0 },
        selector: Selector::default(),
        common: CommonTerms::NONE,
        sets: Default::default(),
    }
}

/// Parameters like those of an identified joint: 1, 2 or 4 sets, each with a network in two cases of three.
pub fn tame(random: &mut ChaCha8Rng) -> FrictionParameters {
    tame_within(random, MOST_SETS)
}

/// The same with so many sets at the most: 1, 2 or 4.
pub fn tame_within(random: &mut ChaCha8Rng, most_sets: usize) -> FrictionParameters {
    let domain = tame_domain(random);
    let mut selector = Selector { fade_time: q16(random.random_range(0.01..0.3)) as u32, ..Selector::default() };
    for criterion in selector.criteria.iter_mut().take(random.random_range(0..=most_sets.ilog2() as usize)) {
        let enter = q16(random.random_range(0.1..2.0));
        let measure = [Measure::Acceleration, Measure::Speed, Measure::Coupled][random.random_range(0..3)];
        *criterion = Some(Criterion { measure, enter, leave: enter - enter / 4 });
    }
    let mut parameters = FrictionParameters { domain, selector, common: CommonTerms::NONE, sets: Default::default() };
    for set in parameters.sets.iter_mut().take(selector.sets()) {
        *set = ParameterSet {
            physical: tame_physical(random, &domain),
            network: random.random_bool(0.67).then(|| tame_network(random)),
        };
    }
    if random.random() {
        parameters.common = tame_common(random);
    } else {
        to_format(&mut parameters, 1);
    }
    parameters
}

/// Takes away what an image of a format cannot hold.
pub fn to_format(parameters: &mut FrictionParameters, format: u16) {
    if format < 2 {
        parameters.common = CommonTerms::NONE;
    }
    let (terms, coefficients) = held_by(format);
    for set in &mut parameters.sets {
        set.physical.terms = Terms(set.physical.terms.0 & terms.0);
        let mut array = set.physical.coefficients.to_array();
        array[coefficients..].fill(0);
        set.physical.coefficients = Coefficients::from_array(array);
    }
}

/// Pre-sliding over 0.3 to 100 mrad and two ripples of up to 0.2 Nm, some of them absent.
pub fn tame_common(random: &mut ChaCha8Rng) -> CommonTerms {
    let mut common = CommonTerms::NONE;
    for element in common.elements.iter_mut().take(random.random_range(0..=ELEMENTS)) {
        let distance = 10f64.powf(random.random_range(-3.5..-1.0));
        *element = MaxwellElement { stiffness: q16(1.0 / distance), level: q16(random.random_range(0.01..1.0)) };
    }
    for ripple in common.ripples.iter_mut().take(random.random_range(0..=2)) {
        let mut amplitude = || q16(random.random_range(-0.2..0.2));
        let (level_sine, level_cosine, torque_sine, torque_cosine) =
            (amplitude(), amplitude(), amplitude(), amplitude());
        let periods = q16(random.random_range(0.1..30.0));
        *ripple = Ripple { periods, level_sine, level_cosine, torque_sine, torque_cosine };
    }
    common
}

/// Any common terms.
fn extreme_common(random: &mut ChaCha8Rng) -> CommonTerms {
    let calm = random.random_range(0..16);
    let mut common = CommonTerms::NONE;
    for element in &mut common.elements {
        let mut up_to = |most: i32| bits(random).saturating_abs().min(most);
        *element = MaxwellElement { stiffness: up_to(MAX_STIFFNESS), level: up_to(MAX_LEVEL) >> calm };
    }
    for ripple in &mut common.ripples {
        let periods = bits(random);
        let mut amplitude = || bits(random) >> calm;
        let (level_sine, level_cosine, torque_sine, torque_cosine) =
            (amplitude(), amplitude(), amplitude(), amplitude());
        *ripple = Ripple { periods, level_sine, level_cosine, torque_sine, torque_cosine };
    }
    common
}

/// The box of a robot joint.
pub fn tame_domain(random: &mut ChaCha8Rng) -> Domain {
    let mut symmetric = |least: f64, most: f64| {
        let half = random.random_range(least..most);
        let offset = half * random.random_range(-0.2..0.2);
        range(offset - half, offset + half)
    };
    let (position, velocity) = (symmetric(0.5, 3.2), symmetric(0.5, 12.0));
    let (torque, measured, acceleration) = (symmetric(2.0, 80.0), symmetric(2.0, 90.0), symmetric(5.0, 150.0));
    let coldest = random.random_range(10.0..30.0);
    let temperature = range(coldest, coldest + random.random_range(5.0..50.0));
    Domain {
        ranges: [position, velocity, torque, measured, temperature, acceleration],
        margin: q16(random.random_range(0.05..0.5)) as u32,
        reference_temperature: q16(random.random_range(20.0..40.0)),
    }
}

/// A physical model of ordinary size: friction of 0.1 to 5 Nm whose terms each take part in three cases of four.
pub fn tame_physical(random: &mut ChaCha8Rng, domain: &Domain) -> PhysicalParameters {
    let terms = (0..16).filter(|_| random.random_bool(0.75)).fold(0, |terms, bit| terms | 1 << bit);
    let level = random.random_range(0.1..5.0);
    let mut si = [0.0; Coefficients::COUNT];
    for (value, name) in si.iter_mut().zip(Coefficients::NAMES) {
        let (low, high) = match name {
            "constant" => (-0.1 * level, 0.1 * level),
            "position" => (-0.05 * level, 0.05 * level),
            "temperature" => (-0.01 * level, 0.01 * level),
            "load" => (-0.03, 0.03),
            "viscous" => (0.02 * level, 0.5 * level),
            "viscous_temperature" | "coulomb_temperature" => (-0.01, 0.002),
            "quadratic" => (-0.02 * level, 0.05 * level),
            "coulomb_positive" | "coulomb_negative" => (0.6 * level, level),
            "coulomb_load" => (0.0, 0.02),
            "coulomb_slope" => (5.0, 100.0),
            "breakaway_positive" | "breakaway_negative" => (level, 1.6 * level),
            "stribeck_slope" | "weakening_slope" => (1.0, 20.0),
            "weakening_positive" | "weakening_negative" => (0.0, 0.9),
            "hysteresis" => (0.0, 0.3 * level),
            "hysteresis_velocity_slope" => (1.0, 50.0),
            "hysteresis_width" => (0.0, 2.0),
            "hysteresis_acceleration_slope" => (0.1, 10.0),
            "harmonic_frequency" => (0.5, 20.0),
            "rotor_inertia" => (0.0, 0.01 * level),
            _ => (-0.1 * level, 0.1 * level), // harmonics, viscous asymmetry
        };
        *value = random.random_range(low..high);
    }
    PhysicalParameters { terms: Terms(terms), coefficients: coefficients(domain, &si) }
}

/// A network with the weights of a trained one: of order one, but up to 20 where a neuron models the Coulomb edge.
pub fn tame_network(random: &mut ChaCha8Rng) -> NetworkParameters {
    // The sum of four uniform numbers: near enough to a normal distribution, of standard deviation `deviation`.
    let mut normal = |deviation: f64| {
        (0..4).map(|_| random.random_range(-1.0..1.0)).sum::<f64>() * deviation * (3.0f64 / 4.0).sqrt()
    };
    let mut first = [[0; INPUTS + 1]; NEURONS];
    for row in &mut first {
        *row = core::array::from_fn(|i| (normal(0.6) * 2f64.powi(if i < INPUTS { 26 } else { 25 })) as i32);
    }
    let hidden = core::array::from_fn(|_| core::array::from_fn(|_| quantized(core::array::from_fn(|_| normal(0.6)))));
    let output = quantized(core::array::from_fn(|_| normal(0.6)));
    for row in first.iter_mut().take(random.random_range(1..=2)) {
        let weight = random.random_range(3.0..20.0) * if random.random() { 1.0 } else { -1.0 };
        row[Signal::Velocity as usize] = (weight * 2f64.powi(26)) as i32;
    }
    NetworkParameters { first, hidden, output, scale: q16(random.random_range(0.05..2.0)) }
}

/// A neuron with the most fraction bits for which weights fit 16 bits and the sum 32.
pub fn quantized(weights: [f64; NEURONS + 1]) -> Neuron {
    let largest = weights.iter().fold(0.0f64, |most, weight| most.max(weight.abs()));
    let sum: f64 = weights.iter().map(|weight| weight.abs()).sum();
    let fits = |fraction: &u8| {
        let scale = 2f64.powi(*fraction as i32);
        largest * scale < 32_767.0 && sum * scale < 65_500.0
    };
    let fraction = (MIN_FRACTION..=MAX_FRACTION).rev().find(fits).unwrap_or(MIN_FRACTION);
    Neuron { weights: weights.map(|weight| (weight * 2f64.powi(fraction as i32)).round() as i16), fraction }
}

/// Parameters of any size that an image may hold. About half of them do not overflow.
pub fn extreme(random: &mut ChaCha8Rng) -> FrictionParameters {
    let domain = extreme_domain(random);
    let mut selector = Selector { fade_time: bits(random) as u32, ..Selector::default() };
    for criterion in selector.criteria.iter_mut().take(random.random_range(0..=MAX_CRITERIA)) {
        let (a, b) = (bits(random), bits(random));
        let measure = [Measure::Acceleration, Measure::Speed, Measure::Coupled][random.random_range(0..3)];
        *criterion = Some(Criterion { measure, enter: a.max(b), leave: a.min(b) });
    }
    let mut parameters = FrictionParameters { domain, selector, common: CommonTerms::NONE, sets: Default::default() };
    for set in parameters.sets.iter_mut().take(selector.sets()) {
        *set = ParameterSet {
            physical: extreme_physical(random),
            network: random.random_bool(0.6).then(|| extreme_network(random)),
        };
    }
    if random.random() {
        parameters.common = extreme_common(random);
    }
    parameters
}

/// 32 bits whose magnitude may be anything from nothing to all of them, the ends of the type included.
pub fn bits(random: &mut ChaCha8Rng) -> i32 {
    match random.random_range(0..12) {
        0 => 0,
        1 => i32::MAX,
        2 => i32::MIN,
        3 => [1, -1, 1 << 16, -(1 << 16)][random.random_range(0..4)],
        _ => random.random::<i32>() >> random.random_range(0..32),
    }
}

fn extreme_domain(random: &mut ChaCha8Rng) -> Domain {
    let mut ranges = [Range::ANY; SIGNALS];
    for range in &mut ranges {
        let (a, b) = (bits(random), bits(random));
        *range = match random.random_range(0..6) {
            0 => Range::ANY,
            1 => Range { low: a, high: a },
            2 => Range { low: a, high: a.saturating_add(random.random_range(0..40)) },
            3 => Range { low: (a >> 1).min(-(a >> 1)), high: (a >> 1).max(-(a >> 1)) },
            _ => Range { low: a.min(b), high: a.max(b) },
        };
    }
    let margin = match random.random_range(0..5) {
        0 => 0,
        1 => u32::MAX,
        2 => 1 << 16,
        _ => random.random::<u32>() >> random.random_range(0..32),
    };
    Domain { ranges, margin, reference_temperature: bits(random) }
}

/// Any term, any coefficients; most models leave some room, so that their sum can be proved to fit.
fn extreme_physical(random: &mut ChaCha8Rng) -> PhysicalParameters {
    let calm = random.random_range(0..16);
    let large = random.random_range(0..Coefficients::COUNT);
    let array = core::array::from_fn(|i| bits(random) >> if i == large { calm / 8 } else { calm });
    PhysicalParameters {
        terms: Terms(random.random_range(0..=Terms::ALL.0)),
        coefficients: Coefficients::from_array(array),
    }
}

fn extreme_network(random: &mut ChaCha8Rng) -> NetworkParameters {
    let calm = random.random_range(0..8);
    let mut neuron = || Neuron {
        weights: core::array::from_fn(|_| (bits(random) >> 16) as i16 >> (random.random_range(0..=3) + calm / 2)),
        fraction: random.random_range(MIN_FRACTION..=MAX_FRACTION),
    };
    let hidden = core::array::from_fn(|_| core::array::from_fn(|_| neuron()));
    let output = neuron();
    NetworkParameters {
        first: core::array::from_fn(|_| {
            core::array::from_fn(|_| bits(random) >> (random.random_range(0..=3) + calm / 2))
        }),
        hidden,
        output,
        scale: bits(random).clamp(-MAX_SCALE, MAX_SCALE),
    }
}

/// An image of `friction` with `golden` golden vectors (1 to [`MAX_GOLDEN`], or fewer where no more have room) that
/// hold, and no limit below the type's.
pub fn image(random: &mut ChaCha8Rng, friction: FrictionParameters, golden: usize) -> Image {
    let model = FrictionModel::new(&friction, 20_000);
    let mut vectors = heapless::Vec::new();
    let mut sequence = GoldenSequence::new(&friction.common);
    for _ in 0..golden.clamp(1, MAX_GOLDEN) {
        let set = random.random_range(0..friction.selector.sets());
        let signals = states::signals(random, &friction);
        let state = JointState::from_signals(signals);
        let expected: Estimate = model.evaluate_with(set, &state, &sequence.next(&state));
        // The count was held at the capacity.
        let _ = vectors.push(GoldenVector { set: set as u8, signals, expected });
    }
    let mut image = Image {
        version: random.random(),
        target: Default::default(),
        created: random.random(),
        effort: Default::default(),
        data_hash: random.random(),
        friction,
        limits: Limits { output: u32::MAX, torque_gain: u32::MAX, velocity_slope: u32::MAX },
        golden: vectors,
    };
    while image.golden.len() > 1 && matches!(image.encode(&mut [0; MAX_LENGTH]), Err(ImageError::TooLong { .. })) {
        image.golden.pop();
    }
    image
}
