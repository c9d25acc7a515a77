//! The control loop of the flashed programs on both emulated boards, in closed loop with the plant, is the host's: a
//! million control steps, the same bits in each.
//!
//! Random joints' friction models with networks and regimes, driven over the bus through reversals, beyond the trained
//! box and back, and into faults. See [`host_tests::emulated::twin`] for what is compared.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4};
use emulator::chip::Waiting;
use emulator::program::Program;
use emulator::variables::Variables;
use friction_compensation::compensation::Request;
use friction_compensation::friction::state::Signal;
use friction_compensation::parameters::image::Image;
use host_tests::bare_metal::build;
use host_tests::emulated::bench::{actuator, program};
use host_tests::emulated::kept::{Kept, configuration};
use host_tests::emulated::master::send;
use host_tests::emulated::motion::{MOTION, Moving, acting_image};
use host_tests::emulated::observed::Observed;
use host_tests::emulated::taken::{CONTROL, taken};
use host_tests::emulated::twin::Seen;
use host_tests::emulated::{Bench, Twin};
use host_tests::image_bytes::encoded;
use host_tests::on_each_board;
use host_tests::parameters;
use joint_firmware::joint::Active;
use joint_firmware::joint::configuration::Configuration;
use libtest_mimic::{Failed, Trial};
use plant::actuator::Fault;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Mutex;

/// Control steps that are compared at least.
const STEPS: u64 = 1_000_000;
/// Most cycles of a control interrupt, entry and return included, with faults, transitions and uploads among the steps:
/// the target of docs/budget.md.
const LONGEST: u64 = 2500;
/// Most cycles of the network from its inputs in Q31: the same.
const NETWORK: u64 = 330;
/// Joints that they are spread over, half of them on either board.
const JOINTS: u64 = 12;
/// The boards' programs.
const PROGRAMS: [&str; 2] = ["moteus-r4", "b-g431b-esc1"];
/// Period of set-points, s.
const SET_POINT: f64 = 0.005;
const NODE: u8 = 5;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    let mut trials = vec![Trial::test("every_control_step_of_the_flashed_programs_is_the_hosts", same_steps)];
    trials.extend(on_each_board!("in_motion_takes_the_cycles_that_are_published", published));
    trials
}

/// Longest control interrupt with the network acting: it takes what docs/budget.md says, and no more than the target
/// where that is called kept.
fn published<W: Observed + Clone>(board: fn(Drivetrain) -> W) -> Result<(), Failed> {
    let name = W::NAME;
    let path = build(name, env!("CARGO_TARGET_TMPDIR"))?;
    let program = Program::parse(std::fs::read(&path)?)?;
    let moving = Moving::start(board, &actuator(), &program, &acting_image::<W>())?;
    let variables = Variables::of(&program)?;
    for (waiting, wait_states) in
        [(Waiting::Never, "none"), (Waiting::Prefetched, "prefetched"), (Waiting::Always, "always")]
    {
        let taken = taken(moving.clone(), (&path, &program), &variables, waiting, MOTION)?;
        println!("{name}, wait states {wait_states}: {taken:?}");
        taken.check()?;
        let [[_, _, network], _] = taken.network;
        let of = [("interrupt", taken.interrupt.most, LONGEST), ("network", network, NETWORK)];
        for (what, most, target) in of {
            let (said, kept) = row(name, wait_states, what).ok_or("docs/budget.md has no such row")?;
            if kept && most > target || most.abs_diff(said) * 50 > said {
                let error = format!(
                    "{what}, wait states {wait_states}: {most} cycles, {said} are published, kept: {kept}; target {target}. Where that is meant, write \
                     docs/budget.md anew: `cargo bench -p host-tests --bench budget`"
                );
                return Err(error.into());
            }
        }
    }
    Ok(())
}

/// Most cycles of the interrupt or of the network in docs/budget.md, and whether they are called kept.
fn row(name: &str, wait_states: &str, what: &str) -> Option<(u64, bool)> {
    let published = include_str!("../../../docs/budget.md");
    let rows = published.lines().map(|line| line.split('|').map(str::trim).collect::<Vec<_>>());
    for row in rows {
        let cycles = match row[..] {
            ["", program, _, waits, _, _, _, most, said, ""] if what == "interrupt" => (program, waits, most, said),
            ["", program, waits, network, _, said, ""] if what == "network" => (program, waits, network, said),
            _ => continue,
        };
        if (cycles.0, cycles.1) == (name, wait_states) {
            return Some((cycles.2.parse().ok()?, cycles.3 == "kept"));
        }
    }
    None
}

fn same_steps() -> Result<(), Failed> {
    let [moteus, esc1] = PROGRAMS.map(|name| program(name, env!("CARGO_TARGET_TMPDIR")));
    let (moteus, esc1) = (moteus?, esc1?);
    let (of_moteus, of_esc1) = (Variables::of(&moteus)?, Variables::of(&esc1)?);
    let (next, outcomes) = (Mutex::new(0..JOINTS), Mutex::new(Vec::new()));
    let work = || {
        // Taken before the joint is driven: the other threads need the lock.
        let take = || next.lock().ok().and_then(|mut next| next.next());
        while let Some(joint) = take() {
            let outcome = match board(joint) {
                0 => drive(MoteusR4::new, joint, &moteus, &of_moteus),
                _ => drive(BG431BEsc1::new, joint, &esc1, &of_esc1),
            };
            let outcome = outcome.map(|(seen, most)| (board(joint), seen, most)).map_err(|error| {
                let error = error.message().unwrap_or("failed").to_owned();
                format!("joint {joint}, {}: {error}", PROGRAMS[board(joint)])
            });
            if let Ok(mut outcomes) = outcomes.lock() {
                outcomes.push(outcome);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(work);
        }
    });
    let outcomes = outcomes.into_inner().map_err(|_| "a joint panicked")?;
    let (mut steps, mut switching, mut faults, mut longest) = ([0; 2], 0, 0, [0; 2]);
    let mut compensation = BTreeMap::<String, u64>::new();
    for outcome in outcomes {
        let (board, seen, most) = outcome?;
        longest[board] = most.max(longest[board]);
        steps[board] += seen.steps;
        switching += seen.switching;
        faults += seen.faults;
        for (what, count) in seen.compensation {
            *compensation.entry(what).or_default() += count;
        }
    }
    let sum: u64 = steps.iter().sum();
    println!(
        "{sum} control steps compared, {switching} with the bridge on, {faults} with a fault present; with the bridge on, by what acted:"
    );
    for (what, count) in &compensation {
        println!("{count:>9}  {what}");
    }
    let rates = [MoteusR4::CONFIGURATION.bridge.rate, BG431BEsc1::CONFIGURATION.bridge.rate];
    for (board, rate) in rates.into_iter().enumerate() {
        let (name, period, longest) = (PROGRAMS[board], 170e6 / f64::from(rate), longest[board]);
        println!(
            "{name}: {} steps; the longest control interrupt took {longest} of a period's {period} cycles",
            steps[board]
        );
        if longest > LONGEST {
            return Err(format!("the control interrupt may take {LONGEST} cycles at the most").into());
        }
    }
    if sum < STEPS || steps.contains(&0) || switching * 2 < sum || faults == 0 {
        return Err("too few steps, or too little happened".into());
    }
    for needed in [
        "PhysicalAndNetwork AsRequested",
        "Physical AsRequested",
        "Nothing Off",
        "Physical NoNetwork",
        "PhysicalAndNetwork OutsideTrainedBox",
        "Physical FarOutsideTrainedBox",
        "Nothing FarOutsideTrainedBox",
    ] {
        if !compensation.keys().any(|what| what.starts_with(needed)) {
            return Err(format!("no step was \"{needed}\"").into());
        }
    }
    Ok(())
}

/// Board of a joint: both have models, temperatures and faults of all kinds.
const fn board(joint: u64) -> usize {
    (joint / 2 % 2) as usize
}

/// A joint of its own for each number: what was compared, and the cycles of its longest control interrupt.
fn drive<W: Observed>(
    board: fn(Drivetrain) -> W,
    joint: u64,
    program: &Program,
    variables: &Variables,
) -> Result<(Seen, u64), Failed> {
    let mut random = ChaCha8Rng::seed_from_u64(joint);
    let actuator = actuator();
    let request = match joint % 5 {
        3 => Request::Physical,
        4 => Request::Off,
        _ => Request::PhysicalAndNetwork,
    };
    let configuration = configuration::<W>(&actuator, NODE, request);
    let mut friction = parameters::tame_within(&mut random, W::CONFIGURATION.parameter_sets);
    // The bench is at room temperature, and so is the box of every second joint.
    if joint.is_multiple_of(2) {
        friction.domain.ranges[Signal::Temperature as usize] = parameters::range(10.0, 40.0);
    }
    let image = encoded(&parameters::image(&mut random, friction, 1));
    let active = prepared::<W>(&configuration, &image)?;

    let mut bench = Bench::with(board, &actuator, program)?;
    Kept { configuration: &configuration, image: &image }.write(&mut bench.emulation, program)?;
    let mut twin = Twin::new::<W>(variables, active)?;
    bench.stop_at_control_steps(program)?;

    if W::INDEX {
        bench.turn_by_hand(|emulation| twin.look(emulation))?;
    }
    let mut look = |bench: &mut Bench<W>, seconds: f64| {
        bench
            .run_with(seconds, |emulation| match emulation.resets() {
                [] => twin.look(emulation),
                resets => Err(format!("the chip was reset: {resets:?}").into()),
            })
            .map_err(|error| Failed::from(format!("{}\n{}", error.message().unwrap_or_default(), bench.log())))
    };
    let periods = (STEPS / JOINTS) as f64 / f64::from(W::CONFIGURATION.bridge.rate) / SET_POINT;
    let amplitude = 0.4 + 0.35 * joint as f64;
    // Start-up and enabling come on top.
    for period in 0..periods as u32 + 40 {
        let time = f64::from(period) * SET_POINT;
        let controlword = match period {
            0..30 => 0x06u16,
            30 => 0x07,
            _ => 0x0F,
        };
        // Slow and fast, with reversals; the frequency rises.
        let velocity = amplitude * (TAU * (0.8 + 0.4 * time) * time).sin();
        match period {
            20 => send(&mut bench.emulation, 0x000, &[0x01, NODE])?,
            300 if joint % 3 == 1 => bench.board().drivetrain().actuator_mut().inject(Fault::SourceVoltage(40.0))?,
            300 if joint % 3 == 2 => bench.board().drivetrain().external_torque = 8.0,
            _ => {}
        }
        let mut frame = controlword.to_le_bytes().to_vec();
        frame.push(9);
        frame.extend(((1e3 * velocity) as i32).to_le_bytes());
        send(&mut bench.emulation, 0x300 + u16::from(NODE), &frame)?;
        look(&mut bench, SET_POINT)?;
    }
    let times = bench.emulation.cpu.exception_times().get(&CONTROL).ok_or("no control interrupt")?;
    Ok((twin.seen().clone(), times.most))
}

/// Configuration that the board will prepare.
fn prepared<W: Observed>(configuration: &Configuration, image: &[u8]) -> Result<Active, Failed> {
    let bridge = W::CONFIGURATION.bridge;
    let mut active = configuration.prepare(&bridge).map_err(|error| error.to_string())?;
    Image::prepare(image, bridge.motion_rate(), &mut active.friction);
    if active.friction.is_none() {
        return Err("the image is none".into());
    }
    Ok(active)
}
