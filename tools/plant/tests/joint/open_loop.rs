//! A joint that nobody has described under an open-loop voltage: what it gives, what stops it, and how soon; host.

use crate::rig::{Rig, break_down, reset, velocity};
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Command, Mode};
use joint_firmware::motor::angle::{Direction, ElectricalAngle, EncoderAlignment};
use joint_firmware::motor::open_loop::{Frame, Window};
use plant::actuator::{ActuatorParameters, Fault as Broken};
use plant::virtual_joint::Setup;

fn open_loop(frame: Frame) -> Command {
    Command { mode: Mode::OpenLoop, open_loop: frame, ..Command::NOTHING }
}

/// An actuator that nobody has aligned, and a configuration that is wrong in everything that commissioning finds.
fn unknown(seed: u64) -> (ActuatorParameters, Setup) {
    let parameters = ActuatorParameters::randomised(seed).without_payload();
    let mut setup = Setup::of(&parameters);
    let motor = &mut setup.configuration.motor;
    motor.resistance *= 1.7;
    motor.inductance_d *= 0.6;
    motor.inductance_q *= 0.6;
    motor.alignment =
        EncoderAlignment { pole_pairs: 3, direction: Direction::Reverse, electrical_zero: ElectricalAngle(1 << 30) };
    (parameters, setup)
}

/// A joint under a voltage.
fn applying(seed: u64, frame: Frame) -> Rig {
    let (parameters, setup) = unknown(seed);
    enabled(parameters, &setup, frame)
}

/// The same of a joint as it is described.
fn enabled(parameters: ActuatorParameters, setup: &Setup, frame: Frame) -> Rig {
    let mut rig = Rig::off(parameters, setup);
    rig.demand.command = open_loop(frame);
    rig.run(0.1);
    assert_eq!((rig.state(), rig.is_switching()), (State::SwitchOnDisabled, false));
    for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::ENABLE_OPERATION] {
        rig.demand.controlword = word;
        rig.step();
    }
    assert_eq!((rig.state(), rig.is_switching()), (State::OpenLoop, true), "{:?}", rig.latched());
    rig
}

/// The first whole window after `seconds` more.
fn window(rig: &mut Rig, seconds: f64) -> Window {
    rig.run(seconds);
    let before = rig.joint.joint().window().number;
    while rig.joint.joint().window().number < before + 2 {
        rig.step();
        assert_eq!(rig.state(), State::OpenLoop, "{:?}", rig.latched());
    }
    *rig.joint.joint().window()
}

const TURNING: Frame = Frame { voltage: 1_000, speed: 100, along: 0, across: 0 };

#[test]
fn the_windows_of_a_motor_that_is_not_described_tell_its_resistance() {
    for seed in 0..6 {
        let (parameters, setup) = unknown(seed);
        let limit = f64::from(setup.configuration.motor.current_limit);
        let mut rig = applying(seed, Frame::default());
        // Up to half of the current limit.
        let mut voltage = 0;
        loop {
            voltage += 50;
            rig.demand.command = open_loop(Frame { voltage, ..Frame::default() });
            if f64::from(window(&mut rig, 0.02).current.d) > 0.5 * limit {
                break;
            }
        }
        let mut at = |part: f32| {
            let voltage = (part * f32::from(voltage)) as u16;
            rig.demand.command = open_loop(Frame { voltage, ..Frame::default() });
            window(&mut rig, 1.0)
        };
        let (second, first) = (at(1.0), at(0.6));
        let (rise, volts) = (second.current.d - first.current.d, second.voltage.d - first.voltage.d);
        let resistance = f64::from(volts / rise);
        let expected = parameters.joint.motor.resistance / 1.5 + parameters.inverter.on_resistance;
        assert!((resistance / expected - 1.0).abs() < 0.1, "seed {seed}: {resistance} of {expected} Ohm");
    }
}

#[test]
fn whatever_takes_it_away_switches_the_bridge_off_in_the_same_step() {
    type Way = (&'static str, fn(&mut Rig));
    let ways: [Way; 9] = [
        ("disable voltage", |rig| rig.demand.controlword = Controlword::DISABLE_VOLTAGE),
        ("quick stop", |rig| rig.demand.controlword = Controlword::QUICK_STOP),
        ("fault reset", |rig| rig.demand.controlword = Controlword::FAULT_RESET),
        ("shutdown", |rig| rig.demand.controlword = Controlword::SHUTDOWN),
        ("switch on", |rig| rig.demand.controlword = Controlword::SWITCH_ON),
        ("another mode", |rig| rig.demand.command = velocity(0.5)),
        ("gate driver", |rig| break_down(rig, Broken::GateDriver)),
        ("overrun", |rig| rig.always_late = true),
        ("no supply", |rig| break_down(rig, Broken::SourceVoltage(0.0))),
    ];
    for (name, take_away) in ways {
        let mut rig = applying(1, TURNING);
        rig.run(0.2);
        assert_eq!(rig.state(), State::OpenLoop, "{name}");
        take_away(&mut rig);
        if name == "no supply" {
            // The capacitor takes some steps to its limit: then at once.
            while rig.latched().is_empty() {
                rig.step();
            }
            assert_eq!(rig.latched(), [Fault::UnderVoltage]);
        } else {
            rig.step();
        }
        assert!(!rig.is_switching(), "{name}: {:?}", rig.state());
        // Nor does it begin again by itself, where the controlword stays as it is.
        if name != "another mode" {
            rig.demand.controlword = Controlword::DISABLE_VOLTAGE;
        }
        for _ in 0..1_000 {
            rig.step();
            assert!(!rig.is_switching(), "{name}");
        }
    }
}

#[test]
fn a_command_that_is_not_renewed_for_a_tenth_of_a_second_switches_off() {
    let mut rig = applying(2, TURNING);
    rig.run(0.2);
    let deadline = rig.steps_in(0.1);
    rig.silent = true;
    while rig.without_set_point < deadline {
        rig.step();
        assert_eq!(rig.state(), State::OpenLoop, "{} steps", rig.without_set_point);
    }
    rig.step();
    assert_eq!((rig.state(), rig.is_switching()), (State::Fault, false));
    assert_eq!(rig.latched(), [Fault::StaleCommand]);
    rig.silent = false;
    rig.run(0.01);
    reset(&mut rig);
    assert_eq!(rig.state(), State::SwitchOnDisabled);
}

#[test]
fn a_shorter_deadline_of_the_configuration_counts_and_a_longer_one_does_not() {
    for (configured, expected) in [(0.02, 0.02), (1.0, 0.1)] {
        let (parameters, mut setup) = unknown(2);
        setup.configuration.limits.command_deadline = configured;
        let mut rig = Rig::off(parameters, &setup);
        rig.demand.command = open_loop(TURNING);
        rig.run(0.1);
        for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::ENABLE_OPERATION] {
            rig.demand.controlword = word;
            rig.step();
        }
        rig.run(0.05);
        rig.silent = true;
        let steps = rig.steps_to_fault(10_000).unwrap();
        let most = rig.steps_in(expected) + 1;
        assert!((most - 20..=most).contains(&steps), "{steps} steps with a deadline of {configured} s");
    }
}

/// A joint under a voltage that its current limit lowers, after two seconds; and the largest current in the windings,
/// A.
fn at_its_limit(seed: u64, limit: Option<f32>, frame: Frame) -> (Rig, f32) {
    let (parameters, mut setup) = unknown(seed);
    if let Some(limit) = limit {
        setup.configuration.motor.current_limit = limit;
    }
    let mut rig = enabled(parameters, &setup, frame);
    let mut largest = 0f64;
    for _ in 0..rig.steps_in(2.0) {
        rig.step();
        assert_eq!(rig.state(), State::OpenLoop, "seed {seed}: {:?}", rig.latched());
        let [d, q] = rig.joint.actuator().state().dq_current;
        largest = largest.max(d.hypot(q));
    }
    println!("seed {seed}, {frame:?}: {largest:.2} A of {:.2} A", setup.configuration.motor.current_limit);
    (rig, largest as f32)
}

/// Excess over the limit is nearer to a current than to a part of the limit: of a limit far below the motor's own it is
/// more.
#[test]
fn a_current_passes_its_limit_by_no_more_than_the_documentation_says() {
    let frames = [(0, 0), (300, 0), (0, 20_000), (300, 20_000)].map(|(speed, along)| Frame {
        voltage: 12_000,
        speed,
        along,
        across: 0,
    });
    for (seed, limit, most) in [(0, None, 1.05), (11, None, 1.05), (6, Some(5.0), 1.3), (19, Some(2.0), 2.2)] {
        let parts = frames.map(|frame| {
            let (rig, largest) = at_its_limit(seed, limit, frame);
            largest / rig.joint.active().current_limit
        });
        assert!(parts.iter().all(|part| (0.98..most).contains(part)), "seed {seed}, {limit:?} A: {parts:?}");
    }
}

#[test]
fn the_current_stays_at_the_joints_limit_and_shows_as_torque() {
    for seed in [0, 1, 2, 3, 4, 5, 11, 19] {
        let (rig, largest) = at_its_limit(seed, None, Frame { voltage: u16::MAX, ..Frame::default() });
        let limit = rig.joint.active().current_limit;
        // docs/commissioning.md tells of these.
        assert!((0.98..1.05).contains(&(largest / limit)), "seed {seed}: {largest} of {limit} A");
        let telemetry = rig.joint.joint().telemetry();
        let current = telemetry.current.norm_squared().sqrt();
        let expected = current * rig.joint.active().scales.torque_per_current;
        assert!((telemetry.measured_torque / expected - 1.0).abs() < 0.2, "seed {seed}");
        assert_eq!(telemetry.statusword() & 0x406F, 0x4027);
    }
}

#[test]
fn a_joint_in_motion_brakes_first_and_stays_off() {
    let mut rig = Rig::following(velocity(1.0), 0.4);
    rig.demand.command = open_loop(TURNING);
    assert_eq!(rig.step(), State::QuickStopActive);
    for _ in 0..rig.steps_in(1.5) {
        assert_ne!(rig.step(), State::OpenLoop);
    }
    assert_eq!((rig.state(), rig.is_switching()), (State::SwitchOnDisabled, false));
    assert!(rig.velocity().abs() < 0.1);
}
