//! A friction model that knows the plant's parameters, or nearly: what compensation is with a model that is wrong by a
//! known amount.

use crate::parameters::{coefficients, q16, range};
use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::Domain;
use friction_compensation::friction::physical::{Coefficients, PhysicalParameters, Terms};
use friction_compensation::friction::regime::Selector;
use friction_compensation::friction::{FrictionParameters, ParameterSet};
use plant::actuator::ActuatorParameters;
use plant::friction::{FrictionParameters as Plant, REFERENCE_TEMPERATURE};

/// Width of the model's Coulomb edge, as a part of the plant's Stribeck velocity.
const EDGE: f64 = 0.5;
/// Stribeck velocity of the model, as a part of the plant's: the model's bump rises from zero and falls later than the
/// plant's, which starts at its peak; with this they meet at one and a third of the plant's.
const STRIBECK: f64 = 0.75;

/// The model whose Coulomb, breakaway, viscous, Stribeck, load and temperature terms are those of `friction`; it has no
/// bristle, and no ripple over position.
pub fn informed(actuator: &ActuatorParameters, friction: &Plant) -> FrictionParameters {
    let joint = &actuator.joint;
    let torque = 1.2 * joint.motor.torque_limit();
    let domain = Domain {
        ranges: [
            range(-joint.limits.travel - 1.0, joint.limits.travel + 1.0),
            range(-2.0 * joint.limits.speed, 2.0 * joint.limits.speed),
            range(-torque, torque),
            range(-torque, torque),
            range(-10.0, 90.0),
            range(-2000.0, 2000.0),
        ],
        margin: q16(0.2) as u32,
        reference_temperature: q16(REFERENCE_TEMPERATURE),
    };
    let coulomb = 0.5 * (friction.coulomb.forward + friction.coulomb.backward);
    let si = Coefficients::NAMES.map(|name| match name {
        "viscous" => 0.5 * (friction.viscous.forward + friction.viscous.backward),
        "viscous_temperature" => -friction.viscous_thinning,
        "coulomb_positive" => friction.coulomb.forward,
        "coulomb_negative" => friction.coulomb.backward,
        "coulomb_temperature" => -friction.coulomb_thinning,
        "coulomb_load" => friction.gear_loss / coulomb,
        "coulomb_slope" => 1.0 / (EDGE * friction.stribeck_velocity),
        "breakaway_positive" => friction.breakaway.forward,
        "breakaway_negative" => friction.breakaway.backward,
        "stribeck_slope" => 1.0 / (STRIBECK * friction.stribeck_velocity),
        _ => 0.0,
    });
    let terms = [
        Terms::VISCOUS,
        Terms::VISCOUS_TEMPERATURE,
        Terms::COULOMB,
        Terms::COULOMB_TEMPERATURE,
        Terms::COULOMB_LOAD,
        Terms::STRIBECK,
    ];
    let terms = terms.into_iter().fold(Terms(0), Terms::union);
    let physical = PhysicalParameters { terms, coefficients: coefficients(&domain, &si) };
    let mut sets: [ParameterSet; 4] = Default::default();
    sets[0].physical = physical;
    FrictionParameters { domain, selector: Selector::default(), common: CommonTerms::NONE, sets }
}
