//! A motion of all joints beside every limit, on a fine grid of times; host. It begins and ends at rest by its form:
//! every series fades.

use super::Task;
use excitation::Excitation;
use serde::Serialize;

/// Extremes of one joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Extremes {
    /// The joint.
    pub joint: String,
    /// Unit of its position.
    pub unit: &'static str,
    /// Lowest and highest position.
    pub position: (f64, f64),
    /// Largest velocity.
    pub velocity: f64,
    /// Largest acceleration.
    pub acceleration: f64,
}

/// The lowest place of a motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lowest {
    /// Height above the base's origin, m.
    pub height: f64,
    /// Link whose frame it is.
    pub frame: String,
    /// Time, s.
    pub time: f64,
}

/// A motion beside its limits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Findings {
    /// Extremes of every joint.
    pub joints: Vec<Extremes>,
    /// The lowest place of all frames; None for a robot without frames.
    pub lowest: Option<Lowest>,
    /// Limits that are exceeded, in words; none where the motion may be run.
    pub defects: Vec<String>,
}

/// Checks the motion every `period` (s).
pub fn check(task: &Task, excitations: &[Excitation], period: f64) -> Findings {
    let mut findings = Findings { joints: Vec::new(), lowest: None, defects: Vec::new() };
    for (j, excitation) in excitations.iter().enumerate() {
        let extremes = extremes(task, j, excitation, period);
        findings.defects.extend(exceeded(task, j, &extremes));
        findings.joints.push(extremes);
    }
    findings.lowest = lowest(task, excitations, period);
    if let (Some(floor), Some(lowest)) = (task.floor, &findings.lowest)
        && lowest.height < floor
    {
        findings.defects.push(format!(
            "frame {} comes down to {:.4} m at {:.3} s, the floor is at {floor:.4} m",
            lowest.frame, lowest.height, lowest.time
        ));
    }
    findings
}

fn extremes(task: &Task, j: usize, excitation: &Excitation, period: f64) -> Extremes {
    let joint = task.robot.tree.joints[j].name.clone();
    let position = (f64::INFINITY, f64::NEG_INFINITY);
    let mut extremes = Extremes { joint, unit: task.unit(j), position, velocity: 0.0, acceleration: 0.0 };
    for (_, motion) in excitation.samples(period) {
        let (low, high) = extremes.position;
        extremes.position = (low.min(motion.position), high.max(motion.position));
        extremes.velocity = extremes.velocity.max(motion.velocity.abs());
        extremes.acceleration = extremes.acceleration.max(motion.acceleration.abs());
    }
    extremes
}

fn exceeded(task: &Task, j: usize, found: &Extremes) -> Vec<String> {
    let (bounds, unit, joint) = (&task.bounds[j], found.unit, &found.joint);
    let mut defects = Vec::new();
    let (low, high) = bounds.position;
    if found.position.0 < low {
        defects.push(format!("joint {joint} reaches {:.5} {unit}, the lowest permitted is {low:.5}", found.position.0));
    }
    if found.position.1 > high {
        defects
            .push(format!("joint {joint} reaches {:.5} {unit}, the highest permitted is {high:.5}", found.position.1));
    }
    for (what, value, most, per) in [
        ("velocity", found.velocity, bounds.velocity, "/s"),
        ("acceleration", found.acceleration, bounds.acceleration, "/s^2"),
    ] {
        if value > most {
            defects.push(format!("{what} of joint {joint} reaches {value:.5} {unit}{per}, permitted are {most:.5}"));
        }
    }
    defects
}

fn lowest(task: &Task, excitations: &[Excitation], period: f64) -> Option<Lowest> {
    let motions: Vec<Vec<(f64, f64)>> = (excitations.iter())
        .map(|excitation| excitation.samples(period).map(|(time, motion)| (time, motion.position)).collect())
        .collect();
    let samples = motions.iter().map(Vec::len).min()?;
    let mut found: Option<Lowest> = None;
    for i in 0..samples {
        let q: Vec<f64> = motions.iter().map(|motion| motion[i].1).collect();
        let (height, frame) = task.lowest(&q);
        if found.as_ref().is_none_or(|found| height < found.height) {
            let frame = task.robot.frames.get(frame)?.link.clone();
            found = Some(Lowest { height, frame, time: motions[0][i].0 });
        }
    }
    found
}
