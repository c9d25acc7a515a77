//! The whole actuator: motion, energy, effects one by one, random actuators, refusals.

use crate::support::{CurrentController, PERIOD, actuator, coast, duties, hold_current};
use plant::actuator::Effect;
use plant::actuator::windings::PhaseOrder;
use plant::contact::{Contact, Side};
use plant::friction_factors::FrictionFactors;
use plant::{Actuator, ActuatorParameters, Joint, JointParameters, ParameterError};

#[test]
fn a_held_current_moves_the_joint_as_the_ideal_torque_source_does() {
    let parameters = ActuatorParameters::reference().without(Effect::Cogging).without(Effect::Saliency);
    let mut electrical = actuator(parameters);
    hold_current(&mut electrical, [0.0, 5.0], 0.3);
    let mut ideal = Joint::new(parameters.joint, 25.0).unwrap();
    ideal.advance(5.0, 0.0, 0.3);
    let (position, expected) = (electrical.state().joint.position, ideal.state().position);
    assert!(expected > 0.3);
    assert!((position / expected - 1.0).abs() < 0.02, "{position} rad against {expected} rad");
    let torque = electrical.state().joint.motor_torque;
    assert!((torque - 5.0 * parameters.joint.motor.torque_per_ampere()).abs() < 0.02 * torque, "{torque} Nm");
}

#[test]
fn over_a_hard_run_the_energy_from_the_source_is_heat_and_stored_energy_within_half_a_percent() {
    let parameters = ActuatorParameters::reference().without(Effect::Cogging);
    let mut actuator = actuator(parameters);
    let stored = |actuator: &Actuator| {
        let state = actuator.state();
        actuator.joint().stored_energy() + state.magnetic_energy + state.bus_energy
    };
    let before = stored(&actuator);
    let mut controller = CurrentController::new(&parameters);
    let (mut supplied, mut heat) = (0.0, 0.0);
    for n in 0..20_000 {
        let wanted = 12.0 * (8.0 * f64::from(n) * PERIOD).sin();
        let duties = controller.duties(&actuator, [0.0, wanted]);
        actuator.advance(true, duties, 0.0, PERIOD);
        let state = actuator.state();
        supplied += state.source_current * (parameters.bus.source_voltage) * PERIOD;
        let line = state.source_current * state.source_current * parameters.bus.source_resistance;
        let losses = state.powers.copper_loss + state.powers.bridge_loss + state.joint.friction_loss + line;
        heat += (losses + parameters.inverter.idle_power) * PERIOD;
    }
    let gained = stored(&actuator) - before;
    assert!(supplied > 20.0, "{supplied} J");
    assert!((supplied - heat - gained).abs() < 0.005 * supplied, "{supplied} J in, {heat} J heat, {gained} J stored");
}

#[test]
fn in_every_driven_period_the_powers_add_up_to_rounding() {
    let mut actuator = actuator(ActuatorParameters::reference()).released_at(0.0, 3.0);
    let mut most: f64 = 0.0;
    for n in 0..4000 {
        let phase = 0.11 * f64::from(n);
        let before = actuator.state().magnetic_energy;
        actuator.advance(true, [0.0, 2.1, 4.2].map(|shift| 0.5 + 0.3 * (phase + shift).sin()), 0.0, PERIOD);
        let powers = actuator.state().powers;
        let stored = (actuator.state().magnetic_energy - before) / PERIOD;
        let sum = powers.copper_loss + powers.bridge_loss + powers.mechanical + stored;
        assert!((powers.input - sum).abs() < 1e-7, "{powers:?} and {stored} W");
        assert!(powers.bridge_loss >= 0.0 && powers.copper_loss >= 0.0);
        most = most.max(powers.input.abs());
    }
    assert!(most > 100.0, "{most} W");
}

#[test]
fn a_current_vector_that_turns_forward_turns_the_rotor_by_the_phase_order() {
    let turned = |order: PhaseOrder| {
        let mut parameters = ActuatorParameters::reference().without_payload().aligned();
        parameters.windings.phase_order = order;
        let mut actuator = actuator(parameters);
        // Open loop: a vector of a steady 2 V that makes three electrical turns in half a second.
        for n in 0..10_000 {
            let angle = std::f64::consts::TAU * 3.0 * f64::from(n) / 10_000.0;
            let voltages = [0.0, 1.0, 2.0].map(|k| 2.0 * (angle - k * std::f64::consts::TAU / 3.0).cos());
            actuator.advance(true, duties(voltages, 36.0), 0.0, PERIOD);
        }
        actuator.state().rotor_angle
    };
    let forward = turned(PhaseOrder::Forward);
    let turn = std::f64::consts::TAU / 7.0;
    assert!((forward / turn - 3.0).abs() < 0.25, "{} electrical turns", forward / turn);
    let exchanged = turned(PhaseOrder::Exchanged);
    assert!((exchanged / turn + 3.0).abs() < 0.25, "{} electrical turns", exchanged / turn);
}

#[test]
fn a_voltage_along_phase_a_aligns_the_rotor_with_its_electrical_zero() {
    let mut parameters = ActuatorParameters::reference().without_payload();
    parameters.windings.electrical_zero = 1.0;
    parameters.joint.friction = parameters
        .joint
        .friction
        .scaled(&FrictionFactors {
            viscous: plant::friction::Directional { forward: 1.0, backward: 1.0 },
            ..FrictionFactors::uniform(0.05)
        })
        .unwrap();
    let mut actuator = actuator(parameters);
    for _ in 0..20_000 {
        actuator.advance(true, duties([2.0, -1.0, -1.0], 36.0), 0.0, PERIOD);
    }
    let angle = actuator.state().electrical_angle;
    let off = angle.min(std::f64::consts::TAU - angle);
    assert!(off < 0.05, "{off} rad from phase A");
}

#[test]
fn cogging_shakes_a_turning_joint_as_often_as_its_teeth_pass() {
    let swing = |parameters: ActuatorParameters| {
        let mut actuator = actuator(parameters.without_payload().without(Effect::FrictionRipple)).released_at(0.0, 0.4);
        let mut accelerations = vec![];
        for _ in 0..8000 {
            // Just what friction takes at this speed.
            let friction = actuator.state().joint.friction_torque;
            coast(&mut actuator, friction, PERIOD);
            accelerations.push(actuator.state().joint.acceleration);
        }
        let crossings = accelerations[1000..].windows(2).filter(|pair| pair[0] < 0.0 && pair[1] >= 0.0).count();
        (accelerations[1000..].iter().fold(0.0_f64, |most, a| most.max(*a)), crossings)
    };
    let parameters = ActuatorParameters::reference();
    let (with, crossings) = swing(parameters);
    // 0.003 Nm x 50 on 0.25 kg m2; 84 x 50 per turn of the link at 0.4 rad/s for 0.35 s.
    assert!((with / 0.6 - 1.0).abs() < 0.15, "{with} rad/s2");
    assert!((80..110).contains(&crossings), "{crossings}");
    assert!(swing(parameters.without(Effect::Cogging)).0 < 0.05 * with);
}

#[test]
fn hot_windings_need_more_voltage_and_give_the_same_current_without_the_rise() {
    let current = |parameters: ActuatorParameters, temperature: f64| {
        let mut parameters = parameters.aligned();
        parameters.joint.thermal.winding_capacity = 1e4;
        let mut actuator = Actuator::new(parameters, temperature, 1).unwrap();
        for _ in 0..1000 {
            actuator.advance(true, duties([1.0, -0.5, -0.5], actuator.state().bus_voltage), 0.0, PERIOD);
        }
        actuator.state().dq_current[0]
    };
    let parameters = ActuatorParameters::reference().without(Effect::DeadTime);
    let ratio = current(parameters, 25.0) / current(parameters, 125.0);
    // 0.2 ohm rise by 38.5 %, the bridge's 5 mOhm do not.
    assert!((ratio - (0.277 + 0.005) / 0.205).abs() < 0.01, "{ratio}");
    let flat = parameters.without(Effect::ResistanceRise);
    assert!((current(flat, 25.0) / current(flat, 125.0) - 1.0).abs() < 1e-3);
}

#[test]
fn one_or_two_steps_in_a_period_give_the_same_run() {
    let run = |period: f64| {
        let mut parameters = ActuatorParameters::reference().aligned();
        // The same time on the way, and the same share of the period.
        parameters.inverter.duty_delay = 0;
        parameters.inverter.dead_time *= period / PERIOD;
        let mut actuator = actuator(parameters);
        for n in 0..(0.1 / period).round() as usize {
            let angle = 120.0 * n as f64 * period;
            let voltages = [0.0, 2.0943951, 4.1887902].map(|shift| 3.0 * (angle - shift).cos());
            actuator.advance(true, duties(voltages, 36.0), 0.0, period);
        }
        (actuator.state().joint.position, actuator.state().dq_current)
    };
    let (position, current) = run(5e-5);
    let (finer, finer_current) = run(1.25e-5);
    assert!(position > 0.01);
    assert!((position / finer - 1.0).abs() < 0.02, "{position} rad, {finer} rad");
    assert!((current[1] - finer_current[1]).abs() < 0.3, "{current:?} A, {finer_current:?} A");
}

#[test]
fn every_effect_can_be_switched_off_on_its_own_and_is_in_the_reference_or_a_random_actuator() {
    let actuators: Vec<_> =
        (0..20).map(ActuatorParameters::randomised).chain([ActuatorParameters::reference()]).collect();
    for effect in Effect::ALL {
        let different = actuators.iter().filter(|parameters| parameters.without(effect) != **parameters).count();
        let mut late = ActuatorParameters::reference();
        late.sensors.currents.delay = 1;
        assert!(different > 0 || late.without(effect) != late, "{effect:?} changes nothing");
        for parameters in &actuators {
            let without = parameters.without(effect);
            without.validate().unwrap_or_else(|error| panic!("{effect:?}: {error}"));
            assert_eq!(without.without(effect), without);
            assert_eq!(without.ideal(), parameters.ideal());
            // With nothing but the effect, switching it off leaves the ideal actuator.
            assert_eq!(parameters.with_only(effect).without(effect), parameters.ideal());
        }
    }
}

#[test]
fn switching_an_effect_off_changes_what_the_actuator_does_or_shows() {
    // An off-axis run that touches everything: warm, loaded, both directions.
    let mut parameters = ActuatorParameters::randomised(3);
    parameters.sensors.currents.delay = 1;
    parameters.sensors.encoder.delay = 1;
    parameters.sensors.winding.fitted = true;
    let run = |parameters: ActuatorParameters| {
        let mut actuator = Actuator::new(parameters, 45.0, 7).unwrap();
        let limit = parameters.joint.motor.current_limit;
        let mut controller = CurrentController::new(&parameters);
        (0..6000)
            .map(|n| {
                let wanted = 0.4 * limit * (20.0 * f64::from(n) * PERIOD).sin();
                let duties = controller.duties(&actuator, [-0.1 * limit, wanted]);
                actuator.advance(true, duties, 0.0, PERIOD);
                (*actuator.state(), actuator.measure())
            })
            .collect::<Vec<_>>()
    };
    let all = run(parameters);
    for effect in Effect::ALL {
        assert_ne!(run(parameters.without(effect)), all, "{effect:?}");
    }
}

#[test]
fn payload_and_no_payload_differ_by_gravity_and_inertia_alone() {
    let bare = ActuatorParameters::reference().without_payload();
    let loaded = bare.with_payload(2.0, 0.5);
    assert!((loaded.joint.load.total_inertia() - bare.joint.load.total_inertia() - 0.5).abs() < 1e-12);
    assert_eq!(bare.joint.load.gravity_amplitude(), 0.0);
    assert_eq!(loaded.without_payload(), bare.with_payload(0.0, 0.5));
    // Released from the horizontal the loaded one falls.
    let fall = |parameters: ActuatorParameters| {
        let mut actuator = actuator(parameters).released_at(1.57, 0.0);
        coast(&mut actuator, 0.0, 0.2);
        actuator.state().joint.velocity
    };
    assert!(fall(loaded) < -0.5 && fall(bare).abs() < 1e-2);
}

#[test]
fn a_wall_stops_the_link_on_its_side_and_never_pulls() {
    let mut actuator = actuator(ActuatorParameters::reference().aligned().without_payload());
    let wall = Contact { position: 0.2, stiffness: 1000.0, damping: 20.0, side: Side::Above };
    actuator.set_contact(Some(wall)).unwrap();
    hold_current(&mut actuator, [0.0, 6.0], 1.0);
    // 27 Nm less at most the friction, on 1000 Nm/rad.
    let pressed = (actuator.state().joint.position - 0.2) * 1000.0;
    assert!((20.0..32.0).contains(&pressed), "{pressed} Nm");
    assert!(actuator.state().joint.velocity.abs() < 1e-2);
    hold_current(&mut actuator, [0.0, -6.0], 0.3);
    assert!(actuator.state().joint.position < 0.0, "it leaves the wall freely");
    // And a wall of steel keeps the joint finite.
    actuator.set_contact(Some(Contact { stiffness: 1e9, damping: 1e7, ..wall })).unwrap();
    hold_current(&mut actuator, [0.0, 10.0], 1.0);
    assert!((actuator.state().joint.position - 0.2).abs() < 1e-3);
    assert!(actuator.set_contact(Some(Contact { stiffness: -1.0, ..wall })).is_err());
}

#[test]
fn every_seed_draws_a_valid_actuator_whose_battery_reaches_speed_limit_and_peak_torque_with_half_the_current() {
    for seed in 0..5000 {
        let parameters = ActuatorParameters::randomised(seed);
        parameters.validate().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let motor = &parameters.joint.motor;
        let linear = parameters.bus.source_voltage / 3.0_f64.sqrt();
        let needed = parameters.voltage_for(parameters.joint.limits.speed, 0.5 * motor.current_limit);
        assert!(needed < 0.95 * linear, "seed {seed}: {needed} V of {linear} V");
        let original = JointParameters::randomised(seed);
        assert!((motor.torque_limit() / original.motor.torque_limit() - 1.0).abs() < 1e-9);
        let loss = motor.copper_loss(motor.current_limit);
        assert!((loss / original.motor.copper_loss(original.motor.current_limit) - 1.0).abs() < 1e-9);
        assert!(parameters.joint.limits.speed > 0.5, "seed {seed}: {} rad/s", parameters.joint.limits.speed);
        let electrical = parameters.windings.pole_pairs as f64 * motor.gear_ratio * parameters.joint.limits.speed;
        assert!(electrical <= 4000.0 * (1.0 + 1e-9), "seed {seed}: {electrical} rad/s");
        let time_constant = parameters.windings.inductance_d / (motor.resistance / 1.5);
        assert!((2.4999e-4..3.0001e-3).contains(&time_constant), "seed {seed}: {time_constant} s");
    }
    assert_eq!(ActuatorParameters::randomised(42), ActuatorParameters::randomised(42));
    assert_ne!(ActuatorParameters::randomised(42), ActuatorParameters::randomised(43));
}

#[test]
fn a_hundred_random_actuators_follow_their_current_and_stay_finite() {
    for seed in 0..100 {
        let parameters = ActuatorParameters::randomised(seed);
        let mut actuator = Actuator::new(parameters, 30.0, seed).unwrap();
        let limit = parameters.joint.motor.current_limit;
        hold_current(&mut actuator, [0.0, 0.3 * limit], 0.02);
        let [d, q] = actuator.state().dq_current;
        assert!((q / (0.3 * limit) - 1.0).abs() < 0.15 && d.abs() < 0.05 * limit, "seed {seed}: {d} A, {q} A");
        coast(&mut actuator, 0.0, 0.5);
        let state = actuator.state();
        assert!(state.joint.position.is_finite() && state.bus_voltage.is_finite() && state.dq_current == [0.0; 2]);
    }
}

#[test]
fn friction_factors_scale_each_parameter_and_keep_the_friction_possible() {
    let friction = JointParameters::reference().friction;
    assert_eq!(friction.scaled(&FrictionFactors::uniform(1.0)).unwrap(), friction);
    let more = friction.scaled(&FrictionFactors::uniform(1.3)).unwrap();
    assert!((more.coulomb.forward / friction.coulomb.forward - 1.3).abs() < 1e-12);
    assert!((more.ripple[1].amplitude / friction.ripple[1].amplitude - 1.3).abs() < 1e-12);
    assert_eq!(more.ripple[1].periods_per_revolution, friction.ripple[1].periods_per_revolution);
    // A breakaway torque below the Coulomb torque does not exist.
    let mut factors = FrictionFactors::uniform(1.0);
    factors.coulomb.forward = 1.5;
    factors.breakaway.forward = 0.7;
    let odd = friction.scaled(&factors).unwrap();
    assert_eq!(odd.breakaway.forward, odd.coulomb.forward);
    factors.gear_loss = -0.1;
    assert!(friction.scaled(&factors).is_err());

    let draws: Vec<_> = (0..500).map(|seed| FrictionFactors::drawn(seed, 0.3)).collect();
    let (low, high) = draws
        .iter()
        .fold((f64::MAX, f64::MIN), |(low, high), f| (low.min(f.stribeck_velocity), high.max(f.stribeck_velocity)));
    assert!((0.7..0.705).contains(&low) && (1.295..1.3).contains(&high), "{low} to {high}");
    assert_ne!(draws[0].coulomb.forward, draws[0].coulomb.backward);
    let corners = FrictionFactors::extreme(1, 0.3);
    for factor in [corners.coulomb.forward, corners.viscous.backward, corners.gear_loss, corners.ripple[0]] {
        assert!(factor == 0.7 || factor == 1.3);
    }
    for seed in 0..500 {
        let friction = ActuatorParameters::randomised(seed).joint.friction;
        for factors in [FrictionFactors::drawn(seed, 0.3), FrictionFactors::extreme(seed, 0.3)] {
            friction.scaled(&factors).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        }
    }
}

#[test]
fn every_parameter_is_refused_as_not_a_number_and_far_outside_its_range() {
    type Field = fn(&mut ActuatorParameters) -> &mut f64;
    let fields: &[(&str, Field)] = &[
        ("friction.gear_loss", |p| &mut p.joint.friction.gear_loss),
        ("windings.inductance_d", |p| &mut p.windings.inductance_d),
        ("windings.inductance_q", |p| &mut p.windings.inductance_q),
        ("windings.resistance_rise", |p| &mut p.windings.resistance_rise),
        ("windings.electrical_zero", |p| &mut p.windings.electrical_zero),
        ("windings.cogging.amplitude", |p| &mut p.windings.cogging.amplitude),
        ("windings.cogging.periods_per_turn", |p| &mut p.windings.cogging.periods_per_turn),
        ("windings.cogging.phase", |p| &mut p.windings.cogging.phase),
        ("inverter.dead_time", |p| &mut p.inverter.dead_time),
        ("inverter.clamping_current", |p| &mut p.inverter.clamping_current),
        ("inverter.on_resistance", |p| &mut p.inverter.on_resistance),
        ("inverter.diode_drop", |p| &mut p.inverter.diode_drop),
        ("inverter.thermal_resistance", |p| &mut p.inverter.thermal_resistance),
        ("inverter.heat_capacity", |p| &mut p.inverter.heat_capacity),
        ("inverter.idle_power", |p| &mut p.inverter.idle_power),
        ("bus.source_voltage", |p| &mut p.bus.source_voltage),
        ("bus.source_resistance", |p| &mut p.bus.source_resistance),
        ("bus.capacitance", |p| &mut p.bus.capacitance),
        ("currents.offset", |p| &mut p.sensors.currents.offset[1]),
        ("currents.gain_error", |p| &mut p.sensors.currents.gain_error[2]),
        ("currents.noise", |p| &mut p.sensors.currents.noise),
        ("currents.resolution", |p| &mut p.sensors.currents.resolution),
        ("currents.lowest", |p| &mut p.sensors.currents.lowest),
        ("currents.highest", |p| &mut p.sensors.currents.highest),
        ("encoder.zero", |p| &mut p.sensors.encoder.zero),
        ("encoder.noise", |p| &mut p.sensors.encoder.noise),
        ("encoder.eccentricity", |p| &mut p.sensors.encoder.eccentricity),
        ("encoder.eccentricity_phase", |p| &mut p.sensors.encoder.eccentricity_phase),
        ("bus_sensor.gain_error", |p| &mut p.sensors.bus.gain_error),
        ("bus_sensor.noise", |p| &mut p.sensors.bus.noise),
        ("bus_sensor.resolution", |p| &mut p.sensors.bus.resolution),
        ("bus_sensor.highest", |p| &mut p.sensors.bus.highest),
        ("thermistor.lag", |p| &mut p.sensors.winding.lag),
        ("thermistor.resolution", |p| &mut p.sensors.bridge.resolution),
        ("thermistor.lowest", |p| &mut p.sensors.winding.lowest),
        ("thermistor.highest", |p| &mut p.sensors.bridge.highest),
    ];
    for (field, access) in fields {
        for bad in [f64::NAN, f64::INFINITY, -1e9, 1e9] {
            let mut parameters = ActuatorParameters::reference();
            *access(&mut parameters) = bad;
            match Actuator::new(parameters, 25.0, 1).map(|_| ()) {
                Err(ParameterError::OutOfRange { name, value, minimum, maximum }) => {
                    assert_eq!(name, *field);
                    assert_eq!(value.to_bits(), bad.to_bits());
                    assert!(minimum < maximum);
                }
                other => panic!("{field} = {bad}: {other:?}"),
            }
        }
    }
    type Count = fn(&mut ActuatorParameters) -> &mut usize;
    let counts: &[(&str, Count)] = &[
        ("windings.pole_pairs", |p| &mut p.windings.pole_pairs),
        ("inverter.duty_steps", |p| &mut p.inverter.duty_steps),
        ("inverter.duty_delay", |p| &mut p.inverter.duty_delay),
        ("currents.delay", |p| &mut p.sensors.currents.delay),
        ("encoder.counts_per_turn", |p| &mut p.sensors.encoder.counts_per_turn),
        ("encoder.delay", |p| &mut p.sensors.encoder.delay),
    ];
    for (field, access) in counts {
        let mut parameters = ActuatorParameters::reference();
        *access(&mut parameters) = usize::MAX;
        match parameters.validate() {
            Err(ParameterError::CountOutOfRange { name, .. }) => assert_eq!(name, *field),
            other => panic!("{field}: {other:?}"),
        }
    }
    assert!(Actuator::new(ActuatorParameters::reference(), 151.0, 1).is_err());
}
