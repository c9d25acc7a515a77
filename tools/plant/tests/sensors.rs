//! What the drive sees differs from the truth exactly as described.

use plant::JointParameters;
use plant::joint::{Joint, State};
use plant::sensors::{SensorParameters, Sensors};

const PERIOD: f64 = 1e-3;

fn perfect() -> SensorParameters {
    JointParameters::reference().with_perfect_sensors().sensors
}

fn sensors(parameters: SensorParameters, seed: u64) -> Sensors {
    Sensors::new(parameters, JointParameters::reference().motor, seed).unwrap()
}

fn still() -> State {
    *Joint::new(JointParameters::reference(), 22.0).unwrap().state()
}

fn spread(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len() as f64;
    (mean, variance.sqrt())
}

#[test]
fn the_encoder_reports_the_nearest_whole_count() {
    let mut encoder = sensors(SensorParameters { counts_per_revolution: 1000.0, ..perfect() }, 1);
    let count = std::f64::consts::TAU / 1000.0;
    let mut worst: f64 = 0.0;
    for step in 0..5000 {
        let position = step as f64 * 0.013 * count;
        let seen = encoder.sample(&State { position, ..still() }, PERIOD).position;
        assert!((seen / count - (seen / count).round()).abs() < 1e-9);
        worst = worst.max((seen - position).abs());
    }
    assert!(worst <= 0.5 * count * 1.000_001 && worst > 0.48 * count, "off by {} counts", worst / count);
}

#[test]
fn position_and_current_noise_have_the_standard_deviation_asked_for() {
    let parameters = SensorParameters { position_noise: 1e-3, current_noise: 0.2, ..perfect() };
    let mut noisy = sensors(parameters, 7);
    let samples: Vec<_> = (0..40_000).map(|_| noisy.sample(&still(), PERIOD)).collect();
    let (mean, deviation) = spread(&samples.iter().map(|m| m.position).collect::<Vec<_>>());
    assert!(mean.abs() < 3e-5 && (deviation / 1e-3 - 1.0).abs() < 0.02, "{mean} rad, {deviation} rad");
    let (mean, deviation) = spread(&samples.iter().map(|m| m.current).collect::<Vec<_>>());
    assert!(mean.abs() < 6e-3 && (deviation / 0.2 - 1.0).abs() < 0.02, "{mean} A, {deviation} A");
}

#[test]
fn the_current_sensor_has_an_offset_and_whole_counts() {
    let parameters = SensorParameters { current_offset: 0.25, current_resolution: 0.1, ..perfect() };
    let mut current = sensors(parameters, 1);
    let motor_torque = JointParameters::reference().motor.torque_per_ampere() * 1.33;
    let seen = current.sample(&State { motor_torque, ..still() }, PERIOD).current;
    assert!((seen - 1.6).abs() < 1e-9, "{seen} A for 1.33 A with 0.25 A of offset");
}

#[test]
fn position_and_current_arrive_late_by_the_delay_and_temperature_does_not() {
    for delay in [0, 1, 5, 64] {
        let mut late = sensors(SensorParameters { delay, ..perfect() }, 1);
        let ampere = JointParameters::reference().motor.torque_per_ampere();
        for sample in 0..200_i32 {
            let number = f64::from(sample);
            let mut state = State { position: number, motor_torque: number * ampere, ..still() };
            state.heat.housing = number;
            let seen = late.sample(&state, PERIOD);
            let expected = f64::from((sample - delay as i32).max(0));
            assert!((seen.position - expected).abs() < 1e-6, "sample {sample} delayed by {delay}");
            assert!((seen.current - expected).abs() < 1e-9);
            assert!((seen.temperature - number).abs() < 1e-9);
        }
    }
}

#[test]
fn the_temperature_sensor_lags_and_reports_whole_counts() {
    let parameters = SensorParameters { temperature_lag: 4.0, temperature_resolution: 0.5, ..perfect() };
    let mut sensor = sensors(parameters, 1);
    let mut state = still();
    assert_eq!(sensor.sample(&state, PERIOD).temperature, 22.0);
    state.heat.housing = 42.0;
    let seen: Vec<f64> = (0..8000).map(|_| sensor.sample(&state, PERIOD).temperature).collect();
    // One time constant: 63 % of 20 K, in steps of half a kelvin.
    assert!((seen[3999] - (22.0 + 20.0 * 0.632)).abs() <= 0.26, "{} °C", seen[3999]);
    assert!(seen.iter().all(|t| (t * 2.0).fract() == 0.0));
}

#[test]
fn noise_follows_from_the_seed_alone_and_each_channel_from_its_own_stream() {
    let both = SensorParameters { position_noise: 1e-3, current_noise: 0.2, ..perfect() };
    let take = |parameters, seed| {
        let mut noisy = sensors(parameters, seed);
        (0..100).map(|_| noisy.sample(&still(), PERIOD)).collect::<Vec<_>>()
    };
    assert_eq!(take(both, 3), take(both, 3));
    assert_ne!(take(both, 3), take(both, 4));
    let quiet_position = take(SensorParameters { position_noise: 0.0, ..both }, 3);
    assert!(take(both, 3).iter().zip(&quiet_position).all(|(a, b)| a.current == b.current));
}
