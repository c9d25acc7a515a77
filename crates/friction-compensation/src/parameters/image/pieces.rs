//! An image read piece by piece: its header, one parameter set, one golden vector at a time; task or host.
//!
//! A whole [`Image`] takes 2 KiB, and as much again wherever it is moved. A board that has less stack than that
//! verifies an upload, and prepares a friction model in its place, with one parameter set in hand.

use super::codec::{Header, Reader, decode_end, decode_golden, decode_header, decode_set};
use super::{GoldenMismatch, GoldenSequence, GoldenVector, Image, ImageError};
use crate::friction::network::{Inputs, Layers};
use crate::friction::physical::{PreparedTerms, Scaling};
use crate::friction::state::JointState;
use crate::friction::{self, FrictionModel, ParameterSet};

/// An image all of whose fields are right.
pub(in crate::parameters) struct Pieces<'a> {
    pub(in crate::parameters) header: Header,
    /// Reader at the first set.
    sets: Reader<'a>,
}

impl<'a> Pieces<'a> {
    /// Checks what [`Image::decode`] checks, in the same order.
    #[inline(never)]
    pub(in crate::parameters) fn of(bytes: &'a [u8]) -> Result<Self, ImageError> {
        let mut reader = Reader::new(Image::content(bytes)?);
        let header = decode_header(&mut reader);
        let sets = reader.clone();
        let mut pieces = Self { header, sets };
        // The walk to the end finds what is wrong.
        let mut reader = pieces.walk(usize::MAX, &mut |_| ());
        decode_end(&mut reader);
        match reader.error {
            Some(error) => Err(error),
            None => {
                pieces.sets.error = None;
                Ok(pieces)
            }
        }
    }

    /// Number of parameter sets.
    pub(in crate::parameters) const fn sets(&self) -> usize {
        self.header.sets as usize
    }

    /// Reads the sets up to `last`, which `set` holds afterwards; the reader behind it.
    fn read_sets(&self, last: usize, set: &mut ParameterSet) -> Reader<'a> {
        let mut reader = self.sets.clone();
        for index in 0..self.sets().min(last.saturating_add(1)) {
            decode_set(&mut reader, &self.header, index, set);
        }
        reader
    }

    /// A parameter set.
    pub(in crate::parameters) fn set(&self, index: usize, set: &mut ParameterSet) {
        self.read_sets(index, set);
    }

    /// Walks over everything to the end, with each golden vector.
    #[inline(never)]
    fn walk(&self, last: usize, with: &mut dyn FnMut(&GoldenVector)) -> Reader<'a> {
        let mut set = ParameterSet::default();
        let mut reader = self.read_sets(last, &mut set);
        for _ in 0..self.header.golden {
            with(&decode_golden(&mut reader, self.header.sets));
        }
        reader
    }

    /// Evaluates every golden vector; the first that this machine computes differently.
    #[inline(never)]
    pub(in crate::parameters) fn verify_golden(&self) -> Result<(), GoldenMismatch> {
        let domain = &self.header.domain;
        let (scaling, inputs) = (Scaling::new(domain), Inputs::new(domain));
        let mut first: Option<GoldenMismatch> = None;
        for number in 0..self.sets() {
            let prepared = self.prepared(number);
            let mut index = 0;
            let mut sequence = GoldenSequence::new(&self.header.common);
            self.walk(usize::MAX, &mut |vector| {
                let state = JointState::from_signals(vector.signals);
                let common = sequence.next(&state);
                if usize::from(vector.set) == number {
                    let computed = friction::evaluate(&scaling, &inputs, &prepared, &common, &state);
                    if computed != vector.expected && first.is_none_or(|first| index < first.index) {
                        first = Some(GoldenMismatch { index, expected: vector.expected, computed });
                    }
                }
                index += 1;
            });
        }
        first.map_or(Ok(()), Err)
    }

    #[inline(never)]
    fn prepared(&self, number: usize) -> (PreparedTerms, Option<Layers>) {
        let mut set = ParameterSet::default();
        self.set(number, &mut set);
        friction::prepared(&set)
    }

    /// The friction model for a control loop of `rate` Hz, in its place.
    #[inline(never)]
    fn prepare(&self, rate: u32, place: &mut Option<FrictionModel>) {
        let Header { domain, selector, common, .. } = &self.header;
        let model = FrictionModel::place(place, domain, selector, common, rate);
        let mut set = ParameterSet::default();
        for number in 0..self.sets() {
            self.set(number, &mut set);
            model.prepare_set(number, &set);
        }
    }
}

impl Image {
    /// Prepares the friction model of an image's bytes, for a control loop of `rate` Hz, in its place: none where they
    /// are no image. The same as [`FrictionModel::new`] with what [`Image::decode`] gives, on a quarter of the
    /// stack.
    pub fn prepare(bytes: &[u8], rate: u32, place: &mut Option<FrictionModel>) {
        *place = None;
        if let Ok(pieces) = Pieces::of(bytes) {
            pieces.prepare(rate, place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::FrictionParameters;
    use crate::friction::common::CommonTerms;
    use crate::friction::domain::{Domain, Range};
    use crate::friction::maxwell_slip::MaxwellElement;
    use crate::friction::network::{MIN_FRACTION, NEURONS, NetworkParameters, Neuron};
    use crate::friction::physical::{Coefficients, PhysicalParameters, Terms};
    use crate::friction::regime::{Criterion, Measure, Selector};
    use crate::friction::state::SIGNALS;
    use crate::parameters::certificate::{self, Limits};
    use crate::parameters::image::{Effort, MAX_LENGTH, Target};
    use crate::quantity::Torque;
    use proptest::prelude::*;

    fn set(seed: i32, network: bool) -> ParameterSet {
        let coefficients = Coefficients::from_array(core::array::from_fn(|i| seed.wrapping_mul(i as i32 + 1) >> 18));
        let neuron = |k: usize| Neuron {
            weights: core::array::from_fn(|j| (seed >> (j + k)) as i16 >> 4),
            fraction: MIN_FRACTION + k as u8 % 3,
        };
        let learned = NetworkParameters {
            first: core::array::from_fn(|j| core::array::from_fn(|i| seed.wrapping_mul(7 + i as i32 - j as i32) >> 6)),
            hidden: [core::array::from_fn(neuron), core::array::from_fn(|k| neuron(k + NEURONS))],
            output: neuron(2),
            scale: seed >> 14,
        };
        ParameterSet {
            physical: PhysicalParameters { terms: Terms(seed as u32 & Terms::ALL.0), coefficients },
            network: network.then_some(learned),
        }
    }

    fn images() -> impl Strategy<Value = Image> {
        let signals = prop::array::uniform6(-(3i32 << 16)..3 << 16);
        (
            0usize..3,
            prop::array::uniform4((any::<i32>(), any::<bool>())),
            prop::collection::vec((any::<u8>(), signals), 1..8),
        )
            .prop_map(|(criteria, seeds, vectors)| {
                let criterion = Criterion { measure: Measure::Speed, enter: 2 << 16, leave: 1 << 16 };
                let selector = Selector {
                    criteria: core::array::from_fn(|i| (i < criteria).then_some(criterion)),
                    fade_time: 1 << 14,
                };
                let mut sets = [ParameterSet::default(); 4];
                for (place, (seed, network)) in sets.iter_mut().zip(seeds).take(selector.sets()) {
                    *place = set(seed, network);
                }
                let element =
                    |n: i32| MaxwellElement { stiffness: (seeds[0].0 >> n & 0xfff_ffff).abs(), level: 1 << (10 + n) };
                let common = match seeds[0].1 {
                    true => CommonTerms { elements: core::array::from_fn(|n| element(n as i32)), ..CommonTerms::NONE },
                    false => CommonTerms::NONE,
                };
                let range = Range { low: -(2 << 16), high: 3 << 16 };
                let domain = Domain { ranges: [range; SIGNALS], margin: 1 << 14, reference_temperature: 1 << 16 };
                let friction = FrictionParameters { domain, selector, common, sets };
                let model = FrictionModel::new(&friction, 20_000);
                let mut sequence = GoldenSequence::new(&common);
                let golden = vectors.into_iter().map(|(number, signals)| {
                    let set = number % selector.sets() as u8;
                    let state = JointState::from_signals(signals);
                    let expected = model.evaluate_with(set.into(), &state, &sequence.next(&state));
                    GoldenVector { set, signals, expected }
                });
                let golden = golden.collect();
                let limits = Limits::default();
                let (target, effort) = (Target::default(), Effort::NewtonMetre);
                Image { version: 3, target, created: 4, effort, data_hash: [5; 16], friction, limits, golden }
            })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn an_image_in_pieces_is_the_image_as_a_whole(image in images(), wrong in any::<[bool; 8]>()) {
            let mut image = image;
            let mut buffer = [0; MAX_LENGTH];
            for (vector, wrong) in image.golden.iter_mut().zip(wrong) {
                let off = Torque::from_bits(vector.expected.physical.to_bits() ^ 1);
                vector.expected.physical = if wrong { off } else { vector.expected.physical };
            }
            let Ok(length) = image.encode(&mut buffer) else { return Ok(()) }; // longer than a page
            let bytes = &buffer[..length];

            let mut prepared = None;
            Image::prepare(bytes, 20_000, &mut prepared);
            let whole = FrictionModel::new(&image.friction, 20_000);
            prop_assert_eq!(format!("{prepared:?}"), format!("{:?}", Some(&whole)));

            let pieces = Pieces::of(bytes).expect("an image");
            prop_assert_eq!(pieces.verify_golden(), image.verify_golden(&whole));
            let (mut set, mut proved, mut refused) = (ParameterSet::default(), None, None);
            for index in 0..pieces.sets() {
                pieces.set(index, &mut set);
                prop_assert_eq!(set, image.friction.sets[index]);
                let result =
                    certificate::prove_set(&pieces.header.domain, &pieces.header.common, &set, index, pieces.sets(), &mut proved);
                refused = refused.or(result.err());
            }
            prop_assert_eq!(refused.map_or(Ok(proved.unwrap_or_default()), Err), certificate::prove(&image.friction));
        }

        #[test]
        fn what_is_wrong_with_the_whole_is_wrong_with_the_pieces(image in images(), at in 8usize..2_000, byte: u8) {
            let mut buffer = [0; MAX_LENGTH];
            let Ok(length) = image.encode(&mut buffer) else { return Ok(()) };
            buffer[at % (length - 4)] = byte;
            let checksum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&buffer[..length - 4]);
            buffer[length - 4..length].copy_from_slice(&checksum.to_le_bytes());
            let bytes = &buffer[..length];
            let (whole, pieces) = (Image::decode(bytes), Pieces::of(bytes));
            prop_assert_eq!(pieces.as_ref().err(), whole.as_ref().err());
            let mut prepared = None;
            Image::prepare(bytes, 20_000, &mut prepared);
            prop_assert_eq!(prepared.is_some(), whole.is_ok());
        }
    }
}
