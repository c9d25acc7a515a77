//! Writes docs/budget.md: what the control step and its parts take on the board's core, beside their targets; the same
//! network in other libraries; and what both boards' programs take of their memories.
//!
//! `cargo bench -p host-tests --bench budget > docs/budget.md`; needs the board's target.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4, Wired};
use emulator::chip::Waiting;
use emulator::cpu::{ExceptionTimes, Watch};
use emulator::emulation::Emulation;
use emulator::program::Program;
use emulator::variables::Variables;
use friction_compensation::friction::state::SIGNALS;
use host_tests::bare_core::{Core, Cost};
use host_tests::bare_metal::{BOARDS, Board, build};
use host_tests::control_steps::{friction, image_bytes, input, record};
use host_tests::counted_steps::{PARTS, Step, counted, spread};
use host_tests::emulated::bench::actuator;
use host_tests::emulated::motion::{AMPLITUDE, MOTION, Moving, acting_image};
use host_tests::emulated::observed::Observed;
use host_tests::emulated::taken::{CONTROL, taken};
use host_tests::peer_networks::{Exact, scaled};
use host_tests::states::within;
use joint_firmware::joint::configuration::MOTION_STEPS;
use libtest_mimic::Failed;
use object::read::elf::{FileHeader, ProgramHeader};
use plant::ActuatorParameters;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::collections::HashMap;
use std::error::Error;
use std::path::Path;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Folder in which the programs are built.
const TEMPORARY: &str = env!("CARGO_TARGET_TMPDIR");
/// Inputs that each network evaluates; as many as the program `networks` has room for.
const INPUTS: usize = 200;
/// Control interrupts of a board's program that are taken apart: more than come between two that do what a task asks
/// for.
const INTERRUPTS: usize = 1000;
/// Duration of the boards' programs, s.
const RUN: f64 = 1.2;

/// A row of the first table: its name, its parts, and the most instructions and cycles that it should take.
type Row = (&'static str, &'static [&'static str], Option<u64>, Option<u64>);

/// Friction and compensation, without the feedforward around them.
const FRICTION: &[&str] = &["network's inputs", "network", "physical model", "regimes", "compensation"];

const ROWS: [Row; 8] = [
    ("network, from its inputs in Q31", &["network"], Some(230), Some(NETWORK)),
    ("the network's inputs, clamped and scaled", &["network's inputs"], None, None),
    ("physical model", &["physical model"], None, None),
    ("compensation: regimes, fade, limits", &["regimes", "compensation"], None, None),
    ("all of this that is in one step", FRICTION, None, Some(600)),
    ("feedforward and energy guard", &["feedforward and guard"], None, None),
    ("observer", &["observer"], None, None),
    ("current control, with transforms and modulation", &["transforms", "current control", "modulation"], None, None),
];

/// Another way to evaluate the network: its name, the function that is counted, and the value of what it gives.
type Peer<'a> = (&'a str, &'a str, &'a dyn Fn(i32) -> f64);

/// Most cycles of a whole step, interrupt entry included: 30 % of a period of 20 kHz at 170 MHz.
const WHOLE: u64 = 2500;
/// Most cycles of the network from its inputs in Q31.
const NETWORK: u64 = 330;

fn main() -> Outcome<()> {
    println!("# Budget\n");
    println!(
        "Written by `cargo bench -p host-tests --bench budget`: emulation, no hardware. Instructions are exact; cycles are the published timings without \
         wait states,\nas they are where the control interrupt runs from (`tools/emulator/src/cpu/timing.rs`). Each board's code is compiled as its \
         program is.\nA part that takes more instructions than `.ci/instructions` permits fails the tests (`control_step.rs`, which says how to change that)."
    );
    let boards = [run::<BG431BEsc1>(&BOARDS[0], BG431BEsc1::new)?, run::<MoteusR4>(&BOARDS[1], MoteusR4::new)?];
    let mut missed = Vec::new();
    println!(
        "\n## The control step\n\nFive runs of 200 steps, recorded in closed loop with the virtual joint and replayed: off; the physical model; all of the \
         model; torque mode with energy\nguard; position mode. The model is a certified image with every term, a network in each of its sets, and where the board has room for them four sets and two criteria. \
         Least, median and most of the\nsteps that a part runs in. What the compiler has inlined counts for where it was written. A round of the motion loop takes {MOTION_STEPS} steps:\na step has one stage of it, four of them friction. The board's part (converters, timer, report) is that of its program, as it\nis flashed, on the emulated board: {INTERRUPTS} control interrupts while the joint is off, in each of which it tells the tasks what it does; with the bridge on\none step in five does, not the longest, so that the sum of both is more than any takes."
    );
    for (board, program) in BOARDS.iter().zip(&boards) {
        let steps = input(&image_bytes(board.parameter_sets), &record(board.parameter_sets)?);
        let (_, runs) = counted(&board.probe("step", Some(("PROBE_RUNS", &steps)), board.room(), TEMPORARY)?)?;
        let steps: Vec<Step> = runs.concat();
        println!("\n### {}\n", board.name);
        println!("| | instructions | cycles | target | |\n|---|---|---|---|---|");
        let evaluations = || runs.iter().flat_map(|run| run.chunks_exact(MOTION_STEPS as usize));
        let evaluation = |steps: &[Step]| {
            let mut sum = Cost::default();
            steps.iter().for_each(|step| sum += step.of(FRICTION));
            sum
        };
        for (name, parts, instructions, cycles) in &ROWS {
            let costs = steps.iter().map(|step| step.of(parts)).collect();
            row(board, name, costs, *instructions, *cycles, &mut missed);
            if *parts == FRICTION {
                let costs = evaluations().map(evaluation).collect();
                row(board, "a whole evaluation of friction", costs, None, None, &mut missed);
            }
        }
        let rest = |step: &Step| {
            let named: Vec<&str> = ROWS.iter().flat_map(|(_, parts, ..)| *parts).copied().collect();
            step.of(&PARTS.map(|(name, _)| name).into_iter().filter(|name| !named.contains(name)).collect::<Vec<_>>())
        };
        row(board, "everything else of the joint", steps.iter().map(rest).collect(), None, None, &mut missed);
        row(board, "the joint's control step", steps.iter().map(|step| step.sum).collect(), None, None, &mut missed);
        let longest = steps.iter().map(|step| step.sum.cycles).max().unwrap_or(0);
        let [least, median, most] = program.around;
        let whole = longest + most;
        verdict(board.name, "whole interrupt", whole, WHOLE, "cycles", &mut missed);
        println!("| the board's part of the interrupt, entry and return | | {least} {median} {most} | | |");
        let said = if whole <= WHOLE { "kept" } else { "missed" };
        println!("| **both, the longest of each** | | {whole} | {WHOLE} cycles | {said} |");
    }
    println!(
        "\n## The flashed programs in motion\n\nCycles of the control interrupt, entry and return included, while the joint moves for {MOTION} s on the emulated board, over the \
         bus: a velocity of {AMPLITUDE} rad/s, a sine\nof 1 Hz, with the model of above. Rounds: those of the motion loop in which physical model and network acted. In the \
         B-G431B-ESC1's program the physical model lies in flash.\nWait states of the flash: none, as if all of it lay in SRAM; prefetched, those of branches and data, as everywhere \
         in this file; always, those of each line\nof code and of data as if prefetch and caches were of no use, which nothing can exceed. Targets: {WHOLE} cycles the whole \
         interrupt, {NETWORK} the network.\n"
    );
    println!(
        "| program | rounds | wait states | a period | least | mean | most | |\n|---|---|---|---|---|---|---|---|"
    );
    let mut network = Vec::new();
    in_motion("b-g431b-esc1", BG431BEsc1::new, &mut network, &mut missed)?;
    in_motion("moteus-r4", MoteusR4::new, &mut network, &mut missed)?;
    println!("\nOf this the network, from its inputs in Q31 as above, as it is linked:\n");
    println!("| program | wait states | network | its inputs | |\n|---|---|---|---|---|");
    network.iter().for_each(|line| println!("{line}"));
    networks(&mut missed)?;
    memories(&boards);
    println!("\n## What is missed\n");
    missed.iter().for_each(|line| println!("- {line}"));
    if missed.is_empty() {
        println!("Nothing.");
    }
    Ok(())
}

fn verdict(program: &str, name: &str, most: u64, target: u64, unit: &str, missed: &mut Vec<String>) -> bool {
    if most > target {
        missed.push(format!("{program}, {name}: {most} {unit}, {} more than the target of {target}", most - target));
    }
    most <= target
}

/// The control interrupt of a program while its joint moves; rows on the network.
fn in_motion<W: Observed + Clone>(
    name: &str,
    board: fn(Drivetrain) -> W,
    network: &mut Vec<String>,
    missed: &mut Vec<String>,
) -> Outcome<()> {
    let path = build(name, TEMPORARY)?;
    let program = Program::parse(std::fs::read(&path)?)?;
    let variables = Variables::of(&program)?;
    let failed = |failed: Failed| failed.message().unwrap_or("failed").to_owned();
    let moving = Moving::start(board, &actuator(), &program, &acting_image::<W>()).map_err(failed)?;
    let period = (170e6 / W::CONFIGURATION.bridge.rate).round();
    for (waiting, wait_states) in
        [(Waiting::Never, "none"), (Waiting::Prefetched, "prefetched"), (Waiting::Always, "always")]
    {
        let taken = taken(moving.clone(), (&path, &program), &variables, waiting, MOTION).map_err(failed)?;
        taken.check().map_err(failed)?;
        let ExceptionTimes { count, own_cycles, least, most, .. } = taken.interrupt;
        let (mean, rounds) = (own_cycles / count.max(1), format!("{} of {}", taken.acting(), taken.rounds));
        let [net, [_, _, inputs]] = taken.network;
        let said = |kept: bool| if kept { "kept" } else { "missed" };
        let name_of = |what: &str| format!("{what}, wait states {wait_states}");
        let kept = verdict(name, &name_of("control interrupt in motion"), most, WHOLE, "cycles", missed);
        println!("| {name} | {rounds} | {wait_states} | {period} | {least} | {mean} | {most} | {} |", said(kept));
        let kept = verdict(name, &name_of("network as linked"), net[2], NETWORK, "cycles", missed);
        network.push(format!("| {name} | {wait_states} | {} | {inputs} | {} |", net[2], said(kept)));
    }
    Ok(())
}

fn cells(costs: &[Cost]) -> ([u64; 3], [u64; 3]) {
    (spread(costs.iter().map(|cost| cost.instructions)), spread(costs.iter().map(|cost| cost.cycles)))
}

fn row(
    board: &Board,
    name: &str,
    costs: Vec<Cost>,
    instructions: Option<u64>,
    cycles: Option<u64>,
    missed: &mut Vec<String>,
) {
    let (i, c) = cells(&costs);
    let mut kept = true;
    for (spread, target, unit) in [(i, instructions, "instructions"), (c, cycles, "cycles")] {
        kept &= target.is_none_or(|target| verdict(board.name, name, spread[2], target, unit, missed));
    }
    let targets =
        [instructions.map(|most| format!("{most} instructions")), cycles.map(|most| format!("{most} cycles"))];
    let targets: Vec<String> = targets.into_iter().flatten().collect();
    let said = if targets.is_empty() {
        ""
    } else if kept {
        "kept"
    } else {
        "missed"
    };
    println!("| {name} | {} {} {} | {} {} {} | {} | {said} |", i[0], i[1], i[2], c[0], c[1], c[2], targets.join(", "));
}

fn networks(missed: &mut Vec<String>) -> Outcome<()> {
    let (image, friction) = (image_bytes(1), friction(1));
    let (domain, parameters) = (friction.domain, friction.sets[0].network.ok_or("no network")?);
    let exact = Exact::new(&parameters);
    let mut random = ChaCha8Rng::seed_from_u64(8);
    let signals: Vec<[i32; SIGNALS]> =
        (0..INPUTS).map(|_| domain.ranges.map(|range| within(&mut random, range))).collect();
    let inputs: Vec<_> = signals.iter().map(|signals| scaled(&domain, signals)).collect();
    let wanted: Vec<f64> = inputs.iter().map(|x| exact.output(*x)).collect();
    let full_scale = wanted.iter().fold(0.0f64, |most, output| most.max(output.abs()));
    let (bytes, step) = exact.bytes(&inputs);
    println!(
        "\n## The network in other libraries\n\nThe first set's network, {INPUTS} inputs drawn from the trained box, weights from memory. Ours clamps and scales \
         its inputs from Q16.16 in what is\ncounted, and its call counts here; the others get theirs scaled. Error: the largest, in % of the largest output, against 64-bit floats. \
         microflow 0.1 has no tanh and no inputs of more\nthan 8 bits: one is looked up beside it. embedded-nn 0.2 has no tanh for floats (its \
         `fast_tanh_f32` is x / (1 + |x|), 0.5 at 1): libm's is called."
    );
    for board in &BOARDS {
        let mut core = Core::start(&board.probe("networks", None, &["peers"], TEMPORARY)?)?;
        core.run_to((1, 0))?;
        core.write("IMAGE", &image)?;
        core.write_words("LENGTH", [image.len() as i32])?;
        core.write_words("SIGNAL_ROWS", signals.iter().flatten().copied())?;
        let floats = inputs.iter().flatten().map(|x| (*x as f32).to_bits() as i32);
        core.write_words("FLOAT_ROWS", floats)?;
        let rounded: Vec<u8> = inputs.iter().flatten().map(|x| (x * 127.0).round() as i8 as u8).collect();
        core.write("BYTE_ROWS", &rounded)?;
        core.write("FLOATS", &exact.floats())?;
        core.write("BYTES", &bytes)?;
        println!("\n{}:\n", board.name);
        println!("| | instructions | cycles | largest error, % |\n|---|---|---|---|");
        let single = |word: i32| f64::from(f32::from_bits(word as u32));
        let own = |word: i32| f64::from(word) / 65536.0 / exact.scale;
        let eight = |word: i32| f64::from(word) * step;
        let rows: [Peer; 4] = [
            ("this project's", "counted_own", &own),
            ("plain Rust, f32, libm's tanhf", "counted_plain", &single),
            ("embedded-nn 0.2, f32, libm's tanhf", "counted_embedded_nn", &single),
            ("microflow 0.1, i8, tanh looked up", "counted_microflow", &eight),
        ];
        for (name, function, value) in rows {
            let costs = core.calls(function)?;
            let outputs = core.read_words("OUTPUTS", INPUTS)?;
            let errors = outputs.iter().zip(&wanted).map(|(word, wanted)| (value(*word) - wanted).abs());
            let error = 100.0 * errors.fold(0.0, f64::max) / full_scale;
            let (i, c) = cells(&costs);
            if costs.len() != INPUTS {
                return Err(format!("{name}: {} calls", costs.len()).into());
            }
            if function == "counted_own" && i[0] != i[2] {
                missed.push(format!(
                    "{}: the network's instructions depend on its inputs, {} to {}",
                    board.name, i[0], i[2]
                ));
            }
            println!("| {name} | {} {} {} | {} {} {} | {error:.4} |", i[0], i[1], i[2], c[0], c[1], c[2]);
        }
    }
    Ok(())
}

/// A board's program.
struct Flashed {
    name: &'static str,
    flash: u64,
    ram: u64,
    ccm: u64,
    /// Room for the stack, and how much of it was used.
    stack: [u64; 2],
    /// Cycles of the control interrupt that are not the joint's: least, median, most.
    around: [u64; 3],
}

/// Builds a board's program, sums up what it takes, and lets it run.
fn run<W: Wired>(board: &'static Board, wired: impl FnOnce(Drivetrain) -> W) -> Outcome<Flashed> {
    let path = build(board.name, TEMPORARY)?;
    let bytes = std::fs::read(&path)?;
    let (mut flash, mut ram, mut ccm) = (0, 0, 0);
    let header = object::elf::FileHeader32::<object::Endianness>::parse(&*bytes)?;
    let endian = header.endian()?;
    for segment in header.program_headers(endian, &*bytes)? {
        if segment.p_type(endian) != object::elf::PT_LOAD {
            continue;
        }
        flash += u64::from(segment.p_filesz(endian));
        match segment.p_vaddr(endian) >> 28 {
            2 => ram += u64::from(segment.p_memsz(endian)),
            1 => ccm += u64::from(segment.p_memsz(endian)),
            _ => {}
        }
    }
    let program = Program::parse(bytes)?;
    let symbol = |name: &str| program.symbol(name).map(|symbol| symbol.address).ok_or(format!("no {name}"));
    let (end, start) = (symbol("_stack_end")?, symbol("_stack_start")?);
    let mut parameters = ActuatorParameters::reference().aligned().without_payload();
    parameters.bus.source_voltage = 18.0;
    let mut emulation = Emulation::new(wired(Drivetrain::new(parameters, 25.0, 1)?), &program)?;
    emulation.cpu.set_watch(Some(Watch::new()));
    for _ in 0..(RUN / 0.02).round() as u32 {
        if let Some(end) = emulation.run(0.02) {
            return Err(format!("{}: {end}", board.name).into());
        }
        emulation.log();
    }
    let lowest = emulation.cpu.watch().and_then(Watch::lowest_main_stack).ok_or("no stack")?;
    let stack = [u64::from(start - end), u64::from(start - lowest)];
    Ok(Flashed { name: board.name, flash, ram, ccm, stack, around: around(&mut emulation, &path)? })
}

/// Cycles of control interrupts that are not the joint's control step, least, median and most: entry, return, and what
/// the board does before and behind it. Line tables tell the step's instructions, inlined into the handler or not, and
/// what they call counts with them.
fn around<W: Wired>(emulation: &mut Emulation<W>, path: &Path) -> Outcome<[u64; 3]> {
    let loader = addr2line::Loader::new(path).map_err(|error| error.to_string())?;
    let mut known: HashMap<u32, Option<bool>> = HashMap::new();
    let cpu = &mut emulation.cpu;
    cpu.set_watch(None);
    let mut board = Vec::new();
    // One that is under way would be taken apart from its middle on.
    while cpu.exception() == CONTROL {
        if let Some(end) = cpu.step() {
            return Err(end.to_string().into());
        }
    }
    for _ in 0..INTERRUPTS {
        cpu.clear_exception_times();
        let (mut in_joint, mut joint) = (false, 0);
        let own = loop {
            let (at, inside, before) = (cpu.register(15), cpu.exception() == CONTROL, cpu.now());
            if let Some(end) = cpu.step() {
                return Err(end.to_string().into());
            }
            if let Some(times) = cpu.exception_times().get(&CONTROL) {
                break times.own_cycles;
            }
            if inside {
                in_joint = known.entry(at).or_insert_with(|| belongs(&loader, at)).unwrap_or(in_joint);
                joint += if in_joint { cpu.now() - before } else { 0 };
            }
        };
        if joint == 0 {
            return Err("no control step in the control interrupt".into());
        }
        board.push(own - joint);
    }
    Ok(spread(board))
}

/// Returns `true` if an instruction of the handler belongs to the joint's control step; none for what is called out of
/// line.
fn belongs(loader: &addr2line::Loader, address: u32) -> Option<bool> {
    let mut frames = loader.find_frames(address.into()).ok()?;
    let (mut joint, mut handler) = (false, false);
    while let Ok(Some(frame)) = frames.next() {
        let name = frame.function.as_ref().and_then(|function| function.raw_name().ok());
        // With all of the debug information the name is the linker's.
        joint |= name.as_deref().is_some_and(|name| name.contains("control_step"));
        handler |= name.as_deref() == Some("ADC1_2");
    }
    (handler || joint).then_some(joint)
}

fn memories(boards: &[Flashed]) {
    println!(
        "\n## Memories\n\nBytes, from each program's headers; RAM includes the whole stack region. Stack: the most that {RUN} s from power-up took, by the stack \
         pointer after every\ninstruction.\n"
    );
    println!("| | flash | RAM | CCM SRAM | stack region | stack used |\n|---|---|---|---|---|---|");
    for Flashed { name, flash, ram, ccm, stack: [room, used], .. } in boards {
        println!("| {name} | {flash} | {ram} | {ccm} | {room} | {used} |");
    }
}
