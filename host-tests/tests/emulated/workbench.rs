//! The emulated board as a bench: commands do their thing, in the board's own time, and what the program stores outlasts the emulator.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4, Wired};
use emulator::chip::time::Instant;
use emulator::program::Program;
use host_tests::emulated::Bench;
use host_tests::emulated::bench::program;
use host_tests::emulated::master::send;
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
        Trial::test("what_is_stored_survives_a_restart_and_a_kill_of_the_emulator", storage),
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
    at.say(&["thermistor-open", "driver-fault"], 1.1)?;
    equal(at.bench.board().inputs().thermistor_open && at.bench.board().inputs().driver_fault, true)?;
    at.bench.run(0.0)?;
    at.bench.expect("fault: temperature sensor open or shorted")?;
    at.bench.expect("fault: gate driver fault")?;
    at.say(&["thermistor-open off", "driver-fault off", "encoder-open"], 1.1)?;
    equal(at.bench.board().inputs().thermistor_open || at.bench.board().inputs().driver_fault, false)?;
    at.bench.run(0.0)?;
    at.bench.expect("fault: encoder does not answer")?;
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
    equal(at.say(&["driver-fault"], 0.2)?, vec!["error: the b-g431b-esc1 has no fault line".into()])?;
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

/// A board with what a folder keeps.
fn powered_up(program: &Program, folder: &std::path::Path) -> Result<(Bench<MoteusR4>, FlashFile), Failed> {
    let mut bench = Bench::new(MoteusR4::new, program)?;
    let kept = FlashFile::open(folder, &mut bench.emulation, program)?;
    Ok((bench, kept))
}

fn deadline(bench: &mut Bench<MoteusR4>) -> Result<Vec<u8>, Failed> {
    bench.upload(NODE, DEADLINE.0, DEADLINE.1)
}

fn storage() -> Result<(), Failed> {
    let program = program(MoteusR4::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    let (mut bench, mut kept) = powered_up(&program, folder)?;
    bench.run(0.2)?;
    bench.give_node_id(NODE)?;
    let old = deadline(&mut bench)?;
    let new = 0.25f32.to_le_bytes();
    kept.keep(&bench.emulation)?;
    bench.download(NODE, DEADLINE.0, DEADLINE.1, &new)?;
    // What is staged comes into use, and can be stored.
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
        std::fs::copy(folder.join("moteus-r4.flash"), killed.path().join("moteus-r4.flash"))?;
        let (mut again, _) = powered_up(&program, killed.path())?;
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
    let (mut again, _) = powered_up(&program, folder)?;
    again.booted(NODE)?;
    equal(deadline(&mut again)?, new.to_vec())?;

    // Something else in the file is refused, and stays.
    std::fs::write(folder.join("moteus-r4.flash"), b"a letter")?;
    let refused = powered_up(&program, folder).err().ok_or("a letter was taken for a flash")?;
    let text = refused.message().unwrap_or_default().to_owned();
    equal(text.contains("moteus-r4.flash: it does not begin as the flash of an emulated board"), true)?;
    equal(std::fs::read(folder.join("moteus-r4.flash"))?, b"a letter".to_vec())
}
