//! The joint heats itself with the time constants of its two nodes.

use plant::thermal::Heat;
use plant::{Joint, JointParameters};

#[test]
fn a_constant_copper_loss_ends_at_the_temperatures_of_the_two_resistances() {
    let thermal = JointParameters::reference().thermal;
    let mut heat = Heat::uniform(thermal.ambient);
    for _ in 0..40_000 {
        heat.advance(&thermal, 10.0, 5.0, 1.0);
    }
    assert!((heat.housing - (22.0 + 15.0 * 1.5)).abs() < 1e-3);
    assert!((heat.winding - (22.0 + 15.0 * 1.5 + 10.0 * 0.8)).abs() < 1e-3);
}

#[test]
fn a_warm_joint_cools_with_the_slow_time_constant_of_the_two_nodes() {
    let thermal = JointParameters::reference().thermal;
    // Slower eigenvalue of the two-node network, from trace and determinant.
    let winding = 1.0 / (thermal.winding_capacity * thermal.winding_to_housing);
    let coupling = 1.0 / (thermal.housing_capacity * thermal.winding_to_housing);
    let outside = 1.0 / (thermal.housing_capacity * thermal.housing_to_ambient);
    let trace = winding + coupling + outside;
    let determinant = winding * outside;
    let slow = 0.5 * (trace - (trace * trace - 4.0 * determinant).sqrt());

    let mut heat = Heat::uniform(80.0);
    let cool = |heat: &mut Heat, seconds: usize| (0..10 * seconds).for_each(|_| heat.advance(&thermal, 0.0, 0.0, 0.1));
    // Five time constants of the winding first, so that only the slow mode is left.
    cool(&mut heat, 300);
    let start = heat.housing - thermal.ambient;
    cool(&mut heat, 600);
    let end = heat.housing - thermal.ambient;
    let time_constant = 600.0 / (start / end).ln();
    assert!((time_constant * slow - 1.0).abs() < 2e-3, "{time_constant} s, expected {} s", 1.0 / slow);
    assert!(time_constant > 700.0 && time_constant < 1000.0);
}

#[test]
fn the_winding_warms_first_and_the_housing_follows() {
    let thermal = JointParameters::reference().thermal;
    let mut heat = Heat::uniform(thermal.ambient);
    for _ in 0..480 {
        heat.advance(&thermal, 20.0, 0.0, 0.1);
    }
    // One time constant of the winding, 60 J/K x 0.8 K/W = 48 s, against a nearly unmoved housing.
    let rise = heat.winding - heat.housing;
    assert!((rise / (20.0 * 0.8 * (1.0 - (-1.0_f64).exp())) - 1.0).abs() < 0.12, "{rise} K");
    assert!(heat.housing - thermal.ambient < 0.25 * (heat.winding - thermal.ambient));
}

#[test]
fn holding_a_torque_heats_the_winding_and_moving_heats_the_housing() {
    let mut parameters = JointParameters::reference();
    parameters.load.mass = 0.0;
    parameters.motor.resistance = 5.0;
    let mut held = Joint::new(parameters, 22.0).unwrap();
    // 0.4 A is 1.8 Nm: below breakaway even when it is switched on at once.
    held.advance(0.4, 0.0, 20.0);
    assert!(held.state().velocity.abs() < 1e-3);
    let winding = held.state().heat.winding - 22.0;
    assert!((winding / (5.0 * 0.4 * 0.4 * 20.0 / 60.0) - 1.0).abs() < 0.25, "{winding} K");

    // Driven from outside without any current, all heat is friction.
    let mut dragged = Joint::new(parameters, 22.0).unwrap();
    let mut heat = 0.0;
    for _ in 0..2000 {
        dragged.advance(0.0, 8.0, 1e-2);
        heat += dragged.state().friction_torque * dragged.state().velocity * 1e-2;
    }
    let housing = dragged.state().heat.housing - 22.0;
    assert!(heat > 100.0);
    assert!((housing / (heat / 500.0) - 1.0).abs() < 0.1, "{housing} K from {heat} J");
}

#[test]
fn a_joint_that_works_for_minutes_loses_viscous_friction() {
    let mut parameters = JointParameters::reference();
    parameters.load.mass = 0.0;
    let mut joint = Joint::new(parameters, 22.0).unwrap();
    joint.advance(0.0, 8.0, 5.0);
    let cold = joint.state().velocity;
    joint.advance(0.0, 8.0, 120.0);
    assert!(joint.state().heat.housing > 24.0);
    assert!(joint.state().velocity > cold * 1.02, "{cold} rad/s cold, {} rad/s warm", joint.state().velocity);
}
