//! The `full` model: the terms that the data can support, chosen on validation samples; host.
//!
//! Stepwise: from the full set, the term whose loss leaves the lowest validation error is dropped as long as that error stays
//! within a tolerance of the lowest one seen; then the missing term that lowers it most is taken back; and so on until
//! neither helps. Taking terms back matters: a term whose coefficient has reached 0 has lost the gradient of its shapes, and
//! only a new grid finds them. The result is then measured against every other preset that comes close, on all validation
//! samples, and the best one wins. Test samples are not seen.

use super::grid::{search, search_from};
use super::linear::{add_to_normal_sums, normal_equations, normal_sums, sum_over_rows};
use super::nonlinear::{Fit, Problem};
use super::observations::{Row, decimated};
use crate::friction_model::{Term, Terms};
use crate::presets::{Preset, Structure};
use crate::rigid::RigidModel;
use rayon::prelude::*;
use std::fmt;

/// Temperature terms are considered when the train samples cover at least this many kelvin.
pub const TEMPERATURE_RANGE: f64 = 5.0;
/// The position slope stands for itself when the rigid part leaves at least this fraction of the position's variance unexplained; with
/// less its standard error is more than ten times that of a slope alone. Over some 75 degrees either way gravity's sine is a straight line but
/// for a hundredth: noise then decides how much of gravity counts as friction, which whoever commands the joint has added already.
const OWN_POSITION: f64 = 0.01;
/// A position slope that does not stand for itself must be worth this fraction of the validation error.
const CONFOUNDED_WORTH: f64 = 0.05;
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

/// The fraction of the position's variance over the train rows that the rigid part's regressors leave unexplained.
fn position_beside_rigid(problem: &Problem) -> f64 {
    let regressors = &problem.regressors;
    let n = regressors.len() + 1;
    let sums = sum_over_rows(&problem.train, normal_sums(n), |sums, row| {
        let mut columns: Vec<f64> = regressors.iter().map(|&regressor| row.regressors[regressor as usize]).collect();
        columns.push(1.0);
        add_to_normal_sums(sums, &columns, row.joint.position);
    });
    let equations = normal_equations(&sums, n, problem.train.len());
    let mean = equations.gradient[n - 1];
    let variance = equations.cost - mean * mean;
    let explained =
        equations.hessian.cholesky().map(|factor| factor.solve(&equations.gradient).dot(&equations.gradient));
    // Regressors that depend on each other explain less together than they are taken for; then nothing is known.
    explained.map_or(1.0, |explained| (equations.cost - explained) / variance.max(f64::MIN_POSITIVE))
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
    let own = position_beside_rigid(problem);
    let chosen = if own >= OWN_POSITION {
        step_by_step(problem, search(problem, &structure), &structure, &rows, &mut notes)
    } else {
        position_last(problem, &structure, own, &rows, &mut notes)
    };
    let limit = CONTENDER * error(&chosen, &rows);
    let chosen = chosen.polished(problem);
    let mut best = (error(&chosen, &problem.validation), chosen);
    let may_have_position = best.1.candidate.structure.terms.contains(Term::Position) || own >= OWN_POSITION;
    let considered = |preset: &Structure| may_have_position || !preset.terms.contains(Term::Position);
    for preset in Preset::ALL {
        let Some(structure) = preset.structure(rigid).filter(considered) else { continue };
        let fit = search(problem, &structure);
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

/// Chooses among the other terms first, and takes a position slope that the rigid part explains only for what it adds to them.
fn position_last(problem: &Problem, full: &Structure, own: f64, rows: &[Row], notes: &mut Vec<String>) -> Fit {
    let slope = Freedom::Term(Term::Position);
    let others = changed(full, slope, false);
    let without = step_by_step(problem, search(problem, &others), &others, rows, notes);
    let with =
        search_from(problem, &changed(&without.candidate.structure, slope, true), &without, Some(Term::Position));
    let (before, after) = (error(&without, rows), error(&with, rows));
    let explained = 100.0 * (1.0 - own);
    if after <= (1.0 - CONFOUNDED_WORTH) * before {
        notes.push(format!(
            "{slope} added, although the rigid part explains {explained:.1} % of the position over these motions: validation error \
             {before:.4e} -> {after:.4e}"
        ));
        return step_by_step(problem, with, full, rows, notes);
    }
    notes.push(format!(
        "{slope} left out: the rigid part explains {explained:.1} % of the position over these motions, and it is not worth \
         {:.0} % of the validation error ({before:.4e} -> {after:.4e})",
        100.0 * CONFOUNDED_WORTH
    ));
    without
}

/// Drops terms and takes terms of `full` back until neither is worth it.
fn step_by_step(problem: &Problem, start: Fit, full: &Structure, rows: &[Row], notes: &mut Vec<String>) -> Fit {
    let all = freedoms(full);
    let (mut current, mut fit) = (error(&start, rows), start);
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
