//! Slope of the network over one scaled input, for every input in the box.
//!
//! The slope is the sum over all paths through the layers of the weights and of the slopes of tanh in the three neurons on the
//! way: the sum over k of t1_k (sum over j of w1_kj t0_j w0_j) (sum over i of w3_i t2_i w2_ik), with t0, t1, t2 the slopes of tanh in
//! layers 0, 1, 2. It is linear in each of these 15, so within their intervals it is largest and smallest at ends: 32
//! combinations in layer 0, 32 in layer 2, and in layer 1 each neuron's end is known by itself. Intervals taken from layer
//! to layer, with the box bisected 9 times, give bounds that are twice as wide at many times the cost.

use super::interval::Interval;
use crate::friction::network::{NEURONS, NetworkParameters, Neuron};
use crate::friction::smooth::TANH;

/// Fraction bits of slopes.
pub(super) const FRACTION_BITS: u32 = 20;
/// Combinations of the two ends of each neuron's interval in a layer.
const COMBINATIONS: usize = 1 << NEURONS;
/// Combinations of layer 2 that are kept at a time: all would be 2.5 KiB of stack, and what is computed again for each part is little.
const AT_ONCE: usize = 8;

/// Slope over a scaled input in units of the network's output, Q20. `tanh_slopes`: per layer and neuron, Q14.
#[inline(never)]
pub(super) fn over_input(
    parameters: &NetworkParameters,
    tanh_slopes: &[[Interval; NEURONS]; 3],
    input: usize,
) -> Interval {
    let [tanh_0, tanh_1, tanh_2] = tanh_slopes;
    let mut steepest: Option<Interval> = None;
    for part in 0..COMBINATIONS / AT_ONCE {
        let mut behind = [[Interval::ZERO; NEURONS]; AT_ONCE];
        for (combination, place) in behind.iter_mut().enumerate() {
            *place = behind_layer_1(parameters, &ends(tanh_2, part * AT_ONCE + combination));
        }
        for combination in 0..COMBINATIONS {
            let before = before_layer_1(parameters, &ends(tanh_0, combination), input);
            for behind in &behind {
                let mut slope = Interval::ZERO;
                for ((before, behind), own) in before.iter().zip(behind).zip(tanh_1) {
                    let others = before.times_here(*behind).shift_right_here(FRACTION_BITS);
                    slope = slope.add_here(others.times_share(*own));
                }
                let slope = slope.shift_right(14);
                steepest = Some(steepest.map_or(slope, |steepest| steepest.union(slope)));
            }
        }
    }
    steepest.unwrap_or_default()
}

/// One end of each interval, the upper one where the combination has a bit.
fn ends(intervals: &[Interval; NEURONS], combination: usize) -> [i64; NEURONS] {
    let mut bits = combination;
    intervals.map(|interval| {
        let upper = bits & 1 == 1;
        bits >>= 1;
        if upper { interval.high } else { interval.low }
    })
}

/// Slopes of the sums of layer 1 over the input, Q20.
fn before_layer_1(parameters: &NetworkParameters, tanh_0: &[i64; NEURONS], input: usize) -> [Interval; NEURONS] {
    let mut active = [Interval::ZERO; NEURONS];
    for ((place, weights), tanh) in active.iter_mut().zip(&parameters.first).zip(tanh_0) {
        // Weight Q26 times tanh slope Q14.
        *place = Interval::point(weights[input] as i64 * tanh).shift_right(26 + 14 - FRACTION_BITS);
    }
    let [layer_1, _] = &parameters.hidden;
    layer_1.each_ref().map(|neuron| weighted(neuron, &active))
}

/// Slopes of the output over the activations of layer 1, Q20.
fn behind_layer_1(parameters: &NetworkParameters, tanh_2: &[i64; NEURONS]) -> [Interval; NEURONS] {
    let [_, layer_2] = &parameters.hidden;
    let mut slopes = [Interval::ZERO; NEURONS];
    for ((neuron, weight), tanh) in layer_2.iter().zip(parameters.output.weights).zip(tanh_2) {
        // Weight times tanh slope Q14.
        let over_sum = Interval::point((weight as i64 * tanh) << (FRACTION_BITS - 14))
            .shift_right(parameters.output.fraction as u32);
        for (place, weight) in slopes.iter_mut().zip(neuron.weights) {
            let over_activation = over_sum.times(Interval::point(weight as i64)).shift_right(neuron.fraction as u32);
            *place = place.add(over_activation);
        }
    }
    slopes
}

/// Weighted sum of slopes.
#[inline(never)]
fn weighted(neuron: &Neuron, slopes: &[Interval; NEURONS]) -> Interval {
    let mut sum = Interval::ZERO;
    for (weight, slope) in neuron.weights.iter().zip(slopes) {
        sum = sum.add_here(slope.times_here(Interval::point(*weight as i64)));
    }
    sum.shift_right(neuron.fraction as u32)
}

/// Slopes of the tanh table, Q14, over an interval of arguments in Q25.
///
/// The slope falls with the distance from zero, up to the rounding of the knots: one unit of Q15 on either side of a step.
pub(super) fn of_tanh(sum: Interval) -> Interval {
    const ROUNDING: i64 = 32;
    let step = |end: i64| (end >> 20).clamp(-256, 255);
    let (low, high) = (step(sum.low), step(sum.high));
    let slope = |step: i64| TANH[(step + 256) as usize & 511] as i16 as i64;
    let steepest = if low > 0 {
        slope(low)
    } else if high < 0 {
        slope(high)
    } else {
        slope(0).max(slope(-1))
    };
    let flattest = slope(low).min(slope(high));
    Interval { low: (flattest - ROUNDING).max(0), high: (steepest + ROUNDING).min(16384) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tanh_slopes_are_bounded_over_every_interval_of_the_table() {
        let slope = |step: i64| TANH[(step + 256) as usize] as i16 as i64;
        for first in -256i64..256 {
            let mut exact = Interval::point(slope(first));
            for last in first..256 {
                exact = exact.union(Interval::point(slope(last)));
                let bound = of_tanh(Interval { low: first << 20, high: (last << 20) + (1 << 20) - 1 });
                assert!(bound.contains(exact), "steps {first} to {last}: {exact:?} not in {bound:?}");
            }
        }
        let beyond = of_tanh(Interval { low: i32::MIN as i64, high: -(8 << 25) });
        assert_eq!(beyond, Interval { low: 0, high: 32 });
    }

    #[test]
    fn a_slope_is_bounded_by_the_exact_one_where_every_tanh_has_one_slope() {
        let mut parameters = NetworkParameters::default();
        for (j, row) in parameters.first.iter_mut().enumerate() {
            row[3] = (j as i32 - 2) << 26;
        }
        let neuron = |k: i16| Neuron { weights: core::array::from_fn(|j| (j as i16 + k - 3) << 12), fraction: 12 };
        parameters.hidden = [core::array::from_fn(|k| neuron(k as i16)), core::array::from_fn(|k| neuron(-(k as i16)))];
        parameters.output = neuron(1);
        let flat = [[Interval::point(1 << 14); NEURONS]; 3];
        // With tanh of slope one the network is the product of its matrices.
        let mut row = parameters.first.map(|row| row[3] as i64 >> 26);
        for layer in &parameters.hidden {
            row = layer.each_ref().map(|neuron| (0..NEURONS).map(|j| (neuron.weights[j] as i64 >> 12) * row[j]).sum());
        }
        let exact: i64 = (0..NEURONS).map(|j| (parameters.output.weights[j] as i64 >> 12) * row[j]).sum();
        assert_ne!(exact, 0);
        assert_eq!(over_input(&parameters, &flat, 3), Interval::point(exact << FRACTION_BITS));
        assert_eq!(over_input(&parameters, &flat, 1), Interval::ZERO);
    }
}
