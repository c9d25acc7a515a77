//! Measurements of the control step differ from the truth exactly as described.

use crate::support::{PERIOD, actuator, coast, hold_current};
use plant::actuator::{DriveSample, Effect};
use plant::{Actuator, ActuatorParameters};

fn perfect() -> ActuatorParameters {
    ActuatorParameters::reference().ideal().aligned()
}

/// The least distance between two encoder readings, turns.
fn apart(a: u32, b: u32) -> f64 {
    f64::from(a.wrapping_sub(b) as i32) / 4_294_967_296.0
}

fn spread(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len() as f64;
    (mean, variance.sqrt())
}

fn resting(parameters: ActuatorParameters, samples: usize) -> Vec<DriveSample> {
    let mut actuator = actuator(parameters);
    (0..samples).map(|_| actuator.measure()).collect()
}

#[test]
fn perfect_sensors_tell_the_truth() {
    let mut actuator = actuator(perfect()).released_at(0.0, 2.0);
    hold_current(&mut actuator, [1.0, 5.0], 0.02);
    let (sample, state) = (actuator.measure(), *actuator.state());
    assert_eq!(sample.phase_currents, state.phase_currents);
    assert_eq!(sample.bus_voltage, state.bus_voltage);
    let turns = state.rotor_angle / std::f64::consts::TAU;
    assert!((f64::from(sample.encoder) / 4_294_967_296.0 - turns.fract()).abs() < 1e-7);
    assert!(sample.encoder_valid && !sample.bridge_fault);
    assert!((sample.winding_temperature - state.joint.heat.winding).abs() < 1e-9);
    assert!((sample.bridge_temperature - state.bridge_temperature).abs() < 1e-9);
}

#[test]
fn each_current_sensor_has_its_own_offset_and_gain_error() {
    let mut parameters = perfect();
    parameters.sensors.currents.offset = [0.3, -0.2, 0.1];
    parameters.sensors.currents.gain_error = [0.02, -0.01, 0.05];
    let mut actuator = actuator(parameters);
    assert_eq!(actuator.measure().phase_currents, [0.3, -0.2, 0.1]);
    hold_current(&mut actuator, [6.0, 0.3], 0.02);
    let truth = actuator.state().phase_currents;
    let seen = actuator.measure().phase_currents;
    for (k, gain) in [1.02, 0.99, 1.05].into_iter().enumerate() {
        assert!((seen[k] - truth[k] * gain - [0.3, -0.2, 0.1][k]).abs() < 1e-12);
    }
}

#[test]
fn currents_come_in_whole_counts_and_end_at_the_converters_range() {
    let mut parameters = perfect();
    parameters.sensors.currents.resolution = 0.25;
    (parameters.sensors.currents.lowest, parameters.sensors.currents.highest) = (-3.0, 5.0);
    let mut actuator = actuator(parameters);
    let (mut low, mut high) = (false, false);
    let mut controller = crate::support::CurrentController::new(&parameters);
    for n in 0..2000 {
        let (sine, cosine) = (0.01 * f64::from(n)).sin_cos();
        let duties = controller.duties(&actuator, [8.0 * cosine, 0.3 * sine]);
        actuator.advance(true, duties, 0.0, PERIOD);
        for (seen, truth) in actuator.measure().phase_currents.into_iter().zip(actuator.state().phase_currents) {
            assert_eq!((seen / 0.25).fract(), 0.0);
            assert!((-3.0..=5.0).contains(&seen));
            assert!((seen - truth.clamp(-3.0, 5.0)).abs() <= 0.125 + 1e-12);
            low |= seen == -3.0;
            high |= seen == 5.0;
        }
    }
    assert!(low && high);
}

#[test]
fn noise_has_the_standard_deviation_asked_for_on_every_channel() {
    let mut parameters = perfect();
    parameters.sensors.currents.noise = 0.2;
    parameters.sensors.encoder.noise = 1e-4;
    parameters.sensors.bus.noise = 0.05;
    let samples = resting(parameters, 40_000);
    for k in 0..3 {
        let (mean, deviation) = spread(samples.iter().map(|sample| sample.phase_currents[k]));
        assert!(mean.abs() < 6e-3 && (deviation / 0.2 - 1.0).abs() < 0.02, "{mean} A, {deviation} A");
    }
    let (mean, deviation) = spread(samples.iter().map(|sample| apart(sample.encoder, 0)));
    assert!(mean.abs() < 3e-6 && (deviation / 1e-4 - 1.0).abs() < 0.02, "{mean}, {deviation} turns");
    let (mean, deviation) = spread(samples.iter().map(|sample| sample.bus_voltage));
    assert!((mean - 36.0).abs() < 2e-3 && (deviation / 0.05 - 1.0).abs() < 0.02, "{mean} V, {deviation} V");
}

#[test]
fn the_encoder_reports_the_nearest_of_its_counts_from_its_own_zero_in_its_own_direction() {
    for (counts, zero, reversed) in [(4096, 0.0, false), (4000, 0.3, true), (1 << 26, 0.9, false)] {
        let mut parameters = perfect();
        let encoder = &mut parameters.sensors.encoder;
        (encoder.counts_per_turn, encoder.zero, encoder.reversed) = (counts, zero, reversed);
        for step in 0..500 {
            let mut actuator = actuator(parameters).released_at(0.0137 * f64::from(step) - 3.0, 0.0);
            let sample = actuator.measure();
            let turns = actuator.state().rotor_angle / std::f64::consts::TAU;
            let expected = zero + if reversed { -turns } else { turns };
            let expected = expected - expected.floor();
            let error = f64::from(sample.encoder) / 4_294_967_296.0 - expected;
            let error = error - error.round();
            assert!(error.abs() <= 0.5 / counts as f64 + 1e-9, "{error} turns with {counts} counts");
            let count = f64::from(sample.encoder) / 4_294_967_296.0 * counts as f64;
            assert!((count - count.round()).abs() < 1e-4, "{count} is not a whole count");
        }
    }
}

#[test]
fn eccentricity_is_a_sine_once_per_turn() {
    let mut parameters = perfect();
    (parameters.sensors.encoder.eccentricity, parameters.sensors.encoder.eccentricity_phase) = (0.01, 0.4);
    let mut worst: f64 = 0.0;
    for step in 0..200 {
        let angle = std::f64::consts::TAU * f64::from(step) / 200.0;
        let mut actuator = actuator(parameters).released_at(angle / 50.0, 0.0);
        let turns = angle / std::f64::consts::TAU;
        let error = f64::from(actuator.measure().encoder) / 4_294_967_296.0 - turns;
        let error = (error - error.round()) * std::f64::consts::TAU;
        assert!((error - 0.01 * (angle + 0.4).sin()).abs() < 1e-6, "{error} rad at {angle} rad");
        worst = worst.max(error.abs());
    }
    assert!(worst > 0.0099);
}

#[test]
fn encoder_and_currents_arrive_late_by_their_delays() {
    for delay in [0, 1, 2, 7] {
        let mut parameters = perfect();
        parameters.sensors.encoder.delay = delay;
        parameters.sensors.currents.delay = delay;
        let mut actuator = actuator(parameters).released_at(0.0, 3.0);
        let mut controller = crate::support::CurrentController::new(&parameters);
        let mut truth = vec![*actuator.state()];
        for _ in 0..50 {
            let duties = controller.duties(&actuator, [2.0, 5.0]);
            actuator.advance(true, duties, 0.0, PERIOD);
            truth.push(*actuator.state());
            let sample = actuator.measure();
            let then = truth[truth.len().saturating_sub(1 + delay)];
            assert_eq!(sample.phase_currents, then.phase_currents);
            let turns = then.rotor_angle / std::f64::consts::TAU;
            assert!((f64::from(sample.encoder) / 4_294_967_296.0 - turns.fract()).abs() < 1e-7);
            // The bus voltage and temperatures have no delay.
            assert_eq!(sample.bus_voltage, actuator.state().bus_voltage);
        }
    }
}

#[test]
fn the_bus_sensor_has_a_gain_error_counts_and_a_range() {
    let mut parameters = perfect();
    parameters.sensors.bus.gain_error = 0.05;
    parameters.sensors.bus.resolution = 0.5;
    assert_eq!(resting(parameters, 1)[0].bus_voltage, 38.0);
    parameters.sensors.bus.highest = 30.0;
    assert_eq!(resting(parameters, 1)[0].bus_voltage, 30.0);
}

#[test]
fn thermistors_lag_count_and_can_be_missing() {
    let mut parameters = perfect();
    parameters.joint.thermal.winding_capacity = 1.0;
    parameters.sensors.winding.lag = 0.5;
    parameters.sensors.winding.resolution = 0.5;
    parameters.sensors.bridge.fitted = false;
    let mut actuator = actuator(parameters);
    hold_current(&mut actuator, [20.0, 0.0], 0.3);
    let (seen, truth) = (actuator.measure(), actuator.state().joint.heat.winding);
    // A ramp of 0.3 s seen through 0.5 s: (0.3 - 0.5 (1 - exp(-0.6))) / 0.3 = 0.248 of the rise.
    assert!(truth > 50.0, "{truth} °C");
    let share = (seen.winding_temperature - 25.0) / (truth - 25.0);
    assert!((share - 0.248).abs() < 0.03, "{share}");
    assert_eq!((seen.winding_temperature * 2.0).fract(), 0.0);
    assert!(seen.bridge_temperature.is_nan());
}

#[test]
fn a_seed_gives_the_same_run_again_and_another_seed_other_noise_on_the_same_motion() {
    let run = |parameters: ActuatorParameters, seed: u64| {
        let mut actuator = Actuator::new(parameters, 25.0, seed).unwrap();
        (0..500)
            .map(|_| {
                actuator.advance(true, [0.6, 0.45, 0.45], 1.0, PERIOD);
                (actuator.measure(), *actuator.state())
            })
            .collect::<Vec<_>>()
    };
    let parameters = ActuatorParameters::reference();
    assert_eq!(run(parameters, 3), run(parameters, 3));
    let (one, other) = (run(parameters, 3), run(parameters, 4));
    assert!(one.iter().zip(&other).all(|(a, b)| a.1 == b.1) && one.iter().zip(&other).any(|(a, b)| a.0 != b.0));
    // Every channel has a stream of its own.
    let quiet = run(parameters.without(Effect::EncoderNoise), 3);
    assert!(one.iter().zip(&quiet).all(|(a, b)| a.0.phase_currents == b.0.phase_currents));
    assert!(one.iter().zip(&quiet).any(|(a, b)| a.0.encoder != b.0.encoder));
}

#[test]
fn nothing_moves_and_nothing_flows_while_the_bridge_is_off_and_nobody_pushes() {
    let mut actuator = actuator(ActuatorParameters::reference().without(Effect::Cogging));
    coast(&mut actuator, 0.0, 0.2);
    assert_eq!(actuator.state().dq_current, [0.0; 2]);
    assert_eq!(actuator.state().joint.position, 0.0);
}
