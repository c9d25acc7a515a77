//! A recording looks like what a user would log, and the truth stays apart from it.

use plant::excitation::{Excitation, Run, Segment, Trajectory};
use plant::fourier::FourierSeries;
use plant::record::USUAL_SAMPLE_PERIOD;
use plant::{JointParameters, Recording, record};

fn usual(parameters: &JointParameters, seed: u64) -> Recording {
    let excitation = Excitation::for_joint(parameters, seed).unwrap();
    record(parameters, &excitation, seed, USUAL_SAMPLE_PERIOD).unwrap()
}

fn bits(columns: &[&Vec<f64>]) -> Vec<u64> {
    columns.iter().flat_map(|column| column.iter().map(|value| value.to_bits())).collect()
}

fn all_bits(r: &Recording) -> Vec<u64> {
    let (l, t) = (&r.log, &r.truth);
    bits(&[
        &l.time,
        &l.position,
        &l.velocity,
        &l.commanded_torque,
        &l.measured_torque,
        &l.temperature,
        &t.position,
        &t.velocity,
        &t.acceleration,
        &t.motor_torque,
        &t.load_torque,
        &t.friction_torque,
        &t.temperature,
    ])
}

#[test]
fn the_usual_log_has_six_runs_and_about_forty_thousand_rows_at_250_hz() {
    let recording = usual(&JointParameters::reference(), 1);
    let log = &recording.log;
    assert!((35_000..45_000).contains(&log.len()), "{} rows", log.len());
    assert_eq!(log.run.iter().max(), Some(&5));
    for row in 1..log.len() {
        if log.run[row] == log.run[row - 1] {
            assert!((log.time[row] - log.time[row - 1] - 4e-3).abs() < 1e-9);
        } else {
            assert_eq!((log.run[row], log.time[row]), (log.run[row - 1] + 1, 0.0));
        }
    }
    let total = Excitation::for_joint(&JointParameters::reference(), 1).unwrap().duration();
    assert!((120.0..180.0).contains(&total), "{total} s");
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_seed_does_not() {
    let parameters = JointParameters::reference();
    let (once, again, other) = (usual(&parameters, 5), usual(&parameters, 5), usual(&parameters, 6));
    assert!(all_bits(&once) == all_bits(&again));
    assert!(all_bits(&once) != all_bits(&other));
    // The noise alone differs as well when the motion is the same.
    let excitation = Excitation::for_joint(&parameters, 5).unwrap();
    let noise = record(&parameters, &excitation, 6, USUAL_SAMPLE_PERIOD).unwrap();
    assert!(all_bits(&once) != all_bits(&noise));
}

#[test]
fn the_truth_obeys_the_equation_of_motion_in_every_row() {
    let parameters = JointParameters::reference();
    let truth = usual(&parameters, 2).truth;
    for row in 0..truth.position.len() {
        let net = truth.motor_torque[row] - truth.load_torque[row] - truth.friction_torque[row];
        let inertial = parameters.inertia() * truth.acceleration[row];
        assert!((net - inertial).abs() < 1e-6, "row {row}: {net} Nm against {inertial} Nm");
        let gravity = parameters.load.gravity_torque(truth.position[row]);
        assert!((truth.load_torque[row] - gravity).abs() < 0.02);
    }
}

#[test]
fn the_log_follows_the_truth_but_is_not_the_truth() {
    let parameters = JointParameters::reference();
    let Recording { log, truth } = usual(&parameters, 3);
    let rms =
        |a: &[f64], b: &[f64]| (a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len() as f64).sqrt();
    let count = parameters.sensors.position_resolution();
    // A sample of delay at up to 4 rad/s, plus the count.
    let position = rms(&log.position, &truth.position);
    assert!(position > 0.2 * count && position < 3e-3, "{position} rad");
    let velocity = rms(&log.velocity, &truth.velocity);
    assert!(velocity > 1e-3 && velocity < 0.1, "{velocity} rad/s");
    // The noise alone is 0.05 A x 4.5 Nm/A.
    let torque = rms(&log.measured_torque, &truth.motor_torque);
    assert!(torque > 0.2 && torque < 0.6, "{torque} Nm");
    let temperature = rms(&log.temperature, &truth.temperature);
    assert!(temperature > 0.05 && temperature < 0.5, "{temperature} K");
    assert!(log.position.iter().all(|p| (p / count - (p / count).round()).abs() < 1e-6));
}

#[test]
fn the_usual_log_covers_speeds_directions_rests_and_temperatures() {
    let parameters = JointParameters::reference();
    let truth = usual(&parameters, 4).truth;
    let share = |condition: &dyn Fn(f64) -> bool| {
        truth.velocity.iter().filter(|v| condition(**v)).count() as f64 / truth.velocity.len() as f64
    };
    assert!(share(&|v| v.abs() < 1e-3) > 0.05, "rests");
    assert!(share(&|v| v > 0.01 && v < 0.2) > 0.05 && share(&|v| v < -0.01 && v > -0.2) > 0.05, "slow");
    assert!(share(&|v| v > 1.0) > 0.03 && share(&|v| v < -1.0) > 0.03, "fast");
    let reversals = truth.velocity.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
    assert!(reversals > 60, "{reversals} reversals");
    let hottest = truth.temperature.iter().cloned().fold(f64::MIN, f64::max);
    let coldest = truth.temperature.iter().cloned().fold(f64::MAX, f64::min);
    assert!(hottest - coldest > 20.0, "{coldest} to {hottest} °C");
    let furthest = truth.position.iter().fold(0.0_f64, |most, p| most.max(p.abs()));
    assert!(furthest < parameters.limits.travel + 0.15, "went to {furthest} rad");
}

#[test]
fn the_joint_tracks_its_trajectory() {
    let parameters = JointParameters::reference();
    let excitation = Excitation::for_joint(&parameters, 8).unwrap();
    let Recording { log, truth } = record(&parameters, &excitation, 8, USUAL_SAMPLE_PERIOD).unwrap();
    let squares: f64 = (0..log.len())
        .map(|row| {
            let wanted = excitation.runs[log.run[row] as usize].trajectory.at(log.time[row]);
            (wanted.position - truth.position[row]).powi(2)
        })
        .sum();
    let error = (squares / log.len() as f64).sqrt();
    assert!(error < 0.07, "{error} rad of tracking error");
}

#[test]
fn a_fourier_series_is_the_sum_of_the_papers_terms_and_its_own_derivatives() {
    let series = FourierSeries { fundamental: 0.5, cosine: vec![0.3, -0.2], sine: vec![0.1, 0.4] };
    let t: f64 = 1.3;
    let expected =
        0.3 / 0.5 * (0.5 * t).sin() - 0.1 / 0.5 * (0.5 * t).cos() - 0.2 / 1.0 * t.sin() - 0.4 / 1.0 * t.cos();
    assert!((series.at(t).position - expected).abs() < 1e-12);
    let h = 1e-5;
    for time in [0.2, 0.9, 3.3, 9.6] {
        let (before, at, after) =
            (series.faded(time - h, 10.0), series.faded(time, 10.0), series.faded(time + h, 10.0));
        assert!(((after.position - before.position) / (2.0 * h) - at.velocity).abs() < 1e-8);
        assert!(((after.velocity - before.velocity) / (2.0 * h) - at.acceleration).abs() < 1e-8);
    }
    for end in [0.0, 10.0] {
        let rest = series.faded(end, 10.0);
        assert!(rest.position.abs() + rest.velocity.abs() + rest.acceleration.abs() < 1e-12);
    }
}

#[test]
fn a_trajectory_has_no_jumps_in_position_or_velocity() {
    let parameters = JointParameters::reference();
    for run in Excitation::for_joint(&parameters, 9).unwrap().runs {
        let trajectory = run.trajectory;
        let mut before = trajectory.at(0.0);
        for step in 1..=(trajectory.duration() * 1000.0) as usize {
            let now = trajectory.at(step as f64 * 1e-3);
            assert!((now.velocity - before.velocity).abs() < 0.021, "{before:?} to {now:?}");
            assert!((now.position - before.position).abs() < 1e-3 * (parameters.limits.speed + 0.1));
            assert!(now.velocity.abs() <= parameters.limits.speed && now.position.abs() <= parameters.limits.travel);
            before = now;
        }
        assert!(before.position.abs() < 1e-3 && before.velocity.abs() < 0.05, "ends at {before:?}");
    }
}

#[test]
fn a_slow_move_creeps_and_arrives() {
    let segments = vec![Segment::Move { to: 0.1, speed: 0.05, acceleration: 1.0 }, Segment::Rest { duration: 0.5 }];
    let excitation = Excitation { runs: vec![Run { warmth: 0.0, trajectory: Trajectory::new(segments).unwrap() }] };
    let recording = record(&JointParameters::reference(), &excitation, 1, 1e-3).unwrap();
    assert_eq!(recording.log.len(), 2551);
    let end = *recording.truth.position.last().unwrap();
    // The controller has no integral action: friction holds it short.
    assert!(end > 0.03 && end < 0.11, "{end} rad");
}
