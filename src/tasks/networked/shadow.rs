//! The friction model in shadow: prepared by the task of the bus, computed every millisecond by the one above it.

use core::cell::RefCell;
use critical_section::Mutex;
use joint_firmware::friction::FrictionModel;
use joint_firmware::joint::Telemetry;
use joint_firmware::joint::shadow::Shadow;
use joint_firmware::quantity::Torque;

/// Evaluations a second, Hz.
pub const RATE: u32 = 1_000;

static SHADOW: Mutex<RefCell<Option<Shadow>>> = Mutex::new(RefCell::new(None));

/// Another model, or none.
pub fn replace(model: Option<FrictionModel>) {
    critical_section::with(|section| *SHADOW.borrow_ref_mut(section) = model.map(Shadow::new));
}

/// What it would add; none where there is none. [`RATE`] times a second.
pub fn torque(telemetry: &Telemetry) -> Option<Torque> {
    critical_section::with(|section| Some(SHADOW.borrow_ref_mut(section).as_mut()?.torque(telemetry)))
}
