//! From a configuration to a calibration, and back with what it found; task, host.

use super::configuration::{BridgeConfiguration, Configuration};
use crate::motor::calibration::{Calibration, CalibrationSequence, CalibrationSettings};
use crate::motor::number::{limited, within};
use crate::motor::setting::SettingError;
use crate::motor::thermal::COPPER_COEFFICIENT;

/// Largest offset of a current sensor as a part of the over-current limit, as at the joint's start.
const LARGEST_OFFSET: f32 = 0.25;
/// Highest voltage as a part of the lowest supply: what the calibration can apply at any angle.
const HIGHEST_VOLTAGE: f32 = 0.5;
/// Electrical turns there and back: the joint moves by one more.
const ELECTRICAL_TURNS: u32 = 4;
/// Time of an electrical turn, and to come to rest, s.
const TIME: f32 = 0.5;

/// Settings with which a joint's motor is calibrated by a current, A: at least 0.1, and as much as the over-current limit leaves room for.
///
/// # Errors
/// A current out of this range.
pub fn calibration_settings(
    configuration: &Configuration,
    bridge: &BridgeConfiguration,
    current: f32,
) -> Result<CalibrationSettings, SettingError> {
    let limits = &configuration.limits;
    let settings = CalibrationSettings {
        rate: bridge.rate,
        current,
        highest_current: limits.over_current,
        highest_voltage: within(HIGHEST_VOLTAGE * limits.bus_voltage.0, 0.5, 100.0),
        highest_offset: within(LARGEST_OFFSET * limits.over_current, 0.01, 100.0),
        electrical_turns: ELECTRICAL_TURNS,
        turn_time: TIME,
        settle_time: TIME,
        expected_pole_pairs: None,
    };
    CalibrationSequence::new(&settings).map(|_| settings)
}

impl Configuration {
    /// The configuration with what a calibration found, at a temperature of the winding, °C; where that is not known (NaN), the resistance
    /// is taken for the one at 25 °C.
    pub fn calibrated(&self, found: &Calibration, winding_temperature: f32) -> Self {
        let mut calibrated = *self;
        let warmer = limited(winding_temperature - 25.0, 150.0);
        let resistance = found.resistance / (1.0 + COPPER_COEFFICIENT * warmer);
        calibrated.motor.resistance = resistance;
        calibrated.motor.inductance_d = found.inductance_d;
        calibrated.motor.inductance_q = found.inductance_q;
        calibrated.motor.alignment = found.alignment;
        calibrated
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::default_configuration::{B_G431B_ESC1, MOTEUS_R4};
    use crate::joint::configuration::MotorConfiguration;
    use crate::motor::angle::{Direction, ElectricalAngle, EncoderAlignment};
    use crate::motor::phases::Phases;

    #[test]
    fn a_board_s_own_configuration_can_be_calibrated_with_its_current_limit_and_not_with_more_than_it_switches_off_at()
    {
        for board in [B_G431B_ESC1, MOTEUS_R4] {
            let settings = |current| calibration_settings(&board.joint, &board.bridge, current);
            let possible = settings(board.joint.motor.current_limit).unwrap();
            assert!(possible.highest_voltage * 1.732 / 0.9 <= board.joint.limits.bus_voltage.0);
            for current in [0.09, board.joint.limits.over_current, f32::NAN] {
                assert!(settings(current).is_err(), "{current} A");
            }
        }
    }

    #[test]
    fn a_resistance_that_was_measured_hot_is_kept_as_the_one_at_25_degrees() {
        let alignment =
            EncoderAlignment { pole_pairs: 11, direction: Direction::Reverse, electrical_zero: ElectricalAngle(77) };
        let found = Calibration {
            current_offsets: Phases::uniform(0.0),
            resistance: 0.1393,
            lost_voltage: 0.1,
            inductance_d: 50e-6,
            inductance_q: 60e-6,
            alignment,
            lag: 0.01,
        };
        let configuration = B_G431B_ESC1.joint;
        let motor = |temperature| configuration.calibrated(&found, temperature).motor;
        assert!((motor(125.0).resistance - 0.1).abs() < 1e-6);
        assert_eq!(motor(f32::NAN).resistance, 0.1393);
        let expected = (50e-6, 60e-6, alignment, configuration.motor.current_limit);
        let MotorConfiguration { inductance_d, inductance_q, alignment, current_limit, .. } = motor(25.0);
        assert_eq!((inductance_d, inductance_q, alignment, current_limit), expected);
    }
}
