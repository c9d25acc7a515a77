//! The CRC unit: RM0440, chapter 16.

use super::super::variant;
use super::*;

const CRC: u32 = 0x4002_3000;

fn bench() -> Bench {
    let mut bench = Bench::new(&variant::STM32G431CB);
    bench.set(RCC + 0x48, 0x100 | 1 << 12);
    bench
}

fn feed(bench: &mut Bench, bytes: &[u8]) {
    for byte in bytes {
        bench.try_write(CRC, Width::Byte, u32::from(*byte)).unwrap();
    }
}

#[test]
fn after_reset_it_is_the_crc_32_of_ethernet_without_its_reversals() {
    let mut bench = bench();
    feed(&mut bench, b"123456789");
    assert_eq!(bench.get(CRC), 0x0376_e6e7, "CRC-32/MPEG-2, check value");
}

#[test]
fn with_both_reversals_it_is_the_crc_32_of_ethernet_before_the_last_inversion() {
    let mut bench = bench();
    bench.set(CRC + 0x08, 1 | 1 << 5 | 1 << 7);
    feed(&mut bench, b"123456789");
    assert_eq!(!bench.get(CRC), 0xcbf4_3926, "CRC-32, check value");
}

#[test]
fn words_and_half_words_go_in_highest_byte_first() {
    let mut bench = bench();
    feed(&mut bench, b"123456");
    let bytes = bench.get(CRC);
    bench.set(CRC + 0x08, 1);
    bench.set(CRC, 0x3132_3334);
    bench.try_write(CRC, Width::Half, 0x3536).unwrap();
    assert_eq!(bench.get(CRC), bytes);
}

#[test]
fn a_polynomial_of_16_bits_is_xmodem() {
    let mut bench = bench();
    bench.set(CRC + 0x14, 0x1021);
    bench.set(CRC + 0x10, 0);
    bench.set(CRC + 0x08, 1 | 1 << 3);
    feed(&mut bench, b"123456789");
    assert_eq!(bench.get(CRC), 0x31c3, "CRC-16/XMODEM, check value");
}
