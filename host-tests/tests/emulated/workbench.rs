//! The emulated board as a bench: commands do their thing, in the board's own time, and what the program stores
//! outlasts the emulator.

use super::gate_driver::{COMPLETE, DRIVER, FAULT, NO_ANSWER, NOT_CONFIGURED, RESET, is, told, words};
use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4, Wired};
use emulator::chip::time::Instant;
use emulator::parts::drv8353::fault;
use emulator::program::Program;
use host_tests::emulated::Bench;
use host_tests::emulated::bench::program;
use host_tests::emulated::master::{heard, send};
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::State;
use libtest_mimic::{Failed, Trial};
use node::{FlashFile, Workbench};

const NODE: u8 = 5;
/// The command deadline's object.
const DEADLINE: (u16, u8) = (0x2103, 11);

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    vec![
        Trial::test("each_command_does_its_thing_on_the_moteus_r4", on_the_moteus),
        Trial::test("each_command_does_its_thing_on_the_b_g431b_esc1", on_the_esc1),
        Trial::test("each_fault_of_the_moteus_r4s_gate_driver_is_named_and_gone_after_a_fault_reset", driver_faults),
        Trial::test("the_moteus_r4_waits_for_a_supply_that_comes_late", late_supply),
        Trial::test("what_is_stored_survives_a_restart_and_a_kill_of_the_emulator_on_the_moteus_r4", || {
            storage(MoteusR4::new)
        }),
        Trial::test("what_is_stored_survives_a_restart_and_a_kill_of_the_emulator_on_the_b_g431b_esc1", || {
            storage(BG431BEsc1::new)
        }),
    ]
}

/// A board with somebody at its bench.
struct Attended<W: Wired> {
    bench: Bench<W>,
    workbench: Workbench,
}

impl<W: Wired> Attended<W> {
    fn new(board: fn(Drivetrain) -> W) -> Result<Self, Failed> {
        let bench = Bench::new(board, &program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?)?;
        Ok(Self { bench, workbench: Workbench::new() })
    }

    /// Says lines, and runs so long; the answers without their times.
    fn say(&mut self, lines: &[&str], seconds: f64) -> Result<Vec<String>, Failed> {
        lines.iter().for_each(|line| self.workbench.tell(line));
        let until = Instant(self.bench.emulation.now().0 + (seconds * 1e12) as u64);
        if let Some(end) = self.workbench.run_until(&mut self.bench.emulation, until) {
            return Err(format!("{end}").into());
        }
        let answers = self.workbench.take_answers();
        Ok(answers.iter().filter_map(|answer| Some(answer.split_once(" s  ")?.1.to_owned())).collect())
    }

    fn position(&mut self) -> f64 {
        self.bench.board().drivetrain().actuator().state().joint.position
    }
}

fn equal<T: PartialEq + std::fmt::Debug>(found: T, expected: T) -> Result<(), Failed> {
    if found == expected { Ok(()) } else { Err(format!("{found:?} instead of {expected:?}").into()) }
}

fn near(found: f64, expected: f64, within: f64) -> Result<(), Failed> {
    if (found - expected).abs() <= within { Ok(()) } else { Err(format!("{found} instead of {expected}").into()) }
}

fn on_the_moteus() -> Result<(), Failed> {
    let mut at = Attended::new(MoteusR4::new)?;
    equal(
        at.say(&["# nothing", "", "suply 3"], 0.2)?,
        vec!["error: unknown command \"suply\"; help lists them".into()],
    )?;
    let help = at.say(&["help"], 0.0)?;
    equal((help.len(), help[0].contains("supply V (voltage of the supply")), (1, true))?;
    equal(at.say(&["button"], 0.0)?, vec!["error: the moteus-r4 has no button".into()])?;

    // By hand, with friction and without, there and back.
    let from = at.position();
    at.say(&["turn 0.3"], 1.5)?;
    near(at.position(), from + 0.3, 0.02)?;
    at.say(&["turn -0.2"], 1.2)?;
    near(at.position(), from + 0.1, 0.03)?;
    at.say(&["load 50"], 0.05)?;
    equal(at.bench.board().drivetrain().external_torque, 50.0)?;
    at.say(&["load 0"], 0.05)?;

    equal(at.say(&["supply 12"], 0.05)?, vec!["supply 12 V".into()])?;
    near(at.bench.board().drivetrain().actuator().state().bus_voltage, 12.0, 0.1)?;
    at.say(&["thermistor-open", "driver-fault line"], 1.1)?;
    equal(at.bench.board().inputs().thermistor_open && at.bench.board().inputs().driver_fault, true)?;
    at.bench.run(0.0)?;
    at.bench.expect_fault(Fault::TemperatureSensor)?;
    at.bench.expect_fault(Fault::BridgeDriver)?;
    at.say(&["thermistor-open off", "driver-fault off", "encoder-open"], 1.1)?;
    equal(at.bench.board().inputs().thermistor_open || at.bench.board().inputs().driver_fault, false)?;
    at.bench.run(0.0)?;
    at.bench.expect_fault(Fault::EncoderLost)?;
    at.say(&["encoder-open off"], 0.0)?;
    equal(at.bench.board().inputs().encoder_line, None)?;

    // Without power nothing runs, and time passes.
    let before = at.bench.emulation.now();
    let answers = at.say(&["power off", "power off", "wait 0.5", "power on"], 0.6)?;
    equal(answers.len(), 4)?;
    equal(answers[1].as_str(), "error: the power is off already")?;
    near(at.bench.emulation.now().seconds() - before.seconds(), 0.1, 1e-6)?;
    equal(at.bench.emulation.is_powered(), true)?;
    let status = at.say(&["status"], 0.0)?;
    equal(status[0].contains("power on; bridge off"), true)
}

fn on_the_esc1() -> Result<(), Failed> {
    let mut at = Attended::new(BG431BEsc1::new)?;
    equal(
        at.say(&["driver-fault over-current", "driver-fault off"], 0.2)?,
        vec!["error: the b-g431b-esc1 has no gate driver that tells of its faults".to_owned(); 2],
    )?;
    at.say(&["encoder-open", "turn 0.2"], 1.0)?;
    let count = |at: &mut Attended<BG431BEsc1>| -> Result<u32, Failed> {
        let now = at.bench.emulation.cpu.now();
        let read =
            emulator::bus::Bus::read(&mut at.bench.emulation.cpu.bus, now, 0x4000_0824, emulator::bus::Width::Word);
        Ok(read.map_err(|refusal| format!("{refusal:?}"))?)
    };
    let still = count(&mut at)?;
    at.say(&["turn 0.2"], 1.0)?;
    equal(count(&mut at)?, still)?;
    at.say(&["encoder-open off", "turn 0.02"], 0.3)?;
    equal(count(&mut at)? == still, false)?;
    equal(at.say(&["button"], 0.05)?, vec!["button pressed for 0.1 s".into()])?;
    equal(at.bench.board().inputs().button, true)?;
    at.say(&[], 0.06)?;
    equal(at.bench.board().inputs().button, false)?;
    at.bench.run(0.0)?;
    at.bench.expect("button: the bridge stays off until the next reset")
}

/// Signs of the bench's driver fault: a line of the log, 2302h:1 and 2, 2302h:4.
type Told = (&'static str, [u16; 2], u32);

fn driver_faults() -> Result<(), Failed> {
    let mut at = Attended::new(MoteusR4::new)?;
    at.bench.run(0.2)?;
    at.bench.give_node_id(NODE)?;
    send(&mut at.bench.emulation, 0x000, &[0x01, NODE])?;
    at.bench.run(0.1)?;
    is(&mut at.bench, State::SwitchOnDisabled)?;
    let faults: [(&str, Told); 7] = [
        ("over-current", ("over-current of a transistor", words(fault::OVER_CURRENT), FAULT)),
        ("under-voltage", ("under-voltage lock-out", words(fault::UNDER_VOLTAGE), FAULT)),
        ("over-temperature", ("thermal shutdown", words(fault::OVER_TEMPERATURE), FAULT)),
        ("gate-drive", ("gate drive", words(fault::GATE_DRIVE), FAULT)),
        ("line", ("", [0; 2], FAULT)),
        ("silent", ("does not answer", [0x7ff; 2], NO_ANSWER)),
        ("forgot", ("", [0; 2], NOT_CONFIGURED)),
    ];
    for (count, (word, (logged, status, setup))) in (1..).zip(faults) {
        println!("{word}");
        equal(told(&mut at.bench)?, ([0; 2], count - 1, COMPLETE))?;
        heard(&mut at.bench.emulation);
        let command = format!("driver-fault {word}");
        equal(at.say(&[&command], 0.3)?, vec![command.clone()])?;
        let frames = heard(&mut at.bench.emulation);
        let [[a, b], [c, d]] = status.map(u16::to_le_bytes);
        let [low, high] = DRIVER.to_le_bytes();
        let emergency = (0x80 + u16::from(NODE), vec![low, high, 0x81, 16, a, b, c, d]);
        if !frames.contains(&emergency) {
            return Err(format!("no EMCY {emergency:x?}: {frames:x?}").into());
        }
        equal(told(&mut at.bench)?, (status, count, setup))?;
        equal(at.bench.number(NODE, 0x603F, 0)? as u16, DRIVER)?;
        is(&mut at.bench, State::Fault)?;
        at.bench.run(0.0)?;
        let [first, second] = status;
        at.bench.expect(&format!("gate driver: {logged}, status {first:#05x} {second:#05x}"))?;
        // It lasts until the bench ends it; a driver that has forgotten is configured anew by the reset.
        reset(&mut at)?;
        is(&mut at.bench, if word == "forgot" { State::SwitchOnDisabled } else { State::Fault })?;
        equal(at.say(&["driver-fault off"], 0.1)?, vec!["driver-fault off".into()])?;
        reset(&mut at)?;
        is(&mut at.bench, State::SwitchOnDisabled)?;
        equal(told(&mut at.bench)?, ([0; 2], count, COMPLETE))?;
        equal(at.bench.number(NODE, 0x603F, 0)?, 0)?;
    }
    // Each ends the one before.
    at.say(&["driver-fault silent", "driver-fault line", "driver-fault over-current", "driver-fault off"], 0.3)?;
    reset(&mut at)?;
    is(&mut at.bench, State::SwitchOnDisabled)?;
    equal((at.bench.emulation.resets().len(), at.bench.emulation.is_powered()), (0, true))
}

/// A fault reset by the controlword, and the time that it may take.
fn reset(at: &mut Attended<MoteusR4>) -> Result<(), Failed> {
    for word in [RESET, 0] {
        at.bench.download(NODE, 0x6040, 0, &word.to_le_bytes())?;
        at.bench.run(0.15)?;
    }
    Ok(())
}

fn late_supply() -> Result<(), Failed> {
    let mut at = Attended::new(MoteusR4::new)?;
    at.bench.run(0.2)?;
    at.bench.give_node_id(NODE)?;
    at.say(&["supply 0", "power off", "power on"], 0.5)?;
    is(&mut at.bench, State::NotReadyToSwitchOn)?;
    equal(told(&mut at.bench)?, ([0; 2], 0, NO_ANSWER))?;
    // Below the driver's lock-out, then above.
    at.say(&["supply 7"], 0.1)?;
    is(&mut at.bench, State::NotReadyToSwitchOn)?;
    equal(told(&mut at.bench)?, (words(fault::UNDER_VOLTAGE), 0, FAULT))?;
    at.say(&["supply 18"], 0.1)?;
    is(&mut at.bench, State::SwitchOnDisabled)?;
    equal(told(&mut at.bench)?, ([0; 2], 0, COMPLETE))?;
    equal(at.bench.number(NODE, 0x603F, 0)?, 0)
}

/// A board with what a folder keeps.
fn powered_up<W: Wired>(
    board: fn(Drivetrain) -> W,
    program: &Program,
    folder: &std::path::Path,
) -> Result<(Bench<W>, FlashFile), Failed> {
    let mut bench = Bench::new(board, program)?;
    let kept = FlashFile::open(folder, &mut bench.emulation, program)?;
    Ok((bench, kept))
}

fn deadline<W: Wired>(bench: &mut Bench<W>) -> Result<Vec<u8>, Failed> {
    bench.upload(NODE, DEADLINE.0, DEADLINE.1)
}

fn storage<W: Wired>(board: fn(Drivetrain) -> W) -> Result<(), Failed> {
    let file = format!("{}.flash", W::NAME);
    let program = program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    let (mut bench, mut kept) = powered_up(board, &program, folder)?;
    bench.run(0.2)?;
    bench.give_node_id(NODE)?;
    let old = deadline(&mut bench)?;
    let new = 0.25f32.to_le_bytes();
    kept.keep(&bench.emulation)?;
    bench.download(NODE, DEADLINE.0, DEADLINE.1, &new)?;
    // Staged settings come into use, and can be stored.
    bench.download(NODE, 0x2100, 1, &[1])?;
    bench.run(0.001)?;

    // "save", and the process is killed at instants in the middle of it: what is in the file is what was kept last.
    send(&mut bench.emulation, 0x600 + u16::from(NODE), &[0x23, 0x10, 0x10, 0x01, b's', b'a', b'v', b'e'])?;
    let (begun, mut seen) = (bench.operations(), (0, 0, 0));
    for _ in 0..400 {
        bench.run(0.000_3)?;
        kept.keep(&bench.emulation)?;
        let (operations, busy) = bench.emulation.cpu.bus.flash().progress();
        if !busy || operations - begun <= seen.2 {
            continue;
        }
        // Every eighth operation is enough.
        seen.2 = operations - begun + 8;
        let killed = tempfile::tempdir()?;
        std::fs::copy(folder.join(&file), killed.path().join(&file))?;
        let (mut again, _) = powered_up(board, &program, killed.path())?;
        equal(again.emulation.cpu.bus.flash().array.torn().is_empty(), false)?;
        again.booted(NODE)?;
        match deadline(&mut again)? {
            found if found == old => seen.0 += 1,
            found if found == new => seen.1 += 1,
            found => return Err(format!("{found:x?}").into()),
        }
    }
    println!("killed in the middle of a store: {} starts with the old deadline, {} with the new one", seen.0, seen.1);
    equal(seen.0 > 0, true)?;
    bench.written()?;
    kept.keep(&bench.emulation)?;
    drop(bench);
    let (mut again, _) = powered_up(board, &program, folder)?;
    again.booted(NODE)?;
    equal(deadline(&mut again)?, new.to_vec())?;

    // Something else in the file is refused, and stays.
    std::fs::write(folder.join(&file), b"a letter")?;
    let refused = powered_up(board, &program, folder).err().ok_or("a letter was taken for a flash")?;
    let text = refused.message().unwrap_or_default().to_owned();
    equal(text.contains(&format!("{file}: it does not begin as the flash of an emulated board")), true)?;
    equal(std::fs::read(folder.join(&file))?, b"a letter".to_vec())
}
