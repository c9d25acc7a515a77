//! Reading and writing the bytes of an image, field by field, in the order of the [layout](super::image).

use super::certificate::Limits;
use super::image::{CRC_LENGTH, Effort, FORMAT, GoldenVector, Image, ImageError, MAGIC, MAX_GOLDEN, Target};
use crate::friction::domain::{Domain, Range};
use crate::friction::network::{INPUTS, MAX_FRACTION, MIN_FRACTION, NEURONS, NetworkParameters, Neuron};
use crate::friction::physical::{Coefficients, PhysicalParameters, Terms};
use crate::friction::regime::{Criterion, MAX_CRITERIA, MAX_SETS, Measure, Selector};
use crate::friction::state::{SIGNALS, Signal};
use crate::friction::{Estimate, FrictionParameters, ParameterSet};
use crate::quantity::Torque;

/// Everything between the length and the checksum.
pub(super) fn decode_content(mut reader: Reader) -> Result<Image, ImageError> {
    reader.skip(8)?;
    let version = reader.u32()?;
    let target = Target { product: reader.u32()?, serial: reader.u32()? };
    let created = u64::from_le_bytes(reader.bytes()?);
    let effort = match reader.checked_u8("effort unit", 0, 3)? {
        0 => Effort::NewtonMetre,
        1 => Effort::Newton,
        2 => Effort::Ampere,
        _ => Effort::Volt,
    };
    let sets_offset = reader.offset;
    let sets = reader.checked_u8("number of sets", 1, MAX_SETS as u8)?;
    let networks = reader.checked_u8("networks", 0, ((1u16 << sets) - 1) as u8)?;
    let golden_count = reader.checked_u8("number of golden vectors", 1, MAX_GOLDEN as u8)?;
    let data_hash = reader.bytes()?;

    let mut ranges = [Range::ANY; SIGNALS];
    for (range, signal) in ranges.iter_mut().zip(Signal::ALL) {
        let low = reader.i32()?;
        let high = reader.checked_i32(signal.name(), low, i32::MAX)?;
        *range = Range { low, high };
    }
    let domain = Domain { ranges, margin: reader.u32()?, reference_temperature: reader.i32()? };
    let mut selector = Selector { fade_time: reader.u32()?, ..Default::default() };
    for i in 0..MAX_CRITERIA {
        // A second criterion without a first has no meaning: only "none" may follow "none".
        let last = i > 0 && selector.criteria[0].is_none();
        let measure = reader.checked_u8("criterion", 0, if last { 0 } else { 3 })?;
        reader.reserved(3)?;
        let enter = reader.i32()?;
        let leave = reader.checked_i32("lower threshold", i32::MIN, enter)?;
        let measure = match measure {
            0 if (enter, leave) == (0, 0) => continue,
            0 => return Err(ImageError::Reserved { offset: reader.offset - 8 }),
            1 => Measure::Acceleration,
            2 => Measure::Speed,
            _ => Measure::Coupled,
        };
        selector.criteria[i] = Some(Criterion { measure, enter, leave });
    }
    if sets as usize != selector.sets() {
        let expected = selector.sets() as i64;
        let (name, value) = ("number of sets", sets as i64);
        return Err(ImageError::Field { name, offset: sets_offset, value, low: expected, high: expected });
    }
    let limits = Limits { output: reader.u32()?, torque_gain: reader.u32()?, velocity_slope: reader.u32()? };

    let mut friction = FrictionParameters { domain, selector, sets: Default::default() };
    for (i, set) in friction.sets.iter_mut().enumerate().take(sets as usize) {
        set.physical = decode_physical(&mut reader)?;
        if networks >> i & 1 == 1 {
            set.network = Some(decode_network(&mut reader)?);
        }
    }
    let mut golden = heapless::Vec::new();
    for _ in 0..golden_count {
        let set = reader.checked_u8("golden vector's set", 0, sets - 1)?;
        reader.reserved(3)?;
        let mut signals = [0; SIGNALS];
        for signal in &mut signals {
            *signal = reader.i32()?;
        }
        let expected =
            Estimate { physical: Torque::from_bits(reader.i32()?), network: Torque::from_bits(reader.i32()?) };
        // The count was checked against the capacity.
        let _ = golden.push(GoldenVector { set, signals, expected });
    }
    if !reader.bytes.is_empty() {
        let length = reader.offset + reader.bytes.len() + CRC_LENGTH;
        return Err(ImageError::TooLong { length, limit: reader.offset + CRC_LENGTH });
    }
    Ok(Image { version, target, created, effort, data_hash, friction, limits, golden })
}

fn decode_physical(reader: &mut Reader) -> Result<PhysicalParameters, ImageError> {
    let offset = reader.offset;
    let terms = reader.u16()?;
    if terms & !Terms::ALL.0 != 0 {
        let (low, high) = (0, Terms::ALL.0 as i64);
        return Err(ImageError::Field { name: "terms", offset, value: terms as i64, low, high });
    }
    reader.reserved(2)?;
    let mut coefficients = [0; Coefficients::COUNT];
    for coefficient in &mut coefficients {
        *coefficient = reader.i32()?;
    }
    Ok(PhysicalParameters { terms: Terms(terms), coefficients: Coefficients::from_array(coefficients) })
}

fn decode_network(reader: &mut Reader) -> Result<NetworkParameters, ImageError> {
    let mut network = NetworkParameters::default();
    for weight in network.first.iter_mut().flatten() {
        *weight = reader.i32()?;
    }
    for neuron in network.hidden.iter_mut().flatten().chain([&mut network.output]) {
        *neuron = decode_neuron(reader)?;
    }
    network.scale = reader.i32()?;
    reader.reserved(2)?;
    Ok(network)
}

fn decode_neuron(reader: &mut Reader) -> Result<Neuron, ImageError> {
    let mut weights = [0; NEURONS + 1];
    for weight in &mut weights {
        *weight = i16::from_le_bytes(reader.bytes()?);
    }
    let fraction = reader.checked_u8("fraction bits", MIN_FRACTION, MAX_FRACTION)?;
    reader.reserved(1)?;
    Ok(Neuron { weights, fraction })
}

/// Everything before the checksum; the length stays open.
pub(super) fn encode_content(image: &Image, writer: &mut Writer) {
    let Image { friction, limits, golden, .. } = image;
    let sets = friction.selector.sets();
    let networks = (0..sets).filter(|&i| friction.sets[i].network.is_some()).fold(0u8, |mask, i| mask | 1 << i);
    writer.put(&MAGIC);
    writer.put(&FORMAT.to_le_bytes());
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
    for set in friction.sets.iter().take(sets) {
        encode_set(set, writer);
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

fn encode_set(set: &ParameterSet, writer: &mut Writer) {
    writer.put(&set.physical.terms.0.to_le_bytes());
    writer.put(&[0; 2]);
    for coefficient in set.physical.coefficients.to_array() {
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

/// Takes numbers off the front of a byte string.
pub(super) struct Reader<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) offset: usize,
}

impl Reader<'_> {
    pub(super) fn bytes<const N: usize>(&mut self) -> Result<[u8; N], ImageError> {
        let Some((head, rest)) = self.bytes.split_first_chunk::<N>() else {
            let (length, needed) = (self.offset + self.bytes.len(), self.offset + N);
            return Err(ImageError::Truncated { length, needed });
        };
        self.bytes = rest;
        self.offset += N;
        Ok(*head)
    }

    pub(super) fn u16(&mut self) -> Result<u16, ImageError> {
        self.bytes().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Result<u32, ImageError> {
        self.bytes().map(u32::from_le_bytes)
    }

    fn i32(&mut self) -> Result<i32, ImageError> {
        self.bytes().map(i32::from_le_bytes)
    }

    fn skip(&mut self, count: usize) -> Result<(), ImageError> {
        for _ in 0..count {
            self.bytes::<1>()?;
        }
        Ok(())
    }

    fn reserved(&mut self, count: usize) -> Result<(), ImageError> {
        for _ in 0..count {
            let offset = self.offset;
            if self.bytes::<1>()? != [0] {
                return Err(ImageError::Reserved { offset });
            }
        }
        Ok(())
    }

    fn checked_u8(&mut self, name: &'static str, low: u8, high: u8) -> Result<u8, ImageError> {
        let offset = self.offset;
        let [value] = self.bytes()?;
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(ImageError::Field { name, offset, value: value as i64, low: low as i64, high: high as i64 })
    }

    fn checked_i32(&mut self, name: &'static str, low: i32, high: i32) -> Result<i32, ImageError> {
        let offset = self.offset;
        let value = self.i32()?;
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(ImageError::Field { name, offset, value: value as i64, low: low as i64, high: high as i64 })
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

/// The sizes that the layout states.
const _: () = assert!(4 + 4 * Coefficients::COUNT == 128 && 4 * NEURONS * (INPUTS + 1) + 11 * 14 + 6 == 280);
