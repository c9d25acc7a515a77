//! The samples as identification sees them: checked, train and validation rows only, and the limits that follow; host.

use super::IdentifyError;
use crate::friction_model::{JointState, RIPPLES};
use crate::joint_model::{float_state, rigid_state};
use crate::rigid::{Given, RigidModel, RigidParameters, RigidRegressor};
use crate::samples::{Part, Samples};

/// Intervals of position that must be visited for position harmonics to be considered.
const POSITION_BINS: usize = 50;
/// Fraction of these intervals that each direction of motion must have visited.
const POSITION_COVERAGE: f64 = 0.8;
/// Samples that make an interval visited.
const POSITION_VISITS: usize = 5;

/// Least part of the rows in which each joint of a pair leads for a relief to be considered.
const LEADS: f64 = 0.05;

/// One sample, ready for evaluation.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Variables that friction depends on.
    pub joint: JointState,
    /// Values of all regressors of the rigid part.
    pub regressors: [f64; RigidRegressor::ALL.len()],
    /// Measured effort.
    pub effort: f64,
}

/// Limits of the train rows, from which bounds on the parameters follow.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// 99.9 % quantile of |velocity|.
    pub velocity: f64,
    /// Root mean square of the acceleration.
    pub acceleration_rms: f64,
    /// Largest |T - T_ref|, K.
    pub warming: f64,
    /// Difference between the highest and the lowest temperature, K.
    pub temperature_range: f64,
    /// Largest |theoretical torque|.
    pub load: f64,
    /// Largest |position|.
    pub position: f64,
    /// Difference between the largest and the smallest position.
    pub position_range: f64,
    /// Each direction of motion visits most of the position range.
    pub position_covered: bool,
    /// Pre-sliding elements whose distances were chosen.
    pub elements: usize,
    /// Ripples whose frequencies were chosen.
    pub ripples: usize,
    /// `true` for those of them that may have a part whatever the direction.
    pub ripple_torques: [bool; RIPPLES],
    /// The joint shares its drive, and each of the two leads in a part of the rows.
    pub both_lead: bool,
}

/// Checks that all columns the model needs exist, are of one length and finite in the train and validation rows.
pub fn check(samples: &Samples, rigid: &RigidModel) -> Result<(), IdentifyError> {
    let expected = samples.part.len();
    let mut columns = vec![
        ("time", &samples.time),
        ("position", &samples.position),
        ("velocity", &samples.velocity),
        ("acceleration", &samples.acceleration),
        ("effort", &samples.effort),
        ("temperature", &samples.temperature),
    ];
    if rigid.mass_and_length {
        for name in ["mass", "length"] {
            let column = samples.extra.get(name).ok_or(IdentifyError::MissingColumn { column: name })?;
            columns.push((name, column));
        }
    }
    if rigid.given != Given::None {
        columns.push(("rigid", samples.extra.get("rigid").ok_or(IdentifyError::MissingColumn { column: "rigid" })?));
    }
    for (column, values) in columns {
        if values.len() != expected {
            return Err(IdentifyError::Length { column, found: values.len(), expected });
        }
        let used = |i: &usize| matches!(samples.part[*i], Part::Train | Part::Validation);
        if let Some(index) = (0..expected).filter(used).find(|&i| !values[i].is_finite()) {
            return Err(IdentifyError::NotFinite { column, index, value: values[index] });
        }
    }
    Ok(())
}

/// Indices of the samples that identification uses: all for training and validation.
pub fn used(samples: &Samples) -> Vec<usize> {
    (0..samples.len()).filter(|&i| matches!(samples.part[i], Part::Train | Part::Validation)).collect()
}

/// The rows of the samples that identification uses, in order, without a load.
pub fn rows(samples: &Samples) -> Vec<Row> {
    let row = |i| Row {
        joint: JointState { load: 0.0, ..float_state(samples, i) },
        regressors: RigidParameters::regressor_values(&rigid_state(samples, i)),
        effort: samples.effort[i],
    };
    used(samples).into_iter().map(row).collect()
}

/// Every n-th row, with the smallest n that leaves at most `limit`.
pub fn decimated(rows: &[Row], limit: usize) -> Vec<Row> {
    rows.iter().step_by(rows.len().div_ceil(limit.max(1)).max(1)).copied().collect()
}

impl Limits {
    /// The limits of the given rows (at least one) around a reference temperature.
    pub fn of(rows: &[Row], reference_temperature: f64) -> Self {
        let mut speed: Vec<f64> = rows.iter().map(|row| row.joint.velocity.abs()).collect();
        speed.sort_by(f64::total_cmp);
        let range = |value: fn(&JointState) -> f64| {
            rows.iter()
                .map(|row| value(&row.joint))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
        };
        let (coldest, warmest) = range(|s| s.temperature);
        let (lowest, highest) = range(|s| s.position);
        let (least, most) = range(|s| s.load);
        let squares: f64 = rows.iter().map(|row| row.joint.acceleration * row.joint.acceleration).sum();
        Self {
            velocity: speed[(speed.len() - 1) * 999 / 1000],
            acceleration_rms: (squares / rows.len() as f64).sqrt(),
            warming: (warmest - reference_temperature).abs().max((coldest - reference_temperature).abs()),
            temperature_range: warmest - coldest,
            load: least.abs().max(most.abs()),
            position: lowest.abs().max(highest.abs()),
            position_range: highest - lowest,
            position_covered: covers_positions(rows, lowest, highest),
            elements: 0,
            ripples: 0,
            ripple_torques: [false; RIPPLES],
            both_lead: both_lead(rows),
        }
    }
}

fn both_lead(rows: &[Row]) -> bool {
    let following = rows.iter().filter(|row| row.joint.following).count() as f64 / rows.len() as f64;
    (LEADS..=1.0 - LEADS).contains(&following)
}

fn covers_positions(rows: &[Row], lowest: f64, highest: f64) -> bool {
    let mut visits = [[0; POSITION_BINS]; 2];
    for row in rows {
        let along = (row.joint.position - lowest) / (highest - lowest) * POSITION_BINS as f64;
        visits[usize::from(row.joint.velocity < 0.0)][(along as usize).min(POSITION_BINS - 1)] += 1;
    }
    visits.iter().all(|bins| {
        let visited = bins.iter().filter(|&&n| n >= POSITION_VISITS).count();
        visited as f64 >= POSITION_COVERAGE * POSITION_BINS as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(position: f64, velocity: f64) -> Row {
        Row {
            joint: JointState { position, velocity, ..Default::default() },
            regressors: [0.0; RigidRegressor::ALL.len()],
            effort: 0.0,
        }
    }

    #[test]
    fn positions_are_covered_only_when_both_directions_visit_them() {
        let there: Vec<Row> = (0..1000).map(|i| row(i as f64, 1.0)).collect();
        let back: Vec<Row> = (0..1000).map(|i| row(i as f64, -1.0)).collect();
        assert!(!Limits::of(&there, 25.0).position_covered);
        assert!(Limits::of(&[there, back].concat(), 25.0).position_covered);
    }

    #[test]
    fn decimation_keeps_at_most_the_limit_and_all_rows_below_it() {
        let rows: Vec<Row> = (0..1001).map(|i| row(i as f64, 0.0)).collect();
        assert_eq!(decimated(&rows, 500).len(), 334);
        assert_eq!(decimated(&rows, 1001).len(), 1001);
    }
}
