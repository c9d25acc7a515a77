//! The joint moves as its torques say.

use plant::friction::Directional;
use plant::joint::MAXIMUM_STEP;
use plant::{Joint, JointParameters};

fn frictionless() -> JointParameters {
    let mut parameters = JointParameters::reference().with_plain_friction();
    // The smallest friction that is permitted: a thousandth of a newton metre, on bristles too soft to hold anything.
    parameters.friction.coulomb = Directional { forward: 0.001, backward: 0.001 };
    parameters.friction.breakaway = parameters.friction.coulomb;
    parameters.friction.viscous = Directional { forward: 0.0, backward: 0.0 };
    parameters.friction.bristle_stiffness = 10.0;
    parameters.friction.bristle_damping = 0.0;
    parameters
}

fn unloaded(mut parameters: JointParameters) -> JointParameters {
    parameters.load.mass = 0.0;
    parameters
}

#[test]
fn a_frictionless_pendulum_swings_at_its_natural_frequency_within_0_1_percent() {
    let parameters = frictionless();
    let amplitude = 0.05;
    let mut joint = Joint::new(parameters, 22.0).unwrap().released_at(amplitude, 0.0);
    let mut crossings = Vec::new();
    let mut time = 0.0;
    while crossings.len() < 21 {
        let before = joint.state().position;
        joint.advance(0.0, 0.0, MAXIMUM_STEP);
        time += MAXIMUM_STEP;
        assert!(time < 60.0, "the pendulum does not swing");
        let after = joint.state().position;
        if before.signum() != after.signum() {
            crossings.push(time - MAXIMUM_STEP * after / (after - before));
        }
    }
    let period = (crossings[20] - crossings[0]) / 10.0;
    let natural = (parameters.load.gravity_amplitude() / parameters.inertia()).sqrt();
    // The finite amplitude makes the period longer by the fraction amplitude^2 / 16.
    let expected = std::f64::consts::TAU / natural * (1.0 + amplitude * amplitude / 16.0);
    assert!((period / expected - 1.0).abs() < 1e-3, "period {period} s, expected {expected} s");
}

#[test]
fn a_frictionless_joint_accelerates_with_torque_over_link_and_reflected_rotor_inertia() {
    let parameters = unloaded(frictionless());
    let mut joint = Joint::new(parameters, 22.0).unwrap();
    joint.advance(1.0, 0.5, 0.2);
    // 0.09 Nm/A x 50 + 0.5 Nm on 0.1 + 50^2 x 6e-5 kg m^2.
    let expected = (4.5 + 0.5) / (0.1 + 0.15);
    assert!((joint.state().velocity / (0.2 * expected) - 1.0).abs() < 1e-3);
}

/// Ramps the motor torque at `rate` (Nm/s) until the joint runs, and returns the largest friction before it slid
/// 5 mrad and the friction when it then slides at four Stribeck velocities (Nm).
fn break_away(parameters: JointParameters, sign: f64, rate: f64) -> (f64, f64) {
    let mut joint = Joint::new(parameters, 25.0).unwrap();
    let (mut torque, mut peak): (f64, f64) = (0.0, 0.0);
    while joint.state().velocity.abs() < 4.0 * parameters.friction.stribeck_velocity {
        torque += rate * MAXIMUM_STEP;
        assert!(torque < 50.0, "the joint does not break away");
        joint.advance(sign * parameters.motor.current_for(torque), 0.0, MAXIMUM_STEP);
        if joint.state().position.abs() < 5e-3 {
            peak = peak.max(joint.state().friction_torque.abs());
        }
    }
    (peak, joint.state().friction_torque.abs())
}

#[test]
fn a_slow_torque_ramp_has_to_break_the_joint_away_from_a_friction_above_coulomb() {
    let parameters = unloaded(JointParameters::reference().with_plain_friction());
    let (peak, sliding) = break_away(parameters, 1.0, 1.0);
    assert!((peak - 4.2).abs() < 0.05 * 4.2, "broke away at {peak} Nm");
    assert!(sliding < 3.0 + 4.0 * 0.06 * 1.2 + 0.1, "slides at {sliding} Nm");
}

#[test]
fn breakaway_differs_between_the_directions() {
    let mut parameters = unloaded(JointParameters::reference().with_plain_friction());
    parameters.friction.breakaway.backward = 3.5;
    let (forward, _) = break_away(parameters, 1.0, 1.0);
    let (backward, _) = break_away(parameters, -1.0, 1.0);
    assert!((forward - backward - 0.7).abs() < 0.1, "{forward} Nm forward, {backward} Nm backward");
}

#[test]
fn a_joint_that_is_pushed_below_breakaway_creeps_by_its_bristles_and_springs_back() {
    let parameters = unloaded(JointParameters::reference().with_plain_friction());
    let mut joint = Joint::new(parameters, 25.0).unwrap();
    let mut ramp = |from: f64, to: f64| {
        for step in 0..=1000 {
            let torque = from + (to - from) * f64::from(step) / 1000.0;
            joint.advance(parameters.motor.current_for(torque), 0.0, 1e-3);
        }
        assert!(joint.state().velocity.abs() < 2e-3);
        joint.state().position
    };
    // Slow loading integrates z' = v (1 - z/Z) with Z = 4.2 Nm / 4000 Nm/rad; unloading has the opposite sign.
    let breakaway = 4.2 / 4000.0;
    let pushed = -breakaway * (1.0_f64 - 1.0 / 4.2).ln();
    let returned = pushed - breakaway * (1.0_f64 + 1.0 / 4.2).ln();
    let (up, back) = (ramp(0.0, 1.0), ramp(1.0, 0.0));
    assert!((up / pushed - 1.0).abs() < 0.03, "pushed by {up} rad, expected {pushed} rad");
    assert!((back / returned - 1.0).abs() < 0.05, "sprung back to {back} rad, expected {returned} rad");
}

#[test]
fn holding_a_payload_makes_the_gear_of_a_moving_joint_rub_more() {
    let mut parameters = JointParameters::reference().with_plain_friction();
    parameters.friction.gear_loss = 0.05;
    // Constant speed near hanging down against 25 Nm from outside, which the gear has to carry.
    let friction = |external: f64| {
        let mut joint = Joint::new(parameters, 25.0).unwrap();
        let mut held = 0.0;
        for _ in 0..3000 {
            let state = joint.state();
            let wanted = 200.0 * (0.5 - state.velocity) - external + state.friction_torque;
            joint.advance(parameters.motor.current_for(wanted), external, MAXIMUM_STEP);
            held = joint.state().gear_torque;
        }
        (joint.state().friction_torque, held)
    };
    let (free, light) = friction(0.0);
    let (loaded, heavy) = friction(-25.0);
    assert!((heavy - light - 25.0).abs() < 0.5, "the gear carries {heavy} Nm and {light} Nm");
    let more = loaded - free;
    assert!((more / (0.05 * (heavy.abs() - light.abs())) - 1.0).abs() < 0.05, "{more} Nm more friction");
}

#[test]
fn a_released_pendulum_loses_exactly_the_energy_that_its_friction_turns_to_heat() {
    let mut joint = Joint::new(JointParameters::reference(), 22.0).unwrap().released_at(1.4, 0.0);
    let mut energy = joint.stored_energy();
    let start = energy;
    let mut heat = 0.0;
    for _ in 0..30_000 {
        joint.advance(0.0, 0.0, MAXIMUM_STEP);
        assert!(joint.state().friction_loss >= -1e-9);
        heat += joint.state().friction_loss * MAXIMUM_STEP;
        assert!(joint.stored_energy() <= energy + 2e-4, "energy rose from {energy} J");
        energy = joint.stored_energy();
    }
    assert!(start > 10.0);
    assert!(((start - energy) / heat - 1.0).abs() < 0.01, "{start} J to {energy} J with {heat} J of heat");
    assert!(joint.state().velocity.abs() < 1e-3, "it comes to rest");
}

#[test]
fn halving_the_step_does_not_change_the_motion() {
    let swing = |step: f64| {
        let mut joint = Joint::new(JointParameters::reference(), 22.0).unwrap().released_at(1.4, 0.0);
        for _ in 0..(0.6 / step).round() as usize {
            joint.advance(0.0, 0.0, step);
        }
        joint.state().position
    };
    let (usual, half) = (swing(MAXIMUM_STEP), swing(MAXIMUM_STEP / 2.0));
    assert!((usual - half).abs() < 1e-3, "{usual} rad against {half} rad");
}

#[test]
fn a_long_advance_is_cut_into_steps_that_give_the_same_bits() {
    let mut once = Joint::new(JointParameters::reference(), 22.0).unwrap();
    let mut often = once.clone();
    once.advance(3.0, 0.0, 128.0 * MAXIMUM_STEP);
    (0..128).for_each(|_| often.advance(3.0, 0.0, MAXIMUM_STEP));
    assert_eq!(once.state(), often.state());
}

#[test]
fn the_motor_gives_no_more_than_its_current_limit() {
    let mut joint = Joint::new(JointParameters::reference(), 22.0).unwrap();
    joint.advance(1000.0, 0.0, 0.01);
    assert_eq!(joint.state().motor_torque, joint.parameters().motor.torque_limit());
}

#[test]
fn the_gear_carries_the_links_inertia_too() {
    let parameters = unloaded(frictionless());
    let mut joint = Joint::new(parameters, 22.0).unwrap();
    joint.advance(2.0, 0.0, 0.05);
    // 0.1 of 0.25 kg m^2 lie beyond the gear.
    let expected = 9.0 * 0.1 / 0.25;
    assert!((joint.state().gear_torque / expected - 1.0).abs() < 1e-2, "{} Nm", joint.state().gear_torque);
}

#[test]
fn a_joint_turning_at_constant_speed_feels_its_friction_ripple() {
    let mut parameters = unloaded(JointParameters::reference().with_plain_friction());
    parameters.friction.ripple[0].amplitude = 0.08;
    let mut joint = Joint::new(parameters, 25.0).unwrap().released_at(0.0, 0.5);
    let (mut least, mut most) = (f64::MAX, f64::MIN);
    for step in 0..50_000 {
        let state = joint.state();
        let wanted = 200.0 * (0.5 - state.velocity) + state.friction_torque;
        joint.advance(parameters.motor.current_for(wanted), 0.0, MAXIMUM_STEP);
        if step > 5000 {
            least = least.min(joint.state().friction_torque);
            most = most.max(joint.state().friction_torque);
        }
    }
    // 8 % of 3 Nm up and down.
    assert!(((most - least) / 0.48 - 1.0).abs() < 0.03, "{least} to {most} Nm");
}
