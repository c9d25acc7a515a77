//! A joint that is enabled in a mode, and its words and values over SDO.

use crate::master::Master;
use bus::client::Command;
use joint_firmware::joint::state_machine::State;

pub const ENABLE: u16 = 0x0F;

pub fn word(master: &mut Master, word: u16) {
    master.download(0x6040, 0, &word.to_le_bytes()).unwrap();
}

pub fn set32(master: &mut Master, index: u16, value: i32) {
    master.download(index, 0, &value.to_le_bytes()).unwrap();
}

/// The joint of a master, in operation.
pub fn enabled(mut master: Master, mode: i8) -> Master {
    master.command(Command::Start);
    master.download(0x6060, 0, &mode.to_le_bytes()).unwrap();
    for step in [0x06, 0x07, ENABLE] {
        word(&mut master, step);
        master.wait(5);
    }
    assert_eq!(master.state(), State::OperationEnabled);
    master
}

pub fn status(master: &mut Master) -> i64 {
    master.number(0x6041, 0)
}

/// µrad.
pub fn position(master: &mut Master) -> i32 {
    master.number(0x6064, 0) as i32
}
