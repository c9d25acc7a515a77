//! What is out of range is refused by name, with the range.

use plant::excitation::{Excitation, Run, Segment, Trajectory};
use plant::{Joint, JointParameters, ParameterError, record};

#[test]
fn every_parameter_is_refused_as_not_a_number_and_far_outside_its_range() {
    type Field = fn(&mut JointParameters) -> &mut f64;
    let fields: &[(&str, Field)] = &[
        ("motor.torque_constant", |p| &mut p.motor.torque_constant),
        ("motor.gear_ratio", |p| &mut p.motor.gear_ratio),
        ("motor.rotor_inertia", |p| &mut p.motor.rotor_inertia),
        ("motor.current_limit", |p| &mut p.motor.current_limit),
        ("motor.resistance", |p| &mut p.motor.resistance),
        ("load.inertia", |p| &mut p.load.inertia),
        ("load.mass", |p| &mut p.load.mass),
        ("load.length", |p| &mut p.load.length),
        ("friction.coulomb.forward", |p| &mut p.friction.coulomb.forward),
        ("friction.coulomb.backward", |p| &mut p.friction.coulomb.backward),
        ("friction.breakaway.forward", |p| &mut p.friction.breakaway.forward),
        ("friction.breakaway.backward", |p| &mut p.friction.breakaway.backward),
        ("friction.stribeck_velocity", |p| &mut p.friction.stribeck_velocity),
        ("friction.viscous.forward", |p| &mut p.friction.viscous.forward),
        ("friction.viscous.backward", |p| &mut p.friction.viscous.backward),
        ("friction.bristle_stiffness", |p| &mut p.friction.bristle_stiffness),
        ("friction.bristle_damping", |p| &mut p.friction.bristle_damping),
        ("friction.viscous_thinning", |p| &mut p.friction.viscous_thinning),
        ("friction.coulomb_thinning", |p| &mut p.friction.coulomb_thinning),
        ("friction.gear_loss", |p| &mut p.friction.gear_loss),
        ("friction.ripple.periods_per_revolution", |p| &mut p.friction.ripple[1].periods_per_revolution),
        ("friction.ripple.amplitude", |p| &mut p.friction.ripple[0].amplitude),
        ("friction.ripple.phase", |p| &mut p.friction.ripple[1].phase),
        ("thermal.winding_capacity", |p| &mut p.thermal.winding_capacity),
        ("thermal.housing_capacity", |p| &mut p.thermal.housing_capacity),
        ("thermal.winding_to_housing", |p| &mut p.thermal.winding_to_housing),
        ("thermal.housing_to_ambient", |p| &mut p.thermal.housing_to_ambient),
        ("thermal.ambient", |p| &mut p.thermal.ambient),
        ("sensors.counts_per_revolution", |p| &mut p.sensors.counts_per_revolution),
        ("sensors.position_noise", |p| &mut p.sensors.position_noise),
        ("sensors.current_noise", |p| &mut p.sensors.current_noise),
        ("sensors.current_offset", |p| &mut p.sensors.current_offset),
        ("sensors.current_resolution", |p| &mut p.sensors.current_resolution),
        ("sensors.temperature_resolution", |p| &mut p.sensors.temperature_resolution),
        ("sensors.temperature_lag", |p| &mut p.sensors.temperature_lag),
        ("limits.travel", |p| &mut p.limits.travel),
        ("limits.speed", |p| &mut p.limits.speed),
    ];
    for (field, access) in fields {
        for bad in [f64::NAN, f64::INFINITY, -1e9, 1e9] {
            let mut parameters = JointParameters::reference();
            *access(&mut parameters) = bad;
            match parameters.validate() {
                Err(ParameterError::OutOfRange { name, value, minimum, maximum }) => {
                    assert_eq!(name, *field);
                    assert_eq!(value.to_bits(), bad.to_bits());
                    assert!(minimum < maximum);
                }
                other => panic!("{field} = {bad}: {other:?}"),
            }
        }
    }
}

#[test]
fn a_breakaway_torque_below_the_coulomb_torque_is_refused_with_it_as_the_limit() {
    let mut parameters = JointParameters::reference();
    parameters.friction.breakaway.backward = 2.4;
    let error = parameters.validate().unwrap_err();
    assert_eq!(error.to_string(), "friction.breakaway.backward = 2.4 is outside [2.5, 12.5]");
}

#[test]
fn a_delay_longer_than_the_buffer_is_refused() {
    let mut parameters = JointParameters::reference();
    parameters.sensors.delay = 65;
    let error = parameters.validate().unwrap_err();
    assert_eq!(error.to_string(), "sensors.delay = 65 is outside 0..=64");
}

#[test]
fn recording_refuses_bad_joints_sample_periods_warmth_and_empty_excitations() {
    let good = JointParameters::reference();
    let excitation = Excitation::for_joint(&good, 1).unwrap();
    let name = |result: Result<_, ParameterError>| match result.map(|_: plant::Recording| ()).unwrap_err() {
        ParameterError::OutOfRange { name, .. } | ParameterError::CountOutOfRange { name, .. } => name,
    };
    let mut bad = good;
    bad.load.mass = -1.0;
    assert_eq!(name(record(&bad, &excitation, 1, 4e-3)), "load.mass");
    assert_eq!(name(record(&good, &excitation, 1, 0.0)), "sample_period");
    assert_eq!(name(record(&good, &Excitation { runs: vec![] }, 1, 4e-3)), "excitation.runs");
    let trajectory = Trajectory::new(vec![Segment::Rest { duration: 1.0 }]).unwrap();
    let hot = Excitation { runs: vec![Run { warmth: 61.0, trajectory }] };
    assert_eq!(name(record(&good, &hot, 1, 4e-3)), "excitation.warmth");
    assert!(Joint::new(good, 151.0).is_err());
}

#[test]
fn a_trajectory_refuses_segments_that_cannot_be_followed() {
    let moving = |speed, acceleration| Trajectory::new(vec![Segment::Move { to: 1.0, speed, acceleration }]);
    assert!(moving(1.0, 1.0).is_ok());
    assert!(moving(0.0, 1.0).is_err());
    assert!(moving(1.0, f64::NAN).is_err());
    assert!(Trajectory::new(vec![]).is_err());
    assert!(Trajectory::new(vec![Segment::Rest { duration: -1.0 }]).is_err());
}
