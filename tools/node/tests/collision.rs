//! Reactions to a collision as a master on the bus sees them, in simulated time. The joint moves at 0.5 rad/s in
//! velocity mode, and a hand pushes against it.

mod master;

use joint_firmware::joint::Telemetry;
use joint_firmware::joint::state_machine::State;
use master::Master;
use node::{SampleImage, SlotImages};
use plant::ActuatorParameters;

const ENABLE: u16 = 0x0F;
const HALT: u16 = 1 << 8;
const FOLLOWS: i64 = 1 << 12;
const COLLISION: u16 = 0xFF04;
/// Torque of the hand, Nm: of a joint with 90 Nm and 4 Nm of friction.
const HAND: f64 = 25.0;
/// Threshold, Nm: the image knows 0.05 Nm of the friction.
const THRESHOLD: f32 = 8.0;
const SPEED: i32 = 500;

const OFF: u8 = 0;
const WARNING: u8 = 1;
const QUICK_STOP: u8 = 2;
const HOLD: u8 = 3;
const YIELD: u8 = 4;

/// A joint with a reaction in motion.
fn moving(reaction: u8, quick_stop: i16) -> Master {
    let parameters = ActuatorParameters::reference().aligned().without_payload();
    let mut images = SlotImages::empty().unwrap();
    images.store(&SampleImage::constant(2, 0.05)).unwrap();
    let mut master = Master::with(images);
    master.download(0x2200, 1, &[1]).unwrap();
    master.download(0x2202, 2, &(parameters.joint.inertia() as f32).to_le_bytes()).unwrap();
    master.download(0x2203, 1, &THRESHOLD.to_le_bytes()).unwrap();
    master.download(0x2203, 2, &[reaction]).unwrap();
    master.download(0x605A, 0, &quick_stop.to_le_bytes()).unwrap();
    master.enabled();
    master.drive(ENABLE, SPEED, 400);
    assert_eq!(master.number(0x2203, 6), 0, "friction alone is no collision");
    master
}

fn velocity(master: &Master) -> f64 {
    master.node.joint().actuator().state().joint.velocity
}

fn position(master: &Master) -> f64 {
    master.node.joint().actuator().state().joint.position
}

/// Motor torque, Nm.
fn torque(master: &Master) -> f64 {
    master.node.joint().joint().telemetry().mean_torque.into()
}

/// The hand pushes while the master sends its set-points on.
fn push(master: &mut Master, hand: f64, milliseconds: u64) {
    master.node.push(hand);
    master.drive(ENABLE, SPEED, milliseconds);
    master.node.push(0.0);
}

#[test]
fn without_a_reaction_a_collision_is_counted_and_with_a_warning_it_is_told_once() {
    for reaction in [OFF, WARNING] {
        let mut master = moving(reaction, 2);
        push(&mut master, -HAND, 300);
        let told = master.emergencies().iter().filter(|code| **code == COLLISION).count();
        assert_eq!((master.number(0x2203, 6), told), (1, usize::from(reaction)));
        let status = master.number(0x6041, 0);
        assert_eq!((master.state(), status & FOLLOWS), (State::OperationEnabled, FOLLOWS));
        master.drive(ENABLE, SPEED, 300);
        assert!((velocity(&master) - 0.5).abs() < 0.1, "{} rad/s", velocity(&master));
    }
}

#[test]
fn the_external_torque_and_its_uncertainty_can_be_read() {
    let mut master = moving(OFF, 2);
    master.node.push(-HAND);
    master.drive(ENABLE, SPEED, 200);
    let rated = 1e-3 * master.number(0x6076, 0) as f64;
    let [found, bound] = [master.number(0x2203, 4) as i16, master.number(0x2203, 5) as i16];
    let [found, bound] = [found, bound].map(|permille| 1e-3 * f64::from(permille) * rated);
    // Friction, which the image does not know, pushes against the motion, too.
    assert!((-HAND - 6.0..-HAND - 2.0).contains(&found), "{found} Nm");
    assert!((0.5..4.0).contains(&bound), "{bound} Nm");
}

#[test]
fn a_quick_stop_is_that_of_its_option_code_and_lasts_until_a_controlword_asks_for_less() {
    for (option, expected) in [(0, State::SwitchOnDisabled), (2, State::SwitchOnDisabled), (6, State::QuickStopActive)]
    {
        let mut master = moving(QUICK_STOP, option);
        push(&mut master, -HAND, 60);
        assert!(master.emergencies().contains(&COLLISION));
        master.drive(ENABLE, SPEED, 800);
        assert_eq!(master.state(), expected, "605Ah = {option}: the set-points go on");
        assert!(velocity(&master).abs() < 0.01, "605Ah = {option}: {} rad/s", velocity(&master));
        for word in [6, 7, ENABLE] {
            master.drive(word, 0, 10);
        }
        master.drive(ENABLE, SPEED, 400);
        assert_eq!(master.state(), State::OperationEnabled, "605Ah = {option}");
        assert!((velocity(&master) - 0.5).abs() < 0.1, "605Ah = {option}: {} rad/s", velocity(&master));
    }
}

#[test]
fn with_its_bridge_off_the_arm_goes_with_the_hand_and_braked_it_does_not() {
    let way = |option| {
        let mut master = moving(QUICK_STOP, option);
        let begin = position(&master);
        push(&mut master, -HAND, 150);
        position(&master) - begin
    };
    let [off, holds] = [way(0), way(6)];
    assert!(off < -0.3, "{off} rad");
    assert!(holds.abs() < 0.1, "{holds} rad");
}

#[test]
fn a_joint_that_holds_stays_where_it_stopped_and_follows_again_after_halt() {
    let mut master = moving(HOLD, 2);
    push(&mut master, -HAND, 200);
    let stands = position(&master);
    push(&mut master, -HAND, 300);
    let status = master.number(0x6041, 0);
    assert_eq!((master.state(), status & FOLLOWS), (State::OperationEnabled, 0), "{status:#06x}");
    assert!(velocity(&master).abs() < 0.02, "{} rad/s", velocity(&master));
    assert!((position(&master) - stands).abs() < 0.02, "{} rad", position(&master) - stands);
    master.node.push(-HAND);
    master.drive(ENABLE, SPEED, 100);
    assert!((torque(&master) - HAND).abs() < 5.0, "it presses against the hand: {} Nm", torque(&master));
    master.node.push(0.0);
    master.drive(ENABLE, SPEED, 300);
    assert!(velocity(&master).abs() < 0.02, "nobody has acknowledged it: {} rad/s", velocity(&master));
    master.drive(ENABLE | HALT, SPEED, 20);
    master.drive(ENABLE, SPEED, 400);
    assert!((velocity(&master) - 0.5).abs() < 0.1, "{} rad/s", velocity(&master));
    assert_ne!(master.number(0x6041, 0) & FOLLOWS, 0);
}

#[test]
fn a_joint_that_gives_way_goes_with_the_hand_without_torque_and_stops_where_it_is_left() {
    let mut master = moving(YIELD, 2);
    let begin = position(&master);
    push(&mut master, -HAND, 60);
    let way = position(&master) - begin;
    assert!(way < -0.05, "it went with the hand: {way} rad");
    assert!(torque(&master).abs() < 0.5, "{} Nm", torque(&master));
    let status = master.number(0x6041, 0);
    assert_eq!((master.state(), status & FOLLOWS), (State::OperationEnabled, 0));
    // Friction brakes it.
    master.drive(ENABLE, SPEED, 1_000);
    let left = position(&master);
    master.drive(ENABLE, SPEED, 300);
    assert!((position(&master) - left).abs() < 1e-3, "{} rad", position(&master) - left);
    master.drive(7, 0, 20);
    master.drive(ENABLE, SPEED, 400);
    assert!((velocity(&master) - 0.5).abs() < 0.1, "{} rad/s", velocity(&master));
}

/// Position and telemetry every 10 ms, through a push that is a collision.
fn course(mut master: Master) -> Vec<(u64, Telemetry)> {
    let mut course = vec![];
    for hand in [0.0, -HAND, 0.0, HAND, 0.0] {
        master.node.push(hand);
        for _ in 0..15 {
            master.drive(ENABLE, SPEED, 10);
            course.push((position(&master).to_bits(), master.node.joint().joint().telemetry()));
        }
    }
    course
}

#[test]
fn an_observer_without_a_reaction_changes_no_bit_of_the_joint() {
    let prepared = |reaction, inertia: f32, threshold: f32| {
        let mut master = moving(reaction, 2);
        master.download(0x2202, 2, &inertia.to_le_bytes()).unwrap();
        master.download(0x2203, 1, &threshold.to_le_bytes()).unwrap();
        master
    };
    let without = course(prepared(OFF, 0.0, 0.0));
    for (reaction, inertia, threshold) in [(OFF, 0.25, 8.0), (OFF, 0.25, 0.0), (WARNING, 0.25, 8.0), (HOLD, 0.0, 0.0)] {
        let with = course(prepared(reaction, inertia, threshold));
        let first = with.iter().zip(&without).position(|(with, without)| with != without);
        assert_eq!(first, None, "reaction {reaction}, {inertia} kg m², {threshold} Nm");
    }
    let reacts = course(prepared(HOLD, 0.25, 8.0));
    assert!(reacts != without, "a reaction is seen");
}
