//! The physical friction model as the image holds it.

use super::QuantizeError;
use super::full_scale::{from_q16, from_si, to_si};
use crate::friction_model::{Directional, FrictionModel, Term, Terms as FloatTerms};
use friction_compensation::friction::domain::Domain;
use friction_compensation::friction::physical::{Coefficients, PhysicalParameters, Terms};
use friction_compensation::friction::state::SIGNALS;

/// Quantises `model` for evaluation in `domain`. Coefficients of terms that are off become zero.
///
/// A slope too steep for its format (1/v_c, 1/v_st) is held at the steepest: both curves are then within a thousandth
/// of their limit, a step, beyond a thousandth of full-scale velocity.
pub fn quantize(model: &FrictionModel, domain: &Domain) -> Result<PhysicalParameters, QuantizeError> {
    let shifts = domain.shifts();
    let values = natural(model);
    let mut bits = [0; Coefficients::COUNT];
    for i in 0..Coefficients::COUNT {
        let (name, dimension) = (Coefficients::NAMES[i], Coefficients::DIMENSIONS[i]);
        bits[i] = match from_si(name, values[i], dimension, &shifts) {
            Err(QuantizeError::Range { .. }) if name.ends_with("slope") && values[i] > 0.0 => i32::MAX,
            other => other?,
        };
    }
    let terms = of_a_set().filter(|&term| model.terms.contains(term));
    let terms = terms.fold(Terms::default(), |set, term| set.union(firmware_term(term)));
    Ok(PhysicalParameters { terms, coefficients: Coefficients::from_array(bits) })
}

/// The terms that a parameter set has for itself.
fn of_a_set() -> impl Iterator<Item = Term> {
    Term::ALL.into_iter().take(Term::OF_A_SET)
}

/// The firmware's bit for a term of a set: both list them in the same order.
fn firmware_term(term: Term) -> Terms {
    Terms(1 << term as u32)
}

/// The coefficients in SI, in the firmware's order; zero where their term is off.
fn natural(model: &FrictionModel) -> [f64; Coefficients::COUNT] {
    let on = |term: Term, value: f64| if model.terms.contains(term) { value } else { 0.0 };
    let either = |a: Term, b: Term, value: f64| if model.terms.contains(a) { value } else { on(b, value) };
    let harmonic = |amplitude: f64| on(Term::Harmonics, amplitude);
    let mut values = vec![
        on(Term::Constant, model.offset),
        on(Term::Position, model.position_slope),
        on(Term::Temperature, model.temperature_slope),
        on(Term::Load, model.load_slope),
        on(Term::Viscous, model.viscous),
        on(Term::ViscousTemperature, model.viscous_temperature),
        on(Term::Quadratic, model.quadratic),
        on(Term::Coulomb, model.coulomb.positive),
        on(Term::Coulomb, model.coulomb.negative),
        on(Term::CoulombTemperature, model.coulomb_temperature),
        on(Term::CoulombLoad, model.coulomb_load),
        either(Term::Coulomb, Term::Harmonics, model.coulomb_slope),
        on(Term::Stribeck, model.breakaway.positive),
        on(Term::Stribeck, model.breakaway.negative),
        on(Term::Stribeck, model.stribeck_slope),
        on(Term::Hysteresis, model.hysteresis),
        on(Term::Hysteresis, model.hysteresis_velocity_slope),
        on(Term::Hysteresis, model.hysteresis_width),
        on(Term::Hysteresis, model.hysteresis_acceleration_slope),
        on(Term::Harmonics, model.harmonic_frequency),
    ];
    values.extend(model.harmonic_positive.map(harmonic));
    values.extend(model.harmonic_negative.map(harmonic));
    values.push(on(Term::RotorInertia, model.rotor_inertia));
    values.push(on(Term::ViscousAsymmetry, model.viscous_asymmetry));
    let weakening = [model.weakening.positive, model.weakening.negative, model.weakening_slope];
    values.extend(weakening.map(|value| on(Term::VelocityWeakening, value)));
    std::array::from_fn(|i| values[i])
}

/// The model that stored parameters stand for.
pub fn dequantize(parameters: &PhysicalParameters, domain: &Domain) -> FrictionModel {
    let shifts = domain.shifts();
    let bits = parameters.coefficients.to_array();
    let values: [f64; Coefficients::COUNT] =
        std::array::from_fn(|i| to_si(bits[i], Coefficients::DIMENSIONS[i], &shifts));
    let terms: Vec<Term> = of_a_set().filter(|term| parameters.terms.contains(firmware_term(*term))).collect();
    FrictionModel {
        terms: FloatTerms::of(&terms),
        offset: values[0],
        position_slope: values[1],
        temperature_slope: values[2],
        load_slope: values[3],
        viscous: values[4],
        viscous_temperature: values[5],
        quadratic: values[6],
        coulomb: Directional { positive: values[7], negative: values[8] },
        coulomb_temperature: values[9],
        coulomb_load: values[10],
        coulomb_slope: values[11],
        breakaway: Directional { positive: values[12], negative: values[13] },
        stribeck_slope: values[14],
        hysteresis: values[15],
        hysteresis_velocity_slope: values[16],
        hysteresis_width: values[17],
        hysteresis_acceleration_slope: values[18],
        harmonic_frequency: values[19],
        harmonic_positive: std::array::from_fn(|j| values[20 + j]),
        harmonic_negative: std::array::from_fn(|j| values[25 + j]),
        rotor_inertia: values[30],
        viscous_asymmetry: values[31],
        weakening: Directional { positive: values[32], negative: values[33] },
        weakening_slope: values[34],
        reference_temperature: from_q16(domain.reference_temperature),
        ..FrictionModel::default()
    }
}

/// Signals that the model depends on, in the order of [`Signal`](friction_compensation::friction::state::Signal).
pub fn depends_on(model: &FrictionModel) -> [bool; SIGNALS] {
    let any = |terms: &[Term]| terms.iter().any(|&term| model.terms.contains(term));
    use Term::*;
    [
        any(&[Position, Harmonics]),
        any(&[Viscous, ViscousAsymmetry, Quadratic, Coulomb, Stribeck, Hysteresis, Harmonics]),
        any(&[Load, CoulombLoad]),
        false,
        any(&[Temperature, ViscousTemperature, CoulombTemperature]),
        any(&[Hysteresis, RotorInertia]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_list_terms_and_coefficients_in_the_same_order() {
        assert_eq!(Term::OF_A_SET, Terms::NAMES.len());
        for (term, name) in of_a_set().zip(Terms::NAMES) {
            let text = serde_json::to_string(&term).unwrap().replace('-', "_");
            assert_eq!(text.trim_matches('"'), name);
        }
        let mut model = FrictionModel { rotor_inertia: 7.0, offset: 1.0, ..FrictionModel::default() };
        model.terms = of_a_set().fold(model.terms, |set, term| set.with(term));
        (model.stribeck_slope, model.harmonic_negative[4]) = (14.0, 29.0);
        let values = natural(&model);
        let at = |name: &str| values[Coefficients::NAMES.iter().position(|n| *n == name).unwrap()];
        assert_eq!(
            [at("constant"), at("stribeck_slope"), at("harmonic_negative_5"), at("rotor_inertia")],
            [1.0, 14.0, 29.0, 7.0]
        );
    }

    #[test]
    fn a_stored_model_stands_for_what_was_stored() {
        let range = friction_compensation::friction::domain::Range { low: -(3 << 16), high: 3 << 16 };
        let domain = Domain { ranges: [range; SIGNALS], margin: 1 << 15, reference_temperature: 25 << 16 };
        let bits = std::array::from_fn(|i| (i as i32 + 1) * 1000);
        let terms = Terms::ALL;
        let parameters = PhysicalParameters { terms, coefficients: Coefficients::from_array(bits) };
        assert_eq!(quantize(&dequantize(&parameters, &domain), &domain), Ok(parameters));
    }
}
