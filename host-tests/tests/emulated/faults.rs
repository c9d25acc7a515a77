//! Faults while the flashed program moves the joint on the emulated board: the bridge is off in time, and the reason
//! can be read.
//!
//! Times run from the instant at which the part breaks to the one at which the plant sees the last gate off. How long
//! that may take and what is to be read stands in the table of docs/emulated-board.md, which the tests read. Each fault
//! is brought in at several instants, anywhere in a control period, drawn by a fixed seed; the worst counts.

use emulator::board::{BG431BEsc1, Drivetrain, Inputs, MoteusR4, Wired};
use emulator::chip::time::Instant;
use emulator::cpu::{End, Watch};
use emulator::program::Program;
use host_tests::emulated::Bench;
use host_tests::emulated::bench::{SUPPLY, actuator, faults_in, program};
use host_tests::emulated::motion::{Moving, NODE, SET_POINT};
use host_tests::emulated::observed::Observed;
use joint_firmware::joint::fault::Fault as JointFault;
use joint_firmware::reset_record::LastReset;
use libtest_mimic::{Failed, Trial};
use node::SampleImage;
use plant::actuator::{Channel, Failure, Fault, Phase};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Document in which the limits stand.
const DOCUMENT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/emulated-board.md");
/// Instants at which a fault is brought in.
const INSTANTS: usize = 6;
/// The joint is at least so fast then, rad/s: what stands still shows little of what is broken.
const MOVING: f64 = 0.8;
/// Duration of the disturbance of the bus, s.
const DISTURBED: f64 = 0.4;
/// Factors of the supply: what it rises to, what it falls to, and what is left of it where it is lost; the chip's
/// regulators need more.
const SURGE: f64 = 2.2;
const SAG: f64 = 0.3;
const LOST: f64 = 0.1;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    vec![
        Trial::test("moteus_r4_switches_off_in_time_and_says_why", || switches_off(MoteusR4::new, &MOTEUS)),
        Trial::test("b_g431b_esc1_switches_off_in_time_and_says_why", || switches_off(BG431BEsc1::new, &ESC1)),
    ]
}

/// A row of the document's table.
struct Documented {
    /// Time from the fault until the bridge is off, s.
    within: f64,
    /// Error codes, of which one is to be read over the bus.
    codes: Vec<u16>,
    /// Lines that the log is to have.
    log: Vec<String>,
    /// Cause of the chip's reset, as object 2301h:1 is to say.
    reset: Option<&'static Cause>,
}

/// A cause of a reset: its name in the table, its bit of object 2301h:1.
type Cause = (&'static str, u8);

const CAUSES: [Cause; 2] = [("power", LastReset::POWER), ("watchdog", LastReset::WATCHDOG)];

/// The row of a fault.
fn documented(board: &str, fault: &str) -> Result<Documented, Failed> {
    let document = std::fs::read_to_string(DOCUMENT)?;
    let mut row = document.lines().filter_map(|line| {
        let cells: Vec<&str> = line.strip_prefix("| ")?.strip_suffix(" |")?.split(" | ").collect();
        let [of, what, within, _, reason] = cells.as_slice() else { return None };
        (*of == board && *what == fault).then_some((within.trim(), reason.trim()))
    });
    let (within, reason) =
        row.next_back().ok_or_else(|| format!("docs/emulated-board.md has no row for {board}, {fault}"))?;
    let words = reason.split([' ', ',']);
    Ok(Documented {
        within: within.parse::<f64>().map_or(0.0, |milliseconds| 1e-3 * milliseconds),
        codes: words.filter_map(|word| u16::from_str_radix(word.strip_suffix('h')?, 16).ok()).collect(),
        log: reason.split('`').skip(1).step_by(2).map(str::to_owned).collect(),
        reset: CAUSES.iter().find(|(name, _)| reason.ends_with(&format!("2301h:1 {name}"))),
    })
}

/// Brings a fault in; the instant from which on it is there.
type Bring<W> = fn(&mut Moving<W>, &Program) -> Result<Instant, Failed>;

/// A fault, and how it is brought in: the instant from which on it is there.
struct Broken<W: Wired> {
    name: &'static str,
    bring: Bring<W>,
    /// Number of times that it is brought in.
    instants: usize,
    /// Time from the fault to the last of what the joint has to say of it, s.
    afterwards: f64,
}

/// Brought in at every instant; what there is to say is said at once.
const fn broken<W: Wired>(name: &'static str, bring: Bring<W>) -> Broken<W> {
    Broken { name, bring, instants: INSTANTS, afterwards: 0.05 }
}

fn inject<W: Observed>(moving: &mut Moving<W>, fault: Fault) -> Result<Instant, Failed> {
    moving.bench.board().drivetrain().actuator_mut().inject(fault)?;
    Ok(moving.now())
}

/// Fault on the board: no sensor, no lead, no supply.
fn on_the_board<W: Observed>(moving: &mut Moving<W>, breaks: fn(&mut Inputs)) -> Result<Instant, Failed> {
    breaks(moving.bench.board().inputs());
    Ok(moving.now())
}

/// The source takes another voltage; from the instant on at which the supply is beyond the configuration's limits.
fn supply<W: Observed>(moving: &mut Moving<W>, part: f64) -> Result<Instant, Failed> {
    inject(moving, Fault::SourceVoltage(part * SUPPLY))?;
    let (lowest, highest) = moving.configuration.limits.bus_voltage;
    for _ in 0..100_000 {
        let voltage = moving.bench.board().drivetrain().actuator().state().bus_voltage as f32;
        if voltage < lowest || voltage > highest {
            return Ok(moving.now());
        }
        moving.bench.run(2e-6)?;
    }
    Err("the supply stays within its limits".into())
}

/// The supply is gone, and with it the chip's, at once; it comes back later.
fn lose_supply<W: Observed>(moving: &mut Moving<W>) -> Result<Instant, Failed> {
    let lost = inject(moving, Fault::SourceVoltage(LOST * SUPPLY))?;
    moving.bench.emulation.power_down();
    moving.bench.board().drivetrain().actuator_mut().clear_faults();
    moving.bench.emulation.power_up();
    Ok(lost)
}

/// Disturbs the bus: nobody's frame comes through.
fn disturb<W: Observed>(moving: &mut Moving<W>) -> Instant {
    let now = moving.now();
    moving.bench.board().line().disturb(Instant(now.0 + (DISTURBED * 1e12) as u64));
    now
}

/// An instruction that branches to itself, where the program has none: the flash before its parameters is empty.
fn trap<W: Wired>(bench: &mut Bench<W>, program: &Program) -> Result<u32, Failed> {
    let place = program.symbol("__parameters_start").ok_or("the program names no parameters")?.address - 8;
    match bench.emulation.cpu.bus.program(place, &[0xfe, 0xe7]) {
        true => Ok(place),
        false => Err("the flash ends before the parameters".into()),
    }
}

/// The executor of the interrupt never comes back, and with it none that is less urgent.
fn stall_interrupt_executor<W: Wired>(bench: &mut Bench<W>, program: &Program) -> Result<Instant, Failed> {
    let place = trap(bench, program)?;
    let executor = program.symbol("CRS").ok_or("the program has no executor in an interrupt")?;
    let end = Instant(bench.emulation.now().0 + 50_000_000_000);
    bench.emulation.cpu.set_watch(Some(Watch::new().stop_at(executor.address)));
    match bench.emulation.run_until(end) {
        Some(End::Reached { .. }) => {}
        other => return Err(format!("the executor does not run: {other:?}").into()),
    }
    bench.emulation.cpu.set_watch(None);
    bench.emulation.cpu.set_register(15, place);
    Ok(bench.emulation.now())
}

/// The main loop never comes back.
fn stall_main_loop<W: Wired>(bench: &mut Bench<W>, program: &Program) -> Result<Instant, Failed> {
    let place = trap(bench, program)?;
    let core = &mut bench.emulation.cpu;
    while core.exception() != 0 {
        if let Some(end) = core.step() {
            return Err(end.to_string().into());
        }
    }
    core.set_register(15, place);
    Ok(bench.emulation.now())
}

const MOTEUS: [Broken<MoteusR4>; 15] = [
    broken("motor lead open", |m, _| inject(m, Fault::PhaseOpen(Phase::B))),
    broken("low side shorted", |m, _| inject(m, Fault::PhaseShorted(Phase::B))),
    broken("current sensor off by 10 A", |m, _| inject(m, Fault::Sensor(Channel::CurrentA, Failure::Offset(10.0)))),
    broken("encoder's line stuck low", |m, _| on_the_board(m, |inputs| inputs.encoder_line = Some(false))),
    broken("encoder silent", |m, _| on_the_board(m, |inputs| inputs.encoder_line = Some(true))),
    broken("encoder stuck", |m, _| inject(m, Fault::Sensor(Channel::Encoder, Failure::Stuck))),
    broken("bridge's thermistor open", |m, _| on_the_board(m, |inputs| inputs.thermistor_open = true)),
    broken("gate driver's fault line", |m, _| on_the_board(m, |inputs| inputs.driver_fault = true)),
    broken("supply too high", |m, _| supply(m, SURGE)),
    broken("supply sags", |m, _| supply(m, SAG)),
    broken("supply lost", |m, _| lose_supply(m)),
    Broken { afterwards: DISTURBED + 0.25, instants: 2, ..broken("bus disturbed", |m, _| Ok(disturb(m))) },
    broken("set-points end", |m, _| {
        m.silent = true;
        Ok(m.now())
    }),
    broken("interrupt executor stands still", |m, program| stall_interrupt_executor(&mut m.bench, program)),
    Broken { instants: 1, ..broken("main loop stands still", |m, program| stall_main_loop(&mut m.bench, program)) },
];

/// A line of the log comes every second.
const LOGGED: f64 = 1.3;

const ESC1: [Broken<BG431BEsc1>; 12] = [
    broken("motor lead open", |m, _| inject(m, Fault::PhaseOpen(Phase::B))),
    broken("low side shorted", |m, _| inject(m, Fault::PhaseShorted(Phase::B))),
    Broken {
        afterwards: LOGGED,
        ..broken("current sensor off by 10 A", |m, _| {
            inject(m, Fault::Sensor(Channel::CurrentA, Failure::Offset(10.0)))
        })
    },
    broken("encoder's lines stay as they are", |m, _| on_the_board(m, |inputs| inputs.encoder_line = Some(false))),
    Broken {
        afterwards: LOGGED,
        ..broken("bridge's thermistor open", |m, _| on_the_board(m, |inputs| inputs.thermistor_open = true))
    },
    Broken { afterwards: LOGGED, ..broken("supply too high", |m, _| supply(m, SURGE)) },
    Broken { afterwards: LOGGED, ..broken("supply sags", |m, _| supply(m, SAG)) },
    Broken { afterwards: LOGGED, ..broken("supply lost", |m, _| lose_supply(m)) },
    Broken { afterwards: DISTURBED + 0.25, instants: 2, ..broken("bus disturbed", |m, _| Ok(disturb(m))) },
    broken("set-points end", |m, _| {
        m.silent = true;
        Ok(m.now())
    }),
    Broken {
        afterwards: LOGGED,
        ..broken("interrupt executor stands still", |m, program| stall_interrupt_executor(&mut m.bench, program))
    },
    Broken { instants: 1, ..broken("main loop stands still", |m, program| stall_main_loop(&mut m.bench, program)) },
];

fn switches_off<W: Observed + Clone>(board: fn(Drivetrain) -> W, faults: &[Broken<W>]) -> Result<(), Failed> {
    let program = program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    let image = SampleImage::constant(1, 0.1);
    let mut moving = Moving::start(board, &actuator(), &program, &image)?;
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut moments = Vec::new();
    for _ in 0..20 * INSTANTS {
        if moments.len() == INSTANTS {
            break;
        }
        moving.run(f64::from(random.random_range(2..12)) * SET_POINT)?;
        let mut moment = moving.clone();
        moment.bench.run(random.random_range(0.0..SET_POINT))?;
        if moment.bench.board().drivetrain().actuator().state().joint.velocity.abs() > MOVING {
            moments.push(moment);
        }
    }
    if moments.len() < INSTANTS {
        return Err(format!("the joint hardly moves:\n{}", moving.bench.log()).into());
    }
    let mut bad = Vec::new();
    for broken in faults {
        let limits = documented(W::NAME, broken.name)?;
        let (mut times, mut reasons) = (Vec::new(), Vec::new());
        for moment in moments.iter().take(broken.instants) {
            match broken.happens(moment.clone(), &program, &limits) {
                Ok((time, reason)) => {
                    times.push(1e3 * time);
                    if !reasons.contains(&reason) {
                        reasons.push(reason);
                    }
                }
                Err(error) => {
                    let error = format!("{}: {}", broken.name, error.message().unwrap_or_default());
                    println!("bad: {error}");
                    bad.push(error);
                }
            }
        }
        let (least, most) = times.iter().fold((f64::MAX, 0.0f64), |(least, most), t| (least.min(*t), most.max(*t)));
        let within = 1e3 * limits.within;
        println!("| {} | {} | {within:.2} | {least:.3} to {most:.3} | {} |", W::NAME, broken.name, reasons.join("; "));
    }
    if bad.is_empty() { Ok(()) } else { Err(bad.join("\n").into()) }
}

impl<W: Observed> Broken<W> {
    /// Time after which the bridge was off, and what is to be read of it.
    fn happens(&self, mut moving: Moving<W>, program: &Program, limits: &Documented) -> Result<(f64, String), Failed> {
        let said = moving.bench.log().len();
        let from = (self.bring)(&mut moving, program)?;
        let time = moving.until_off(from, limits.within + 0.1)?.ok_or("the bridge is still on")?;
        let resets = moving.bench.emulation.resets().len();
        let rest = self.afterwards - (moving.now().0 - from.0) as f64 * 1e-12;
        moving.run(rest.max(0.05))?;
        if moving.bench.board().drivetrain().is_switching() {
            return Err("the bridge is on again".into());
        }
        let log = moving.bench.log().split_off(said);
        let code = u16::from_le_bytes(*moving.bench.upload(NODE, 0x603F, 0)?.first_chunk().ok_or("603Fh is short")?);
        let mut reason = String::new();
        if !limits.codes.is_empty() {
            let history = error_history(&mut moving.bench)?;
            let sent = moving.emergencies();
            // A reset is over, and no fault of the joint.
            let code = if resets == 0 { code } else { sent.last().copied().unwrap_or_default() };
            if !limits.codes.contains(&code) || !sent.contains(&code) || !history.contains(&code) {
                return Err(format!("603Fh is {code:04X}h, 1003h {history:04X?}, EMCYs {sent:04X?}").into());
            }
            reason = format!("{code:04X}h");
        }
        if let Some((name, bit)) = limits.reset {
            let causes = moving.bench.upload(NODE, 0x2301, 1)?;
            match causes[..] {
                [causes] if causes & bit != 0 => reason = format!("{reason} 2301h:1 {name}"),
                _ => return Err(format!("2301h:1 is {causes:02X?}, without {name}").into()),
            }
        }
        for text in &limits.log {
            let fault = JointFault::ALL.into_iter().find(|fault| fault.to_string() == *text);
            let told = fault.map(|fault| faults_in(&log) >> (fault as u32 - 1) & 1 == 1);
            if !told.unwrap_or_else(|| log.contains(text)) {
                return Err(format!("the log does not say \"{text}\", but:\n{log}").into());
            }
            reason = format!("{reason}`{text}`");
        }
        if resets > 1 || time > limits.within {
            return Err(format!("off after {:.3} ms, {resets} resets, {reason}", 1e3 * time).into());
        }
        Ok((time, reason))
    }
}

/// Codes in object 1003h, newest first.
fn error_history<W: Observed>(bench: &mut Bench<W>) -> Result<Vec<u16>, Failed> {
    let length = bench.upload(NODE, 0x1003, 0)?.first().copied().unwrap_or(0);
    let code = |number| {
        let entry = bench.upload(NODE, 0x1003, number)?;
        Ok(u16::from_le_bytes(*entry.first_chunk().ok_or("an entry of 1003h is short")?))
    };
    (1..=length).map(code).collect()
}
