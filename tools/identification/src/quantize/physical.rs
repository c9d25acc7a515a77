//! The physical friction model as the image holds it.

use super::QuantizeError;
use super::full_scale::{from_q16, from_si, to_si};
use crate::friction_model::{FrictionModel, Term, Terms as FloatTerms};
use crate::friction_parameter::{FrictionParameter, place};
use friction_compensation::friction::domain::Domain;
use friction_compensation::friction::physical::{Coefficients, PhysicalParameters, Terms};
use friction_compensation::friction::state::SIGNALS;

/// Slope of the hysteresis over acceleration, the one coefficient that is chosen and not identified.
const ACCELERATION_SLOPE: usize = place("hysteresis_acceleration_slope");

/// Quantises `model` for evaluation in `domain`. Coefficients of terms that are off become zero.
///
/// A slope too steep for its format (1/v_c, 1/v_st) is held at the steepest: both curves are then within a thousandth
/// of their limit, a step, beyond a thousandth of full-scale velocity.
pub fn quantize(model: &FrictionModel, domain: &Domain) -> Result<PhysicalParameters, QuantizeError> {
    let shifts = domain.shifts();
    let terms = firmware_terms(model);
    let values = natural(model, terms);
    let mut bits = [0; Coefficients::COUNT];
    for i in 0..Coefficients::COUNT {
        let (name, dimension) = (Coefficients::NAMES[i], Coefficients::DIMENSIONS[i]);
        bits[i] = match from_si(name, values[i], dimension, &shifts) {
            Err(QuantizeError::Range { .. }) if name.ends_with("slope") && values[i] > 0.0 => i32::MAX,
            other => other?,
        };
    }
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

/// The firmware's bits of a model.
fn firmware_terms(model: &FrictionModel) -> Terms {
    let terms = of_a_set().filter(|&term| model.terms.contains(term));
    terms.fold(Terms::default(), |set, term| set.union(firmware_term(term)))
}

/// The coefficients in SI, in the firmware's order; zero where their terms are off.
fn natural(model: &FrictionModel, terms: Terms) -> [f64; Coefficients::COUNT] {
    let mut values = [0.0; Coefficients::COUNT];
    for parameter in FrictionParameter::all() {
        if let Some(i) = parameter.coefficient() {
            values[i] = model.parameter(parameter);
        }
    }
    values[ACCELERATION_SLOPE] = model.hysteresis_acceleration_slope;
    std::array::from_fn(|i| if matters(i, terms) { values[i] } else { 0.0 })
}

/// True for a coefficient that one of the terms has.
fn matters(coefficient: usize, terms: Terms) -> bool {
    Coefficients::TERMS[coefficient].0 & terms.0 != 0
}

/// The model that stored parameters stand for.
pub fn dequantize(parameters: &PhysicalParameters, domain: &Domain) -> FrictionModel {
    let shifts = domain.shifts();
    let bits = parameters.coefficients.to_array();
    let value = |i: usize| to_si(bits[i], Coefficients::DIMENSIONS[i], &shifts);
    let terms: Vec<Term> = of_a_set().filter(|term| parameters.terms.contains(firmware_term(*term))).collect();
    let mut model = FrictionModel {
        terms: FloatTerms::of(&terms),
        hysteresis_acceleration_slope: value(ACCELERATION_SLOPE),
        reference_temperature: from_q16(domain.reference_temperature),
        ..FrictionModel::default()
    };
    for parameter in FrictionParameter::all() {
        if let Some(i) = parameter.coefficient() {
            *model.parameter_mut(parameter) = value(i);
        }
    }
    model
}

/// Signals that the model depends on, in the order of [`Signal`](friction_compensation::friction::state::Signal).
pub fn depends_on(model: &FrictionModel) -> [bool; SIGNALS] {
    let terms = firmware_terms(model);
    let mut depends = [false; SIGNALS];
    for (i, dimension) in Coefficients::DIMENSIONS.iter().enumerate() {
        if let Some((signal, _)) = dimension.per {
            depends[signal as usize] |= matters(i, terms);
        }
    }
    depends
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_list_terms_and_coefficients_in_the_same_order() {
        for (term, name) in of_a_set().zip(Terms::NAMES) {
            let text = serde_json::to_string(&term).unwrap().replace('-', "_");
            assert_eq!(text.trim_matches('"'), name);
        }
        let mut model = FrictionModel { rotor_inertia: 7.0, offset: 1.0, ..FrictionModel::default() };
        model.terms = of_a_set().fold(model.terms, |set, term| set.with(term));
        (model.stribeck_slope, model.harmonic_negative[4]) = (14.0, 29.0);
        let values = natural(&model, firmware_terms(&model));
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
