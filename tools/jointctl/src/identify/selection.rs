//! The `full` model: the terms that the data can support, chosen on validation samples; host.
//!
//! Stepwise: from the full set, the term whose loss leaves the lowest validation error is dropped as long as that error stays
//! within a tolerance of the lowest one seen; then the missing term that lowers it most is taken back; and so on until
//! neither helps. Taking terms back matters: a term whose coefficient has reached 0 has lost the gradient of its shapes, and
//! only a new grid finds them. The result is then measured against every other preset that comes close, on all validation
//! samples, and the best one wins. Test samples are not seen.

use super::grid::{search, search_from};
use super::nonlinear::{Fit, Problem};
use super::observations::{Row, decimated};
use crate::friction_model::{Term, Terms};
use crate::presets::{Preset, Structure};
use crate::rigid::RigidModel;
use rayon::prelude::*;
use std::fmt;

/// Temperature terms are considered when the train samples cover at least this many kelvin.
pub const TEMPERATURE_RANGE: f64 = 5.0;
/// A term stays when it is worth at least this fraction of the validation error.
const WORTH: f64 = 1e-3;
/// Limit on steps: each fits about a dozen models.
const STEPS: usize = 40;
/// Validation rows that decide on a step.
const VALIDATION_ROWS: usize = 10_000;
/// A preset is fitted over all rows when its error over the search rows comes this close to that of the chosen terms.
const CONTENDER: f64 = 1.02;

/// What a structure can lose or gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Freedom {
    Term(Term),
    AsymmetricCoulomb,
    AsymmetricBreakaway,
}

impl fmt::Display for Freedom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Term(term) => write!(f, "{term:?}"),
            Self::AsymmetricCoulomb => f.write_str("asymmetry of the Coulomb friction"),
            Self::AsymmetricBreakaway => f.write_str("asymmetry of the breakaway friction"),
        }
    }
}

/// A structure on the way, its fit over the search rows and its validation error.
struct Step {
    changed: Freedom,
    error: f64,
    fit: Fit,
}

/// The terms that the data can support, and why others are left out.
fn supported(problem: &Problem, rigid: &RigidModel) -> (Structure, Vec<String>) {
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

/// What the structure can lose; viscous and Coulomb friction stay.
fn freedoms(structure: &Structure) -> Vec<Freedom> {
    let terms = structure.terms.iter().filter(|term| !matches!(term, Term::Viscous | Term::Coulomb));
    let sides = [
        (Freedom::AsymmetricCoulomb, structure.asymmetric_coulomb),
        (Freedom::AsymmetricBreakaway, structure.asymmetric_breakaway),
    ];
    terms.map(Freedom::Term).chain(sides.into_iter().filter(|side| side.1).map(|side| side.0)).collect()
}

/// The structure with one freedom more or less.
fn changed(structure: &Structure, freedom: Freedom, on: bool) -> Structure {
    let mut changed = *structure;
    match freedom {
        Freedom::Term(term) if on => changed.terms = changed.terms.with(term),
        Freedom::Term(term) => changed.terms = changed.terms.without(term),
        Freedom::AsymmetricCoulomb => changed.asymmetric_coulomb = on,
        Freedom::AsymmetricBreakaway => changed.asymmetric_breakaway = on,
    }
    changed.asymmetric_breakaway &= changed.terms.contains(Term::Stribeck);
    changed
}

/// The fit over all train rows of the structure with the lowest validation error, and how it was chosen.
pub fn select(problem: &Problem, rigid: &RigidModel) -> (Fit, Vec<String>) {
    let (structure, mut notes) = supported(problem, rigid);
    let rows = decimated(&problem.validation, VALIDATION_ROWS);
    let chosen = step_by_step(problem, search(problem, &structure), &rows, &mut notes);
    let limit = CONTENDER * error(&chosen, &rows);
    let chosen = chosen.polished(problem);
    let mut best = (error(&chosen, &problem.validation), chosen);
    for preset in Preset::ALL {
        let Some(fit) = preset.structure(rigid).map(|structure| search(problem, &structure)) else { continue };
        if error(&fit, &rows) > limit {
            continue;
        }
        let fit = fit.polished(problem);
        let error = error(&fit, &problem.validation);
        if error < best.0 {
            notes.push(format!("{preset} replaces the chosen terms: validation error {:.4e} -> {error:.4e}", best.0));
            best = (error, fit);
        }
    }
    (best.1, notes)
}

fn error(fit: &Fit, rows: &[Row]) -> f64 {
    fit.rmse(rows).unwrap_or(f64::INFINITY)
}

/// Drops terms and takes terms back until neither is worth it.
fn step_by_step(problem: &Problem, full: Fit, rows: &[Row], notes: &mut Vec<String>) -> Fit {
    let all = freedoms(&full.candidate.structure);
    let (mut current, mut fit) = (error(&full, rows), full);
    let mut lowest = current;
    let (mut adding, mut exhausted) = (false, 0);
    for _ in 0..STEPS {
        let structure = fit.candidate.structure;
        let present = freedoms(&structure);
        let freedoms = all.iter().copied().filter(|freedom| present.contains(freedom) != adding).collect();
        let limit = if adding { current * (1.0 - WORTH) } else { lowest * (1.0 + WORTH) };
        match best_step(problem, &fit, freedoms, adding, rows) {
            Some(step) if step.error <= limit => {
                let verb = if adding { "taken back" } else { "dropped" };
                notes.push(format!("{} {verb}: validation error {current:.4e} -> {:.4e}", step.changed, step.error));
                (current, fit) = (step.error, step.fit);
                lowest = lowest.min(current);
                exhausted = 0;
            }
            _ => {
                exhausted += 1;
                adding = !adding;
            }
        }
        if exhausted == 2 {
            break;
        }
    }
    fit
}

/// The change of one freedom that leaves the lowest error.
fn best_step(problem: &Problem, from: &Fit, freedoms: Vec<Freedom>, adding: bool, rows: &[Row]) -> Option<Step> {
    let steps: Vec<Step> = freedoms
        .into_par_iter()
        .map(|freedom| {
            let structure = changed(&from.candidate.structure, freedom, adding);
            let new = match freedom {
                Freedom::Term(term) if adding => Some(term),
                _ => None,
            };
            let fit = search_from(problem, &structure, from, new);
            Step { changed: freedom, error: error(&fit, rows), fit }
        })
        .collect();
    steps.into_iter().reduce(|best, step| if step.error < best.error { step } else { best })
}
