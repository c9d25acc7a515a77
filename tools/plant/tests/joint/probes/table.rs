//! The limits of the joint's configuration and of its sensors, each with its probes.

use super::bench::Bench;
use super::{Found, Probe, Shows, Subject, probed};
use crate::rig::table::documented;
use joint_firmware::default_configuration::BoardConfiguration;
use joint_firmware::joint::configuration::{Limits, MOTION_STEPS};
use joint_firmware::joint::fault::{Fault, Faults};
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::motor::phases::Phases;
use std::f64::consts::TAU;

/// Distance of a probe from its limit, as a part of it.
const NEAR: f64 = 1e-3;
/// Control steps for which a value just below its limit is held.
const LONG: u32 = 1_000;
/// The same where a torque is compared.
const ROUNDS: u32 = 20;
/// Distance of a probe from a temperature, K.
const KELVIN: f64 = 0.01;
/// Span below a temperature limit over which the current falls, K.
const DERATING: f64 = 20.0;

type Board = BoardConfiguration;
type Set = fn(&mut Bench, f64);

fn only(faults: Faults) -> Found {
    Found { faults, part: 1.0 }
}

/// A value that is set in a joint that is already there, each step anew.
fn held(
    board: &Board,
    make: fn(&Board) -> Bench,
    set: impl Fn(&mut Bench, f64) + Copy + 'static,
) -> impl Fn() -> Subject + 'static {
    let board = *board;
    move || {
        let mut bench = make(&board);
        Box::new(move |value| {
            set(&mut bench, value);
            only(bench.step())
        })
    }
}

/// A value that is there from the joint's first step on, and looked at from "operation enabled" on, with so much torque
/// asked for, Nm.
fn from_the_start(
    board: &Board,
    torque: f64,
    set: impl Fn(&mut Bench, f64) + Copy + 'static,
) -> impl Fn() -> Subject + 'static {
    let board = *board;
    move || {
        let mut enabled: Option<Bench> = None;
        Box::new(move |value| {
            let bench = enabled.get_or_insert_with(|| {
                let mut bench = Bench::new(&board);
                set(&mut bench, value);
                let mut bench = bench.switch_on();
                bench.demand.controlword = Controlword::ENABLE_OPERATION;
                bench.follows = true;
                bench
            });
            if torque == 0.0 { only(bench.step()) } else { bench.asked(torque) }
        })
    }
}

/// Torque that is asked for and made, a round of the motion loop a call, while a value is held in a joint that is
/// enabled; with the value, Nm.
fn asking(board: &Board, set: impl Fn(&mut Bench, f64) -> f64 + Copy + 'static) -> impl Fn() -> Subject + 'static {
    let board = *board;
    move || {
        let mut bench = Bench::enabled(&board);
        Box::new(move |value| {
            let torque = set(&mut bench, value);
            bench.asked(torque)
        })
    }
}

/// One phase's current, A; the others are the way back.
fn one_phase(phase: usize, current: f64) -> Phases {
    let current = current as f32;
    let mut phases = [-0.5 * current; 3];
    phases[phase] = current;
    let [a, b, c] = phases;
    Phases { a, b, c }
}

/// All probes of a joint on a board.
pub fn probes(board: &Board) -> Vec<Probe> {
    [currents(board), supply(board), encoder(board), motion(board), temperatures(board), commands(board), torque(board)]
        .into_iter()
        .flatten()
        .collect()
}

fn currents(board: &Board) -> Vec<Probe> {
    let limit = f64::from(board.joint.limits.over_current);
    let mut probes = vec![];
    for (phase, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
        let set = move |bench: &mut Bench, current| bench.measured.phase_currents = one_phase(phase, current);
        let over = Probe::of(
            format!("over-current of phase {phase}"),
            Shows::Fault(Fault::OverCurrent),
            held(board, Bench::switched_on, set),
        );
        probes.push(over.around(sign * limit, sign * NEAR * limit, LONG));

        // A tenth of the fault limit.
        let set = move |bench: &mut Bench, current: f64| {
            let mut phases = [0.0; 3];
            phases[phase] = current as f32;
            let [a, b, c] = phases;
            bench.measured.phase_currents = Phases { a, b, c };
        };
        let sum = Probe::of(
            format!("sum with phase {phase}"),
            Shows::Fault(Fault::CurrentSensor),
            held(board, Bench::switched_on, set),
        );
        probes.push(sum.around(sign * 0.1 * limit, sign * NEAR * 0.1 * limit, LONG));

        // Without current, at the start: a quarter of the fault limit, or less where the converter ends.
        for over_current in [board.joint.limits.over_current, board.bridge.limits.over_current] {
            let mut board = *board;
            board.joint.limits.over_current = over_current;
            let (low, high) = board.bridge.limits.current_range;
            let offset = f64::from((0.25 * over_current).min(high.min(-low) - over_current));
            let subject = held(&board, Bench::new, set);
            let start = Probe::of(
                format!("offset of phase {phase} at {over_current} A"),
                Shows::Fault(Fault::CurrentSensor),
                subject,
            );
            probes.push(start.around(sign * offset, sign * NEAR * offset, 3 * LONG).apart());
        }
    }
    let configured = *board;
    let subject = move || -> Subject {
        let mut bench = Bench::switched_on(&configured);
        Box::new(move |steps| {
            bench.measured.phase_currents.a = 0.5 * configured.joint.limits.over_current;
            let faults = (0..steps as u32).map(|_| bench.step()).last().unwrap();
            only(faults)
        })
    };
    let most = f64::from(documented(Fault::CurrentSensor).steps) - 1.0;
    probes.push(Probe::of("steps of an unbalanced sum", Shows::Fault(Fault::CurrentSensor), subject).counted(most));
    probes
}

fn supply(board: &Board) -> Vec<Probe> {
    let (lowest, highest) = board.joint.limits.bus_voltage;
    let probe = |name: &str, fault, limit: f64, distance| {
        let set: Set = |bench, voltage| bench.measured.bus_voltage = voltage as f32;
        Probe::of(name, Shows::Fault(fault), held(board, Bench::switched_on, set)).around(limit, distance, LONG)
    };
    let (lowest, highest) = (f64::from(lowest), f64::from(highest));
    vec![
        probe("highest supply", Fault::OverVoltage, highest, NEAR * highest),
        probe("lowest supply", Fault::UnderVoltage, lowest, -NEAR * lowest),
        probe("supply below zero", Fault::OverVoltage, 0.0, -NEAR).beside(&[Fault::UnderVoltage]),
    ]
}

fn encoder(board: &Board) -> Vec<Probe> {
    let board = *board;
    let jump = 0.5 / f64::from(board.joint.motor.alignment.pole_pairs);
    let jumps = move || -> Subject {
        let mut bench = Bench::switched_on(&board);
        let mut jumped = 0.0;
        Box::new(move |way| {
            if way != jumped {
                bench.angle += way;
                jumped = way;
            }
            only(bench.step())
        })
    };
    // After so many silent steps the encoder answers for so many.
    let silent = move |answers: u32| {
        move || -> Subject {
            let mut bench = Bench::switched_on(&board);
            Box::new(move |steps| {
                bench.measured.encoder_valid = false;
                let silent = (0..steps as u32).map(|_| bench.step()).last();
                bench.measured.encoder_valid = true;
                let then = (0..answers).map(|_| bench.step()).last();
                only(then.or(silent).unwrap())
            })
        }
    };
    // A part of all samples.
    let missing = move || -> Subject {
        let mut bench = Bench::switched_on(&board);
        let mut missing = 0.0;
        Box::new(move |part| {
            missing += part;
            bench.measured.encoder_valid = missing < 1.0;
            missing = if missing < 1.0 { missing } else { missing - 1.0 };
            only(bench.step())
        })
    };
    let lost = Shows::Fault(Fault::EncoderLost);
    // A quarter of a turn at twice the velocity limit.
    let fastest = 2.0 * f64::from(board.joint.limits.velocity) * f64::from(board.joint.gear.ratio);
    let bridged = 0.25 * TAU / fastest * f64::from(board.bridge.rate);
    let of_jump = |name: &str, sign: f64| {
        let probe = Probe::of(name, Shows::Fault(Fault::EncoderJump), jumps);
        probe.around(sign * jump, sign * NEAR * jump, LONG)
    };
    vec![
        of_jump("jump forward", 1.0),
        of_jump("jump backward", -1.0),
        Probe::of("samples missing", lost, silent(0)).counted(f64::from(documented(Fault::EncoderLost).steps) - 1.0),
        Probe::of("samples missing until turns are lost", lost, silent(100)).counted(bridged),
        Probe { within: 100, ..Probe::of("samples missing of many", lost, missing).around(0.365, 0.035, LONG).apart() },
    ]
}

fn motion(board: &Board) -> Vec<Probe> {
    let Limits { velocity, position: (lowest, highest), position_margin, .. } = board.joint.limits;
    let (lowest, highest, margin) = (f64::from(lowest), f64::from(highest), f64::from(position_margin));
    let over_speed = 1.2 * f64::from(velocity);
    let mut unbounded = *board;
    unbounded.joint.limits.position = (-100.0, 100.0);
    let turning: Set = |bench, velocity| bench.speed = velocity * f64::from(bench.board.joint.gear.ratio);
    let lies: Set = |bench, position| bench.angle = position * f64::from(bench.board.joint.gear.ratio);
    let speed = |name: &str, sign: f64| {
        let probe = Probe::of(name, Shows::Fault(Fault::OverSpeed), from_the_start(&unbounded, 0.0, turning));
        probe.around(sign * over_speed, sign * NEAR * over_speed, LONG).apart()
    };
    let position = |name: &str, limit: f64, distance: f64| {
        let probe = Probe::of(name, Shows::Fault(Fault::PositionLimit), from_the_start(board, 0.0, lies));
        probe.around(limit, distance, LONG).apart()
    };
    vec![
        speed("speed forward", 1.0),
        speed("speed backward", -1.0),
        position("highest position", highest + margin, NEAR * margin),
        position("lowest position", lowest - margin, -NEAR * margin),
    ]
}

fn temperatures(board: &Board) -> Vec<Probe> {
    let Limits { bridge_temperature, winding_temperature, .. } = board.joint.limits;
    let bridge: Set = |bench, temperature| bench.measured.bridge_temperature = temperature as f32;
    let winding: Set = |bench, temperature| bench.measured.winding_temperature = temperature as f32;
    let at = |name: &str, fault, set: Set, limit: f64, distance| {
        Probe::of(name, Shows::Fault(fault), held(board, Bench::switched_on, set)).around(limit, distance, LONG)
    };
    let sensor = Fault::TemperatureSensor;
    let hot = Probe::of("winding", Shows::Fault(Fault::WindingTemperature), held(board, Bench::enabled, winding));
    let hot = hot.around(winding_temperature.into(), KELVIN, LONG);
    // The slow task looks every 10 ms; the documentation counts steps at 20 kHz.
    let within = (f64::from(hot.within) - 1.0) * f64::from(board.bridge.rate) / 20e3 + 1.0;
    let mut probes = vec![
        at("bridge", Fault::BridgeTemperature, bridge, bridge_temperature.into(), KELVIN),
        Probe { within: within as u32, ..hot },
        at("cold end of the bridge's sensor", sensor, bridge, -40.0, -KELVIN),
        at("hot end of the bridge's sensor", sensor, bridge, 180.0, KELVIN).beside(&[Fault::BridgeTemperature]),
        at("cold end of the winding's sensor", sensor, winding, -40.0, -KELVIN),
        at("hot end of the winding's sensor", sensor, winding, 180.0, KELVIN),
    ];
    let derated = [("bridge", bridge, bridge_temperature), ("winding", winding, winding_temperature)];
    for (name, set, limit) in derated {
        let most = f64::from(board.joint.limits.torque);
        let subject = asking(board, move |bench, temperature| {
            set(bench, temperature);
            most
        });
        let probe = Probe::of(format!("derating of the {name}"), Shows::Less, subject);
        // A thousandth of the torque.
        let probe = probe.around(f64::from(limit) - DERATING, 1e-3 * DERATING, LONG);
        let rounds = (within / f64::from(MOTION_STEPS)).ceil() as u32;
        probes.push(if name == "winding" { Probe { within: rounds, ..probe } } else { probe });
    }
    probes
}

fn commands(board: &Board) -> Vec<Probe> {
    let board = *board;
    let rate = f64::from(board.bridge.rate);
    let silence = move |make: fn(&Board) -> Bench, deadline: f32| {
        let mut board = board;
        board.joint.limits.command_deadline = deadline;
        move || -> Subject {
            let mut bench = make(&board);
            Box::new(move |steps| {
                bench.silent = false;
                bench.step();
                bench.silent = true;
                only((0..steps as u32).map(|_| bench.step()).last().unwrap())
            })
        }
    };
    // A joint that does not stand still is braked for so many steps.
    let braking = move || -> Subject {
        let mut board = board;
        board.joint.limits.position = (-100.0, 100.0);
        Box::new(move |steps| {
            let mut bench = Bench::new(&board);
            bench.speed = f64::from(board.joint.limits.velocity);
            let mut bench = bench.switch_on();
            bench.enable();
            bench.demand.controlword = Controlword::QUICK_STOP;
            let faults = (0..=steps as u32).map(|_| bench.step()).last().unwrap();
            Found { faults, part: if bench.state() == State::QuickStopActive { 1.0 } else { 0.0 } }
        })
    };
    let stale = Shows::Fault(Fault::StaleCommand);
    let deadline = board.joint.limits.command_deadline;
    // The open loop's own, or the configured one where that is shorter.
    let own = 0.1;
    vec![
        Probe::of("command deadline", stale, silence(Bench::enabled, deadline)).counted(f64::from(deadline) * rate),
        Probe::of("open loop", stale, silence(Bench::open_loop, 3.0 * own)).counted(f64::from(own) * rate),
        Probe::of("open loop", stale, silence(Bench::open_loop, deadline)).counted(f64::from(deadline) * rate),
        Probe::of("braking time", Shows::Less, braking).counted(f64::from(board.joint.gains.braking_time) * rate),
    ]
}

/// Limits at which a torque falls, or is not exceeded.
fn torque(board: &Board) -> Vec<Probe> {
    let Limits { torque, velocity, damping, position: (lowest, highest), position_margin, regeneration_band, .. } =
        board.joint.limits;
    let (torque, margin) = (f64::from(torque), f64::from(position_margin));
    let mut weak = *board;
    weak.joint.motor.current_limit = 0.3;
    let per_current = f64::from(board.joint.motor.torque_constant) * f64::from(board.joint.gear.ratio);
    let current_limit = f64::from(weak.joint.motor.current_limit) * per_current;
    assert!(current_limit < 0.9 * torque && torque < 0.9 * f64::from(board.joint.motor.current_limit) * per_current);
    let mut unbounded = *board;
    unbounded.joint.limits.position = (-100.0, 100.0);
    let fade = torque / f64::from(damping);
    let onset = f64::from(board.joint.limits.bus_voltage.1 - regeneration_band);
    let band = f64::from(regeneration_band);
    let turning: Set = |bench, velocity| bench.speed = velocity * f64::from(bench.board.joint.gear.ratio);
    let lies: Set = |bench, position| bench.angle = position * f64::from(bench.board.joint.gear.ratio);
    let braking = move |bench: &mut Bench, voltage: f64| {
        bench.measured.bus_voltage = voltage as f32;
        bench.speed = -0.9 * f64::from(velocity) * f64::from(bench.board.joint.gear.ratio);
    };
    let mut probes = vec![
        Probe::of("regeneration band", Shows::Less, from_the_start(&unbounded, 0.5 * torque, braking))
            .around(onset, 2e-3 * band, ROUNDS)
            .apart(),
    ];
    for (sign, end) in [(1.0, highest), (-1.0, lowest)] {
        for (name, board, limit) in [("torque", board, torque), ("current", &weak, current_limit)] {
            let probe = Probe::of(format!("{name} {sign}"), Shows::Less, asking(board, |_, torque| torque));
            probes.push(probe.around(sign * limit, sign * NEAR * limit, ROUNDS));
        }
        let subject = from_the_start(&unbounded, sign * torque, turning);
        let fast = Probe::of(format!("torque's fade at the velocity limit {sign}"), Shows::Less, subject);
        let limit = sign * (f64::from(velocity) - fade);
        probes.push(fast.around(limit, sign * 5.0 * NEAR * fade, ROUNDS).apart());
        let subject = from_the_start(board, sign * torque, lies);
        let far = Probe::of(format!("torque's fade at the position limit {sign}"), Shows::Less, subject);
        probes.push(far.around(end.into(), sign * 5.0 * NEAR * margin, ROUNDS).apart());
    }
    probes
}

/// The probed configuration with each of its limits a little lower, by its name, with how that limit shows. A new limit
/// does not compile before it is in here.
pub fn with_each_limit_moved(board: &Board) -> Vec<(&'static str, Shows, Board)> {
    let board = probed(board);
    let limits = board.joint.limits;
    let Limits {
        torque,
        velocity,
        position: (lowest, highest),
        position_margin,
        damping,
        over_current,
        bus_voltage: (lowest_supply, highest_supply),
        regeneration_band,
        // An output, and no limit of the joint: `joint::chopper` probes both.
        chopper_voltage: _,
        chopper_share: _,
        bridge_temperature,
        winding_temperature,
        command_deadline,
    } = limits;
    let part = 0.95;
    let fault = Shows::Fault;
    [
        ("torque", Shows::Less, Limits { torque: part * torque, ..limits }),
        ("velocity", fault(Fault::OverSpeed), Limits { velocity: part * velocity, ..limits }),
        ("lowest position", fault(Fault::PositionLimit), Limits { position: (part * lowest, highest), ..limits }),
        ("highest position", fault(Fault::PositionLimit), Limits { position: (lowest, part * highest), ..limits }),
        ("position margin", fault(Fault::PositionLimit), Limits { position_margin: part * position_margin, ..limits }),
        ("damping", Shows::Less, Limits { damping: part * damping, ..limits }),
        ("over-current", fault(Fault::OverCurrent), Limits { over_current: part * over_current, ..limits }),
        (
            "lowest supply",
            fault(Fault::UnderVoltage),
            Limits { bus_voltage: (part * lowest_supply, highest_supply), ..limits },
        ),
        (
            "highest supply",
            fault(Fault::OverVoltage),
            Limits { bus_voltage: (lowest_supply, part * highest_supply), ..limits },
        ),
        ("regeneration band", Shows::Less, Limits { regeneration_band: part * regeneration_band, ..limits }),
        (
            "bridge temperature",
            fault(Fault::BridgeTemperature),
            Limits { bridge_temperature: part * bridge_temperature, ..limits },
        ),
        (
            "winding temperature",
            fault(Fault::WindingTemperature),
            Limits { winding_temperature: part * winding_temperature, ..limits },
        ),
        (
            "command deadline",
            fault(Fault::StaleCommand),
            Limits { command_deadline: part * command_deadline, ..limits },
        ),
    ]
    .map(|(name, shows, limits)| {
        let mut moved = board;
        moved.joint.limits = limits;
        (name, shows, moved)
    })
    .into()
}
