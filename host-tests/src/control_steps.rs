//! Recorded runs of the whole joint, for the board's core to replay: a model with every term, runs in closed loop with
//! the virtual joint, and what they lead to on this machine.

#[path = "../probe/src/replay.rs"]
#[allow(missing_docs, reason = "its first lines are for those that include it")]
pub mod replay;

use crate::image_bytes::encoded;
use crate::parameters::{coefficients, image, q16, range, tame_network};
use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::Domain;
use friction_compensation::friction::maxwell_slip::MaxwellElement;
use friction_compensation::friction::physical::{Coefficients, PhysicalParameters, Terms};
use friction_compensation::friction::regime::{Criterion, Measure, Selector};
use friction_compensation::friction::ripple::Ripple;
use friction_compensation::friction::{FrictionModel, FrictionParameters, ParameterSet};
use friction_compensation::parameters::certificate::prove;
use joint_firmware::joint::state_machine::State;
use joint_firmware::joint::{Demand, Joint};
use plant::VirtualJoint;
use plant::actuator::ActuatorParameters;
use plant::virtual_joint::Setup;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use replay::{SCENARIOS, SEED, START, STEPS, Scenario, WORDS};

/// Every term, a network in every set, and two criteria that the runs cross where there is room for `most_sets` > 1;
/// friction like the reference joint's.
pub fn friction(most_sets: usize) -> FrictionParameters {
    let domain = Domain {
        ranges: [
            range(-2.5, 2.5),
            range(-6.0, 6.0),
            range(-90.0, 90.0),
            range(-90.0, 90.0),
            range(0.0, 80.0),
            range(-500.0, 500.0),
        ],
        margin: q16(0.2) as u32,
        reference_temperature: q16(25.0),
    };
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut set = |coulomb: f64| {
        let si = Coefficients::NAMES.map(|name| match name {
            "constant" | "position" | "quadratic" => 0.05,
            "temperature" | "viscous_temperature" | "coulomb_temperature" | "load" => -0.002,
            "viscous" => 1.1,
            "coulomb_positive" | "coulomb_negative" => coulomb,
            "coulomb_load" => 0.01,
            "coulomb_slope" => 30.0,
            "breakaway_positive" | "breakaway_negative" => 1.3 * coulomb,
            "stribeck_slope" => 20.0,
            "hysteresis" => 0.1,
            "hysteresis_velocity_slope" => 10.0,
            "hysteresis_width" => 0.5,
            "hysteresis_acceleration_slope" => 0.1,
            "harmonic_frequency" => 4.0,
            "rotor_inertia" => 1e-3,
            _ => 0.05,
        });
        let physical = PhysicalParameters { terms: Terms::ALL, coefficients: coefficients(&domain, &si) };
        let mut network = tame_network(&mut random);
        network.scale = q16(0.05);
        ParameterSet { physical, network: Some(network) }
    };
    let criterion = |measure, enter: f64| Some(Criterion { measure, enter: q16(enter), leave: q16(0.8 * enter) });
    let selector = Selector {
        criteria: [criterion(Measure::Speed, 0.05), criterion(Measure::Coupled, 0.1)],
        fade_time: q16(0.002) as u32,
    };
    let sets = [set(2.5), set(2.4), set(2.3), set(2.2)];
    let one = [sets[0], ParameterSet::default(), ParameterSet::default(), ParameterSet::default()];
    let (selector, sets) = if most_sets == 1 { (Selector::default(), one) } else { (selector, sets) };
    FrictionParameters {
        domain,
        selector,
        common: CommonTerms {
            elements: [0.002, 0.006, 0.02, 0.06]
                .map(|distance| MaxwellElement { stiffness: q16(1.0 / distance), level: q16(0.1) }),
            ripples: [8.0, 50.0].map(|periods| Ripple {
                periods: q16(periods / std::f64::consts::TAU),
                level_sine: q16(0.05),
                level_cosine: q16(-0.03),
                torque_sine: q16(0.02),
                torque_cosine: q16(0.01),
            }),
        },
        sets,
    }
}

/// The model as bytes.
///
/// # Panics
/// Panics if the certificate refuses it.
pub fn image_bytes(most_sets: usize) -> Vec<u8> {
    let friction = friction(most_sets);
    prove(&friction).unwrap_or_else(|error| panic!("{error:?}"));
    encoded(&image(&mut ChaCha8Rng::seed_from_u64(6), friction, 1))
}

/// Input that the program `step` is built around: the image behind its length, then the steps.
pub fn input(image: &[u8], steps: &[[u32; WORDS]]) -> Vec<u8> {
    let mut runs = (image.len() as u16).to_le_bytes().to_vec();
    runs.extend_from_slice(image);
    runs.extend(steps.iter().flatten().flat_map(|word| word.to_le_bytes()));
    runs
}

/// The start and all runs in closed loop with the virtual joint: what the control step was told.
///
/// # Errors
/// The virtual joint cannot be made, or has not stayed enabled.
pub fn record(most_sets: usize) -> Result<Vec<[u32; WORDS]>, Box<dyn std::error::Error>> {
    let parameters = ActuatorParameters::reference().aligned();
    let (configuration, bridge) = replay::configuration(&SCENARIOS[0]);
    let mut started = VirtualJoint::new(parameters, &Setup { configuration, bridge }, 25.0, 3)?;
    let mut steps = Vec::new();
    let mut step = |joint: &mut VirtualJoint, demand: &Demand| {
        let slow = *joint.slow();
        let state = joint.step(demand, 0.0).state;
        steps.push(replay::words(joint.measured(), &slow));
        state
    };
    for n in 0..START {
        step(&mut started, &replay::starting(n));
    }
    for scenario in &SCENARIOS {
        let mut joint = started.clone();
        let (configuration, bridge) = replay::configuration(scenario);
        joint.set_active(configuration.prepare(&bridge)?);
        joint.set_friction(Some(FrictionModel::new(&friction(most_sets), bridge.motion_rate())));
        for n in 0..STEPS {
            let state = step(&mut joint, &replay::demand(scenario, n));
            if state != State::OperationEnabled {
                return Err(format!("{state:?} in step {n}: {:?}", joint.joint().latched_faults()).into());
            }
        }
    }
    Ok(steps)
}

/// The hashes of all runs on this machine; none where the image is refused.
pub fn replayed_here(image: &[u8], steps: &[[u32; WORDS]]) -> Option<Vec<u32>> {
    let mut steps = steps.iter().map(replay::measured);
    let active = replay::prepare(&SCENARIOS[0], image)?;
    let mut started = Joint::new();
    for n in 0..START {
        let (measured, slow) = steps.next()?;
        started.control_step(&active, &replay::starting(n), &slow, &measured);
    }
    let run = |scenario: &Scenario| {
        let active = replay::prepare(scenario, image)?;
        let mut joint = started.clone();
        (0..STEPS).try_fold(SEED, |sum, n| {
            let (measured, slow) = steps.next()?;
            let bridge = joint.control_step(&active, &replay::demand(scenario, n), &slow, &measured);
            Some(replay::hash(sum, &joint, &bridge))
        })
    };
    SCENARIOS.iter().map(run).collect()
}
