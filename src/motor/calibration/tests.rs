//! The whole sequence on a simulated motor, and each way in which it fails.

use super::*;
use crate::motor::angle::{Direction, ElectricalAngle};
use crate::motor::modulation::{ModulationSettings, Modulator};
use crate::motor::virtual_motor::{RATE, VirtualMotor};

const SETTINGS: CalibrationSettings = CalibrationSettings {
    rate: RATE as f32,
    current: 6.0,
    highest_current: 12.0,
    highest_voltage: 3.0,
    highest_offset: 1.0,
    electrical_turns: 2,
    turn_time: 0.4,
    settle_time: 0.3,
    expected_pole_pairs: Some(14),
};

fn input(motor: &VirtualMotor) -> CalibrationInput {
    CalibrationInput {
        phase_currents: motor.measured_currents(),
        encoder: motor.encoder(),
        encoder_valid: true,
        bus_voltage: 24.0,
    }
}

/// Runs to the end with measurements that `change` may spoil at each step; the end, the steps and the highest phase current.
fn run(
    motor: &mut VirtualMotor,
    settings: &CalibrationSettings,
    mut change: impl FnMut(u32, &mut CalibrationInput, &mut VirtualMotor),
) -> (Progress, u32, f32) {
    let modulator = Modulator::new(&ModulationSettings {
        voltage_fraction: 1.0,
        minimum_duty: 0.0,
        maximum_duty: 0.96,
        dead_time: 0.0,
        dead_time_band: 0.1,
        minimum_bus_voltage: 6.0,
    })
    .unwrap();
    let mut sequence = CalibrationSequence::new(settings).unwrap();
    let mut highest = 0f32;
    for n in 0.. {
        let mut measured = input(motor);
        change(n, &mut measured, motor);
        let step = sequence.step(&measured);
        if let Progress::Done(_) | Progress::Failed(_) = step.progress {
            assert_eq!(step.voltage, None, "the bridge is off at the end");
            assert!(n as f32 <= sequence.longest() * RATE as f32, "{n} steps");
            return (step.progress, n, highest);
        }
        let modulated = step.voltage.map(|voltage| modulator.modulate(voltage, 24.0, Phases::default()));
        assert!(modulated.is_none_or(|modulated| !modulated.limited));
        motor.period(modulated.map(|modulated| modulated.duties), 24.0);
        let Phases { a, b, c } = motor.measured_currents();
        highest = highest.max(a.abs()).max(b.abs()).max(c.abs());
    }
    unreachable!()
}

fn calibrated(motor: &mut VirtualMotor, settings: &CalibrationSettings) -> Calibration {
    match run(motor, settings, |_, _, _| {}).0 {
        Progress::Done(calibration) => calibration,
        other => panic!("{other:?}"),
    }
}

fn failure(settings: &CalibrationSettings, motor: VirtualMotor) -> Failure {
    failure_with(settings, motor, |_, _, _| {})
}

fn failure_with(
    settings: &CalibrationSettings,
    mut motor: VirtualMotor,
    change: impl FnMut(u32, &mut CalibrationInput, &mut VirtualMotor),
) -> Failure {
    match run(&mut motor, settings, change).0 {
        Progress::Failed(failure) => failure,
        other => panic!("{other:?}"),
    }
}

/// Difference of electrical angles, degrees.
fn degrees(found: ElectricalAngle, exact: ElectricalAngle) -> f64 {
    found.0.wrapping_sub(exact.0) as i32 as f64 / 2f64.powi(32) * 360.0
}

#[test]
fn a_motor_is_found_as_it_is_in_both_directions_of_the_encoder() {
    for direction in [Direction::Forward, Direction::Reverse] {
        for (offset, position, dead_time) in [(0.0, 0.0, 0.0), (0.3, 0.021, 0.01), (0.777, -0.034, 0.01)] {
            let current_offsets = Phases { a: 0.3, b: -0.2, c: 0.1 };
            let mut motor = VirtualMotor {
                direction,
                encoder_offset: offset,
                position,
                dead_time,
                current_offsets,
                ..VirtualMotor::default()
            };
            let found = calibrated(&mut motor, &SETTINGS);
            let exact = motor.alignment();
            assert_eq!((found.alignment.direction, found.alignment.pole_pairs), (direction, 14));
            let error = degrees(found.alignment.electrical_zero, exact.electrical_zero);
            assert!(error.abs() < 0.5, "{error}°");
            assert!((found.resistance / 0.12 - 1.0).abs() < 0.01, "{found:?}");
            assert!((found.lost_voltage - dead_time as f32 * 24.0).abs() < 0.01, "{found:?}");
            assert!((found.inductance_d / 60e-6 - 1.0).abs() < 0.01, "{found:?}");
            assert!((found.inductance_q / 90e-6 - 1.0).abs() < 0.01, "{found:?}");
            let offsets = found.current_offsets;
            assert!((offsets.a - 0.3).abs() < 1e-3 && (offsets.b + 0.2).abs() < 1e-3, "{offsets:?}");
        }
    }
}

#[test]
fn other_motors_are_found_as_well() {
    for (resistance, inductance, pole_pairs, flux_linkage) in
        [(0.05, 20e-6, 21, 0.003), (0.8, 600e-6, 7, 0.01), (0.25, 250e-6, 1, 0.02)]
    {
        let mut motor = VirtualMotor {
            resistance,
            inductance: (inductance, inductance),
            pole_pairs,
            flux_linkage,
            direction: Direction::Reverse,
            encoder_offset: 0.1,
            ..VirtualMotor::default()
        };
        let settings =
            CalibrationSettings { expected_pole_pairs: None, highest_voltage: 6.0, settle_time: 0.6, ..SETTINGS };
        let found = calibrated(&mut motor, &settings);
        assert_eq!((found.alignment.pole_pairs, found.alignment.direction), (pole_pairs, Direction::Reverse));
        let error = degrees(found.alignment.electrical_zero, motor.alignment().electrical_zero);
        assert!(error.abs() < 0.5, "{error}°");
        assert!((found.resistance as f64 / resistance - 1.0).abs() < 0.01, "{found:?}");
        assert!((found.inductance_d as f64 / inductance - 1.0).abs() < 0.01, "{found:?}");
        let force = pole_pairs as f64 * flux_linkage / (core::f64::consts::TAU * RATE / 8.0);
        let gives_way = 1.5 * force * force / (motor.inertia * inductance);
        assert!((found.inductance_q as f64 / inductance - 1.0 + gives_way).abs() < 0.01, "{gives_way} {found:?}");
    }
}

#[test]
fn friction_shows_as_lag_and_leaves_the_zero_alone() {
    let with = |coulomb_friction| {
        let mut motor = VirtualMotor { coulomb_friction, ..VirtualMotor::default() };
        // Slowly, for the back-EMF's lag to be small.
        let found = calibrated(&mut motor, &CalibrationSettings { electrical_turns: 1, turn_time: 2.0, ..SETTINGS });
        let error = degrees(found.alignment.electrical_zero, motor.alignment().electrical_zero);
        assert!(error.abs() < 1.0, "{error}° with {coulomb_friction} Nm");
        found.lag
    };
    // Holding torque 3/2 14 0.005 Wb 6 A = 0.63 Nm: the lag is the arc sine of the ratio, plus a little for the saliency.
    let (little, much) = (with(0.02), with(0.2));
    let expected = (0.2f32 / 0.63).asin() / core::f32::consts::TAU;
    assert!(little > 0.0 && little < 0.02, "{little}");
    assert!((much / expected - 1.0).abs() < 0.25, "{much} {expected}");
}

#[test]
fn the_current_rises_gently_and_stays_near_what_was_asked_for() {
    let (progress, _, highest) = run(&mut VirtualMotor::default(), &SETTINGS, |_, _, _| {});
    assert!(matches!(progress, Progress::Done(_)));
    assert!(highest < 1.3 * SETTINGS.current, "{highest} A");
}

#[test]
fn it_can_be_aborted_at_any_step() {
    let (_, steps, _) = run(&mut VirtualMotor::default(), &SETTINGS, |_, _, _| {});
    for part in 0..50 {
        let mut motor = VirtualMotor::default();
        let mut sequence = CalibrationSequence::new(&SETTINGS).unwrap();
        for _ in 0..steps * part / 500 {
            sequence.step(&input(&motor));
        }
        let off = CalibrationStep { voltage: None, progress: Progress::Failed(Failure::Aborted) };
        assert_eq!(sequence.abort(), off);
        for _ in 0..3 {
            assert_eq!(sequence.step(&input(&motor)), off, "it stays off");
            motor.period(None, 24.0);
        }
    }
}

#[test]
fn what_is_over_cannot_be_aborted() {
    let mut sequence = CalibrationSequence::new(&SETTINGS).unwrap();
    let lost = CalibrationInput { bus_voltage: 0.0, ..input(&VirtualMotor::default()) };
    let failed = sequence.step(&lost);
    assert!(matches!(failed.progress, Progress::Failed(Failure::SupplyTooLow { .. })));
    assert_eq!(sequence.abort(), failed);
}

#[test]
fn a_supply_that_cannot_give_the_voltage_is_refused() {
    for supply in [0.0, 5.0, f32::NAN, f32::INFINITY] {
        let found = failure_with(&SETTINGS, VirtualMotor::default(), |n, input, _| {
            if n > 5_000 {
                input.bus_voltage = supply;
            }
        });
        assert!(matches!(found, Failure::SupplyTooLow { least, .. } if (least - 5.77).abs() < 0.01), "{found}");
    }
}

#[test]
fn a_current_beyond_the_limit_or_none_at_all_ends_it_at_once() {
    for bad in [12.5, -12.5, f32::NAN] {
        let mut at = 0;
        let found = failure_with(&SETTINGS, VirtualMotor::default(), |n, input, _| {
            if n >= 30_000 {
                input.phase_currents.b = bad;
            }
            at = n;
        });
        assert!(matches!(found, Failure::OverCurrent { phase: Phase::B, limit: 12.0, .. }), "{found}");
        assert_eq!(at, 30_000, "in the same step");
    }
}

#[test]
fn a_silent_encoder_is_borne_for_ten_steps() {
    let silent = |from: u32, steps: u32| {
        run(&mut VirtualMotor::default(), &SETTINGS, |n, input, _| {
            input.encoder_valid = !(from..from + steps).contains(&n);
        })
        .0
    };
    assert!(matches!(silent(60_000, 10), Progress::Done(_)));
    assert_eq!(silent(60_000, 11), Progress::Failed(Failure::EncoderLost { steps: 11 }));
}

#[test]
fn a_rotor_that_turns_spoils_the_offsets() {
    let found = failure(&SETTINGS, VirtualMotor { held_speed: Some(2.0), ..VirtualMotor::default() });
    assert!(matches!(found, Failure::RotorMoves { limit: 0.005, turns } if turns > 0.005), "{found}");
}

#[test]
fn a_large_offset_is_named() {
    let current_offsets = Phases { c: -1.2, ..Phases::default() };
    let found = failure(&SETTINGS, VirtualMotor { current_offsets, ..VirtualMotor::default() });
    assert!(matches!(found, Failure::OffsetTooLarge { phase: Phase::C, limit: 1.0, .. }), "{found}");
}

#[test]
fn an_open_phase_is_named() {
    for (open, expected) in [(0, Phase::A), (1, Phase::B), (2, Phase::C)] {
        let motor = VirtualMotor { open_phase: Some(open), coulomb_friction: 1.0, ..VirtualMotor::default() };
        let found = failure(&SETTINGS, motor);
        assert!(matches!(found, Failure::PhaseOpen { phase, .. } if phase == expected), "{open}: {found}");
    }
}

#[test]
fn a_resistance_beyond_the_voltage_is_reported_with_the_current_that_flows() {
    let found = failure(&SETTINGS, VirtualMotor { resistance: 2.0, ..VirtualMotor::default() });
    assert!(
        matches!(found, Failure::CurrentNotReached { current, wanted: 3.0, voltage: 3.0 } if (current - 1.5).abs() < 0.05),
        "{found}"
    );
}

#[test]
fn a_sensor_with_the_wrong_gain_is_found_by_the_sum() {
    let found = failure_with(&SETTINGS, VirtualMotor::default(), |_, input, _| input.phase_currents.b *= 2.0);
    assert!(matches!(found, Failure::CurrentsDoNotAddUp { .. }), "{found}");
}

#[test]
fn a_short_circuit_is_no_winding() {
    let motor = VirtualMotor { resistance: 0.0005, inductance: (60e-6, 60e-6), ..VirtualMotor::default() };
    let settings = CalibrationSettings { settle_time: 5.0, highest_voltage: 0.5, ..SETTINGS };
    let found = failure(&settings, motor);
    assert!(matches!(found, Failure::ResistanceImplausible { least: 0.001, .. }), "{found}");
}

#[test]
fn a_winding_too_inductive_for_the_voltage_and_one_too_resistive_for_the_rate_are_reported() {
    let motor = VirtualMotor { inductance: (9e-3, 9e-3), ..VirtualMotor::default() };
    let found = failure(&SETTINGS, motor);
    assert!(matches!(found, Failure::RippleTooSmall { .. }), "{found}");
    let motor = VirtualMotor { inductance: (2.5e-6, 2.5e-6), ..VirtualMotor::default() };
    let found = failure(&SETTINGS, motor);
    assert!(matches!(found, Failure::NotInductive { least: 1.1, .. }), "{found}");
}

#[test]
fn a_blocked_rotor_is_reported() {
    let found = failure(&SETTINGS, VirtualMotor { coulomb_friction: 5.0, ..VirtualMotor::default() });
    assert!(matches!(found, Failure::RotorDidNotMove { turns, .. } if turns.abs() < 0.001), "{found}");
}

#[test]
fn a_rotor_that_slips_on_the_way_back_is_reported() {
    let found = failure_with(&SETTINGS, VirtualMotor::default(), |_, input, motor| {
        // The encoder slips on the shaft while it turns back.
        if motor.speed < -0.1 {
            motor.encoder_offset += 2e-6;
        }
        input.encoder = motor.encoder();
    });
    assert!(matches!(found, Failure::RotorSlipped { .. }), "{found}");
}

#[test]
fn a_gear_between_motor_and_encoder_gives_no_whole_number_of_pole_pairs() {
    // The encoder turns at 0.967 of the rotor's speed.
    let settings = CalibrationSettings { expected_pole_pairs: None, ..SETTINGS };
    let found = failure_with(&settings, VirtualMotor::default(), |_, input, motor| {
        input.encoder = ((motor.position * 0.967).rem_euclid(1.0) * 2f64.powi(32)) as u64 as u32;
    });
    assert!(matches!(found, Failure::PolePairsUnclear { ratio } if (ratio - 14.48).abs() < 0.1), "{found}");
}

#[test]
fn another_number_of_pole_pairs_than_expected_is_reported() {
    let found = failure(&SETTINGS, VirtualMotor { pole_pairs: 11, ..VirtualMotor::default() });
    assert_eq!(found, Failure::PolePairs { counted: 11, expected: 14 });
}

#[test]
fn a_rotor_that_lags_too_far_is_reported() {
    // 0.54 of about 0.61 Nm of holding torque.
    let found = failure(&SETTINGS, VirtualMotor { coulomb_friction: 0.54, ..VirtualMotor::default() });
    assert!(matches!(found, Failure::LagTooLarge { lag, .. } if lag > 1.0 / 6.0), "{found}");
}

#[test]
fn it_ends_by_its_own_limit_if_nothing_else_ends_it() {
    let mut sequence = CalibrationSequence::new(&SETTINGS).unwrap();
    sequence.plan.longest = 1000;
    let motor = VirtualMotor::default();
    let last = (0..1001).map(|_| sequence.step(&input(&motor)).progress).last();
    assert_eq!(last, Some(Progress::Failed(Failure::TooLong { limit: 0.05 })));
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let refused = |settings: CalibrationSettings| CalibrationSequence::new(&settings).unwrap_err().name;
    assert_eq!(refused(CalibrationSettings { highest_current: 6.5, ..SETTINGS }), "highest calibration current");
    assert_eq!(refused(CalibrationSettings { electrical_turns: 0, ..SETTINGS }), "electrical turns");
    assert_eq!(refused(CalibrationSettings { turn_time: f32::NAN, ..SETTINGS }), "time of an electrical turn");
    assert_eq!(refused(CalibrationSettings { expected_pole_pairs: Some(65), ..SETTINGS }), "expected pole pairs");
}

/// Marsaglia's xorshift, 32 bits.
fn next(random: &mut u32) -> u32 {
    *random ^= *random << 13;
    *random ^= *random >> 17;
    *random ^= *random << 5;
    *random
}

#[test]
fn whatever_is_measured_it_ends_in_time_and_never_asks_for_more_than_the_highest_voltage() {
    let settings = CalibrationSettings {
        turn_time: 0.1,
        settle_time: 0.05,
        electrical_turns: 1,
        expected_pole_pairs: None,
        ..SETTINGS
    };
    let (mut done, mut failed_late) = (0, 0);
    for seed in 1..600u32 {
        let mut random = seed.wrapping_mul(0x9e37_79b9);
        // Something like a motor, with nonsense now and then: once in so many steps, from never to once in 3,000.
        let rarity = [0, 100_000, 30_000, 3_000][seed as usize % 4];
        let resistance = 0.1 + 0.1 * (seed % 5) as f32;
        let pole_pairs = 1 + seed % 30;
        let mut sequence = CalibrationSequence::new(&settings).unwrap();
        let longest = (sequence.longest() * RATE as f32) as u32 + 1;
        let (mut current, mut position, mut last) = (AlphaBeta::ZERO, 0f64, 0f64);
        let mut aligned = false;
        for n in 0.. {
            assert!(n <= longest, "{:?}", sequence.progress());
            let wild = rarity > 0 && next(&mut random).is_multiple_of(rarity);
            let step = sequence.step(&CalibrationInput {
                phase_currents: if wild && next(&mut random).is_multiple_of(2) {
                    Phases { a: f32::from_bits(next(&mut random)), ..current.to_phases() }
                } else {
                    current.to_phases()
                },
                encoder: if wild { next(&mut random) } else { (position * 2f64.powi(32)) as i64 as u32 },
                encoder_valid: !next(&mut random).is_multiple_of(7),
                bus_voltage: 24.0,
            });
            aligned |= step.progress == Progress::Alignment;
            match step.progress {
                Progress::Done(_) => done += 1,
                Progress::Failed(_) if aligned => failed_late += 1,
                Progress::Failed(_) => {}
                _ => {
                    let voltage = step.voltage.unwrap_or_default();
                    assert!(voltage.alpha.hypot(voltage.beta) <= 3.0 * 1.0001, "{voltage:?}");
                    current = current + (voltage * (1.0 / resistance) - current) * 0.3;
                    // The rotor follows the field as far as it moves by less than an eighth of a turn.
                    let field = (voltage.beta as f64).atan2(voltage.alpha as f64) / core::f64::consts::TAU;
                    let moved = (field - last + 0.5).rem_euclid(1.0) - 0.5;
                    if moved.abs() < 0.125 && voltage.alpha.hypot(voltage.beta) > 0.1 {
                        position += moved / pole_pairs as f64;
                    }
                    last = field;
                    continue;
                }
            }
            break;
        }
    }
    assert!(done > 100 && failed_late > 30, "{done} {failed_late}");
}
