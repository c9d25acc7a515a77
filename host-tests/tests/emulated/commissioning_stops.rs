//! Stops of `jointctl commission` on the flashed programs: under a commanded voltage, whatever ends it has the bridge
//! off in the same control step; where the joint follows set-points, so has what cuts the voltage, and the rest has it
//! off once the joint stands.
//!
//! Every stage under current is stopped by every cause, all of the product on both boards: a stop takes milliseconds,
//! and the commissioning that leads to it some seconds.

use super::commissioning::{ESC1, Motor, NODE, built};
use emulator::board::{Drivetrain, Wired};
use emulator::chip::time::Instant;
use host_tests::emulated::Bench;
use host_tests::emulated::commissioned::OnBoard;
use host_tests::emulated::master::send;
use host_tests::on_each_board;
use joint_firmware::objects::settings::Setting;
use jointctl::commission::joint::Joint;
use jointctl::commission::{Bench as _, Failure as NotCommissioned, Plan, Stage, commission};
use libtest_mimic::{Failed, Trial};
use plant::actuator::{Channel, Failure, Fault};
use std::collections::BTreeMap;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    on_each_board!("stops_a_commissioning_in_the_same_control_step", stops).into()
}

/// Carrier of a controlword.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum By {
    Rpdo,
    Sdo,
}

/// Cause that stops a commissioning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cause {
    /// The controlword asks for less.
    Controlword(u16, By),
    /// Another mode, with the controlword that applies the voltage.
    Mode,
    /// An NMT command.
    Network(u8),
    /// A current sensor reads more than the over-current limit.
    Fault,
    /// Lost client: nobody sends frames any more.
    LostClient,
    /// The button.
    Button,
}

/// Disable voltage, quick stop, disable operation, fault reset.
const DISABLE_VOLTAGE: u16 = 0x00;
const QUICK_STOP: u16 = 0x02;
const DISABLE_OPERATION: u16 = 0x07;
const FAULT_RESET: u16 = 0x80;
/// NMT: stop, PRE-OPERATIONAL, reset node, reset communication.
const STOP: u8 = 0x02;
const PRE_OPERATIONAL: u8 = 0x80;
const RESET_NODE: u8 = 0x81;
const RESET_COMMUNICATION: u8 = 0x82;

const CAUSES: [Cause; 16] = [
    Cause::Controlword(DISABLE_VOLTAGE, By::Rpdo),
    Cause::Controlword(QUICK_STOP, By::Rpdo),
    Cause::Controlword(DISABLE_OPERATION, By::Rpdo),
    Cause::Controlword(FAULT_RESET, By::Rpdo),
    Cause::Controlword(DISABLE_VOLTAGE, By::Sdo),
    Cause::Controlword(QUICK_STOP, By::Sdo),
    Cause::Controlword(DISABLE_OPERATION, By::Sdo),
    Cause::Controlword(FAULT_RESET, By::Sdo),
    Cause::Mode,
    Cause::Network(STOP),
    Cause::Network(PRE_OPERATIONAL),
    Cause::Network(RESET_NODE),
    Cause::Network(RESET_COMMUNICATION),
    Cause::Fault,
    Cause::LostClient,
    Cause::Button,
];

/// Stages in which the joint follows set-points, with the mode of 6060h: these can brake.
const MOVING: [(Stage, i8); 3] = [(Stage::Turning, VELOCITY), (Stage::Load, POSITION), (Stage::Inertia, VELOCITY)];
const OPEN_LOOP: i8 = -2;
const POSITION: i8 = 8;
const VELOCITY: i8 = 9;

impl Cause {
    /// The joint brakes before the bridge is off, in a stage in which it can. Not by what cuts the voltage, nor by
    /// "disable operation", as 605Ch is at first.
    const fn brakes(self) -> bool {
        match self {
            Self::Controlword(word, _) => word == QUICK_STOP,
            Self::Mode | Self::Network(_) | Self::LostClient => true,
            Self::Fault | Self::Button => false,
        }
    }
}

/// The longest frame with so many bytes, bits of 1 us: CiA 301's frames with an 11-bit identifier, stuffed.
const fn longest_frame(bytes: u64) -> u64 {
    let stuffed = 34 + 8 * bytes;
    47 + 8 * bytes + (stuffed - 1) / 4
}
/// Looks at the bus until no frame is under way, s, and how many: two of the longest frames.
const FRAME_LOOK: f64 = 2e-6;
const FRAME_LOOKS: u32 = 135;
/// Longest time of the task that answers SDO requests, from the frame on, s.
const TASK: f64 = 0.0005;
/// The joint's dead man, and its button's debouncing, s.
const DEAD_MAN: f64 = 0.1;
const DEBOUNCE: f64 = 0.020;
/// A joint that brakes takes at least so long, s: one that does not is off within two periods, and where the client is
/// lost the joint may have turned back by then and be slow. Part of its speed that may be left when the bridge goes
/// off; how often it is looked at, s.
const BRAKING: f64 = 0.003;
const LEFT: f64 = 0.2;
const LOOK: f64 = 0.0005;
/// Speed of the joint, rad/s, with which a stop of a stage that turns is one.
const TURNS: f64 = 0.1;
/// A millisecond's tick of the task that looks at the button, s.
const TICK: f64 = 0.001;
/// Instant in a stage at which it is stopped: at this object that the client reads.
const LOOKS: u32 = 120;

fn stops<W: Wired + Clone>(wired: fn(Drivetrain) -> W) -> Result<(), Failed> {
    let board = W::NAME;
    let motor = Motor::random(7, board == ESC1);
    let mut moments: BTreeMap<&str, Bench<W>> = BTreeMap::new();
    let mut looks: BTreeMap<&str, u32> = BTreeMap::new();
    let bench = motor.board(wired, built(board)?)?;
    let stages = || Stage::UNDER_CURRENT.into_iter().chain(MOVING.map(|(stage, _)| stage));
    let (rate, braking) = {
        let reading = |bench: &Bench<W>, stage: Stage| {
            let seen = looks.entry(stage.name()).or_default();
            *seen += 1;
            if *seen == LOOKS && stages().any(|of| of == stage) {
                moments.insert(stage.name(), bench.clone());
            }
        };
        let (on_board, mut telling) = OnBoard::new(bench, NODE);
        let mut joint = Joint::new(on_board.watched(reading));
        let plan = Plan { load: Some(0.1), inertia: Some(motor.parameters.joint.inertia()), ..motor.plan };
        match commission(&mut joint, &plan, &mut telling) {
            // Friction may hide the inertia: by then the joint has swung all the same.
            Ok(_) | Err(NotCommissioned::InertiaUnclear { .. }) => {}
            Err(failure) => return Err(format!("{failure}\n{}", telling.told.join("\n")).into()),
        }
        let stopped = |stopped: jointctl::commission::Stopped| stopped.to_string();
        (joint.rate().map_err(stopped)?, joint.setting(Setting::BrakingTime).map_err(stopped)?)
    };
    let mut bad = Vec::new();
    for stage in stages().filter(|stage| board == ESC1 || *stage != Stage::Index) {
        let Some(moment) = moments.get(stage.name()) else {
            bad.push(format!("{}: the client never read so many objects", stage.name()));
            continue;
        };
        for cause in CAUSES.into_iter().filter(|cause| board == ESC1 || *cause != Cause::Button) {
            match stop(moment.clone(), stage, cause, rate, braking) {
                Ok(told) => println!("| {board} | {} | {cause:x?} | {told} |", stage.name()),
                Err(wrong) => bad.push(format!("{}, {cause:x?}: {wrong}", stage.name())),
            }
        }
    }
    if bad.is_empty() { Ok(()) } else { Err(bad.join("\n").into()) }
}

/// Stops it: the bridge is off in the control step that follows what the program could know, or, where the joint brakes
/// first, when it stands.
fn stop<W: Wired>(mut bench: Bench<W>, stage: Stage, cause: Cause, rate: f64, braking: f64) -> Result<String, String> {
    let failed = |error: Failed| error.message().unwrap_or_default().to_owned();
    if !bench.board().drivetrain().is_switching() {
        return Err("the bridge is off before".into());
    }
    let mode = MOVING.iter().find(|(of, _)| *of == stage).map_or(OPEN_LOOP, |(_, mode)| *mode);
    let brakes = mode != OPEN_LOOP && cause.brakes();
    let seconds = |from: Instant, to: Instant| (to.0 as f64 - from.0 as f64) * 1e-12;
    let velocity = |bench: &mut Bench<W>| bench.board().drivetrain().actuator().state().joint.velocity;
    let fastest = velocity(&mut bench);
    if mode != OPEN_LOOP && fastest.abs() < TURNS {
        return Err(format!("the joint hardly turns: {fastest} rad/s"));
    }
    let drive = |controlword: u16, mode: i8| {
        let mut frame = controlword.to_le_bytes().to_vec();
        frame.push(mode as u8);
        // If it is a target, the joint goes on as it does.
        frame.extend(((1e3 * fastest) as i32).to_le_bytes());
        frame
    };
    // A frame that has begun ends first: what is sent behind it comes later, and nobody stops it meanwhile.
    for _ in 0..FRAME_LOOKS {
        let now = bench.emulation.now();
        if bench.emulation.cpu.bus.wiring_mut().line().is_idle(now) {
            break;
        }
        bench.run(FRAME_LOOK).map_err(failed)?;
    }
    // The earliest and the latest instant at which the program can know, from now on, s.
    let begun = bench.emulation.now();
    let frame = |bench: &mut Bench<W>, id: u16, frame: &[u8]| {
        send(&mut bench.emulation, id, frame).map_err(failed)?;
        let bytes = frame.len() as u64;
        Ok::<_, String>((1e-6 * (40 + 8 * bytes) as f64, 1e-6 * longest_frame(bytes) as f64))
    };
    let rpdo =
        |bench: &mut Bench<W>, controlword, mode| frame(bench, 0x300 + u16::from(NODE), &drive(controlword, mode));
    let (earliest, latest) = match cause {
        Cause::Controlword(word, By::Rpdo) => rpdo(&mut bench, word, mode)?,
        Cause::Controlword(word, By::Sdo) => {
            let [low, high] = word.to_le_bytes();
            let (after, until) = frame(&mut bench, 0x600 + u16::from(NODE), &[0x2B, 0x40, 0x60, 0, low, high, 0, 0])?;
            (after, until + TASK)
        }
        Cause::Mode => rpdo(&mut bench, 0x0F, if mode == OPEN_LOOP { VELOCITY } else { OPEN_LOOP })?,
        Cause::Network(command) => frame(&mut bench, 0, &[command, NODE])?,
        Cause::Fault => {
            let fault = Fault::Sensor(Channel::CurrentA, Failure::Offset(100.0));
            bench.board().drivetrain().actuator_mut().inject(fault).map_err(|error| error.to_string())?;
            (0.0, 0.0)
        }
        Cause::LostClient => {
            // The last frame, which arrives at once, and nothing after it.
            let (after, until) = rpdo(&mut bench, 0x0F, mode)?;
            // It is over in the first step that makes it more.
            (DEAD_MAN + after, DEAD_MAN + until + 1.0 / rate)
        }
        Cause::Button => {
            bench.board().inputs().button = true;
            (DEBOUNCE - TICK, DEBOUNCE + TICK)
        }
    };
    let period = 1.0 / rate;
    if cause == Cause::Button {
        // Somebody goes on meanwhile.
        for _ in 0..3 {
            rpdo(&mut bench, 0x0F, mode)?;
            bench.run(0.008).map_err(failed)?;
        }
    }
    // The step that begins after it is known begins within a period, and is over within another.
    let limit = latest + 2.0 * period + if brakes { braking } else { 0.0 };
    let end = limit + 2.0 * period;
    let off_since = |bench: &mut Bench<W>| bench.board().drivetrain().off_since().filter(|off| *off >= begun);
    while brakes && off_since(&mut bench).is_none() && seconds(begun, bench.emulation.now()) < end {
        bench.run(LOOK).map_err(failed)?;
    }
    if !brakes {
        bench.run((end - seconds(begun, bench.emulation.now())).max(0.0)).map_err(failed)?;
    }
    let left = velocity(&mut bench);
    // Nor does anything enable it again.
    bench.run(0.002).map_err(failed)?;
    let off = off_since(&mut bench).ok_or_else(|| format!("the bridge is still on:\n{}", bench.log()))?;
    let off = seconds(begun, off);
    let earliest = earliest + if brakes { BRAKING } else { 0.0 };
    let [off, earliest, limit] = [off, earliest, limit].map(|time| 1e3 * time);
    if off < earliest || off > limit {
        return Err(format!("off after {off:.4} ms, {earliest:.4} to {limit:.4} ms were expected"));
    }
    if brakes && left.abs() > LEFT * fastest.abs() {
        return Err(format!("off at {left:.3} rad/s, it was {fastest:.3} rad/s before"));
    }
    Ok(format!("{off:.3} | {limit:.3} | {fastest:.3} | {left:.3}"))
}
