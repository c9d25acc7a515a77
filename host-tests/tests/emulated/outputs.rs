//! The boards' outputs, by their programs on the emulated boards: a holding brake opens before the joint follows and
//! closes before the bridge is off, and a chopper conducts while the supply is too high and its resistor bears it.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4, Wired as _};
use host_tests::emulated::bench::{SUPPLY, actuator, program};
use host_tests::emulated::motion::{Moving, NODE, SET_POINT};
use host_tests::emulated::observed::Observed;
use host_tests::on_each_board;
use libtest_mimic::{Failed, Trial};
use node::SampleImage;
use plant::actuator::Fault;

/// Times of the brake, s.
const RELEASE: f32 = 0.1;
const APPLY: f32 = 0.05;
/// Object 2100h:1: take what is staged.
const TAKE: u8 = 1;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    let mut trials = vec![
        Trial::test("moteus_r4_lets_a_brake_chopper_conduct", chopper),
        Trial::test("b_g431b_esc1_refuses_a_brake_chopper", no_chopper),
    ];
    trials.extend(on_each_board!("opens_and_closes_a_holding_brake", brake));
    trials
}

fn moving<W: Observed>(board: impl FnOnce(Drivetrain) -> W) -> Result<Moving<W>, Failed> {
    let program = program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    Moving::start(board, &actuator(), &program, &SampleImage::constant(1, 0.1))
}

fn outputs<W: Observed>(moving: &mut Moving<W>) -> (bool, bool) {
    moving.bench.board().drivetrain().outputs()
}

fn switches<W: Observed>(moving: &mut Moving<W>) -> bool {
    moving.bench.board().drivetrain().is_switching()
}

fn expect(what: &str, holds: bool) -> Result<(), Failed> {
    if holds { Ok(()) } else { Err(what.into()) }
}

/// Set-points until something is so; their number.
fn until<W: Observed>(moving: &mut Moving<W>, is: impl Fn(&mut Moving<W>) -> bool) -> Result<u32, Failed> {
    for number in 0..200 {
        if is(moving) {
            return Ok(number);
        }
        moving.run(SET_POINT)?;
    }
    Err("that did not happen in time".into())
}

fn brake<W: Observed>(board: impl FnOnce(Drivetrain) -> W) -> Result<(), Failed> {
    let mut moving = moving(board)?;
    expect("a joint in motion has its brake open", outputs(&mut moving).0 && switches(&mut moving))?;
    expect("60FEh says so", moving.bench.number(NODE, 0x60FE, 1)? == 0)?;
    moving.controlword = Some(0);
    moving.run(2.0 * SET_POINT)?;
    expect("a joint that is off has it closed", !outputs(&mut moving).0 && !switches(&mut moving))?;
    expect("60FEh says so, too", moving.bench.number(NODE, 0x60FE, 1)? == 1)?;

    for (sub_index, time) in [(1, RELEASE), (2, APPLY)] {
        moving.bench.download(NODE, 0x2109, sub_index, &time.to_le_bytes())?;
    }
    moving.bench.download(NODE, 0x2100, 1, &[TAKE])?;
    moving.bench.download(NODE, 0x605C, 0, &1u16.to_le_bytes())?;
    for word in [0x06, 0x07] {
        moving.controlword = Some(word);
        moving.run(2.0 * SET_POINT)?;
    }
    moving.controlword = Some(0x0F);
    until(&mut moving, |moving| outputs(moving).0)?;
    expect("the bridge is on while the brake opens", switches(&mut moving))?;
    let at = moving.bench.board().drivetrain().actuator().state().joint.position;
    moving.run(0.8 * f64::from(RELEASE))?;
    let way = moving.bench.board().drivetrain().actuator().state().joint.position - at;
    expect(&format!("it goes on by {way} rad while its brake opens"), way.abs() < 0.02)?;
    moving.run(0.3)?;
    let way = moving.bench.board().drivetrain().actuator().state().joint.position - at;
    expect("it moves once the brake is open", way.abs() > 0.05)?;

    moving.controlword = Some(0x07);
    until(&mut moving, |moving| !outputs(moving).0)?;
    expect("the bridge is on while the brake closes", switches(&mut moving))?;
    let closing = f64::from(until(&mut moving, |moving| !switches(moving))?) * SET_POINT;
    expect(
        &format!("the bridge is off {closing} s after the brake began to close"),
        (closing - f64::from(APPLY)).abs() <= 2.0 * SET_POINT,
    )
}

/// Stages two settings of the chopper and has them taken; the abort, if there is one.
fn configure<W: Observed>(moving: &mut Moving<W>, voltage: f32, share: f32) -> Result<(), Failed> {
    moving.controlword = Some(0);
    moving.run(2.0 * SET_POINT)?;
    moving.bench.download(NODE, 0x2103, 14, &voltage.to_le_bytes())?;
    moving.bench.download(NODE, 0x2103, 15, &share.to_le_bytes())?;
    moving.bench.download(NODE, 0x2100, 1, &[TAKE])
}

fn chopper() -> Result<(), Failed> {
    let mut moving = moving(MoteusR4::new)?;
    let voltage = 1.05 * SUPPLY as f32;
    configure(&mut moving, voltage, 0.01)?;
    let supply = |moving: &mut Moving<MoteusR4>, voltage: f64| -> Result<(), Failed> {
        let actuator = moving.bench.board().drivetrain().actuator_mut();
        actuator.clear_faults();
        Ok(actuator.inject(Fault::SourceVoltage(voltage))?)
    };
    expect("it conducts at the supply's own voltage", !outputs(&mut moving).1)?;
    supply(&mut moving, 1.03 * f64::from(voltage))?;
    moving.run(2.0 * SET_POINT)?;
    expect("it does not conduct above its voltage", outputs(&mut moving).1)?;
    expect("60FEh says so", moving.bench.number(NODE, 0x60FE, 1)? == 1 << 16 | 1)?;
    // 1 % of 10 s, and then that part of the time.
    moving.run(0.15)?;
    expect("it conducts for longer than its resistor bears", !outputs(&mut moving).1)?;
    supply(&mut moving, SUPPLY)?;
    moving.run(2.0 * SET_POINT)?;
    expect("it conducts at the supply's own voltage again", !outputs(&mut moving).1)
}

fn no_chopper() -> Result<(), Failed> {
    let mut moving = moving(BG431BEsc1::new)?;
    expect("a voltage without an output is taken", configure(&mut moving, 1.05 * SUPPLY as f32, 0.5).is_err())?;
    moving.bench.download(NODE, 0x2100, 1, &[2])?;
    configure(&mut moving, 0.0, 0.5)
}
