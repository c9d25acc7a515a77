//! Length of a frame on the wire in bits: ISO 11898-1, classic base format; no I/O, host.

use crate::Frame;
use std::time::Duration;

/// Bits after the CRC sequence, not stuffed: CRC delimiter, acknowledge slot and delimiter, end of frame.
const TRAILER: u32 = 1 + 2 + 7;
/// Bits in which nobody may begin.
pub(super) const INTERFRAME_SPACE: u32 = 3;
const CRC: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_15_CAN);

/// One bit, in whole nanoseconds; a `bitrate` of 0 counts as 1 bit/s.
pub fn bit_time(bitrate: u32) -> Duration {
    Duration::from_nanos(1_000_000_000 / u64::from(bitrate.max(1)))
}

/// Bits from start of frame to the end of the interframe space, stuff bits included: 47 + 8 n + stuff bits for n bytes
/// of data.
pub fn bits(frame: &Frame) -> u32 {
    let region = stuffed_region(frame);
    region.length + stuff_bits(region) + TRAILER + INTERFRAME_SPACE
}

/// Bits in the order of the wire: the last one lowest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Region {
    bits: u128,
    length: u32,
}

/// Start of frame to CRC sequence, before stuffing.
fn stuffed_region(frame: &Frame) -> Region {
    let data = frame.data();
    // Start of frame; identifier; remote request, identifier extension and the reserved bit; length.
    let header = u32::from(frame.id()) << 7 | data.len() as u32;
    let mut crc = CRC.digest();
    // Zeros before the start of frame do not change it.
    crc.update(&header.to_be_bytes());
    crc.update(data);
    let with_data = data.iter().fold(u128::from(header), |bits, byte| bits << 8 | u128::from(*byte));
    Region { bits: with_data << 15 | u128::from(crc.finalize()), length: 34 + 8 * data.len() as u32 }
}

/// Number of stuff bits: after five equal bits comes the opposite one, which counts towards the next five.
fn stuff_bits(region: Region) -> u32 {
    let (mut stuffed, mut run, mut last) = (0, 0, None);
    for at in (0..region.length).rev() {
        let bit = region.bits >> at & 1 != 0;
        run = if last == Some(bit) { run + 1 } else { 1 };
        last = Some(bit);
        if run == 5 {
            stuffed += 1;
            run = 1;
            last = Some(!bit);
        }
    }
    stuffed
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn region(text: &str) -> Region {
        Region { bits: u128::from_str_radix(text, 2).unwrap(), length: text.len() as u32 }
    }

    #[test]
    fn a_frame_begins_as_the_standard_says_and_its_crc_is_divided_bit_by_bit() {
        let told = stuffed_region(&Frame::new(0x14, &[1]).unwrap());
        assert_eq!((told.bits >> 15, told.length), (0b000_0000_1010_0000_0001_0000_0001, 42));
        // x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1 (ISO 11898-1, CRC sequence).
        let crc = (15..42).rev().map(|at| told.bits >> at & 1 != 0).fold(0u16, |crc, bit| {
            let next = bit != (crc >> 14 & 1 != 0);
            (crc << 1 ^ if next { 0x4599 } else { 0 }) & 0x7FFF
        });
        assert_eq!((told.bits & 0x7FFF) as u16, crc);
    }

    #[test]
    fn runs_of_five_are_stuffed_and_a_stuff_bit_begins_the_next_run() {
        let run = |text| stuff_bits(region(text));
        assert_eq!([run("0000"), run("00000"), run("000001"), run("000001111"), run("0000011110000")], [0, 1, 1, 2, 3]);
        assert_eq!(run("0000000000"), 2);
    }

    #[test]
    fn a_sync_and_a_full_frame_cost_what_textbooks_say() {
        // 47 bits without data, 111 with eight bytes, before stuffing.
        let sync = bits(&Frame::new(0x80, &[]).unwrap());
        assert!((47..=47 + 8).contains(&sync), "{sync}");
        let full = Frame::new(0x2AA, &[0xAA; 8]).unwrap();
        assert_eq!(bits(&full) - stuff_bits(stuffed_region(&full)), 111);
        assert_eq!(bit_time(1_000_000), Duration::from_micros(1));
    }

    proptest! {
        #[test]
        fn no_frame_is_longer_than_the_worst_case_of_the_literature(id in 0u16..0x800, data in proptest::collection::vec(prop_oneof![Just(0u8), Just(0xFF), Just(0x0F), any::<u8>()], 0..9)) {
            let count = bits(&Frame::new(id, &data).unwrap());
            let region = 34 + 8 * data.len() as u32;
            // Davis, Burns, Bril, Lukkien, "Controller Area Network (CAN) schedulability analysis", 2007, eq. 1.
            prop_assert!((region + 13..=region + 13 + (region - 1) / 4).contains(&count));
        }
    }
}
