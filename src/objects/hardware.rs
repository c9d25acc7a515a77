//! Report of the board on its hardware, objects 2302h and 2303h; the task.

use super::field::HardwareField;
use crate::hardware::Hardware;

/// Value of an object.
pub(super) fn get(hardware: &Hardware, part: HardwareField) -> u32 {
    let Hardware { driver, revision, options } = hardware;
    let [status1, status2] = driver.status;
    match part {
        HardwareField::DriverStatus1 => status1.into(),
        HardwareField::DriverStatus2 => status2.into(),
        HardwareField::DriverFaults => driver.faults.into(),
        HardwareField::DriverSetup => driver.setup as u32,
        HardwareField::Revision => (*revision).into(),
        HardwareField::OptionsFound => options.found,
        HardwareField::OptionsNeeded => options.needed(),
        HardwareField::OptionsWrong => options.wrong().into(),
        HardwareField::SetOptions => 0,
    }
}
