//! Both boards' programs, as they are flashed, on the emulated boards: they start, control at their rate and within their period, see the
//! supply, the rotor and the button, and answer on the bus.
//!
//! Needs the target; where it is missing the tests are reported as ignored, by name; with `CI` set they run and fail.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4, Wired};
use emulator::chip::fdcan::line::CanFrame;
use emulator::emulation::Emulation;
use emulator::program::Program;
use emulator::rtt::Messages;
use host_tests::bare_metal::{build, target_installed};
use libtest_mimic::{Arguments, Failed, Trial};
use plant::ActuatorParameters;
use plant::actuator::Fault;

/// Exception of the control interrupt, ADC1_2: interrupt 18 of both chips.
const CONTROL: u16 = 16 + 18;
/// Time after power-up by which the second line of the log has come, s.
const SETTLED: f64 = 1.1;

fn main() {
    let arguments = Arguments::from_args();
    let ignored = std::env::var_os("CI").is_none() && !target_installed();
    let trials = vec![
        Trial::test("b_g431b_esc1_starts_and_controls", esc1_starts),
        Trial::test("b_g431b_esc1_is_ready_once_its_encoder_has_met_the_index", esc1_index),
        Trial::test("b_g431b_esc1_keeps_the_bridge_off_after_the_button", esc1_button),
        Trial::test("moteus_r4_starts_and_controls", moteus_starts),
        Trial::test("moteus_r4_takes_a_node_id_and_answers", moteus_bus),
        Trial::test("a_supply_out_of_range_is_a_fault_on_both", supply),
    ];
    let trials = trials.into_iter().map(|trial| trial.with_ignored_flag(ignored)).collect();
    libtest_mimic::run(&arguments, trials).exit();
}

/// A board with its program, on a bench supply.
struct Bench<W: Wired> {
    emulation: Emulation<W>,
    messages: Messages,
    bytes: Vec<u8>,
}

impl<W: Wired> Bench<W> {
    fn new(board: impl FnOnce(Drivetrain) -> W) -> Result<Self, Failed> {
        let mut parameters = ActuatorParameters::reference().aligned().without_payload();
        parameters.bus.source_voltage = 18.0;
        let program = Program::parse(std::fs::read(build(W::NAME, env!("CARGO_TARGET_TMPDIR"))?)?)
            .map_err(|error| format!("{error:?}"))?;
        let emulation = Emulation::new(board(Drivetrain::new(parameters, 25.0, 1)?), &program)?;
        let messages = Messages::of(&program)?.ok_or("the program logs without defmt")?;
        Ok(Self { emulation, messages, bytes: Vec::new() })
    }

    /// Runs on; whatever ends the run before is an error.
    fn run(&mut self, seconds: f64) -> Result<(), Failed> {
        let parts = (seconds / 0.02).ceil();
        for _ in 0..parts as u32 {
            let end = self.emulation.run(seconds / parts);
            // The buffer of the log is small.
            self.bytes.extend(self.emulation.log());
            if let Some(end) = end {
                return Err(format!("after {:.6} s: {end}", self.emulation.now().seconds()).into());
            }
        }
        Ok(())
    }

    /// The log so far.
    fn log(&self) -> String {
        let messages = self.messages.decoder().decode(&self.bytes);
        messages.iter().map(|message| format!("{}\n", message.text)).collect()
    }

    /// What the log says of the joint, last of all.
    fn state(&self) -> String {
        let log = self.log();
        let line = log.lines().rfind(|line| line.starts_with("joint: ")).unwrap_or_default();
        line.trim_start_matches("joint: ").split(',').next().unwrap_or_default().to_owned()
    }

    fn expect(&self, what: &str) -> Result<(), Failed> {
        match self.log().contains(what) {
            true => Ok(()),
            false => Err(format!("the log does not say \"{what}\":\n{}", self.log()).into()),
        }
    }

    /// The board's own part of the plant and of the bus.
    fn board(&mut self) -> &mut W {
        self.emulation.cpu.bus.wiring_mut()
    }
}

/// It starts once, controls once a period and within it, and reports neither faults nor overruns.
fn starts<W: Wired>(bench: &mut Bench<W>, rate: u32, idle: &str) -> Result<(), Failed> {
    bench.run(0.1)?;
    bench.emulation.cpu.clear_exception_times();
    bench.run(SETTLED - 0.1)?;
    bench.expect(&format!("{}: control steps at {rate} Hz", W::NAME))?;
    let times = bench.emulation.cpu.exception_times().get(&CONTROL).ok_or("no control interrupt")?;
    let (expected, period) = (f64::from(rate) * (SETTLED - 0.1), 170_000_000 / u64::from(rate));
    println!("{}: {} control interrupts, {} to {} cycles of {period}", W::NAME, times.count, times.least, times.most);
    if (times.count as f64 - expected).abs() > 1.0 || times.most >= period {
        return Err(format!("{} control interrupts of {expected}, of up to {} cycles", times.count, times.most).into());
    }
    bench.expect("overruns: 0, switching: false, stopped: false")?;
    bench.expect("torn words 0")?;
    let state = bench.state();
    if state != idle || bench.log().contains("fault:") {
        return Err(format!("{state} instead of {idle}:\n{}", bench.log()).into());
    }
    // 18 V and room temperature, by parts of another description than the firmware's constants.
    bench.expect("supply 1")?;
    bench.expect("bridge 25.0")?;
    match bench.emulation.resets() {
        [] => Ok(()),
        resets => Err(format!("{resets:?}").into()),
    }
}

fn esc1_starts() -> Result<(), Failed> {
    starts(&mut Bench::new(BG431BEsc1::new)?, 20_000, "not ready to switch on")
}

fn moteus_starts() -> Result<(), Failed> {
    starts(&mut Bench::new(MoteusR4::new)?, 40_000, "switch on disabled")
}

/// Somebody turns the link by hand, slowly: the rotor passes the index.
fn esc1_index() -> Result<(), Failed> {
    let mut bench = Bench::new(BG431BEsc1::new)?;
    bench.run(0.2)?;
    for _ in 0..700 {
        let drivetrain = bench.board().drivetrain();
        let velocity = drivetrain.actuator().state().joint.velocity;
        drivetrain.external_torque = (200.0 * (0.25 - velocity)).clamp(-10.0, 10.0);
        bench.run(0.001)?;
    }
    let turned = bench.board().drivetrain().actuator().state().rotor_angle;
    if turned < std::f64::consts::TAU {
        return Err(format!("the rotor turned by {turned} rad only").into());
    }
    bench.board().drivetrain().external_torque = 0.0;
    bench.run(SETTLED - 0.9)?;
    match bench.state().as_str() {
        "switch on disabled" => Ok(()),
        state => Err(format!("{state}:\n{}", bench.log()).into()),
    }
}

fn esc1_button() -> Result<(), Failed> {
    let mut bench = Bench::new(BG431BEsc1::new)?;
    bench.run(0.2)?;
    bench.board().inputs().button = true;
    bench.run(0.1)?;
    bench.board().inputs().button = false;
    bench.run(SETTLED - 0.3)?;
    bench.expect("button: the bridge stays off until the next reset")?;
    bench.expect("stopped: true")
}

fn supply() -> Result<(), Failed> {
    fn over<W: Wired>(mut bench: Bench<W>) -> Result<(), Failed> {
        bench.run(0.2)?;
        bench.board().drivetrain().actuator_mut().inject(Fault::SourceVoltage(40.0))?;
        bench.run(SETTLED - 0.2)?;
        bench.expect("fault: supply voltage too high")?;
        if bench.state() == "fault" { Ok(()) } else { Err(bench.log().into()) }
    }
    over(Bench::new(BG431BEsc1::new)?)?;
    over(Bench::new(MoteusR4::new)?)
}

/// CiA 305: a new node is silent until LSS gives it a node id. Then it boots and answers.
fn moteus_bus() -> Result<(), Failed> {
    let mut bench = Bench::new(MoteusR4::new)?;
    bench.run(0.2)?;
    let mut exchange = |id: u32, data: [u8; 8]| -> Result<Vec<(u32, [u8; 8])>, Failed> {
        let frame = CanFrame::standard(id, &data).ok_or("no such frame")?;
        let now = bench.emulation.now();
        bench.board().line().send(now, frame);
        bench.emulation.cpu.bus.wiring_changed();
        bench.run(0.02)?;
        let line = bench.board().line();
        Ok(std::iter::from_fn(|| line.receive()).map(|(_, frame)| (frame.id, frame.data)).collect())
    };
    const LSS: u32 = 0x7E5;
    let silent = exchange(0x605, [0x40, 0, 0x10, 0, 0, 0, 0, 0])?;
    if !silent.is_empty() {
        return Err(format!("a node without a node id sends {silent:x?}").into());
    }
    // All nodes to configuration; node id 5; back to waiting.
    exchange(LSS, [0x04, 1, 0, 0, 0, 0, 0, 0])?;
    let taken = exchange(LSS, [0x11, 5, 0, 0, 0, 0, 0, 0])?;
    if taken != [(0x7E4, [0x11, 0, 0, 0, 0, 0, 0, 0])] {
        return Err(format!("answer to the node id: {taken:x?}").into());
    }
    let booted = exchange(LSS, [0x04, 0, 0, 0, 0, 0, 0, 0])?;
    if !booted.contains(&(0x705, [0; 8])) {
        return Err(format!("no boot-up message: {booted:x?}").into());
    }
    // Device type of a servo drive, by SDO.
    let answer = exchange(0x605, [0x40, 0, 0x10, 0, 0, 0, 0, 0])?;
    match answer.contains(&(0x585, [0x43, 0, 0x10, 0, 0x92, 0x01, 0x02, 0])) {
        true => Ok(()),
        false => Err(format!("answer to 1000h: {answer:x?}").into()),
    }
}
