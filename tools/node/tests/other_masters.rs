//! Masters that nobody here wrote, by what they send: the joint does nothing that was not asked for; simulated time.

mod master;

use bus::client::Command;
use joint_firmware::joint::state_machine::State;
use master::{ID, Master};
use plant::ActuatorParameters;

/// Controlword with halt (bit 8).
const HALT: u16 = 1 << 8;
const SHUTDOWN: u16 = 0x06;
const SWITCH_ON: u16 = 0x07;
const ENABLE: u16 = 0x0F;
const POSITION: i8 = 8;
const VELOCITY: i8 = 9;
const TORQUE: i8 = 10;
/// Largest motion of a joint before its first target, rad.
const STILL: f64 = 1e-3;
/// Position to which the joint is brought before, µrad.
const SOMEWHERE: i32 = 361_000;

/// RPDO 1 as ros2_canopen maps it: controlword, mode, target position. Its 22 SDO writes follow the procedure of CiA
/// 301.
fn map_for_ros2_canopen(master: &mut Master) {
    let id = u32::from(ID);
    master.download(0x1400, 1, &(0x8000_0200 | id).to_le_bytes()).unwrap();
    master.download(0x1600, 0, &[0]).unwrap();
    for (entry, object) in (1u8..).zip([0x6040_0010u32, 0x6060_0008, 0x607A_0020]) {
        master.download(0x1600, entry, &object.to_le_bytes()).unwrap();
    }
    master.download(0x1600, 0, &[3]).unwrap();
    master.download(0x1400, 1, &(0x200 | id).to_le_bytes()).unwrap();
}

/// Cycles of 10 ms of a master that sends all of its RPDO in each.
fn cycles(master: &mut Master, controlword: u16, mode: i8, position: i32, milliseconds: u64) {
    for _ in 0..milliseconds / 10 {
        let data = [&controlword.to_le_bytes()[..], &mode.to_le_bytes(), &position.to_le_bytes()].concat();
        master.send(0x200 + u16::from(ID), &data);
        master.send(0x080, &[]);
        master.wait(10);
    }
}

fn position(master: &Master) -> f64 {
    master.node.joint().actuator().state().joint.position
}

fn velocity(master: &Master) -> f64 {
    master.node.joint().actuator().state().joint.velocity
}

/// Farthest way from where the joint was during `part`, looked at every 10 ms; rad.
fn farthest(master: &mut Master, milliseconds: u64, mut part: impl FnMut(&mut Master)) -> f64 {
    let begun = position(master);
    let far = (0..milliseconds / 10).map(|_| {
        part(master);
        (position(master) - begun).abs()
    });
    far.fold(0.0, f64::max)
}

/// A joint that ros2_canopen has set up, brought to [`SOMEWHERE`] and at rest there, disabled.
fn somewhere(parameters: ActuatorParameters) -> Master {
    let mut master = Master::of(parameters);
    map_for_ros2_canopen(&mut master);
    master.command(Command::Start);
    for controlword in [SHUTDOWN, SWITCH_ON, ENABLE] {
        cycles(&mut master, controlword, POSITION, 0, 20);
    }
    cycles(&mut master, ENABLE, POSITION, SOMEWHERE, 3_000);
    assert!((position(&master) - 0.361).abs() < 0.01, "{} rad", position(&master));
    master
}

#[test]
fn the_sequence_of_ros2_canopens_402_driver_moves_nothing_before_the_first_target() {
    let mut master = somewhere(ActuatorParameters::reference().aligned().without_payload());
    cycles(&mut master, 0, 0, 0, 500);
    assert_eq!(master.state(), State::SwitchOnDisabled);
    let moved = farthest(&mut master, 10, |master| {
        // Mode 0 and halt, and nothing in the position but zero.
        for controlword in [SHUTDOWN, SWITCH_ON, ENABLE] {
            cycles(master, HALT | controlword, 0, 0, 50);
        }
        assert_eq!(master.state(), State::OperationEnabled);
        assert_eq!(master.number(0x6061, 0), 0, "mode 0 is shown");
        cycles(master, HALT | ENABLE, 0, 0, 500);
        // The mode is chosen before there is a target.
        cycles(master, HALT | ENABLE, POSITION, 0, 2_000);
        assert_eq!(master.number(0x6041, 0) & 1 << 12, 0, "nothing is followed");
    });
    assert!(moved < STILL, "{moved} rad");
    // The first target comes with the release of halt.
    cycles(&mut master, ENABLE, POSITION, SOMEWHERE + 100_000, 2_000);
    assert!((position(&master) - 0.461).abs() < 0.01, "{} rad", position(&master));
    assert_eq!(master.number(0x6041, 0) >> 12 & 1, 1, "the target is followed");
    assert_eq!(master.state(), State::OperationEnabled);
}

#[test]
fn a_position_that_is_zero_comes_with_the_release_of_halt() {
    let mut master = somewhere(ActuatorParameters::reference().aligned().without_payload());
    cycles(&mut master, HALT | ENABLE, POSITION, 0, 500);
    cycles(&mut master, ENABLE, POSITION, 0, 3_000);
    assert!(position(&master).abs() < 0.01, "{} rad", position(&master));
}

#[test]
fn a_master_that_fills_its_pdo_with_zeros_moves_nothing_in_any_mode() {
    for mode in [0, POSITION, VELOCITY, TORQUE] {
        let mut master = somewhere(ActuatorParameters::reference().aligned().without_payload());
        cycles(&mut master, 0, mode, 0, 500);
        let moved = farthest(&mut master, 10, |master| {
            for controlword in [SHUTDOWN, SWITCH_ON, ENABLE] {
                cycles(master, controlword, mode, 0, 50);
            }
            assert_eq!(master.state(), State::OperationEnabled);
            cycles(master, ENABLE, mode, 0, 1_000);
        });
        assert!(moved < STILL, "mode {mode}: {moved} rad");
    }
}

#[test]
fn a_joint_that_holds_bears_its_load_and_waits_for_its_master() {
    let mut master = somewhere(ActuatorParameters::reference().aligned());
    // Halt, another mode and no word at all: the arm with its payload stays where it is.
    let moved = farthest(&mut master, 10, |master| {
        cycles(master, HALT | ENABLE, POSITION, 0, 300);
        cycles(master, HALT | ENABLE, 0, 0, 300);
        cycles(master, ENABLE, 0, 0, 300);
        cycles(master, ENABLE, VELOCITY, 0, 300);
        cycles(master, ENABLE, POSITION, 0, 300);
        master.wait(2_000);
    });
    assert!(moved < STILL, "{moved} rad");
    assert_eq!(master.state(), State::OperationEnabled);
    // A target that is not renewed is late.
    cycles(&mut master, ENABLE, POSITION, SOMEWHERE + 1_000, 50);
    master.wait(1_000);
    assert_eq!(master.state(), State::Fault);
}

#[test]
fn halt_brakes_along_the_ramp_and_holds_in_every_mode_and_its_release_goes_on() {
    assert_eq!(Master::new().number(0x605D, 0), 1);
    let ramp = |master: &Master| f64::from(master.node.configuration().gains.acceleration);
    for mode in [VELOCITY, TORQUE, POSITION] {
        let mut master = Master::new();
        master.enabled();
        master.download(0x6060, 0, &[mode as u8]).unwrap();
        let run = |master: &mut Master, controlword: u16, milliseconds: u64| {
            for _ in 0..milliseconds / 10 {
                let torque: i16 = if mode == TORQUE { 60 } else { 0 };
                let set_point = [&controlword.to_le_bytes()[..], &torque.to_le_bytes(), &60_000_000i32.to_le_bytes()];
                master.send(0x200 + u16::from(ID), &set_point.concat());
                if mode == VELOCITY {
                    master.velocity(controlword, 500);
                }
                master.wait(10);
            }
        };
        run(&mut master, ENABLE, 20);
        let moves = |master: &mut Master| {
            let fast = (0..200).find(|_| {
                run(master, ENABLE, 10);
                velocity(master) > 0.3
            });
            assert!(fast.is_some(), "mode {mode}: {} rad/s", velocity(master));
        };
        moves(&mut master);
        let fast = velocity(&master);
        let stopping = (fast / ramp(&master) * 1e3) as u64 + 150;
        run(&mut master, HALT | ENABLE, stopping);
        let moved = farthest(&mut master, 1_000, |master| run(master, HALT | ENABLE, 10));
        assert!(moved < STILL, "mode {mode}: {moved} rad in halt");
        assert_eq!(master.state(), State::OperationEnabled);
        moves(&mut master);
    }
}
