//! Length of a frame on the wire in bits: ISO 11898-1, classic base format; no I/O, host.

use crate::Frame;
use std::time::Duration;

/// Bits after the CRC sequence, not stuffed: CRC delimiter, acknowledge slot and delimiter, end of frame.
const TRAILER: u32 = 1 + 2 + 7;
/// Bits in which nobody may begin.
pub(super) const INTERFRAME_SPACE: u32 = 3;
/// Generator polynomial of the CRC sequence, without x^15.
const POLYNOMIAL: u16 = 0x4599;

/// One bit, in whole nanoseconds; a `bitrate` of 0 counts as 1 bit/s.
pub fn bit_time(bitrate: u32) -> Duration {
    Duration::from_nanos(1_000_000_000 / u64::from(bitrate.max(1)))
}

/// Bits from start of frame to the end of the interframe space, stuff bits included: 47 + 8 n + stuff bits for n bytes
/// of data.
pub fn bits(frame: &Frame) -> u32 {
    let stuffed = stuffed_region(frame);
    stuffed.len() as u32 + stuff_bits(&stuffed) + TRAILER + INTERFRAME_SPACE
}

/// Start of frame to CRC sequence, before stuffing.
fn stuffed_region(frame: &Frame) -> Vec<bool> {
    let mut bits = Vec::with_capacity(98);
    let mut push = |value: u16, width: u32| bits.extend((0..width).rev().map(|bit| value >> bit & 1 != 0));
    // Start of frame; identifier; remote request, identifier extension and the reserved bit; length.
    push(0, 1);
    push(frame.id(), 11);
    push(0, 3);
    push(frame.data().len() as u16, 4);
    for byte in frame.data() {
        push(u16::from(*byte), 8);
    }
    let crc = crc(&bits);
    bits.extend((0..15).rev().map(|bit| crc >> bit & 1 != 0));
    bits
}

fn crc(bits: &[bool]) -> u16 {
    bits.iter().fold(0, |crc, bit| {
        let next = *bit != (crc >> 14 & 1 != 0);
        (crc << 1 ^ if next { POLYNOMIAL } else { 0 }) & 0x7FFF
    })
}

/// Number of stuff bits: after five equal bits comes the opposite one, which counts towards the next five.
fn stuff_bits(bits: &[bool]) -> u32 {
    let (mut stuffed, mut run, mut last) = (0, 0, None);
    for bit in bits {
        run = if last == Some(*bit) { run + 1 } else { 1 };
        last = Some(*bit);
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

    #[test]
    fn the_crc_is_the_catalogue_s_and_a_frame_begins_as_the_standard_says() {
        // CRC-15/CAN in the catalogue of parametrised CRC algorithms: 059Eh for "123456789".
        let text: Vec<bool> =
            b"123456789".iter().flat_map(|byte| (0..8).rev().map(move |bit| byte >> bit & 1 != 0)).collect();
        assert_eq!(crc(&text), 0x059E);
        let region = stuffed_region(&Frame::new(0x14, &[1]).unwrap());
        let text: String = region.iter().map(|bit| if *bit { '1' } else { '0' }).collect();
        assert_eq!((&text[..27], text.len()), ("000000010100000000100000001", 42));
    }

    #[test]
    fn runs_of_five_are_stuffed_and_a_stuff_bit_begins_the_next_run() {
        let run = |text: &str| stuff_bits(&text.chars().map(|bit| bit == '1').collect::<Vec<_>>());
        assert_eq!([run("0000"), run("00000"), run("000001"), run("000001111"), run("0000011110000")], [0, 1, 1, 2, 3]);
        assert_eq!(run("0000000000"), 2);
    }

    #[test]
    fn a_sync_and_a_full_frame_cost_what_textbooks_say() {
        // 47 bits without data, 111 with eight bytes, before stuffing.
        let sync = bits(&Frame::new(0x80, &[]).unwrap());
        assert!((47..=47 + 8).contains(&sync), "{sync}");
        assert_eq!(
            bits(&Frame::new(0x2AA, &[0xAA; 8]).unwrap())
                - stuff_bits(&stuffed_region(&Frame::new(0x2AA, &[0xAA; 8]).unwrap())),
            111
        );
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

        #[test]
        fn the_crc_of_a_region_with_its_crc_is_zero(id in 0u16..0x800, data in proptest::collection::vec(any::<u8>(), 0..9)) {
            prop_assert_eq!(crc(&stuffed_region(&Frame::new(id, &data).unwrap())), 0);
        }
    }
}
