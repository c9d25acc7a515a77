//! Tests of the fit: its derivatives, and the columns it drops.

use super::super::synthetic::{RIGID, drive, friction, motion, problem, rigid};
use super::*;
use crate::friction_model::{Term, Terms};

fn some_problem() -> Problem {
    let truth = friction(Terms::of(&Term::ALL));
    let mut samples = motion(1_000);
    drive(&mut samples, &rigid(), &truth, 0.1, 2);
    problem(&samples, &RIGID, rigid(), &truth)
}

fn structures() -> [Structure; 3] {
    let all = Terms::of(&Term::ALL).without(Term::RotorInertia);
    let free = Structure { terms: all.without(Term::Load), asymmetric_coulomb: true, ..Structure::default() };
    [
        Structure { asymmetric_breakaway: true, ..free },
        Structure { coupled_slopes: true, ..free },
        Structure { terms: all, ..Structure::default() },
    ]
}

#[test]
fn the_gradient_agrees_with_a_central_difference_of_the_cost() {
    let problem = some_problem();
    for structure in structures() {
        let candidate = Candidate::new(&problem, &structure);
        let residuals = Residuals { rows: &problem.train, candidate: &candidate };
        let x = candidate.layout.encode(&rigid(), &friction(structure.terms)) * 1.05;
        let at = residuals.normal_equations(&x);
        assert!((at.cost - residuals.cost(&x)).abs() < 1e-12 * at.cost);
        for i in 0..x.len() {
            let step = 1e-5 * x[i].abs().max(0.01);
            let moved = |sign: f64| {
                let mut other = x.clone();
                other[i] += sign * step;
                residuals.cost(&other)
            };
            let difference = (moved(1.0) - moved(-1.0)) / (4.0 * step);
            let name = &candidate.layout.columns[i].name;
            let scale = (at.hessian[(i, i)] * at.cost).sqrt();
            assert!((difference - at.gradient[i]).abs() < 1e-6 * scale, "{name}: {difference} {}", at.gradient[i]);
        }
    }
}

#[test]
fn the_matrix_of_one_row_is_the_outer_product_of_its_gradient() {
    let problem = some_problem();
    let candidate = Candidate::new(&problem, &structures()[0]);
    let x = candidate.layout.encode(&rigid(), &friction(candidate.structure.terms)) * 0.9;
    let at = Residuals { rows: &problem.train[10..11], candidate: &candidate }.normal_equations(&x);
    let outer = &at.gradient * at.gradient.transpose() / at.cost;
    assert!((outer - &at.hessian).norm() < 1e-9 * at.hessian.norm());
}

#[test]
fn terms_that_multiply_the_same_quantity_are_kept_once_and_the_other_is_named() {
    let problem = some_problem();
    let terms = Terms::of(&[Term::Viscous, Term::Coulomb, Term::RotorInertia]);
    let candidate = Candidate::new(&problem, &Structure { terms, ..Structure::default() });
    assert_eq!(candidate.notes, ["rotor inertia: cannot be told from inertia; set to 0"]);
    assert!(candidate.layout.columns.iter().all(|column| column.name != "rotor inertia"));
}
