//! Field weakening and the whole hexagon of the virtual joint: how much faster it gets, and that nothing else changes.

use crate::rig::{Rig, reference, torque, velocity};
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::Controlword;
use joint_firmware::motor::modulation::HIGHEST_VOLTAGE_FRACTION;
use plant::actuator::ActuatorParameters;
use plant::virtual_joint::Setup;

/// Part of the supply that the joints here have of what they are made for: their base speed lies below the velocity
/// limit then.
const SUPPLY: f64 = 0.6;

/// A joint without gravity on a weak supply, and its setup with the highest velocity limit that permits field
/// weakening.
fn weak(parameters: ActuatorParameters) -> (ActuatorParameters, Setup) {
    let mut parameters = parameters.aligned();
    let load = &mut parameters.joint.load;
    (load.inertia, load.mass, load.length) = (load.total_inertia(), 0.0, 0.0);
    let mut setup = Setup::of(&parameters);
    parameters.bus.source_voltage *= SUPPLY;
    let limits = &mut setup.configuration.limits;
    limits.bus_voltage.0 *= SUPPLY as f32;
    limits.position = (-900.0, 900.0);
    limits.velocity = 0.999 * fastest(&parameters, f64::from(limits.bus_voltage.1)) as f32;
    limits.damping = limits.damping.max(limits.least_damping());
    (parameters, setup)
}

/// Velocity, rad/s, 1.2 times which induces a voltage between phases, V.
fn fastest(parameters: &ActuatorParameters, voltage: f64) -> f64 {
    let motor = &parameters.joint.motor;
    let flux = parameters.windings.flux_linkage(motor);
    voltage / (1.2 * 3f64.sqrt() * flux * parameters.windings.pole_pairs as f64 * motor.gear_ratio.abs())
}

/// The largest d current that may be configured, A.
fn most(parameters: &ActuatorParameters, setup: &Setup) -> f32 {
    let flux = parameters.windings.flux_linkage(&parameters.joint.motor) as f32;
    setup.configuration.motor.current_limit.min(0.999 * flux / setup.configuration.motor.inductance_d)
}

/// Driven with all of its torque for `time` s: the fastest, rad/s, and the largest current over the limit.
fn driven(rig: &mut Rig, direction: f32, time: f64) -> (f64, f64) {
    let limit = f64::from(rig.joint.active().current_limit);
    rig.demand.command = torque(direction * rig.joint.active().limits.torque);
    let (mut fastest, mut largest) = (0.0f64, 0.0f64);
    for _ in 0..rig.steps_in(time) {
        rig.step();
        let [d, q] = rig.joint.actuator().state().dq_current;
        fastest = fastest.max(rig.velocity().abs());
        largest = largest.max(d.hypot(q) / limit);
    }
    (fastest, largest)
}

#[test]
fn it_turns_faster_with_field_weakening_and_faster_with_the_hexagon_within_the_current_limit() {
    let (mut counted, mut weakened, mut widened) = (0, 0, 0);
    for seed in 0..80 {
        let (parameters, setup) = weak(ActuatorParameters::randomised(seed));
        let run = |current: f32, fraction: f32| {
            let mut setup = setup;
            setup.configuration.motor.field_weakening_current = current;
            setup.configuration.gains.voltage_fraction = fraction;
            let mut rig = Rig::enabled(parameters, &setup);
            let (fastest, largest) = driven(&mut rig, if seed % 2 == 0 { 1.0 } else { -1.0 }, 0.6);
            (fastest, largest, rig.latched())
        };
        let (without, current, faults) = run(0.0, 1.0);
        // Those that something else holds are no measure: their speed limit, or friction.
        if !faults.is_empty() || without > 0.85 * f64::from(setup.configuration.limits.velocity) {
            continue;
        }
        let (hexagon, of_hexagon, hexagon_faults) = run(0.0, HIGHEST_VOLTAGE_FRACTION);
        let (with, of_weakening, weakening_faults) = run(most(&parameters, &setup), 1.0);
        println!(
            "{seed}: {without:.2} rad/s, hexagon {:.3}, weakening {:.3} times; {current:.2} {of_hexagon:.2} {of_weakening:.2} of the current; {hexagon_faults:?} {weakening_faults:?}",
            hexagon / without,
            with / without
        );
        assert!(hexagon_faults.is_empty() && weakening_faults.is_empty(), "{seed}");
        assert!(of_weakening < current.max(1.0) + 0.1, "{seed}: {of_weakening}");
        counted += 1;
        assert!(with > 0.99 * without, "{seed}: slower");
        weakened += u32::from(with > 1.05 * without);
        widened += u32::from(hexagon > 1.02 * without);
    }
    println!("{weakened} and {widened} of {counted}");
    assert!(
        counted >= 40 && weakened * 4 >= counted * 3 && widened * 4 >= counted * 3,
        "{weakened} {widened} {counted}"
    );
}

#[test]
fn below_the_base_speed_not_a_bit_changes() {
    let (parameters, setup) = weak(reference());
    let mut with = setup;
    with.configuration.motor.field_weakening_current = most(&parameters, &setup);
    let rigs = [setup, with].map(|setup| Rig::enabled(parameters, &setup));
    let base = SUPPLY / 1.3 * f64::from(setup.configuration.limits.velocity);
    let [mut one, mut other] = rigs;
    for speed in [0.3, -0.5, 0.5] {
        for rig in [&mut one, &mut other] {
            rig.demand.command = velocity((speed * base) as f32);
        }
        for _ in 0..one.steps_in(0.5) {
            one.step();
            other.step();
            assert_eq!(one.joint.joint().telemetry(), other.joint.joint().telemetry());
        }
        assert!((one.velocity() / (speed * base) - 1.0).abs() < 0.1, "{} of {}", one.velocity(), speed * base);
    }
}

/// The diodes rectify what the rotor induces: on a supply that takes nothing back, it stays below the highest.
#[test]
fn a_bridge_that_switches_off_at_the_highest_speed_leaves_the_supply_below_its_limit() {
    let (mut parameters, mut setup) = weak(reference());
    parameters.bus.takes_back = false;
    setup.configuration.motor.field_weakening_current = most(&parameters, &setup);
    let mut rig = Rig::enabled(parameters, &setup);
    let (fastest, _) = driven(&mut rig, 1.0, 1.0);
    assert!(rig.latched().is_empty(), "{:?}", rig.latched());
    let induced = fastest / self::fastest(&parameters, 1.0);
    let before = rig.joint.actuator().state().bus_voltage;
    rig.demand.controlword = Controlword::DISABLE_VOLTAGE;
    let mut highest = 0.0f64;
    for _ in 0..rig.steps_in(0.1) {
        rig.step();
        highest = highest.max(rig.joint.actuator().state().bus_voltage);
    }
    println!("{before:.2} V, {:.2} V are induced, {highest:.2} V after", induced / 1.2);
    assert!(!rig.latched().contains(&Fault::OverVoltage));
    assert!(highest < f64::from(setup.configuration.limits.bus_voltage.1));
}

#[test]
fn a_speed_that_would_raise_the_supply_above_its_limit_is_refused() {
    let (parameters, setup) = weak(reference());
    let of = |part: f32, current: f32| {
        let mut changed = setup;
        changed.configuration.limits.velocity *= part;
        changed.configuration.motor.field_weakening_current = current;
        changed.configuration.verify(&changed.bridge).err().map(|error| error.to_string())
    };
    let current = most(&parameters, &setup);
    assert_eq!((of(1.0, current), of(1.002, 0.0)), (None, None));
    let refused = of(1.002, current).unwrap();
    assert!(refused.contains("voltage induced where over-speed is a fault") && refused.contains(" V"), "{refused}");
    // A d current beyond the flux linkage, and one beyond the current limit.
    let motor = &setup.configuration.motor;
    let flux = parameters.windings.flux_linkage(&parameters.joint.motor) as f32 / motor.inductance_d;
    let bound = motor.current_limit.min(flux);
    assert_eq!(of(1.0, 0.999 * bound), None);
    for current in [1.001 * bound, -0.001, f32::NAN] {
        let refused = of(1.0, current);
        assert!(refused.is_some_and(|refused| refused.contains("field-weakening current")), "{current}");
    }
}
