//! The bytes of a parameter image are those of the documented layout: an image that a device stores today is read the
//! same tomorrow.

use friction_compensation::friction::FrictionParameters;
use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::Range;
use friction_compensation::friction::maxwell_slip::MaxwellElement;
use friction_compensation::friction::network::Neuron;
use friction_compensation::friction::physical::{Coefficients, Terms};
use friction_compensation::friction::regime::{Criterion, Measure, Selector};
use friction_compensation::friction::ripple::Ripple;
use friction_compensation::parameters::certificate::Limits;
use friction_compensation::parameters::image::{Effort, GoldenVector, Image, Target};
use friction_compensation::quantity::Torque;
use host_tests::image_bytes::{crc32, encoded, sealed};
use host_tests::parameters::frictionless;

/// The coefficients in the order of the bytes: it is part of the format.
const COEFFICIENTS: [&str; 35] = [
    "constant",
    "position",
    "temperature",
    "load",
    "viscous",
    "viscous_temperature",
    "quadratic",
    "coulomb_positive",
    "coulomb_negative",
    "coulomb_temperature",
    "coulomb_load",
    "coulomb_slope",
    "breakaway_positive",
    "breakaway_negative",
    "stribeck_slope",
    "hysteresis",
    "hysteresis_velocity_slope",
    "hysteresis_width",
    "hysteresis_acceleration_slope",
    "harmonic_frequency",
    "harmonic_positive_1",
    "harmonic_positive_2",
    "harmonic_positive_3",
    "harmonic_positive_4",
    "harmonic_positive_5",
    "harmonic_negative_1",
    "harmonic_negative_2",
    "harmonic_negative_3",
    "harmonic_negative_4",
    "harmonic_negative_5",
    "rotor_inertia",
    "viscous_asymmetry",
    "weakening_positive",
    "weakening_negative",
    "weakening_slope",
];

/// Coefficients of a set in a format.
fn coefficients_of(format: u16) -> usize {
    [31, 32, 35][usize::from(format) - 1]
}

/// An image with two sets, the second with a network, written by hand from the table in `parameters::image`.
fn hand_packed(format: u16) -> Vec<u8> {
    let mut bytes: Vec<u8> = vec![];
    bytes.extend(b"JFPI");
    bytes.extend(format.to_le_bytes());
    let (common, set) = [(0, 128), (72, 132), (72, 144)][usize::from(format) - 1];
    bytes.extend((144u16 + common + set + set + 280 + 2 * 36 + 4).to_le_bytes());
    bytes.extend(0x0102_0304u32.to_le_bytes()); // version
    bytes.extend(0x1112_1314u32.to_le_bytes()); // product
    bytes.extend(0x2122_2324u32.to_le_bytes()); // serial
    bytes.extend(0x3132_3334_3536_3738u64.to_le_bytes()); // creation time
    bytes.extend([2, 2, 0b10, 2]); // ampere, sets, networks, golden vectors
    bytes.extend(core::array::from_fn::<u8, 16, _>(|i| 0xd0 + i as u8));
    assert_eq!(bytes.len(), 48);
    for signal in 0..6i32 {
        bytes.extend((-1000 - signal).to_le_bytes());
        bytes.extend((2000 + signal).to_le_bytes());
    }
    bytes.extend(0x8000_0001u32.to_le_bytes()); // margin
    bytes.extend((-7i32).to_le_bytes()); // reference temperature
    bytes.extend(0x9000_0002u32.to_le_bytes()); // cross-fade
    bytes.extend([3, 0, 0, 0]); // coupled
    bytes.extend(77i32.to_le_bytes());
    bytes.extend((-78i32).to_le_bytes());
    bytes.extend([0; 12]);
    assert_eq!(bytes.len(), 132);
    bytes.extend(0xf000_0001u32.to_le_bytes());
    bytes.extend(0xf000_0002u32.to_le_bytes());
    bytes.extend(0xf000_0003u32.to_le_bytes());
    if format >= 2 {
        for element in 0..4i32 {
            bytes.extend((100_000 * element + 3).to_le_bytes()); // stiffness
            bytes.extend((7_000 * element + 5).to_le_bytes()); // level
        }
        for number in 0..10i32 {
            bytes.extend((123_456 * (number - 4)).to_le_bytes()); // two ripples
        }
    }
    for set in 0..2i32 {
        bytes.extend(if set == 0 { 0x2aaau16 } else { 0x1555 }.to_le_bytes());
        bytes.extend([0, 0]);
        for coefficient in 0..coefficients_of(format) as i32 {
            bytes.extend((10_000 * (set + 1) - coefficient * 700).to_le_bytes());
        }
    }
    for weight in 0..30i32 {
        bytes.extend((weight * 70_000_003 - 1_000_000_000).to_le_bytes());
    }
    for neuron in 0..11i16 {
        for weight in 0..6i16 {
            bytes.extend((neuron * 2000 + weight * 300 - 12_000).to_le_bytes());
        }
        bytes.extend([10 + neuron as u8 % 11, 0]);
    }
    bytes.extend((-123_456i32).to_le_bytes()); // torque for an output of 1
    bytes.extend([0, 0]);
    for vector in 0..2i32 {
        bytes.extend([vector as u8, 0, 0, 0]);
        for value in 0..8i32 {
            bytes.extend((500_000 * (value - 4) + vector).to_le_bytes());
        }
    }
    bytes.extend([0; 4]);
    sealed(bytes)
}

#[test]
fn bytes_packed_by_hand_from_the_documented_layout_are_the_image_they_describe() {
    for format in [1, 2, 3] {
        bytes_packed_by_hand_are_the_image_they_describe(format);
    }
}

fn bytes_packed_by_hand_are_the_image_they_describe(format: u16) {
    assert_eq!(Coefficients::NAMES, COEFFICIENTS);
    assert_eq!(crc32(b"123456789"), 0xcbf4_3926, "check value of CRC-32 ISO-HDLC");
    let coefficient = |set: i32, i: usize| if i < coefficients_of(format) { 10_000 * set - i as i32 * 700 } else { 0 };
    let coefficients = |set: i32| Coefficients::from_array(core::array::from_fn(|i| coefficient(set, i)));
    let mut friction = FrictionParameters {
        selector: Selector {
            criteria: [Some(Criterion { measure: Measure::Coupled, enter: 77, leave: -78 }), None],
            fade_time: 0x9000_0002,
        },
        ..frictionless()
    };
    friction.domain.ranges = core::array::from_fn(|i| Range { low: -1000 - i as i32, high: 2000 + i as i32 });
    if format >= 2 {
        let element = |n: i32| MaxwellElement { stiffness: 100_000 * n + 3, level: 7_000 * n + 5 };
        let number = |n: i32| 123_456 * (n - 4);
        let ripple = |n: i32| Ripple {
            periods: number(n),
            level_sine: number(n + 1),
            level_cosine: number(n + 2),
            torque_sine: number(n + 3),
            torque_cosine: number(n + 4),
        };
        friction.common =
            CommonTerms { elements: core::array::from_fn(|n| element(n as i32)), ripples: [ripple(0), ripple(5)] };
    }
    (friction.domain.margin, friction.domain.reference_temperature) = (0x8000_0001, -7);
    let [first, second, ..] = &mut friction.sets;
    first.physical.terms = Terms(0x2aaa);
    second.physical.terms = Terms(0x1555);
    (first.physical.coefficients, second.physical.coefficients) = (coefficients(1), coefficients(2));
    let neuron = |n: usize| Neuron {
        weights: core::array::from_fn(|w| n as i16 * 2000 + w as i16 * 300 - 12_000),
        fraction: 10 + n as u8 % 11,
    };
    let network = second.network.insert(Default::default());
    network.first = core::array::from_fn(|n| core::array::from_fn(|w| (6 * n + w) as i32 * 70_000_003 - 1_000_000_000));
    network.hidden = core::array::from_fn(|layer| core::array::from_fn(|n| neuron(5 * layer + n)));
    (network.output, network.scale) = (neuron(10), -123_456);
    let vector = |n: i32| {
        let value = |i: i32| 500_000 * (i - 4) + n;
        let mut vector =
            GoldenVector { set: n as u8, signals: core::array::from_fn(|i| value(i as i32)), ..Default::default() };
        vector.expected.physical = Torque::from_bits(value(6));
        vector.expected.network = Torque::from_bits(value(7));
        vector
    };
    let expected = Image {
        version: 0x0102_0304,
        target: Target { product: 0x1112_1314, serial: 0x2122_2324 },
        created: 0x3132_3334_3536_3738,
        effort: Effort::Ampere,
        data_hash: core::array::from_fn(|i| 0xd0 + i as u8),
        friction,
        limits: Limits { output: 0xf000_0001, torque_gain: 0xf000_0002, velocity_slope: 0xf000_0003 },
        golden: [vector(0), vector(1)].into_iter().collect(),
    };
    let bytes = hand_packed(format);
    assert_eq!(Image::decode(&bytes).as_ref(), Ok(&expected));
    assert_eq!(encoded(&expected), bytes);
}
