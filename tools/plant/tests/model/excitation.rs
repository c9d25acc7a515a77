//! The motions that are recorded: the paper's series, and trajectories without jumps within the joint's limits.

use plant::JointParameters;
use plant::excitation::Excitation;
use plant::fourier::FourierSeries;

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
fn the_excitation_of_every_random_joint_is_six_runs_of_twenty_to_thirty_seconds() {
    for seed in 0..200 {
        let excitation = Excitation::for_joint(&JointParameters::randomised(seed), seed).unwrap();
        assert_eq!(excitation.runs.len(), 6, "seed {seed}");
        assert!(excitation.runs.iter().all(|run| (20.0..30.0).contains(&run.trajectory.duration())), "seed {seed}");
    }
}
