//! Default joint of each board, until somebody has commissioned it: values with which nothing can go far; task, host.
//!
//! **No motor is known here.** Everything about motor, gear and heat is a placeholder that commissioning has to
//! replace: resistance and inductance are low, which makes the current loop slow on any real motor; limits are low;
//! compensation is off. What a board itself brings, [`BridgeConfiguration`] and the limits of its parts, is data of the
//! board; its sources stand in `src/board/`.

use crate::joint::BoardLimits;
use crate::joint::configuration::{
    BridgeConfiguration, CompensationConfiguration, Configuration, FACTORY_TRIM, Gains, GearConfiguration, Limits,
    LoadConfiguration, MotorConfiguration, ThermalConfiguration,
};
use crate::joint::stop_options::StopConfiguration;
use crate::motor::angle::{Direction, ElectricalAngle, EncoderAlignment};
use crate::sensors::analog::Analog;
use crate::sensors::as5047p::As5047p;
use crate::sensors::rotor_encoder;
use friction_compensation::friction::regime::MOST_SETS;

/// Facts of a board, and the joint that it is until a configuration says otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardConfiguration {
    /// The bridge and its timing.
    pub bridge: BridgeConfiguration,
    /// Its amplifiers and dividers.
    pub analog: Analog,
    /// The joint, not commissioned.
    pub joint: Configuration,
    /// Parameter sets of an image that its program has room for: 1, no regimes, or 4.
    pub parameter_sets: usize,
}

/// The boards, each by the name of its feature, in the order of the columns of docs/boards.md.
pub const BOARDS: [(&str, BoardConfiguration); 2] = [("b-g431b-esc1", B_G431B_ESC1), ("moteus-r4", MOTEUS_R4)];

const B_G431B_ESC1_ANALOG: Analog = Analog {
    // Derived: 3.3 V / 4096 / (3 mOhm * 64/7); F, O. Codes fall with a current into the motor: the sense resistor lies
    // between the low side and ground, and the low side conducts when the current is sampled. The sign is unconfirmed.
    amperes_per_code: -0.029_38,
    // Derived: about 2.06 V. The joint's start finds each phase's own.
    current_zero: 2_557.0,
    // Divider of 169 kOhm and 18 kOhm (N, K, R), at a reference of 3.3 V.
    volts_per_code: 3.3 / 4_095.0 * (169.0 + 18.0) / 18.0,
};

const MOTEUS_R4_ANALOG: Analog = Analog {
    // Derived: 3.3 V / 4096 / (0.5 mOhm * 20). The amplifier's output rises with a current into the motor (derived from
    // the driver's datasheet and the place of the resistors; sign unconfirmed).
    amperes_per_code: 0.0806,
    // Half the reference. The joint's start finds each phase's own.
    current_zero: 2_048.0,
    // Divider of 100 kOhm and 4.7 kOhm.
    volts_per_code: 0.017_947,
};

/// Limits of both boards. No source states how hot their bridges may be: the chip beside it bears a junction of 105 °C
/// (temperature class 6), and the moteus' own firmware stops at 75 °C unless told otherwise. A joint that nobody
/// commands for longer is not under control.
const HOT_OR_SILENT: BoardLimits = BoardLimits {
    supply: 0.0,
    over_current: 0.0,
    current: 0.0,
    bridge_temperature: 100.0,
    command_deadline: 0.5,
    current_range: (0.0, 0.0),
    supply_end: 0.0,
};

/// ST B-G431B-ESC1. Supply: the board's limit is 25 V. The encoder's counter is read after the currents' conversions:
/// no age.
pub const B_G431B_ESC1: BoardConfiguration = BoardConfiguration {
    bridge: settled(
        B_G431B_ESC1_SETTLING,
        BridgeConfiguration {
            rate: 20_000.0,
            duty: (0.0, 1.0),
            dead_time: 800e-9,
            dead_time_band: 1.0,
            has_bridge_sensor: true,
            has_winding_sensor: false,
            counts_an_encoder: true,
            has_chopper_output: false,
            limits: BoardLimits {
                // 6S, 25 V (the maker's limit); its converter ends at 34 V.
                supply: 25.0,
                // The board's peak; of the converters' range, -45 to 75 A, the nearer end is 11 % above it.
                over_current: 40.0,
                current: 38.0,
                ..HOT_OR_SILENT
            }
            .seen_by(&B_G431B_ESC1_ANALOG),
        },
    ),
    analog: B_G431B_ESC1_ANALOG,
    joint: uncommissioned((8.0, 25.0), 1.0, 0.0),
    parameter_sets: 1,
};

/// mjbots moteus r4.11. Supply: a bench supply of 12 to 24 V. The motor's thermistor is the user's to fit, so none is
/// expected.
pub const MOTEUS_R4: BoardConfiguration = BoardConfiguration {
    bridge: settled(
        MOTEUS_R4_SETTLING,
        BridgeConfiguration {
            rate: MOTEUS_R4_RATE,
            duty: (0.0, 1.0),
            // Dead time that the gate driver is configured for.
            dead_time: 50e-9,
            dead_time_band: 1.0,
            has_bridge_sensor: true,
            has_winding_sensor: false,
            counts_an_encoder: false,
            has_chopper_output: true,
            limits: BoardLimits {
                // The vendor's range is 10 to 44 V (specifications in the README of mjbots/moteus); its converter ends
                // at 73 V.
                supply: 44.0,
                // The vendor's peak of a phase (there, too); the converters' range is +-165 A.
                over_current: 100.0,
                current: 95.0,
                ..HOT_OR_SILENT
            }
            .seen_by(&MOTEUS_R4_ANALOG),
        },
    ),
    analog: MOTEUS_R4_ANALOG,
    joint: uncommissioned((10.0, 30.0), 4.0, rotor_encoder::age::<MoteusR4Encoder>(MOTEUS_R4_RATE)),
    parameter_sets: MOST_SETS,
};

/// Rotor encoder of the moteus r4.
pub type MoteusR4Encoder = As5047p;

/// Control steps a second, Hz.
const MOTEUS_R4_RATE: f32 = 40_000.0;

/// Time from the edge of a low side until its current can be sampled, s: by the vendor's measurement at gain 20, which
/// is the settling time of the gate driver's data sheet and 500 ns.
const MOTEUS_R4_SETTLING: f32 = 1.5e-6;

/// The same on the B-G431B-ESC1, *derived*: the gate driver's 110 ns, and 4.6 time constants (1 %) of an amplifier with
/// a gain-bandwidth product of 7 MHz, the least of the chip's data sheet, at a gain of 16: 364 ns each. The typical
/// amplifier takes half of that.
const B_G431B_ESC1_SETTLING: f32 = 1.8e-6;

/// The conversions start so long before the top of the PWM counter, s: a count of the timer.
const TRIGGER: f32 = 1.0 / 170e6;

/// A bridge with the greatest duty at which a low side's dead time is over and its amplifier has settled (s after that)
/// when the conversions start. From there on the low side conducts for as long again, which is longer than the currents
/// are sampled: 0.4 µs, on the B-G431B-ESC1, where the second current follows the first on the same converter, 1 µs.
const fn settled(settling: f32, bridge: BridgeConfiguration) -> BridgeConfiguration {
    let greatest = 1.0 - 2.0 * bridge.rate * (bridge.dead_time + settling + TRIGGER);
    BridgeConfiguration { duty: (bridge.duty.0, greatest), ..bridge }
}

/// A joint that nobody has described, at a lowest and highest supply, V, that fades braking from two thirds of the way
/// from 24 V on, with an encoder whose samples are so old, s.
const fn uncommissioned(bus_voltage: (f32, f32), regeneration_band: f32, encoder_latency: f32) -> Configuration {
    Configuration {
        node_id: 255,
        oscillator_trim: FACTORY_TRIM,
        motor: MotorConfiguration {
            resistance: 0.1,
            inductance_d: 20e-6,
            inductance_q: 20e-6,
            torque_constant: 0.02,
            current_limit: 2.0,
            loss_current: 0.0,
            field_weakening_current: 0.0,
            alignment: EncoderAlignment {
                pole_pairs: 7,
                direction: Direction::Forward,
                electrical_zero: ElectricalAngle(0),
            },
            encoder_latency,
            // 1,000 lines.
            encoder_counts: 4_000,
        },
        gear: GearConfiguration { ratio: 1.0, zero: 0.0 },
        limits: Limits {
            torque: 0.04,
            velocity: 10.0,
            position: (-0.5, 0.5),
            position_margin: 0.1,
            // Stops up to 1e-3 kg m² within the margin: half the torque is for the quick stop's deceleration then.
            damping: 0.03,
            // A quarter of it is the largest offset that a current sensor may start with: 2.5 A are 85 codes of the one
            // board and 31 of the other.
            over_current: 10.0,
            bus_voltage,
            regeneration_band,
            chopper_voltage: 0.0,
            chopper_share: 0.1,
            bridge_temperature: 70.0,
            winding_temperature: 80.0,
            command_deadline: 0.1,
        },
        gains: Gains {
            current_bandwidth: 200.0,
            observer_bandwidth: 100.0,
            voltage_fraction: 1.0,
            stiffness: 0.2,
            damping: 0.01,
            integral: 0.0,
            acceleration: 1.0,
            quick_stop_deceleration: 20.0,
            braking_time: 0.5,
        },
        stops: StopConfiguration::DEFAULT,
        compensation: CompensationConfiguration::OFF,
        load: LoadConfiguration::NONE,
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
    use crate::motor::modulation::compare_value;
    use crate::motor::phases::Phases;
    use crate::motor::thermal::WindingTemperature;

    #[test]
    fn every_board_starts_switched_off_and_stays_so_while_nobody_commands() {
        for (_, board) in BOARDS {
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
        for (_, board) in BOARDS {
            let thermal = board.joint.prepare(&board.bridge).unwrap().thermal;
            assert!(WindingTemperature::new(&thermal, thermal.warning).is_ok());
        }
    }

    /// The part of docs/boards.md from its heading on.
    fn limits() -> String {
        let row = |what: &str, unit: &str, value: fn(&BoardLimits) -> String| {
            let cells = BOARDS.map(|(_, board)| format!(" {} |", value(&board.bridge.limits)));
            format!("| {what}, {unit} |{}\n", cells.concat())
        };
        let rows = [
            row("highest supply", "V", |of| of.supply.to_string()),
            row("supply at which its converter ends", "V", |of| format!("{:.1}", of.supply_end)),
            row("highest over-current limit", "A", |of| of.over_current.to_string()),
            row("phase currents at which a converter ends", "A", |of| {
                format!("{:.1} and {:.1}", of.current_range.0, of.current_range.1)
            }),
            row("largest current limit of a motor", "A", |of| of.current.to_string()),
            row("highest limit of the bridge's temperature", "°C", |of| of.bridge_temperature.to_string()),
            row("longest command deadline", "s", |of| of.command_deadline.to_string()),
        ];
        let names = BOARDS.map(|(name, _)| format!(" `{name}` |")).concat();
        let rule = BOARDS.map(|_| "---|").concat();
        format!("{LIMITS}| |{names}\n|---|{rule}\n{}\n", rows.concat())
    }

    const LIMITS: &str = "## Limits

What a configuration may ask of a board at the most; made from `src/default_configuration.rs`, where the sources stand: a test fails where this
table says anything else, and `UPDATE_DOCS=1 cargo test -p joint-firmware --lib default_configuration` writes it anew. A configuration beyond it is
refused by the name of the setting with the board's range, and the control step is held to it in any case. A current or supply at the end of its
converter's range counts as beyond its limit.

";

    #[test]
    fn the_documentation_tells_the_boards_limits() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/boards.md");
        let text = std::fs::read_to_string(path).unwrap();
        let (before, rest) = text.split_once("## Limits\n").unwrap();
        let (_, after) = rest.split_once("\n## ").unwrap();
        let expected = format!("{before}{}## {after}", limits());
        if std::env::var_os("UPDATE_DOCS").is_some() {
            std::fs::write(path, &expected).unwrap();
        }
        let found = std::fs::read_to_string(path).unwrap();
        assert!(found == expected, "docs/boards.md has other limits; UPDATE_DOCS=1 writes them anew");
    }

    #[test]
    fn at_the_greatest_duty_the_amplifiers_have_just_settled_when_the_conversions_start() {
        for (BoardConfiguration { bridge, .. }, settling, sampled) in
            [(B_G431B_ESC1, 1.8e-6, 1e-6), (MOTEUS_R4, 1.5e-6, 0.4e-6)]
        {
            let timer = 170e6;
            let top = (timer / (2.0 * f64::from(bridge.rate))) as u16;
            let greatest = compare_value(1.0, top, bridge.duty.1);
            let settles =
                |compare: u16| f64::from(top - 1 - compare) / timer >= f64::from(bridge.dead_time) + settling - 1e-9;
            assert!(settles(greatest) && !settles(greatest + 2), "{greatest} of {top}");
            // On the way down it conducts up to the same count.
            assert!(f64::from(top - greatest) / timer > sampled);
        }
    }

    #[test]
    fn the_greatest_duty_follows_the_dead_time() {
        let longer = settled(1.5e-6, BridgeConfiguration { dead_time: 200e-9, ..MOTEUS_R4.bridge });
        assert!((MOTEUS_R4.bridge.duty.1 - 0.8755).abs() < 1e-4 && (longer.duty.1 - 0.8635).abs() < 1e-4);
        assert!((B_G431B_ESC1.bridge.duty.1 - 0.8958).abs() < 1e-4);
    }
}
