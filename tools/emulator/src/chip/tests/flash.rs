//! FLASH: RM0440, chapters 3 and 5.

use super::super::flash::{ERASE_NS, PROGRAM_NS};
use super::super::rcc::Cause;
use super::super::{Waiting, flash::Torn, variant};
use super::*;

const KEYR: u32 = FLASH + 0x08;
const SR: u32 = FLASH + 0x10;
const CR: u32 = FLASH + 0x14;
const ECCR: u32 = FLASH + 0x18;

const BSY: u32 = 1 << 16;
const STRT: u32 = 1 << 16;

pub fn unlock(bench: &mut Bench) {
    bench.set(KEYR, 0x4567_0123);
    bench.set(KEYR, 0xcdef_89ab);
}

/// Waits until an operation ends, or the power goes; looks every few microseconds.
fn wait(bench: &mut Bench, microseconds: u64) {
    while bench.signals.stall.is_some() {
        bench.pass_us(microseconds);
    }
}

/// Both words of a double word; waits for the end.
pub fn program(bench: &mut Bench, address: u32, low: u32, high: u32) -> u32 {
    bench.set(CR, 1);
    bench.set(address, low);
    bench.set(address + 4, high);
    wait(bench, 1);
    if !bench.chip.is_powered() {
        return 0;
    }
    bench.set(CR, 0);
    bench.get(SR)
}

/// A page of a bank; waits for the end.
pub fn erase(bench: &mut Bench, bank: u32, page: u32) -> u32 {
    bench.set(CR, 2 | page << 3 | bank << 11);
    bench.set(CR, 2 | page << 3 | bank << 11 | STRT);
    wait(bench, 100);
    if !bench.chip.is_powered() {
        return 0;
    }
    bench.set(CR, 0);
    bench.get(SR)
}

#[test]
fn it_is_locked_until_both_keys_came() {
    let mut bench = Bench::fast();
    bench.set(CR, 1);
    assert_eq!(bench.get(CR), 0xc000_0000, "writes are ignored");
    bench.set(0x0801_0000, 1);
    assert_eq!(bench.get(SR), 1 << 7, "PGSERR: written without PG");
    bench.set(SR, 1 << 7);
    unlock(&mut bench);
    assert_eq!(bench.get(CR), 0x4000_0000);
    bench.set(CR, 1);
    assert_eq!(bench.get(CR), 0x4000_0001);
    bench.set(CR, 1 << 31);
    bench.set(CR, 1);
    assert_eq!(bench.get(CR), 0xc000_0000, "and locked again");
}

#[test]
fn a_wrong_key_is_a_bus_error_and_locks_until_the_next_reset() {
    let mut bench = Bench::fast();
    assert_eq!(bench.try_write(KEYR, Width::Word, 0x1234_5678), Err(Refusal::NoAnswer));
    assert_eq!(bench.try_write(KEYR, Width::Word, 0x4567_0123), Err(Refusal::NoAnswer), "3.3.6");
    assert_eq!(bench.get(CR), 0xc000_0000);
    bench.chip.reset(bench.now, Cause::Software);
    unlock(&mut bench);
    assert_eq!(bench.get(CR), 0x4000_0000);
}

#[test]
fn a_double_word_is_programmed_by_two_words_and_takes_its_time() {
    let mut bench = Bench::fast();
    unlock(&mut bench);
    bench.set(CR, 1);
    bench.set(0x0801_0008, 0x1122_3344);
    assert_eq!(bench.get(SR), 0, "nothing begins before the second word");
    bench.set(0x0801_000c, 0x5566_7788);
    let cycles = bench.until(SR, BSY, 0);
    let expected = PROGRAM_NS * 170 / 1_000;
    assert!(cycles.abs_diff(expected) < 10, "{cycles} cycles, {expected} expected");
    assert_eq!(bench.get(0x0801_0008), 0x1122_3344);
    assert_eq!(bench.get(0x0801_000c), 0x5566_7788);
    assert_eq!(bench.get(0x0001_000c), 0x5566_7788, "and at the alias from address 0");
    assert_eq!(bench.get(SR), 0, "EOP is set with its interrupt's enable only (3.7.5)");
    assert_eq!(bench.signals.rewritten, Some(0x0801_0008..0x0801_0010));
}

#[test]
fn a_double_word_is_written_once_but_for_zeros() {
    let mut bench = Bench::fast();
    unlock(&mut bench);
    assert_eq!(program(&mut bench, 0x0801_0000, u32::MAX, u32::MAX), 0);
    assert_eq!(program(&mut bench, 0x0801_0000, 1, 2), 1 << 3, "PROGERR: even ones count as written");
    assert_eq!(bench.get(0x0801_0000), u32::MAX);
    assert_eq!(program(&mut bench, 0x0801_0000, 0, 0), 1 << 3 | 1 << 7, "the flag blocks everything: PGSERR");
    bench.set(SR, 0xff);
    assert_eq!(program(&mut bench, 0x0801_0000, 0, 0), 0);
    assert_eq!(bench.get(0x0801_0000), 0);
}

#[test]
fn wrong_sequences_are_flagged_and_change_nothing() {
    let mut bench = Bench::fast();
    unlock(&mut bench);
    bench.set(CR, 1);
    bench.set(0x0801_0004, 1);
    assert_eq!(bench.get(SR), 1 << 5, "PGAERR: begins with the second word");
    bench.set(SR, 1 << 5);
    bench.set(0x0801_0000, 1);
    bench.set(0x0801_000c, 1);
    assert_eq!(bench.get(SR), 1 << 5, "PGAERR: second word of another double word");
    bench.set(SR, 1 << 5);
    bench.try_write(0x0801_0000, Width::Byte, 1).unwrap();
    assert_eq!(bench.get(SR), 1 << 6, "SIZERR");
    bench.set(SR, 1 << 6);
    assert_eq!(bench.get(0x0801_0000), u32::MAX);
    assert_eq!(bench.chip.flash().operations(), 0);
    assert!(bench.refused(CR, 1 | STRT).contains("STRT without what to erase"));
    assert!(bench.refused(CR, 4 | STRT).starts_with("FLASH_CR: bits 0x4"), "mass erase");
}

#[test]
fn a_page_is_erased_and_takes_its_time() {
    let mut bench = Bench::fast();
    assert!(bench.chip.program(0x0801_0000, &[0x55; 4096]));
    unlock(&mut bench);
    let begin = bench.now;
    assert_eq!(erase(&mut bench, 0, 32), 0);
    let microseconds = (bench.now - begin) / 170;
    assert!(microseconds.abs_diff(ERASE_NS / 1_000) < 110, "{microseconds} µs");
    assert!((0..2048).step_by(4).all(|byte| bench.get(0x0801_0000 + byte) == u32::MAX));
    assert_eq!(bench.get(0x0801_0800), 0x5555_5555, "the next page is whole");
    assert_eq!(program(&mut bench, 0x0801_0000, 7, 7), 0);
}

#[test]
fn pages_that_are_not_there_stop_the_run() {
    let mut bench = Bench::fast();
    unlock(&mut bench);
    assert!(bench.refused(CR, 2 | 64 << 3 | STRT).contains("a page is erased that is not there"));
    assert!(bench.refused(CR, 2 | 1 << 11 | STRT).contains("a page is erased that is not there"), "a second bank");
}

#[test]
fn one_bank_stalls_its_readers_two_banks_only_those_of_the_same() {
    let mut bench = Bench::fast();
    unlock(&mut bench);
    bench.set(CR, 2 | 60 << 3 | STRT);
    let (range, until) = bench.signals.stall.clone().unwrap();
    assert_eq!(range, 0x0800_0000..0x0802_0000);
    assert_eq!(until, bench.now + ERASE_NS * 170 / 1_000);
    bench.pass_us(ERASE_NS / 1_000 + 1);
    assert_eq!(bench.signals.stall, None);

    let mut bench = Bench::new(&variant::STM32G474CE);
    bench.speed_up();
    unlock(&mut bench);
    bench.set(CR, 2 | 127 << 3 | 1 << 11 | STRT);
    assert_eq!(bench.signals.stall.clone().unwrap().0, 0x0804_0000..0x0808_0000);
    assert_eq!(bench.signals.rewritten, Some(0x0807_f800..0x0808_0000));
}

#[test]
fn the_flash_is_left_alone_while_it_works() {
    let mut bench = Bench::fast();
    unlock(&mut bench);
    bench.set(CR, 2 | 60 << 3 | STRT);
    assert!(bench.refused(CR, 0).contains("while an operation is under way"));
    assert!(bench.refused(0x0801_0000, 0).contains("while an operation is under way"));
}

#[test]
fn the_end_of_an_operation_interrupts_where_it_is_enabled() {
    let mut bench = Bench::fast();
    unlock(&mut bench);
    bench.set(CR, 1 | 1 << 24);
    bench.set(0x0801_0000, 1);
    bench.set(0x0801_0004, 1);
    assert!(!bench.line(4));
    bench.pass_us(82);
    assert!(bench.line(4));
    bench.set(SR, 1);
    assert!(!bench.line(4));
}

#[test]
fn reading_a_torn_double_word_is_a_non_maskable_interrupt_until_it_is_cleared() {
    for (variant, address, status) in [
        (&variant::STM32G431CB, 0x0801_d008, 1 << 31 | 0x1_d008),
        (&variant::STM32G474CE, 0x0807_d008, 1 << 31 | 1 << 21 | 0x3_d008),
    ] {
        let mut bench = Bench::new(variant);
        bench.speed_up();
        unlock(&mut bench);
        bench.chip.power_cut_at(1, Torn::Error);
        program(&mut bench, address, 1, 2);
        bench.chip.power_up(bench.now);
        assert_eq!(bench.get(address - 8), u32::MAX);
        assert!(!bench.signals.nmi);
        bench.get(address + 4);
        assert!(bench.signals.nmi);
        assert_eq!(bench.get(ECCR), status, "{}", variant.name);
        bench.set(ECCR, 0);
        assert!(bench.signals.nmi, "a zero clears nothing");
        bench.set(ECCR, 1 << 31);
        assert!(!bench.signals.nmi);
        // It can be overwritten by zeros, and erased.
        unlock(&mut bench);
        assert_eq!(program(&mut bench, address, 5, 6), 1 << 3);
        bench.set(SR, 1 << 3);
        assert_eq!(program(&mut bench, address, 0, 0), 0);
        assert_eq!(bench.get(address), 0);
        assert!(!bench.signals.nmi);
    }
}

#[test]
fn a_reset_in_the_middle_of_an_operation_leaves_a_torn_word() {
    let mut bench = Bench::fast();
    unlock(&mut bench);
    bench.set(CR, 1);
    bench.set(0x0801_0000, 1);
    bench.set(0x0801_0004, 1);
    bench.chip.reset(bench.now, Cause::IndependentWatchdog);
    bench.get(0x0801_0000);
    assert!(bench.signals.nmi);
}

#[test]
fn wait_states_are_the_flashs_alone() {
    let bench = Bench::fast();
    assert_eq!(bench.chip.wait_states(0x0800_1000), 4);
    assert_eq!(bench.chip.wait_states(0x2000_1000), 0);
    assert_eq!(bench.chip.wait_states(0x1000_1000), 0);
    assert_eq!(bench.chip.line(), None, "the prefetch keeps up");
}

#[test]
fn wait_states_are_counted_where_that_is_chosen() {
    let mut bench = Bench::fast();
    bench.chip.set_waiting(Waiting::Always);
    assert_eq!((bench.chip.wait_states(0x0800_1000), bench.chip.line()), (4, Some(8)));
    bench.chip.set_waiting(Waiting::Never);
    assert_eq!((bench.chip.wait_states(0x0800_1000), bench.chip.line()), (0, None));
}

const OPTKEYR: u32 = FLASH + 0x0c;
const OPTR: u32 = FLASH + 0x20;
const OPTSTRT: u32 = 1 << 17;
const OBL_LAUNCH: u32 = 1 << 27;

fn unlock_options(bench: &mut Bench) {
    unlock(bench);
    bench.set(OPTKEYR, 0x0819_2a3b);
    bench.set(OPTKEYR, 0x4c5d_6e7f);
}

#[test]
fn options_are_locked_until_both_pairs_of_keys_came() {
    let mut bench = Bench::fast();
    let before = bench.get(OPTR);
    bench.set(OPTR, before & !(1 << 24));
    unlock(&mut bench);
    bench.set(OPTR, before & !(1 << 24));
    bench.set(CR, OPTSTRT);
    assert_eq!((bench.get(OPTR), bench.get(SR)), (before, 0), "writes are ignored");
    assert_eq!(bench.try_write(OPTKEYR, Width::Word, 1), Err(Refusal::NoAnswer));
    assert_eq!(bench.try_write(OPTKEYR, Width::Word, 0x0819_2a3b), Err(Refusal::NoAnswer), "until the next reset");
    let mut bench = Bench::fast();
    assert_eq!(
        bench.try_write(OPTKEYR, Width::Word, 0x0819_2a3b),
        Err(Refusal::NoAnswer),
        "the flash's own come first"
    );
}

#[test]
fn options_that_are_programmed_count_once_they_are_loaded() {
    let mut bench = Bench::fast();
    let before = bench.get(OPTR);
    unlock_options(&mut bench);
    bench.set(OPTR, before & !(1 << 24));
    bench.set(CR, OPTSTRT);
    bench.until(SR, BSY, 0);
    bench.chip.reset(bench.now, Cause::Software);
    assert_eq!(bench.get(OPTR), before, "a reset does not load them");
    unlock_options(&mut bench);
    bench.set(CR, OBL_LAUNCH);
    assert!(bench.signals.reset);
    assert_eq!(bench.get(OPTR), before & !(1 << 24));
    bench.chip.power_down(bench.now);
    bench.chip.power_up(bench.now);
    assert_eq!(bench.get(OPTR), before & !(1 << 24));
}

#[test]
fn options_that_were_not_programmed_are_as_before() {
    let mut bench = Bench::fast();
    let before = bench.get(OPTR);
    unlock_options(&mut bench);
    bench.set(OPTR, before & !(1 << 26));
    bench.set(CR, OBL_LAUNCH);
    assert_eq!(bench.get(OPTR), before);
    unlock_options(&mut bench);
    assert!(bench.refused(OPTR, before ^ 1).contains("another read protection"));
}

#[test]
fn the_options_say_whether_there_are_two_banks() {
    assert_eq!(Bench::new(&variant::STM32G474CE).get(FLASH + 0x20) >> 22 & 1, 1);
    assert_eq!(Bench::new(&variant::STM32G431CB).get(FLASH + 0x20) >> 22 & 1, 0);
}
