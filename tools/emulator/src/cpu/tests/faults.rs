//! Faults: their status, their escalation, and what no handler can take.

use super::{
    AIRCR, BFAR, CCR, CFSR, CPACR, HFSR, SHCSR, STACK, START, finish, halves, handler, machine, place, read, write,
};
use crate::cpu::{Cpu, End, Lockup, Origin};
use crate::memory::Memory;

const HARD: u16 = 3;
const BUS: u16 = 5;
const USAGE: u16 = 6;
const FORCED: u32 = 1 << 30;

/// A core at this code, with breakpoints of their number in the fault handlers.
fn faulting(code: &[u16]) -> Cpu<Memory> {
    let mut cpu = machine(code);
    (3..7).for_each(|number| place(&mut cpu, handler(number), &[0xbe00 | number, 0x4770]));
    cpu
}

/// Runs into the handler of `expected`; the address that was stacked.
fn faults(cpu: &mut Cpu<Memory>, expected: u16) -> u32 {
    let end = finish(cpu);
    assert!(matches!(end, End::Breakpoint { number, .. } if u16::from(number) == expected), "{end}");
    let stack = cpu.register(13);
    read(cpu, stack + 24)
}

#[test]
fn an_undefined_instruction_is_a_usage_fault_or_a_hard_fault() {
    let mut cpu = faulting(&[0xbf00, 0xdefe]);
    assert_eq!(faults(&mut cpu, HARD), START + 2, "the instruction itself");
    assert_eq!((read(&mut cpu, CFSR), read(&mut cpu, HFSR)), (1 << 16, FORCED));
    let mut cpu = faulting(&[0xbf00, 0xdefe]);
    write(&mut cpu, SHCSR, 1 << 18);
    assert_eq!(faults(&mut cpu, USAGE), START + 2);
    assert_eq!((read(&mut cpu, CFSR), read(&mut cpu, HFSR)), (1 << 16, 0));
    // Status bits are cleared by writing them.
    write(&mut cpu, CFSR, 1 << 16);
    assert_eq!(read(&mut cpu, CFSR), 0);
}

#[test]
fn a_load_from_nowhere_is_a_precise_bus_fault() {
    // ldr r1, [r0]
    let mut cpu = faulting(&[0x6801]);
    cpu.set_register(0, 0x6000_0000);
    cpu.set_register(1, 77);
    write(&mut cpu, SHCSR, 1 << 17);
    assert_eq!(faults(&mut cpu, BUS), START);
    assert_eq!((read(&mut cpu, CFSR), read(&mut cpu, BFAR)), (1 << 9 | 1 << 15, 0x6000_0000));
    assert_eq!(cpu.register(1), 77, "nothing was loaded");
}

#[test]
fn a_division_by_zero_faults_only_if_asked() {
    // sdiv r0, r1, r2
    let code = halves(0xfb91_f0f2);
    let mut cpu = faulting(&code);
    super::complete(&mut cpu);
    let mut cpu = faulting(&code);
    write(&mut cpu, CCR, 0x210);
    assert_eq!(faults(&mut cpu, HARD), START);
    assert_eq!(read(&mut cpu, CFSR), 1 << 25);
}

#[test]
fn the_floating_point_unit_has_to_be_switched_on() {
    // vadd.f32 s0, s1, s2
    let mut cpu = faulting(&halves(0xee30_0a81));
    assert_eq!(faults(&mut cpu, HARD), START);
    assert_eq!(read(&mut cpu, CFSR), 1 << 19);
    let mut cpu = faulting(&halves(0xee30_0a81));
    write(&mut cpu, CPACR, 5 << 20);
    super::complete(&mut cpu);
}

#[test]
fn a_branch_to_an_even_address_leaves_thumb_state() {
    // bx r0
    let mut cpu = faulting(&[0x4700]);
    cpu.set_register(0, START + 0x40);
    assert_eq!(faults(&mut cpu, HARD), START + 0x40, "the fault is that of the target");
    assert_eq!(read(&mut cpu, CFSR), 1 << 17);
    let stack = cpu.register(13);
    assert_eq!(read(&mut cpu, stack + 28) >> 24 & 1, 0, "as the frame says");
}

#[test]
fn code_where_nothing_answers_and_where_there_must_be_none() {
    for (target, status) in [(0x3000_0001, 1 << 8), (0x4000_0001, 1), (0xe000_0001, 1)] {
        let mut cpu = faulting(&[0x4700]);
        cpu.set_register(0, target);
        assert_eq!(faults(&mut cpu, HARD), target & !1);
        assert_eq!(read(&mut cpu, CFSR), status, "{target:#x}");
    }
}

#[test]
fn a_fault_in_the_fault_handler_locks_up() {
    let mut cpu = faulting(&[0xdefe]);
    place(&mut cpu, handler(HARD), &[0xdefe]);
    assert_eq!(
        finish(&mut cpu),
        End::Lockup(Lockup {
            address: handler(HARD),
            exception: HARD,
            faults: 1 << 16,
            hard_fault: FORCED,
            bus_fault_address: 0
        })
    );
}

#[test]
fn a_supervisor_call_that_cannot_be_taken_becomes_a_hard_fault() {
    // cpsid i; svc #0
    let mut cpu = faulting(&[0xb672, 0xdf00]);
    assert_eq!(faults(&mut cpu, HARD), START + 4);
    assert_eq!(read(&mut cpu, HFSR), FORCED);
}

#[test]
fn a_stack_that_leaves_the_memory_is_a_hard_fault_and_then_the_end() {
    // push {r0} at the bottom of the memory
    let mut cpu = faulting(&[0xb401]);
    cpu.set_register(13, 0x2000_0000);
    let end = finish(&mut cpu);
    // The frame cannot be written either, but the handler begins; its registers are wherever they were.
    assert!(matches!(end, End::Breakpoint { number: 3, .. }), "{end}");
    let (faults, hard) = cpu.fault_status();
    assert_eq!((faults & (1 << 9 | 1 << 12), hard), (1 << 9 | 1 << 12, FORCED));
}

#[test]
fn a_return_that_does_not_hold_together_is_a_usage_fault() {
    // PendSV's handler returns with an address that does not exist.
    let mut cpu = faulting(&[0xbf00]);
    place(&mut cpu, handler(14), &[0x4700]);
    cpu.set_register(0, 0xffff_fff5);
    write(&mut cpu, SHCSR, 1 << 18);
    write(&mut cpu, super::ICSR, 1 << 28);
    let end = finish(&mut cpu);
    assert!(matches!(end, End::Breakpoint { number: 6, .. }), "{end}");
    assert_eq!((read(&mut cpu, CFSR), cpu.register(13)), (1 << 18, STACK - 32));
}

#[test]
fn the_program_can_ask_for_a_reset() {
    // str r1, [r0]
    let mut cpu = faulting(&[0x6001, 0x2005]);
    cpu.set_register(0, AIRCR);
    cpu.set_register(1, 0x05fa_0004);
    assert_eq!(finish(&mut cpu), End::Reset(Origin::Program));
    cpu.reset(super::VECTORS).expect("vectors");
    assert_eq!((cpu.register(15), cpu.register(13), cpu.register(0)), (START, STACK, 0));
    // Without the key nothing happens.
    cpu.set_register(0, AIRCR);
    cpu.set_register(1, 4);
    super::complete(&mut cpu);
}

#[test]
fn registers_that_are_not_modelled_end_the_run_by_name() {
    for (address, name) in [(0xe000_0000u32, "ITM"), (0xe000_edf4, "debug control"), (0xe000_ed98, "MPU")] {
        let mut cpu = faulting(&[0x6801]);
        cpu.set_register(0, address);
        let end = finish(&mut cpu);
        assert!(matches!(&end, End::Unmodelled { address: START, what } if what.contains(name)), "{end}");
    }
}
