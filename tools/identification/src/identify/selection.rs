//! The `full` model: the terms that pay on motions that were left out; host.
//!
//! 1. From Coulomb and viscous friction with an offset, the term that lowers the error of the left-out motions most is
//!    taken, then those are dropped without which it does not rise, and so on until neither helps. Where several runs
//!    or conditions are left out in turn, the same is done from the terms that help second and third most alone, as the
//!    first may stand in the way of two others; parts of one run do not tell so many models apart. And from a preset
//!    that is better.
//! 2. Of all models on these ways the simplest one is chosen that the best does not beat beyond one standard error.
//!
//! A term that the others nearly explain is not considered (`determined`). Test samples are not seen.

use super::crossed::{FoldFit, crossed, errors, overall};
use super::determined::stands_for_itself;
use super::freedom::Freedom;
use super::grid::{search, search_from};
use super::nonlinear::{Fit, Problem};
use crate::choice::{Comparison, TermRule, compare, rank};
use crate::friction_model::{FrictionModel, Term, Terms};
use crate::friction_parameter::Considered;
use crate::presets::{Preset, Structure};
use crate::rigid::RigidModel;
use rayon::prelude::*;

/// Temperature terms are considered when the train samples cover at least this many kelvin.
pub const TEMPERATURE_RANGE: f64 = 5.0;
/// A term is taken as long as it lowers the mean error by this fraction.
const STEP: f64 = 5e-4;
/// Limit on terms that are taken: each step fits about a dozen models.
const STEPS: usize = 12;
/// Ways, each from another first term, where several runs or conditions are left out in turn.
const WAYS: usize = 3;
/// Terms of every model, unless they are forbidden: the simplest model.
const ALWAYS: [Term; 3] = [Term::Constant, Term::Viscous, Term::Coulomb];

/// The terms that the data can support, and why others are left out.
fn supported(problem: &Problem, rigid: &RigidModel) -> (Structure, Vec<String>) {
    let limits = &problem.limits;
    let warm = limits.temperature_range >= TEMPERATURE_RANGE;
    let found = |term: &Term| match term.facts().considered {
        Considered::Always => true,
        Considered::Never => false,
        Considered::WithoutRigidInertia => !rigid.has_inertia(),
        Considered::PositionsCovered => limits.position_covered,
        Considered::TemperaturesCovered => warm,
        Considered::ElementsChosen => limits.elements > 0,
        Considered::RipplesChosen(number) => limits.ripples >= number,
        Considered::BothLead => limits.both_lead,
    };
    let terms = Term::ALL.into_iter().filter(found).fold(Terms::default(), Terms::with);
    let mut notes = Vec::new();
    if !limits.position_covered {
        notes.push("position harmonics are not considered: motion does not cover the position range both ways".into());
    }
    if !warm {
        notes.push(format!(
            "temperature terms are not considered: the train samples cover {:.1} K, {TEMPERATURE_RANGE} K are needed",
            limits.temperature_range
        ));
    }
    let structure = Structure { terms, asymmetric_coulomb: true, asymmetric_breakaway: true, ..Structure::default() };
    (structure, notes)
}

/// A structure with its fit over the search rows and its fits without each fold.
#[derive(Clone)]
struct Crossed {
    fit: Fit,
    folds: Vec<FoldFit>,
    errors: Vec<f64>,
}

impl Crossed {
    fn new(problem: &Problem, fit: Fit) -> Self {
        let folds = crossed(problem, &fit);
        let errors = errors(&folds);
        Self { fit, folds, errors }
    }

    fn structure(&self) -> Structure {
        self.fit.candidate.structure
    }

    fn overall(&self) -> f64 {
        overall(&self.errors).unwrap_or(f64::INFINITY)
    }

    /// Change of the error from `self` to `other`.
    fn to(&self, other: &Self) -> Comparison {
        compare(&self.errors, &other.errors)
    }

    /// True where `other` lowers the mean error by `worth`, and neither the error of all folds together rises nor that
    /// of one grouping: a gain on slow motions is not paid for with the fast ones, nor one in time with one in
    /// speed.
    fn improves(&self, other: &Self, worth: f64) -> bool {
        let grouping: Vec<usize> = self.folds.iter().map(|fold| fold.grouping).collect();
        improves(&self.errors, &other.errors, &grouping, worth)
    }
}

/// See [`Crossed::improves`]; errors before and after, and the grouping of each fold.
fn improves(before: &[f64], after: &[f64], grouping: &[usize], worth: f64) -> bool {
    let mean = |number: usize| {
        let of = |errors: &[f64]| -> Vec<f64> {
            errors.iter().zip(grouping).filter(|(_, grouping)| **grouping == number).map(|(error, _)| *error).collect()
        };
        compare(&of(before), &of(after)).mean
    };
    let groupings = grouping.iter().max().map_or(0, |last| last + 1);
    compare(before, after).mean <= (1.0 - worth).ln()
        && overall(after) <= overall(before)
        && (0..groupings).all(|number| mean(number) <= 0.0)
}

/// Terms that a person decides about.
struct Rules<'a>(&'a [TermRule]);

impl Rules<'_> {
    fn forced(&self, term: Term) -> bool {
        self.0.iter().any(|rule| rule.term == term && rule.force)
    }

    fn forbids(&self, structure: &Structure) -> bool {
        self.0.iter().any(|rule| !rule.force && structure.terms.contains(rule.term))
    }

    fn lacks(&self, structure: &Structure) -> bool {
        self.0.iter().any(|rule| rule.force && !structure.terms.contains(rule.term))
    }
}

/// Freedoms that the structure can lose; the terms of every model stay, and what is forced.
fn freedoms(structure: &Structure, rules: &Rules) -> Vec<Freedom> {
    let terms = structure.terms.iter().filter(|&term| !ALWAYS.contains(&term) && !rules.forced(term));
    let sides = [
        (Freedom::AsymmetricCoulomb, structure.asymmetric_coulomb),
        (Freedom::AsymmetricBreakaway, structure.asymmetric_breakaway),
    ];
    terms.map(Freedom::Term).chain(sides.into_iter().filter(|side| side.1).map(|side| side.0)).collect()
}

/// The structure with one freedom more or less; nothing where it needs a term that is not there.
fn changed(structure: &Structure, freedom: Freedom, on: bool) -> Option<Structure> {
    let mut changed = *structure;
    match freedom {
        Freedom::Term(term) if on => changed.terms = changed.terms.with(term),
        Freedom::Term(term) => changed.terms = changed.terms.without(term),
        Freedom::AsymmetricCoulomb => changed.asymmetric_coulomb = on,
        Freedom::AsymmetricBreakaway => changed.asymmetric_breakaway = on,
    }
    let has = |term| changed.terms.contains(term);
    let breaks_away = has(Term::Stribeck) || has(Term::VelocityWeakening);
    let possible = match freedom {
        Freedom::AsymmetricBreakaway => breaks_away,
        Freedom::AsymmetricCoulomb => has(Term::Coulomb),
        Freedom::Term(term) => term.facts().beside.is_none_or(has),
    };
    changed.asymmetric_breakaway &= breaks_away;
    changed.coupled_slopes &= has(Term::Stribeck);
    (possible || !on).then_some(changed)
}

/// The chosen structure fitted to all rows, its fits without each fold, and how it was chosen.
/// `several`: the folds leave out whole runs or conditions.
pub fn select(
    problem: &Problem,
    rigid: &RigidModel,
    rules: &[TermRule],
    several: bool,
) -> (Fit, Vec<FoldFit>, Vec<String>) {
    let rules = Rules(rules);
    let (mut full, notes) = supported(problem, rigid);
    let forbidden = rules.0.iter().filter(|rule| !rule.force);
    full.terms = forbidden.fold(full.terms, |terms, rule| terms.without(rule.term));
    let mut simplest = simplest(&full, &rules);
    if !rules.forced(Term::Constant) {
        (full, simplest) = (problem.determined(full), problem.determined(simplest));
    }
    let start = Crossed::new(problem, search(problem, &simplest));
    let mut ways = Ways { problem, full, rules, path: vec![start.clone()], notes };
    let mut first = ways.additions(&start);
    first.sort_by(|(_, one), (_, other)| start.to(one).mean.total_cmp(&start.to(other).mean));
    for (taken, model) in first.into_iter().take(if several { WAYS } else { 1 }) {
        ways.note(&format!("{taken} taken first"), &start, &model);
        ways.walk(model);
    }
    if let Some((preset, better)) = ways.best_preset(rigid) {
        let before = ways.best().clone();
        ways.note(&format!("all terms of {preset} taken"), &before, &better);
        ways.walk(better);
    }
    let Ways { mut path, mut notes, .. } = ways;
    let errors: Vec<Vec<f64>> = path.iter().map(|model| model.errors.clone()).collect();
    let sizes: Vec<usize> = path.iter().map(|model| model.fit.x.len()).collect();
    let order = rank(&errors, &sizes);
    if let [chosen, best, ..] = order[..] {
        let change = path[chosen].to(&path[best]);
        if change.mean < 0.0 {
            notes.push(format!(
                "{} numbers instead of {} are chosen: with the latter the error changes by {:+.1} ± {:.1} %",
                sizes[chosen],
                sizes[best],
                change.percent(),
                100.0 * change.standard_error
            ));
        }
    }
    let Crossed { fit, folds, .. } = path.swap_remove(order[0]);
    (fit.polished(problem), folds, notes)
}

/// Viscous and Coulomb friction with an offset, and what is forced.
fn simplest(full: &Structure, rules: &Rules) -> Structure {
    let base = ALWAYS.into_iter().chain(full.terms.contains(Term::RotorInertia).then_some(Term::RotorInertia));
    let wanted = Term::ALL.into_iter().filter(|&term| rules.forced(term));
    let terms: Vec<Term> =
        base.chain(wanted).filter(|&term| !rules.0.iter().any(|r| !r.force && r.term == term)).collect();
    Structure { terms: Terms::of(&terms), ..Structure::default() }
}

/// The models that were come across, the simplest first, and what they may have.
struct Ways<'a> {
    problem: &'a Problem,
    full: Structure,
    rules: Rules<'a>,
    path: Vec<Crossed>,
    notes: Vec<String>,
}

impl Ways<'_> {
    /// The model with the lowest error on left-out motions so far.
    fn best(&self) -> &Crossed {
        let better = |best, model| if Crossed::to(best, model).mean < 0.0 { model } else { best };
        self.path.iter().reduce(better).unwrap_or(&self.path[0])
    }

    fn note(&mut self, what: &str, before: &Crossed, after: &Crossed) {
        let (before, after) = (before.overall(), after.overall());
        self.notes.push(format!("{what}: error on left-out motions {before:.4e} -> {after:.4e}"));
    }

    /// True where the model's viscous friction is one beyond the fastest motion, too: see [`bears_speed`]. What is
    /// forced is not asked.
    fn bears_speed(&self, model: &Crossed) -> bool {
        self.rules.forced(Term::Quadratic) || bears_speed(&model.fit.friction, self.problem.limits.velocity)
    }

    /// Takes and drops terms, one at a time, as long as one of both helps, or to a model of another way.
    fn walk(&mut self, from: Crossed) {
        let mut before = from.clone();
        self.path.push(from);
        for _ in 0..STEPS {
            let Some((taken, mut current)) = lowest(self.additions(&before)) else { break };
            self.note(&format!("{taken} taken"), &before, &current);
            while let Some((dropped, fewer)) = self.best_removal(&current, taken) {
                self.note(&format!("{dropped} dropped"), &current, &fewer);
                current = fewer;
            }
            if self.path.iter().any(|model| model.structure() == current.structure()) {
                break;
            }
            self.path.push(current.clone());
            before = current;
        }
    }

    /// The freedoms that lower the error of the left-out motions.
    fn additions(&self, from: &Crossed) -> Vec<(Freedom, Crossed)> {
        let has = freedoms(&from.structure(), &self.rules);
        let missing: Vec<Freedom> =
            freedoms(&self.full, &self.rules).into_iter().filter(|freedom| !has.contains(freedom)).collect();
        let steps = missing.into_par_iter().filter_map(|freedom| {
            let structure = changed(&from.structure(), freedom, true)?;
            let new = match freedom {
                Freedom::Term(term) => Some(term),
                _ => None,
            };
            let fit = search_from(self.problem, &structure, &from.fit, new);
            if !stands_for_itself(&fit, freedom) {
                return None;
            }
            let next = Crossed::new(self.problem, fit);
            (from.improves(&next, STEP) && self.bears_speed(&next)).then_some((freedom, next))
        });
        steps.collect()
    }

    /// The freedom, but for the one just taken, without which the error of the left-out motions is lowest, if it does
    /// not rise.
    fn best_removal(&self, from: &Crossed, taken: Freedom) -> Option<(Freedom, Crossed)> {
        let others: Vec<Freedom> =
            freedoms(&from.structure(), &self.rules).into_iter().filter(|&freedom| freedom != taken).collect();
        let steps = others.into_par_iter().filter_map(|freedom| {
            let structure = changed(&from.structure(), freedom, false)?;
            let fewer = Crossed::new(self.problem, search_from(self.problem, &structure, &from.fit, None));
            (from.improves(&fewer, 0.0) && self.bears_speed(&fewer)).then_some((freedom, fewer))
        });
        lowest(steps.collect())
    }

    /// The best preset, where it is better than the last model. It has no term that the data do not support.
    fn best_preset(&self, rigid: &RigidModel) -> Option<(Preset, Crossed)> {
        let presets = Preset::ALL.into_par_iter().filter_map(|preset| {
            let mut structure = preset.structure(rigid)?;
            for term in ALWAYS.into_iter().filter(|&term| self.full.terms.contains(term)) {
                structure.terms = structure.terms.with(term);
            }
            if !self.full.terms.contains(Term::Constant) {
                structure.terms = structure.terms.without(Term::Constant);
            }
            let supported = structure.terms.iter().all(|term| term == Term::Load || self.full.terms.contains(term));
            if !supported || self.rules.forbids(&structure) || self.rules.lacks(&structure) {
                return None;
            }
            let fit = search(self.problem, &structure);
            let own = freedoms(&structure, &self.rules).into_iter().all(|freedom| stands_for_itself(&fit, freedom));
            let model = Crossed::new(self.problem, fit);
            (own && self.best().improves(&model, STEP)).then_some((preset, model))
        });
        lowest(presets.collect())
    }
}

/// True where a quadratic term bends viscous friction down, as a lubricant that is sheared does, and no further than
/// that it still grows at one and a half times the greatest speed. Bent up it stands for viscous friction that a narrow
/// range of speeds does not tell from it, and is far too much beyond.
fn bears_speed(friction: &FrictionModel, speed: f64) -> bool {
    let (viscous, quadratic) = (friction.viscous, friction.quadratic);
    !friction.terms.contains(Term::Quadratic) || quadratic <= 0.0 && viscous + 2.0 * 1.5 * speed * quadratic >= 0.0
}

/// The model with the lowest error on left-out motions; of equal ones the first.
fn lowest<T>(models: Vec<(T, Crossed)>) -> Option<(T, Crossed)> {
    models.into_iter().reduce(|best, model| if best.1.to(&model.1).mean < 0.0 { model } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_lowers_the_mean_error_by_its_worth() {
        assert!(improves(&[1.0, 1.0], &[0.998, 1.0], &[0, 0], 9e-4));
        assert!(!improves(&[1.0, 1.0], &[0.998, 1.0], &[0, 0], 1.1e-3));
    }

    #[test]
    fn a_step_pays_for_no_gain_with_the_error_of_all_folds_together() {
        // Half of a small error gained, a tenth of a large one lost.
        assert!(!improves(&[0.1, 1.0], &[0.05, 1.1], &[0, 0], 0.0));
        assert!(improves(&[0.1, 1.0], &[0.05, 1.001], &[0, 0], 0.0));
    }

    #[test]
    fn a_step_pays_for_no_gain_in_one_grouping_with_the_other() {
        assert!(!improves(&[1.0, 1.0, 1.0], &[0.5, 0.5, 1.01], &[0, 0, 1], 0.0));
        assert!(improves(&[1.0, 1.0, 1.0], &[0.5, 0.5, 1.0], &[0, 0, 1], 0.0));
    }

    #[test]
    fn viscous_friction_may_bend_down_as_far_as_it_still_grows_beyond_the_fastest_motion() {
        let of = |viscous: f64, quadratic: f64| {
            let terms = Terms::of(&[Term::Viscous, Term::Quadratic]);
            bears_speed(&FrictionModel { terms, viscous, quadratic, ..FrictionModel::default() }, 2.0)
        };
        assert!(of(3.0, 0.0) && of(3.0, -0.499) && !of(3.0, -0.501) && !of(3.0, 1e-6) && !of(0.0, -1e-6));
        let other = FrictionModel { quadratic: 1.0, ..FrictionModel::default() };
        assert!(bears_speed(&other, 2.0), "without the term its coefficient means nothing");
    }

    #[test]
    fn without_coulomb_friction_none_of_its_parts_and_factors_is_tried() {
        use Term::*;
        let without = Structure { terms: Terms::of(&[Constant, Viscous]), ..Structure::default() };
        let impossible = |term: &Term| changed(&without, Freedom::Term(*term), true).is_none();
        assert_eq!(
            Term::ALL.into_iter().filter(impossible).collect::<Vec<_>>(),
            [CoulombTemperature, CoulombLoad, Stribeck, VelocityWeakening, PreSliding, Ripple, SecondRipple, Relief]
        );
    }
}
