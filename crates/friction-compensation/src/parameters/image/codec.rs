//! Reading and writing the bytes of an image, field by field, in the order of the [layout](super).

use super::{COMMON_TERMS, CRC_LENGTH, Effort, GoldenVector, Image, ImageError, MAGIC, MAX_GOLDEN, Target};
use crate::friction::common::CommonTerms;
use crate::friction::domain::{Domain, Range};
use crate::friction::maxwell_slip::{ELEMENTS, MAX_LEVEL, MAX_STIFFNESS, MaxwellElement};
use crate::friction::network::{INPUTS, MAX_FRACTION, MAX_SCALE, MIN_FRACTION, NEURONS, NetworkParameters};
use crate::friction::physical::{Coefficients, PhysicalParameters, Terms, held_by};
use crate::friction::regime::{Criterion, MAX_SETS, MOST_SETS, Measure, Selector};
use crate::friction::ripple::{RIPPLES, Ripple};
use crate::friction::state::{SIGNALS, Signal};
use crate::friction::{Estimate, FrictionParameters, ParameterSet};
use crate::parameters::certificate::Limits;
use crate::quantity::Torque;

/// Fields before the parameter sets.
pub(in crate::parameters) struct Header {
    /// 1 to [`FORMAT`](super::FORMAT).
    pub(in crate::parameters) format: u16,
    pub(in crate::parameters) version: u32,
    pub(in crate::parameters) target: Target,
    pub(in crate::parameters) created: u64,
    pub(in crate::parameters) effort: Effort,
    pub(in crate::parameters) data_hash: [u8; 16],
    pub(in crate::parameters) domain: Domain,
    pub(in crate::parameters) selector: Selector,
    pub(in crate::parameters) limits: Limits,
    pub(in crate::parameters) common: CommonTerms,
    /// Parameter sets; a bit for each that has a network; golden vectors.
    pub(in crate::parameters) sets: u8,
    pub(in crate::parameters) networks: u8,
    pub(in crate::parameters) golden: u8,
}

/// Decodes everything between the length and the checksum.
pub(super) fn decode_content(mut reader: Reader) -> Result<Image, ImageError> {
    let header = decode_header(&mut reader);
    let mut parameters = [ParameterSet::default(); MAX_SETS];
    for (i, set) in parameters.iter_mut().enumerate().take(header.sets as usize) {
        decode_set(&mut reader, &header, i, set);
    }
    let Header { version, target, created, effort, data_hash, domain, selector, limits, common, sets, .. } = header;
    let mut golden = heapless::Vec::new();
    for _ in 0..header.golden {
        // The count was checked against the capacity.
        let _ = golden.push(decode_golden(&mut reader, sets));
    }
    decode_end(&mut reader);
    if let Some(error) = reader.error {
        return Err(error);
    }
    let friction = FrictionParameters { domain, selector, common, sets: parameters };
    Ok(Image { version, target, created, effort, data_hash, friction, limits, golden })
}

#[inline(never)]
pub(super) fn decode_header(reader: &mut Reader) -> Header {
    reader.skip(4);
    let format = reader.u16();
    reader.skip(2);
    let mut header = Header {
        format,
        version: reader.u32(),
        target: Target { product: reader.u32(), serial: reader.u32() },
        created: u64::from(reader.u32()) | u64::from(reader.u32()) << 32,
        effort: match reader.checked_u8("effort unit", 0, 3) {
            0 => Effort::NewtonMetre,
            1 => Effort::Newton,
            2 => Effort::Ampere,
            _ => Effort::Volt,
        },
        data_hash: [0; 16],
        domain: Domain { ranges: [Range::ANY; SIGNALS], margin: 0, reference_temperature: 0 },
        selector: Selector::default(),
        limits: Limits::default(),
        common: CommonTerms::NONE,
        sets: 0,
        networks: 0,
        golden: 0,
    };
    let sets_offset = reader.offset;
    header.sets = reader.checked_u8("number of sets", 1, MOST_SETS as u8);
    header.networks = reader.checked_u8("networks", 0, ((1u16 << header.sets) - 1) as u8);
    header.golden = reader.checked_u8("number of golden vectors", 1, MAX_GOLDEN as u8);
    reader.fill(&mut header.data_hash);

    let Header { domain, selector, .. } = &mut header;
    for (range, signal) in domain.ranges.iter_mut().zip(Signal::ALL) {
        let low = reader.i32();
        *range = Range { low, high: reader.checked_i32(signal.name(), low, i32::MAX) };
    }
    domain.margin = reader.u32();
    domain.reference_temperature = reader.i32();
    selector.fade_time = reader.u32();
    // A second criterion without a first has no meaning: only "none" may follow "none".
    let mut highest = 3;
    for criterion in &mut selector.criteria {
        let measure = reader.checked_u8("criterion", 0, highest);
        reader.reserved(3);
        let offset = reader.offset;
        let enter = reader.i32();
        let leave = reader.checked_i32("lower threshold", i32::MIN, enter);
        let measure = match measure {
            0 => {
                highest = 0;
                if (enter, leave) != (0, 0) {
                    reader.refuse(ImageError::Reserved { offset });
                }
                continue;
            }
            1 => Measure::Acceleration,
            2 => Measure::Speed,
            _ => Measure::Coupled,
        };
        *criterion = Some(Criterion { measure, enter, leave });
    }
    let expected = selector.sets();
    if header.sets as usize != expected {
        let (expected, value) = (expected as i64, header.sets as i64);
        let (name, offset) = ("number of sets", sets_offset);
        reader.refuse(ImageError::Field { name, offset, value, low: expected, high: expected });
    }
    if expected > MAX_SETS {
        reader.refuse(ImageError::TooManySets { sets: header.sets });
        header.sets = MAX_SETS as u8;
    }
    header.limits = Limits { output: reader.u32(), torque_gain: reader.u32(), velocity_slope: reader.u32() };
    if format >= COMMON_TERMS {
        decode_common(reader, &mut header.common);
    }
    header
}

#[inline(never)]
fn decode_common(reader: &mut Reader, common: &mut CommonTerms) {
    for element in &mut common.elements {
        let stiffness = reader.checked_i32("stiffness of pre-sliding", 0, MAX_STIFFNESS);
        *element = MaxwellElement { stiffness, level: reader.checked_i32("level of pre-sliding", 0, MAX_LEVEL) };
    }
    for ripple in &mut common.ripples {
        *ripple = Ripple {
            periods: reader.i32(),
            level_sine: reader.i32(),
            level_cosine: reader.i32(),
            torque_sine: reader.i32(),
            torque_cosine: reader.i32(),
        };
    }
}

/// Overwrites the whole set, which is that of number `index`.
#[inline(never)]
pub(super) fn decode_set(reader: &mut Reader, header: &Header, index: usize, set: &mut ParameterSet) {
    decode_physical(reader, header.format, &mut set.physical);
    set.network = None;
    if header.networks >> index & 1 == 1 {
        decode_network(reader, set.network.insert(NetworkParameters::default()));
    }
}

#[inline(never)]
pub(super) fn decode_golden(reader: &mut Reader, sets: u8) -> GoldenVector {
    let set = reader.checked_u8("golden vector's set", 0, sets - 1);
    reader.reserved(3);
    let mut signals = [0; SIGNALS];
    for signal in &mut signals {
        *signal = reader.i32();
    }
    let expected = Estimate { physical: Torque::from_bits(reader.i32()), network: Torque::from_bits(reader.i32()) };
    GoldenVector { set, signals, expected }
}

/// Refuses bytes that follow.
pub(super) fn decode_end(reader: &mut Reader) {
    if !reader.bytes.is_empty() {
        let length = reader.offset + reader.bytes.len() + CRC_LENGTH;
        reader.refuse(ImageError::TooLong { length, limit: reader.offset + CRC_LENGTH });
    }
}

fn decode_physical(reader: &mut Reader, format: u16, physical: &mut PhysicalParameters) {
    let offset = reader.offset;
    let terms = u32::from(reader.u16());
    let (known, count) = held_by(format);
    if terms & !known.0 != 0 {
        let (low, high) = (0, known.0 as i64);
        reader.refuse(ImageError::Field { name: "terms", offset, value: terms as i64, low, high });
    }
    reader.reserved(2);
    let mut coefficients = [0; Coefficients::COUNT];
    for coefficient in coefficients.iter_mut().take(count) {
        *coefficient = reader.i32();
    }
    *physical = PhysicalParameters { terms: Terms(terms), coefficients: Coefficients::from_array(coefficients) };
}

fn decode_network(reader: &mut Reader, network: &mut NetworkParameters) {
    for weight in network.first.iter_mut().flatten() {
        *weight = reader.i32();
    }
    for neuron in network.hidden.iter_mut().flatten().chain([&mut network.output]) {
        for weight in &mut neuron.weights {
            *weight = reader.u16() as i16;
        }
        neuron.fraction = reader.checked_u8("fraction bits", MIN_FRACTION, MAX_FRACTION);
        reader.reserved(1);
    }
    network.scale = reader.checked_i32("scale", -MAX_SCALE, MAX_SCALE);
    reader.reserved(2);
}

/// Encodes everything before the checksum; the length stays open.
pub(super) fn encode_content(image: &Image, writer: &mut Writer) {
    let Image { friction, limits, golden, .. } = image;
    let format = image.format();
    let sets = friction.selector.sets();
    let networks = (0..sets).filter(|&i| friction.sets[i].network.is_some()).fold(0u8, |mask, i| mask | 1 << i);
    writer.put(&MAGIC);
    writer.put(&format.to_le_bytes());
    writer.put(&[0; 2]); // the length, known at the end
    writer.put(&image.version.to_le_bytes());
    writer.put(&image.target.product.to_le_bytes());
    writer.put(&image.target.serial.to_le_bytes());
    writer.put(&image.created.to_le_bytes());
    writer.put(&[image.effort as u8, sets as u8, networks, golden.len() as u8]);
    writer.put(&image.data_hash);
    for range in &friction.domain.ranges {
        writer.i32(range.low);
        writer.i32(range.high);
    }
    writer.put(&friction.domain.margin.to_le_bytes());
    writer.i32(friction.domain.reference_temperature);
    writer.put(&friction.selector.fade_time.to_le_bytes());
    for criterion in &friction.selector.criteria {
        let (measure, enter, leave) = criterion.map_or((0, 0, 0), |c| (c.measure as u8, c.enter, c.leave));
        writer.put(&[measure, 0, 0, 0]);
        writer.i32(enter);
        writer.i32(leave);
    }
    for limit in [limits.output, limits.torque_gain, limits.velocity_slope] {
        writer.put(&limit.to_le_bytes());
    }
    if format >= COMMON_TERMS {
        encode_common(&friction.common, writer);
    }
    for set in friction.sets.iter().take(sets) {
        encode_set(set, format, writer);
    }
    for vector in golden {
        writer.put(&[vector.set, 0, 0, 0]);
        for signal in vector.signals {
            writer.i32(signal);
        }
        writer.i32(vector.expected.physical.to_bits());
        writer.i32(vector.expected.network.to_bits());
    }
}

fn encode_common(common: &CommonTerms, writer: &mut Writer) {
    for element in &common.elements {
        writer.i32(element.stiffness);
        writer.i32(element.level);
    }
    for ripple in &common.ripples {
        let Ripple { periods, level_sine, level_cosine, torque_sine, torque_cosine } = *ripple;
        for number in [periods, level_sine, level_cosine, torque_sine, torque_cosine] {
            writer.i32(number);
        }
    }
}

fn encode_set(set: &ParameterSet, format: u16, writer: &mut Writer) {
    writer.put(&(set.physical.terms.0 as u16).to_le_bytes());
    writer.put(&[0; 2]);
    let (_, count) = held_by(format);
    for coefficient in set.physical.coefficients.to_array().into_iter().take(count) {
        writer.i32(coefficient);
    }
    let Some(network) = &set.network else { return };
    for weight in network.first.iter().flatten() {
        writer.i32(*weight);
    }
    for neuron in network.hidden.iter().flatten().chain([&network.output]) {
        for weight in neuron.weights {
            writer.put(&weight.to_le_bytes());
        }
        writer.put(&[neuron.fraction, 0]);
    }
    writer.i32(network.scale);
    writer.put(&[0; 2]);
}

/// Takes numbers off the front of a byte string. The first error stays; what is read behind it is of no meaning, but
/// within the limits that were asked for. One look at the end instead of one behind every number is half the code.
#[derive(Clone)]
pub(super) struct Reader<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) offset: usize,
    pub(super) error: Option<ImageError>,
}

impl<'a> Reader<'a> {
    pub(super) const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, offset: 0, error: None }
    }

    /// Keeps an error, if it is the first.
    #[inline(never)]
    pub(super) fn refuse(&mut self, error: ImageError) {
        self.error.get_or_insert(error);
    }

    /// Zeros where there are not enough bytes.
    #[inline(never)]
    pub(super) fn fill(&mut self, out: &mut [u8]) {
        let Some((head, rest)) = self.bytes.split_at_checked(out.len()) else {
            let (length, needed) = (self.offset + self.bytes.len(), self.offset + out.len());
            out.fill(0);
            return self.refuse(ImageError::Truncated { length, needed });
        };
        self.bytes = rest;
        self.offset += head.len();
        out.iter_mut().zip(head).for_each(|(byte, value)| *byte = *value);
    }

    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        self.fill(&mut bytes);
        bytes
    }

    fn u8(&mut self) -> u8 {
        let [byte] = self.bytes();
        byte
    }

    #[inline(never)]
    pub(super) fn u16(&mut self) -> u16 {
        u16::from_le_bytes(self.bytes())
    }

    #[inline(never)]
    pub(super) fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes())
    }

    fn i32(&mut self) -> i32 {
        self.u32() as i32
    }

    fn skip(&mut self, count: usize) {
        for _ in 0..count {
            self.u8();
        }
    }

    #[inline(never)]
    fn reserved(&mut self, count: usize) {
        for _ in 0..count {
            let offset = self.offset;
            if self.u8() != 0 {
                self.refuse(ImageError::Reserved { offset });
            }
        }
    }

    #[inline(never)]
    fn checked(&mut self, name: &'static str, offset: usize, value: i32, low: i32, high: i32) -> i32 {
        if (low..=high).contains(&value) {
            return value;
        }
        let (value, least, high) = (value as i64, low as i64, high as i64);
        self.refuse(ImageError::Field { name, offset, value, low: least, high });
        low
    }

    fn checked_u8(&mut self, name: &'static str, low: u8, high: u8) -> u8 {
        let (offset, value) = (self.offset, self.u8());
        self.checked(name, offset, value as i32, low as i32, high as i32) as u8
    }

    fn checked_i32(&mut self, name: &'static str, low: i32, high: i32) -> i32 {
        let (offset, value) = (self.offset, self.i32());
        self.checked(name, offset, value, low, high)
    }
}

/// Puts numbers into a buffer, front to back; beyond its end they are only counted.
pub(super) struct Writer<'a> {
    pub(super) rest: &'a mut [u8],
    pub(super) offset: usize,
}

impl Writer<'_> {
    fn put(&mut self, bytes: &[u8]) {
        self.offset += bytes.len();
        match core::mem::take(&mut self.rest).split_at_mut_checked(bytes.len()) {
            Some((place, rest)) => {
                place.copy_from_slice(bytes);
                self.rest = rest;
            }
            None => self.rest = &mut [],
        }
    }

    fn i32(&mut self, value: i32) {
        self.put(&value.to_le_bytes());
    }
}

/// The sizes that the layout states; those of a set without a network are beside it.
const _: () = assert!(4 * NEURONS * (INPUTS + 1) + 11 * 14 + 6 == 280 && 8 * ELEMENTS + 20 * RIPPLES == 72);
