//! Enabled, moved and disabled again, in every mode, and whatever happens meanwhile.

use crate::served::{DEADLINE, NODE, Served};
use joint_firmware::joint::state_machine::State;
use joint_firmware::joint::{Command, Mode};
use jointctl::remote::motion::{Motion, Observation, Outcome};
use jointctl::remote::{Entry, RemoteError, RemoteJoint, Stream, configuration, info};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

fn motion(command: Command, duration: f64) -> Motion {
    Motion { command, duration, rate: 100.0, acknowledge: false }
}

fn run(joint: &RemoteJoint, motion: &Motion) -> Result<(Outcome, Vec<Observation>), RemoteError> {
    let mut seen = Vec::new();
    let outcome = motion.run(joint, &|| true, &mut |observation| seen.push(*observation))?;
    Ok((outcome, seen))
}

pub fn each_mode_moves_the_joint_and_leaves_it_disabled() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let velocity = Command { mode: Mode::Velocity, velocity: -0.5, ..Command::default() };
    let (outcome, _) = run(&joint, &motion(velocity, 1.5)).unwrap();
    let last = outcome.last.unwrap();
    assert!((-0.6..-0.4).contains(&last.velocity) && outcome.complete, "{last}");
    assert_eq!((outcome.state, joint.state().unwrap()), (State::SwitchOnDisabled, State::SwitchOnDisabled));

    let position = Command { mode: Mode::Position, position: 0.3, ..Command::default() };
    let last = run(&joint, &motion(position, 2.0)).unwrap().0.last.unwrap();
    assert!((0.28..0.32).contains(&last.position), "{last}");

    let impedance =
        Command { mode: Mode::Impedance, position: 0.0, stiffness: 60.0, damping: 2.0, ..Command::default() };
    let (outcome, seen) = run(&joint, &motion(impedance, 2.0)).unwrap();
    let last = outcome.last.unwrap();
    assert!((-0.15..0.15).contains(&last.position), "{last}");
    // The spring's rest position goes there slowly: no blow at the beginning.
    assert!(seen.first().unwrap().position > 0.2, "{}", seen[0]);

    let torque = Command { mode: Mode::Torque, torque: 2.0, ..Command::default() };
    let (outcome, _) = run(&joint, &motion(torque, 0.3)).unwrap();
    assert!(outcome.last.unwrap().torque > 1.5, "{}", outcome.last.unwrap());
    assert_eq!(outcome.state, State::SwitchOnDisabled);
    assert_eq!(joint.faults().unwrap(), []);
}

pub fn a_stream_of_positions_is_interpolated_and_60c2h_is_put_back() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let interpolated = || [1, 2].map(|sub_index| joint.node().upload(0x60C2, sub_index).unwrap()[0]);
    let before = interpolated();
    // 10 ms in tenths of a millisecond.
    for (mode, expected) in [(Mode::Position, [100, -4i8 as u8]), (Mode::Torque, before)] {
        let stream = Stream::begin(&joint, mode, 100.0, false).unwrap();
        assert_eq!(interpolated(), expected, "{mode:?}");
        stream.end().unwrap();
        assert_eq!(interpolated(), before, "{mode:?}");
    }
    // One that is dropped puts it back as well.
    let other = served.joint();
    let stream = Stream::begin(&other, Mode::Velocity, 100.0, false).unwrap();
    drop(stream);
    assert_eq!(interpolated(), before);
}

pub fn a_motion_beyond_a_limit_is_refused_by_name_before_the_joint_is_enabled() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    for (command, expected) in [
        (Command { mode: Mode::Torque, torque: 1e3, ..Command::default() }, "torque-limit (2103h:1)"),
        (Command { mode: Mode::Velocity, velocity: -1e3, ..Command::default() }, "velocity-limit (2103h:2)"),
        (Command { mode: Mode::Position, position: 999.0, ..Command::default() }, "highest-position (2103h:4)"),
        (Command { mode: Mode::Torque, torque: f32::NAN, ..Command::default() }, "torque-limit (2103h:1)"),
        (Command { mode: Mode::Impedance, stiffness: 600.0, ..Command::default() }, "stiffness-range (2012h:3)"),
    ] {
        let message = run(&joint, &motion(command, 1.0)).unwrap_err().to_string();
        assert!(message.contains(expected) && message.contains("node 5"), "{message}");
    }
    let message = run(&joint, &motion(Command::default(), 0.0)).unwrap_err().to_string();
    assert!(message.contains("--duration is 0 s"), "{message}");
    let deadline = Entry::one("command-deadline").unwrap();
    configuration::set(&joint, &[(deadline, deadline.parse("0.5").unwrap())]).unwrap();
    let slow = Motion { rate: 2.0, ..motion(Command::default(), 1.0) };
    let message = run(&joint, &slow).unwrap_err().to_string();
    assert!(message.contains("rate of set-points is 2 Hz, must lie in 4 to 1000 Hz"), "{message}");
    assert_eq!(joint.state().unwrap(), State::SwitchOnDisabled);
}

pub fn an_interrupt_in_motion_leaves_the_joint_disabled_and_without_a_fault() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let looks = AtomicU32::new(0);
    let running = || looks.fetch_add(1, Ordering::Relaxed) < 10;
    let command = Command { mode: Mode::Velocity, velocity: 1.0, ..Command::default() };
    let outcome = motion(command, 60.0).run(&joint, &running, &mut |_| {}).unwrap();
    assert!(!outcome.complete && outcome.last.unwrap().velocity > 0.5);
    assert_eq!((outcome.state, joint.faults().unwrap()), (State::SwitchOnDisabled, vec![]));
}

pub fn braking_may_take_longer_than_the_command_deadline() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let wanted = [("command-deadline", "1"), ("quick-stop-deceleration", "0.5")].map(|(name, text)| {
        let entry = Entry::one(name).unwrap();
        (entry, entry.parse(text).unwrap())
    });
    configuration::set(&joint, &wanted).unwrap();
    let command = Command { mode: Mode::Velocity, velocity: 1.0, ..Command::default() };
    let outcome = run(&joint, &motion(command, 1.0)).unwrap().0;
    assert!(outcome.last.unwrap().velocity > 0.9, "{}", outcome.last.unwrap());
    assert_eq!((outcome.state, joint.faults().unwrap()), (State::SwitchOnDisabled, vec![]));
}

pub fn a_master_that_dies_leaves_a_fault_that_is_named_and_acknowledged_only_when_asked() {
    let served = Served::joints(&[NODE]);
    let joint = served.joint();
    let stream = Stream::begin(&joint, Mode::Torque, 100.0, false).unwrap();
    // State as if the program had been killed after a few set-points: nothing more is sent, nothing is said.
    let mut sent = 0;
    stream.play(move |_| {
        sent += 1;
        if sent > 10 {
            loop {
                std::thread::sleep(Duration::from_secs(1));
            }
        }
        Command { mode: Mode::Torque, ..Command::default() }
    });
    joint.await_state(State::Fault, Duration::from_secs_f32(DEADLINE + 60.0)).unwrap();
    let message = stream.check().unwrap_err().to_string();
    assert!(message.contains("command deadline missed (8100h)"), "{message}");
    std::mem::forget(stream);

    let again = served.joint();
    let command = Command { mode: Mode::Torque, ..Command::default() };
    let message = run(&again, &motion(command, 0.1)).unwrap_err().to_string();
    assert!(
        message.contains("node 5 is in a fault: command deadline missed") && message.contains("--reset"),
        "{message}"
    );
    let acknowledged = Motion { acknowledge: true, ..motion(command, 0.1) };
    assert_eq!(run(&again, &acknowledged).unwrap().0.state, State::SwitchOnDisabled);
    // Acknowledged faults are in the log still.
    let page = info::page(&again).unwrap();
    assert!(page.contains("fault log       1 faults, 1 power-ups\n"), "{page}");
    assert!(
        page.contains("command deadline missed (8100h), ") && page.contains(" s after the start, power-up 1\n"),
        "{page}"
    );
}

pub fn disable_stops_a_joint_that_somebody_else_moves() {
    let served = Served::joints(&[NODE]);
    let (joint, other) = (served.joint(), served.joint());
    let stream = Stream::begin(&joint, Mode::Velocity, 100.0, false).unwrap();
    stream.set(Command { mode: Mode::Velocity, velocity: 1.0, ..Command::default() });
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(other.disable().unwrap(), State::SwitchOnDisabled);
    assert!(matches!(stream.check(), Err(RemoteError::Stopped { .. })));
    assert_eq!(stream.end().unwrap(), State::SwitchOnDisabled);
}
