//! What a board's joint is until somebody has commissioned it: values with which nothing can go far; task, host.
//!
//! **No motor is known here.** Everything about motor, gear and heat is a placeholder that commissioning has to replace: resistance and
//! inductance are low, which makes the current loop slow on any real motor; limits are low; compensation is off. What a board
//! itself brings, [`BridgeConfiguration`] and the limits of its parts, is data of the board; its sources stand in
//! `src/board/`.

use crate::compensation::Request;
use crate::joint::configuration::{
    BridgeConfiguration, CompensationConfiguration, Configuration, Gains, GearConfiguration, Limits,
    MotorConfiguration, ThermalConfiguration, VelocitySource,
};
use crate::motor::angle::{Direction, ElectricalAngle, EncoderAlignment};
use crate::sensors::analog::Analog;

/// What a board brings, and the joint that it is until a configuration says otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardConfiguration {
    /// The bridge and its timing.
    pub bridge: BridgeConfiguration,
    /// Its amplifiers and dividers.
    pub analog: Analog,
    /// The joint, not commissioned.
    pub joint: Configuration,
}

/// ST B-G431B-ESC1. Supply: the board's limit is 25 V. The encoder's counter is read after the currents' conversions: no age.
pub const B_G431B_ESC1: BoardConfiguration = BoardConfiguration {
    bridge: BridgeConfiguration {
        rate: 20_000.0,
        // The low sides conduct at least 2.5 µs around the top: dead time, settling of the amplifiers, two conversions.
        duty: (0.0, 0.95),
        dead_time: 800e-9,
        dead_time_band: 1.0,
        has_bridge_sensor: true,
        has_winding_sensor: false,
    },
    analog: Analog {
        // Derived: 3.3 V / 4096 / (3 mOhm * 64/7); F, O. Codes fall with a current into the motor: the sense resistor lies
        // between the low side and ground, and the low side conducts when the current is sampled. The sign is unconfirmed.
        amperes_per_code: -0.029_38,
        // Derived: about 2.06 V. The joint's calibration finds each phase's own.
        current_zero: 2_557.0,
        // Divider of 169 kOhm and 18 kOhm (N, K, R), at a reference of 3.3 V.
        volts_per_code: 3.3 / 4_095.0 * (169.0 + 18.0) / 18.0,
    },
    joint: uncommissioned((8.0, 25.0), 0.0),
};

/// mjbots moteus r4.11. Supply: a bench supply of 12 to 24 V. The encoder's answer is two control periods old. The motor's
/// thermistor is the user's to fit, so none is expected.
pub const MOTEUS_R4: BoardConfiguration = BoardConfiguration {
    bridge: BridgeConfiguration {
        rate: MOTEUS_R4_RATE,
        // A period has 4,250 cycles: too few for all of it in each.
        // The low sides conduct at least 2.5 µs around the top: dead time, settling of the amplifiers, one conversion.
        duty: (0.0, 0.9),
        // As the gate driver is configured.
        dead_time: 200e-9,
        dead_time_band: 1.0,
        has_bridge_sensor: true,
        has_winding_sensor: false,
    },
    analog: Analog {
        // Derived: 3.3 V / 4096 / (0.5 mOhm * 20). The amplifier's output rises with a current into the motor (derived from
        // the driver's datasheet and the place of the resistors; sign unconfirmed).
        amperes_per_code: 0.0806,
        // Half the reference. The joint's calibration finds each phase's own.
        current_zero: 2_048.0,
        // Divider of 100 kOhm and 4.7 kOhm.
        volts_per_code: 0.017_947,
    },
    joint: uncommissioned((10.0, 30.0), 2.0 / MOTEUS_R4_RATE),
};

/// Control steps a second, Hz.
const MOTEUS_R4_RATE: f32 = 40_000.0;

/// A joint that nobody has described, at a lowest and highest supply, V, with an encoder whose samples are so old, s.
const fn uncommissioned(bus_voltage: (f32, f32), encoder_latency: f32) -> Configuration {
    Configuration {
        node_id: 255,
        motor: MotorConfiguration {
            resistance: 0.1,
            inductance_d: 20e-6,
            inductance_q: 20e-6,
            torque_constant: 0.02,
            current_limit: 2.0,
            alignment: EncoderAlignment {
                pole_pairs: 7,
                direction: Direction::Forward,
                electrical_zero: ElectricalAngle(0),
            },
            encoder_latency,
        },
        gear: GearConfiguration { ratio: 1.0, zero: 0.0 },
        limits: Limits {
            torque: 0.04,
            velocity: 10.0,
            position: (-0.5, 0.5),
            position_margin: 0.1,
            // A quarter of it is the largest offset that a current sensor may start with: 2.5 A are 85 codes of the one board and 31
            // of the other.
            over_current: 10.0,
            bus_voltage,
            bridge_temperature: 70.0,
            winding_temperature: 80.0,
            command_deadline: 0.1,
        },
        gains: Gains {
            current_bandwidth: 200.0,
            observer_bandwidth: 100.0,
            stiffness: 0.2,
            damping: 0.01,
            integral: 0.0,
            acceleration: 1.0,
            quick_stop_deceleration: 20.0,
            braking_time: 0.5,
        },
        compensation: CompensationConfiguration {
            request: Request::Off,
            gain: 0.0,
            clamp: 0.0,
            slew: 1.0,
            velocity_source: VelocitySource::Reference,
            standstill_velocity: 0.1,
        },
        thermal: ThermalConfiguration {
            winding_capacity: 10.0,
            housing_capacity: 50.0,
            winding_to_housing: 2.0,
            housing_to_ambient: 5.0,
            ambient: 40.0,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::state_machine::State;
    use crate::joint::{Bridge, Demand, Joint, Measurements, OFFSET_STEPS, Slow};
    use crate::motor::phases::Phases;
    use crate::motor::thermal::WindingTemperature;

    const BOARDS: [BoardConfiguration; 2] = [B_G431B_ESC1, MOTEUS_R4];

    #[test]
    fn every_board_starts_switched_off_and_stays_so_while_nobody_commands() {
        for board in BOARDS {
            let active = board.joint.prepare(&board.bridge).unwrap();
            let measured = Measurements {
                phase_currents: Phases { a: 0.4, b: -0.3, c: 0.2 },
                bus_voltage: 18.0,
                encoder: 123 << 20,
                encoder_valid: true,
                encoder_referenced: true,
                winding_temperature: f32::NAN,
                bridge_temperature: 25.0,
                bridge_fault: false,
                overrun: false,
            };
            let mut joint = Joint::new();
            for step in 1..3 * OFFSET_STEPS {
                let bridge = joint.control_step(&active, &Demand::default(), &Slow::default(), &measured);
                assert_eq!(bridge, Bridge::OFF);
                let started = step >= OFFSET_STEPS;
                let expected = if started { State::SwitchOnDisabled } else { State::NotReadyToSwitchOn };
                assert_eq!((joint.telemetry().state, joint.latched_faults().is_empty()), (expected, true), "{step}");
            }
        }
    }

    #[test]
    fn the_thermal_model_takes_every_boards_heat_paths() {
        for board in BOARDS {
            let thermal = board.joint.prepare(&board.bridge).unwrap().thermal;
            assert!(WindingTemperature::new(&thermal, thermal.warning).is_ok());
        }
    }

    #[test]
    fn the_low_sides_conduct_long_enough_to_sample_the_currents() {
        for BoardConfiguration { bridge, .. } in BOARDS {
            assert!((1.0 - bridge.duty.1) / bridge.rate >= 2.499e-6);
        }
    }
}
