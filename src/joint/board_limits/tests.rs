//! Protections attacked by configuration: whatever a board accepts, the control step does not let it bear more than it
//! can.

use super::*;
use crate::default_configuration::{BOARDS, BoardConfiguration};
use crate::joint::configuration::Configuration;
use crate::joint::fault::Fault;
use crate::joint::rig::{self, at_rest, enabled};
use crate::joint::state_machine::{Controlword, State};
use crate::joint::{Active, BridgeState, Command, Demand, Joint, Measurements, OFFSET_STEPS, Slow};
use crate::motor::phases::Phases;
use crate::objects::field::Field;
use crate::objects::settings::Setting;
use crate::objects::table::{DataType, described};
use std::collections::BTreeSet;

/// Settings that may take part in harming a bridge; each is tried with each other.
const ELECTRICAL: [Setting; 25] = [
    Setting::Resistance,
    Setting::InductanceD,
    Setting::InductanceQ,
    Setting::TorqueConstant,
    Setting::CurrentLimit,
    Setting::LossCurrent,
    Setting::EncoderLatency,
    Setting::OverCurrent,
    Setting::LowestBusVoltage,
    Setting::HighestBusVoltage,
    Setting::RegenerationBand,
    Setting::BridgeTemperature,
    Setting::WindingTemperature,
    Setting::CommandDeadline,
    Setting::CurrentBandwidth,
    Setting::ObserverBandwidth,
    Setting::FieldWeakeningCurrent,
    Setting::VoltageFraction,
    Setting::ChopperVoltage,
    Setting::ChopperShare,
    Setting::PolePairs,
    Setting::EncoderCounts,
    Setting::ElectricalZero,
    Setting::VelocityLimit,
    Setting::GearRatio,
];
/// Control steps in which a joint is turned, and until when the loops ask for what they can.
const TURNED: u32 = 24;
/// 1 and a little: rounding of single-precision numbers.
const ROUNDED: f32 = 1.000_01;

/// The board's highest value of a setting; none where it has no say.
fn highest(board: &BoardLimits, setting: Setting) -> Option<f32> {
    match setting {
        Setting::CurrentLimit => Some(board.current),
        Setting::OverCurrent => Some(board.over_current),
        Setting::LowestBusVoltage => Some(board.supply - 1.0),
        Setting::HighestBusVoltage => Some(board.supply),
        Setting::BridgeTemperature => Some(board.bridge_temperature),
        Setting::CommandDeadline => Some(board.command_deadline),
        _ => None,
    }
}

/// Ends of a setting that follow from the others as the board has them at first, or from its control rate.
fn depending(board: &BoardConfiguration, setting: Setting) -> Vec<f32> {
    let BoardConfiguration { bridge, joint: Configuration { limits, motor, .. }, .. } = board;
    match setting {
        Setting::LossCurrent | Setting::FieldWeakeningCurrent => vec![motor.current_limit],
        Setting::ChopperVoltage => {
            vec![limits.bus_voltage.0 + 1.0, limits.bus_voltage.1 - limits.regeneration_band]
        }
        Setting::RegenerationBand => vec![limits.bus_voltage.1 - limits.bus_voltage.0],
        Setting::CurrentBandwidth => vec![bridge.rate / 18.0],
        Setting::ObserverBandwidth => vec![bridge.rate / 10.0],
        Setting::GearRatio => vec![1.0, -1.0, 100.0],
        Setting::VelocityLimit => vec![100.0],
        _ => Vec::new(),
    }
}

/// Every setting with the numbers that it is attacked with: both ends, the board's, just beyond each, and what is no
/// number.
fn attacks(board: &BoardConfiguration) -> Vec<(Setting, Vec<u32>)> {
    let of = |(object, text): (&crate::objects::table::Object, &crate::objects::table::Text)| {
        let (Field::Setting(setting) | Field::AtOnce(setting)) = object.field else { return None };
        if object.data_type != DataType::F32 {
            return Some((setting, vec![0, 1, 2, 15, 16, 63, 64, 65, 65_535, 65_536, 1 << 31, u32::MAX]));
        }
        let mut values = vec![0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE];
        let (low, high) = text.limits.map_or((1e-3, 1e3), |(low, high)| (low as f32, high as f32));
        let ends = [low, high].into_iter().chain(highest(&board.bridge.limits, setting));
        for end in ends.chain(depending(board, setting)) {
            values.extend([end.next_down(), end, end.next_up(), 0.99 * end, 1.01 * end]);
        }
        Some((setting, values.into_iter().map(f32::to_bits).collect()))
    };
    described().filter_map(of).collect()
}

/// A joint on a board that has started.
fn started(board: &BoardConfiguration) -> Joint {
    rig::started(&board.joint.prepare(&board.bridge).unwrap())
}

/// Asserts that what is accepted is within the facts of the board and of the bridge's timing that no measurement shows.
fn is_borne(board: &BoardConfiguration, accepted: &Configuration) {
    let (bears, rate) = (&board.bridge.limits, board.bridge.rate);
    let Configuration { motor, gear, limits, gains, .. } = accepted;
    let (lowest, highest) = limits.bus_voltage;
    assert!(motor.loss_current <= motor.current_limit && motor.field_weakening_current <= motor.current_limit);
    assert!(motor.current_limit <= bears.current && limits.over_current >= 1.049 * motor.current_limit);
    assert!(gains.current_bandwidth <= ROUNDED * rate / 18.0 && gains.observer_bandwidth <= ROUNDED * rate / 10.0);
    assert!((0.099..=1.1548).contains(&gains.voltage_fraction), "{}", gains.voltage_fraction);
    assert!((1..=64).contains(&motor.alignment.pole_pairs) && (16..=65_535).contains(&motor.encoder_counts));
    // Half a turn in a control step at twice the velocity limit: beyond it nobody could tell which way the rotor
    // turned.
    let rotor = limits.velocity * gear.ratio.abs();
    assert!(gear.ratio.abs() >= 1.0 && 2.0 * rotor <= ROUNDED * core::f32::consts::PI * rate, "{rotor} rad/s");
    // A rotor whose field is weakened does not charge the supply beyond its limit through the diodes.
    if motor.field_weakening_current > 0.0 {
        let induced = 3.0f32.sqrt() * motor.torque_constant / 1.5 * 1.2 * rotor;
        assert!(induced <= ROUNDED * highest && highest <= bears.supply, "{induced} V induced on {highest} V");
        let flux_linkage = motor.torque_constant / (1.5 * motor.alignment.pole_pairs as f32);
        assert!(motor.field_weakening_current * motor.inductance_d <= ROUNDED * flux_linkage);
    }
    if limits.chopper_voltage != 0.0 {
        assert!(board.bridge.has_chopper_output);
        let (low, high) = (lowest + 1.0, highest - limits.regeneration_band);
        assert!((low..=high).contains(&limits.chopper_voltage), "{} of {low} to {high}", limits.chopper_voltage);
    }
    assert!((0.000_999..=1.0).contains(&limits.chopper_share));
}

/// Turned at its velocity limit, with all the torque asked for, and stopped all of a sudden: duties leave the time in
/// which the currents are sampled, and no more current is wanted than board and motor bear.
fn turned(running: &Joint, board: &BoardConfiguration, active: &Active, accepted: &Configuration, calm: &Measurements) {
    let (low, high) = board.bridge.duty;
    let most = accepted.motor.current_limit.min(board.bridge.limits.current);
    for sign in [1.0, -1.0] {
        let (mut joint, mut encoder) = (running.clone(), calm.encoder);
        let command = Command { torque: sign * 1e9, ..Command::default() };
        let turns = accepted.limits.velocity * accepted.gear.ratio.abs() / (core::f32::consts::TAU * board.bridge.rate);
        let way = (f64::from(sign * turns) * 4_294_967_296.0) as i64 as u32;
        for step in 0..TURNED {
            encoder = encoder.wrapping_add(if step < TURNED / 2 { way } else { 0 });
            let demand = Demand {
                command,
                controlword: Controlword::ENABLE_OPERATION,
                sequence: 1_000 + step,
                ..Demand::default()
            };
            let measured = Measurements { encoder, ..*calm };
            let bridge = joint.control_step(active, &demand, &Slow::default(), &measured);
            for duty in [bridge.duties.a, bridge.duties.b, bridge.duties.c] {
                assert!((low..=high).contains(&duty), "{step}: a duty of {duty} of {low} to {high}");
            }
            let reference = joint.telemetry().reference;
            assert!(reference.norm() <= ROUNDED * most, "{step}: {reference:?} of {most} A");
            let chops = joint.telemetry().outputs.chopper();
            assert!(!chops || accepted.limits.chopper_voltage > 0.0);
        }
    }
}

/// A joint that is configured so protects the board; whether it ran, because its position is within its limits.
fn protects(joint: &Joint, board: &BoardConfiguration, active: &Active, accepted: &Configuration) -> bool {
    let bears = &board.bridge.limits;
    let (limits, configured) = (&active.limits, &accepted.limits);
    is_borne(board, accepted);
    let calm = at_rest(0.5 * (limits.bus_voltage.0 + limits.bus_voltage.1));
    let mut running = joint.clone();
    let demand = enabled(&mut running, active, 1e9, &calm);
    let latched: Vec<Fault> = running.latched_faults().iter().collect();
    assert!(latched.is_empty() || latched == [Fault::PositionLimit], "{latched:?}");
    running.control_step(active, &demand, &Slow::default(), &calm);
    assert!(running.telemetry().reference.norm() <= bears.current, "{:?}", running.telemetry().reference);

    turned(&running, board, active, accepted, &calm);
    let faults = |measured: &Measurements| {
        let mut joint = running.clone();
        let bridge = joint.control_step(active, &demand, &Slow::default(), measured);
        let state = joint.telemetry().state;
        (joint.telemetry().faults, bridge.state == BridgeState::Switching && state == State::OperationEnabled)
    };
    let phase_currents = |current: f32| {
        let turned = |currents: Phases| Phases { a: currents.c, b: currents.a, c: currents.b };
        let first = Phases { a: current, b: -0.5 * current, c: -0.5 * current };
        [first, turned(first), turned(turned(first))].map(|phase_currents| Measurements { phase_currents, ..calm })
    };
    for sign in [-1.0, 1.0] {
        for measured in phase_currents(sign * bears.over_current.next_up()) {
            let (faults, on) = faults(&measured);
            assert!(faults.contains(Fault::OverCurrent) && !on);
        }
        for measured in phase_currents(sign * 0.999 * configured.over_current) {
            assert!(!faults(&measured).0.contains(Fault::OverCurrent), "{measured:?}");
        }
    }
    let supplied = |bus_voltage| faults(&Measurements { bus_voltage, ..calm });
    let (over, on) = supplied(bears.supply.next_up());
    assert!(over.contains(Fault::OverVoltage) && !on);
    assert!(!supplied(0.999 * configured.bus_voltage.1).0.contains(Fault::OverVoltage));

    let heated = |bridge_temperature| faults(&Measurements { bridge_temperature, ..calm });
    let (over, on) = heated(bears.bridge_temperature.next_up());
    assert!(over.contains(Fault::BridgeTemperature) && !on);
    assert!(!heated(configured.bridge_temperature - 0.01).0.contains(Fault::BridgeTemperature));

    assert!(active.deadline_steps as f32 <= bears.command_deadline * board.bridge.rate);
    // Readings of a converter at either end, whatever the limits are.
    for code in [0, 4_095] {
        for phase in 0..3 {
            let mut codes = [board.analog.current_zero as u16; 3];
            codes[phase] = code;
            let at_end = Measurements { phase_currents: board.analog.currents(codes), ..calm };
            assert!(faults(&at_end).0.contains(Fault::OverCurrent), "{code}");
        }
    }
    assert!(supplied(board.analog.supply(4_095)).0.contains(Fault::OverVoltage));
    // Above its voltage a chopper conducts, and where there is none nothing does.
    let mut joint = running.clone();
    joint.control_step(
        active,
        &demand,
        &Slow::default(),
        &Measurements { bus_voltage: configured.bus_voltage.1, ..calm },
    );
    assert_eq!(joint.telemetry().outputs.chopper(), configured.chopper_voltage > 0.0);
    latched.is_empty()
}

/// Prepares what is attacked; 1 where the board accepted it and the joint ran.
fn attack(joint: &Joint, board: &BoardConfiguration, configuration: &Configuration) -> u32 {
    let active = configuration.prepare(&board.bridge);
    active.is_ok_and(|active| protects(joint, board, &active, configuration)).into()
}

#[test]
fn no_single_setting_at_its_ends_or_beyond_takes_a_protection_away() {
    for (_, board) in BOARDS {
        let joint = started(&board);
        let (mut tried, mut accepted) = (0, 0);
        for (setting, values) in attacks(&board) {
            for bits in values {
                let mut configuration = board.joint;
                if setting.set(&mut configuration, bits) {
                    tried += 1;
                    accepted += attack(&joint, &board, &configuration);
                }
            }
        }
        assert!(accepted > 100 && accepted < tried, "{accepted} of {tried} accepted");
    }
}

#[test]
fn no_pair_of_electrical_settings_takes_a_protection_away() {
    for (_, board) in BOARDS {
        let joint = started(&board);
        let mut attacks = attacks(&board);
        attacks.retain(|(setting, _)| ELECTRICAL.contains(setting));
        assert_eq!(attacks.len(), ELECTRICAL.len());
        let (mut tried, mut accepted) = (0, 0);
        for (place, (first, values)) in attacks.iter().enumerate() {
            for (second, others) in &attacks[..place] {
                for (bits, other) in values.iter().flat_map(|bits| others.iter().map(move |other| (*bits, *other))) {
                    let mut configuration = board.joint;
                    assert!(first.set(&mut configuration, bits) && second.set(&mut configuration, other));
                    tried += 1;
                    accepted += attack(&joint, &board, &configuration);
                }
            }
        }
        assert!(accepted > 1_000 && accepted < tried / 2, "{accepted} of {tried} accepted");
    }
}

#[test]
fn a_value_above_the_boards_is_refused_with_its_name_and_the_boards_range() {
    for (_, board) in BOARDS {
        let bears = &board.bridge.limits;
        let mut names = BTreeSet::new();
        for (setting, _) in attacks(&board) {
            let Some(high) = highest(bears, setting) else { continue };
            // Highest value that the others let it have.
            let mut configuration = board.joint;
            configuration.limits.bus_voltage.1 = bears.supply;
            (configuration.limits.over_current, configuration.limits.regeneration_band) = (bears.over_current, 0.5);
            assert!(setting.set(&mut configuration, high.to_bits()));
            assert_eq!(configuration.verify(&board.bridge), Ok(()), "{setting:?} {high}");
            assert!(setting.set(&mut configuration, high.next_up().to_bits()));
            let refused = configuration.verify(&board.bridge).unwrap_err();
            let crate::joint::configuration::ConfigurationError::Setting(error) = refused else { panic!("{refused}") };
            assert_eq!((error.value, error.high), (high.next_up(), high), "{setting:?}");
            names.insert(error.name.text());
        }
        assert_eq!(names.len(), 6, "{names:?}");
    }
}

#[test]
fn limits_that_were_not_checked_are_held_to_the_boards_all_the_same() {
    for (_, board) in BOARDS {
        let bears = &board.bridge.limits;
        let mut limits = board.joint.limits;
        assert_eq!(bears.hold(&limits), limits);
        (limits.over_current, limits.bus_voltage.1) = (500.0, 100.0);
        (limits.bridge_temperature, limits.command_deadline) = (150.0, 10.0);
        let held = bears.hold(&limits);
        assert_eq!((held.over_current, held.bus_voltage.1), (bears.over_current, bears.supply));
        assert_eq!(
            (held.bridge_temperature, held.command_deadline),
            (bears.bridge_temperature, bears.command_deadline)
        );
    }
}

/// Over-current limits of each board, with sensors that are as far off as a sound one may be.
#[test]
fn at_the_end_of_its_converter_a_current_is_over_the_limit_whatever_the_offset() {
    for (name, board) in BOARDS {
        for part in [0.1, 0.25, 0.5, 0.75, 0.9, 1.0] {
            let mut configuration = board.joint;
            configuration.limits.over_current = part * board.bridge.limits.over_current;
            configuration.motor.current_limit = 0.5;
            let active = configuration.prepare(&board.bridge).unwrap();
            for (offset, sound) in [(0.999, true), (-0.999, true), (1.001, false), (-1.001, false)] {
                let offset = Phases::uniform(offset * active.largest_offset);
                let still = Measurements { phase_currents: offset, ..at_rest(18.0) };
                let mut joint = Joint::new();
                let step = |joint: &mut Joint, measured: &Measurements| {
                    joint.control_step(&active, &Demand::default(), &Slow::default(), measured);
                    joint.telemetry().faults
                };
                (0..=OFFSET_STEPS).for_each(|_| _ = step(&mut joint, &still));
                assert_eq!(joint.telemetry().state == State::SwitchOnDisabled, sound, "{name}, {part}");
                for (code, phase) in [(0, 0), (4_095, 1), (0, 2), (4_095, 2)].into_iter().filter(|_| sound) {
                    let end = board.analog.currents([code; 3]).a;
                    let mut measured = still;
                    *[&mut measured.phase_currents.a, &mut measured.phase_currents.b, &mut measured.phase_currents.c]
                        [phase] = end;
                    assert!(step(&mut joint.clone(), &measured).contains(Fault::OverCurrent), "{name}, {part}: {code}");
                }
            }
        }
    }
}

#[test]
fn a_board_sees_more_than_it_bears() {
    for (name, board) in BOARDS {
        let bears = &board.bridge.limits;
        let (low, high) = bears.current_range;
        assert!(low < -1.1 * bears.over_current && high > 1.1 * bears.over_current, "{name}: {low} to {high} A");
        assert!(bears.supply_end > 1.1 * bears.supply, "{name}: {} V", bears.supply_end);
        assert!(bears.over_current >= 1.05 * bears.current, "{name}");
        let (low, high) = [board.analog.currents([0, 1, 2]).a, board.analog.currents([4_095, 1, 2]).a]
            .iter()
            .fold((f32::MAX, f32::MIN), |(low, high), end| (low.min(*end), high.max(*end)));
        let step = board.analog.amperes_per_code.abs();
        assert!((bears.current_range.0 - low - 0.5 * step).abs() < 1e-3 * step.max(1e-2), "{name}: {low}");
        assert!((high - bears.current_range.1 - 0.5 * step).abs() < 1e-3 * step.max(1e-2), "{name}: {high}");
    }
}

#[test]
fn the_longest_deadline_ends_operation_in_its_time() {
    for (name, board) in BOARDS {
        let mut configuration = board.joint;
        configuration.limits.command_deadline = board.bridge.limits.command_deadline;
        let active = configuration.prepare(&board.bridge).unwrap();
        let mut joint = started(&board);
        let demand = enabled(&mut joint, &active, 0.0, &at_rest(18.0));
        let steps = (0..100_000)
            .find(|_| {
                joint.control_step(&active, &demand, &Slow::default(), &at_rest(18.0));
                joint.telemetry().state != State::OperationEnabled
            })
            .unwrap();
        let most = (board.bridge.limits.command_deadline * board.bridge.rate) as i32;
        assert!(joint.latched_faults().contains(Fault::StaleCommand) && (steps - most).abs() <= 2, "{name}: {steps}");
    }
}
