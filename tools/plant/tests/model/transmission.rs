//! Motor and link behind a gear that gives way.

use plant::contact::{Contact, Side};
use plant::friction::Directional;
use plant::joint::MAXIMUM_STEP;
use plant::transmission::TransmissionParameters;
use plant::{ActuatorParameters, Joint, JointParameters, ParameterError};

const SPRING: TransmissionParameters = TransmissionParameters {
    stiffness: 2000.0,
    hardening: 0.0,
    damping: 0.0,
    hysteresis: 0.0,
    hysteresis_twist: 1e-3,
    backlash: 0.0,
};

/// The reference joint with hardly any friction and no payload behind a transmission.
fn behind(transmission: TransmissionParameters) -> JointParameters {
    let mut parameters = JointParameters::reference().with_plain_friction();
    parameters.friction.coulomb = Directional { forward: 0.001, backward: 0.001 };
    parameters.friction.breakaway = parameters.friction.coulomb;
    parameters.friction.viscous = Directional { forward: 0.0, backward: 0.0 };
    parameters.friction.bristle_stiffness = 10.0;
    parameters.friction.bristle_damping = 0.0;
    parameters.load.mass = 0.0;
    parameters.transmission = Some(transmission);
    parameters
}

/// Pushes for `seconds` with a motor torque, Nm; the joint then.
fn pushed(joint: &mut Joint, torque: f64, seconds: f64) {
    joint.advance(joint.parameters().motor.current_for(torque), 0.0, seconds);
}

fn twist(joint: &Joint) -> f64 {
    joint.state().position - joint.state().link_position
}

#[test]
fn behind_a_stiff_transmission_motor_and_link_move_as_one() {
    let stiff = behind(TransmissionParameters { stiffness: 1e6, damping: 100.0, ..SPRING });
    let one = JointParameters { transmission: None, ..stiff };
    let [mut two, mut one] = [stiff, one].map(|parameters| Joint::new(parameters, 25.0).unwrap());
    for torque in [5.0, -3.0, 2.0] {
        pushed(&mut two, torque, 0.1);
        pushed(&mut one, torque, 0.1);
        let (two, one) = (two.state(), one.state());
        assert!((two.velocity / one.velocity - 1.0).abs() < 1e-3, "{} and {}", two.velocity, one.velocity);
        assert!((two.link_position / one.position - 1.0).abs() < 1e-3);
    }
    assert_eq!(one.state().link_position, one.state().position);
}

#[test]
fn a_link_swings_on_its_spring_at_the_natural_frequency_within_half_a_percent() {
    let mut parameters = behind(SPRING);
    // A rotor too heavy to be moved.
    (parameters.motor.rotor_inertia, parameters.motor.gear_ratio) = (0.1, 300.0);
    let mut joint = Joint::new(parameters, 25.0).unwrap();
    joint.advance(0.0, 20.0, 0.02);
    let (mut time, mut crossings) = (0.0, Vec::new());
    while crossings.len() < 21 {
        let before = joint.state().link_velocity;
        joint.advance(0.0, 0.0, MAXIMUM_STEP);
        time += MAXIMUM_STEP;
        assert!(time < 5.0, "the link does not swing");
        let after = joint.state().link_velocity;
        if before.signum() != after.signum() {
            crossings.push(time - MAXIMUM_STEP * after / (after - before));
        }
    }
    let frequency = 10.0 / (crossings[20] - crossings[0]);
    let natural = (2000.0f64 / 0.1).sqrt() / std::f64::consts::TAU;
    assert!((frequency / natural - 1.0).abs() < 5e-3, "{frequency} Hz, expected {natural} Hz");
}

#[test]
fn a_held_link_lets_the_motor_twist_as_the_hardening_spring_says() {
    let hardening = TransmissionParameters { hardening: 5e4, damping: 20.0, ..SPRING };
    let mut joint = Joint::new(behind(hardening), 25.0).unwrap();
    joint.set_contact(Some(Contact::blocking(0.0, 1.0))).unwrap();
    pushed(&mut joint, 10.0, 2.0);
    let twist = twist(&joint);
    let expected = 2000.0 * twist * (1.0 + 5e4 * twist * twist);
    assert!((expected - 10.0).abs() < 0.02, "{expected} Nm at {twist} rad");
    assert!(twist < 0.9 * 10.0 / 2000.0, "it does not harden: {twist} rad");
    assert!((joint.state().gear_torque - 10.0).abs() < 0.02);
    // The link bears on its holder with the same torque.
    assert!((joint.state().load_torque - 10.0).abs() < 0.02);
}

#[test]
fn an_unloaded_transmission_keeps_the_twist_of_its_hysteresis() {
    let hysteresis = TransmissionParameters { hysteresis: 0.5, hysteresis_twist: 2e-4, damping: 20.0, ..SPRING };
    let mut joint = Joint::new(behind(hysteresis), 25.0).unwrap();
    joint.set_contact(Some(Contact::blocking(0.0, 1.0))).unwrap();
    let mut left = |torque: f64| {
        // Slowly to the torque and back.
        for n in (0..=1000).chain((0..1000).rev()) {
            pushed(&mut joint, torque * f64::from(n) / 1000.0, 2e-3);
        }
        pushed(&mut joint, 0.0, 0.5);
        twist(&joint)
    };
    let [forward, backward] = [left(10.0), left(-10.0)];
    // Without load the spring bears what is left of the hysteresis: nearly all of it.
    for (left, sign) in [(forward, 1.0), (backward, -1.0)] {
        let share = sign * left * 2000.0 / 0.5;
        assert!((0.6..1.01).contains(&share), "the spring is left with {share} of the hysteresis");
    }
    assert_eq!(twist(&Joint::new(behind(hysteresis), 25.0).unwrap()), 0.0);
}

#[test]
fn in_the_gap_the_motor_moves_alone_and_a_reversal_crosses_all_of_it() {
    let backlash = TransmissionParameters { backlash: 0.02, damping: 5.0, ..SPRING };
    let mut joint = Joint::new(behind(backlash), 25.0).unwrap();
    // Half of the gap on either side.
    while twist(&joint) < 0.0095 {
        pushed(&mut joint, 0.5, MAXIMUM_STEP);
        assert_eq!(joint.state().link_position, 0.0);
        assert_eq!(joint.state().gear_torque, 0.0);
    }
    pushed(&mut joint, 0.5, 0.2);
    assert!(joint.state().link_position > 0.0);
    let held = joint.state().link_position;
    joint.set_contact(Some(Contact::blocking(held, 1.0))).unwrap();
    pushed(&mut joint, 2.0, 1.0);
    let forward = twist(&joint);
    pushed(&mut joint, -2.0, 1.0);
    let backward = twist(&joint);
    let gap = forward - backward - 2.0 * 2.0 / 2000.0;
    assert!((gap - 0.02).abs() < 1e-4, "a gap of {gap} rad");
}

#[test]
fn a_wall_is_reached_through_the_gap_and_never_pulls() {
    let backlash = TransmissionParameters { backlash: 0.01, damping: 5.0, ..SPRING };
    let mut joint = Joint::new(behind(backlash), 25.0).unwrap();
    joint.set_contact(Some(Contact { position: 0.05, stiffness: 1e5, damping: 50.0, side: Side::Above })).unwrap();
    pushed(&mut joint, 3.0, 2.0);
    let state = joint.state();
    assert!((state.link_position - 0.05 - 3.0 / 1e5).abs() < 1e-5, "the link stands at {}", state.link_position);
    assert!((twist(&joint) - 0.005 - 3.0 / 2000.0).abs() < 1e-4);
    pushed(&mut joint, -3.0, 0.3);
    assert!(joint.state().link_position < 0.04);
}

#[test]
fn no_random_joint_that_is_left_alone_gains_energy() {
    let mut moved = 0;
    for seed in 0..60 {
        let parameters = ActuatorParameters::judging(seed).joint;
        let mut joint = Joint::new(parameters, 25.0).unwrap().released_at(0.8, 0.5);
        // A blow, so that it swings on its spring and through its gap.
        joint.advance(0.0, 2.0 * parameters.load.gravity_amplitude(), 0.01);
        let mut energy = joint.stored_energy();
        let scale = energy;
        for _ in 0..20_000 {
            joint.advance(0.0, 0.0, 5e-5);
            let now = joint.stored_energy();
            // What the position's own step adds to a pendulum comes and goes.
            assert!(now < energy + 1e-5 * scale, "joint {seed} gains {} of {scale} J", now - energy);
            energy = now.min(energy);
        }
        moved += usize::from(energy < 0.99 * scale);
    }
    assert!(moved > 50, "{moved} of 60 joints lost energy");
}

#[test]
fn parameters_out_of_range_are_refused_by_name() {
    let validated = |change: fn(&mut TransmissionParameters)| {
        let mut transmission = SPRING;
        change(&mut transmission);
        match behind(transmission).validate() {
            Ok(()) => "",
            Err(ParameterError::OutOfRange { name, .. } | ParameterError::CountOutOfRange { name, .. }) => name,
        }
    };
    assert_eq!(validated(|_| ()), "");
    assert_eq!(validated(|t| t.stiffness = 1.0), "");
    assert_eq!(validated(|t| t.stiffness = 0.99), "transmission.stiffness");
    assert_eq!(validated(|t| t.backlash = 0.1), "");
    assert_eq!(validated(|t| t.backlash = 0.101), "transmission.backlash");
    assert_eq!(validated(|t| t.hysteresis = 50.0), "");
    assert_eq!(validated(|t| t.hysteresis = 50.1), "transmission.hysteresis");
    assert_eq!(validated(|t| (t.hysteresis, t.backlash) = (0.1, 0.01)), "transmission.hysteresis");
    assert_eq!(validated(|t| t.hysteresis_twist = 0.0), "transmission.hysteresis_twist");
    assert_eq!(validated(|t| t.hardening = -1.0), "transmission.hardening");
    assert_eq!(validated(|t| t.damping = f64::NAN), "transmission.damping");
    let mut no_link = behind(SPRING);
    no_link.load.inertia = 0.0;
    assert!(no_link.validate().unwrap_err().to_string().contains("total inertia behind a transmission"));
}
