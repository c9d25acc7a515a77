//! Every way to stop, with every option code, in every mode, of a joint that bears a load: what the arm does, with a
//! holding brake and without. The table is published in
//! `docs/stops.md`; `UPDATE_DOCS=1 cargo test -p plant --test joint stops` writes it anew.

use crate::heartbeat::Alive;
use crate::rig::{Rig, break_down, position, reference, torque, velocity};
use joint_firmware::joint::active::DERATING;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::stop_options::StopConfiguration;
use joint_firmware::joint::{Command, CommandLimits, Mode};
use joint_firmware::objects::Operation;
use plant::actuator::{Accessories, Fault as Broken};
use plant::virtual_joint::Setup;
use std::fmt::Write;

/// Times in which the holding brake opens and closes, s.
const BRAKE: (f32, f32) = (0.15, 0.1);
/// Position of the arm when it is stopped, about, rad: nearly level. And how fast it goes, rad/s.
pub const LEVEL: f32 = 1.3;
pub const SPEED: f32 = 0.5;
/// An arm that moves less, rad, holds.
const HOLDS: f64 = 0.02;
const MODES: [Operation; 8] = [
    Operation::None,
    Operation::ProfilePosition,
    Operation::ProfileVelocity,
    Operation::Homing,
    Operation::Position,
    Operation::Velocity,
    Operation::Torque,
    Operation::Impedance,
];
/// Gain of the master that commands torques, Nm s/rad.
pub const TORQUE_GAIN: f32 = 60.0;
/// Acceleration of profiles, rad/s².
pub const ACCELERATION: f32 = 8.0;
/// Distance from where a profile begins to where it ends, rad.
pub const FAR: f32 = 0.6;
/// The same of homing: the next index is less than a turn of the rotor away.
const INDEX: f32 = 0.12;

/// A way to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    QuickStop,
    Nmt,
    /// The master's heartbeat stays away, with this behaviour (1029h).
    Heartbeat(u8),
    Shutdown,
    DisableOperation,
    Halt,
    DisableVoltage,
    LateCommand,
    BrakingFault,
    BridgeFault,
}

impl Way {
    const fn name(self) -> &'static str {
        match self {
            Self::QuickStop => "quick stop",
            Self::Nmt => "NMT leaves OPERATIONAL",
            Self::Heartbeat(0) => "a lost heartbeat, 1029h = 0",
            Self::Heartbeat(_) => "a lost heartbeat, 1029h = 2",
            Self::Shutdown => "shutdown",
            Self::DisableOperation => "disable operation",
            Self::Halt => "halt",
            Self::DisableVoltage => "disable voltage",
            Self::LateCommand => "the client is gone",
            Self::BrakingFault => "a fault that permits braking",
            Self::BridgeFault => "a fault of the bridge",
        }
    }
}

/// An option, as the table names it, and how it is set.
type Choice = (&'static str, fn(&mut StopConfiguration));

const QUICK_STOPS: [Choice; 5] = [
    ("605Ah = 0", |s| s.quick_stop = 0),
    ("605Ah = 1", |s| s.quick_stop = 1),
    ("605Ah = 2", |s| s.quick_stop = 2),
    ("605Ah = 5", |s| s.quick_stop = 5),
    ("605Ah = 6", |s| s.quick_stop = 6),
];

fn choices(way: Way) -> Vec<Choice> {
    match way {
        Way::QuickStop | Way::Nmt | Way::Heartbeat(_) => QUICK_STOPS.to_vec(),
        Way::Shutdown => vec![("605Bh = 0", |s| s.shutdown = 0), ("605Bh = 1", |s| s.shutdown = 1)],
        Way::DisableOperation => {
            vec![("605Ch = 0", |s| s.disable_operation = 0), ("605Ch = 1", |s| s.disable_operation = 1)]
        }
        Way::Halt => vec![("605Dh = 1", |s| s.halt = 1), ("605Dh = 2", |s| s.halt = 2)],
        Way::LateCommand => vec![
            ("6007h = 1, 605Eh = 0", |s| s.fault_reaction = 0),
            ("6007h = 1, 605Eh = 1", |s| s.fault_reaction = 1),
            ("6007h = 1, 605Eh = 2", |s| s.fault_reaction = 2),
            ("6007h = 3, 605Ah = 0", |s| (s.late_command, s.quick_stop) = (3, 0)),
            ("6007h = 3, 605Ah = 1", |s| (s.late_command, s.quick_stop) = (3, 1)),
            ("6007h = 3, 605Ah = 2", |s| (s.late_command, s.quick_stop) = (3, 2)),
            ("6007h = 3, 605Ah = 5", |s| (s.late_command, s.quick_stop) = (3, 5)),
            ("6007h = 3, 605Ah = 6", |s| (s.late_command, s.quick_stop) = (3, 6)),
        ],
        Way::BrakingFault => vec![
            ("605Eh = 0", |s| s.fault_reaction = 0),
            ("605Eh = 1", |s| s.fault_reaction = 1),
            ("605Eh = 2", |s| s.fault_reaction = 2),
        ],
        Way::DisableVoltage | Way::BridgeFault => vec![("", |_| {})],
    }
}

const WAYS: [Way; 11] = [
    Way::QuickStop,
    Way::Nmt,
    Way::Heartbeat(0),
    Way::Heartbeat(2),
    Way::LateCommand,
    Way::Halt,
    Way::DisableOperation,
    Way::Shutdown,
    Way::DisableVoltage,
    Way::BrakingFault,
    Way::BridgeFault,
];

/// Limits of a mode's command: a profile's speed, and accelerations of its own.
fn limits(mode: Operation) -> CommandLimits {
    match mode {
        Operation::ProfilePosition | Operation::Homing | Operation::ProfileVelocity => {
            CommandLimits::new(SPEED, ACCELERATION, ACCELERATION, f32::INFINITY)
        }
        _ => CommandLimits::NONE,
    }
}

/// A loaded arm, nearly level, that rises in a mode; in mode 0 it holds, as nothing moves it.
///
/// Commands are those of `objects::set_points`. Homing moves as a profile does, and the zero that follows changes
/// nothing of the motion.
fn rising(mode: Operation, stops: StopConfiguration, brake: bool) -> Rig {
    let parameters = reference().with_payload(3.0, 0.3);
    let mut setup = Setup::of(&parameters);
    setup.configuration.stops = stops;
    if brake {
        (setup.configuration.stops.brake_release, setup.configuration.stops.brake_apply) = BRAKE;
    }
    let mut rig = Rig::off(parameters, &setup);
    let fitted = brake.then_some((f64::from(BRAKE.0), f64::from(BRAKE.1)));
    rig.joint.actuator_mut().fit(Accessories { brake: fitted, ..Accessories::default() });
    rig.enable();
    rig.follow(position(LEVEL), 2.5);
    let bears = rig.joint.actuator().state().joint.load_torque as f32;
    let gains = setup.configuration.gains;
    let at = rig.position() as f32;
    let mut time = 0.0;
    while time < 0.2 {
        let goal = at + SPEED * time;
        let command = match mode {
            Operation::ProfilePosition | Operation::Homing => {
                let far = if mode == Operation::Homing { INDEX } else { FAR };
                Command { mode: Mode::Profile, position: at + far, limits: limits(mode), ..Command::NOTHING }
            }
            Operation::None => Command { mode: Mode::Hold, ..Command::NOTHING },
            Operation::ProfileVelocity | Operation::Velocity => Command { limits: limits(mode), ..velocity(SPEED) },
            // Its master controls the speed.
            Operation::Torque => torque(bears + TORQUE_GAIN * (SPEED - rig.velocity() as f32)),
            Operation::Impedance => Command {
                mode: Mode::Impedance,
                position: goal,
                velocity: SPEED,
                torque: bears,
                stiffness: gains.stiffness,
                damping: gains.damping,
                ..Command::NOTHING
            },
            _ => position(goal + 0.1),
        };
        rig.follow(command, 1e-3);
        time += 1e-3;
    }
    match mode {
        Operation::None => assert!(rig.velocity().abs() < 0.05, "{} rad/s", rig.velocity()),
        _ => assert!(rig.velocity() > 0.8 * f64::from(SPEED), "{mode:?}: {} rad/s", rig.velocity()),
    }
    rig
}

/// Motion of the arm.
#[derive(Clone, Copy, Debug)]
pub struct Stopped {
    /// Distance that it went on upwards, rad, and that it then sank, within two seconds.
    pub way: f64,
    pub sank: f64,
    /// `true` if it still moves.
    pub falls: bool,
    pub state: State,
}

fn stopped(mode: Operation, way: Way, stops: StopConfiguration, brake: bool) -> Stopped {
    if let Way::Heartbeat(behaviour) = way {
        return Alive::rising(mode, behaviour, stops.quick_stop, brake.then_some(BRAKE)).lost();
    }
    let mut rig = rising(mode, stops, brake);
    let start = rig.position();
    match way {
        Way::Heartbeat(_) => {}
        Way::QuickStop => rig.demand.controlword = Controlword::QUICK_STOP,
        Way::Nmt => {
            // Request of `objects::process_image`: once, and then no set-point comes.
            (rig.demand.controlword, rig.demand.command) = (Controlword::QUICK_STOP, Command::default());
            rig.step();
            rig.silent = true;
        }
        Way::Shutdown => rig.demand.controlword = Controlword::SHUTDOWN,
        Way::DisableOperation => rig.demand.controlword = Controlword::SWITCH_ON,
        Way::Halt => {
            // Request of `objects::set_points`.
            rig.demand.controlword = Controlword(Controlword::ENABLE_OPERATION.0 | Controlword::HALT.0);
            rig.demand.command = Command { mode: Mode::Hold, limits: limits(mode), ..Command::NOTHING };
        }
        Way::DisableVoltage => rig.demand.controlword = Controlword::DISABLE_VOLTAGE,
        Way::LateCommand => rig.silent = true,
        Way::BrakingFault => {
            let mut active = rig.joint.active().clone();
            active.fault_position.1 = rig.position() as f32;
            rig.joint.set_active(active);
        }
        Way::BridgeFault => break_down(&mut rig, Broken::GateDriver),
    }
    let (mut highest, mut lowest) = (start, f64::INFINITY);
    for _ in 0..rig.steps_in(2.0) {
        rig.step();
        let now = rig.position();
        if now > highest {
            (highest, lowest) = (now, now);
        }
        lowest = lowest.min(now);
    }
    let falls = rig.velocity().abs() > 0.05;
    Stopped { way: highest - start, sank: highest - lowest, falls, state: rig.state() }
}

/// Returns `true` if a mode's set-point has to be renewed; a profile position and homing end by themselves, and mode 0
/// has none.
fn is_renewed(mode: Operation) -> bool {
    !matches!(mode, Operation::ProfilePosition | Operation::Homing | Operation::None)
}

/// Motion in each mode in which the way is one.
fn in_each_mode(way: Way, stops: StopConfiguration, brake: bool) -> Vec<(Operation, Stopped)> {
    let modes = MODES.into_iter().filter(|mode| way != Way::LateCommand || is_renewed(*mode));
    modes.map(|mode| (mode, stopped(mode, way, stops, brake))).collect()
}

/// The worst over all modes.
fn worst(all: &[(Operation, Stopped)]) -> Stopped {
    all.iter()
        .map(|(_, stopped)| *stopped)
        .reduce(|a, b| {
            if b.sank > a.sank {
                Stopped { way: a.way.max(b.way), ..b }
            } else {
                Stopped { way: a.way.max(b.way), ..a }
            }
        })
        .unwrap()
}

const HEAD: &str = "# What the arm does

A joint that bears 3 kg on 0.3 m, nearly level, rises at 0.5 rad/s and is stopped in every way, with every option code, in eight modes
(profile position, profile velocity, homing to an index, cyclic synchronous position, velocity and torque, impedance; and mode 0, in which nothing moves it: it holds there and is stopped). It is the virtual joint with its friction; its numbers are of this joint alone, and the words hold for every one: `tools/plant/tests/joint/stops.rs`
asserts them, and `UPDATE_DOCS=1 cargo test -p plant --test joint stops` writes this page anew. The option codes are those of CiA 402-2 (6007h, 605Ah to 605Eh, [objects](objects.md));
`[stops]` in joint.toml. The brake opens in 0.15 s and closes in 0.1 s, and both times are configured (2109h).

- way: how far it goes on before it turns or stands, rad; the largest of all modes.
- sinks: how far it is below that 2 s later, rad; of the mode in which it is most. Whether it holds or falls is the same in all modes. Below 0.02 rad it *holds*; a brake that has to close first lets it sink a little.
- Before the bridge goes off at once nothing closes a brake: disable voltage, code 0, and faults of the bridge or the current loop have the arm without support for its time.
- A client that is gone stops nothing in profile position, homing and mode 0: there no set-point has to be renewed, and the arm goes on to where it was sent, and holds. A lost heartbeat stops it there, too.
- A lost heartbeat is that of a master that falls silent altogether, seen through the objects: 1016h calls it lost after 50 ms, in which the arm goes on. Then 1029h decides: 0 leaves OPERATIONAL for PRE-OPERATIONAL, 2 for STOPPED, and 605Ah holds for both; with 1 it stops nothing, and the set-points that are not renewed do.

| stopped by | option | way | sinks | with a brake: way | sinks |
|---|---|---|---|---|---|
";

fn sinks(stopped: &Stopped) -> String {
    match stopped.sank {
        sank if sank < HOLDS => "holds".to_owned(),
        sank if sank > 0.5 => format!("falls, {sank:.1}"),
        sank => format!("{sank:.2}"),
    }
}

#[test]
fn every_way_to_stop_does_what_its_option_says_with_a_load_on_the_arm() {
    let mut text = HEAD.to_owned();
    for way in WAYS {
        for (name, change) in choices(way) {
            let mut stops = StopConfiguration::DEFAULT;
            change(&mut stops);
            let (without, with) = (in_each_mode(way, stops, false), in_each_mode(way, stops, true));
            let (way_name, off) = (way.name(), name.ends_with("= 0") || name.is_empty());
            let holds = matches!(way, Way::Halt) || name.ends_with("605Ah = 5") || name.ends_with("605Ah = 6");
            for (mode, without) in &without {
                assert_eq!(without.sank < HOLDS, holds, "{way_name} {name} {mode:?}: {without:?}");
                if holds && !matches!(way, Way::Halt) {
                    assert_eq!(without.state, State::QuickStopActive, "{way_name} {name} {mode:?}");
                }
            }
            for (mode, with) in &with {
                // With a brake nothing falls; what is switched off at once sinks for the time in which it closes.
                assert!(!with.falls, "{way_name} {name} {mode:?}: {with:?}");
                assert_eq!(with.sank < HOLDS, !off, "{way_name} {name} {mode:?}: {with:?}");
            }
            let (without, with) = (worst(&without), worst(&with));
            let (a, b) = (sinks(&without), sinks(&with));
            writeln!(text, "| {way_name} | {name} | {:.2} | {a} | {:.2} | {b} |", without.way, with.way).unwrap();
        }
    }
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/stops.md");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(file, &text).unwrap();
    }
    let found = std::fs::read_to_string(file).unwrap_or_default();
    assert!(found == text, "docs/stops.md is not what the joint does; UPDATE_DOCS=1 writes it anew");
}

#[test]
fn a_client_that_is_gone_stops_no_motion_that_ends_by_itself() {
    for mode in MODES {
        let stopped = stopped(mode, Way::LateCommand, StopConfiguration::DEFAULT, false);
        if is_renewed(mode) {
            assert_eq!(stopped.state, State::Fault, "{mode:?}");
            continue;
        }
        // It began 0.2 s before the client went.
        let rest = f64::from(match mode {
            Operation::None => 0.0,
            Operation::Homing => INDEX - 0.2 * SPEED,
            _ => FAR - 0.2 * SPEED,
        });
        assert!((stopped.way - rest).abs() < 0.03, "{mode:?}: {stopped:?}, {rest} rad were left");
        assert!(stopped.state == State::OperationEnabled && stopped.sank < HOLDS, "{mode:?}: {stopped:?}");
    }
}

/// A braked joint that somebody enables, with a target to go to at once.
fn enabled_with_brake() -> Rig {
    let parameters = reference().with_payload(3.0, 0.3);
    let mut setup = Setup::of(&parameters);
    (setup.configuration.stops.brake_release, setup.configuration.stops.brake_apply) = BRAKE;
    setup.configuration.stops.disable_operation = 1;
    let mut rig = Rig::off(parameters, &setup);
    let brake = Some((f64::from(BRAKE.0), f64::from(BRAKE.1)));
    rig.joint.actuator_mut().fit(Accessories { brake, ..Accessories::default() });
    rig.enable();
    rig.demand.command = position(0.5);
    rig
}

fn is_gripped(rig: &Rig) -> bool {
    rig.joint.actuator().fitted().grip().is_some()
}

#[test]
fn an_enabled_joint_holds_until_its_brake_is_open_and_says_so() {
    let mut rig = enabled_with_brake();
    let steps = rig.steps_in(BRAKE.0.into());
    for step in 0..steps - 2 {
        rig.step();
        let telemetry = rig.joint.joint().telemetry();
        assert!(telemetry.held && telemetry.outputs.brake_open(), "{step}");
        assert!(rig.joint.joint().telemetry().wanted.velocity.unwrap_or(0.0).abs() < 1e-3, "{step}");
    }
    rig.run(0.01);
    assert!(!rig.joint.joint().telemetry().held && !is_gripped(&rig));
    rig.run(1.5);
    assert!((rig.position() - 0.5).abs() < 0.02);
}

#[test]
fn operation_enabled_again_while_the_brake_closes_waits_until_it_is_open() {
    let mut rig = enabled_with_brake();
    rig.run(1.5);
    rig.demand.controlword = Controlword::SWITCH_ON;
    while rig.joint.joint().outputs().brake_open() {
        assert_eq!(rig.step(), State::OperationEnabled);
    }
    rig.run(0.5 * f64::from(BRAKE.1));
    assert_eq!(rig.state(), State::OperationEnabled);
    rig.demand.controlword = Controlword::ENABLE_OPERATION;
    rig.demand.command = position(-0.5);
    rig.step();
    assert!(rig.joint.joint().outputs().brake_open());
    let before = rig.position();
    rig.run(0.9 * f64::from(BRAKE.0));
    assert!(rig.joint.joint().telemetry().held && (rig.position() - before).abs() < 1e-3);
    rig.run(2.0);
    assert!((rig.position() + 0.5).abs() < 0.02, "{}", rig.position());
}

#[test]
fn a_bridge_is_off_only_when_the_brake_has_closed() {
    let mut rig = enabled_with_brake();
    rig.run(1.5);
    rig.demand.controlword = Controlword::SWITCH_ON;
    while rig.joint.joint().outputs().brake_open() {
        rig.step();
        assert!(rig.is_switching());
    }
    let closing = (1..10_000u32).find(|_| rig.step() == State::SwitchedOn).unwrap();
    let expected = rig.steps_in(BRAKE.1.into());
    assert!(closing.abs_diff(expected) <= 1, "{closing} control steps, not {expected}");
    assert!(!rig.is_switching());
}

/// A master that was silent and goes on as if it had not been.
#[test]
fn a_joint_that_stopped_for_a_late_command_goes_on_only_when_it_is_asked_anew() {
    let stops = StopConfiguration { late_command: 3, quick_stop: 6, ..StopConfiguration::DEFAULT };
    let mut rig = rising(Operation::Position, stops, false);
    rig.silent = true;
    rig.run(0.5);
    assert_eq!((rig.state(), rig.latched().is_empty()), (State::QuickStopActive, true));
    rig.silent = false;
    rig.run(0.5);
    assert_eq!(rig.state(), State::QuickStopActive);
    let held = rig.position();
    rig.demand.controlword = Controlword::QUICK_STOP;
    rig.step();
    rig.demand.controlword = Controlword::ENABLE_OPERATION;
    rig.demand.command = Command { mode: Mode::Hold, ..Command::NOTHING };
    rig.step();
    assert_eq!(rig.state(), State::OperationEnabled);
    rig.run(1.0);
    // The torque that bore the load goes on bearing it.
    assert!((rig.position() - held).abs() < 5e-3, "{held}: {}", rig.position());
}

#[test]
fn a_joint_that_cannot_hold_switches_off_and_closes_its_brake() {
    let stops = StopConfiguration { quick_stop: 6, ..StopConfiguration::DEFAULT };
    let mut rig = rising(Operation::Position, stops, true);
    rig.demand.controlword = Controlword::QUICK_STOP;
    rig.run(1.0);
    assert!(rig.state() == State::QuickStopActive && rig.joint.joint().outputs().brake_open());
    // Somebody pulls it down with more than it has.
    let pull = -1.5 * rig.torque_limit();
    break_down(&mut rig, Broken::ExternalTorque(pull));
    let steps = (1..200_000).find(|_| rig.step() != State::QuickStopActive).unwrap();
    let longest = rig.steps_in(1.0 + f64::from(BRAKE.1)) + 500;
    assert!(steps <= longest, "{steps} of {longest} control steps");
    assert!(!rig.is_switching() && !rig.joint.joint().outputs().brake_open());
}

/// Check that, for as long as it holds, winding and bridge bear what they bear for long.
#[test]
fn what_holds_gives_no_more_current_than_a_hot_winding_bears() {
    let stops = StopConfiguration { quick_stop: 6, ..StopConfiguration::DEFAULT };
    let mut rig = rising(Operation::Position, stops, false);
    rig.demand.controlword = Controlword::QUICK_STOP;
    rig.run(1.0);
    let current = |rig: &Rig| rig.joint.joint().telemetry().current.q.abs();
    let before = current(&rig);
    let mut active = rig.joint.active().clone();
    // A fiftieth of the derating's span is left.
    active.limits.bridge_temperature = rig.joint.measured().bridge_temperature + 0.02 * DERATING;
    let limit = active.current_limit * 0.02;
    rig.joint.set_active(active);
    rig.run(0.02);
    assert!(before > 2.0 * limit && current(&rig) < 1.3 * limit, "{before} A, {} A of {limit} A", current(&rig));
}
