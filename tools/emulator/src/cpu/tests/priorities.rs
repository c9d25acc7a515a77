//! Order of exceptions: which comes first, which waits, and what masks them.

use super::{AIRCR, complete, enable, finish, handler, machine, pend, place, read};
use crate::cpu::{Cpu, End};
use crate::memory::Memory;

/// A core on which interrupts 0 to 3 are enabled with these priorities; their handlers are breakpoints of their number
/// and return.
fn with_priorities(priorities: [u8; 4]) -> Cpu<Memory> {
    let mut cpu = machine(&[0xbf00]);
    for (n, priority) in priorities.into_iter().enumerate() {
        enable(&mut cpu, n as u32, priority);
        place(&mut cpu, handler(16 + n as u16), &[0xbe10 | n as u16, 0x4770]);
    }
    cpu
}

/// The handlers in the order in which they come.
fn order(cpu: &mut Cpu<Memory>) -> Vec<u8> {
    let mut order = Vec::new();
    while let End::Breakpoint { number, .. } = finish(cpu) {
        if number == 0 {
            break;
        }
        order.push(number & 0xf);
        cpu.skip();
    }
    order
}

#[test]
fn the_smaller_priority_comes_first_and_the_smaller_number_among_equals() {
    let mut cpu = with_priorities([0x30, 0x10, 0x20, 0x10]);
    (0..4).for_each(|n| pend(&mut cpu, n));
    assert_eq!(order(&mut cpu), [1, 3, 2, 0]);
}

#[test]
fn four_bits_of_a_priority_exist() {
    let mut cpu = with_priorities([0xff, 0, 0, 0]);
    assert_eq!(read(&mut cpu, 0xe000_e400), 0xf0);
}

#[test]
fn only_a_smaller_priority_preempts() {
    for (first, second, depth) in [(0x20, 0x10, 2), (0x20, 0x20, 1), (0x10, 0x20, 1)] {
        let mut cpu = with_priorities([first, second, 0, 0]);
        pend(&mut cpu, 0);
        finish(&mut cpu);
        pend(&mut cpu, 1);
        cpu.skip();
        finish(&mut cpu);
        // A frame each, or one where the second waited.
        assert_eq!(super::STACK - cpu.register(13), 32 * depth, "{first:#x} and {second:#x}");
    }
}

#[test]
fn within_a_group_nothing_preempts_but_the_subpriority_orders() {
    let mut cpu = with_priorities([0x70, 0x60, 0x50, 0x30]);
    // Two bits for the group: 0x40 to 0x70 are one.
    super::write(&mut cpu, AIRCR, 0x05fa_0500);
    pend(&mut cpu, 0);
    finish(&mut cpu);
    pend(&mut cpu, 1);
    pend(&mut cpu, 2);
    cpu.skip();
    assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 0x12, .. }), "the third, but only after the first");
    assert_eq!(super::STACK - cpu.register(13), 32);
    pend(&mut cpu, 3);
    cpu.skip();
    finish(&mut cpu);
    assert_eq!(super::STACK - cpu.register(13), 64, "another group preempts");
}

#[test]
fn a_mask_holds_back_what_is_not_urgent_enough() {
    let mut cpu = with_priorities([0x40, 0x30, 0, 0]);
    cpu.set_special_register(17, 2, 0x40).expect("BASEPRI");
    pend(&mut cpu, 0);
    pend(&mut cpu, 1);
    assert_eq!(order(&mut cpu), [1]);
    let mut cpu = with_priorities([0x40, 0, 0, 0]);
    cpu.set_special_register(17, 2, 0x40).expect("BASEPRI");
    // BASEPRI_MAX only makes it stricter.
    cpu.set_special_register(18, 2, 0x80).expect("BASEPRI_MAX");
    assert_eq!(cpu.special_register(17), Ok(0x40));
    cpu.set_special_register(18, 2, 0x20).expect("BASEPRI_MAX");
    assert_eq!(cpu.special_register(17), Ok(0x20));
    cpu.set_special_register(17, 2, 0).expect("BASEPRI");
    pend(&mut cpu, 0);
    assert_eq!(order(&mut cpu), [0]);
}

#[test]
fn nothing_masks_the_non_maskable_interrupt() {
    let mut cpu = with_priorities([0, 0, 0, 0]);
    cpu.set_special_register(16, 2, 1).expect("PRIMASK");
    cpu.set_special_register(19, 2, 1).expect("FAULTMASK");
    place(&mut cpu, handler(2), &[0xbe02, 0x4770]);
    pend(&mut cpu, 0);
    cpu.bus.signals.nmi = true;
    cpu.read_signals();
    assert_eq!(order(&mut cpu), [2], "once, although its line stays");
    assert_eq!(cpu.special_register(19), Ok(1), "only other handlers clear it");
}

#[test]
fn a_line_that_stays_high_comes_again_and_one_that_falls_does_not() {
    let mut cpu = with_priorities([0x10, 0, 0, 0]);
    cpu.bus.signals.lines[0] = 1;
    cpu.read_signals();
    let mut seen = 0;
    while let End::Breakpoint { number: 0x10, .. } = finish(&mut cpu) {
        seen += 1;
        if seen == 3 {
            cpu.bus.signals.lines[0] = 0;
            cpu.read_signals();
        }
        cpu.skip();
    }
    assert_eq!(seen, 3);
}

#[test]
fn a_line_stays_pending_until_its_interrupt_is_enabled() {
    let mut cpu = machine(&[0xbf00]);
    place(&mut cpu, handler(16 + 40), &[0xbe28, 0x4770]);
    cpu.bus.signals.lines[1] = 1 << 8;
    cpu.read_signals();
    cpu.bus.signals.lines[1] = 0;
    cpu.read_signals();
    assert_eq!(read(&mut cpu, 0xe000_e204), 1 << 8);
    complete(&mut cpu);
    cpu.set_register(15, super::START);
    enable(&mut cpu, 40, 0);
    assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 0x28, .. }));
}

#[test]
fn clearing_a_pending_bit_does_not_help_against_a_line_that_is_high() {
    let mut cpu = machine(&[0xbf00]);
    cpu.bus.signals.lines[0] = 1;
    cpu.read_signals();
    super::write(&mut cpu, 0xe000_e280, 1);
    assert_eq!(read(&mut cpu, 0xe000_e200), 1);
    cpu.bus.signals.lines[0] = 0;
    cpu.read_signals();
    super::write(&mut cpu, 0xe000_e280, 1);
    assert_eq!(read(&mut cpu, 0xe000_e200), 0);
}
