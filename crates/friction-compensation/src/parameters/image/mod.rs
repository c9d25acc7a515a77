//! The parameter image: one binary blob that holds a joint's friction model; task or host, never the control interrupt.
//!
//! # Layout, format versions 1 to 3
//!
//! Format 2 has [common terms](crate::friction::common) and one coefficient more, format 3 three coefficients more. An
//! image is written in the oldest format that can hold it, and one of format 1 means the same bits that it always did.
//!
//! All numbers are little-endian two's complement. Q16.16 means a 32-bit integer that counts 1/65536 of the unit.
//! Reserved bytes are zero. "Full scale" is explained in [`Domain::shifts`](crate::friction::domain::Domain::shifts).
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 4 | magic: the ASCII characters `JFPI` |
//! | 4 | 2 | format version, 1 to 3 |
//! | 6 | 2 | length of the image in bytes, checksum included; at most [`MAX_LENGTH`] |
//! | 8 | 4 | image version, rises with every image of a joint |
//! | 12 | 4 | product that the image is for, 0 = any |
//! | 16 | 4 | serial number that the image is for, 0 = any |
//! | 20 | 8 | creation time, seconds since 1970-01-01 UTC, 0 = not stated |
//! | 28 | 1 | unit of the effort: 0 Nm, 1 N, 2 A, 3 V ([`Effort`]) |
//! | 29 | 1 | number of parameter sets: 1, 2 or 4, as the criteria demand |
//! | 30 | 1 | which sets have a network: bit n for set n |
//! | 31 | 1 | number of golden vectors, 1 to [`MAX_GOLDEN`] |
//! | 32 | 16 | first 16 bytes of the SHA-256 of the data set |
//! | 48 | 48 | trained box: per [`Signal`], in order, lowest and highest value, Q16.16 |
//! | 96 | 4 | margin: how far beyond the box, in half widths, the network fades out, Q16.16, unsigned |
//! | 100 | 4 | reference temperature, Q16.16 degrees Celsius |
//! | 104 | 4 | duration of the cross-fade between sets, Q16.16 s, unsigned |
//! | 108 | 2 x 12 | criteria: measure (0 none, 1 acceleration, 2 speed, 3 coupled), three reserved bytes, upper and lower threshold, Q16.16 |
//! | 132 | 4 | limit of the absolute friction, Q16.16 of the effort's unit, unsigned |
//! | 136 | 4 | limit of the absolute slope of the network over the measured torque, Q16.16, unsigned |
//! | 140 | 4 | limit of the absolute slope of friction over velocity, unsigned, 1/256 Nm s/rad |
//! | 144 | 4 x 8 | from format 2 on: pre-sliding elements: stiffness, Q16.16 per rad, 0 to [`MAX_STIFFNESS`]; level, Q16.16 of the effort's unit, 0 to [`MAX_LEVEL`] |
//! | 176 | 2 x 20 | from format 2 on: ripple: periods in a rad; sine and cosine of the level, of the torque; Q16.16 |
//! | 144, 216 | | parameter sets, one after another |
//! | | | golden vectors, one after another |
//! | length - 4 | 4 | CRC-32 (ISO-HDLC: polynomial 0x04C11DB7 reflected, start and final XOR 0xFFFFFFFF) of all bytes before |
//!
//! A parameter set is 128 bytes, 132 in format 2, 144 in format 3, and 280 more where it has a network:
//!
//! | bytes | content |
//! |---|---|
//! | 2 | terms of the physical model that take part, a bit each ([`Terms`]) |
//! | 2 | reserved |
//! | 31 x 4, 32 x 4, 35 x 4 | coefficients at full scale, Q16.16, in the order of [`Coefficients::NAMES`](crate::friction::physical::Coefficients::NAMES) |
//! | 5 x 6 x 4 | network layer 0: per neuron five weights in Q26 and a bias in Q25 |
//! | 10 x 14 | layers 1 and 2: per neuron five weights and a bias, 16 bits each, their fraction bits (8 bits, 10 to 20), a reserved byte |
//! | 14 | layer 3, one neuron of the same form |
//! | 4 | torque for an output of 1, Q16.16, below 256 Nm |
//! | 2 | reserved |
//!
//! A golden vector is 36 bytes: the index of the set (1 byte), three reserved, the six signals (Q16.16, in the order of
//! [`Signal`]), and the exact Q16.16 torques of the physical model and of the network. A device evaluates them before
//! it uses an image, which proves that its arithmetic is the one that the image was judged with. Golden vectors are a
//! sequence: each is one step of [`GOLDEN_RATE`], and pre-sliding elements, at rest before the first, go on from one to
//! the next.
//!
//! An upload is an image and, behind it, the tag of 32 bytes that [authenticates](super::authentication) it, where
//! there is one.

mod codec;
mod pieces;

pub(in crate::parameters) use pieces::Pieces;

use super::certificate::Limits;
use crate::friction::common::{Common, CommonTerms, CommonTorques};
use crate::friction::maxwell_slip::{Bent, MAX_LEVEL, MAX_STIFFNESS};
use crate::friction::network::{MAX_FRACTION, MAX_SCALE, MIN_FRACTION};
use crate::friction::physical::{NEWEST_FORMAT, Terms, held_by};
use crate::friction::regime::MAX_SETS;
use crate::friction::state::{JointState, SIGNALS, Signal};
use crate::friction::{Estimate, FrictionModel, FrictionParameters, ParameterSet};
use codec::{Reader, Writer, decode_content, encode_content};

/// The magic bytes.
pub const MAGIC: [u8; 4] = *b"JFPI";
/// The newest format version that this code reads and writes, that of the newest coefficient; the first is 1.
pub const FORMAT: u16 = NEWEST_FORMAT;
/// The format version that common terms came with.
const COMMON_TERMS: u16 = 2;
/// Steps a second of the sequence of golden vectors.
pub const GOLDEN_RATE: u32 = 1_000;
/// Longest image: a flash page less 32 bytes for the slot's header.
pub const MAX_LENGTH: usize = 2048 - 32;
/// Most golden vectors that an image can hold.
pub const MAX_GOLDEN: usize = 8;
/// Longest image that this program has room for: [`MAX_LENGTH`], or less where it has room for fewer parameter sets.
pub const ROOM: usize = {
    let longest = 216 + MAX_SETS * (set_length(FORMAT) + 280) + MAX_GOLDEN * 36 + CRC_LENGTH;
    if longest < MAX_LENGTH { longest } else { MAX_LENGTH }
};

/// Bytes of a parameter set without a network.
const fn set_length(format: u16) -> usize {
    4 + 4 * held_by(format).1
}

/// The sizes that the layout states.
const _: () = assert!(set_length(1) == 128 && set_length(2) == 132 && set_length(3) == 144 && FORMAT == 3);

const HEADER_LENGTH: usize = 144;
const CRC_LENGTH: usize = 4;
const CRC: crc::Crc<u32, crc::NoTable> = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);

/// Unit of the effort that an image speaks of. A board accepts Nm (N on a linear axis); data sets in A or V are for
/// study.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Effort {
    /// Torque, Nm.
    #[default]
    NewtonMetre = 0,
    /// Force, N.
    Newton = 1,
    /// Motor current, A.
    Ampere = 2,
    /// Motor voltage, V.
    Volt = 3,
}

impl Effort {
    /// All units, by number.
    pub const ALL: [Self; 4] = [Self::NewtonMetre, Self::Newton, Self::Ampere, Self::Volt];

    /// The unit's symbol.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::NewtonMetre => "Nm",
            Self::Newton => "N",
            Self::Ampere => "A",
            Self::Volt => "V",
        }
    }
}

/// Joints that an image is for; 0 = any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Target {
    /// Product code.
    pub product: u32,
    /// Serial number.
    pub serial: u32,
}

/// An input and the exact output that belongs to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GoldenVector {
    /// Parameter set that is evaluated.
    pub set: u8,
    /// Signals in the order of [`Signal`], Q16.16.
    pub signals: [i32; SIGNALS],
    /// Torques that the set must give.
    pub expected: Estimate,
}

/// A decoded parameter image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Rises with every image of a joint.
    pub version: u32,
    /// Joints that the image is for.
    pub target: Target,
    /// Creation time, seconds since 1970-01-01 UTC, 0 = not stated.
    pub created: u64,
    /// Unit of the effort.
    pub effort: Effort,
    /// First 16 bytes of the data set's SHA-256.
    pub data_hash: [u8; 16],
    /// The friction model.
    pub friction: FrictionParameters,
    /// Limits that the certificate must stay within.
    pub limits: Limits,
    /// Inputs with exact outputs; at least one.
    pub golden: heapless::Vec<GoldenVector, MAX_GOLDEN>,
}

/// Reason for which bytes are not a usable image, or an image cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageError {
    /// Fewer bytes than the smallest image, or than the image's own length says.
    Truncated {
        /// Bytes present.
        length: usize,
        /// Bytes needed.
        needed: usize,
    },
    /// More bytes than the image's own length says, or than an image may have.
    TooLong {
        /// Bytes present.
        length: usize,
        /// Bytes allowed.
        limit: usize,
    },
    /// The magic is not there: this is something else.
    NotAnImage {
        /// The first four bytes.
        found: [u8; 4],
    },
    /// A format that this program does not know.
    UnsupportedFormat {
        /// Format version of the bytes.
        found: u16,
    },
    /// The content was damaged.
    Checksum {
        /// CRC-32 in the image.
        stored: u32,
        /// CRC-32 of the content.
        computed: u32,
    },
    /// Regimes, where the program has room for one parameter set ([`MAX_SETS`]).
    TooManySets {
        /// Parameter sets of the image.
        sets: u8,
    },
    /// Bytes that must be zero are not: written by a newer program, perhaps.
    Reserved {
        /// Offset of the first reserved byte.
        offset: usize,
    },
    /// A field holds a value that it must not.
    Field {
        /// Name of the field.
        name: &'static str,
        /// Offset of the field; 0 when the image is being written.
        offset: usize,
        /// Value found.
        value: i64,
        /// Lowest permitted value.
        low: i64,
        /// Highest permitted value.
        high: i64,
    },
}

impl core::fmt::Display for ImageError {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        match *self {
            Self::Truncated { length, needed } => write!(f, "truncated: {length} bytes of at least {needed}"),
            Self::TooLong { length, limit } => write!(f, "too long: {length} bytes, at most {limit} are allowed here"),
            Self::NotAnImage { found } => {
                write!(f, "not a parameter image: starts with {found:02x?}, not with \"JFPI\"")
            }
            Self::UnsupportedFormat { found } => {
                write!(f, "format version {found} is not known, this program reads versions 1 to {FORMAT}")
            }
            Self::Checksum { stored, computed } => {
                write!(f, "damaged: checksum {stored:08x} is stored, the content has {computed:08x}")
            }
            Self::TooManySets { sets } => {
                write!(
                    f,
                    "{sets} parameter sets: the joint's program has room for one and no regimes (`jointctl fit` without --regimes)"
                )
            }
            Self::Reserved { offset } => write!(f, "reserved byte at offset {offset} is not zero"),
            Self::Field { name, offset, value, low, high } => {
                write!(f, "{name} (offset {offset}) is {value}, must be {low} to {high}")
            }
        }
    }
}

impl core::error::Error for ImageError {}

/// A golden vector that this machine computes differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GoldenMismatch {
    /// Index of the vector.
    pub index: usize,
    /// Torques in the image.
    pub expected: Estimate,
    /// Torques computed here.
    pub computed: Estimate,
}

impl core::fmt::Display for GoldenMismatch {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        let Self { index, expected, computed } = self;
        write!(
            f,
            "golden vector {index}: physical {} and network {} expected, {} and {} computed",
            expected.physical, expected.network, computed.physical, computed.network
        )
    }
}

impl core::error::Error for GoldenMismatch {}

impl Image {
    /// Reads an image. `bytes` must hold the image and nothing else.
    ///
    /// Checked in this order: magic, format, length, checksum, fields. Whether the image is safe to use is the
    /// [certificate](super::certificate)'s business.
    pub fn decode(bytes: &[u8]) -> Result<Self, ImageError> {
        decode_content(Reader::new(Self::content(bytes)?))
    }

    /// Content that the checksum is of, once magic, format, length and checksum are right.
    #[inline(never)]
    pub(super) fn content(bytes: &[u8]) -> Result<&[u8], ImageError> {
        let truncated = |needed| ImageError::Truncated { length: bytes.len(), needed };
        let Some((&found, rest)) = bytes.split_first_chunk::<4>() else { return Err(truncated(4)) };
        if found != MAGIC {
            return Err(ImageError::NotAnImage { found });
        }
        let Some((&format, rest)) = rest.split_first_chunk::<2>() else { return Err(truncated(6)) };
        let format = u16::from_le_bytes(format);
        if !(1..=FORMAT).contains(&format) {
            return Err(ImageError::UnsupportedFormat { found: format });
        }
        let Some(&stated) = rest.first_chunk::<2>() else { return Err(truncated(8)) };
        let stated = u16::from_le_bytes(stated) as usize;
        if stated > MAX_LENGTH {
            return Err(ImageError::TooLong { length: stated, limit: MAX_LENGTH });
        }
        if bytes.len() < stated.max(HEADER_LENGTH + CRC_LENGTH) {
            let needed = stated.max(HEADER_LENGTH + CRC_LENGTH);
            return Err(ImageError::Truncated { length: bytes.len(), needed });
        }
        if bytes.len() > stated {
            return Err(ImageError::TooLong { length: bytes.len(), limit: stated });
        }
        let Some((content, checksum)) = bytes.split_last_chunk::<CRC_LENGTH>() else {
            return Err(ImageError::Truncated { length: bytes.len(), needed: CRC_LENGTH });
        };
        let (stored, computed) = (u32::from_le_bytes(*checksum), CRC.checksum(content));
        if stored != computed {
            return Err(ImageError::Checksum { stored, computed });
        }
        Ok(content)
    }

    /// Writes the image to the start of `buffer`; the number of bytes used. An image that [`Image::decode`] would not
    /// give back is refused.
    pub fn encode(&self, buffer: &mut [u8; MAX_LENGTH]) -> Result<usize, ImageError> {
        self.check()?;
        let mut writer = Writer { rest: &mut buffer[..], offset: 0 };
        encode_content(self, &mut writer);
        let length = writer.offset + CRC_LENGTH;
        let too_long = ImageError::TooLong { length, limit: MAX_LENGTH };
        buffer.get_mut(6..8).ok_or(too_long)?.copy_from_slice(&(length as u16).to_le_bytes());
        let (content, rest) = buffer.split_at_mut_checked(length - CRC_LENGTH).ok_or(too_long)?;
        *rest.first_chunk_mut::<CRC_LENGTH>().ok_or(too_long)? = CRC.checksum(content).to_le_bytes();
        Ok(length)
    }

    /// The oldest format that can hold the image.
    pub fn format(&self) -> u16 {
        let FrictionParameters { common, sets, .. } = &self.friction;
        let of_common = if *common == CommonTerms::NONE { 1 } else { COMMON_TERMS };
        sets.iter().map(|set| set.physical.format()).fold(of_common, u16::max)
    }

    /// Evaluates every golden vector with `model`, which must have been prepared from this image.
    pub fn verify_golden(&self, model: &FrictionModel) -> Result<(), GoldenMismatch> {
        let mut sequence = GoldenSequence::new(&self.friction.common);
        for (index, vector) in self.golden.iter().enumerate() {
            let state = JointState::from_signals(vector.signals);
            let computed = model.evaluate_with(vector.set as usize, &state, &sequence.next(&state));
            if computed != vector.expected {
                return Err(GoldenMismatch { index, expected: vector.expected, computed });
            }
        }
        Ok(())
    }
}

/// Outputs of the common terms of an image along its golden vectors.
pub struct GoldenSequence {
    common: Common,
    bent: Bent,
}

impl GoldenSequence {
    /// Sequence before the first vector.
    pub fn new(terms: &CommonTerms) -> Self {
        Self { common: Common::new(terms, GOLDEN_RATE), bent: Bent::default() }
    }

    /// Torques at the next vector's state.
    pub fn next(&mut self, state: &JointState) -> CommonTorques {
        self.common.step(&mut self.bent, state)
    }
}

impl Image {
    /// Refuses what no image may hold, but its types can.
    fn check(&self) -> Result<(), ImageError> {
        let Self { friction: FrictionParameters { domain, selector, common, sets }, golden, .. } = self;
        let field = |name, value: i64, low: i64, high: i64| match (low..=high).contains(&value) {
            true => Ok(()),
            false => Err(ImageError::Field { name, offset: 0, value, low, high }),
        };
        for (range, signal) in domain.ranges.iter().zip(Signal::ALL) {
            field(signal.name(), range.high as i64, range.low as i64, i32::MAX as i64)?;
        }
        if let [None, Some(second)] = selector.criteria {
            field("second criterion without a first", second.measure as i64, 0, 0)?;
        }
        for criterion in selector.criteria.iter().flatten() {
            field("lower threshold", criterion.leave as i64, i32::MIN as i64, criterion.enter as i64)?;
        }
        for element in &common.elements {
            field("stiffness of pre-sliding", element.stiffness as i64, 0, MAX_STIFFNESS as i64)?;
            field("level of pre-sliding", element.level as i64, 0, MAX_LEVEL as i64)?;
        }
        let last = selector.sets() as i64 - 1;
        for (index, set) in sets.iter().enumerate() {
            if *set != ParameterSet::default() {
                field("index of a set in use", index as i64, 0, last)?;
            }
            field("terms", set.physical.terms.0 as i64, 0, Terms::ALL.0 as i64)?;
            let Some(network) = &set.network else { continue };
            for neuron in network.hidden.iter().flatten().chain([&network.output]) {
                field("fraction bits", neuron.fraction as i64, MIN_FRACTION as i64, MAX_FRACTION as i64)?;
            }
            field("scale", network.scale as i64, -MAX_SCALE as i64, MAX_SCALE as i64)?;
        }
        field("number of golden vectors", golden.len() as i64, 1, MAX_GOLDEN as i64)?;
        golden.iter().try_for_each(|vector| field("golden vector's set", vector.set as i64, 0, last))
    }
}
