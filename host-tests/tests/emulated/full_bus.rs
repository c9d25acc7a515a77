//! A bus without a gap: the control steps of a joint in motion begin on time, whatever comes, and the stack suffices.
//!
//! Others fill the bus with frames that the node has to look at. Of those that it need not, its filters keep the
//! receive interrupt free.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4, Wired};
use emulator::chip::fdcan::line::CanFrame;
use emulator::chip::time::Instant;
use emulator::emulation::Emulation;
use friction_compensation::compensation::Request;
use host_tests::emulated::Bench;
use host_tests::emulated::bench::{actuator, program};
use host_tests::emulated::kept::{Kept, configuration};
use host_tests::emulated::master::{Heard, heard, send};
use host_tests::emulated::observed::Observed;
use host_tests::emulated::stack::PaintedStack;
use libtest_mimic::{Failed, Trial};
use node::SampleImage;
use std::f64::consts::TAU;

const NODE: u8 = 5;
/// Period of set-points, s.
const SET_POINT: f64 = 0.001;
/// Reversals of the joint per second: it keeps up, and its current crosses zero often.
const REVERSALS: f64 = 5.0;
/// Duration of each load, in set-points.
const LASTS: u32 = 200;
/// Duration of each flood, in set-points: longer than the watchdog's time-out.
const FLOODED: u32 = 300;
/// Part of the core that is left to the tasks.
const LEFT: f64 = 0.05;
/// Permitted deviation of a control step's begin from a period after the one before, ps: 1 us.
const JITTER: u64 = 1_000_000;
/// The bus is full: part of the time that frames and what is between them take.
const FULL: f64 = 0.99;
/// Bits between frames.
const INTERMISSION: u64 = 3;
/// Bytes of stack that nothing has touched: an exception's frame, twice.
const MARGIN: u32 = 2 * 104;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    vec![
        Trial::test("a_full_bus_moves_no_control_step_of_moteus_r4", || on_time(MoteusR4::NAME, MoteusR4::new)),
        Trial::test("a_full_bus_moves_no_control_step_of_b_g431b_esc1", || on_time("b-g431b-esc1", BG431BEsc1::new)),
    ]
}

/// Frames that others send in the time of a set-point, besides it.
type Load = (&'static str, fn(u32) -> Vec<Heard>);

const LOADS: [Load; 3] = [
    ("nothing else", |_| Vec::new()),
    ("SYNC, SDO requests, others' heartbeats and PDOs", |number| {
        let mut frames = vec![(0x080, Vec::new()), (0x600 + u16::from(NODE), vec![0x40, 0x41, 0x60, 0, 0, 0, 0, 0])];
        frames.extend([0x189, 0x289, 0x389, 0x489].map(|other| (other, number.to_le_bytes().repeat(2))));
        frames.extend([(0x77E, vec![5]), (0x77F, vec![5])]);
        frames
    }),
    ("set-points of its own alone", |_| vec![(0x300 + u16::from(NODE), set_point(0x0F, 0.5)); 9]),
];

/// The frames of a flood, by their number.
type Flood = (&'static str, fn(u32) -> Heard);

/// Frames so short and so many that they leave nothing of the bus to anybody whose identifier is higher. Set-points may
/// starve: the joint stops then.
const FLOODS: [Flood; 6] = [
    ("SYNC", |_| (0x080, Vec::new())),
    ("NMT commands that change nothing", |_| (0x000, vec![1, NODE])),
    ("NMT commands that stop and start", |number| (0x000, vec![1 + (number % 2) as u8, NODE])),
    ("RPDOs that are too short", |_| (0x300 + u16::from(NODE), Vec::new())),
    ("SDO requests that are too short", |_| (0x600 + u16::from(NODE), Vec::new())),
    ("LSS requests that are too short", |_| (0x7E5, Vec::new())),
];

/// Controlword, mode and velocity, rad/s.
fn set_point(controlword: u16, velocity: f64) -> Vec<u8> {
    let mut frame = controlword.to_le_bytes().to_vec();
    frame.push(9);
    frame.extend(((1e3 * velocity) as i32).to_le_bytes());
    frame
}

/// The control steps under a load.
#[derive(Default)]
struct Steps {
    before: Option<Instant>,
    count: u64,
    /// Time from one to the next, ps: least and most.
    gap: Option<(u64, u64)>,
}

impl Steps {
    fn note(&mut self, now: Instant) {
        if let Some(before) = self.before.replace(now) {
            let gap = now.0 - before.0;
            let (least, most) = self.gap.unwrap_or((gap, gap));
            self.gap = Some((least.min(gap), most.max(gap)));
            self.count += 1;
        }
    }
}

fn on_time<W: Observed>(name: &str, board: fn(Drivetrain) -> W) -> Result<(), Failed> {
    let program = program(name, env!("CARGO_TARGET_TMPDIR"))?;
    let configuration = configuration::<W>(&actuator(), NODE, Request::PhysicalAndNetwork);
    let mut bench = Bench::with(board, &actuator(), &program)?;
    let stack = PaintedStack::new(&mut bench.emulation, &program)?;
    Kept { configuration: &configuration, image: &SampleImage::constant(1, 0.1) }
        .write(&mut bench.emulation, &program)?;
    bench.booted(NODE)?;
    if W::INDEX {
        bench.turn_by_hand(|_| Ok(()))?;
    }
    send(&mut bench.emulation, 0x000, &[0x01, NODE])?;
    bench.download(NODE, 0x1017, 0, &10u16.to_le_bytes())?;
    // The joint measures its currents' zeros first.
    for (controlword, times) in [(0x06, 150), (0x07, 20), (0x0F, 100)] {
        for _ in 0..times {
            send(&mut bench.emulation, 0x300 + u16::from(NODE), &set_point(controlword, 0.0))?;
            bench.run(SET_POINT)?;
        }
    }
    bench.stop_at_control_steps(&program)?;
    let period = (1e12 / f64::from(W::CONFIGURATION.bridge.rate)) as u64;
    let mut bad = Vec::new();
    for (load, frames) in LOADS {
        let (steps, part) = under(&mut bench, frames)
            .map_err(|error| format!("{load}: {}\n{}", error.message().unwrap_or_default(), bench.log()))?;
        let (least, most) = steps.gap.ok_or("no control steps")?;
        let jitter = (period - least.min(period)).max(most.saturating_sub(period));
        println!(
            "{name}, {load}: bus {:.1} % full, {} control steps, {:.3} us at most from where they belong",
            100.0 * part,
            steps.count,
            jitter as f64 * 1e-6
        );
        let expected = u64::from(LASTS) * (SET_POINT * f64::from(W::CONFIGURATION.bridge.rate)) as u64;
        if jitter > JITTER || steps.count + 2 < expected {
            bad.push(format!("{load}: {} control steps, {jitter} ps from where they belong", steps.count));
        }
        if load != LOADS[0].0 && part < FULL {
            bad.push(format!("{load}: the bus is only {part} full"));
        }
        let faulty = !bench.board().drivetrain().is_switching() || bench.faults() != 0;
        if faulty || !bench.emulation.resets().is_empty() {
            bad.push(format!("{load}: {:?}\n{}", bench.emulation.resets(), bench.log()));
        }
    }
    for (flood, frame) in FLOODS {
        let (frames, left) = withstands(&mut bench, frame, period)
            .map_err(|error| format!("{flood}: {}\n{}", error.message().unwrap_or_default(), bench.log()))?;
        println!(
            "{name}, nothing but {flood}: {frames} frames in {FLOODED} ms leave {:.1} % of the core",
            100.0 * left
        );
        if left < LEFT {
            bad.push(format!("{flood}: {left} of the core is left"));
        }
    }
    let (used, region) = stack.used(&mut bench.emulation)?;
    println!("{name}: {used} of {region} B of stack used");
    if used + MARGIN > region {
        bad.push(format!("{used} of {region} B of stack used"));
    }
    if bad.is_empty() { Ok(()) } else { Err(bad.join("\n").into()) }
}

/// Moves the joint to and fro under a load; its control steps, and which part of the time the bus was taken.
fn under<W: Observed>(bench: &mut Bench<W>, frames: fn(u32) -> Vec<Heard>) -> Result<(Steps, f64), Failed> {
    let (mut steps, mut bits) = (Steps::default(), 0);
    heard(&mut bench.emulation);
    let from = bench.emulation.now();
    for number in 0..LASTS {
        let velocity = (TAU * REVERSALS * f64::from(number) * SET_POINT).sin();
        let own = (0x300 + u16::from(NODE), set_point(0x0F, velocity));
        for (id, data) in frames(number).into_iter().chain([own]) {
            bits += put(bench, id, &data)?;
        }
        watch(bench, &mut steps)?;
        for (id, data) in heard(&mut bench.emulation) {
            bits += taken(id, &data)?;
        }
    }
    let microseconds = (bench.emulation.now().0 - from.0) as f64 * 1e-6;
    // Frames that still wait go before the next load.
    for _ in LASTS..LASTS + 50 {
        send(&mut bench.emulation, 0x300 + u16::from(NODE), &set_point(0x0F, 0.0))?;
        bench.run(SET_POINT)?;
    }
    Ok((steps, (bits as f64 / microseconds).min(1.0)))
}

/// The control steps go on under a flood, and the node is there after it; how many frames came, and which part of the
/// core no interrupt took.
fn withstands<W: Observed>(bench: &mut Bench<W>, frame: fn(u32) -> Heard, period: u64) -> Result<(u32, f64), Failed> {
    let (mut steps, mut number) = (Steps::default(), 0);
    let from = bench.emulation.cpu.now();
    bench.emulation.cpu.clear_exception_times();
    for _ in 0..FLOODED {
        let mut bits = 0;
        while bits < (1e6 * SET_POINT) as u64 {
            let (id, data) = frame(number);
            number += 1;
            bits += put(bench, id, &data)?;
        }
        watch(bench, &mut steps)?;
    }
    let cpu = &bench.emulation.cpu;
    let interrupts: u64 = cpu.exception_times().values().map(|times| times.own_cycles).sum();
    let left = 1.0 - interrupts as f64 / (cpu.now() - from) as f64;
    let (least, most) = steps.gap.ok_or("no control steps")?;
    if least + JITTER < period || most > period + JITTER {
        return Err(format!("control steps {least} to {most} ps apart").into());
    }
    if !bench.emulation.resets().is_empty() {
        return Err(format!("{:?}", bench.emulation.resets()).into());
    }
    send(&mut bench.emulation, 0x000, &[0x01, NODE])?;
    bench.run(10.0 * SET_POINT)?;
    heard(&mut bench.emulation);
    bench.number(NODE, 0x6041, 0)?;
    Ok((number, left))
}

/// Puts a frame on the bus; its bits.
fn put<W: Observed>(bench: &mut Bench<W>, id: u16, data: &[u8]) -> Result<u64, Failed> {
    send(&mut bench.emulation, id, data)?;
    taken(id, data)
}

/// The control steps of a set-point's time.
fn watch<W: Observed>(bench: &mut Bench<W>, steps: &mut Steps) -> Result<(), Failed> {
    bench.run_with(SET_POINT, |emulation: &mut Emulation<W>| {
        steps.note(emulation.now());
        Ok(())
    })
}

/// Bits of the bus, at 1 Mbit/s.
fn taken(id: u16, data: &[u8]) -> Result<u64, Failed> {
    Ok(CanFrame::standard(id.into(), data).ok_or("no such frame")?.bits() + INTERMISSION)
}
