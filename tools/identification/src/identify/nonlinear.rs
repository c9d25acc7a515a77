//! Fitting one structure of terms by Levenberg-Marquardt over all its parameters, with an exact Jacobian; host.

use super::fold_rows::FoldRows;
use super::layout::{Layout, PARAMETERS, Parameter};
use super::linear::{OWN_PART, add_to_normal_sums, dependences, normal_equations, normal_sums, sum_over_rows};
use super::observations::{Limits, Row};
use crate::friction_model::{FrictionModel, Term};
use crate::friction_parameter::Role;
use crate::levenberg_marquardt::{Damping, LeastSquares, NormalEquations, Options, minimise};
use crate::presets::Structure;
use crate::rigid::{RigidModel, RigidParameters, RigidRegressor};
use nalgebra::DVector;
use std::ops::ControlFlow;

/// Data that all fits of one identification share.
#[derive(Clone, Debug)]
pub struct Problem {
    /// All rows for training and validation.
    pub train: Vec<Row>,
    /// Rows of every fold; empty until the theoretical torque is known.
    pub folds: Vec<FoldRows>,
    /// The same rows, evenly decimated, for searching.
    pub search: Vec<Row>,
    /// Limits of the train rows.
    pub limits: Limits,
    /// Regressors of the rigid part.
    pub rigid: RigidModel,
    /// Rigid part that the theoretical torque in the rows was computed with.
    pub theoretical: RigidParameters,
    /// The part of a constant over the train rows that the rigid part does not explain.
    pub own_part_of_offset: f64,
    /// Fixed parameters, and the Coulomb slope where a structure does not identify it.
    pub template: FrictionModel,
}

impl Problem {
    /// The structure without an offset where nothing tells it from the rigid part.
    pub fn determined(&self, structure: Structure) -> Structure {
        match self.own_part_of_offset >= OWN_PART {
            true => structure,
            false => Structure { terms: structure.terms.without(Term::Constant), ..structure },
        }
    }
}

/// A structure of terms, laid out for the data at hand.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Terms and what they share.
    pub structure: Structure,
    /// Columns that the data can tell apart.
    pub layout: Layout,
    /// The problem's template with the terms of the structure.
    pub template: FrictionModel,
    /// Notes on the columns that the data cannot tell apart.
    pub notes: Vec<String>,
}

/// Length of a descent.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Limit on accepted steps.
    pub iterations: usize,
    /// Stop when a step lowers the mean square by less than this fraction.
    pub tolerance: f64,
}

/// A fitted structure.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Fitted model.
    pub candidate: Candidate,
    /// Searched numbers.
    pub x: DVector<f64>,
    /// Normal equations at `x` over the rows that were fitted.
    pub at: NormalEquations,
    /// Rigid part; that of the theoretical torque where it is held.
    pub rigid: RigidParameters,
    /// Friction.
    pub friction: FrictionModel,
}

/// The mean squared error of a candidate over some rows.
pub struct Residuals<'a> {
    /// The rows.
    pub rows: &'a [Row],
    /// The candidate.
    pub candidate: &'a Candidate,
}

impl Residuals<'_> {
    fn residual(&self, row: &Row, rigid: &RigidParameters, friction: f64) -> f64 {
        let rigid = if self.candidate.structure.holds_rigid() { row.joint.load } else { rigid_effort(rigid, row) };
        rigid + friction - row.effort
    }
}

impl LeastSquares for Residuals<'_> {
    fn cost(&self, x: &DVector<f64>) -> f64 {
        let (rigid, friction) = self.candidate.layout.decode(x, &self.candidate.template);
        let square = |sums: &mut [f64], row: &Row| {
            sums[0] += self.residual(row, &rigid, friction.friction(&row.joint)).powi(2);
        };
        sum_over_rows(self.rows, 1, square)[0] / self.rows.len().max(1) as f64
    }

    fn normal_equations(&self, x: &DVector<f64>) -> NormalEquations {
        let layout = &self.candidate.layout;
        let (rigid, friction) = layout.decode(x, &self.candidate.template);
        let links: Vec<(usize, usize, f64)> = layout
            .links
            .iter()
            .map(|l| (l.parameter.index(), l.column, l.factor * layout.physical_derivative(l.column, x[l.column])))
            .collect();
        let sums = sum_over_rows(self.rows, normal_sums(layout.len()), |sums, row| {
            let mut by_parameter = [0.0; PARAMETERS];
            by_parameter[..row.regressors.len()].copy_from_slice(&row.regressors);
            let friction = friction.friction_and_derivatives(&row.joint, |p, derivative| {
                by_parameter[Parameter::Friction(p).index()] = derivative;
            });
            let mut jacobian = [0.0; PARAMETERS];
            for &(parameter, column, factor) in &links {
                jacobian[column] += factor * by_parameter[parameter];
            }
            add_to_normal_sums(sums, &jacobian[..layout.len()], self.residual(row, &rigid, friction));
        });
        normal_equations(&sums, layout.len(), self.rows.len())
    }
}

/// Rigid part of the effort of one row.
pub fn rigid_effort(rigid: &RigidParameters, row: &Row) -> f64 {
    RigidRegressor::ALL.into_iter().map(|r| rigid.coefficient(r) * row.regressors[r.index()]).sum()
}

impl Candidate {
    /// Lays out a structure and drops the linear columns that the train rows cannot tell from earlier ones.
    pub fn new(problem: &Problem, structure: &Structure) -> Self {
        let layout = Layout::new(structure, &problem.rigid, &problem.limits);
        let template = FrictionModel { terms: structure.terms, ..problem.template.clone() };
        let mut candidate = Self { structure: *structure, layout, template, notes: vec![] };
        let linear = |role| matches!(role, Role::Coefficient | Role::Factor);
        let columns = &candidate.layout.columns;
        let considered: Vec<usize> = (0..columns.len()).filter(|&i| linear(columns[i].role)).collect();
        let probe = candidate.probe();
        let at = Residuals { rows: &problem.search, candidate: &candidate }.normal_equations(&probe);
        let found = dependences(&at.hessian, &considered);
        let mut dropped = vec![false; columns.len()];
        for dependence in found {
            let name = |i: usize| columns[i].name.as_str();
            let partners: Vec<&str> = dependence.explained_by.iter().map(|&i| name(i)).collect();
            candidate.notes.push(if partners.is_empty() {
                format!("{}: nothing in the train samples excites it; set to 0", name(dependence.column))
            } else {
                format!("{}: cannot be told from {}; set to 0", name(dependence.column), partners.join(" and "))
            });
            dropped[dependence.column] = true;
        }
        candidate.layout = candidate.layout.without(&dropped);
        candidate
    }

    /// A point at which every linear column is visible: coefficients 1, factors 0, shapes in the middle of their range.
    fn probe(&self) -> DVector<f64> {
        let bounds = self.layout.bounds();
        let value = |(column, (low, high)): (&super::layout::Column, &(f64, f64))| match column.role {
            Role::Coefficient => 1.0,
            Role::Factor => 0.0,
            Role::Shape | Role::Slope => 0.5 * (low + high) + 0.01 * (high - low),
        };
        DVector::from_iterator(bounds.len(), self.layout.columns.iter().zip(&bounds).map(value))
    }

    /// Descends from `x` to the nearest minimum over the rows.
    pub fn descend(&self, problem: &Problem, rows: &[Row], x: &DVector<f64>, effort: Effort) -> Fit {
        let options = Options {
            max_iterations: effort.iterations,
            gradient_tolerance: 0.0,
            cost_tolerance: effort.tolerance,
            mu_initial: 1e-4,
            mu_max: 1e6,
            damping: Damping::Diagonal,
            bounds: self.layout.bounds(),
        };
        let residuals = Residuals { rows, candidate: self };
        let found = minimise(&residuals, x, &options, |_, _, _| ControlFlow::Continue(()));
        let (rigid, friction) = self.layout.decode(&found.x, &self.template);
        let rigid = if self.structure.holds_rigid() { problem.theoretical } else { rigid };
        Fit { candidate: self.clone(), x: found.x, at: found.at, rigid, friction }
    }
}

impl Fit {
    /// Root mean square of effort - rigid - friction over the rows; nothing without rows.
    pub fn rmse(&self, rows: &[Row]) -> Option<f64> {
        let cost = Residuals { rows, candidate: &self.candidate }.cost(&self.x);
        (!rows.is_empty()).then(|| cost.sqrt())
    }

    /// The same fit, continued over all train rows until a step gains less than a thousandth of the variance that the
    /// samples leave in one parameter.
    pub fn polished(&self, problem: &Problem) -> Self {
        let effort = Effort { iterations: 40, tolerance: 1e-3 / problem.train.len() as f64 };
        self.candidate.descend(problem, &problem.train, &self.x, effort)
    }
}

#[cfg(test)]
#[path = "nonlinear_tests.rs"]
mod tests;
