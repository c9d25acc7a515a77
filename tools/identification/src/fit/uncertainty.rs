//! Part of an image's friction that the joint may not have: what the energy guard has to know (docs/energy-guard.md);
//! host.
//!
//! Compensation is passive at an instant where it is at most (1 - u) times the image's friction, u such that the
//! joint's friction is at least that. u is measured on motions that were left out: the friction in the effort over that
//! of the model, mean over each direction, range of speeds and kind of load. One period of a ripple averages out, as
//! its work does.

use crate::choice::Folds;
use crate::identify::Identified;
use crate::joint_model::{float_state, rigid_state};
use crate::page::Uncertainty;
use crate::samples::{Part, Samples};
use std::collections::BTreeMap;

/// Least speed that counts, part of the greatest (99th percentile): below, friction is a spring.
const SLOWEST: f64 = 0.05;
/// Ranges of speed end here, parts of the greatest.
const SPEEDS: [f64; 4] = [0.1, 0.2, 0.4, 0.7];
/// Load that counts as one, part of the greatest (99th percentile).
const LOADED: f64 = 1.0 / 3.0;
/// Passes through a cell of which its mean is told, at least.
const PASSES: usize = 4;
/// Standard errors by which a cell's friction may be less than its mean.
const DEVIATIONS: f64 = 2.0;
/// Least uncertainty that is stated: no recording has everything.
const LEAST: f64 = 0.1;

/// Direction, range of speed and kind of load of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Cell {
    backward: bool,
    speed: usize,
    load: Load,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Load {
    Small,
    Driving,
    Braking,
}

impl Cell {
    /// Name in words.
    fn name(self) -> String {
        let direction = if self.backward { "backward" } else { "forward" };
        let from = self.speed.checked_sub(1).map_or(SLOWEST, |below| SPEEDS[below]);
        let to = SPEEDS.get(self.speed).map_or_else(String::new, |to| format!(" to {:.0}", 100.0 * to));
        let load = match self.load {
            Load::Small => "",
            Load::Driving => ", against a load",
            Load::Braking => ", with a load",
        };
        format!("{direction} at {:.0}{to} % of the greatest speed{load}", 100.0 * from)
    }
}

/// Cells of all samples; None for those that do not count.
fn cells(samples: &Samples) -> Vec<Option<Cell>> {
    let used: Vec<usize> = (0..samples.len()).filter(|&i| counts(samples, i)).collect();
    let greatest = |values: &dyn Fn(usize) -> f64| {
        let mut all: Vec<f64> = used.iter().map(|&i| values(i).abs()).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() * 99 / 100).copied().unwrap_or(0.0)
    };
    let load = |i: usize| samples.load.get(i).copied().unwrap_or(0.0);
    let (fastest, heaviest) = (greatest(&|i| samples.velocity[i]), greatest(&load));
    let cell = |i: usize| {
        let (velocity, load) = (samples.velocity[i], load(i));
        let speed = velocity.abs() / fastest;
        (counts(samples, i) && speed >= SLOWEST).then(|| Cell {
            backward: velocity < 0.0,
            speed: SPEEDS.iter().filter(|edge| speed >= **edge).count(),
            load: match load.abs() <= LOADED * heaviest {
                true => Load::Small,
                false if load * velocity > 0.0 => Load::Driving,
                false => Load::Braking,
            },
        })
    };
    (0..samples.len()).map(cell).collect()
}

/// True for what identification sees.
fn counts(samples: &Samples, i: usize) -> bool {
    matches!(samples.part[i], Part::Train | Part::Validation)
}

/// Excess of a model, by cell: 1 - measured / model, with twice the standard error, of the cells with enough passes.
/// `friction` is the measured one and the model's of a sample, None where it does not count.
fn excess(
    samples: &Samples,
    cells: &[Option<Cell>],
    friction: impl Fn(usize) -> Option<(f64, f64)>,
) -> Vec<(Cell, f64)> {
    let mut passes: BTreeMap<Cell, Vec<(f64, f64)>> = BTreeMap::new();
    let mut last: Option<(Cell, u32)> = None;
    for (i, cell) in cells.iter().enumerate() {
        let Some((cell, (measured, model))) = cell.zip(friction(i)) else {
            last = None;
            continue;
        };
        let sign = if cell.backward { -1.0 } else { 1.0 };
        let all = passes.entry(cell).or_default();
        if last != Some((cell, samples.run[i])) {
            all.push((0.0, 0.0));
        }
        if let Some(pass) = all.last_mut() {
            *pass = (pass.0 + sign * measured, pass.1 + sign * model);
        }
        last = Some((cell, samples.run[i]));
    }
    let enough = passes.into_iter().filter(|(_, passes)| passes.len() >= PASSES);
    enough.filter_map(|(cell, passes)| Some((cell, of_passes(&passes)?))).collect()
}

/// 1 - measured / model over passes, with twice its standard error. None where the model has no friction against the
/// motion.
fn of_passes(passes: &[(f64, f64)]) -> Option<f64> {
    let measured: f64 = passes.iter().map(|pass| pass.0).sum();
    let model: f64 = passes.iter().map(|pass| pass.1).sum();
    let ratio = measured / model;
    let n = passes.len() as f64;
    let left: f64 = passes.iter().map(|pass| (pass.0 - ratio * pass.1).powi(2)).sum();
    let error = (left * n / (n - 1.0)).sqrt() / model;
    (model > 0.0).then_some(1.0 - ratio + DEVIATIONS * error)
}

/// The uncertainty of a model: the largest excess over all motions that were left out, each by the model that was
/// fitted without it, and of the image over all that identification saw. None for a recording of one motion, which
/// tells nothing about others, and for one whose cells have too few passes.
pub(super) fn uncertainty(
    samples: &Samples,
    folds: &Folds,
    physical: &Identified,
    image: &[(f64, f64)],
) -> Option<Uncertainty> {
    if !folds.motions {
        return None;
    }
    let cells = cells(samples);
    let mut all: Vec<(Cell, f64, &str)> = Vec::new();
    for (fold, fit) in physical.folds.iter().enumerate() {
        let left_out = |i: usize| {
            folds.leaves_out(fold, i).then(|| {
                let measured = samples.effort[i] - fit.rigid.effort(&rigid_state(samples, i));
                (measured, fit.friction.friction(&float_state(samples, i)))
            })
        };
        let name = folds.names[fold].as_str();
        all.extend(excess(samples, &cells, left_out).into_iter().map(|(cell, excess)| (cell, excess, name)));
    }
    let whole = |i: usize| Some((samples.effort[i] - physical.rigid_effort(samples, i), image[i].0 + image[i].1));
    all.extend(excess(samples, &cells, whole).into_iter().map(|(cell, excess)| (cell, excess, "")));
    let (cell, most, left_out) = all.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let without = if left_out.is_empty() { String::new() } else { format!(", {left_out} left out") };
    Some(Uncertainty {
        value: (100.0 * most.clamp(LEAST, 1.0)).ceil() / 100.0,
        worst: format!("{}{without}", cell.name()),
        cells: all.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four runs to and fro at two speeds, with friction of `factor` times one in every pass backward and fast.
    fn samples() -> Samples {
        let mut samples = Samples::default();
        for run in 0..4u32 {
            for velocity in [0.3, -0.3, 1.0, -1.0] {
                for _ in 0..20 {
                    samples.velocity.push(velocity);
                    samples.run.push(run);
                    samples.time.push(0.01 * samples.time.len() as f64);
                    samples.part.push(Part::Train);
                }
            }
        }
        samples
    }

    fn worst(samples: &Samples, friction: impl Fn(usize) -> Option<(f64, f64)>) -> (Cell, f64) {
        let all = excess(samples, &cells(samples), friction);
        all.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
    }

    #[test]
    fn the_cell_in_which_the_model_states_most_too_much_counts_with_twice_its_standard_error() {
        let samples = samples();
        let model = |i: usize| samples.velocity[i].signum();
        let backward_fast = |i: usize| samples.velocity[i] < -0.5;
        let (cell, excess) = worst(&samples, |i| Some((model(i) * if backward_fast(i) { 0.7 } else { 1.0 }, model(i))));
        assert!(cell.backward && cell.speed == SPEEDS.len(), "{cell:?}");
        assert!((excess - 0.3).abs() < 1e-9, "{excess}");
        assert_eq!(cell.name(), "backward at 70 % of the greatest speed");
        // The same mean with runs that scatter by a tenth: half of it is the standard error of four passes' mean.
        let scatter = |i: usize| if samples.run[i].is_multiple_of(2) { 0.1 } else { -0.1 };
        let (_, excess) = worst(&samples, |i| Some((model(i) * (0.7 + scatter(i)), model(i))));
        let error = 0.1 * (4.0f64 / 3.0).sqrt() / 2.0;
        assert!((excess - (0.3 + 2.0 * error)).abs() < 1e-9, "{excess}");
    }

    #[test]
    fn three_passes_tell_nothing_and_four_do() {
        let samples = samples();
        let of = |runs: u32| {
            let seen = |i: usize| (samples.run[i] < runs).then_some((0.5 * samples.velocity[i], samples.velocity[i]));
            excess(&samples, &cells(&samples), seen).len()
        };
        assert_eq!((of(3), of(4)), (0, 4));
    }

    #[test]
    fn more_friction_than_the_models_is_no_excess_and_friction_with_the_motion_is_told_by_nothing() {
        assert!(of_passes(&[(1.2, 1.0); 4]).unwrap() < 0.0);
        assert_eq!(of_passes(&[(1.0, -1.0); 4]), None);
    }

    #[test]
    fn loads_that_drive_and_brake_are_told_apart_and_creep_does_not_count() {
        let mut samples = samples();
        samples.load = samples.run.iter().map(|run| if run % 2 == 0 { 5.0 } else { 0.0 }).collect();
        samples.velocity[0] = 0.049;
        samples.velocity[1] = 0.051;
        let cells = cells(&samples);
        assert_eq!(cells[0], None);
        assert_eq!(cells[1].unwrap().load, Load::Driving);
        assert_eq!(cells[20].unwrap().load, Load::Braking);
        assert_eq!(cells[80].unwrap().load, Load::Small);
    }
}
