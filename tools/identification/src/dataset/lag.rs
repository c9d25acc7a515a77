//! Delay of the recorded effort against the position, from the training samples; host.
//!
//! The simplest linear model is fitted for every whole shift of the effort; the parabola through the least residual and
//! its neighbours gives the delay between the samples. No interpolated effort is used for that: it would be smoother,
//! and fit better for that alone. The standard error is that of the jackknife over runs or blocks of time, which also
//! tells whether the delay lowers the residual where it was not identified.

use super::simple_model::{Normal, SimpleModel, groups, jackknife};
use crate::rigid::RigidModel;
use crate::samples::{Part, Samples};

/// Standard errors that a delay must exceed to be applied.
const SIGNIFICANT: f64 = 3.0;
/// Least fall of the residual in groups that were left out, as a fraction, for a delay to be applied.
const LEAST_GAIN: f64 = 0.005;
/// Rows below which nothing is identified, and rows that are enough.
const LEAST_ROWS: usize = 400;
const MOST_ROWS: usize = 40_000;
/// Residual, as a fraction of the effort's RMS, below which there is nothing to gain: every shift of a sine is a sine.
const LEAST_RESIDUAL: f64 = 1e-3;

/// A delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// Time by which the recorded effort lags behind the position, s; negative: it leads.
    pub lag: f64,
    /// Standard error, s.
    pub standard_error: f64,
    /// Fall of the simplest model's residual in groups that were left out, as a fraction.
    pub gain: f64,
    /// The magnitude that is not exceeded, s.
    pub limit: f64,
    /// The least residual lies at the limit or beyond.
    pub beyond: bool,
}

impl Lag {
    /// The delay is certain and lowers the residual where it was not identified.
    pub fn significant(&self) -> bool {
        self.lag.abs() > SIGNIFICANT * self.standard_error && self.gain >= LEAST_GAIN
    }

    /// The delay is significant and within the limit.
    pub fn applies(&self) -> bool {
        self.significant() && !self.beyond
    }
}

/// Residuals of one group of rows for every shift.
type Profile = Vec<Normal>;

/// The delay of the effort, or None where the rows do not suffice. `run` is the run as recorded for each sample,
/// `period` the sampling period, s, `limit` the largest magnitude, s.
pub fn identify(samples: &Samples, rigid: &RigidModel, run: &[u32], period: f64, limit: f64) -> Option<Lag> {
    let reach = (limit / period).ceil() as usize + 1;
    let inside = |&i: &usize| {
        i >= reach
            && i + reach < samples.len()
            && samples.run[i - reach] == samples.run[i]
            && samples.run[i + reach] == samples.run[i]
    };
    let mut rows: Vec<usize> = samples.indices(Part::Train).into_iter().filter(inside).collect();
    if rows.len() < LEAST_ROWS {
        return None;
    }
    let every = rows.len().div_ceil(MOST_ROWS);
    rows = rows.into_iter().step_by(every).collect();
    let model = SimpleModel::new(rigid, samples, &rows);
    let group = groups(run, &rows);
    let count = group.iter().max().map_or(0, |most| most + 1);
    let shifts = 2 * reach + 1;
    let mut profiles: Vec<Profile> = vec![vec![Normal::zero(model.terms.len()); shifts]; count];
    for (&i, &group) in rows.iter().zip(&group) {
        let values = model.values(samples, i);
        for (shift, normal) in profiles[group].iter_mut().enumerate() {
            normal.add(&values, samples.effort[i + shift - reach]);
        }
    }
    let profile = residuals(&profiles, None);
    let effort = profiles.iter().map(|profile| profile[reach].square).sum::<f64>() / rows.len() as f64;
    if profile[reach] < LEAST_RESIDUAL * LEAST_RESIDUAL * effort {
        return None;
    }
    let (shift, edge) = least(&profile);
    let left_out: Vec<f64> = (0..count).map(|g| least(&residuals(&profiles, Some(g))).0).collect();
    let lag = (shift - reach as f64) * period;
    let standard_error = jackknife(&left_out).1 * period;
    let (mut with, mut without) = (0.0, 0.0);
    for (g, &shift) in left_out.iter().enumerate() {
        let at = |shift: usize| {
            let others: Vec<Normal> = others(&profiles, g, shift);
            profiles[g][shift].residual(&Normal::without(&others, None).solve())
        };
        without += at(reach);
        with += between(shift, shifts, at);
    }
    let gain = if without > 0.0 { 1.0 - (with / without).sqrt() } else { 0.0 };
    Some(Lag { lag, standard_error, gain, limit, beyond: edge || lag.abs() > limit })
}

fn others(profiles: &[Profile], left_out: usize, shift: usize) -> Vec<Normal> {
    profiles.iter().enumerate().filter(|(g, _)| *g != left_out).map(|(_, profile)| profile[shift].clone()).collect()
}

/// Mean squared residual of the model for every shift, with one group left out.
fn residuals(profiles: &[Profile], left_out: Option<usize>) -> Vec<f64> {
    let shifts = profiles.first().map_or(0, Vec::len);
    let at = |shift: usize| {
        let groups: Vec<Normal> = profiles.iter().map(|profile| profile[shift].clone()).collect();
        let sum = Normal::without(&groups, left_out);
        sum.residual(&sum.solve()) / sum.count.max(1) as f64
    };
    (0..shifts).map(at).collect()
}

/// Place of the least value, between the samples, and whether it lies at an end.
fn least(profile: &[f64]) -> (f64, bool) {
    let at = (0..profile.len()).min_by(|&a, &b| profile[a].total_cmp(&profile[b])).unwrap_or(0);
    if at == 0 || at + 1 >= profile.len() {
        return (at as f64, true);
    }
    let (before, here, after) = (profile[at - 1], profile[at], profile[at + 1]);
    let curvature = before - 2.0 * here + after;
    let offset = if curvature > 0.0 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 };
    (at as f64 + offset, false)
}

/// A function of the shift at a place between whole ones, along the parabola through the three nearest.
fn between(place: f64, shifts: usize, at: impl Fn(usize) -> f64) -> f64 {
    let middle = (place.round() as usize).clamp(1, shifts.saturating_sub(2).max(1));
    let t = place - middle as f64;
    let (before, here, after) = (at(middle - 1), at(middle), at(middle + 1));
    here + 0.5 * t * (after - before) + 0.5 * t * t * (before - 2.0 * here + after)
}
