//! Finding about a joint, from the parameters of its days; host.
//!
//! The reference is the sums of the first days, the present those of the last ones. Between them, over the motion of
//! the present: the factor of the rigid torque (inertia and gravity), of friction, of dry and of viscous friction, and
//! of what is left. A torque constant or gear ratio that is wrong scales all of the torque, a change of friction leaves
//! inertia and gravity alone, and a broken gear leaves more that no parameter explains.
//!
//! Limits were chosen on virtual joints (tests/virtual_fleet.rs), not on a fleet of hardware.

use crate::estimate::{Estimate, estimate, factor, mean, rms};
use crate::stored::Entry;
use crate::sums::Sums;
use serde::Serialize;

/// Unknowns of the rigid torque, with the offset, which a gravity that hardly changes looks like; of friction; of dry
/// and of viscous friction.
const RIGID: [usize; 4] = [0, 1, 2, 3];
const FRICTION: [usize; 2] = [4, 5];
const DRY: [usize; 1] = [4];
const VISCOUS: [usize; 1] = [5];
/// Gravity's cosine and the offset: a cosine that hardly changes looks like an offset, their sum is determined.
const OFFSETS: [usize; 2] = [2, 3];

/// Days of the reference: the first with an estimate.
pub const REFERENCE_DAYS: usize = 3;
/// Days of the present: the last with an estimate.
pub const PRESENT_DAYS: usize = 2;
/// Change of the friction torque, as a part of it, from which friction has drifted.
pub const DRIFT: f64 = 0.15;
/// Change of the offset, as a part of the friction torque's RMS, from which it is told.
pub const OFFSET_DRIFT: f64 = 0.3;
/// Change of the rigid torque, as a part of it, from which the configuration is wrong.
pub const SCALE: f64 = 0.1;
/// Factors of the residual, beside that of more friction, from which a joint is broken: of one whose residual scatters
/// little from day to day, and of one whose residual scatters much or whose friction has drifted. More friction brings
/// ripple and sticking that no parameter explains.
pub const BROKEN: [f64; 2] = [1.3, 2.0];
/// Standard errors of the residual, from its scatter, that lie between these two.
pub const SCATTER: f64 = 3.0;
/// Least residual that the factor refers to, as a part of the torque's RMS.
pub const LEAST_RESIDUAL: f64 = 0.01;

/// A finding's kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Growth of what is left unexplained.
    Broken,
    /// The sign of the torque, or a factor of all of it.
    WrongConfiguration,
    /// More friction.
    Drifted,
    /// Less friction.
    FrictionFell,
    /// No parameters in the reference or in the present.
    NotEnoughMotion,
    /// No finding.
    Healthy,
}

impl Kind {
    /// Name in words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Broken => "broken",
            Self::WrongConfiguration => "wrong configuration",
            Self::Drifted => "drifted",
            Self::FrictionFell => "friction fell",
            Self::NotEnoughMotion => "not enough motion",
            Self::Healthy => "healthy",
        }
    }
}

/// A day of a joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Day {
    /// YYYY-MM-DD.
    pub day: String,
    /// Time of motion that was used, s.
    pub motion_s: f64,
    /// RMS of what the day's own parameters leave, Nm; none without them.
    pub residual_nm: Option<f64>,
    /// RMS of what the reference's parameters leave, as a part of the torque's RMS; none without both.
    pub unexplained: Option<f64>,
    /// Inertia, gravity (sine, cosine), offset, dry and viscous friction; SI units.
    pub parameters: Option<[f64; 6]>,
    /// Their standard errors (of independent windows).
    pub errors: Option<[f64; 6]>,
    /// Mean temperature, °C.
    pub temperature_c: Option<f64>,
    /// Reason for which the day is not used; empty where it is.
    pub defect: String,
}

/// The factors between reference and present.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Factor of inertia and gravity.
    pub rigid: f64,
    /// Factor of the friction torque.
    pub friction: f64,
    /// Factor of dry friction.
    pub dry: f64,
    /// Factor of viscous friction.
    pub viscous: f64,
    /// Difference of the mean torque that does not depend on the velocity, without gravity's sine, Nm.
    pub offset_nm: f64,
    /// Factor of the residual.
    pub residual: f64,
    /// Factor of the residual, beside that of more friction, from which the joint is broken.
    pub residual_limit: f64,
    /// Difference of the temperature, K; NaN where it is not recorded.
    pub temperature_k: f64,
}

/// A joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Name of the joint.
    pub joint: String,
    /// Kind of what is wrong.
    pub kind: Kind,
    /// The same as a sentence.
    pub reason: String,
    /// First day from which the change holds; none without one.
    pub since: Option<String>,
    /// Change between reference and present; none without parameters.
    pub change: Option<Change>,
    /// Days that are not used.
    pub bad_days: usize,
    /// All days.
    pub days: Vec<Day>,
}

/// Findings about all joints, the worst kind first, then by name.
pub fn findings(entries: &[Entry]) -> Vec<Finding> {
    let joints = entries.chunk_by(|one, other| one.joint == other.joint);
    let mut findings: Vec<Finding> = joints.map(finding).collect();
    findings.sort_by(|one, other| (one.kind, &one.joint).cmp(&(other.kind, &other.joint)));
    findings
}

/// The finding about one joint, from its days in order.
fn finding(entries: &[Entry]) -> Finding {
    let estimates: Vec<Option<Estimate>> = entries.iter().map(|entry| estimate(&entry.sums)).collect();
    let good: Vec<usize> = (0..entries.len()).filter(|at| estimates[*at].is_some()).collect();
    let pooled = |days: &[usize]| {
        let mut sums = Sums::default();
        days.iter().for_each(|at| sums.add(&entries[*at].sums));
        let residual = pooled_residual(days, entries, &estimates);
        estimate(&sums).map(|found| Side { residual, days: days.len() as f64, sums, found })
    };
    let reference = pooled(&good[..good.len().min(REFERENCE_DAYS)]);
    // Days of the reference are not those of the present.
    let later = &good[good.len().min(REFERENCE_DAYS)..];
    let present = pooled(&later[later.len().saturating_sub(PRESENT_DAYS)..]);
    let days =
        entries.iter().zip(&estimates).map(|(entry, own)| day(entry, own.as_ref(), reference.as_ref())).collect();
    let bad_days = entries.iter().filter(|entry| !entry.defect.is_empty()).count();
    let joint = entries.first().map_or_else(String::new, |entry| entry.joint.clone());
    let (Some(reference), Some(present)) = (&reference, &present) else {
        let reason =
            format!("{} of {} days have enough motion, {} are needed", good.len(), entries.len(), REFERENCE_DAYS + 1);
        let kind = Kind::NotEnoughMotion;
        return Finding { joint, kind, reason, since: None, change: None, bad_days, days };
    };
    let scatter = scatter(&estimates);
    let change = changed(reference, present, scatter);
    let (kind, reason) = judge(&change, reference);
    let since = later.iter().rev().take_while(|at| {
        let own = pooled(&[**at]);
        kind != Kind::Healthy && own.is_some_and(|own| judge(&changed(reference, &own, scatter), reference).0 == kind)
    });
    let since = since.last().map(|at| entries[*at].day.clone());
    Finding { joint, kind, reason, since, change: Some(change), bad_days, days }
}

/// Reference or present.
struct Side {
    sums: Sums,
    found: Estimate,
    /// RMS of what each day's own parameters leave, Nm.
    residual: f64,
    /// Number of days.
    days: f64,
}

/// Standard deviation of a day's residual, as a natural logarithm, by the differences from day to day: a change that
/// stays is one of many.
fn scatter(estimates: &[Option<Estimate>]) -> f64 {
    let logarithms: Vec<f64> = estimates.iter().flatten().map(|own| own.residual.max(f64::MIN_POSITIVE).ln()).collect();
    let squares: f64 = logarithms.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
    (squares / (2.0 * (logarithms.len() as f64 - 1.0)).max(1.0)).sqrt()
}

/// RMS over days of what their own parameters leave: of several days, parameters that differ would be part of it.
fn pooled_residual(days: &[usize], entries: &[Entry], estimates: &[Option<Estimate>]) -> f64 {
    let of = |at: &usize| estimates[*at].map_or(0.0, |own| own.residual * own.residual * entries[*at].sums.windows);
    let windows: f64 = days.iter().map(|at| entries[*at].sums.windows).sum();
    (days.iter().map(of).sum::<f64>() / windows).sqrt()
}

fn day(entry: &Entry, own: Option<&Estimate>, reference: Option<&Side>) -> Day {
    let unexplained = own.zip(reference).map(|(own, reference)| {
        let mut left = *own;
        left.values.iter_mut().zip(reference.found.values).for_each(|(value, before)| *value -= before);
        // The residual of the day's own parameters is orthogonal to what they explain.
        let all: Vec<usize> = (0..left.values.len()).collect();
        rms(&entry.sums, &all, &left).hypot(own.residual) / own.torque
    });
    let temperature = entry.sums.mean_temperature();
    Day {
        day: entry.day.clone(),
        motion_s: entry.sums.windows * crate::windows::WINDOW,
        residual_nm: own.map(|own| own.residual),
        unexplained,
        parameters: own.map(|own| own.values),
        errors: own.map(|own| own.errors),
        temperature_c: temperature.is_finite().then_some(temperature),
        defect: entry.defect.clone(),
    }
}

fn changed(reference: &Side, present: &Side, scatter: f64) -> Change {
    let (sums, now, before) = (&present.sums, &present.found, &reference.found);
    let of = |which: &[usize]| factor(sums, which, now, before).unwrap_or(1.0);
    let least = LEAST_RESIDUAL * before.torque;
    let error = scatter * (1.0 / reference.days + 1.0 / present.days).sqrt();
    let friction = of(&FRICTION);
    let drifted = friction > 1.0 + DRIFT;
    Change {
        rigid: of(&RIGID),
        friction,
        dry: of(&DRY),
        viscous: of(&VISCOUS),
        offset_nm: mean(sums, &OFFSETS, now) - mean(sums, &OFFSETS, before),
        residual: present.residual.max(least) / reference.residual.max(least),
        residual_limit: if drifted { BROKEN[1] } else { (SCATTER * error).exp().clamp(BROKEN[0], BROKEN[1]) },
        temperature_k: sums.mean_temperature() - reference.sums.mean_temperature(),
    }
}

/// The kind and the reason of a change.
fn judge(change: &Change, reference: &Side) -> (Kind, String) {
    let percent = |factor: f64| 100.0 * (factor - 1.0).abs();
    let temperature = match change.temperature_k.abs() >= 5.0 {
        true => format!("; it is {:+.0} K warmer, of which a part may come", change.temperature_k),
        false => String::new(),
    };
    let friction = format!("dry times {:.2}, viscous times {:.2}{temperature}", change.dry, change.viscous);
    // All of the torque has one factor, as far as friction tells it.
    let scaled = (change.friction - change.rigid).abs() < 0.5 * (change.rigid - 1.0).abs();
    if change.rigid < 0.0 {
        return (Kind::WrongConfiguration, "inertia and gravity are negative: the sign of torque or position".into());
    }
    if (change.rigid - 1.0).abs() > SCALE && scaled {
        let reason = format!(
            "inertia and gravity are times {:.2} along with friction (times {:.2}): torque constant or gear ratio",
            change.rigid, change.friction
        );
        return (Kind::WrongConfiguration, reason);
    }
    if change.residual > change.residual_limit * change.friction.max(1.0) {
        let reason = format!(
            "what no parameter explains is times {:.1}: ripple, knocks or a sensor; friction {friction}",
            change.residual
        );
        return (Kind::Broken, reason);
    }
    if change.friction > 1.0 + DRIFT {
        return (Kind::Drifted, format!("friction is {:.0} % more: {friction}", percent(change.friction)));
    }
    if change.friction < 1.0 - DRIFT {
        return (Kind::FrictionFell, format!("friction is {:.0} % less: {friction}", percent(change.friction)));
    }
    let of_friction = rms(&reference.sums, &FRICTION, &reference.found);
    if change.offset_nm.abs() > OFFSET_DRIFT * of_friction {
        return (Kind::Drifted, format!("the offset has moved by {:+.3} Nm", change.offset_nm));
    }
    (Kind::Healthy, format!("friction within {:.0} %", 100.0 * DRIFT))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::windows::{Recorded, Window};

    /// Inertia, gravity (sine, cosine), offset, dry and viscous friction of a joint.
    const JOINT: [f64; 6] = [0.5, 2.0, 0.1, 0.2, 1.5, 0.3];

    /// Day number so and so of a joint with these parameters, and a torque that no parameter explains.
    fn entry(number: usize, values: [f64; 6], unexplained: f64) -> Entry {
        let window = |at: usize| {
            let t = at as f64 * 0.04;
            let (q, v) = ((1.7 * t).sin() + 0.3 * t.cos(), 1.7 * (1.7 * t).cos() - 0.3 * t.sin());
            let row = [-2.9 * (1.7 * t).sin(), q.sin(), q.cos(), 1.0, v.signum(), v];
            let error = unexplained * ((at * 7_919 % 1_009) as f64 / 504.0 - 1.0);
            let torque = row.iter().zip(values).map(|(factor, value)| factor * value).sum::<f64>() + error;
            Window { row, torque, duration: 0.04 }
        };
        let windows = (0..400).map(window).collect();
        let recorded = Recorded { windows, seconds: 16.0, temperature: 30.0 };
        Entry {
            joint: "j".into(),
            day: format!("2026-01-{:02}", number + 1),
            source: String::new(),
            defect: String::new(),
            sums: Sums::of(&[recorded], |_| None),
        }
    }

    /// The finding where six days are followed by three with other parameters.
    fn after(values: [f64; 6], unexplained: f64) -> Finding {
        let before = (0..6).map(|number| entry(number, JOINT, 0.1));
        let days: Vec<Entry> = before.chain((6..9).map(|number| entry(number, values, unexplained))).collect();
        finding(&days)
    }

    /// The joint with its rigid torque and its friction times a factor each.
    fn times(rigid: f64, friction: f64) -> [f64; 6] {
        let factors = [rigid, rigid, rigid, rigid, friction, friction];
        std::array::from_fn(|at| JOINT[at] * factors[at])
    }

    #[test]
    fn a_residual_that_scatters_from_day_to_day_has_to_grow_by_more() {
        let of = |before: [f64; 6], now: f64| {
            let all = before.into_iter().chain([now; 3]).enumerate();
            finding(&all.map(|(number, unexplained)| entry(number, JOINT, unexplained)).collect::<Vec<_>>())
        };
        let [steady, uneven] = [[0.1; 6], [0.1, 0.13, 0.08, 0.12, 0.08, 0.12]].map(|before| of(before, 0.15));
        assert_eq!((steady.kind, uneven.kind), (Kind::Broken, Kind::Healthy), "{} {}", steady.reason, uneven.reason);
        let [steady, uneven] = [steady, uneven].map(|found| found.change.unwrap().residual_limit);
        // One step by ln 1.5 among eight differences: exp(3 * 0.405 / 4 * sqrt(1/3 + 1/2)).
        assert!((steady - 1.32).abs() < 0.005 && uneven > 1.5 && uneven < BROKEN[1], "{steady} {uneven}");
        assert_eq!(of([0.1, 0.2, 0.05, 0.2, 0.05, 0.2], 0.15).change.unwrap().residual_limit, BROKEN[1]);
        // More friction brings more that no parameter explains.
        for (factor, kind) in [(0.97, Kind::Drifted), (1.05, Kind::Broken)] {
            let found = after(times(1.0, 1.2), factor * BROKEN[1] * 1.2 * 0.1);
            assert_eq!(found.kind, kind, "{factor}: {}", found.reason);
        }
    }

    #[test]
    fn each_limit_has_a_joint_just_below_and_one_just_above_it() {
        for (friction, kind) in [
            (1.0, Kind::Healthy),
            (0.99 + DRIFT, Kind::Healthy),
            (1.01 + DRIFT, Kind::Drifted),
            (1.01 - DRIFT, Kind::Healthy),
            (0.99 - DRIFT, Kind::FrictionFell),
        ] {
            let found = after(times(1.0, friction), 0.1);
            assert_eq!(found.kind, kind, "{friction}: {}", found.reason);
        }
        for (scale, kind) in [(1.01 - SCALE, Kind::Healthy), (0.99 - SCALE, Kind::WrongConfiguration)] {
            let found = after(times(scale, scale), 0.1);
            assert_eq!(found.kind, kind, "{scale}: {}", found.reason);
        }
        for (factor, kind) in [(0.97 * BROKEN[0], Kind::Healthy), (1.03 * BROKEN[0], Kind::Broken)] {
            let found = after(JOINT, factor * 0.1);
            assert_eq!(found.kind, kind, "{factor}: {}", found.reason);
        }
        let friction = rms(&entry(0, JOINT, 0.0).sums, &FRICTION, &estimate(&entry(0, JOINT, 0.0).sums).unwrap());
        for (part, kind) in [(0.97, Kind::Healthy), (1.03, Kind::Drifted)] {
            let mut moved = JOINT;
            moved[3] += part * OFFSET_DRIFT * friction;
            let found = after(moved, 0.1);
            assert_eq!(found.kind, kind, "{part}: {}", found.reason);
        }
    }

    #[test]
    fn a_payload_scales_no_friction_and_is_no_wrong_configuration() {
        for rigid in [0.7, 1.5] {
            assert_eq!(after(times(rigid, 1.0), 0.1).kind, Kind::Healthy, "{rigid}");
        }
        assert_eq!(after(times(-1.0, -1.0), 0.1).kind, Kind::WrongConfiguration);
    }

    #[test]
    fn more_friction_may_leave_as_much_more_unexplained() {
        assert_eq!(after(times(1.0, 2.0), 0.1 * 3.9).kind, Kind::Drifted);
        assert_eq!(after(times(1.0, 2.0), 0.1 * 4.1).kind, Kind::Broken);
    }

    #[test]
    fn a_change_holds_since_its_first_day_and_a_healthy_joint_has_none() {
        assert_eq!(after(times(1.0, 1.4), 0.1).since.as_deref(), Some("2026-01-07"));
        assert_eq!(after(JOINT, 0.1).since, None);
    }

    #[test]
    fn the_present_has_no_day_of_the_reference() {
        let three: Vec<Entry> = (0..REFERENCE_DAYS).map(|number| entry(number, JOINT, 0.1)).collect();
        assert_eq!(finding(&three).kind, Kind::NotEnoughMotion);
        let four: Vec<Entry> = three.into_iter().chain([entry(3, times(1.0, 1.4), 0.1)]).collect();
        let found = finding(&four);
        // One day of the present, and it alone.
        assert!((found.change.unwrap().friction - 1.4).abs() < 0.01, "{found:?}");
    }
}
