//! Loads, stores, blocks, exclusive accesses, branches by table.

use super::{CCR, CFSR, DATA, complete, finish, halves, handler, machine, place, read, write};
use crate::cpu::End;

#[test]
fn loads_extend_and_stores_cut() {
    let mut cpu = machine(&[
        // ldrsb r1, [r0, r7]; ldrsh r2, [r0, r7]; ldrb r3, [r0, #0]; ldrh r4, [r0, #0]; strb r5, [r0, #4]; strh r5,
        // [r0, #8]
        0x57c1, 0x5fc2, 0x7803, 0x8804, 0x7105, 0x8105,
    ]);
    cpu.set_register(0, DATA);
    cpu.set_register(5, 0x1234_5678);
    write(&mut cpu, DATA, 0x0000_f081);
    complete(&mut cpu);
    assert_eq!([1, 2, 3, 4].map(|n| cpu.register(n)), [0xffff_ff81, 0xffff_f081, 0x81, 0xf081]);
    assert_eq!((read(&mut cpu, DATA + 4), read(&mut cpu, DATA + 8)), (0x78, 0x5678));
}

#[test]
fn the_base_changes_before_or_after() {
    let mut code = halves(0xf850_1b04).to_vec(); // ldr r1, [r0], #4
    code.extend(halves(0xf850_2f04)); // ldr r2, [r0, #4]!
    code.extend(halves(0xf840_1d08)); // str r1, [r0, #-8]!
    code.extend(halves(0xe9f0_3402)); // ldrd r3, r4, [r0, #8]!
    let mut cpu = machine(&code);
    cpu.set_register(0, DATA);
    (0..5).for_each(|i| write(&mut cpu, DATA + 4 * i, 100 + i));
    complete(&mut cpu);
    assert_eq!([1, 2, 3, 4].map(|n| cpu.register(n)), [100, 102, 102, 103]);
    assert_eq!(cpu.register(0), DATA + 8);
}

#[test]
fn blocks_come_in_the_order_of_their_registers() {
    // push {r0-r2, lr}; then pop {r3-r6}
    let mut cpu = machine(&[0xb507, 0xbc78]);
    for (n, value) in [(0, 10), (1, 11), (2, 12), (14, 0x99)] {
        cpu.set_register(n, value);
    }
    complete(&mut cpu);
    assert_eq!([3, 4, 5, 6].map(|n| cpu.register(n)), [10, 11, 12, 0x99]);
    assert_eq!(cpu.register(13), super::STACK);
    assert_eq!(cpu.now(), 5 + 5 + 1, "one more than there are registers, each");
}

#[test]
fn a_block_that_loads_its_base_keeps_what_was_loaded() {
    // ldmia r0!, {r0, r1}: narrow, so that the base does not change by itself
    let mut cpu = machine(&[0xc803]);
    cpu.set_register(0, DATA);
    write(&mut cpu, DATA, 7);
    write(&mut cpu, DATA + 4, 8);
    complete(&mut cpu);
    assert_eq!((cpu.register(0), cpu.register(1)), (7, 8));
}

#[test]
fn an_unaligned_word_takes_a_cycle_more_and_blocks_must_be_aligned() {
    let cycles = |address: u32| {
        let mut cpu = machine(&[0x6801]);
        cpu.set_register(0, address);
        write(&mut cpu, DATA, 0x4433_2211);
        write(&mut cpu, DATA + 4, 0x8877_6655);
        complete(&mut cpu);
        (cpu.register(1), cpu.now())
    };
    assert_eq!((cycles(DATA), cycles(DATA + 1)), ((0x4433_2211, 3), (0x5544_3322, 4)));
    // ldmia r0, {r1, r2} at an odd address; ldr with the trap switched on
    for (code, trap) in [(halves(0xe890_0006).to_vec(), 0), (vec![0x6801], 1 << 3)] {
        let mut cpu = machine(&code);
        place(&mut cpu, handler(3), &[0xbe03]);
        cpu.set_register(0, DATA + 1);
        write(&mut cpu, CCR, 0x200 | trap);
        assert!(matches!(finish(&mut cpu), End::Breakpoint { number: 3, .. }));
        assert_eq!(read(&mut cpu, CFSR), 1 << 24);
    }
}

#[test]
fn an_exclusive_store_needs_its_load_and_nothing_between() {
    let mut code = halves(0xe850_1f00).to_vec(); // ldrex r1, [r0]
    code.extend(halves(0xe840_2300)); // strex r3, r2, [r0]
    code.extend(halves(0xe840_2400)); // strex r4, r2, [r0]
    let mut cpu = machine(&code);
    cpu.set_register(0, DATA);
    cpu.set_register(2, 55);
    complete(&mut cpu);
    assert_eq!((cpu.register(3), cpu.register(4), read(&mut cpu, DATA)), (0, 1, 55));
    // clrex between
    let mut code = halves(0xe850_1f00).to_vec();
    code.extend(halves(0xf3bf_8f2f));
    code.extend(halves(0xe840_2300));
    let mut cpu = machine(&code);
    cpu.set_register(0, DATA);
    cpu.set_register(2, 55);
    complete(&mut cpu);
    assert_eq!((cpu.register(3), read(&mut cpu, DATA)), (1, 0));
}

#[test]
fn a_table_branches_by_its_entries() {
    // tbb [pc, r0]; bytes 2, 3; movs r1, #1 (skipped by both), movs r2, #2; movs r3, #3
    let mut code = halves(0xe8df_f000).to_vec();
    code.extend([0x0302, 0x2101, 0x2202, 0x2303]);
    let registers = |entry: u32| {
        let mut cpu = machine(&code);
        cpu.set_register(0, entry);
        complete(&mut cpu);
        [1, 2, 3].map(|n| cpu.register(n))
    };
    assert_eq!((registers(0), registers(1)), ([0, 2, 3], [0, 0, 3]));
}

#[test]
fn calls_and_returns_keep_the_thumb_bit() {
    // bl to the third half-word behind; b over; there: mov r0, lr; bx lr
    let mut code = halves(0xf000_f801).to_vec();
    code.extend([0xe002, 0x4670, 0x4770, 0xbf00]);
    let mut cpu = machine(&code);
    complete(&mut cpu);
    assert_eq!(cpu.register(0), super::START + 5);
}

#[test]
fn a_load_behind_a_load_takes_one_cycle() {
    // ldr r1, [r0]; ldr r2, [r0]; str r1, [r0]; ldr r3, [r0]; nop; ldr r4, [r0]
    let mut cpu = machine(&[0x6801, 0x6802, 0x6001, 0x6803, 0xbf00, 0x6804]);
    cpu.set_register(0, DATA);
    complete(&mut cpu);
    assert_eq!(cpu.now(), 2 + 1 + 1 + 1 + 1 + 2 + 1);
}

#[test]
fn wait_states_count_for_branches_and_for_loads_from_there() {
    // ldr r1, [pc, #0]; b to the next; nop
    let cycles = |wait_states: u32| {
        let mut cpu = machine(&[0x4900, 0xe7ff, 0xbf00]);
        cpu.bus.wait_states = wait_states;
        cpu.read_signals();
        complete(&mut cpu);
        cpu.now()
    };
    assert_eq!(cycles(4) - cycles(0), 4 + 4);
}

#[test]
fn lines_of_code_cost_wait_states_in_sequence_where_nothing_prefetches() {
    let cycles = |code: &[u16], line: Option<u32>| {
        let mut cpu = machine(code);
        cpu.bus.wait_states = 4;
        cpu.bus.line = line;
        cpu.read_signals();
        complete(&mut cpu);
        cpu.now()
    };
    let extra = |code: &[u16]| cycles(code, Some(8)) - cycles(code, None);
    // The first fetch costs nothing: nothing has led there.
    assert_eq!(super::START % 8, 0);
    assert_eq!(extra(&[0xbf00; 3]), 0, "a line with what ends the run");
    assert_eq!(extra(&[0xbf00; 4]), 4, "what ends the run lies in the next line");
    assert_eq!(extra(&[0xbf00; 11]), 8, "three lines");
    // nop, nop, nop, movw r0, #0: half of it in the next line.
    assert_eq!(extra(&[0xbf00, 0xbf00, 0xbf00, 0xf240, 0x0000]), 4);
    // A branch over three half-words to the second line has waited for it.
    assert_eq!(extra(&[0xe002, 0xbf00, 0xbf00, 0xbf00, 0xbf00]), 0);
}

#[test]
fn code_that_changes_is_decoded_anew() {
    // strh r1, [r0]; b back to the first of two instructions that have run
    let mut cpu = machine(&[0x2001, 0xbf00]);
    complete(&mut cpu);
    place(&mut cpu, super::START, &[0x2002]);
    cpu.set_register(15, super::START);
    complete(&mut cpu);
    assert_eq!(cpu.register(0), 2);
    // By the program itself.
    let mut cpu = machine(&[0x2001, 0x8011, 0xbf00, 0x2003]);
    cpu.set_register(1, 0x2009);
    cpu.set_register(2, super::START + 6);
    complete(&mut cpu);
    assert_eq!(cpu.register(0), 9);
}
