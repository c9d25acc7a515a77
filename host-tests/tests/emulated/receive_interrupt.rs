//! Cycles of the receive interrupt with a set-point: the time between a frame and the control step that knows it.
//!
//! The control interrupt preempts it and takes up to six tenths of the core on the moteus r4, so that it lasts two and
//! a half times as long: 3,300 cycles are 49 us there, nearly two control periods. A quarter of them come behind the
//! demand.

use emulator::board::Drivetrain;
use friction_compensation::compensation::Request;
use host_tests::emulated::Bench;
use host_tests::emulated::bench::{actuator, program};
use host_tests::emulated::kept::{Kept, configuration};
use host_tests::emulated::master::send;
use host_tests::emulated::observed::Observed;
use host_tests::on_each_board;
use libtest_mimic::{Failed, Trial};

const NODE: u8 = 5;
/// Exception of the receive interrupt, FDCAN1_IT0: interrupt 21 of both chips.
const RECEIVE: u16 = 16 + 21;
/// Period of set-points, s, and their number.
const SET_POINT: f64 = 0.001;
const SET_POINTS: i32 = 50;
/// 60C2h, ms: set-points are interpolated.
const PERIOD: u8 = 10;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    on_each_board!("keeps_the_cycles_of_its_receive_interrupt", keeps_cycles).into()
}

/// A set-point of cyclic synchronous velocity mode, mrad/s, and the time until the next.
fn commanded<W: Observed>(bench: &mut Bench<W>, controlword: u16, velocity: i32) -> Result<(), Failed> {
    let mut frame = controlword.to_le_bytes().to_vec();
    frame.push(9);
    frame.extend(velocity.to_le_bytes());
    send(&mut bench.emulation, 0x300 + u16::from(NODE), &frame)?;
    bench.run(SET_POINT)
}

fn keeps_cycles<W: Observed>(board: fn(Drivetrain) -> W) -> Result<(), Failed> {
    let limit = W::RECEIVE_CYCLES;
    let program = program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    let configuration = configuration::<W>(&actuator(), NODE, Request::Off);
    let mut bench = Bench::with(board, &actuator(), &program)?;
    Kept { configuration: &configuration, image: &[] }.write(&mut bench.emulation, &program)?;
    bench.booted(NODE)?;
    if W::INDEX {
        bench.turn_by_hand(|_| Ok(()))?;
    }
    if bench.number(NODE, 0x6502, 0)? & 1 != 0 {
        bench.download(NODE, 0x60C2, 1, &[PERIOD])?;
    }
    send(&mut bench.emulation, 0x000, &[0x01, NODE])?;
    // The joint measures its currents' zeros first.
    for (controlword, times) in [(0x06, 150), (0x07, 20), (0x0F, 20)] {
        for _ in 0..times {
            commanded(&mut bench, controlword, 0)?;
        }
    }
    bench.emulation.cpu.clear_exception_times();
    for number in 1..=SET_POINTS {
        commanded(&mut bench, 0x0F, 10 * number)?;
    }
    let times = *bench.emulation.cpu.exception_times().get(&RECEIVE).ok_or("no receive interrupt")?;
    println!(
        "{}: the receive interrupt takes {} cycles at least, {} at most, {} times",
        W::NAME,
        times.least,
        times.most,
        times.count
    );
    if times.count < SET_POINTS as u64 || !bench.board().drivetrain().is_switching() {
        return Err(format!("{} receive interrupts, or the bridge is off:\n{}", times.count, bench.log()).into());
    }
    if times.most > limit {
        return Err(format!("the receive interrupt takes {} cycles, {limit} are permitted", times.most).into());
    }
    Ok(())
}
