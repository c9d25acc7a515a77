//! Decoding of half-words into operations: which instruction an encoding is, and whether its outcome is defined (ARM
//! DDI 0403, A5 and A7.7).

mod branch;
mod data_processing;
mod floating_point;
mod load_store;
mod multiply;
mod narrow;
mod simd;

use super::operation::Operation;
use crate::bus::Bus;
use std::fmt;

/// Reason for which an encoding is not executed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// No such instruction on a Cortex-M4F, or it is not implemented here.
    Unknown,
    /// The architecture leaves open what it does.
    Unpredictable,
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Unknown => "not an instruction that is implemented",
            Self::Unpredictable => "unpredictable",
        })
    }
}

pub(super) type Decoded<B> = Result<Operation<B>, Refused>;

/// Returns `true` if an instruction that begins so has a second half-word.
pub(super) fn wide(first: u16) -> bool {
    first >> 11 >= 0b11101
}

/// Bits `high` to `low` of a half-word.
fn bits(word: u32, high: u32, low: u32) -> u32 {
    word >> low & (u32::MAX >> (31 - (high - low)))
}

/// Stack pointer or program counter, where most instructions must not have them (BadReg).
fn bad(register: u32) -> bool {
    matches!(register, 13 | 15)
}

/// The operation, or unpredictable if `open`.
fn unless<B: Bus>(open: bool, operation: Operation<B>) -> Decoded<B> {
    if open { Err(Refused::Unpredictable) } else { Ok(operation) }
}

/// [`decode`] of some core.
pub(super) type Decode<B> = fn(u32, u16, u16) -> Decoded<B>;

/// The instruction at `address`; the second half-word counts only if it is wide.
pub(super) fn decode<B: Bus>(address: u32, first: u16, second: u16) -> Decoded<B> {
    let is_wide = wide(first);
    let (first, second) = (u32::from(first), u32::from(second));
    let operation = match is_wide {
        false => narrow::decode(address, first),
        true => wide_decode(address, first, second),
    };
    operation.map(|operation| operation.length(if is_wide { 4 } else { 2 }))
}

/// A5.3.
fn wide_decode<B: Bus>(address: u32, first: u32, second: u32) -> Decoded<B> {
    match (bits(first, 12, 11), bits(first, 10, 9)) {
        (1, 0) if first & 0x40 == 0 => load_store::several(first, second),
        (1, 0) => load_store::pair(address, first, second),
        (1, 1) => data_processing::shifted_register(first, second),
        (1 | 3, 2 | 3) => floating_point::decode(address, first, second),
        (2, _) if second & 0x8000 != 0 => branch::decode(address, first, second),
        (2, 0 | 2) => data_processing::modified_immediate(first, second),
        (2, _) => data_processing::plain_immediate(address, first, second),
        (3, 0) => load_store::single(address, first, second),
        (3, _) => match bits(first, 8, 7) {
            0 | 1 => data_processing::register(first, second),
            2 => multiply::word(first, second),
            _ => multiply::long(first, second),
        },
        _ => Err(Refused::Unknown),
    }
}
