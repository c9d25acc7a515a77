//! Gaps of a recording: points of the trained box in cells that no sample visits; host.
//!
//! Most of a box is empty: a trajectory visits few pairs of position and velocity. Between the samples a network may
//! take any value, up to many times the friction. So it is trained towards nothing there, which leaves the physical
//! model: points are drawn evenly from the box, those in a cell that a sample visits are left out, and the others join
//! the samples with the target 0.

use crate::network::{INPUTS, InputBox};
use crate::train::TrainingSet;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::collections::HashSet;

/// Cells of the box along each active input.
const CELLS: f64 = 12.0;
/// Points for each sample.
const SHARE: f64 = 0.5;

/// The samples, and points where there is none, with the target 0.
pub(super) fn with_uncovered(
    inputs: Vec<[f64; INPUTS]>,
    targets: Vec<f64>,
    input_box: &InputBox,
    seed: u64,
) -> TrainingSet {
    let points = points(&inputs, input_box, (SHARE * inputs.len() as f64) as usize, seed);
    let mut set = TrainingSet::unweighted(inputs, targets);
    for point in points {
        set.inputs.push(point);
        set.targets.push(0.0);
        set.weights.push(1.0);
    }
    set
}

/// Points of the box, at most `count`, in cells that none of the samples visits.
fn points(samples: &[[f64; INPUTS]], input_box: &InputBox, count: usize, seed: u64) -> Vec<[f64; INPUTS]> {
    let visited: HashSet<[i8; INPUTS]> = samples.iter().map(|sample| cell(sample, input_box)).collect();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let active = input_box.active();
    let (low, high) = (input_box.low(), input_box.high());
    let drawn = (0..2 * count).map(|_| {
        let mut point = *low;
        for input in (0..INPUTS).filter(|&input| active[input]) {
            point[input] += random.random::<f64>() * (high[input] - low[input]);
        }
        point
    });
    drawn.filter(|point| !visited.contains(&cell(point, input_box))).take(count).collect()
}

/// The cell of a point, along the active inputs.
fn cell(point: &[f64; INPUTS], input_box: &InputBox) -> [i8; INPUTS] {
    let (low, high) = (input_box.low(), input_box.high());
    std::array::from_fn(|input| match input_box.active()[input] {
        true => ((point[input] - low[input]) / (high[input] - low[input]) * CELLS).clamp(0.0, CELLS - 1.0) as i8,
        false => 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const USED: [bool; INPUTS] = [true, true, false, false, false];

    /// Position and velocity along a circle, temperature rising.
    fn circle() -> Vec<[f64; INPUTS]> {
        let sample = |i: i32| {
            let angle = f64::from(i) * 0.01;
            [2.0 * angle.cos(), angle.sin(), 0.0, 0.0, 20.0 + angle]
        };
        (0..1000).map(sample).collect()
    }

    #[test]
    fn points_lie_in_cells_of_the_box_that_no_sample_visits() {
        let inputs = circle();
        let input_box = InputBox::around(&inputs, USED).unwrap();
        let set = with_uncovered(inputs.clone(), vec![1.0; inputs.len()], &input_box, 7);
        let added = &set.inputs[inputs.len()..];
        assert_eq!(added.len(), inputs.len() / 2);
        let visited: HashSet<_> = inputs.iter().map(|sample| cell(sample, &input_box)).collect();
        for point in added {
            assert!(point[0].abs() <= 2.0 && point[1].abs() <= 1.0 && !visited.contains(&cell(point, &input_box)));
        }
        let inside = added.iter().filter(|point| (point[0] / 2.0).hypot(point[1]) < 0.8).count();
        assert!(inside > added.len() / 2, "{inside}");
        assert!(set.targets[inputs.len()..].iter().all(|target| *target == 0.0));
        assert_eq!(
            (set.targets[..inputs.len()].to_vec(), set.weights.len()),
            (vec![1.0; inputs.len()], set.inputs.len())
        );
    }

    #[test]
    fn a_box_that_is_visited_everywhere_gets_no_points() {
        let grid: Vec<[f64; INPUTS]> =
            (0..10_000).map(|i| [f64::from(i % 100), f64::from(i / 100), 0.0, 0.0, 0.0]).collect();
        let input_box = InputBox::around(&grid, USED).unwrap();
        assert_eq!(with_uncovered(grid.clone(), vec![0.0; grid.len()], &input_box, 7).inputs.len(), grid.len());
    }
}
