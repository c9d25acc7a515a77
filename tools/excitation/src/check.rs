//! Check of a table of samples: whether it keeps the joint's limits, is a motion at all, and what it tells apart; host.

use super::Bounds;
use super::regressor::condition_number;
use plant::excitation::Reference;

/// Findings about a table of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// Lowest and highest position, rad.
    pub position: (f64, f64),
    /// Largest velocity, rad/s.
    pub velocity: f64,
    /// Largest acceleration, rad/s².
    pub acceleration: f64,
    /// Condition number of the regressor.
    pub condition_number: f64,
    /// Defects, in words; none where it may be run.
    pub defects: Vec<String>,
}

/// Part of a bound by which rounding of a table may exceed it.
const ROUNDING: f64 = 1e-4;

/// Checks samples at `time` (s) against `bounds`.
#[must_use]
pub fn check(time: &[f64], motion: &[Reference], bounds: &Bounds) -> Findings {
    let largest = |value: fn(&Reference) -> f64| motion.iter().map(|m| value(m).abs()).fold(0.0, f64::max);
    let low = motion.iter().map(|m| m.position).fold(f64::INFINITY, f64::min);
    let high = motion.iter().map(|m| m.position).fold(f64::NEG_INFINITY, f64::max);
    let (velocity, acceleration) = (largest(|m| m.velocity), largest(|m| m.acceleration));
    let mut defects = Vec::new();
    let room = ROUNDING * (bounds.position.1 - bounds.position.0);
    if low < bounds.position.0 - room {
        defects.push(format!("position reaches {low:.4} rad, the lowest permitted is {:.4} rad", bounds.position.0));
    }
    if high > bounds.position.1 + room {
        defects.push(format!("position reaches {high:.4} rad, the highest permitted is {:.4} rad", bounds.position.1));
    }
    if velocity > (1.0 + ROUNDING) * bounds.velocity {
        defects.push(format!("velocity reaches {velocity:.4} rad/s, permitted are {:.4} rad/s", bounds.velocity));
    }
    if acceleration > (1.0 + ROUNDING) * bounds.acceleration {
        defects.push(format!(
            "acceleration reaches {acceleration:.4} rad/s², permitted are {:.4} rad/s²",
            bounds.acceleration
        ));
    }
    for (place, end) in [("begin", motion.first()), ("end", motion.last())] {
        if let Some(end) = end.filter(|m| m.velocity.abs() > 0.01 * bounds.velocity) {
            defects.push(format!("it does not {place} at rest, but at {:.4} rad/s", end.velocity));
        }
    }
    defects.extend(contradiction(time, motion, bounds));
    Findings {
        position: (low, high),
        velocity,
        acceleration,
        condition_number: condition_number(bounds, motion),
        defects,
    }
}

/// The first place where position and velocity cannot be of the same motion.
fn contradiction(time: &[f64], motion: &[Reference], bounds: &Bounds) -> Option<String> {
    for (times, pair) in time.windows(2).zip(motion.windows(2)) {
        let step = times[1] - times[0];
        if step <= 0.0 {
            return Some(format!("time does not increase after {:.4} s", times[0]));
        }
        let moved = pair[1].position - pair[0].position;
        let expected = 0.5 * step * (pair[0].velocity + pair[1].velocity);
        // The trapezoidal rule errs by less than this; a table has its decimals.
        let tolerance = 0.25 * bounds.acceleration * step * step + 1e-5;
        if (moved - expected).abs() > tolerance {
            return Some(format!(
                "from {:.4} s to {:.4} s the position changes by {moved:.5} rad, by its velocity {expected:.5} rad",
                times[0], times[1]
            ));
        }
        let gained = pair[1].velocity - pair[0].velocity;
        if gained.abs() > (1.0 + ROUNDING) * bounds.acceleration * step + 1e-4 {
            return Some(format!(
                "from {:.4} s to {:.4} s the velocity changes by {gained:.5} rad/s: more than {:.4} rad/s²",
                times[0], times[1], bounds.acceleration
            ));
        }
    }
    None
}
