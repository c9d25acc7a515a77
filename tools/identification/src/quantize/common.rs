//! The terms that all parameter sets of an image have in common, as the image holds them.

use super::QuantizeError;
use super::full_scale::{from_q16, to_q16};
use crate::friction_model::{FrictionModel, Ripple, Term};
use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::maxwell_slip::{MAX_STIFFNESS, MaxwellElement};
use friction_compensation::friction::ripple::Ripple as StoredRipple;
use std::f64::consts::TAU;

/// Quantises the pre-sliding elements and ripples of `model`; those of terms that are off are absent.
pub fn quantize(model: &FrictionModel) -> Result<CommonTerms, QuantizeError> {
    let mut common = CommonTerms::NONE;
    if model.terms.contains(Term::PreSliding) {
        let elements = model.element_stiffness.iter().zip(model.element_level);
        for (place, (stiffness, level)) in common.elements.iter_mut().zip(elements.filter(|(_, level)| *level > 0.0)) {
            *place = MaxwellElement {
                stiffness: to_q16("stiffness of pre-sliding", *stiffness)?.min(MAX_STIFFNESS),
                level: to_q16("level of pre-sliding", level)?,
            };
        }
    }
    let ripples = model.ripples.iter().zip([Term::Ripple, Term::SecondRipple]);
    for (place, (ripple, term)) in common.ripples.iter_mut().zip(ripples) {
        if model.terms.contains(term) {
            *place = StoredRipple {
                periods: to_q16("periods of a ripple", ripple.frequency / TAU)?,
                level_sine: to_q16("sine of a ripple's level", ripple.level_sine)?,
                level_cosine: to_q16("cosine of a ripple's level", ripple.level_cosine)?,
                torque_sine: to_q16("sine of a ripple's torque", ripple.torque_sine)?,
                torque_cosine: to_q16("cosine of a ripple's torque", ripple.torque_cosine)?,
            };
        }
    }
    Ok(common)
}

/// Gives `model` what stored terms stand for.
pub fn dequantize(common: &CommonTerms, model: &mut FrictionModel) {
    let elements = model.element_stiffness.iter_mut().zip(&mut model.element_level).zip(common.elements);
    for ((stiffness, level), element) in elements {
        (*stiffness, *level) = (from_q16(element.stiffness), from_q16(element.level));
        if element != MaxwellElement::default() {
            model.terms = model.terms.with(Term::PreSliding);
        }
    }
    for ((place, term), ripple) in model.ripples.iter_mut().zip([Term::Ripple, Term::SecondRipple]).zip(common.ripples)
    {
        if ripple != StoredRipple::default() {
            *place = Ripple {
                frequency: from_q16(ripple.periods) * TAU,
                level_sine: from_q16(ripple.level_sine),
                level_cosine: from_q16(ripple.level_cosine),
                torque_sine: from_q16(ripple.torque_sine),
                torque_cosine: from_q16(ripple.torque_cosine),
            };
            model.terms = model.terms.with(term);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction_model::Terms;

    #[test]
    fn what_is_stored_is_what_was_identified_and_absent_terms_are_absent() {
        let ripple = Ripple {
            frequency: 4.0 * TAU,
            level_sine: 0.5,
            level_cosine: -0.25,
            torque_sine: 0.125,
            torque_cosine: -1.0,
        };
        let mut model = FrictionModel {
            element_stiffness: [1000.0, 250.0, 10.0, 0.0],
            element_level: [0.5, 0.25, 2.0, 0.0],
            ripples: [Ripple::default(), ripple],
            ..FrictionModel::default()
        };
        assert_eq!(quantize(&model), Ok(CommonTerms::NONE));
        model.terms = Terms::of(&[Term::PreSliding, Term::SecondRipple]);
        let mut found = FrictionModel::default();
        dequantize(&quantize(&model).unwrap(), &mut found);
        assert_eq!(found, model);
    }

    #[test]
    fn an_element_stiffer_than_an_image_can_hold_is_held_at_the_stiffest() {
        let stored = |stiffness: f64| {
            let model = FrictionModel {
                terms: Terms::of(&[Term::PreSliding]),
                element_stiffness: [stiffness, 0.0, 0.0, 0.0],
                element_level: [1.0, 0.0, 0.0, 0.0],
                ..FrictionModel::default()
            };
            quantize(&model).unwrap().elements[0].stiffness
        };
        assert_eq!(
            [stored(16_383.0), stored(16_384.0), stored(16_385.0)],
            [16_383 << 16, MAX_STIFFNESS, MAX_STIFFNESS]
        );
    }
}
