//! The boards' programs, as they are flashed, on the emulated boards: they start, control at their rate and within
//! their period, see the supply, the rotor and the button.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4, Wired};
use host_tests::emulated::Bench;
use host_tests::emulated::bench::{actuator, program};
use joint_firmware::joint::fault::Fault as JointFault;
use libtest_mimic::{Failed, Trial};
use plant::actuator::Fault;

/// Exception of the control interrupt, ADC1_2: interrupt 18 of both chips.
const CONTROL: u16 = 16 + 18;
/// Time after power-up by which the second line of the log has come, s.
const SETTLED: f64 = 1.1;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    vec![
        Trial::test("b_g431b_esc1_starts_and_controls", esc1_starts),
        Trial::test("b_g431b_esc1_is_ready_once_its_encoder_has_met_the_index", esc1_index),
        Trial::test("b_g431b_esc1_keeps_the_bridge_off_after_the_button", esc1_button),
        Trial::test("moteus_r4_starts_and_controls", moteus_starts),
        Trial::test("a_supply_out_of_range_is_a_fault_on_both", supply),
    ]
}

/// A board with its program, on a bench supply.
fn bench<W: Wired>(board: impl FnOnce(Drivetrain) -> W) -> Result<Bench<W>, Failed> {
    Bench::new(board, &program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?)
}

/// The B-G431B-ESC1 with its rotor half a turn from the encoder's index: on it, noise alone would reach the index.
fn esc1() -> Result<Bench<BG431BEsc1>, Failed> {
    let mut actuator = actuator();
    actuator.sensors.encoder.zero = 0.5;
    Bench::with(BG431BEsc1::new, &actuator, &program(BG431BEsc1::NAME, env!("CARGO_TARGET_TMPDIR"))?)
}

/// Checks that it starts once, controls once a period and within it, and reports neither faults nor overruns.
fn starts<W: Wired>(bench: &mut Bench<W>, rate: u32, idle: &str) -> Result<(), Failed> {
    bench.run(0.1)?;
    bench.emulation.cpu.clear_exception_times();
    bench.run(SETTLED - 0.1)?;
    bench.expect(&format!("control steps at {rate} Hz"))?;
    let times = bench.emulation.cpu.exception_times().get(&CONTROL).ok_or("no control interrupt")?;
    let (expected, period) = (f64::from(rate) * (SETTLED - 0.1), 170_000_000 / u64::from(rate));
    println!("{}: {} control interrupts, {} to {} cycles of {period}", W::NAME, times.count, times.least, times.most);
    if (times.count as f64 - expected).abs() > 1.0 || times.most >= period {
        return Err(format!("{} control interrupts of {expected}, of up to {} cycles", times.count, times.most).into());
    }
    bench.expect("overruns: 0, switching: false, stopped: false")?;
    bench.expect("torn words 0")?;
    let state = bench.state();
    if state != idle || bench.faults() != 0 {
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
    starts(&mut esc1()?, 20_000, "not ready to switch on")
}

fn moteus_starts() -> Result<(), Failed> {
    starts(&mut bench(MoteusR4::new)?, 40_000, "switch on disabled")
}

/// Turns the link by hand, slowly: the rotor passes the index.
fn esc1_index() -> Result<(), Failed> {
    let mut bench = esc1()?;
    bench.run(0.2)?;
    bench.turn_by_hand(|_| Ok(()))?;
    // A line of the log a second.
    bench.run(1.1)?;
    match bench.state().as_str() {
        "switch on disabled" => Ok(()),
        state => Err(format!("{state}:\n{}", bench.log()).into()),
    }
}

fn esc1_button() -> Result<(), Failed> {
    let mut bench = esc1()?;
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
        bench.expect_fault(JointFault::OverVoltage)?;
        if bench.state() == "fault" { Ok(()) } else { Err(bench.log().into()) }
    }
    over(esc1()?)?;
    over(bench(MoteusR4::new)?)
}
