//! Timers: RM0440, chapters 28 to 30.

use super::super::Deviation;
use super::super::wiring::Gate;
use super::*;

const TIM1: u32 = 0x4001_2c00;
const TIM2: u32 = 0x4000_0000;
const TIM4: u32 = 0x4000_0800;
const TIM15: u32 = 0x4001_4000;
const SYSCFG: u32 = 0x4001_0000;

const TOP: u32 = 4_250;

/// All clocks on, at 170 MHz.
fn bench() -> Bench {
    let mut bench = Bench::fast();
    bench.set(RCC + 0x58, 1 << 28 | 0x7);
    bench.set(RCC + 0x60, 1 << 11 | 1 << 16 | 1);
    bench.set(RCC + 0x4c, 0x7f | 1 << 13);
    bench
}

/// TIM1 as the firmware has it: centre-aligned mode 2, PWM mode 1 preloaded on channels 1 to 3, PWM mode 2 on channel 4
/// one count before the top, dead time of 136 cycles, system break; outputs off, counter stopped.
fn bridge() -> Bench {
    let mut bench = bench();
    // PA8, PA9, PA10, PA12: function 6; PC13, PB15: function 4.
    bench.set(0x4800_0000, 0xabff_ffff & !0x033f_0000 | 0x022a_0000);
    bench.set(0x4800_0000 + 0x24, 0x0006_0666);
    bench.set(0x4800_0800, !(3 << 26) | 2 << 26);
    bench.set(0x4800_0800 + 0x24, 4 << 20);
    bench.set(0x4800_0400, !(3 << 30) | 2 << 30);
    bench.set(0x4800_0400 + 0x24, 4 << 28);
    bench.set(TIM1, 2 << 5 | 1 << 7);
    bench.set(TIM1 + 0x2c, TOP);
    bench.set(TIM1 + 0x18, 0x6868);
    bench.set(TIM1 + 0x1c, 0x7868);
    for channel in 0..3 {
        bench.set(TIM1 + 0x34 + 4 * channel, TOP / 2);
    }
    bench.set(TIM1 + 0x40, TOP - 1);
    bench.set(TIM1 + 0x04, 7 << 20);
    bench.set(TIM1 + 0x60, 0);
    bench.set(SYSCFG + 0x1c, 3);
    bench.set(TIM1 + 0x44, 0x84 | 1 << 10 | 1 << 11 | 1 << 13);
    bench.set(TIM1 + 0x44, 0x84 | 1 << 10 | 1 << 11 | 1 << 13 | 1 << 12);
    bench.set(TIM1 + 0x20, 0x555);
    bench.set(TIM1 + 0x14, 1);
    bench.set(TIM1 + 0x10, 0);
    bench
}

#[test]
fn a_time_base_counts_microseconds_overflows_and_compares() {
    // Timer as embassy's time driver has TIM15.
    let mut bench = bench();
    bench.try_write(TIM15 + 0x28, Width::Half, 169).unwrap();
    bench.set(TIM15, 1 << 2);
    bench.set(TIM15 + 0x14, 1);
    assert_eq!(bench.get(TIM15 + 0x10), 0, "URS: only a turn flags (30.8.1)");
    bench.set(TIM15 + 0x34, 0x8000);
    bench.set(TIM15 + 0x0c, 3);
    bench.set(TIM15, 1);
    bench.pass_us(1_000);
    assert!(bench.get(TIM15 + 0x24).abs_diff(1_000) <= 1);
    bench.pass_us(0x8000 - 1_000 - 10);
    assert!(!bench.line(24));
    bench.pass_us(20);
    assert!(bench.line(24), "half-way");
    assert_eq!(bench.get(TIM15 + 0x10), 2);
    bench.set(TIM15 + 0x10, !2);
    assert!(!bench.line(24));
    bench.pass_us(0x8000);
    assert_eq!(bench.get(TIM15 + 0x10), 1 | 4, "overflow; channel 2 compares with 0");
    bench.set(TIM15 + 0x38, 500);
    bench.set(TIM15 + 0x0c, 7);
    bench.set(TIM15 + 0x10, 0);
    bench.pass_us(600);
    assert_eq!(bench.get(TIM15 + 0x10), 4, "alarm");
    assert!(bench.line(24));
}

#[test]
fn centre_aligned_it_updates_at_the_top_and_at_the_bottom() {
    let mut bench = bridge();
    bench.set(TIM1 + 0x0c, 1);
    bench.set(TIM1, 1 | 2 << 5 | 1 << 7);
    let start = bench.now;
    let mut updates = vec![];
    while updates.len() < 4 {
        bench.pass(1);
        if bench.line(25) {
            updates.push((bench.now - start, bench.get(TIM1) & 0x10 != 0));
            bench.set(TIM1 + 0x10, !1);
        }
    }
    let top = u64::from(TOP);
    let expected: Vec<_> = (1..5).map(|turn| (turn * top, turn % 2 == 1)).collect();
    let near =
        updates.iter().zip(&expected).all(|(found, wanted)| found.0.abs_diff(wanted.0) <= 3 && found.1 == wanted.1);
    assert!(near, "{updates:?}, {expected:?} expected: at the top DIR says down");
}

#[test]
fn the_repetition_counter_leaves_updates_out() {
    let mut bench = bridge();
    bench.set(TIM1 + 0x30, 1);
    bench.set(TIM1 + 0x14, 1);
    bench.set(TIM1 + 0x10, 0);
    bench.set(TIM1 + 0x0c, 1);
    bench.set(TIM1, 1 | 2 << 5 | 1 << 7);
    bench.pass(u64::from(TOP) + 10);
    assert!(!bench.line(25));
    bench.pass(u64::from(TOP));
    assert!(bench.line(25), "28.3.3: every second");
}

#[test]
fn preloaded_duties_come_into_force_at_an_update_and_not_while_updates_are_held() {
    let mut bench = bridge();
    bench.set(TIM1 + 0x44, 0xbc84);
    bench.set(TIM1, 1 | 2 << 5 | 1 << 7);
    bench.pass(100);
    bench.set(TIM1 + 0x34, 1_000);
    assert_eq!(bench.board().pwm.last().unwrap().1.legs[0].compare, TOP / 2);
    bench.set(TIM1, 1 | 1 << 1 | 2 << 5 | 1 << 7);
    bench.pass(u64::from(TOP));
    assert_eq!(bench.board().pwm.last().unwrap().1.legs[0].compare, TOP / 2, "UDIS");
    assert_eq!(bench.get(TIM1 + 0x10) & 1, 0, "and no flag");
    bench.set(TIM1, 1 | 2 << 5 | 1 << 7);
    bench.pass(u64::from(TOP));
    assert_eq!(bench.board().pwm.last().unwrap().1.legs[0].compare, 1_000);
}

#[test]
fn the_outputs_are_held_low_until_moe_and_switch_apart_by_the_dead_time() {
    let mut bench = bridge();
    let pwm = bench.board().pwm.last().unwrap().1;
    for leg in pwm.legs {
        assert_eq!((leg.high, leg.low), (Gate::Held(false), Gate::Held(false)), "OSSI, OISx = 0");
    }
    bench.set(TIM1 + 0x44, 0xbc84);
    let pwm = bench.board().pwm.last().unwrap().1;
    for leg in pwm.legs {
        assert_eq!(leg.high, Gate::Switching { inverted: false });
        assert_eq!(leg.low, Gate::Complement { inverted: false });
        assert!(leg.active_below);
    }
    assert_eq!(pwm.dead_time, 136, "800 ns: DTG 84h is (64 + 4) * 2 (28.6.20)");
    assert_eq!((pwm.timer, pwm.top, pwm.tick), (TimerName::Tim1, TOP, 1));
}

#[test]
fn a_pin_that_is_not_the_timers_is_released() {
    let mut bench = bridge();
    bench.set(TIM1 + 0x44, 0xbc84);
    bench.set(0x4800_0800, u32::MAX);
    let pwm = bench.board().pwm.last().unwrap().1;
    assert_eq!(pwm.legs[0].low, Gate::Released, "PC13 is analog again");
    assert_eq!(pwm.legs[1].low, Gate::Complement { inverted: false });
}

#[test]
fn a_lock_up_of_the_core_switches_the_outputs_off_until_they_are_switched_on_again() {
    let mut bench = bridge();
    bench.set(TIM1 + 0x44, 0xbc84);
    bench.set(TIM1, 1 | 2 << 5 | 1 << 7);
    bench.pass(1_000);
    bench.chip.lockup(bench.now);
    assert_eq!(bench.board().pwm.last().unwrap().1.legs[0].high, Gate::Held(false));
    assert_eq!(bench.get(TIM1 + 0x44) & 1 << 15, 0, "MOE");
    assert_eq!(bench.get(TIM1 + 0x10) & 1 << 13, 1 << 13, "SBIF");
    bench.pass(100_000);
    assert_eq!(bench.get(TIM1 + 0x44) & 1 << 15, 0, "not by itself");
    bench.set(TIM1 + 0x44, 0xbc84);
    assert_ne!(bench.get(TIM1 + 0x44) & 1 << 15, 0);
}

#[test]
fn without_the_break_a_lock_up_changes_nothing() {
    for without in [false, true] {
        let mut bench = bench();
        // Break enabled but not connected in SYSCFG, and the other way round.
        bench.set(TIM1 + 0x60, 0);
        bench.set(TIM1 + 0x44, 1 << 13);
        bench.set(SYSCFG + 0x1c, if without { 3 } else { 0 });
        bench.set(TIM1 + 0x44, 1 << 13 | if without { 0 } else { 1 << 12 } | 1 << 15);
        bench.chip.lockup(bench.now);
        assert_ne!(bench.get(TIM1 + 0x44) & 1 << 15, 0);
    }
}

#[test]
fn an_enabled_break_with_the_polarity_after_reset_breaks_at_once() {
    let mut bench = bench();
    bench.set(TIM1 + 0x44, 1 << 15);
    assert_ne!(bench.get(TIM1 + 0x44) & 1 << 15, 0);
    bench.set(TIM1 + 0x44, 1 << 15 | 1 << 12);
    assert_eq!(bench.get(TIM1 + 0x44) & 1 << 15, 0, "BKP = 0: low is a break, and nothing drives the pin");
    assert_ne!(bench.get(TIM1 + 0x10) & 1 << 7, 0, "BIF");
}

#[test]
fn the_board_is_told_at_every_turn_and_in_order() {
    let mut bench = bridge();
    bench.set(TIM1 + 0x44, 0xbc84);
    bench.set(TIM1, 1 | 2 << 5 | 1 << 7);
    bench.board().pwm.clear();
    bench.pass(10 * u64::from(TOP) + 20);
    let turns: Vec<_> = bench.board().pwm.iter().map(|(_, pwm)| (pwm.count, pwm.up)).collect();
    assert_eq!(turns.len(), 10);
    for (number, turn) in turns.into_iter().enumerate() {
        assert_eq!(turn, if number % 2 == 0 { (TOP, false) } else { (0, true) });
    }
    let instants: Vec<_> = bench.board().pwm.iter().map(|(at, _)| at.0).collect();
    assert!(instants.windows(2).all(|pair| (pair[1] - pair[0]).abs_diff(25_000_000) <= 1), "25 µs");
}

#[test]
fn an_encoder_counts_every_edge_round_the_top_and_the_index_captures() {
    // Timer as embassy's counter driver and the firmware's index have TIM4.
    let mut bench = bench();
    bench.board().quadrature.count = 1_000;
    bench.set(TIM4 + 0x18, 0x3131);
    bench.set(TIM4 + 0x20, 0x11);
    bench.set(TIM4 + 0x08, 3);
    bench.set(TIM4 + 0x2c, 3_999);
    bench.set(TIM4, 1);
    bench.set(TIM4 + 0x1c, 0x31);
    bench.set(TIM4 + 0x20, 0x111);
    assert_eq!(bench.get(TIM4 + 0x24), 0, "wherever the encoder stands, the count begins at 0");
    bench.board().quadrature.count = 1_250;
    assert_eq!(bench.get(TIM4 + 0x24), 250);
    assert_eq!(bench.get(TIM4) & 0x10, 0);
    bench.board().quadrature.count = 950;
    assert_eq!(bench.get(TIM4 + 0x24), 3_950, "below 0 comes the top");
    assert_eq!(bench.get(TIM4) & 0x10, 0x10, "down");
    assert_eq!(bench.get(TIM4 + 0x10) & 1, 1, "UIF");
    bench.board().quadrature = Quadrature { count: 1_020, index: Some(1_010) };
    assert_eq!(bench.get(TIM4 + 0x10) & 8, 8, "CC3IF");
    assert_eq!(bench.get(TIM4 + 0x3c), 10);
    assert_eq!(bench.get(TIM4 + 0x10) & 8, 0, "reading the capture clears the flag (29.5.5)");
    for count in [2_000, 3_000] {
        bench.board().quadrature = Quadrature { count, index: Some(count) };
        bench.get(TIM4 + 0x24);
    }
    assert_eq!(bench.get(TIM4 + 0x10) & 0x808, 0x808, "CC3OF: a capture was overwritten");
}

#[test]
fn the_counter_of_tim2_has_32_bits() {
    let mut bench = bench();
    bench.set(TIM2 + 0x24, 0x1_0000);
    bench.set(TIM2, 1);
    bench.pass(98);
    assert_eq!(bench.get(TIM2 + 0x24), 0x1_0000 + 100);
}

#[test]
fn what_is_not_modelled_is_refused() {
    let mut bench = bench();
    assert!(bench.refused(TIM2, 1 << 3).starts_with("TIM2_CR1: bits 0x8"), "one pulse");
    assert!(bench.refused(TIM2, 1 << 4).contains("counting down"));
    assert!(bench.refused(TIM2 + 0x08, 1).contains("a slave mode other than encoder mode 3"));
    assert!(bench.refused(TIM2 + 0x0c, 1 << 8).starts_with("TIM2_DIER"), "DMA");
    assert!(bench.refused(TIM2 + 0x18, 3 << 4).contains("channel mode 0x30"), "toggle");
    assert!(bench.refused(TIM2 + 0x44, 0).contains("register at 0x044"), "no break on TIM2");
    assert!(bench.refused(TIM15 + 0x20, 1).starts_with("TIM15_CCER"));
    assert!(bench.refused(TIM1 + 0x44, 1 << 14).starts_with("TIM1_BDTR"), "AOE");
}

#[test]
fn the_firmwares_first_line_touches_tim1_without_a_clock_which_has_to_be_allowed() {
    let mut bench = Bench::fast();
    assert!(bench.unread(TIM1 + 0x44).contains("without its clock"));
    bench.chip.allow(Deviation::WithoutClock { register: TIM1 + 0x44 });
    assert_eq!(bench.get(TIM1 + 0x44), 0);
}
