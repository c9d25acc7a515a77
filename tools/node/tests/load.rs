//! The feedforward of the load as a master on the bus sets it, in simulated time.

mod master;

use joint_firmware::joint::{Command, Demand, Mode};
use master::Master;

const LOAD: u16 = 0x2202;

/// Feedforward in a mode now, Nm.
fn borne(master: &Master, mode: Mode) -> f32 {
    let command = Command { mode, ..Command::NOTHING };
    master.node.joint().bearing(&Demand { command, ..Demand::default() }).command.torque
}

fn set(master: &mut Master, sub_index: u8, value: f32) {
    master.download(LOAD, sub_index, &value.to_le_bytes()).unwrap();
}

#[test]
fn a_payload_is_borne_from_one_object_on_while_operation_is_enabled() {
    let mut master = Master::new();
    // The link hangs, and is said to be level: nobody needs the torque, and it shows as a residual.
    set(&mut master, 4, -core::f32::consts::FRAC_PI_2);
    set(&mut master, 6, 0.3);
    master.download(LOAD, 1, &[2]).unwrap();
    master.enabled();
    master.drive(15, 0, 200);
    assert_eq!(borne(&master, Mode::Velocity), 0.0);
    let before = master.number(0x2020, 2) as i16;
    set(&mut master, 5, 1.0);
    master.drive(15, 0, 20);
    let (most, torque) = (2.942, borne(&master, Mode::Velocity));
    assert!(torque > 0.1 && torque < most, "no blow: {torque} Nm after 20 ms");
    master.drive(15, 0, 500);
    let residual = master.number(0x2020, 2) as i16 - before;
    assert!((borne(&master, Mode::Velocity) - most).abs() < 0.01, "{} Nm", borne(&master, Mode::Velocity));
    assert!((-3_400..-300).contains(&residual), "{residual} mNm: the controller and friction at rest hold against it");
    assert_eq!((borne(&master, Mode::Position), borne(&master, Mode::Torque)), (borne(&master, Mode::Velocity), 0.0));
    set(&mut master, 5, 0.0);
    master.drive(15, 0, 200);
    assert_eq!(borne(&master, Mode::Velocity), 0.0);
}

#[test]
fn a_load_that_is_stored_is_borne_after_a_loss_of_power() {
    let mut master = Master::new();
    set(&mut master, 3, 4.0);
    set(&mut master, 4, -core::f32::consts::FRAC_PI_2);
    master.download(LOAD, 1, &[3]).unwrap();
    master.download(0x1010, 1, b"save").unwrap();
    let storage = master.node.storage();
    let master = Master::powered(storage);
    assert!((borne(&master, Mode::Hold) - 4.0).abs() < 0.01, "{} Nm", borne(&master, Mode::Hold));
}
