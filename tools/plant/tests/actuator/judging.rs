//! Actuators that are less like the firmware's model, and what a data sheet says of them.

use plant::actuator::Actuator;
use plant::thermal::{GearNode, Heat};
use plant::{ActuatorParameters, JointParameters};

#[test]
fn every_judging_actuator_is_valid_and_every_class_occurs() {
    let mut classes = [0; 3];
    for seed in 0..300 {
        let parameters = ActuatorParameters::judging(seed);
        parameters.validate().unwrap_or_else(|error| panic!("actuator {seed}: {error}"));
        parameters.without_payload().validate().unwrap_or_else(|error| panic!("actuator {seed}, no payload: {error}"));
        let class = parameters.joint.transmission.map_or(2, |transmission| usize::from(transmission.backlash > 0.0));
        classes[class] += 1;
        if class < 2 {
            let transmission = parameters.joint.transmission.unwrap();
            let twist = parameters.joint.motor.torque_limit() / transmission.stiffness;
            assert!((2e-3..2e-2 + 1e-9).contains(&twist), "{twist} rad at peak torque");
        }
        // What it is built on is the other generator's.
        let base = ActuatorParameters::randomised(seed);
        assert_eq!((parameters.joint.motor, parameters.joint.load), (base.joint.motor, base.joint.load));
    }
    assert!(classes[0] > 90 && classes[1] > 90 && classes[2] > 30, "{classes:?}");
}

#[test]
fn a_data_sheet_keeps_to_its_tolerance_and_says_nothing_of_what_was_added() {
    let (mut largest, mut loads) = (0.0f64, 0.0f64);
    for seed in 0..100 {
        let truth = ActuatorParameters::judging(seed);
        let sheet = truth.as_data_sheet(seed);
        sheet.validate().unwrap();
        let off = |sheet: f64, truth: f64| (sheet / truth - 1.0).abs();
        let (s, t) = (&sheet.joint, &truth.joint);
        let torque = off(s.motor.torque_constant, t.motor.torque_constant);
        assert!(torque <= 0.07 + 1e-12);
        largest = largest.max(torque);
        loads = loads.max(off(s.load.mass, t.load.mass));
        assert!(off(s.thermal.housing_capacity, t.thermal.housing_capacity) <= 0.3 + 1e-12);
        assert_eq!((s.transmission, s.friction.shape, s.thermal.gear), (None, None, None));
        assert_eq!((sheet.windings.flux_fall, s.thermal.ambient), (0.0, 25.0));
        assert_eq!((s.motor.gear_ratio, sheet.windings.pole_pairs), (t.motor.gear_ratio, truth.windings.pole_pairs));
    }
    assert!(largest > 0.06 && (0.09..=0.1 + 1e-12).contains(&loads), "{largest}, {loads}");
}

#[test]
fn a_gear_of_its_own_is_warmer_than_the_housing_by_its_loss_and_nothing_is_lost() {
    let mut thermal = JointParameters::reference().thermal;
    thermal.gear = Some(GearNode { capacity: 100.0, to_housing: 0.5 });
    let mut heat = Heat::uniform(thermal.ambient);
    let mut given_off = 0.0;
    for _ in 0..200_000 {
        heat.advance(&thermal, 10.0, 8.0, 0.05);
        given_off += 0.05 * (heat.housing - thermal.ambient) / thermal.housing_to_ambient;
    }
    assert!((heat.gear - heat.housing - 8.0 * 0.5).abs() < 1e-3);
    assert!((heat.housing - thermal.ambient - 18.0 * 1.5).abs() < 1e-2);
    let held = thermal.winding_capacity * (heat.winding - thermal.ambient)
        + thermal.housing_capacity * (heat.housing - thermal.ambient)
        + 100.0 * (heat.gear - thermal.ambient);
    let taken = 18.0 * 10_000.0;
    assert!((held + given_off - taken).abs() < 1e-4 * taken, "{held} J held, {given_off} J given off, {taken} J taken");
}

#[test]
fn warm_magnets_give_less_torque_for_the_same_current() {
    let torque = |flux_fall: f64, temperature: f64| {
        let mut parameters = ActuatorParameters::reference().aligned().without_payload();
        (parameters.windings.flux_fall, parameters.windings.resistance_rise) = (flux_fall, 0.0);
        parameters.windings.cogging.amplitude = 0.0;
        let mut actuator = Actuator::new(parameters, temperature, 1).unwrap();
        actuator.set_contact(Some(plant::contact::Contact::blocking(0.0, 1.0))).unwrap();
        (0..4000).for_each(|_| actuator.advance(true, [0.5, 0.52, 0.48], 0.0, 5e-5));
        actuator.state().joint.motor_torque / actuator.state().dq_current[1]
    };
    let (cold, warm) = (torque(0.002, 25.0), torque(0.002, 75.0));
    assert!((warm / cold - 0.9).abs() < 2e-3, "{} of the torque at 25 °C", warm / cold);
    assert!((torque(0.0, 75.0) / cold - 1.0).abs() < 2e-3);
}
