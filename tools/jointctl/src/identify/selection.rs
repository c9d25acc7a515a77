//! The `full` model: every term that the data can support, reduced as long as validation samples do not mind; host.
//!
//! Backward elimination: from the full set, the term whose loss leaves the lowest validation error is dropped, again and
//! again, while that error does not rise. The result is then measured against every other preset on the same samples, and the
//! best one wins: `full` never loses against its sub-models on validation. Test samples are not seen.

use super::grid::{search, search_from};
use super::nonlinear::{Fit, Problem};
use super::observations::{Row, decimated};
use crate::friction_model::{Term, Terms};
use crate::presets::{Preset, Structure};
use crate::rigid::RigidModel;
use rayon::prelude::*;

/// Temperature terms are considered when the train samples cover at least this many kelvin.
pub const TEMPERATURE_RANGE: f64 = 5.0;
/// Validation rows that decide on a term.
const VALIDATION_ROWS: usize = 10_000;

/// What can be dropped from a structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Freedom {
    Term(Term),
    AsymmetricCoulomb,
    AsymmetricBreakaway,
}

/// The terms that the data can support, and why others are left out.
pub fn supported(problem: &Problem, rigid: &RigidModel) -> (Structure, Vec<String>) {
    use Term::*;
    let mut terms = Terms::of(&[Constant, Position, Viscous, Quadratic, Coulomb, CoulombLoad, Stribeck, Hysteresis]);
    let mut notes = Vec::new();
    if !rigid.inertia {
        terms = terms.with(RotorInertia);
    }
    if problem.limits.position_covered {
        terms = terms.with(Harmonics);
    } else {
        notes.push("position harmonics are not considered: motion does not cover the position range both ways".into());
    }
    if problem.limits.temperature_range >= TEMPERATURE_RANGE {
        terms = terms.with(Temperature).with(ViscousTemperature).with(CoulombTemperature);
    } else {
        notes.push(format!(
            "temperature terms are not considered: the train samples cover {:.1} K, {TEMPERATURE_RANGE} K are needed",
            problem.limits.temperature_range
        ));
    }
    let structure = Structure { terms, asymmetric_coulomb: true, asymmetric_breakaway: true, coupled_slopes: false };
    (structure, notes)
}

fn freedoms(structure: &Structure) -> Vec<Freedom> {
    let terms = structure.terms.iter().filter(|term| !matches!(term, Term::Viscous | Term::Coulomb));
    let sides = [
        (Freedom::AsymmetricCoulomb, structure.asymmetric_coulomb),
        (Freedom::AsymmetricBreakaway, structure.asymmetric_breakaway),
    ];
    terms.map(Freedom::Term).chain(sides.into_iter().filter(|side| side.1).map(|side| side.0)).collect()
}

fn without(structure: &Structure, freedom: Freedom) -> Structure {
    let mut reduced = *structure;
    match freedom {
        Freedom::Term(term) => reduced.terms = reduced.terms.without(term),
        Freedom::AsymmetricCoulomb => reduced.asymmetric_coulomb = false,
        Freedom::AsymmetricBreakaway => reduced.asymmetric_breakaway = false,
    }
    reduced.asymmetric_breakaway &= reduced.terms.contains(Term::Stribeck);
    reduced
}

/// The structure with the lowest validation error, fitted over all train rows.
pub fn select(problem: &Problem, rigid: &RigidModel) -> (Fit, Vec<String>) {
    let (structure, mut notes) = supported(problem, rigid);
    let rows = decimated(&problem.validation, VALIDATION_ROWS);
    let reduced = reduce(problem, search(problem, &structure), &rows, &mut notes).polished(problem);
    let mut best = (error(&reduced, &problem.validation), reduced);
    for preset in Preset::ALL {
        let Some(structure) = preset.structure(rigid) else { continue };
        let fit = search(problem, &structure).polished(problem);
        let error = error(&fit, &problem.validation);
        if error < best.0 {
            notes.push(format!("{preset} has a lower validation error than the reduced full set and replaces it"));
            best = (error, fit);
        }
    }
    (best.1, notes)
}

fn error(fit: &Fit, rows: &[Row]) -> f64 {
    fit.rmse(rows).unwrap_or(f64::INFINITY)
}

/// Drops terms as long as the error over the rows does not rise.
fn reduce(problem: &Problem, full: Fit, rows: &[Row], notes: &mut Vec<String>) -> Fit {
    let mut current = (error(&full, rows), full);
    loop {
        let structure = current.1.candidate.structure;
        let reduced: Vec<(Freedom, f64, Fit)> = freedoms(&structure)
            .into_par_iter()
            .map(|freedom| {
                let fit = search_from(problem, &without(&structure, freedom), &current.1);
                (freedom, error(&fit, rows), fit)
            })
            .collect();
        let best = reduced.into_iter().reduce(|best, other| if other.1 < best.1 { other } else { best });
        match best {
            Some((freedom, error, fit)) if error <= current.0 => {
                notes.push(format!("dropped {freedom:?}: validation error {:.6} -> {error:.6}", current.0));
                current = (error, fit);
            }
            _ => return current.1,
        }
    }
}
