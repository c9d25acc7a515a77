//! A parameter image arrives whole or not at all: every damage is refused and named, everything else decodes and
//! encodes to the same bytes.

use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::Range;
use friction_compensation::friction::maxwell_slip::{MAX_LEVEL, MAX_STIFFNESS};
use friction_compensation::friction::network::{MAX_SCALE, NetworkParameters, Neuron};
use friction_compensation::friction::physical::Terms;
use friction_compensation::friction::regime::{Criterion, Measure};
use friction_compensation::friction::state::{SIGNALS, Signal};
use friction_compensation::friction::{FrictionModel, FrictionParameters, ParameterSet};
use friction_compensation::parameters::certificate::Limits;
use friction_compensation::parameters::image::{
    Effort, FORMAT, GoldenMismatch, Image, ImageError, MAX_GOLDEN, MAX_LENGTH, Target,
};
use friction_compensation::quantity::Torque;
use host_tests::image_bytes::{encoded, sealed};
use host_tests::parameters::{extreme, frictionless, image, tame, tame_common, to_format};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Parameters of a format with 1, 2 or 4 sets, all of them or none with a network.
fn parameters(random: &mut ChaCha8Rng, format: u16, sets: usize, networks: bool) -> FrictionParameters {
    loop {
        let mut parameters = tame(random);
        let in_use = &parameters.sets[..parameters.selector.sets()];
        if in_use.len() == sets && in_use.iter().all(|set| set.network.is_some() == networks) {
            to_format(&mut parameters, format);
            if format > 2 && parameters.sets.iter().all(|set| set.physical.format() < format) {
                continue;
            }
            while format > 1 && parameters.common == CommonTerms::NONE {
                parameters.common = tame_common(random);
            }
            return parameters;
        }
    }
}

/// Number of golden vectors of an image with `sets` sets, all with a network or none: one a set, as long as they fit.
fn golden(format: u16, sets: usize, networks: bool) -> usize {
    sets.min(if format == 3 && networks { 2 } else { 4 })
}

/// Valid images of every shape, [`SHAPES`] of each format.
fn valid_images() -> Vec<Vec<u8>> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut images = vec![];
    for format in 1..=FORMAT {
        for sets in [1, 2, 4] {
            for networks in [false, true] {
                let image = loop {
                    let parameters = parameters(&mut random, format, sets, networks);
                    let image = image(&mut random, parameters, sets);
                    if image.format() == format {
                        break image;
                    }
                };
                images.push(encoded(&image));
            }
        }
    }
    images
}

/// Images of one format: without and with networks, for no, one and two criteria.
const SHAPES: usize = 6;

#[test]
fn every_flipped_bit_is_refused_with_its_reason() {
    for bytes in valid_images() {
        assert!(Image::decode(&bytes).is_ok());
        for bit in 0..8 * bytes.len() {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            let error = Image::decode(&damaged).expect_err("one bit is wrong");
            let stated = u16::from_le_bytes([damaged[6], damaged[7]]) as usize;
            let fits = match bit / 8 {
                0..4 => error == ImageError::NotAnImage { found: [damaged[0], damaged[1], damaged[2], damaged[3]] },
                // Another format that is known.
                4..6 if (1..=FORMAT).contains(&u16::from_le_bytes([damaged[4], damaged[5]])) => {
                    matches!(error, ImageError::Checksum { .. })
                }
                4..6 => error == ImageError::UnsupportedFormat { found: u16::from_le_bytes([damaged[4], damaged[5]]) },
                6..8 if stated > MAX_LENGTH => error == ImageError::TooLong { length: stated, limit: MAX_LENGTH },
                6..8 if stated < bytes.len() => error == ImageError::TooLong { length: bytes.len(), limit: stated },
                6..8 => error == ImageError::Truncated { length: bytes.len(), needed: stated },
                _ => matches!(error, ImageError::Checksum { stored, computed } if stored != computed),
            };
            assert!(fits, "bit {bit} of {}: {error:?}", bytes.len());
        }
    }
}

#[test]
fn every_truncation_and_every_extension_is_refused_with_both_lengths() {
    for bytes in valid_images() {
        for length in 0..bytes.len() {
            let error = Image::decode(&bytes[..length]).expect_err("bytes are missing");
            let ImageError::Truncated { length: found, needed } = error else { panic!("{length}: {error}") };
            assert!(found == length && needed > length && needed <= bytes.len(), "{length}: {error}");
            assert!(length < 8 || needed == bytes.len(), "{length}: {error}");
        }
        let mut extended = bytes.clone();
        for _ in 0..100 {
            extended.push(0);
            let too_long = ImageError::TooLong { length: extended.len(), limit: bytes.len() };
            assert_eq!(Image::decode(&extended), Err(too_long));
        }
    }
}

#[test]
fn lengths_and_numbers_appear_in_the_messages() {
    let bytes = &valid_images()[0];
    let message = |bytes: &[u8]| Image::decode(bytes).expect_err("damaged").to_string();
    let length = bytes.len();
    assert_eq!(message(&bytes[..20]), format!("truncated: 20 bytes of at least {length}"));
    let mut damaged = bytes.clone();
    damaged.push(1);
    assert_eq!(message(&damaged), format!("too long: {} bytes, at most {length} are allowed here", length + 1));
    damaged = bytes.clone();
    damaged[4] = 9;
    assert_eq!(message(&damaged), format!("format version 9 is not known, this program reads versions 1 to {FORMAT}"));
    damaged = bytes.clone();
    damaged[28] = 7;
    assert_eq!(message(&sealed(damaged)), "effort unit (offset 28) is 7, must be 0 to 3");
    damaged = bytes.clone();
    damaged[length - 1] ^= 0x80;
    let [stored, computed] = [&damaged, bytes].map(|bytes| u32::from_le_bytes(*bytes.last_chunk().expect("four")));
    let text = format!("damaged: checksum {stored:08x} is stored, the content has {computed:08x}");
    assert_eq!(message(&damaged), text);
    assert!(message(b"ELF of some kind").starts_with("not a parameter image"));
}

/// Meaning of a byte by the documented layout.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Byte {
    /// Any value may stand here.
    Free,
    /// Must be zero.
    Reserved,
    /// A one-byte field with these limits.
    Field(u8, u8),
    /// Part of a field whose limits depend on others, or that decides the length.
    Dependent,
}

/// The layout of an image with `criteria` criteria and `networks` (a bit a set), from the table in `parameters::image`.
fn layout(format: u16, criteria: usize, networks: u8, golden: usize) -> Vec<Byte> {
    use Byte::*;
    let sets = 1 << criteria;
    let mut bytes = vec![Free; 28];
    bytes.extend([Field(0, 3), Dependent, Dependent, Dependent]);
    bytes.extend([Free; 16]);
    bytes.extend([Dependent; 48]);
    bytes.extend([Free; 12]);
    for criterion in 0..2 {
        bytes.extend([Dependent, Reserved, Reserved, Reserved]);
        // The thresholds of an absent criterion are reserved too.
        bytes.extend([if criterion < criteria { Dependent } else { Reserved }; 8]);
    }
    bytes.extend([Free; 12]);
    if format >= 2 {
        // Numbers that are not negative, and for the stiffness below a limit.
        bytes.extend([Free, Free, Free, Dependent, Free, Free, Free, Dependent].repeat(4));
        bytes.extend([Free; 40]);
    }
    for set in 0..sets {
        // Terms: 14 bits, 15 in format 2, all in format 3.
        bytes.extend([Free, if format == 3 { Free } else { Dependent }, Reserved, Reserved]);
        bytes.extend(vec![Free; [124, 128, 140][usize::from(format) - 1]]);
        if networks >> set & 1 == 1 {
            bytes.extend([Free; 120]);
            for _ in 0..11 {
                bytes.extend([Free; 12]);
                bytes.extend([Field(10, 20), Reserved]);
            }
            bytes.extend([Dependent, Dependent, Dependent, Dependent, Reserved, Reserved]); // the scale: 25 bits
        }
    }
    for _ in 0..golden {
        bytes.extend([Field(0, sets as u8 - 1), Reserved, Reserved, Reserved]);
        bytes.extend([Free; 32]);
    }
    bytes
}

#[test]
fn with_a_right_checksum_reserved_bytes_and_fields_are_refused_and_the_rest_is_canonical() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut refused = [0; 2];
    for (shape, bytes) in valid_images().into_iter().enumerate() {
        let (format, criteria) = ((shape / SHAPES) as u16 + 1, shape % SHAPES / 2);
        let sets = 1 << criteria;
        let layout = layout(
            format,
            criteria,
            if shape % 2 == 1 { (1 << sets) - 1 } else { 0 },
            golden(format, sets, shape % 2 == 1),
        );
        assert_eq!(layout.len() + 4, bytes.len());
        for (offset, byte) in layout.into_iter().enumerate().skip(8) {
            let bits = (0..8).map(|bit| bytes[offset] ^ 1 << bit);
            let values: Vec<u8> = if byte == Byte::Free {
                vec![random.random()]
            } else if let Byte::Field(..) = byte {
                (0..=255).collect()
            } else {
                bits.chain([0, 255]).collect()
            };
            for value in values {
                let mut damaged = bytes.clone();
                damaged[offset] = value;
                let damaged = sealed(damaged);
                let found = Image::decode(&damaged);
                match byte {
                    Byte::Free => assert!(found.is_ok(), "offset {offset}: {found:?}"),
                    Byte::Reserved if value != 0 => {
                        // Thresholds of an absent criterion count as one field of eight bytes, and are compared first.
                        let thresholds = [112..120, 124..132].into_iter().find(|range| range.contains(&offset));
                        match (&found, thresholds) {
                            (Err(ImageError::Reserved { offset: at }), None) => assert_eq!(*at, offset),
                            (Err(ImageError::Reserved { offset: at }), Some(range)) => assert_eq!(*at, range.start),
                            (Err(ImageError::Field { name: "lower threshold", .. }), Some(_)) => {}
                            _ => panic!("offset {offset}: {found:?}"),
                        }
                    }
                    Byte::Field(low, high) if !(low..=high).contains(&value) => {
                        let Err(ImageError::Field { offset: at, value: v, low: l, high: h, .. }) = found else {
                            panic!("offset {offset}: {found:?}");
                        };
                        assert_eq!((at, v, l, h), (offset, value as i64, low as i64, high as i64));
                    }
                    Byte::Dependent | Byte::Reserved | Byte::Field(..) => {}
                }
                match found {
                    Ok(image) => assert_eq!(encoded(&image), damaged, "offset {offset}"),
                    Err(ImageError::Reserved { .. }) => refused[0] += 1,
                    Err(ImageError::Field { value, low, high, .. }) => {
                        assert!(!(low..=high).contains(&value));
                        refused[1] += 1;
                    }
                    // A different number of sets, networks or vectors makes another length.
                    Err(ImageError::Truncated { .. } | ImageError::TooLong { .. }) => {
                        assert!((29..32).contains(&offset), "offset {offset}");
                    }
                    Err(error) => panic!("offset {offset}: {error}"),
                }
            }
        }
    }
    assert!(refused.into_iter().all(|count| count > 1000), "{refused:?}");
}

#[test]
fn without_golden_vectors_or_with_too_many_an_image_is_refused() {
    let bytes = &valid_images()[0]; // one set, no network, one golden vector
    let (head, vector) = (&bytes[..144 + 128], &bytes[144 + 128..144 + 128 + 36]);
    for count in [0, 1, 2, 8, 9] {
        let mut other = [head, &vector.repeat(count), &[0; 4]].concat();
        let length = other.len() as u16;
        other[6..8].copy_from_slice(&length.to_le_bytes());
        other[31] = count as u8;
        let found = Image::decode(&sealed(other));
        if (1..=8).contains(&count) {
            assert!(found.is_ok_and(|image| image.golden.len() == count));
        } else {
            let (name, value) = ("number of golden vectors", count as i64);
            assert_eq!(found, Err(ImageError::Field { name, offset: 31, value, low: 1, high: 8 }));
        }
    }
}

#[test]
fn a_pre_sliding_element_is_as_stiff_and_as_strong_as_it_may_be_and_no_more() {
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let parameters = parameters(&mut random, 2, 1, false);
    let bytes = encoded(&image(&mut random, parameters, 1));
    for (offset, name, limit) in
        [(144, "stiffness of pre-sliding", MAX_STIFFNESS), (148, "level of pre-sliding", MAX_LEVEL)]
    {
        let with = |value: i32| {
            let mut other = bytes.clone();
            other[offset..offset + 4].copy_from_slice(&value.to_le_bytes());
            Image::decode(&sealed(other))
        };
        assert!(with(limit).is_ok() && with(0).is_ok(), "{name}");
        for value in [limit + 1, -1] {
            let (low, high, value) = (0, i64::from(limit), i64::from(value));
            assert_eq!(with(value as i32), Err(ImageError::Field { name, offset, value, low, high }));
        }
    }
}

#[test]
fn a_range_or_a_criterion_upside_down_is_refused_at_its_offset() {
    let bytes = &valid_images()[4]; // two criteria
    let with = |offset: usize, value: i32| {
        let mut damaged = bytes.clone();
        damaged[offset..offset + 4].copy_from_slice(&value.to_le_bytes());
        Image::decode(&sealed(damaged))
    };
    for (index, signal) in Signal::ALL.into_iter().enumerate() {
        let offset = 48 + 8 * index;
        let low = i32::from_le_bytes(*bytes[offset..].first_chunk().expect("four"));
        assert!(with(offset + 4, low).is_ok(), "a range of one point");
        let (name, value, low, high) = (signal.name(), low as i64 - 1, low as i64, i32::MAX as i64);
        let expected = ImageError::Field { name, offset: offset + 4, value, low, high };
        assert_eq!(with(offset + 4, value as i32), Err(expected));
    }
    for offset in [108, 120] {
        let enter = i32::from_le_bytes(*bytes[offset + 4..].first_chunk().expect("four"));
        assert!(with(offset + 8, enter).is_ok(), "a threshold without hysteresis");
        let Err(ImageError::Field { name: "lower threshold", offset: at, high, .. }) = with(offset + 8, enter + 1)
        else {
            panic!("{enter}");
        };
        assert_eq!((at, high), (offset + 8, enter as i64));
    }
}

#[test]
fn random_bytes_and_random_damage_never_panic_and_stay_canonical() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut buffer = [0; MAX_LENGTH + 100];
    for _ in 0..200_000 {
        let length = random.random_range(0..300);
        random.fill_bytes(&mut buffer[..length]);
        if random.random() && length >= 8 {
            buffer[..6].copy_from_slice(b"JFPI\x01\x00");
            buffer[6..8].copy_from_slice(&(length as u16).to_le_bytes());
        }
        assert!(Image::decode(&buffer[..length]).is_err());
    }
    let images = valid_images();
    let mut accepted = 0;
    for _ in 0..60_000 {
        let mut bytes = images[random.random_range(0..images.len())].clone();
        for _ in 0..random.random_range(1..6) {
            let offset = if random.random_bool(0.3) {
                random.random_range(28..144)
            } else {
                random.random_range(8..bytes.len())
            };
            bytes[offset] = random.random::<u8>() >> random.random_range(0..8);
        }
        if random.random_bool(0.1) {
            // Another length, and stated as such.
            bytes.resize(random.random_range(144..MAX_LENGTH), random.random());
            let length = bytes.len() as u16;
            bytes[6..8].copy_from_slice(&length.to_le_bytes());
        }
        let bytes = sealed(bytes);
        if let Ok(image) = Image::decode(&bytes) {
            accepted += 1;
            assert_eq!(encoded(&image), bytes);
        }
    }
    assert!(accepted > 10_000, "{accepted}");
}

#[test]
fn what_is_encoded_is_what_is_decoded() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    for _ in 0..3000 {
        let parameters = if random.random() { tame(&mut random) } else { extreme(&mut random) };
        let golden = random.random_range(1..=4);
        let mut image = image(&mut random, parameters, golden);
        image.target = Target { product: random.random(), serial: random.random() };
        image.effort = Effort::ALL[random.random_range(0..4)];
        image.limits =
            Limits { output: random.random(), torque_gain: random.random(), velocity_slope: random.random() };
        let bytes = encoded(&image);
        assert_eq!(Image::decode(&bytes).as_ref(), Ok(&image));
        image.verify_golden(&FrictionModel::new(&image.friction, 20_000)).expect("they were computed here");
    }
}

#[test]
fn a_golden_vector_that_this_machine_computes_differently_is_named() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let parameters = parameters(&mut random, 2, 2, true);
    let image = image(&mut random, parameters, MAX_GOLDEN);
    let model = FrictionModel::new(&image.friction, 20_000);
    assert_eq!(image.verify_golden(&model), Ok(()));
    for index in 0..MAX_GOLDEN {
        let computed = image.golden[index].expected;
        for one_unit in [1, -1] {
            let change = |torque: Torque| Torque::from_bits(torque.to_bits().wrapping_add(one_unit));
            for part in 0..2 {
                let mut other = image.clone();
                let expected = &mut other.golden[index].expected;
                let torque = if part == 0 { &mut expected.physical } else { &mut expected.network };
                *torque = change(*torque);
                let expected = *expected;
                assert_eq!(other.verify_golden(&model), Err(GoldenMismatch { index, expected, computed }));
                let text = GoldenMismatch { index, expected, computed }.to_string();
                assert!(text.starts_with(&format!("golden vector {index}: physical {}", expected.physical)), "{text}");
            }
        }
    }
}

#[test]
fn four_sets_with_networks_leave_room_for_six_golden_vectors_in_format_2_for_four_in_format_3_for_two_and_not_for_one_more()
 {
    let mut random = ChaCha8Rng::seed_from_u64(6);
    for (format, before_golden, most) in
        [(1, 144 + 4 * (128 + 280), 6), (2, 216 + 4 * (132 + 280), 4), (3, 216 + 4 * (144 + 280), 2)]
    {
        let parameters = parameters(&mut random, format, 4, true);
        let fits = image(&mut random, parameters, most);
        assert_eq!((fits.format(), encoded(&fits).len()), (format, before_golden + most * 36 + 4));
        assert_eq!(image(&mut random, parameters, MAX_GOLDEN).golden.len(), most);
        let mut too_many = fits.clone();
        too_many.golden.push(fits.golden[0]).expect("room for eight");
        let too_long = ImageError::TooLong { length: before_golden + (most + 1) * 36 + 4, limit: MAX_LENGTH };
        assert_eq!(too_many.encode(&mut [0; MAX_LENGTH]), Err(too_long));
    }
    assert_eq!(MAX_LENGTH, 2016);
}

#[test]
fn what_could_not_be_read_back_is_not_written() {
    let valid = image(&mut ChaCha8Rng::seed_from_u64(7), frictionless(), 1);
    assert!(valid.encode(&mut [0; MAX_LENGTH]).is_ok());
    let refused = |change: &dyn Fn(&mut Image)| {
        let mut image = valid.clone();
        change(&mut image);
        let Err(ImageError::Field { name, value, low, high, .. }) = image.encode(&mut [0; MAX_LENGTH]) else {
            panic!("{image:?}");
        };
        assert!(!(low..=high).contains(&value), "{name}");
        name
    };
    let criterion = Criterion { measure: Measure::Speed, enter: 5, leave: 6 };
    let neuron = |fraction| Neuron { fraction, ..Default::default() };
    let mut network = NetworkParameters::default();
    (network.hidden, network.output) = ([[neuron(10); 5]; 2], neuron(20));
    let with_network = |image: &mut Image, fraction: u8| {
        let mut network = network;
        network.hidden[1][4].fraction = fraction;
        image.friction.sets[0].network = Some(network);
    };
    for signal in 0..SIGNALS {
        let upside_down = Range { low: 1, high: 0 };
        assert_eq!(refused(&|image| image.friction.domain.ranges[signal] = upside_down), Signal::ALL[signal].name());
    }
    assert_eq!(refused(&|image| image.friction.selector.criteria[0] = Some(criterion)), "lower threshold");
    assert_eq!(
        refused(&|image| image.friction.selector.criteria[1] = Some(Criterion { leave: 5, ..criterion })),
        "second criterion without a first"
    );
    assert_eq!(refused(&|image| image.friction.sets[0].physical.terms = Terms(1 << Terms::COUNT)), "terms");
    assert_eq!(refused(&|image| with_network(image, 9)), "fraction bits");
    assert_eq!(refused(&|image| with_network(image, 21)), "fraction bits");
    for scale in [MAX_SCALE + 1, -MAX_SCALE - 1] {
        let network = NetworkParameters { scale, ..network };
        assert_eq!(refused(&|image| image.friction.sets[0].network = Some(network)), "scale");
    }
    assert_eq!(
        refused(&|image| image.friction.sets[1] = ParameterSet { network: Some(network), ..Default::default() }),
        "index of a set in use"
    );
    assert_eq!(refused(&|image| image.golden.clear()), "number of golden vectors");
    assert_eq!(refused(&|image| image.golden[0].set = 1), "golden vector's set");
}
