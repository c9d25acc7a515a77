//! Every effect of the plant that the firmware compensates: the error is small with its compensation and several times
//! as large with that compensation alone switched off.

use friction_compensation::compensation::Request;
use friction_compensation::friction::physical::Terms;
use friction_compensation::friction::{FrictionModel, FrictionParameters};
use host_tests::driving::{enabled, follow};
use host_tests::informed::informed;
use plant::actuator::{ActuatorParameters, Effect};
use plant::excitation::{Segment, Trajectory, back_and_forth};
use plant::virtual_joint::Setup;

/// Slow and fast, forward and backward, about hanging down and at the side.
fn moves(parameters: &ActuatorParameters) -> Trajectory {
    let limits = &parameters.joint.limits;
    let mut segments = Vec::new();
    for share in [0.02, 0.1, 0.4] {
        segments.extend(back_and_forth(share * limits.speed, 0.5 * limits.travel, 20.0));
    }
    segments.push(Segment::Move { to: 0.9 * limits.travel, speed: 0.3 * limits.speed, acceleration: 20.0 });
    Trajectory::new(segments).unwrap()
}

/// RMS of what compensation leaves of the friction while the reference moves, Nm; `warmth` above ambient, K.
fn friction_left(parameters: &ActuatorParameters, model: &FrictionParameters, warmth: f64) -> f64 {
    let mut setup = Setup::of(parameters).compensating(Request::Physical);
    setup.configuration.compensation.gain = 1.0;
    let mut joint = enabled(parameters, &setup, warmth, 1).unwrap();
    joint.set_friction(Some(FrictionModel::new(model, 20_000)));
    let trajectory = moves(parameters);
    let (mut squares, mut count) = (0.0, 0u32);
    follow(&mut joint, &trajectory, |time, telemetry, state| {
        let reference = trajectory.at(time);
        // Constant speed: at reversals bristles bend, which no model without a memory knows.
        if reference.acceleration == 0.0 && reference.velocity != 0.0 && state.joint.velocity * reference.velocity > 0.0
        {
            squares += (state.joint.friction_torque - f64::from(telemetry.compensated.torque)).powi(2);
            count += 1;
        }
    })
    .unwrap();
    (squares / f64::from(count)).sqrt()
}

/// The ideal actuator with `effect` alone, compensated by the informed model, whole and as `cut` leaves it.
fn with_and_without(effect: Effect, warmth: f64, cut: impl Fn(&mut FrictionParameters)) -> (f64, f64) {
    let parameters = ActuatorParameters::reference().with_only(effect).aligned();
    let whole = informed(&parameters, &parameters.joint.friction);
    let mut without = whole;
    cut(&mut without);
    (friction_left(&parameters, &whole, warmth), friction_left(&parameters, &without, warmth))
}

/// Takes terms out of the model.
fn no(terms: &[Terms]) -> impl Fn(&mut FrictionParameters) {
    let terms = terms.to_vec();
    move |parameters| {
        let physical = &mut parameters.sets[0].physical;
        terms.iter().for_each(|term| physical.terms = Terms(physical.terms.0 & !term.0));
    }
}

fn assert_needed(name: &str, (with, without): (f64, f64), factor: f64) {
    println!("{name}: {with:.4} Nm left, {without:.4} Nm without its compensation");
    assert!(without >= factor * with, "{name}: {with} Nm left, {without} Nm without");
}

#[test]
fn coulomb_friction_needs_its_term() {
    let cut = no(&[Terms::COULOMB, Terms::COULOMB_LOAD, Terms::COULOMB_TEMPERATURE]);
    assert_needed("Coulomb", with_and_without(Effect::EncoderNoise, 0.0, cut), 4.0);
}

#[test]
fn the_stribeck_effect_needs_its_term() {
    // 1.49 with a round of the motion loop in five control steps; 1.54 with the motion law in each and friction in
    // three.
    assert_needed("Stribeck", with_and_without(Effect::Stribeck, 0.0, no(&[Terms::STRIBECK])), 1.4);
}

#[test]
fn viscous_friction_needs_its_term() {
    assert_needed("viscous", with_and_without(Effect::ViscousFriction, 0.0, no(&[Terms::VISCOUS])), 2.0);
}

#[test]
fn asymmetry_needs_two_levels() {
    let cut = |parameters: &mut FrictionParameters| {
        let c = &mut parameters.sets[0].physical.coefficients;
        c.coulomb_negative = c.coulomb_positive;
        c.breakaway_negative = c.breakaway_positive;
    };
    assert_needed("asymmetry", with_and_without(Effect::Asymmetry, 0.0, cut), 1.2);
}

#[test]
fn a_warm_gear_needs_the_temperature_terms() {
    let cut = no(&[Terms::COULOMB_TEMPERATURE, Terms::VISCOUS_TEMPERATURE]);
    assert_needed("temperature", with_and_without(Effect::FrictionTemperature, 40.0, cut), 1.2);
}

#[test]
fn gear_loss_needs_the_load_term() {
    // Gear loss needs a load.
    let parameters = ActuatorParameters::reference();
    let loss = parameters.joint.friction.gear_loss;
    let mut loaded = parameters.with_only(Effect::Payload).aligned();
    loaded.joint.friction.gear_loss = loss;
    let whole = informed(&loaded, &loaded.joint.friction);
    let mut without = whole;
    no(&[Terms::COULOMB_LOAD])(&mut without);
    assert_needed("load", (friction_left(&loaded, &whole, 0.0), friction_left(&loaded, &without, 0.0)), 1.2);
}

/// RMS of the torque that the motor gives less the one that was asked for, Nm, at a share of the speed limit, without
/// friction compensation.
fn torque_error(parameters: &ActuatorParameters, setup: &Setup, share: f64) -> f64 {
    let limits = &parameters.joint.limits;
    let trajectory = Trajectory::new(back_and_forth(share * limits.speed, 0.9 * limits.travel, 20.0)).unwrap();
    let mut joint = enabled(parameters, setup, 0.0, 1).unwrap();
    let (mut squares, mut count) = (0.0, 0u32);
    follow(&mut joint, &trajectory, |_, telemetry, state| {
        squares += (state.joint.motor_torque - f64::from(telemetry.wanted.torque)).powi(2);
        count += 1;
    })
    .unwrap();
    (squares / f64::from(count)).sqrt()
}

#[test]
fn dead_time_needs_its_compensation() {
    let parameters = ActuatorParameters::reference().with_only(Effect::DeadTime).aligned();
    let with = Setup::of(&parameters);
    let mut without = with;
    without.bridge.dead_time = 0.0;
    assert_needed(
        "dead time",
        (torque_error(&parameters, &with, 0.02), torque_error(&parameters, &without, 0.02)),
        1.2,
    );
}

#[test]
fn a_late_encoder_needs_its_latency_made_up_for() {
    let mut parameters = ActuatorParameters::reference().with_only(Effect::EncoderDelay).aligned();
    parameters.sensors.encoder.delay = 6;
    let with = Setup::of(&parameters);
    let mut without = with;
    without.configuration.motor.encoder_latency = 0.0;
    assert_needed(
        "encoder delay",
        (torque_error(&parameters, &with, 0.9), torque_error(&parameters, &without, 0.9)),
        1.2,
    );
}
