//! The stack of the B-G431B-ESC1's program suffices: the deepest path of calls in thread mode and every interrupt's on
//! top of it, all at their deepest at once, are within the region that the linker leaves for it.
//!
//! By the frames of the linked functions ([`crate::thumb::stack`]). Of the priorities, each has one interrupt at a time
//! on the stack; the entries are those of the vector table, at the priorities that the program gives them. While the
//! program starts, only time and the torn words of the flash interrupt it; the others are enabled one after another
//! when what is deep has returned. What is called by way of a table of functions is said below.

use crate::thumb::Program;
use crate::thumb::stack::{Depth, Stack};
use host_tests::bare_metal;
use libtest_mimic::{Failed, Trial};

/// Bytes that an exception pushes before its first instruction: 8 core registers, 18 of the floating-point unit's, and
/// a word to align them (ARM DDI 0403, B1.5.6).
const EXCEPTION: u32 = 108;

/// The program whose chip has no byte more.
const BOARD: &str = "b-g431b-esc1";
/// Its interrupts by priority, from the highest on: of each one is on the stack. The interrupt executor is below all of
/// these.
const INTERRUPTS: [&[&str]; 4] =
    [&["NonMaskableInt"], &["ADC1_2", "TIM1_UP_TIM16"], &["FDCAN1_IT0"], &["TIM1_BRK_TIM15"]];
/// Interrupts of a program that is still starting.
const QUIET: [&str; 2] = ["NonMaskableInt", "TIM1_BRK_TIM15"];

/// Functions that call by way of a table or of a parameter, and what they may call: both by parts of their names.
const CALLS: [(&str, &[&str]); 9] = [
    // Tasks: looked at by themselves.
    ("16embassy_executor3raw8Executor4poll", &[]),
    // The executor's wakers are the only ones.
    ("8physical14slopes_between", &["physical10tanh_slope", "14stribeck_slope"]),
    ("_embassy_time_schedule_wake", &["16embassy_executor3raw5waker"]),
    ("24embassy_time_queue_utils5Queue15next_expiration", &["16embassy_executor3raw5waker"]),
    ("17WakerRegistration4wake", &["16embassy_executor3raw5waker"]),
    ("16embassy_executor3raw20TaskStorage", &["16embassy_executor3raw5waker"]),
    // The controller's clock and interrupts.
    ("24adjust_reference_counter", &["9typelevel9Interrupt4pend"]),
    ("6pieces6Pieces4walk", &["6Pieces13verify_golden28_", "3ops8function5FnMut8call_mut"]),
    ("13PreparedTerms3new28_", &["3ops8function6FnOnce9call_once"]),
];

pub fn trials() -> Vec<Trial> {
    vec![
        Trial::test("a_call_that_nobody_knows_of_is_found_out", finds_unknown_calls),
        Trial::test("the_stack_of_b_g431b_esc1_suffices", suffices),
    ]
}

fn program() -> Result<Program, Failed> {
    Ok(Program::parse(&std::fs::read(bare_metal::build(BOARD, env!("CARGO_TARGET_TMPDIR"))?)?)?)
}

fn suffices() -> Result<(), Failed> {
    let program = program()?;
    let calls = |name: &str| {
        let (_, targets) = CALLS.iter().find(|(caller, _)| name.contains(caller))?;
        Some(program.named(|name| targets.iter().any(|target| name.contains(target))))
    };
    let mut stack = Stack::new(&program, &calls);
    let region = program.symbol("_stack_start").zip(program.symbol("_stack_end")).map(|(start, end)| start - end);
    let region = region.ok_or("no stack")?;

    let start = stack.of("main");
    // Both executors run tasks by the same function; the medium one's feed the watchdog, or keep the winding cool.
    let polls = program.named(|name| name.contains("16embassy_executor3raw20TaskStorage") && name.contains("4poll"));
    let tasks: Vec<Depth> = polls.iter().map(|poll| stack.of(poll)).collect();
    let serves = |depth: &&Depth| depth.path.iter().any(|(name, _)| name.contains("12canopen_node"));
    let executor = stack.of_containing("16embassy_executor3raw8Executor4poll");
    let entry = start.bytes_down_to("embassy_executor");
    let slowest = tasks.iter().max_by_key(|task| task.bytes).cloned().unwrap_or_default();
    let medium = tasks.iter().filter(|task| !serves(task)).max_by_key(|task| task.bytes).cloned().unwrap_or_default();
    let serving = entry + executor.bytes + slowest.bytes;
    let enabling = start.bytes_down_to("5tasks5start") + stack.of_containing("5board7control5start").bytes;
    println!("{BOARD}: start {}, serving {serving}, medium executor {}", start.bytes, medium.bytes);

    let (mut quiet, mut busy) = (0, EXCEPTION + stack.of("CRS").bytes + medium.bytes);
    for priority in INTERRUPTS {
        let deepest = priority.iter().map(|handler| stack.of(handler).bytes).max().unwrap_or_default();
        println!("  {}: {deepest}", priority.join(", "));
        busy += EXCEPTION + deepest;
        if QUIET.iter().any(|handler| priority.contains(handler)) {
            quiet += EXCEPTION + deepest;
        }
    }
    let all = (start.bytes + quiet).max(serving.max(enabling) + busy);
    println!("  {all} of {region} B");
    match (stack.unclear.as_slice(), all <= region) {
        ([], true) => Ok(()),
        ([], false) => {
            let path: String = slowest.path.iter().map(|(name, frame)| format!("{frame:6} {name}\n")).collect();
            Err(format!("{all} of {region} B; the deepest task:\n{path}").into())
        }
        (unclear, _) => Err(unclear.join("\n").into()),
    }
}

/// The tables above are worth something only if a call that is not in them is found out.
fn finds_unknown_calls() -> Result<(), Failed> {
    let program = program()?;
    let mut stack = Stack::new(&program, &|_| None);
    let depth = stack.of("main");
    match depth.bytes > 0 && stack.unclear.iter().any(|unclear| unclear.contains("calls through a register")) {
        true => Ok(()),
        false => Err(stack.unclear.join("\n").into()),
    }
}
