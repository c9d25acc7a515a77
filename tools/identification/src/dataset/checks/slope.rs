//! The Coulomb step of an identified model: whether anything was recorded where it turns; host.

use crate::dataset::warning::Warning;
use crate::friction_model::{FrictionModel, Term};
use crate::samples::{Part, Samples};

/// Training rows that must lie on the step, where tanh(v / v_c) is below 0.964.
const LEAST_ROWS: usize = 20;

/// A warning where fewer than 20 training rows are slower than twice the Coulomb velocity: the step's slope is then a
/// guess.
pub fn check(friction: &FrictionModel, samples: &Samples) -> Option<Warning> {
    if !friction.terms.contains(Term::Coulomb) || friction.coulomb_slope <= 0.0 {
        return None;
    }
    let width = 2.0 / friction.coulomb_slope;
    let rows = samples.indices(Part::Train);
    let slow = rows.iter().filter(|&&i| samples.velocity[i].abs() < width).count();
    (slow < LEAST_ROWS).then(|| Warning {
        check: "slope",
        column: "Coulomb slope of the model".to_owned(),
        rows: format!("{slow} of {} training rows", rows.len()),
        finding: format!(
            "the step of {:.1} s per unit turns below {width:.2e} of speed, where at least {LEAST_ROWS} rows are needed",
            friction.coulomb_slope
        ),
        remedy: "record slow reversals, or lower select.minimum_speed".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction_model::Terms;

    #[test]
    fn a_step_that_nothing_was_recorded_on_is_told_and_one_with_twenty_rows_is_not() {
        let friction = |coulomb_slope| FrictionModel {
            terms: Terms::of(&[Term::Coulomb]),
            coulomb_slope,
            ..FrictionModel::default()
        };
        let samples = |slow: usize| Samples {
            time: vec![0.0; 1000],
            velocity: (0..1000).map(|i| if i < slow { 0.01 } else { 0.5 }).collect(),
            part: vec![Part::Train; 1000],
            ..Samples::default()
        };
        assert!(check(&friction(100.0), &samples(20)).is_none());
        let text = check(&friction(100.0), &samples(19)).unwrap().to_string();
        assert!(text.contains("19 of 1000 training rows") && text.contains("100.0 s"), "{text}");
        assert!(check(&friction(4900.0), &samples(500)).is_some());
        assert!(check(&FrictionModel::default(), &samples(0)).is_none());
    }
}
