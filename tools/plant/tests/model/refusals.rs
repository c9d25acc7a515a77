//! Refusals of values that are out of range, by name, with the range.

use plant::excitation::{Segment, Trajectory};
use plant::{JointParameters, ParameterError};

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
fn a_trajectory_refuses_segments_that_cannot_be_followed() {
    let moving = |speed, acceleration| Trajectory::new(vec![Segment::Move { to: 1.0, speed, acceleration }]);
    assert!(moving(1.0, 1.0).is_ok());
    assert!(moving(0.0, 1.0).is_err());
    assert!(moving(1.0, f64::NAN).is_err());
    assert!(Trajectory::new(vec![]).is_err());
    assert!(Trajectory::new(vec![Segment::Rest { duration: -1.0 }]).is_err());
}
