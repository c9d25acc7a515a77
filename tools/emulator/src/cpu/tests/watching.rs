//! Observations of test equipment: calls, stops, the stack's depth; and that watching changes nothing.

use super::{STACK, START, complete, finish, machine};
use crate::cpu::{Call, End, Watch};

/// bl to a function twice: push {r4, lr}; nop; pop {r4, pc}. It begins at the sixth half-word.
const CALLS: [u16; 10] = [0xf000, 0xf804, 0xf000, 0xf802, 0xe003, 0xbf00, 0xb510, 0xbf00, 0xbd10, 0xbf00];
const FUNCTION: u32 = START + 12;

#[test]
fn each_call_is_seen_with_what_it_took() {
    let mut cpu = machine(&CALLS);
    cpu.set_watch(Some(Watch::new().function(FUNCTION | 1)));
    complete(&mut cpu);
    let watch = cpu.watch_mut().expect("a watch");
    // push 3, nop 1, pop 3 and the branch's 2.
    let call = |entered| Call { function: FUNCTION, exception: 0, entered, cycles: 9, instructions: 3 };
    assert_eq!(watch.take_calls(), [call(3), call(3 + 9 + 3)]);
    assert_eq!(watch.take_calls(), []);
    assert_eq!(watch.lowest_main_stack(), Some(STACK - 8));
    assert_eq!(watch.lowest_process_stack(), None);
}

#[test]
fn watching_changes_neither_cycles_nor_instructions() {
    let mut plain = machine(&CALLS);
    complete(&mut plain);
    let mut watched = machine(&CALLS);
    watched.set_watch(Some(Watch::new().function(FUNCTION)));
    complete(&mut watched);
    assert_eq!((plain.now(), plain.instructions()), (watched.now(), watched.instructions()));
}

#[test]
fn a_stop_ends_the_run_each_time_before_the_instruction() {
    let mut cpu = machine(&CALLS);
    cpu.set_watch(Some(Watch::new().stop_at(FUNCTION)));
    for time in 0..2 {
        assert_eq!(finish(&mut cpu), End::Reached { address: FUNCTION });
        assert_eq!((cpu.register(15), cpu.register(13)), (FUNCTION, STACK), "{time}");
    }
    complete(&mut cpu);
}

#[test]
fn steps_are_the_instructions_of_a_run() {
    let mut stepped = machine(&CALLS);
    let mut ends = 0;
    while ends == 0 {
        ends += usize::from(stepped.step().is_some());
    }
    let mut run = machine(&CALLS);
    complete(&mut run);
    assert_eq!((stepped.now(), stepped.instructions()), (run.now(), run.instructions()));
}

#[test]
fn a_run_ends_at_its_cycle_and_goes_on_from_there() {
    let mut cpu = machine(&CALLS);
    assert_eq!(cpu.run(4), End::Time);
    // bl takes 3 cycles, push 3: the instruction that reaches the cycle completes.
    assert_eq!((cpu.now(), cpu.register(15)), (6, FUNCTION + 2));
    complete(&mut cpu);
}
