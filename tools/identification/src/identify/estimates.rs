//! Estimates, parameter by parameter, with standard errors from the normal equations at the solution; host.

use super::layout::Parameter;
use super::linear::{dependences, inverse};
use super::nonlinear::Fit;
use crate::friction_model::Term;
use crate::friction_parameter::{FrictionParameter, Units};
use crate::rigid::RigidRegressor;
use serde::Serialize;

/// One identified parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimated {
    /// Name in the field's words.
    pub name: String,
    /// Symbol in the design's formula.
    pub symbol: String,
    /// Unit.
    pub unit: String,
    /// Value.
    pub value: f64,
    /// Standard error, sigma^2 (J^T J)^-1 with sigma^2 from the residual; it takes residuals for independent, which
    /// those of filtered recordings are not: there it is a lower limit. None at a bound, or where the data do not
    /// determine it.
    pub standard_error: Option<f64>,
    /// The value lies on one of its bounds.
    pub at_bound: bool,
}

/// All parameters of a fit over `rows` samples, and notes about those that have no standard error.
pub fn estimates(fit: &Fit, rows: usize, units: &Units) -> (Vec<Estimated>, Vec<String>) {
    let layout = &fit.candidate.layout;
    let bounds = layout.bounds();
    let at_bound: Vec<bool> = fit.x.iter().zip(&bounds).map(|(x, (low, high))| x <= low || x >= high).collect();
    let hessian = &fit.at.hessian;
    let mut free: Vec<usize> = (0..layout.len()).filter(|&i| !at_bound[i]).collect();
    let undetermined = dependences(hessian, &free);
    free.retain(|i| undetermined.iter().all(|dependence| dependence.column != *i));
    let name = |i: usize| layout.columns[i].name.as_str();
    let note = |d: &super::linear::Dependence| format!("{}: no effect of its own at the solution", name(d.column));
    let notes = undetermined.iter().map(note).collect();
    let variance = fit.at.cost / rows.saturating_sub(free.len()).max(1) as f64;
    let covariance = inverse(hessian, &free).map(|inverse| inverse * variance);

    let standard_error = |parameter: Parameter| {
        let mut gradient = vec![0.0; free.len()];
        for link in layout.links.iter().filter(|link| link.parameter == parameter) {
            let position = free.iter().position(|&i| i == link.column)?;
            gradient[position] += link.factor * layout.physical_derivative(link.column, fit.x[link.column]);
        }
        let covariance = covariance.as_ref()?;
        let square: f64 = (0..free.len())
            .flat_map(|a| (0..free.len()).map(move |b| (a, b)))
            .map(|(a, b)| gradient[a] * covariance[(a, b)] * gradient[b])
            .sum();
        Some(square.max(0.0).sqrt())
    };
    let linked = |parameter| layout.links.iter().any(|link| link.parameter == parameter);
    let bounded = |parameter| layout.links.iter().any(|link| link.parameter == parameter && at_bound[link.column]);
    let held = |regressor| fit.candidate.structure.holds_rigid() && fit.rigid.coefficient(regressor) != 0.0;
    let rigid = RigidRegressor::ALL.into_iter().filter(|&r| linked(Parameter::Rigid(r)) || held(r)).map(|regressor| {
        let parameter = Parameter::Rigid(regressor);
        Estimated {
            name: regressor.to_string(),
            symbol: regressor.symbol(),
            unit: regressor.unit(units),
            value: fit.rigid.coefficient(regressor),
            standard_error: linked(parameter).then(|| standard_error(parameter)).flatten(),
            at_bound: bounded(parameter),
        }
    });
    let breakaway = |p| matches!(p, FrictionParameter::BreakawayPositive | FrictionParameter::BreakawayNegative);
    let stribeck = fit.friction.terms.contains(Term::Stribeck);
    let friction = FrictionParameter::all()
        .into_iter()
        .filter(|&p| linked(Parameter::Friction(p)) && (stribeck || !breakaway(p)))
        .map(|p| Estimated {
            name: p.to_string(),
            symbol: p.symbol(),
            unit: p.unit(units),
            value: fit.friction.parameter(p),
            standard_error: standard_error(Parameter::Friction(p)),
            at_bound: bounded(Parameter::Friction(p)),
        });
    (rigid.chain(friction).collect(), notes)
}
