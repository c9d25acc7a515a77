//! SPI: RM0440, chapter 39.

use super::*;

const SPI2: u32 = 0x4000_3800;

/// Controller as embassy sets it up: master, mode 1, a 32nd of the clock.
fn bench(bits: u32) -> Bench {
    let mut bench = Bench::fast();
    bench.set(RCC + 0x58, 1 << 28 | 1 << 14);
    bench.set(SPI2 + 0x04, if bits == 8 { 0x1704 } else { 0x0f04 });
    bench.set(SPI2, 1 | 1 << 2 | 4 << 3 | 3 << 8 | 1 << 6);
    bench
}

#[test]
fn a_frame_of_16_bits_takes_16_periods_and_brings_the_answer() {
    let mut bench = bench(16);
    bench.board().answers.push_back(0x1234);
    bench.try_write(SPI2 + 0x0c, Width::Half, 0xffff).unwrap();
    let began = bench.now;
    assert_eq!(bench.get(SPI2 + 0x08) & 0x83, 0x82, "busy, and room for more");
    bench.until(SPI2 + 0x08, 1, 1);
    assert!((bench.now - began).abs_diff(16 * 32) <= 4);
    assert_eq!(bench.get(SPI2 + 0x08) & 0x80, 0, "not busy any more");
    assert_eq!(bench.try_read(SPI2 + 0x0c, Width::Half), Ok(0x1234));
    assert_eq!(bench.get(SPI2 + 0x08) & 1, 0);
    let (_, frame) = bench.board().frames[0];
    assert_eq!((frame.bus, frame.mode, frame.bits, frame.sent, frame.frequency), (2, 1, 16, 0xffff, 5_312_500));
}

#[test]
fn frames_of_8_bits_follow_each_other_without_a_gap() {
    let mut bench = bench(8);
    bench.board().answers.extend([0x11, 0x22]);
    bench.try_write(SPI2 + 0x0c, Width::Half, 0xbbaa).unwrap();
    bench.pass(2 * 8 * 32 + 2);
    let sent: Vec<_> = bench.board().frames.iter().map(|(_, frame)| (frame.sent, frame.bits)).collect();
    assert_eq!(sent, [(0xaa, 8), (0xbb, 8)], "data packing: the low byte first (39.4.9)");
    assert_eq!(bench.get(SPI2 + 0x08) >> 9 & 3, 2, "FRLVL");
    assert_eq!(bench.try_read(SPI2 + 0x0c, Width::Half), Ok(0x2211));
}

#[test]
fn what_finds_no_room_is_lost_and_flagged_until_it_is_read() {
    let mut bench = bench(16);
    for _ in 0..3 {
        bench.try_write(SPI2 + 0x0c, Width::Half, 1).unwrap();
        bench.pass(600);
    }
    assert_ne!(bench.get(SPI2 + 0x08) & 1 << 6, 0, "OVR");
    bench.try_read(SPI2 + 0x0c, Width::Half).unwrap();
    bench.get(SPI2 + 0x08);
    assert_eq!(bench.get(SPI2 + 0x08) & 1 << 6, 0, "DR, then SR (39.4.11)");
}

#[test]
fn a_disabled_peripheral_sends_nothing() {
    let mut bench = bench(16);
    bench.set(SPI2, 1 | 1 << 2 | 4 << 3 | 3 << 8);
    bench.try_write(SPI2 + 0x0c, Width::Half, 1).unwrap();
    bench.pass(10_000);
    assert!(bench.board().frames.is_empty());
}

#[test]
fn what_is_not_modelled_is_refused() {
    let mut bench = bench(16);
    assert!(bench.refused(SPI2, 1 << 13).starts_with("SPI2_CR1: bits 0x2000"), "CRC");
    assert!(bench.refused(SPI2 + 0x04, 0x0a04).contains("a size other than 8 and 16 bits"));
    assert!(bench.refused(SPI2, 1 << 6).contains("slave mode"));
    assert!(bench.refused(SPI2 + 0x0c, 0).contains("this width"));
}
