//! Measurements of the plant, as the control step reads them.

use crate::actuator::DriveSample;
use joint_firmware::joint::Measurements;
use joint_firmware::motor::phases::Phases;

/// The sample in the firmware's types: what a board's driver does with its converters' codes.
pub(super) fn measurements(sample: &DriveSample, overrun: bool) -> Measurements {
    let [a, b, c] = sample.phase_currents.map(|current| current as f32);
    Measurements {
        phase_currents: Phases { a, b, c },
        bus_voltage: sample.bus_voltage as f32,
        encoder: sample.encoder,
        encoder_valid: sample.encoder_valid,
        encoder_referenced: true,
        winding_temperature: sample.winding_temperature as f32,
        bridge_temperature: sample.bridge_temperature as f32,
        bridge_fault: sample.bridge_fault,
        overrun,
    }
}
