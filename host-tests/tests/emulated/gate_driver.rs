//! The moteus r4's gate driver, and either board's chip, by their programs on the emulated boards: faults of the driver
//! are named over CAN and gone after a fault reset, without a loss of power; a driver that does not answer, or a supply
//! that comes late, is waited for; another board is left alone; option bytes are told, and set when asked.

use emulator::board::{Drivetrain, MoteusR4, Wired as _};
use emulator::cpu::Origin;
use emulator::parts::drv8353::{Drv8353, fault};
use emulator::program::Program;
use friction_compensation::compensation::Request;
use host_tests::emulated::Bench;
use host_tests::emulated::bench::{SUPPLY, actuator, program};
use host_tests::emulated::kept::{Kept, configuration};
use host_tests::emulated::master::send;
use host_tests::emulated::motion::{Moving, NODE, SET_POINT};
use host_tests::emulated::observed::Observed;
use host_tests::on_each_board;
use joint_firmware::hardware::chip_options::{COMMAND, N_SWBOOT0, SRAM_PE};
use joint_firmware::hardware::drv8353::MOTEUS_R4_11;
use joint_firmware::hardware::moteus_revision::{OTHER_FAMILY, SUPPORTED};
use joint_firmware::joint::state_machine::State;
use libtest_mimic::{Failed, Trial};
use node::SampleImage;
use plant::actuator::Fault;

/// Error code of a fault of the gate driver.
pub const DRIVER: u16 = 0x5410;
/// Fault status 1: any fault.
const ANY: u16 = 1 << 10;
/// Numbers of object 2302h:4.
pub const COMPLETE: u32 = 0;
pub const NO_ANSWER: u32 = 2;
pub const NOT_CONFIGURED: u32 = 3;
pub const FAULT: u32 = 4;
const WRONG_BOARD: u32 = 5;
/// Controlwords.
const SHUTDOWN: u16 = 0x06;
pub const RESET: u16 = 0x80;
/// Set-points in 50 ms, in 150 ms.
const SHORT: f64 = 10.0 * SET_POINT;
const LONG: f64 = 30.0 * SET_POINT;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    let mut trials = vec![
        Trial::test("moteus_r4_names_a_fault_of_its_gate_driver_and_clears_it", faults_in_motion),
        Trial::test("moteus_r4_clears_no_fault_whose_cause_is_there", causes_that_stay),
        Trial::test("moteus_r4_configures_a_driver_anew_that_has_forgotten", forgotten),
        Trial::test("moteus_r4_finds_a_silent_driver_before_it_switches", silent_at_rest),
        Trial::test("moteus_r4_waits_for_a_silent_driver", silent_at_start),
        Trial::test("moteus_r4_waits_for_its_supply", late_supply),
        Trial::test("moteus_r4_leaves_another_board_alone", other_boards),
    ];
    trials.extend(on_each_board!("tells_its_option_bytes_and_sets_them_when_asked", options));
    trials
}

fn expect<T: PartialEq + std::fmt::Debug>(what: &str, found: T, expected: T) -> Result<(), Failed> {
    if found == expected { Ok(()) } else { Err(format!("{what} is {found:x?} instead of {expected:x?}").into()) }
}

fn built() -> Result<Program, Failed> {
    program("moteus-r4", env!("CARGO_TARGET_TMPDIR"))
}

fn moving(program: &Program) -> Result<Moving, Failed> {
    Moving::start(MoteusR4::new, &actuator(), program, &SampleImage::constant(1, 0.1))
}

/// A board with a node id, whatever was done to it before; up to its boot-up message.
fn started(
    program: &Program,
    prepare: impl FnOnce(&mut MoteusR4) -> Result<(), Failed>,
) -> Result<Bench<MoteusR4>, Failed> {
    let actuator = actuator();
    let mut bench = Bench::with(MoteusR4::new as fn(Drivetrain) -> MoteusR4, &actuator, program)?;
    prepare(bench.board())?;
    let configuration = configuration::<MoteusR4>(&actuator, NODE, Request::Off);
    Kept { configuration: &configuration, image: &[] }.write(&mut bench.emulation, program)?;
    bench.booted(NODE)?;
    Ok(bench)
}

/// State by the statusword.
pub fn is(bench: &mut Bench<MoteusR4>, state: State) -> Result<(), Failed> {
    let mask =
        if matches!(state, State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::Fault) { 0x4f } else { 0x6f };
    let word = bench.number(NODE, 0x6041, 0)? as u16;
    expect(&format!("the state by statusword {word:#06x}"), word & mask, state.statusword() & mask)
}

/// Objects 2302h:1 to 4.
pub fn told(bench: &mut Bench<MoteusR4>) -> Result<([u16; 2], u32, u32), Failed> {
    let mut number = |sub_index| bench.number(NODE, 0x2302, sub_index);
    Ok(([number(1)? as u16, number(2)? as u16], number(3)?, number(4)?))
}

/// The status words that a fault is told with.
pub fn words(status: [u16; 2]) -> [u16; 2] {
    [status[0] | ANY, status[1]]
}

/// Asks once for a fault reset, and then for nothing that moves.
fn reset(moving: &mut Moving) -> Result<(), Failed> {
    moving.controlword = Some(RESET);
    moving.run(SET_POINT)?;
    moving.controlword = Some(0);
    moving.run(LONG)
}

/// Enables the joint from "switch on disabled" until it moves.
fn enable(moving: &mut Moving) -> Result<(), Failed> {
    for word in [SHUTDOWN, 0x07, 0x0F] {
        moving.controlword = Some(word);
        moving.run(SET_POINT)?;
    }
    moving.run(SHORT)?;
    match moving.bench.board().drivetrain().is_switching() {
        true => Ok(()),
        false => Err(format!("the bridge does not switch:\n{}", moving.bench.log()).into()),
    }
}

fn is_configured(driver: &Drv8353) -> bool {
    MOTEUS_R4_11.registers().iter().all(|(number, content)| driver.register(usize::from(*number)) == Some(*content))
}

fn faults_in_motion() -> Result<(), Failed> {
    let start = moving(&built()?)?;
    for (name, status) in [
        ("over-current of a transistor", fault::OVER_CURRENT),
        ("under-voltage lock-out", fault::UNDER_VOLTAGE),
        ("thermal shutdown", fault::OVER_TEMPERATURE),
        ("gate drive", fault::GATE_DRIVE),
    ] {
        let mut moving = start.clone();
        expect("2302h at first", told(&mut moving.bench)?, ([0; 2], 0, COMPLETE))?;
        moving.bench.board().driver().fail(status);
        moving.run(SHORT)?;
        expect("2302h", told(&mut moving.bench)?, (words(status), 1, FAULT))?;
        expect("603Fh", moving.bench.number(NODE, 0x603F, 0)? as u16, DRIVER)?;
        is(&mut moving.bench, State::Fault)?;
        moving.bench.run(1.0)?;
        moving.bench.expect(&format!("gate driver: {name}"))?;
        let [[a, b], [c, d]] = words(status).map(u16::to_le_bytes);
        let [low, high] = DRIVER.to_le_bytes();
        let message = [low, high, 0x81, 16, a, b, c, d];
        if !moving.emergency_messages().any(|sent| sent == message) {
            return Err(format!("no EMCY {message:x?}: {:x?}", moving.emergency_messages().collect::<Vec<_>>()).into());
        }
        let cleared = moving.bench.board().driver().clears();
        // Without a reset nothing is cleared, whatever else is asked for.
        moving.run(LONG)?;
        is(&mut moving.bench, State::Fault)?;
        expect("clearings", moving.bench.board().driver().clears(), cleared)?;
        reset(&mut moving)?;
        is(&mut moving.bench, State::SwitchOnDisabled)?;
        expect("2302h after the reset", told(&mut moving.bench)?, ([0; 2], 1, COMPLETE))?;
        expect("603Fh after the reset", moving.bench.number(NODE, 0x603F, 0)?, 0)?;
        enable(&mut moving)?;
        expect("resets of the chip", moving.bench.emulation.resets().len(), 0)?;
    }
    Ok(())
}

fn causes_that_stay() -> Result<(), Failed> {
    let start = moving(&built()?)?;
    for status in [fault::OVER_TEMPERATURE, fault::UNDER_VOLTAGE] {
        let mut moving = start.clone();
        moving.bench.board().driver().set_present(status);
        moving.run(SHORT)?;
        reset(&mut moving)?;
        is(&mut moving.bench, State::Fault)?;
        expect("2302h", told(&mut moving.bench)?, (words(status), 1, FAULT))?;
        // Not even the enable cleared it, and no fault of the currents came of the amplifiers' sleep.
        expect("603Fh", moving.bench.number(NODE, 0x603F, 0)? as u16, DRIVER)?;
        moving.bench.board().driver().set_present([0; 2]);
        // A reset of the past does not count.
        moving.run(LONG)?;
        is(&mut moving.bench, State::Fault)?;
        reset(&mut moving)?;
        is(&mut moving.bench, State::SwitchOnDisabled)?;
        expect("2302h after the reset", told(&mut moving.bench)?, ([0; 2], 1, COMPLETE))?;
        enable(&mut moving)?;
    }
    Ok(())
}

fn forgotten() -> Result<(), Failed> {
    let start = moving(&built()?)?;
    // With a fault: it loses its supply for an instant.
    let mut moving = start.clone();
    let driver = moving.bench.board().driver();
    driver.forget();
    driver.fail(fault::UNDER_VOLTAGE);
    moving.run(SHORT)?;
    is(&mut moving.bench, State::Fault)?;
    reset(&mut moving)?;
    is(&mut moving.bench, State::SwitchOnDisabled)?;
    expect("configured", is_configured(moving.bench.board().driver()), true)?;
    enable(&mut moving)?;
    // Without one, at rest.
    let mut moving = start;
    moving.controlword = Some(0);
    moving.run(SHORT)?;
    moving.bench.board().driver().forget();
    moving.run(LONG)?;
    is(&mut moving.bench, State::Fault)?;
    expect("2302h:4", moving.bench.number(NODE, 0x2302, 4)?, NOT_CONFIGURED)?;
    reset(&mut moving)?;
    expect("configured", is_configured(moving.bench.board().driver()), true)?;
    enable(&mut moving)
}

fn silent_at_rest() -> Result<(), Failed> {
    let mut moving = moving(&built()?)?;
    moving.controlword = Some(0);
    moving.run(SHORT)?;
    is(&mut moving.bench, State::SwitchOnDisabled)?;
    moving.bench.board().driver().set_silent(true);
    moving.run(LONG)?;
    is(&mut moving.bench, State::Fault)?;
    expect("2302h", told(&mut moving.bench)?, ([0x7ff; 2], 1, NO_ANSWER))?;
    reset(&mut moving)?;
    is(&mut moving.bench, State::Fault)?;
    expect("2302h:4 after a reset", moving.bench.number(NODE, 0x2302, 4)?, NO_ANSWER)?;
    moving.bench.board().driver().set_silent(false);
    reset(&mut moving)?;
    is(&mut moving.bench, State::SwitchOnDisabled)?;
    expect("2302h after another", told(&mut moving.bench)?, ([0; 2], 1, COMPLETE))?;
    enable(&mut moving)
}

fn silent_at_start() -> Result<(), Failed> {
    let mut bench = started(&built()?, |board| {
        board.driver().set_silent(true);
        Ok(())
    })?;
    bench.run(1.0)?;
    is(&mut bench, State::NotReadyToSwitchOn)?;
    expect("2302h", told(&mut bench)?, ([0; 2], 0, NO_ANSWER))?;
    bench.expect("gate driver: does not answer")?;
    bench.board().driver().set_silent(false);
    bench.run(SHORT)?;
    is(&mut bench, State::SwitchOnDisabled)?;
    expect("2302h once it answers", told(&mut bench)?, ([0; 2], 0, COMPLETE))?;
    expect("resets of the chip", bench.emulation.resets().len(), 0)
}

/// The chip has power before the bridge has: from a debug probe, or because its regulators need less.
fn late_supply() -> Result<(), Failed> {
    let supply = |bench: &mut Bench<MoteusR4>, volts: f64| -> Result<(), Failed> {
        let actuator = bench.board().drivetrain().actuator_mut();
        actuator.clear_faults();
        Ok(actuator.inject(Fault::SourceVoltage(volts))?)
    };
    let mut bench =
        started(&built()?, |board| Ok(board.drivetrain().actuator_mut().inject(Fault::SourceVoltage(0.0))?))?;
    bench.run(0.5)?;
    is(&mut bench, State::NotReadyToSwitchOn)?;
    expect("2302h:4 without a supply", bench.number(NODE, 0x2302, 4)?, NO_ANSWER)?;
    // Below the lock-out.
    supply(&mut bench, 7.0)?;
    bench.run(0.1)?;
    is(&mut bench, State::NotReadyToSwitchOn)?;
    expect("2302h below the lock-out", told(&mut bench)?, (words(fault::UNDER_VOLTAGE), 0, FAULT))?;
    supply(&mut bench, SUPPLY)?;
    bench.run(0.1)?;
    is(&mut bench, State::SwitchOnDisabled)?;
    expect("2302h with it", told(&mut bench)?, ([0; 2], 0, COMPLETE))?;
    expect("603Fh with it", bench.number(NODE, 0x603F, 0)?, 0)?;
    expect("resets of the chip", bench.emulation.resets().len(), 0)
}

fn other_boards() -> Result<(), Failed> {
    let program = built()?;
    type Prepare = fn(&mut MoteusR4);
    let boards: [(Prepare, u8); 5] = [
        (|board| board.set_revision(3), 3),
        (|board| board.set_revision(5), 5),
        (|board| board.set_revision(0), 0),
        (|board| board.set_family([Some(false), None]), OTHER_FAMILY | SUPPORTED),
        (|board| board.set_family([None, Some(true)]), OTHER_FAMILY | SUPPORTED),
    ];
    for (prepare, code) in boards {
        let mut bench = started(&program, |board| {
            prepare(board);
            Ok(())
        })?;
        bench.run(0.3)?;
        expect("2302h", told(&mut bench)?, ([0; 2], 0, WRONG_BOARD))?;
        expect("2302h:5", bench.number(NODE, 0x2302, 5)?, u32::from(code))?;
        bench.expect("nothing is driven")?;
        // Any frame that is asked for.
        send(&mut bench.emulation, 0x000, &[0x01, NODE])?;
        for word in [SHUTDOWN, 0x07, 0x0F] {
            send(&mut bench.emulation, 0x300 + u16::from(NODE), &[word as u8, 0, 9, 0, 0, 0, 0])?;
            bench.run(0.01)?;
        }
        is(&mut bench, State::NotReadyToSwitchOn)?;
        let now = bench.emulation.now();
        expect("the driver's enable", bench.board().driver().is_awake(now), false)?;
        let drivetrain = bench.board().drivetrain();
        expect("the bridge", (drivetrain.is_switching(), drivetrain.off_since()), (false, None))?;
        expect("resets of the chip", bench.emulation.resets().len(), 0)?;
    }
    let mut bench = started(&program, |_| Ok(()))?;
    bench.run(SHORT)?;
    expect("2302h:5 of the right one", bench.number(NODE, 0x2302, 5)?, u32::from(SUPPORTED))
}

fn options<W: Observed>(board: fn(Drivetrain) -> W) -> Result<(), Failed> {
    let program = program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    let mut moving = Moving::start(board, &actuator(), &program, &SampleImage::constant(1, 0.1))?;
    let found = moving.bench.number(NODE, 0x2303, 1)?;
    let needed = moving.bench.number(NODE, 0x2303, 2)?;
    expect("2303h:2", needed, found & !(SRAM_PE | N_SWBOOT0))?;
    expect("2303h:3", moving.bench.number(NODE, 0x2303, 3)?, 0b011)?;
    moving.bench.expect("option bytes 0x")?;
    // Not while it moves, not by another command.
    let refused = |bench: &mut Bench<W>, command: u32| bench.download(NODE, 0x2303, 4, &command.to_le_bytes()).is_err();
    expect("refused in motion", refused(&mut moving.bench, COMMAND), true)?;
    moving.controlword = Some(0);
    moving.run(SHORT)?;
    expect("refused", refused(&mut moving.bench, COMMAND + 1), true)?;
    expect("2303h:1 after that", moving.bench.number(NODE, 0x2303, 1)?, found)?;
    let bench = &mut moving.bench;
    bench.download(NODE, 0x2303, 4, &COMMAND.to_le_bytes())?;
    bench.booted(NODE)?;
    expect("resets", bench.emulation.resets().iter().map(|(_, origin)| *origin).collect(), vec![Origin::Chip])?;
    expect("2303h:1 after the reset", bench.number(NODE, 0x2303, 1)?, needed)?;
    expect("2303h:3 after the reset", bench.number(NODE, 0x2303, 3)?, 0)?;
    expect("2301h:1", bench.number(NODE, 0x2301, 1)? & 1, 1)?;
    // And after a loss of power.
    bench.restart(NODE)?;
    expect("2303h:1 after a loss of power", bench.number(NODE, 0x2303, 1)?, needed)
}
