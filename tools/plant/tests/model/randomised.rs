//! Joints drawn at random are valid, finite and alive.

use plant::JointParameters;

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
fn the_draws_span_a_wide_range_of_friction_inertia_and_gear() {
    let joints: Vec<_> = (0..200).map(JointParameters::randomised).collect();
    let span = |value: &dyn Fn(&JointParameters) -> f64| {
        let values = joints.iter().map(value);
        values.clone().fold(f64::MIN, f64::max) / values.fold(f64::MAX, f64::min)
    };
    assert!(span(&|j| j.friction.coulomb.forward) > 100.0);
    assert!(span(&|j| j.inertia()) > 300.0, "{}", span(&|j| j.inertia()));
    assert!(span(&|j| j.motor.gear_ratio) > 15.0);
    let heavier_forward = joints.iter().filter(|j| j.friction.coulomb.forward > j.friction.coulomb.backward).count();
    assert!((60..140).contains(&heavier_forward));
}
