//! IWDG: RM0440, chapter 42.

use super::*;

const IWDG: u32 = 0x4000_3000;

/// Watchdog as embassy sets it up for 100 ms: prescaler 4, reload 799.
fn bench() -> Bench {
    let mut bench = Bench::fast();
    bench.set(IWDG, 0x5555);
    bench.set(IWDG + 0x04, 0);
    bench.set(IWDG + 0x08, 799);
    bench.set(IWDG, 0xcccc);
    bench
}

#[test]
fn unfed_it_resets_the_chip_after_its_time_and_says_so() {
    let mut bench = bench();
    bench.pass_us(99_990);
    assert!(!bench.signals.reset);
    bench.pass_us(20);
    assert!(bench.signals.reset);
    assert_eq!(bench.chip.frequency(), 16_000_000, "everything is reset");
    assert_eq!(bench.get(RCC + 0x94) & 0xfe00_0000, 0x2c00_0000, "IWDGRSTF beside the pin's and the power's");
    bench.signals.reset = false;
    bench.pass_us(1_000_000);
    assert!(!bench.signals.reset, "and it is off (IWDG_SW)");
}

#[test]
fn fed_in_time_it_waits_again() {
    let mut bench = bench();
    for _ in 0..5 {
        bench.pass_us(90_000);
        bench.set(IWDG, 0xaaaa);
    }
    assert!(!bench.signals.reset);
    bench.pass_us(100_100);
    assert!(bench.signals.reset);
}

#[test]
fn its_registers_are_locked_and_take_their_time() {
    let mut bench = Bench::fast();
    bench.set(IWDG + 0x04, 3);
    assert_eq!(bench.get(IWDG + 0x04), 0, "locked (42.3.3)");
    bench.set(IWDG, 0x5555);
    bench.set(IWDG + 0x04, 3);
    assert_eq!(bench.get(IWDG + 0x0c), 1, "PVU (42.4.4)");
    assert!(bench.refused(IWDG + 0x04, 4).contains("still on its way"));
    bench.pass_us(160);
    assert_eq!(bench.get(IWDG + 0x0c), 0);
    assert_eq!(bench.get(IWDG + 0x04), 3);
}

#[test]
fn only_the_right_key_feeds_it_and_none_stops_it() {
    let mut bench = bench();
    for key in [0, 0x5555, 0x1234] {
        bench.pass_us(30_000);
        bench.set(IWDG, key);
    }
    bench.pass_us(10_100);
    assert!(bench.signals.reset);
}

#[test]
fn the_window_is_refused() {
    assert!(Bench::fast().refused(IWDG + 0x10, 5).contains("IWDG: register at 0x010"));
}
