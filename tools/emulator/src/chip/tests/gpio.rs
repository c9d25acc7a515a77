//! GPIO: RM0440, chapter 9.

use super::super::variant;
use super::*;

const A: u32 = 0x4800_0000;
const C: u32 = 0x4800_0800;

fn bench() -> Bench {
    let mut bench = Bench::new(&variant::STM32G431CB);
    bench.set(RCC + 0x4c, 0x7f);
    bench
}

#[test]
fn after_reset_pins_are_analog_but_for_the_debuggers() {
    let mut bench = bench();
    assert_eq!(bench.get(A), 0xabff_ffff, "9.4.1");
    assert_eq!(bench.get(0x4800_0400), 0xffff_febf);
    assert_eq!(bench.get(C), u32::MAX);
}

#[test]
fn an_output_is_set_and_cleared_without_a_read() {
    let mut bench = bench();
    bench.set(C, !(3 << 12) | 1 << 12);
    let (pin, now) = (Pin::new('C', 6), bench.now);
    let at = bench.chip.instant(now);
    assert_eq!(bench.board().driven, [(at, pin, Some(false))], "driven as soon as it is an output");
    bench.set(C + 0x18, 1 << 6 | 1 << 22);
    assert_eq!(bench.get(C + 0x14), 1 << 6, "9.4.7: setting wins");
    assert_eq!(bench.get(C + 0x10), 1 << 6, "its input shows what it drives");
    bench.set(C + 0x28, 1 << 6);
    assert_eq!(bench.get(C + 0x14), 0);
    let levels: Vec<_> = bench.board().driven.iter().map(|(_, _, level)| *level).collect();
    assert_eq!(levels, [Some(false), Some(true), Some(false)]);
    bench.set(C, u32::MAX);
    assert_eq!(bench.board().driven.last().unwrap().2, None, "released");
}

#[test]
fn an_open_drain_drives_low_only() {
    let mut bench = bench();
    bench.set(C + 0x04, 1 << 6);
    bench.set(C, !(3 << 12) | 1 << 12);
    bench.set(C + 0x18, 1 << 6);
    assert_eq!(bench.board().driven.last().unwrap().2, None);
    bench.board().levels.insert(Pin::new('C', 6), true);
    assert_eq!(bench.get(C + 0x10), 1 << 6, "and shows what the board drives");
}

#[test]
fn an_input_shows_the_board_or_its_pull() {
    let mut bench = bench();
    bench.set(C, !(3 << 20));
    assert_eq!(bench.get(C + 0x10), 0, "floating reads low here");
    bench.set(C + 0x0c, 1 << 20);
    assert_eq!(bench.get(C + 0x10), 1 << 10);
    bench.board().levels.insert(Pin::new('C', 10), false);
    assert_eq!(bench.get(C + 0x10), 0, "the board is stronger");
    bench.set(C, u32::MAX);
    bench.board().levels.insert(Pin::new('C', 10), true);
    assert_eq!(bench.get(C + 0x10), 0, "an analog pin's input is off (9.3.12)");
}

#[test]
fn the_lock_register_is_refused() {
    let mut bench = bench();
    assert!(bench.refused(C + 0x1c, 1).starts_with("GPIOC_LCKR"));
}
