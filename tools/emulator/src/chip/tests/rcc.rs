//! RCC and PWR: RM0440, chapters 6 and 7.

use super::super::rcc::Cause;
use super::super::{Deviation, variant};
use super::*;

const CR: u32 = RCC;
const CFGR: u32 = RCC + 0x08;
const PLLCFGR: u32 = RCC + 0x0c;
const CSR: u32 = RCC + 0x94;

#[test]
fn after_power_up_the_core_runs_from_hsi_at_16_mhz() {
    let mut bench = Bench::new(&variant::STM32G474CE);
    assert_eq!(bench.chip.frequency(), 16_000_000);
    assert_eq!(bench.get(CR), 0x500, "HSION and HSIRDY (7.4.1)");
    assert_eq!(bench.get(CFGR) & 0xf, 0b0101, "SW and SWS (7.4.3)");
}

#[test]
fn the_trim_of_hsi_is_added_to_its_calibration_and_nothing_else_is_kept() {
    const ICSCR: u32 = RCC + 0x04;
    let mut bench = Bench::new(&variant::STM32G431CB);
    let factory = bench.get(ICSCR);
    assert_eq!(factory >> 24, 64, "7.4.2");
    for trim in [0, 54, 64, 74, 127] {
        bench.set(ICSCR, 0x80ff_ffff & !(0x7f << 24) | trim << 24);
        assert_eq!(bench.get(ICSCR), (trim << 24) | ((factory & 0x00ff_0000) + (trim << 16) - (64 << 16)), "{trim}");
    }
    bench.set(ICSCR, 70 << 24);
    assert_eq!(bench.chip.frequency(), 16_000_000);
}

#[test]
fn the_pll_is_ready_after_its_lock_time_and_makes_170_mhz() {
    let mut bench = Bench::new(&variant::STM32G431CB);
    bench.set(RCC + 0x58, 1 << 28);
    bench.set(PWR + 0x80, 0);
    bench.set(FLASH, 0x0004_0604);
    bench.set(PLLCFGR, 1 << 24 | 85 << 8 | 3 << 4 | 2);
    bench.set(CR, 0x0100_0500);
    assert_eq!(bench.get(CR) & 1 << 25, 0, "not at once");
    let cycles = bench.until(CR, 1 << 25, 1 << 25);
    assert!((15 * 16 - 4..15 * 16 + 4).contains(&cycles), "15 µs at 16 MHz, {cycles} cycles");
    bench.set(CFGR, 3);
    assert_eq!(bench.get(CFGR) & 0xf, 0b1111);
    assert_eq!(bench.chip.frequency(), 170_000_000);
    bench.set(CFGR, 3 | 8 << 4);
    assert_eq!(bench.chip.frequency(), 85_000_000, "HPRE divides by 2");
}

#[test]
fn a_switch_to_a_clock_that_is_not_ready_stops_the_run() {
    let mut bench = Bench::new(&variant::STM32G431CB);
    bench.set(PLLCFGR, 1 << 24 | 85 << 8 | 3 << 4 | 2);
    bench.set(CR, 0x0100_0500);
    assert!(bench.refused(CFGR, 3).starts_with("RCC_CFGR: the system clock is switched to one that is not ready"));
    assert_eq!(bench.chip.frequency(), 16_000_000);
}

#[test]
fn a_pll_beyond_its_limits_or_changed_while_it_runs_stops_the_run() {
    let mut bench = Bench::new(&variant::STM32G431CB);
    bench.set(PLLCFGR, 1 << 24 | 127 << 8 | 3 << 4 | 2);
    assert!(bench.refused(CR, 0x0100_0500).contains("beyond its limits"), "a VCO of 508 MHz");
    let mut bench = Bench::fast();
    assert!(bench.refused(PLLCFGR, 1 << 24 | 80 << 8 | 3 << 4 | 2).contains("while it runs"));
}

#[test]
fn the_clock_that_the_system_runs_on_cannot_be_stopped() {
    let mut bench = Bench::fast();
    bench.set(CR, 0);
    assert_eq!(bench.get(CR) & (1 << 24 | 1 << 25), 1 << 24 | 1 << 25);
}

#[test]
fn too_few_wait_states_stop_the_run() {
    let mut bench = Bench::fast();
    assert!(bench.refused(FLASH, 0x0004_0603).contains("170000000 Hz with 3 wait states"), "3.3.3: four are needed");
}

#[test]
fn beyond_150_mhz_the_regulator_has_to_boost() {
    let prepare = |bench: &mut Bench| {
        bench.set(RCC + 0x58, 1 << 28);
        bench.set(FLASH, 0x0004_0604);
        bench.set(PLLCFGR, 1 << 24 | 85 << 8 | 3 << 4 | 2);
        bench.set(CR, 0x0100_0500);
        bench.until(CR, 1 << 25, 1 << 25);
    };
    let mut bench = Bench::new(&variant::STM32G431CB);
    prepare(&mut bench);
    assert!(bench.refused(CFGR, 3).contains("in range Normal of the regulator: the limit is 150 MHz"));
    let mut bench = Bench::new(&variant::STM32G431CB);
    bench.chip.allow(Deviation::WithoutBoost);
    prepare(&mut bench);
    bench.set(CFGR, 3);
    assert_eq!(bench.chip.frequency(), 170_000_000);
}

#[test]
fn r1mode_is_bit_8_of_pwr_cr5_and_no_other() {
    let mut bench = Bench::new(&variant::STM32G431CB);
    bench.set(RCC + 0x58, 1 << 28);
    assert_eq!(bench.get(PWR + 0x80), 0x100, "6.4.22");
    bench.set(PWR + 0x80, 0x100 & !1);
    assert_eq!(bench.get(PWR + 0x80), 0x100, "clearing bit 0 does not boost");
}

#[test]
fn a_peripheral_without_its_clock_stops_the_run_unless_that_is_known() {
    let mut bench = Bench::new(&variant::STM32G431CB);
    let text = bench.refused(0x4001_2c44, 0);
    assert!(text.contains("without its clock (RM0440, 7.2.16)"), "{text}");
    assert!(bench.unread(0x4800_0000).contains("without its clock"));
    bench.chip.allow(Deviation::WithoutClock { register: 0x4001_2c44 });
    bench.set(0x4001_2c44, 0x8000);
    assert_eq!(bench.get(0x4001_2c44), 0);
    bench.set(RCC + 0x60, 1 << 11);
    assert_eq!(bench.get(0x4001_2c44), 0, "what was written without a clock is lost");
}

#[test]
fn the_causes_of_resets_stay_until_they_are_cleared() {
    let mut bench = Bench::new(&variant::STM32G431CB);
    assert_eq!(bench.get(CSR), 0x0c00_0000, "power and pin (7.4.28)");
    bench.chip.reset(bench.now, Cause::Software);
    bench.look();
    assert!(bench.signals.reset);
    assert_eq!(bench.get(CSR), 0x1c00_0000, "and software");
    bench.set(CSR, 1 << 23);
    assert_eq!(bench.get(CSR), 0);
    bench.chip.reset(bench.now, Cause::Pin);
    assert_eq!(bench.get(CSR), 0x0400_0000);
}

#[test]
fn sram_stays_over_a_reset_and_is_junk_after_power_up() {
    let mut bench = Bench::new(&variant::STM32G431CB);
    bench.set(0x2000_0100, 0x1234_5678);
    bench.chip.reset(bench.now, Cause::Pin);
    assert_eq!(bench.get(0x2000_0100), 0x1234_5678);
    bench.chip.power_down(bench.now);
    assert!(!bench.chip.is_powered());
    assert!(bench.unread(0x2000_0100).contains("no power"));
    bench.chip.power_up(bench.now);
    assert_ne!(bench.get(0x2000_0100), 0x1234_5678);
    assert_ne!(bench.get(0x2000_0100), 0);
    assert_eq!(bench.get(CSR), 0x0c00_0000, "all older causes are gone");
}

#[test]
fn the_backup_domain_is_locked_until_dbp_and_stays_over_resets() {
    let mut bench = Bench::new(&variant::STM32G431CB);
    bench.set(RCC + 0x90, 0x8200);
    assert_eq!(bench.get(RCC + 0x90), 0);
    bench.set(RCC + 0x58, 1 << 28);
    bench.set(PWR, 0x300);
    bench.set(RCC + 0x90, 0x8200);
    bench.chip.reset(bench.now, Cause::Software);
    assert_eq!(bench.get(RCC + 0x90), 0x8200);
}

#[test]
fn a_reset_bit_resets_its_peripheral() {
    let mut bench = Bench::new(&variant::STM32G431CB);
    bench.set(RCC + 0x60, 1 << 11);
    bench.set(0x4001_2c2c, 999);
    bench.set(RCC + 0x40, 1 << 11);
    bench.set(RCC + 0x40, 0);
    assert_eq!(bench.get(0x4001_2c2c), 0xffff);
}

#[test]
fn the_apb_prescalers_are_refused() {
    let mut bench = Bench::new(&variant::STM32G431CB);
    assert!(bench.refused(CFGR, 1 | 4 << 8).starts_with("RCC_CFGR: bits 0x400"));
}
