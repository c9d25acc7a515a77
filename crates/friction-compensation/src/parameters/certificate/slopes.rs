//! Slope of the network over one scaled input, for every input in the box.
//!
//! The slope is the sum over all paths through the layers of the weights and of the slopes of tanh in the three neurons
//! on the way: the sum over k of t1_k (sum over j of w1_kj t0_j w0_j) (sum over i of w3_i t2_i w2_ik), with t0, t1, t2
//! the slopes of tanh in layers 0, 1, 2. It is linear in each of these 15, so within their intervals it is largest and
//! smallest at ends: 32 combinations in layer 0, 32 in layer 2, and in layer 1 each neuron's end is known by itself.
//! Intervals taken from layer to layer, with the box bisected 9 times, give bounds that are twice as wide at many times
//! the cost.

use super::interval::Interval;
use crate::friction::network::{INPUTS, NEURONS, NetworkParameters};
use crate::friction::smooth::TANH;

/// Fraction bits of slopes.
pub(super) const FRACTION_BITS: u32 = 20;
/// Combinations of the two ends of each neuron's interval in a layer.
const COMBINATIONS: usize = 1 << NEURONS;
/// A layer's last neuron. Places are held to it, which they never exceed, so that no access can panic.
const LAST: usize = NEURONS - 1;
/// Combinations of layer 2 that are kept at a time: all would be 2.5 KiB of stack, and what is computed again for each
/// part is little.
const AT_ONCE: usize = 4;

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
        let mut layers_before = Before::new(parameters, tanh_0, input);
        for combination in 0..COMBINATIONS {
            if combination > 0 {
                layers_before.flip(combination.trailing_zeros() as usize);
            }
            let before = layers_before.slopes();
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

/// Slopes of the sums of layer 1 over the input, for one combination of ends of layer 0's intervals after the other:
/// each differs from the one before in one end (the reflected binary code of F. Gray, US patent 2,632,058), so that
/// five products are new instead of 25.
struct Before<'a> {
    parameters: &'a NetworkParameters,
    tanh_0: &'a [Interval; NEURONS],
    input: usize,
    /// Neurons that are at the upper end: a bit each.
    upper: usize,
    /// Sums before the shift by a neuron's fraction. Below 2^44, so that nothing saturates.
    sums: [Interval; NEURONS],
}

impl<'a> Before<'a> {
    /// All at the lower end.
    #[inline(never)]
    fn new(parameters: &'a NetworkParameters, tanh_0: &'a [Interval; NEURONS], input: usize) -> Self {
        let mut before = Self { parameters, tanh_0, input, upper: 0, sums: [Interval::ZERO; NEURONS] };
        for (neuron, tanh) in tanh_0.iter().enumerate() {
            before.add(neuron, before.active(neuron, tanh.low));
        }
        before
    }

    /// Slope of a neuron's activation over the input, Q20.
    fn active(&self, neuron: usize, tanh: i64) -> Interval {
        // Weight Q26 times tanh slope Q14.
        let weight = self.parameters.first[neuron.min(LAST)][self.input.min(INPUTS)];
        Interval::point(weight as i64 * tanh).shift_right(26 + 14 - FRACTION_BITS)
    }

    fn add(&mut self, neuron: usize, change: Interval) {
        let [layer_1, _] = &self.parameters.hidden;
        for (sum, next) in self.sums.iter_mut().zip(layer_1) {
            let Interval { low, high } = change.scaled(next.weights[neuron.min(LAST)]);
            *sum = Interval { low: sum.low + low, high: sum.high + high };
        }
    }

    /// Takes a neuron to its other end.
    #[inline(never)]
    fn flip(&mut self, neuron: usize) {
        self.upper ^= 1 << neuron;
        let Interval { low, high } = self.tanh_0[neuron.min(LAST)];
        let (old, new) = if self.upper >> neuron & 1 == 1 { (low, high) } else { (high, low) };
        let (old, new) = (self.active(neuron, old), self.active(neuron, new));
        // Ends of sums and of changes: not an interval, since they fall as well.
        self.add(neuron, Interval { low: new.low - old.low, high: new.high - old.high });
    }

    /// Q20.
    fn slopes(&self) -> [Interval; NEURONS] {
        let [layer_1, _] = &self.parameters.hidden;
        let mut slopes = self.sums;
        for (slope, neuron) in slopes.iter_mut().zip(layer_1) {
            *slope = slope.shift_right_here(neuron.fraction as u32);
        }
        slopes
    }
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

/// Slopes of the tanh table, Q14, over an interval of arguments in Q25.
///
/// The slope falls with the distance from zero, up to the rounding of the knots: one unit of Q15 on either side of a
/// step.
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
    use crate::friction::network::Neuron;

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

    #[test]
    fn the_bounds_are_the_extremes_over_all_ends_of_all_neurons() {
        let mut seed = 7u32;
        let mut random = |magnitude: i32| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as i32 % (2 * magnitude) - magnitude
        };
        for _ in 0..20 {
            let mut parameters = NetworkParameters::default();
            parameters.first.iter_mut().flatten().for_each(|weight| *weight = random(1 << 22) << 6);
            for neuron in parameters.hidden.iter_mut().flatten().chain([&mut parameters.output]) {
                *neuron = Neuron { weights: core::array::from_fn(|_| random(1 << 14) as i16), fraction: 13 };
            }
            let tanh_slopes: [[Interval; NEURONS]; 3] = core::array::from_fn(|_| {
                core::array::from_fn(|_| Interval::between(8192 + random(8192) as i64, 8192 + random(8192) as i64))
            });
            let weight = |neuron: &Neuron, j: usize| neuron.weights[j] as f64 / 8192.0;
            let (mut low, mut high) = (f64::MAX, f64::MIN);
            for ends in 0..1 << (3 * NEURONS) {
                let tanh = |layer: usize, j: usize| {
                    let Interval { low, high } = tanh_slopes[layer][j];
                    (if ends >> (layer * NEURONS + j) & 1 == 1 { high } else { low }) as f64 / 16384.0
                };
                let mut row: [f64; NEURONS] =
                    core::array::from_fn(|j| parameters.first[j][2] as f64 / (1u64 << 26) as f64 * tanh(0, j));
                for (layer, neurons) in parameters.hidden.iter().enumerate() {
                    row = core::array::from_fn(|k| {
                        tanh(layer + 1, k) * (0..NEURONS).map(|j| weight(&neurons[k], j) * row[j]).sum::<f64>()
                    });
                }
                let slope: f64 = (0..NEURONS).map(|j| weight(&parameters.output, j) * row[j]).sum();
                (low, high) = (low.min(slope), high.max(slope));
            }
            let bound = over_input(&parameters, &tanh_slopes, 2);
            let unit = (1u64 << FRACTION_BITS) as f64;
            let (bound_low, bound_high) = (bound.low as f64 / unit, bound.high as f64 / unit);
            // Rounded outwards, at each of some thirty additions by a unit.
            assert!(bound_low <= low && low - bound_low < 1e-3, "{bound_low}, exact {low}");
            assert!(bound_high >= high && bound_high - high < 1e-3, "{bound_high}, exact {high}");
        }
    }
}
