//! The control loop of the flashed program on the emulated board, in closed loop with the plant, is the host's: a million control steps, the same bits in
//! each.
//!
//! Random joints' friction models with networks and regimes, driven over the bus through reversals, beyond the trained box and back, and into
//! faults. See [`host_tests::emulated::twin`] for what is compared.
//!
//! Needs the target; where it is missing the tests are reported as ignored, by name; with `CI` set they run and fail.

use emulator::board::{Drivetrain, MoteusR4, Wired};
use emulator::chip::Chip;
use emulator::cpu::{Cpu, Watch};
use emulator::program::Program;
use emulator::variables::Variables;
use host_tests::bare_metal::target_installed;
use host_tests::emulated::bench::{actuator, program};
use host_tests::emulated::kept::Kept;
use host_tests::emulated::master::send;
use host_tests::emulated::twin::{Observed, Seen};
use host_tests::emulated::{Bench, Twin};
use host_tests::image_bytes::encoded;
use host_tests::parameters;
use joint_firmware::compensation::Request;
use joint_firmware::friction::state::Signal;
use joint_firmware::joint::Active;
use joint_firmware::joint::configuration::Configuration;
use joint_firmware::parameters::image::Image;
use libtest_mimic::{Arguments, Failed, Trial};
use plant::actuator::Fault;
use plant::virtual_joint::Setup;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Mutex;

/// Control steps that are compared at least.
const STEPS: u64 = 1_000_000;
/// Joints that they are spread over.
const JOINTS: u64 = 12;
/// Between two set-points, s.
const SET_POINT: f64 = 0.005;
const NODE: u8 = 5;
/// Exception of the control interrupt, ADC1_2: interrupt 18.
const CONTROL: u16 = 16 + 18;

fn main() {
    let arguments = Arguments::from_args();
    let ignored = std::env::var_os("CI").is_none() && !target_installed();
    let trials = vec![Trial::test("every_control_step_of_the_flashed_program_is_the_hosts", same_steps)];
    let trials = trials.into_iter().map(|trial| trial.with_ignored_flag(ignored)).collect();
    libtest_mimic::run(&arguments, trials).exit();
}

fn same_steps() -> Result<(), Failed> {
    let program = program(MoteusR4::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    let variables = Variables::of(&program)?;
    let (next, outcomes) = (Mutex::new(0..JOINTS), Mutex::new(Vec::new()));
    let work = || {
        // Taken before the joint is driven: the other threads need the lock.
        let take = || next.lock().ok().and_then(|mut next| next.next());
        while let Some(joint) = take() {
            let outcome = drive(joint, &program, &variables).map_err(|error| {
                let error = error.message().unwrap_or("failed").to_owned();
                format!("joint {joint}: {error}")
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
    let (mut steps, mut switching, mut faults, mut longest) = (0, 0, 0, 0);
    let mut compensation = BTreeMap::<String, u64>::new();
    for outcome in outcomes {
        let (seen, most) = outcome?;
        longest = longest.max(most);
        steps += seen.steps;
        switching += seen.switching;
        faults += seen.faults;
        for (what, count) in seen.compensation {
            *compensation.entry(what).or_default() += count;
        }
    }
    println!(
        "{steps} control steps compared, {switching} with the bridge on, {faults} with a fault present; with the bridge on, by what acted:"
    );
    for (what, count) in &compensation {
        println!("{count:>9}  {what}");
    }
    let period = 170e6 / f64::from(MoteusR4::CONFIGURATION.bridge.rate);
    println!("the longest control interrupt took {longest} of a period's {period} cycles");
    if longest as f64 > 0.85 * period {
        return Err("the control interrupt leaves less than 15 % of the period to everything else".into());
    }
    if steps < STEPS || switching * 2 < steps || faults == 0 {
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

/// A joint of its own for each number: what was compared, and the cycles of its longest control interrupt.
fn drive(joint: u64, program: &Program, variables: &Variables) -> Result<(Seen, u64), Failed> {
    let mut random = ChaCha8Rng::seed_from_u64(joint);
    let actuator = actuator();
    let request = match joint % 5 {
        3 => Request::Physical,
        4 => Request::Off,
        _ => Request::PhysicalAndNetwork,
    };
    let configuration = configuration(request);
    let mut friction = parameters::tame(&mut random);
    // The bench is at room temperature, and so is the box of every second joint.
    if joint.is_multiple_of(2) {
        friction.domain.ranges[Signal::Temperature as usize] = parameters::range(10.0, 40.0);
    }
    let image = encoded(&parameters::image(&mut random, friction, 1));
    let active = prepared::<MoteusR4>(&configuration, &image)?;

    let mut bench = Bench::with(|drivetrain: Drivetrain| MoteusR4::new(drivetrain), &actuator, program)?;
    Kept { configuration: &configuration, image: &image }.write(&mut bench.emulation, program)?;
    let mut twin = Twin::new(variables, active)?;
    watch(&mut bench.emulation.cpu, program)?;

    let periods = (STEPS / JOINTS) as f64 / f64::from(MoteusR4::CONFIGURATION.bridge.rate) / SET_POINT;
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
            400 if joint % 3 == 1 => bench.board().drivetrain().actuator_mut().inject(Fault::SourceVoltage(40.0))?,
            400 if joint % 3 == 2 => bench.board().drivetrain().external_torque = 8.0,
            _ => {}
        }
        let mut frame = controlword.to_le_bytes().to_vec();
        frame.extend([3, period as u8]);
        frame.extend(((1e3 * velocity) as i32).to_le_bytes());
        send(&mut bench.emulation, 0x300 + u16::from(NODE), &frame)?;
        bench
            .run_with(SET_POINT, |emulation| match emulation.resets() {
                [] => twin.look(emulation),
                resets => Err(format!("the chip was reset: {resets:?}").into()),
            })
            .map_err(|error| format!("{}\n{}", error.message().unwrap_or_default(), bench.log()))?;
    }
    let times = bench.emulation.cpu.exception_times().get(&CONTROL).ok_or("no control interrupt")?;
    Ok((twin.seen().clone(), times.most))
}

/// The actuator's configuration, on the board.
fn configuration(request: Request) -> Configuration {
    let board = MoteusR4::CONFIGURATION;
    let mut configuration = Setup::of(&actuator()).compensating(request).configuration;
    configuration.node_id = NODE;
    configuration.motor.encoder_latency = board.joint.motor.encoder_latency;
    configuration
}

/// What the board will prepare of it.
fn prepared<W: Observed>(configuration: &Configuration, image: &[u8]) -> Result<Active, Failed> {
    let bridge = W::CONFIGURATION.bridge;
    let mut active = configuration.prepare(&bridge).map_err(|error| error.to_string())?;
    Image::prepare(image, bridge.rate as u32, &mut active.friction);
    if active.friction.is_none() {
        return Err("the image is none".into());
    }
    Ok(active)
}

/// Stops before every control interrupt.
fn watch<W: Wired>(cpu: &mut Cpu<Chip<W>>, program: &Program) -> Result<(), Failed> {
    let handler = program.symbol("ADC1_2").ok_or("the program has no control interrupt")?;
    cpu.set_watch(Some(Watch::new().stop_at(handler.address)));
    Ok(())
}
