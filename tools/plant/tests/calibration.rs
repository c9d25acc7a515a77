//! The motor's calibration on random actuators that nobody has aligned: dead time, sensors with offsets and gain errors, noise, cogging,
//! friction and an eccentric encoder in the way. What it finds is what the actuator is, and a joint configured with it runs.

mod rig;

use joint_firmware::motor::calibration::{
    Calibration, CalibrationInput, CalibrationSequence, CalibrationSettings, Failure, Progress,
};
use joint_firmware::motor::modulation::{ModulationSettings, Modulator};
use joint_firmware::motor::phases::Phases;
use plant::actuator::windings::PhaseOrder;
use plant::actuator::{Actuator, ActuatorParameters};
use plant::virtual_joint::Setup;
use rig::{Rig, velocity};
use std::f64::consts::TAU;

const RATE: f64 = 20_000.0;

/// `share` of the current limit; the voltage leaves room for the shunts.
fn settings(parameters: &ActuatorParameters, share: f64) -> CalibrationSettings {
    let limit = parameters.joint.motor.current_limit;
    CalibrationSettings {
        rate: RATE as f32,
        current: (share * limit) as f32,
        highest_current: limit as f32,
        highest_voltage: (0.45 * parameters.bus.source_voltage) as f32,
        highest_offset: (0.05 * limit) as f32,
        electrical_turns: 2,
        turn_time: 0.5,
        settle_time: 0.5,
        expected_pole_pairs: None,
    }
}

/// An actuator under calibration; its end, and the largest phase current on the way, A.
fn calibrate(parameters: &ActuatorParameters, share: f64, seed: u64) -> (Progress, f64, Actuator) {
    let mut actuator = Actuator::new(*parameters, parameters.joint.thermal.ambient, seed).unwrap();
    // Before somebody asks for a calibration the rotor has rolled into its detent.
    for _ in 0..(0.5 * RATE) as u32 {
        actuator.measure();
        actuator.advance(false, [0.0; 3], 0.0, 1.0 / RATE);
    }
    let bridge = Setup::of(parameters).bridge;
    let modulator = Modulator::new(&ModulationSettings {
        voltage_fraction: 1.0,
        minimum_duty: bridge.duty.0,
        maximum_duty: bridge.duty.1,
        dead_time: bridge.dead_time * bridge.rate,
        dead_time_band: bridge.dead_time_band,
        minimum_bus_voltage: 6.0,
    })
    .unwrap();
    let mut sequence = CalibrationSequence::new(&settings(parameters, share)).unwrap();
    let mut largest = 0f64;
    for _ in 0..(f64::from(sequence.longest()) * RATE) as u32 + 1 {
        let sample = actuator.measure();
        let [a, b, c] = sample.phase_currents.map(|current| current as f32);
        let input = CalibrationInput {
            phase_currents: Phases { a, b, c },
            encoder: sample.encoder,
            encoder_valid: sample.encoder_valid,
            bus_voltage: sample.bus_voltage as f32,
        };
        let step = sequence.step(&input);
        if let Progress::Done(_) | Progress::Failed(_) = step.progress {
            assert_eq!(step.voltage, None, "seed {seed}: the bridge is off at the end");
            return (step.progress, largest, actuator);
        }
        let modulated =
            step.voltage.map(|voltage| modulator.modulate(voltage, input.bus_voltage, input.phase_currents));
        let duties = modulated.map_or([0.0; 3], |m| [m.duties.a, m.duties.b, m.duties.c].map(f64::from));
        actuator.advance(modulated.is_some(), duties, 0.0, 1.0 / RATE);
        largest = actuator.state().phase_currents.iter().fold(largest, |largest, current| largest.max(current.abs()));
    }
    panic!("seed {seed}: no end");
}

/// How far the found electrical angle is off where the rotor lies now, degrees.
fn angle_error(found: &Calibration, actuator: &Actuator) -> f64 {
    let (parameters, state) = (actuator.parameters(), actuator.state());
    let encoder = &parameters.sensors.encoder;
    let seen = found.alignment.electrical(encoder.counted(encoder.shown(state.rotor_angle)));
    let exact = match parameters.windings.phase_order {
        PhaseOrder::Forward => state.electrical_angle,
        PhaseOrder::Exchanged => -state.electrical_angle,
    };
    let turns = f64::from(seen.0) / 2f64.powi(32) - exact / TAU;
    360.0 * (turns - turns.round())
}

/// Half the current limit turns every rotor against its friction. In motors whose magnets are weak for their saliency it is too much; with
/// the half of it again they calibrate.
fn found(parameters: &ActuatorParameters, seed: u64) -> (Calibration, f64, Actuator) {
    for share in [0.5, 0.25, 0.125] {
        let (end, largest, actuator) = calibrate(parameters, share, seed);
        match end {
            Progress::Done(found) => return (found, largest, actuator),
            Progress::Failed(failure @ Failure::RotorBesideField { .. }) => {
                println!("{seed}: {share} of the current limit: {failure}")
            }
            other => panic!("seed {seed}: {other:?}"),
        }
    }
    panic!("seed {seed}: no current will do");
}

#[test]
fn random_actuators_are_found_as_they_are_and_run() {
    let mut worst = [0f64; 4];
    for seed in 0..40 {
        let parameters = ActuatorParameters::randomised(seed).without_payload();
        let (found, largest, actuator) = found(&parameters, seed);
        let windings = &parameters.windings;
        assert_eq!(found.alignment.pole_pairs as usize, windings.pole_pairs, "seed {seed}");
        let resistance = parameters.joint.motor.resistance / 1.5 + parameters.inverter.on_resistance;
        let errors = [
            angle_error(&found, &actuator).abs(),
            100.0 * (f64::from(found.resistance) / resistance - 1.0).abs(),
            100.0 * (f64::from(found.inductance_d) / windings.inductance_d - 1.0).abs(),
            100.0 * (f64::from(found.inductance_q) / windings.inductance_q - 1.0).abs(),
        ];
        println!("{seed}: {errors:.2?}");
        worst.iter_mut().zip(errors).for_each(|(worst, error)| *worst = worst.max(error));
        assert!(
            errors[0] < 5.0 && errors[1] < 10.0 && errors[2..].iter().all(|error| *error < 6.0),
            "seed {seed}: {errors:?}"
        );
        assert!(largest < 0.7 * parameters.joint.motor.current_limit, "seed {seed}: {largest} A");

        let mut setup = Setup::of(&parameters);
        let motor = &mut setup.configuration.motor;
        motor.alignment = found.alignment;
        motor.resistance = found.resistance;
        (motor.inductance_d, motor.inductance_q) = (found.inductance_d, found.inductance_q);
        let mut rig = Rig::enabled(parameters, &setup);
        let speed = 0.5 * parameters.joint.limits.speed;
        rig.follow(velocity(speed as f32), 0.4);
        let velocity = rig.joint.joint().telemetry().motion.velocity;
        assert!((f64::from(velocity) / speed - 1.0).abs() < 0.1, "seed {seed}: {velocity} of {speed} rad/s");
    }
    println!(
        "worst: angle {:.2} degrees, resistance {:.2} %, inductances {:.2} %, {:.2} %",
        worst[0], worst[1], worst[2], worst[3]
    );
}
