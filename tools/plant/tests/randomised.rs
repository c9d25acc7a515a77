//! Joints drawn at random are valid, finite and alive.

use plant::excitation::Excitation;
use plant::friction::Surroundings;
use plant::record::USUAL_SAMPLE_PERIOD;
use plant::{JointParameters, record};

#[test]
fn every_seed_draws_a_valid_joint() {
    for seed in 0..5000 {
        JointParameters::randomised(seed).validate().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    }
}

#[test]
fn a_seed_draws_the_same_joint_again_and_another_seed_another() {
    assert_eq!(JointParameters::randomised(42), JointParameters::randomised(42));
    assert_ne!(JointParameters::randomised(42), JointParameters::randomised(43));
}

#[test]
fn the_draws_span_a_wide_range_of_friction_inertia_gear_and_noise() {
    let joints: Vec<_> = (0..200).map(JointParameters::randomised).collect();
    let span = |value: &dyn Fn(&JointParameters) -> f64| {
        let values = joints.iter().map(value);
        values.clone().fold(f64::MIN, f64::max) / values.fold(f64::MAX, f64::min)
    };
    assert!(span(&|j| j.friction.coulomb.forward) > 100.0);
    assert!(span(&|j| j.inertia()) > 300.0, "{}", span(&|j| j.inertia()));
    assert!(span(&|j| j.motor.gear_ratio) > 15.0);
    assert!(span(&|j| j.sensors.current_noise) > 20.0);
    let heavier_forward = joints.iter().filter(|j| j.friction.coulomb.forward > j.friction.coulomb.backward).count();
    assert!((60..140).contains(&heavier_forward));
}

#[test]
fn two_hundred_random_joints_stay_finite_move_and_obey_their_trajectories() {
    for seed in 0..200 {
        let parameters = JointParameters::randomised(seed);
        let mut excitation = Excitation::for_joint(&parameters, seed).unwrap();
        assert!((120.0..180.0).contains(&excitation.duration()), "seed {seed}: {} s", excitation.duration());
        assert!(excitation.runs.iter().all(|run| (20.0..30.0).contains(&run.trajectory.duration())), "seed {seed}");
        excitation.runs.truncate(1);
        let recording = record(&parameters, &excitation, seed, USUAL_SAMPLE_PERIOD).unwrap();
        let (log, truth) = (&recording.log, &recording.truth);
        let columns = [
            &log.position,
            &log.velocity,
            &log.commanded_torque,
            &log.measured_torque,
            &log.temperature,
            &truth.position,
            &truth.velocity,
            &truth.acceleration,
            &truth.friction_torque,
            &truth.temperature,
        ];
        assert!(columns.iter().all(|column| column.iter().all(|value| value.is_finite())), "seed {seed}");
        let trajectory = &excitation.runs[0].trajectory;
        let (mut wanted, mut lost): (f64, f64) = (0.0, 0.0);
        for (time, position) in log.time.iter().zip(&truth.position) {
            wanted += trajectory.at(*time).position.powi(2);
            lost += (trajectory.at(*time).position - position).powi(2);
        }
        assert!((lost / wanted).sqrt() < 0.35, "seed {seed}: {} of the motion is lost", (lost / wanted).sqrt());
        // At rest in the first second it must not shake: sensors and controller are not to excite each other.
        let restless = truth.velocity[200..250].iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        assert!(restless < 0.05, "seed {seed}: {restless} rad/s at rest");
        // Friction stays near what its parameters allow: breakaway, ripple, gear loss at the peak torque, viscous.
        let friction = &parameters.friction;
        let peak = parameters.motor.torque_limit();
        let surroundings = Surroundings { gear_torque: peak, temperature: 15.0, ..Surroundings::default() };
        let dry = friction.dry_level(0.0, &surroundings).max(friction.dry_level(-1e-9, &surroundings));
        let viscous = friction.viscous_coefficient(1.0, 15.0).max(friction.viscous_coefficient(-1.0, 15.0));
        let bound = 2.0 * dry + viscous * 1.5 * parameters.limits.speed;
        assert!(truth.friction_torque.iter().all(|torque| torque.abs() < bound), "seed {seed}");
    }
}
