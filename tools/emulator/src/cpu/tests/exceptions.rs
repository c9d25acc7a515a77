//! Entry and return, tail-chaining, late arrival, sleep, and the frame with floating-point registers.

use super::{
    FPCCR, ICSR, SCR, STACK, complete, enable, finish, halves, handler, machine, pend, place, read,
    with_floating_point, write,
};
use crate::cpu::{End, Watch};

const SYSTICK: u32 = 0xe000_e010;
const PEND_SYSTICK: u32 = 1 << 26;
const PEND_SERVICE: u32 = 1 << 28;

#[test]
fn a_handler_finds_the_frame_and_what_was_interrupted_goes_on() {
    let mut cpu = machine(&[0x2001, 0x2002]);
    enable(&mut cpu, 3, 0x80);
    (0..13).for_each(|n| cpu.set_register(n, 100 + n as u32));
    cpu.set_register(14, 114);
    cpu.set_xpsr(0xa000_0000 | 1 << 24);
    pend(&mut cpu, 3);
    // The handler: a breakpoint, then bx lr.
    place(&mut cpu, handler(19), &[0xbe55, 0x4770]);
    let before = cpu.now();
    assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 0x55, .. }));
    assert_eq!(cpu.now() - before, 12 + 1, "entry, and the breakpoint");
    assert_eq!((cpu.exception(), cpu.register(13), cpu.register(14)), (19, STACK - 32, 0xffff_fff9));
    let frame: Vec<u32> = (0..8).map(|i| read(&mut cpu, STACK - 32 + 4 * i)).collect();
    assert_eq!(frame, [100, 101, 102, 103, 112, 114, super::START, 0xa100_0000]);
    assert_eq!(read(&mut cpu, ICSR) & 0x9ff, 19 | 1 << 11, "alone");
    cpu.set_register(0, 0);
    cpu.set_xpsr(1 << 24);
    cpu.skip();
    complete(&mut cpu);
    assert_eq!((cpu.register(0), cpu.register(12), cpu.register(13), cpu.exception()), (2, 112, STACK, 0));
    assert_eq!(cpu.xpsr() & 0xf000_0000, 0x2000_0000, "the flags are back; movs has cleared negative");
}

#[test]
fn a_frame_is_aligned_to_eight_bytes_and_remembers_it() {
    let mut cpu = machine(&[0xbf00]);
    enable(&mut cpu, 0, 0);
    cpu.set_register(13, STACK - 4);
    pend(&mut cpu, 0);
    place(&mut cpu, handler(16), &[0xbe55, 0x4770]);
    finish(&mut cpu);
    assert_eq!(cpu.register(13), STACK - 40);
    assert_eq!(read(&mut cpu, STACK - 40 + 28) >> 9 & 1, 1);
    cpu.skip();
    complete(&mut cpu);
    assert_eq!(cpu.register(13), STACK - 4);
}

#[test]
fn the_next_handler_follows_without_unstacking() {
    let run = |interrupts: u32| {
        let mut cpu = machine(&[0xbf00]);
        (0..interrupts).for_each(|n| enable(&mut cpu, n, 0x40));
        (0..interrupts).for_each(|n| pend(&mut cpu, n));
        complete(&mut cpu);
        (cpu.now(), cpu.exception_times().clone())
    };
    let ((none, _), (one, _), (two, times)) = (run(0), run(1), run(2));
    // 12 in, bx lr, 10 out; each further one bx lr and 6.
    assert_eq!((one - none, two - one), (12 + 1 + 10, 6 + 1));
    assert_eq!((times[&16].count, times[&17].count, times[&17].cycles), (1, 1, 6 + 1 + 10));
}

#[test]
fn a_more_urgent_request_during_stacking_is_taken_first() {
    // SysTick expires while the frame for interrupt 0 is written.
    let mut cpu = machine(&[0xbf00]);
    enable(&mut cpu, 0, 0x80);
    place(&mut cpu, handler(15), &[0xbe0f, 0x4770]);
    place(&mut cpu, handler(16), &[0xbe10, 0x4770]);
    write(&mut cpu, SYSTICK + 4, 5);
    write(&mut cpu, SYSTICK, 7);
    pend(&mut cpu, 0);
    assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 0x0f, .. }), "SysTick first");
    assert_eq!((cpu.now(), cpu.register(13)), (12 + 1, STACK - 32), "one entry, one frame");
    write(&mut cpu, SYSTICK, 0);
    write(&mut cpu, ICSR, 1 << 25);
    cpu.skip();
    assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 0x10, .. }), "then the other");
    assert_eq!(cpu.register(13), STACK - 32);
}

#[test]
fn a_supervisor_call_returns_behind_itself_and_a_pending_service_waits() {
    // svc #7; movs r0, #1
    let mut cpu = machine(&[0xdf07, 0x2001]);
    place(&mut cpu, handler(11), &[0xbe0b, 0x4770]);
    assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 0x0b, .. }));
    let sp = cpu.register(13);
    assert_eq!(read(&mut cpu, sp + 24), super::START + 2);
    // PendSV is as urgent as the call: it waits for its return.
    write(&mut cpu, ICSR, PEND_SERVICE);
    place(&mut cpu, handler(14), &[0xbe0e, 0x4770]);
    cpu.skip();
    assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 0x0e, .. }));
    assert_eq!(cpu.register(0), 0);
    cpu.skip();
    complete(&mut cpu);
    assert_eq!(cpu.register(0), 1);
}

#[test]
fn thread_mode_may_use_the_process_stack() {
    // msr psp, r0; movs r1, #2; msr control, r1; push {r2}; nop
    let mut code = halves(0xf380_8809).to_vec();
    code.push(0x2102);
    code.extend(halves(0xf381_8814));
    code.extend([0xb404, 0xbf00]);
    let mut cpu = machine(&code);
    let process = 0x2000_4000;
    cpu.set_register(0, process);
    place(&mut cpu, handler(14), &[0xbe0e, 0x4770]);
    complete(&mut cpu);
    assert_eq!(cpu.register(13), process - 4);
    write(&mut cpu, ICSR, PEND_SERVICE);
    assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 0x0e, .. }));
    assert_eq!((cpu.register(14), cpu.register(13)), (0xffff_fffd, STACK));
    cpu.skip();
    complete(&mut cpu);
    assert_eq!(cpu.register(13), process - 4);
}

#[test]
fn sleep_jumps_to_the_next_event() {
    // wfi; movs r0, #1
    let mut cpu = machine(&[0xbf30, 0x2001]);
    write(&mut cpu, SYSTICK + 4, 9_999);
    write(&mut cpu, SYSTICK, 7);
    place(&mut cpu, handler(15), &[0xbe0f, 0x4770]);
    assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 0x0f, .. }));
    assert_eq!((cpu.now(), cpu.slept(), cpu.instructions()), (10_000 + 12 + 1, 9_999, 2));
    cpu.skip();
    complete(&mut cpu);
    assert_eq!(cpu.register(0), 1);
}

#[test]
fn a_masked_interrupt_wakes_and_is_taken_when_the_mask_goes() {
    // cpsid i; wfi; movs r0, #1; cpsie i; movs r0, #2
    let mut cpu = machine(&[0xb672, 0xbf30, 0x2001, 0xb662, 0x2002]);
    enable(&mut cpu, 5, 0);
    pend(&mut cpu, 5);
    place(&mut cpu, handler(21), &[0xbe15, 0x4770]);
    cpu.interrupts.primask = true;
    cpu.interrupts.update();
    assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 0x15, .. }));
    assert_eq!(cpu.register(0), 1);
}

#[test]
fn an_event_is_kept_until_somebody_waits_for_it() {
    // sev; wfe; movs r0, #1; wfe
    let mut cpu = machine(&[0xbf40, 0xbf20, 0x2001, 0xbf20]);
    assert_eq!(cpu.run(u64::MAX), End::Asleep);
    assert_eq!((cpu.register(0), cpu.instructions()), (1, 4));
    // A pending interrupt is an event only if SCR says so, even where it is masked.
    let mut cpu = machine(&[0xb672, 0xbf20, 0x2001]);
    write(&mut cpu, SCR, 1 << 4);
    enable(&mut cpu, 0, 0);
    assert_eq!(cpu.run(u64::MAX), End::Asleep);
    cpu.bus.signals.lines[0] = 1;
    cpu.read_signals();
    complete(&mut cpu);
    assert_eq!(cpu.register(0), 1);
}

#[test]
fn nothing_wakes_a_core_without_interrupts() {
    let mut cpu = machine(&[0xbf30]);
    assert_eq!(cpu.run(u64::MAX), End::Asleep);
    assert_eq!(cpu.run(1_000), End::Time);
    assert_eq!((cpu.now(), cpu.slept()), (1_000, 999));
}

/// Uses s0, then takes PendSV, whose handler is this.
fn floating_point_in_both(lazy: bool, code: &[u16]) -> crate::cpu::Cpu<crate::memory::Memory> {
    // vmov.f32 s0, #1.0; str r1, [r0]: pends; nop; nop
    let mut main = halves(0xeeb7_0a00).to_vec();
    main.extend([0x6001, 0xbf00, 0xbf00]);
    let mut cpu = with_floating_point(machine(&main));
    write(&mut cpu, FPCCR, if lazy { 3 << 30 } else { 2 << 30 });
    cpu.set_register(0, ICSR);
    cpu.set_register(1, PEND_SERVICE);
    place(&mut cpu, handler(14), code);
    cpu
}

#[test]
fn floating_point_registers_survive_a_handler_that_uses_them() {
    for lazy in [false, true] {
        let mut code = halves(0xeeb0_0a08).to_vec(); // vmov.f32 s0, #3.0
        code.extend([0xbe0e, 0x4770]);
        let mut cpu = floating_point_in_both(lazy, &code);
        assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 0x0e, .. }));
        assert_eq!((cpu.register(14), cpu.register(13)), (0xffff_ffe9, STACK - 0x68));
        assert_eq!(read(&mut cpu, STACK - 0x48), 0x3f80_0000, "stored, at the latest by the handler's first use");
        assert_eq!(cpu.float_register(0), 0x4040_0000);
        cpu.skip();
        complete(&mut cpu);
        assert_eq!((cpu.float_register(0), cpu.register(13)), (0x3f80_0000, STACK));
    }
}

#[test]
fn lazy_stacking_stores_nothing_for_a_handler_without_floating_point() {
    let cycles = |lazy| {
        let mut cpu = floating_point_in_both(lazy, &[0xbe0e, 0x4770]);
        finish(&mut cpu);
        let stored = read(&mut cpu, STACK - 0x48);
        assert_eq!(read(&mut cpu, FPCCR) & 1, u32::from(lazy));
        cpu.skip();
        complete(&mut cpu);
        assert_eq!(cpu.float_register(0), 0x3f80_0000);
        assert_eq!(read(&mut cpu, FPCCR) & 1, 0);
        (cpu.now(), stored)
    };
    let ((eager, stored), (lazy, deferred)) = (cycles(false), cycles(true));
    assert_eq!((stored, deferred), (0x3f80_0000, 0));
    assert_eq!(eager - lazy, 17 + 17, "neither stored nor loaded");
}

#[test]
fn nested_floating_point_contexts_are_stored_in_order() {
    // PendSV's handler uses s0 and pends SysTick, which is more urgent and uses s0 as well.
    let mut code = halves(0xeeb0_0a08).to_vec(); // vmov.f32 s0, #3.0
    code.extend([0x6002, 0xbf00, 0x4770]); // str r2, [r0]
    let mut cpu = floating_point_in_both(true, &code);
    cpu.set_register(2, PEND_SYSTICK);
    cpu.store::<1>(0xe000_ed22, 0xf0).expect("priority of PendSV");
    let mut inner = halves(0xeeb1_0a00).to_vec(); // vmov.f32 s0, #4.0
    inner.extend([0xbe0f, 0x4770]);
    place(&mut cpu, handler(15), &inner);
    assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 0x0f, .. }));
    assert_eq!((cpu.register(14), cpu.register(13)), (0xffff_ffe1, STACK - 2 * 0x68));
    cpu.skip();
    complete(&mut cpu);
    assert_eq!((cpu.float_register(0), cpu.register(13)), (0x3f80_0000, STACK));
}

#[test]
fn times_of_a_handler_do_not_count_what_preempted_it() {
    // Interrupt 1 pends interrupt 0, which is more urgent: nop; nop; bx lr.
    let mut cpu = machine(&[0xbf00]);
    enable(&mut cpu, 0, 0x10);
    enable(&mut cpu, 1, 0x20);
    place(&mut cpu, handler(17), &[0x6001, 0xbf00, 0x4770]);
    place(&mut cpu, handler(16), &[0xbf00, 0xbf00, 0x4770]);
    cpu.set_register(0, 0xe000_e200);
    cpu.set_register(1, 1);
    pend(&mut cpu, 1);
    cpu.set_watch(Some(Watch::new().function(handler(17))));
    complete(&mut cpu);
    let (inner, outer) = (cpu.exception_times()[&16], cpu.exception_times()[&17]);
    assert_eq!((inner.own_cycles, inner.instructions), (12 + 3 + 10, 3));
    assert_eq!((outer.own_cycles, outer.cycles), (12 + 3 + 10, 2 * (12 + 3 + 10)));
    assert_eq!((outer.instructions, outer.most_instructions), (6, 3));
    let calls = cpu.watch_mut().map(Watch::take_calls).unwrap_or_default();
    assert_eq!(
        calls.iter().map(|call| (call.exception, call.instructions, call.cycles)).collect::<Vec<_>>(),
        [(17, 3, 3 + 10)]
    );
}
